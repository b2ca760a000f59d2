"""Scalar signals at which a control loop is cut for its margins: rotors, torques,
drives, measurements.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skyarm.algebra import Quaternion
from skyarm.records.arrays import Array, doubles, float_array
from skyarm.records.immutable import immutable
from skyarm.vehicle import Rotor, Vehicle

COMMANDS, MEASUREMENTS = "commands", "measurements"

WRENCH = (
    "roll torque",
    "pitch torque",
    "yaw torque",
    "thrust",
    "forward force",
    "sideways force",
)
"""Directions of the rotors' wrench, named by base axes; flat layouts have the first
four."""

VECTORS = {
    "position": 3,
    "quaternion": 4,
    "velocity": 3,
    "rate": 3,
    "specific_force": 3,
}
"""Number of components of a measurement's fields after its time, in order, before those
of the joints."""

NAMES = {"quaternion": "attitude", "specific_force": "acceleration"}
"""Groups with another name than the measurement's field."""


@immutable(eq=False)
class LoopChannel:
    """Scalar signal at which the loop is cut for a margin, as a direction in the
    command or measurement vector.

    Attributes:
        name: name of the direction. group: group of channels that are cut together.
            port: "commands" or "measurements".
        reads: size of the signal in a command or a measurement.
        enters: a command or a measurement of size 1 in this direction alone.
    """

    name: str
    group: str
    port: str
    reads: Array
    enters: Array


def single(
    names: Sequence[str], group: str, port: str, size: int, first: int = 0
) -> list[LoopChannel]:
    """Cut points at consecutive entries of a command or measurement vector of length
    ``size``.
    """
    rows = np.eye(size)[first : first + len(names)]
    return _channels(names, group, port, rows, rows)


def _channels(
    names: Sequence[str], group: str, port: str, reads: Array, enters: Array
) -> list[LoopChannel]:
    """Cut points in several directions, a row of ``reads`` and ``enters`` (directions,
    size) for each.
    """
    return [
        LoopChannel(name=name, group=group, port=port, reads=read, enters=entered)
        for name, read, entered in zip(names, reads, enters, strict=True)
    ]


def vehicle_channels(
    vehicle: Vehicle, speeds: Sequence[float], attitude: Quaternion
) -> tuple[LoopChannel, ...]:
    """Signals at which a vehicle's loop is cut: rotors, body torques and thrust, joint
    drives, measurements.

    Args:
        vehicle: rotors and joints.
        speeds: rotor commands at the instant, rad/s: thrust grows with their square.
        attitude: base to world at the instant: the attitude is cut in rotations about
            the base's axes.
    """
    rotors = len(vehicle.rotors)
    joints = vehicle.joint_names
    size = rotors + len(joints)
    channels = single(
        [f"rotor {rotor.name}" for rotor in vehicle.rotors], "rotors", COMMANDS, size
    )
    channels += _pushes(vehicle.rotors, doubles(speeds), size)
    channels += single(
        [f"drive {name}" for name in joints], "joints", COMMANDS, size, rotors
    )
    return (
        *channels,
        *_measured_channels(joints, [rotor.name for rotor in vehicle.rotors], attitude),
    )


def wrenches(rotors: Sequence[Rotor]) -> Array:
    """Allocation matrix (6, rotors) per squared speed; rows: torque xyz about the base
    origin, then force z, x, y.
    """
    columns = []
    for rotor in rotors:
        force = float_array(rotor.axis) * float(rotor.thrust_coefficient)
        drag = -float(rotor.direction) * float(rotor.moment_coefficient) * force
        torque = np.cross(float_array(rotor.position), force) + drag
        columns.append([*torque, force[2], force[0], force[1]])
    return np.array(columns).reshape(len(rotors), 6).T


def _pushes(rotors: Sequence[Rotor], speeds: Array, size: int) -> list[LoopChannel]:
    """Cut points at body torques and thrust; also at lateral force if the rotors span
    all six axes.
    """
    B = wrenches(rotors)
    lengths = np.linalg.norm(B, axis=1, keepdims=True)
    # no rotor pushes in this direction: its row stays zero
    lengths[lengths == 0.0] = 1.0
    scaled = B / lengths
    # rows have unit length: 1e-6 is far above rounding, and far below a push that
    # counts
    axes = 6 if np.linalg.matrix_rank(scaled, tol=1e-6) == 6 else 4
    # the thrust of a rotor that stands has no slope
    if (
        np.linalg.matrix_rank(scaled[:axes], tol=1e-6) < axes
        or not (speeds > 0.0).all()
    ):
        return []
    # thrust goes with the square of the speed, so its slope is twice the speed
    slope = 2.0 * speeds
    reads = scaled[:axes] * slope
    enters = np.linalg.pinv(scaled[:axes]) / slope[:, None]
    # a push moves no joint
    none = np.zeros((axes, size - len(speeds)))
    return _channels(
        WRENCH[:axes],
        "pushes",
        COMMANDS,
        np.hstack([reads, none]),
        np.hstack([enters.T, none]),
    )


def _measured_channels(
    joints: Sequence[str], rotors: Sequence[str], attitude: Quaternion
) -> list[LoopChannel]:
    """Cut points at a measurement, one per entry except for time."""
    size = 1 + sum(VECTORS.values()) + 2 * len(joints) + len(rotors)
    channels: list[LoopChannel] = []
    place = 1
    for field, count in VECTORS.items():
        group = NAMES.get(field, field)
        names = [f"{group} {axis}" for axis in "xyz"]
        if field == "quaternion":
            channels += _rotations(names, group, size, place, attitude)
        else:
            channels += single(names, group, MEASUREMENTS, size, place)
        place += count
    for group, names in (
        ("joint positions", [f"position of {name}" for name in joints]),
        ("joint rates", [f"rate of {name}" for name in joints]),
        ("rotor speeds", [f"speed of {name}" for name in rotors]),
    ):
        channels += single(names, group, MEASUREMENTS, size, place)
        place += len(names)
    return channels


def _rotations(
    names: Sequence[str], group: str, size: int, place: int, attitude: Quaternion
) -> list[LoopChannel]:
    """Cut points at a measured attitude: small rotations about the base's axes."""
    w, x, y, z = map(float, attitude)
    # columns of length 1/2: four times the transpose inverts it
    Q = 0.5 * np.array([[-x, -y, -z], [w, -z, y], [z, w, -x], [-y, x, w]])
    enters = np.zeros((len(names), size))
    enters[:, place : place + 4] = Q.T
    return _channels(names, group, MEASUREMENTS, 4.0 * enters, enters)
