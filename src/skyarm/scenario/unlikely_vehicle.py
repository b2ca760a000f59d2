"""Numbers of a vehicle that are allowed and hardly meant: other units, as a rule. They are told of, never refused.

The bounds are generous: tens of times what flying robots have, and less than the factors between units (57.3 degrees a
radian, 9.55 rev/min a rad/s, 1000 grams a kilogram, 1000 millimetres a metre, 10 000 kg cm^2 a kg m^2).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from skyarm.actuation.hover import highest_thrust
from skyarm.scenario.unlikely_drives import unlikely_in_drives, unlikely_in_supply
from skyarm.vehicle.linkage import BASE, Body
from skyarm.vehicle.vehicle_records import Vehicle

TURN = 2.0 * math.pi * 1.001
"""rad: a turn, as files round it."""

MARGINS = 0.05, 20.0
"""Highest thrust over weight: racing drones reach 15, and less than a twentieth is no vehicle that flies."""

EARTH = 9.81
"""m/s^2."""

HEAVIEST = 300.0
"""kg: a quadrotor of 0.7 kg written in grams weighs more."""

FARTHEST = 10.0
"""m from one part to the next: an arm of 15 mm written in millimetres is longer."""

SLOWEST = 1.0
"""s: time constants of rotors are some hundredths."""

LONGEST_MOMENT_ARM = 0.5
"""m: drag torque over thrust of a rotor is about a tenth of its radius."""

STRONGEST = 10_000.0
"""N m or N of a joint."""

GYRATION = 3.0
"""Radius of gyration over the vehicle's extent: a body within it has less than 1; in kg cm^2 it has 100 times more."""

OUTSIDE = 3.0
"""Distance of the base's centre of mass over that of its rotors: within an airframe it is less than 1."""

SMALLEST = 0.05
"""m: least extent that is taken for a vehicle's, so that a body without a described size is not suspected."""


def unlikely_in_vehicle(vehicle: Vehicle) -> tuple[str, ...]:
    """Lines about numbers that are probably in other units; empty for a vehicle without any."""
    return (
        *_masses(vehicle),
        *_joints(vehicle),
        *unlikely_in_drives(vehicle),
        *_rotors(vehicle),
        *unlikely_in_supply(vehicle),
        *_lengths(vehicle),
    )


def _masses(vehicle: Vehicle) -> Iterator[str]:
    mass = float(vehicle.mass)
    if mass > HEAVIEST:
        yield f"mass = {mass:g} kg: is that of a car; kg, not g?"
    extent = max([SMALLEST, *(_norm(where) for _, where in _places(vehicle))])
    extent = max(extent, sum(_norm(link.joint.position) for link in vehicle.links))
    for name, body in (("base", vehicle.base), *((f"links[{link.name}]", link.body) for link in vehicle.links)):
        radius = _gyration(body)
        if math.isinf(radius):
            yield f"{name}.mass = 0 kg: has an inertia of {_largest(body):g} kg m^2 without a mass; kg?"
        elif radius > GYRATION * extent:
            yield (
                f"{name}.inertia = {_largest(body):g} kg m^2: is that of its {float(body.mass):g} kg {radius:.3g} m "
                f"away, and the vehicle reaches {extent:.3g} m; kg m^2, not kg cm^2 or g mm^2?"
            )


def _joints(vehicle: Vehicle) -> Iterator[str]:
    for link in vehicle.links:
        joint, name = link.joint, f"joints[{link.joint.name}]"
        unit = "N m" if joint.kind == "revolute" else "N"
        for end in ("lower", "upper"):
            limit = float(getattr(joint, end))
            if joint.kind == "revolute" and TURN < abs(limit) < math.inf:
                yield f"{name}.{end} = {limit:g} rad: is more than a turn; rad, not degrees?"
            elif joint.kind != "revolute" and FARTHEST < abs(limit) < math.inf:
                yield f"{name}.{end} = {limit:g} m: is far; m, not mm?"
        if STRONGEST < float(joint.effort_limit) < math.inf:
            other = "N mm" if joint.kind == "revolute" else "mN"
            yield f"{name}.effort_limit = {float(joint.effort_limit):g} {unit}: is a crane's; {unit}, not {other}?"


