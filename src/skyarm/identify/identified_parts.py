"""Vehicle records and flight surroundings built from identified parameters."""

from __future__ import annotations

import copy
import re
from collections.abc import Mapping
from dataclasses import fields
from itertools import accumulate
from typing import Any, TypeVar

import numpy as np

from skyarm.algebra import Scalar, Sym3, Vec3
from skyarm.dynamics.actuators.servo import PositionServo
from skyarm.identify.unknowns import DRAG_HEIGHT, KNOTS, rises_of_thrust, second_moments
from skyarm.records.immutable import immutable
from skyarm.records.leaves import leaves, rebuild
from skyarm.vehicle import Body, BodyDrag, Joint, Link, MountedDrive, Rotor, Vehicle
from skyarm.vehicle.thrust_table import ThrustTable

R = TypeVar("R", Rotor, Link, Body, Joint, PositionServo, MountedDrive, BodyDrag)

SCALED = (
    "thrust_coefficient",
    "moment_coefficient",
    "time_constant_up",
    "time_constant_down",
)
"""Positive parameters of a rotor; those of all rotors keep the proportions of the start
vehicle."""

FRICTIONS = ("damping", "coulomb", "coulomb_rate", "armature")
"""Friction parameters of a joint that may be identified."""

OF_SERVOS = ("stiffness", "damping", "integral", "latency", "speed_limit")
"""Parameters of a joint's position servo that may be identified."""

LEAST_0 = re.compile(
    r"rotors\.(inertia|drag_coefficient)|drag\.area\..|.+\.(latency|joint\.(damping|coulomb))"
)
"""Pattern of parameters that no vehicle has below 0, where noise may put them in a
search without bounds."""


@immutable
class IdentifiedSurroundings:
    """Delays, sensor position and offsets of a flight, identified together with the
    vehicle.

    Attributes:
        delay: s, dead time from a rotor's command to the measured rates.
        joint_delay: s, dead time from a joint's torque to the measured rates.
        accelerometer_delay: s, of the accelerometer behind the gyroscope.
        pose_delay: s, of the pose behind the gyroscope.
        gyro_bias: rad/s, base axes.
        place: m, of the inertial unit in the base frame.
        offset: m/s^2, of the accelerometer.
        torque: N m, constant, base axes.
        sag: thrust over that of the curve is the relative voltage to this power.
        drift: 1/s, relative change of the thrust, from the flight's take-off on.
        thrust: over that of the first flight, at the take-offs; 1 where the voltage is
            known.
        setpoint_hold: share of a sample's period that servos average their setpoints
            over, from 0, at once, to 1, as of plants of skyarm, whose own loop is slow;
            half where nothing says which.
    """

    delay: float = 0.0
    joint_delay: float = 0.0
    accelerometer_delay: float = 0.0
    pose_delay: float = 0.0
    gyro_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    torque: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sag: float = 0.0
    drift: float = 0.0
    thrust: float = 1.0
    setpoint_hold: float = 0.5


def vehicle_with(
    start: Vehicle, numbers: Mapping[str, Scalar], *, checked: bool = False
) -> Vehicle:
    """Vehicle with identified parameters and unchanged total mass.

    Args:
        start: the rest.
        numbers: values by name of the unknown; any scalars where they are not checked.
        checked: whether its records are checked: a search passes through what no
            vehicle is.

    Raises:
        ValueError: one line, if checked: no vehicle has such numbers.
    """
    if checked:
        numbers = {
            name: max(value, 0.0) if LEAST_0.fullmatch(name) else value
            for name, value in numbers.items()
        }
    links = tuple(_link(each, numbers) for each in start.links)
    # flights show forces per mass only, so that the base bears what the links change
    mass = start.base.mass
    for now, before in zip(links, start.links, strict=True):
        mass = mass - (now.body.mass - float(before.body.mass))
    inertia = _inertia(start.base, numbers)
    made = start.with_checked(
        base=with_changes(
            start.base,
            mass=mass,
            com=_vector("base.com", start.base.com, numbers),
            inertia=of_a_body(inertia) if checked else inertia,
        ),
        rotors=tuple(_rotor(start.rotors[0], each, numbers) for each in start.rotors),
        links=links,
        drag=with_changes(
            start.drag, area=_vector("drag.area", start.drag.area, numbers)
        ),
        drives=tuple(_drive(each, numbers) for each in start.drives),
    )
    # a record that is made anew checks its numbers
    return rebuild(made, iter(leaves(made))) if checked else made


def _vector(name: str, usual: Vec3, numbers: Mapping[str, Scalar]) -> Vec3:
    """Vector whose components are identified, or as usual."""
    return Vec3(
        *(numbers.get(f"{name}.{axis}", getattr(usual, axis)) for axis in "xyz")
    )


THIN = 1e-3
"""Least principal second moment of mass of a body, as a fraction of the sum of the
three: that of a square plate a twentieth as thick as wide; chosen."""


