"""The strongest steady wind in which the vehicle can hold its place."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from skyarm.actuation import rotor_forces
from skyarm.actuation.hover import highest_thrust
from skyarm.algebra import ZERO3, Vec3
from skyarm.assess.arm_poses import Array
from skyarm.assess.finding import NOTE, OK, WARNING, Finding
from skyarm.assess.thrust_margin import ENOUGH
from skyarm.environment import body_drag
from skyarm.vehicle.vehicle_records import Vehicle

STRONGEST = 60.0
"""m/s: a hurricane; no more is looked for."""

BREEZE = 2.0
"""m/s: light air outdoors."""

HEADINGS = 12
"""Horizontal directions from which the wind is tried."""

SPEEDS, REFINED, ITERATIONS = 31, 4, 30
"""Speeds of a grid, grids one within a step of the other, and iterations on the tilt (halved each time)."""


def largest_wind(vehicle: Vehicle, gravity: float, payload: float = 0.0) -> list[Finding]:
    """Largest steady horizontal wind, from the worst side, in which tilted thrust balances weight and drag.

    The drag is that of the airframe and the rotors of the vehicle's file; the arm has none there.
    """
    question = "largest steady wind"
    weight = (float(vehicle.mass) + payload) * gravity
    top = float(highest_thrust(vehicle)) / ENOUGH
    if not math.isfinite(top):
        return [Finding(question=question, level=NOTE, text="not known: a rotor has no max_speed")]
    force = math.sqrt(max(top * top - weight * weight, 0.0))
    if not _has_drag(vehicle):
        text = f"not known: the vehicle states no drag; its thrust holds {force:.3g} N of side force"
        remedy = "state drag.area or rotors.drag_coefficient"
        return [
            Finding(question=question, level=NOTE, text=text, field="drag.area", value=force, unit="N", remedy=remedy)
        ]
    speed = _largest_speed(vehicle, weight, top)
    level = OK if speed >= BREEZE else WARNING
    more = " or more" if speed >= STRONGEST else ""
    return [
        Finding(
            question=question,
            level=level,
            text=f"{speed:.3g} m/s{more} from the worst side; its thrust holds {force:.3g} N of side force",
            field="drag.area, rotors.drag_coefficient",
            value=speed,
            limit=BREEZE,
            unit="m/s",
            remedy="" if level == OK else "more thrust margin, or less drag",
        )
    ]


def _has_drag(vehicle: Vehicle) -> bool:
    coefficients = [*vehicle.drag.area, *(rotor.drag_coefficient for rotor in vehicle.rotors)]
    return any(float(each) for each in coefficients)


def _largest_speed(vehicle: Vehicle, weight: float, top: float) -> float:
    """Wind (m/s) from the worst side at which the thrust that holds against it reaches ``top``."""
    headings = 2.0 * math.pi * np.arange(HEADINGS) / HEADINGS
    low, high = 0.0, STRONGEST
    for _ in range(REFINED):
        speeds = np.linspace(low, high, SPEEDS)
        grid = np.repeat(speeds, HEADINGS)
        thrust = thrust_in_wind(vehicle, grid, np.tile(headings, SPEEDS), weight)[0].reshape(SPEEDS, HEADINGS)
        beyond = np.max(thrust, axis=1) > top
        if not beyond.any():
            return high
        first = int(np.argmax(beyond))
        low, high = (float(speeds[max(first - 1, 0)]), float(speeds[first]))
    return low


def thrust_in_wind(vehicle: Vehicle, speed: Array, heading: Array, weight: float) -> tuple[Array, Array]:
    """Thrust (N) and tilt (rad) with which a vehicle stays in horizontal winds, found by iterating on the tilt.

    Args:
        vehicle: its drag.
        speed: of the winds (lanes,), m/s.
        heading: in which they blow (lanes,), rad.
        weight: N.
    """
    tilt, thrust = np.zeros_like(speed), np.full_like(speed, weight)
    for _ in range(ITERATIONS):
        side, up = drag_in_wind(vehicle, speed, heading, tilt, thrust)
        # thrust along the tilted axis balances the drag and what it leaves of the weight
        vertical = weight - up
        tilt = 0.5 * (tilt + np.arctan2(side, vertical))
        thrust = 0.5 * (thrust + np.hypot(side, vertical))
    return thrust, tilt


def drag_in_wind(vehicle: Vehicle, speed: Array, heading: Array, tilt: Array, thrust: Array) -> tuple[Array, Array]:
    """Drag of airframe and rotors along the wind and up, N, of a vehicle tilted into it; rotors share the thrust."""
    c, s, cos, sin = np.cos(heading), np.sin(heading), np.cos(tilt), np.sin(tilt)
    # the world's axes along the wind and up, in those of a base whose thrust leans against the wind
    along, up = Vec3(c * cos, s * cos, -sin), Vec3(c * sin, s * sin, cos)
    share = np.sqrt(np.clip(thrust / float(highest_thrust(vehicle)), 0.0, 1.0))
    speeds = [float(rotor.max_speed) * share for rotor in vehicle.rotors]
    # a table changes the thrust, which is taken out again, and not the drag
    rotors = tuple(dataclasses.replace(rotor, table=None) for rotor in vehicle.rotors)
    moving, still = (rotor_forces(rotors, speeds, velocity, ZERO3).force for velocity in (along * -speed, ZERO3))
    total = body_drag(vehicle.drag, along * -speed) + moving - still
    return np.asarray(total.dot(along), dtype=float) + 0.0 * speed, np.asarray(total.dot(up), dtype=float) + 0.0 * speed
