"""Measurement that a control law receives, and the full-state sensor with white
noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any

from skyarm.algebra import ZERO3_DATA, Mat3, Quaternion, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import add, data, mul
from skyarm.algebra.scalars.philox import normals
from skyarm.dynamics import State
from skyarm.dynamics.state import (
    BaseVelocity,
    JointPositions,
    JointRates,
    example_state,
)
from skyarm.records.coerce import absent
from skyarm.records.field_rules import checked
from skyarm.records.immutable import field_if_any, immutable
from skyarm.records.leaves import Tree, leaves
from skyarm.records.units import Unit, nonnegative
from skyarm.sensing.sensor import BasePosition, Sensor
from skyarm.vehicle import Vehicle


@immutable
class Image:
    """Depths that a camera or a lidar saw at one instant."""

    time: Annotated[Scalar, Unit("s", "time at which the picture was taken")]
    depth: Annotated[
        Scalars, Unit("m", "depth of each pixel, row by row from the top left")
    ]
    rows: Annotated[int, Unit("", "number of rows")]
    columns: Annotated[int, Unit("", "number of columns")]
    sensor: Annotated[str, Unit("", "name of the sensor")]


@immutable
@checked("measurement", often=True)
class Measurement:
    """Measurement that a control law receives: pose, velocities, specific force,
    joints, rotors.

    ``time`` is when it was taken: older than now if the measurement is delayed.
    """

    time: Annotated[Scalar, Unit("s", "time at which the measurement was taken")]
    position: BasePosition
    quaternion: Annotated[
        Quaternion, Unit("", "attitude as a unit quaternion w x y z, base to world")
    ]
    velocity: BaseVelocity
    rate: Annotated[Vec3, Unit("rad/s", "angular velocity by the gyroscope, base axes")]
    specific_force: Annotated[
        Vec3, Unit("m/s^2", "accelerometer, base axes, +g along z in hover")
    ]
    joints: JointPositions = ()
    joint_rates: JointRates = ()
    rotor_speeds: Annotated[
        Scalars, Unit("rad/s", "rotor speeds, unsigned, in the vehicle's order")
    ] = ()
    tilts: Annotated[Scalars, Unit("rad", "angles of the tilting rotors")] = (
        field_if_any(default=())
    )
    tip_force: Annotated[
        Scalars,
        Unit("N", "reading of the force sensor: force on the tip, axes of the tip"),
    ] = field_if_any(
        default=(),
    )
    switches: Annotated[
        Scalars, Unit("", "state of each tactile switch that phases wait for; 1 closed")
    ] = field_if_any(default=())
    holds: Annotated[
        Scalars, Unit("", "1 while a gripper at the tip reports a grasp")
    ] = field_if_any(default=())
    images: Annotated[
        tuple[Image, ...],
        Unit("", "newest picture of each camera that the law sees, in its order"),
    ] = field_if_any(default=())

    @property
    def rotation(self) -> Mat3:
        """Rotation from base axes to world axes."""
        return self.quaternion.rotation()


def blank_measurement(
    joints: int, rotors: int, tilts: int = 0, tip_force: int = 0
) -> Measurement:
    """Error-free measurement of a vehicle at rest and level at the origin, at time
    0.
    """
    blank = measurement_of(example_state(joints, rotors, tilts), ZERO3_DATA)
    return replace(blank, tip_force=(0.0,) * tip_force)


def measurement_of(state: State, specific_force: Vec3) -> Measurement:
    """Error-free measurement of a state at time 0; specific force in m/s^2, base
    axes.
    """
    # int zeros are structure: they cost no operation in compiled code
    nothing = [0] * noise_count(len(state.joints), len(state.rotor_speeds))
    return measure(SensorNoise(), 0.0, state, specific_force, nothing)


_NOISIER = "higher values make the measurement noisier"


@immutable
@checked("sensors")
class SensorNoise(Sensor):
    """Full-state sensor: the true state with white noise at the control rate.

    Its numbers are standard deviations, one sigma at the control rate; an int 0 folds
    the channel away.
    """

    position: Annotated[
        Scalar,
        nonnegative(
            "m",
            "standard deviation of the position noise, each world axis",
            usual=1.0,
            effect=_NOISIER,
        ),
    ] = 0
    velocity: Annotated[
        Scalar,
        nonnegative(
            "m/s",
            "standard deviation of the velocity noise, each world axis",
            usual=5.0,
            effect=_NOISIER,
        ),
    ] = 0
    attitude: Annotated[
        Scalar,
        nonnegative(
            "rad",
            "standard deviation of the attitude noise, a rotation vector in base axes",
            usual=0.5,
            effect=_NOISIER,
        ),
    ] = 0
    rate: Annotated[
        Scalar,
        nonnegative(
            "rad/s",
            "standard deviation of the angular velocity noise, each base axis",
            usual=5.0,
            effect=_NOISIER,
        ),
    ] = 0
    specific_force: Annotated[
        Scalar,
        nonnegative(
            "m/s^2",
            "standard deviation of the accelerometer noise, each base axis",
            usual=50.0,
            effect=_NOISIER,
        ),
    ] = 0
    joints: Annotated[
        Scalar,
        nonnegative(
            "rad or m",
            "standard deviation of the joint position noise",
            usual=0.5,
            effect=_NOISIER,
        ),
    ] = 0
    joint_rates: Annotated[
        Scalar,
        nonnegative(
            "rad/s or m/s",
            "standard deviation of the joint rate noise",
            usual=5.0,
            effect=_NOISIER,
        ),
    ] = 0
    rotor_speeds: Annotated[
        Scalar,
        nonnegative(
            "rad/s",
            "standard deviation of the rotor speed noise",
            usual=200.0,
            effect=_NOISIER,
        ),
    ] = 0

    def uniforms(self, vehicle: Vehicle) -> int:
        """Count of uniform random numbers per reading, even; 0 for a perfect sensor."""
        count = noise_count(vehicle.n, len(vehicle.rotors))
        # normals are made of pairs of uniforms (Box, Muller), so their count is even
        return count + count % 2 if leaves(self) else 0

    def measure(
        self,
        memory: Any,
        t: Scalar,
        state: State,
        specific_force: Vec3,
        draws: Sequence[Scalar],
        dt: float,
    ) -> tuple[Tree, Measurement]:
        """Reading of the state and specific force with white noise."""
        count = noise_count(len(state.joints), len(state.rotor_speeds))
        noise = normals(draws)[:count] if draws else [0] * count
        # where nothing pushes the reading is a structural zero
        proper = Vec3(*map(data, specific_force))
        return memory, measure(self, t, state, proper, noise)


def noise_count(joints: int, rotors: int) -> int:
    """Number of standard normal numbers in one reading of the full-state sensor."""
    # five vectors (position, velocity, attitude, rate, specific force), q, qd, speeds
    return 15 + 2 * joints + rotors


def measure(
    par: SensorNoise,
    time: Scalar,
    state: State,
    specific_force: Vec3,
    noise: Sequence[Scalar],
) -> Measurement:
    """Measurement of a state with noise of given standard deviations.

    Args:
        par: deviations.
        time: s, when it is taken.
        state: the truth.
        specific_force: specific force of the base origin, base axes, m/s^2.
        noise: :func:`noise_count` standard normal numbers; structural zeros for perfect
            sensors.

    Raises:
        ValueError: another number of draws.
    """
    count = noise_count(len(state.joints), len(state.rotor_speeds))
    if len(noise) != count:
        raise ValueError(
            f"noise has {len(noise)} numbers: must be {count}, one a channel"
        )
    # the order in which values are made below is that of the draws: a seed's flight
    # changes with it
    draws = iter(noise)

    def vector(sigma: Scalar) -> Vec3:
        return Vec3(*(mul(sigma, next(draws)) for _ in range(3)))

    def many(values: Sequence[Scalar], sigma: Scalar) -> Scalars:
        return tuple(add(value, mul(sigma, next(draws))) for value in values)

    position = state.position + vector(par.position)
    velocity = state.velocity + vector(par.velocity)
    turn = vector(par.attitude)
    tilted = (
        state.quaternion
        if all(map(absent, turn))
        else state.quaternion * Quaternion.of_rotation_vector(turn)
    )
    return Measurement(
        time=time,
        position=position,
        velocity=velocity,
        quaternion=tilted,
        rate=state.rate + vector(par.rate),
        specific_force=specific_force + vector(par.specific_force),
        joints=many(state.joints, par.joints),
        joint_rates=many(state.joint_rates, par.joint_rates),
        rotor_speeds=many(state.rotor_speeds, par.rotor_speeds),
        tilts=state.tilts,
    )