def _rotors(vehicle: Vehicle) -> Iterator[str]:
    weight, top = float(vehicle.mass) * EARTH, float(highest_thrust(vehicle)) if vehicle.rotors else math.nan
    if vehicle.rotors and weight > 0.0 and top < math.inf:
        speeds = f"rotors: max_speed = {max(float(rotor.max_speed) for rotor in vehicle.rotors):g} rad/s"
        if top > MARGINS[1] * weight:
            hint = "rad/s, not rev/min? N s^2/rad^2 of thrust?"
            rows = [(rotor.name, rotor.table) for rotor in vehicle.rotors if rotor.table is not None]
            for name, table in rows[:1]:
                speeds = f"rotors[{name}].thrust_table.thrust = {table.thrust[-1]:g} N at {table.speed[-1]:g} rad/s"
                hint = "thrust in N, not g? speed in rad/s, not rev/min?"
            yield f"{speeds}: lifts {top / weight:.3g} times the weight; {hint}"
        elif 0.0 <= top < MARGINS[0] * weight:
            yield f"{speeds}: lifts {top / weight:.2g} of the weight; kg, not g? N s^2/rad^2, not N per (rev/min)^2?"
    for field, most, words in (
        ("time_constant_up", SLOWEST, "s: is slow; s, not ms?"),
        ("time_constant_down", SLOWEST, "s: is slow; s, not ms?"),
        ("moment_coefficient", LONGEST_MOMENT_ARM, "m: is drag torque over thrust, some centimetres; m, not mm?"),
    ):
        beyond = [rotor for rotor in vehicle.rotors if float(getattr(rotor, field)) > most]
        if beyond:
            # one cause as a rule: said once, with the largest
            worst = max(beyond, key=lambda rotor: float(getattr(rotor, field)))
            said, hint = words.split("; ")
            others = f" (and {len(beyond) - 1} more rotors)" if len(beyond) > 1 else ""
            yield f"rotors[{worst.name}].{field} = {float(getattr(worst, field)):g} {said}{others}; {hint}"


def _lengths(vehicle: Vehicle) -> Iterator[str]:
    for name, where in _places(vehicle):
        if _norm(where) > FARTHEST:
            yield f"{name} = {_norm(where):g} m away: is far; m, not mm?"
    hubs, com = max((_norm(rotor.position) for rotor in vehicle.rotors), default=math.inf), _norm(vehicle.base.com)
    if OUTSIDE * max(hubs, SMALLEST) < com <= FARTHEST:
        yield f"base.com = {com:g} m away: is far from a base whose rotors reach {hubs:.3g} m; m, not mm?"


def _places(vehicle: Vehicle) -> list[tuple[str, Any]]:
    """Names and positions of all that has one, each in the frame that it is fixed to."""
    found = [(f"rotors[{rotor.name}].position", rotor.position) for rotor in vehicle.rotors]
    found += [(f"joints[{link.joint.name}].position", link.joint.position) for link in vehicle.moving]
    found += [(f"frames[{frame.name}].position", frame.position) for frame in vehicle.frames]
    names = {BASE: "base"} | {i: f"links[{link.name}]" for i, link in enumerate(vehicle.moving)}
    return found + [(f"{names[i - 1]}.com", body.com) for i, body in enumerate(vehicle.bodies)]


def _norm(vector: Any) -> float:
    return math.hypot(*(float(c) for c in vector))


def _largest(body: Body) -> float:
    """Largest moment on the diagonal, kg m^2."""
    return max(float(body.inertia.xx), float(body.inertia.yy), float(body.inertia.zz))


def _gyration(body: Body) -> float:
    """Radius at which the body's mass would have its largest moment of inertia, m."""
    mass, moment = float(body.mass), _largest(body)
    return math.sqrt(max(moment, 0.0) / mass) if mass > 0.0 else (math.inf if moment > 0.0 else 0.0)
