"""Rotors turned by servos: the angle's lag, and a vehicle as its angles leave it."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from skyarm.actuation.command import Command
from skyarm.scalars import absolute, clip, cos, divide, exp, maximum, minimum, mul, sign, sin, sub
from skyarm.vehicle.tilt import Tilt
from skyarm.vehicle.vehicle_records import Rotor, Vehicle

FASTEST = 1e9
"""rad/s: the largest rate that is reckoned with."""


def angle_after(tilt: Tilt, angle: Any, setpoint: Any, dt: Any) -> Any:
    """Angle (rad) of a rotor's servo after ``dt`` seconds of a held setpoint.

    The rate is (setpoint - angle) / time_constant within +-max_rate: the angle moves at the largest rate until what is
    left is max_rate time_constant, then as a first-order lag. Both are solved exactly. The setpoint is limited to the
    servo's range.
    """
    goal = clip(setpoint, tilt.lower, tilt.upper)
    rate = minimum(tilt.max_rate, FASTEST)
    error = sub(angle, goal)
    size = absolute(error)
    at_rate = clip(divide(sub(size, mul(rate, tilt.time_constant)), rate), 0.0, dt)
    left = mul(sub(size, mul(rate, at_rate)), exp(divide(sub(at_rate, dt), tilt.time_constant)))
    return goal + mul(sign(error), maximum(left, 0.0))


def angles_after(vehicle: Vehicle, angles: Sequence[Any], setpoints: Sequence[Any], dt: Any) -> tuple[Any, ...]:
    """Angles (rad) of all servos of a vehicle after ``dt`` seconds of held setpoints."""
    rows = zip(vehicle.tilts, angles, setpoints, strict=True)
    return tuple(angle_after(tilt, angle, setpoint, dt) for tilt, angle, setpoint in rows)


def turned_rotor(rotor: Rotor, angle: Any) -> Rotor:
    """A rotor whose axis stands where its servo holds it: n cos a + (t x n) sin a, with t across n."""
    if rotor.tilt is None:
        return rotor
    axis = rotor.axis * cos(angle) + rotor.tilt.axis.cross(rotor.axis) * sin(angle)
    return dataclasses.replace(rotor, axis=axis, tilt=None)


def turned(vehicle: Vehicle, angles: Sequence[Any]) -> Vehicle:
    """The vehicle with its rotors' axes where the servos hold them; the same record where none tilts."""
    if not vehicle.tilts:
        return vehicle
    left = iter(angles)
    rotors = tuple(each if each.tilt is None else turned_rotor(each, next(left)) for each in vehicle.rotors)
    return vehicle.with_checked(rotors=rotors)


def with_rest(vehicle: Vehicle, command: Command) -> Command:
    """A command that says nothing of the vehicle's servos, with all of them at rest; any other as it is."""
    if not vehicle.tilts or command.tilts:
        return command
    return dataclasses.replace(command, tilts=(0.0,) * len(vehicle.tilts))