def of_a_body(inertia: Sym3) -> Sym3:
    """Nearest physically possible inertia: principal second moments of mass not below a
    fraction of their sum.

    Moments that were found beside one that stays at the start's may add up to what no
    body has.
    """
    xx, yy, zz, xy, xz, yz = map(float, inertia.entries)
    rows = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    second = 0.5 * np.trace(rows) * np.eye(3) - rows
    sizes, axes = np.linalg.eigh(second)
    least = THIN * float(np.trace(second))
    if sizes[0] >= least:
        return inertia
    second = axes @ np.diag(np.maximum(sizes, least)) @ axes.T
    moments = np.trace(second) * np.eye(3) - second
    return Sym3(
        *(
            float(moments[i, j])
            for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
        )
    )


def with_changes(record: R, **changes: Any) -> R:
    """Copy of a dataclass record with changed fields, whose values are not checked.

    A search passes through what no vehicle is.
    """
    changed = copy.copy(record)  # which runs no checks
    for name, value in changes.items():
        object.__setattr__(changed, name, value)
    return changed


def _rotor(first: Rotor, rotor: Rotor, numbers: Mapping[str, Scalar]) -> Rotor:
    """Rotor with identified parameters: those of the first rotor, scaled by the
    original ratio of the two rotors.
    """
    changes: dict[str, Scalar | Vec3 | ThrustTable] = {}
    for name in SCALED:
        if f"rotors.{name}" in numbers:
            # the ratio first: of alike rotors it is exactly 1, and the number is the
            # one that is reported
            changes[name] = numbers[f"rotors.{name}"] * (
                float(getattr(rotor, name)) / float(getattr(first, name))
            )
    for name in ("inertia", "drag_coefficient"):
        if f"rotors.{name}" in numbers:
            changes[name] = numbers[f"rotors.{name}"]
    if DRAG_HEIGHT in numbers:
        x, y, z = rotor.position
        changes["position"] = Vec3(x, y, z + numbers[DRAG_HEIGHT])
    table = _table(first, numbers)
    if table is not None:
        changes |= {"table": table, "thrust_coefficient": table.thrust_coefficient}
    return with_changes(rotor, **changes)


def _link(link: Link, numbers: Mapping[str, Scalar]) -> Link:
    """Link with identified parameters."""
    name, body = f"links.{link.name}", link.body
    # one factor on all moments, as the shape of a link is that of its drawing
    scale = numbers.get(f"{name}.inertia", 1.0)
    moved = with_changes(
        body,
        mass=numbers.get(f"{name}.mass", body.mass),
        com=_vector(f"{name}.com", body.com, numbers),
        inertia=Sym3(
            *(getattr(body.inertia, each.name) * scale for each in fields(Sym3))
        ),
    )
    frictions = {
        k: numbers[at] for k in FRICTIONS if (at := f"{name}.joint.{k}") in numbers
    }
    return with_changes(link, body=moved, joint=with_changes(link.joint, **frictions))


def _drive(mounted: MountedDrive, numbers: Mapping[str, Scalar]) -> MountedDrive:
    """Joint drive with identified parameters."""
    changes = {
        k: numbers[at]
        for k in OF_SERVOS
        if (at := f"drives.{mounted.name}.{k}") in numbers
    }
    if not changes or not isinstance(mounted.drive, PositionServo):
        return mounted
    return with_changes(mounted, drive=with_changes(mounted.drive, **changes))


def _table(first: Rotor, numbers: Mapping[str, Scalar]) -> ThrustTable | None:
    """Thrust curve of the rotors from identified thrust increments; None if they are
    not identified.
    """
    rises = [numbers[name] for name in rises_of_thrust() if name in numbers]
    if not rises:
        return None
    speeds = tuple(share * float(first.max_speed) for share in KNOTS)
    return ThrustTable(speed=speeds, thrust=tuple(accumulate(rises)))


def _inertia(base: Body, numbers: Mapping[str, Scalar]) -> Sym3:
    """Inertia of the base from its second moments of mass and products of inertia."""
    at = {
        axis: numbers.get(f"base.second_moment.{axis}", moment)
        for axis, moment in zip("xyz", second_moments(base), strict=True)
    }
    products = {
        axis: numbers.get(f"base.inertia.{axis}", getattr(base.inertia, axis))
        for axis in ("xy", "xz", "yz")
    }
    return Sym3(
        xx=at["y"] + at["z"], yy=at["x"] + at["z"], zz=at["x"] + at["y"], **products
    )


def surroundings_with(numbers: Mapping[str, float]) -> IdentifiedSurroundings:
    """Delays and offsets around a vehicle from identified parameters, with defaults for
    missing ones.
    """
    usual = IdentifiedSurroundings()
    return rebuild(
        usual, (numbers.get(name, value) for name, value in _by_name(usual).items())
    )


def numbers_around(about: IdentifiedSurroundings) -> dict[str, float]:
    """Delays and offsets of the surroundings by parameter name, without the thrust
    factor of a single flight.
    """
    numbers = _by_name(about)
    del numbers["thrust"]
    return numbers


def _by_name(about: IdentifiedSurroundings) -> dict[str, float]:
    """All parameters of the surroundings by name, in the order of the record's
    fields.
    """
    numbers = dict[str, float]()
    for each in fields(about):
        value = getattr(about, each.name)
        parts = zip("xyz", value, strict=True) if isinstance(value, tuple) else ()
        numbers |= {f"{each.name}.{axis}": part for axis, part in parts} or {
            each.name: value
        }
    return numbers
