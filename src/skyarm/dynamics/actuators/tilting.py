"""Rotors tilted by servos: servo lag, turned rotor axes, and equivalent pairs of fixed
rotors.

A force k s in the plane that a rotor turns in is linear in the pair (s cos a, s sin a)
of its squared speed s and angle a, and so are its torques, the drag torque included,
which stays along the turned axis. Here the pair stands in the basis of two axes, at the
ends of the angles in use: every force between them has two squared speeds of at least
0, so that allocation, priorities and limits of fixed rotors hold for it. Where the two
axes are perpendicular, the least sum of squares is that of the pairs. Source: Kamel et
al. 2018, The Voliro omniorientational hexacopter, IEEE Robotics and Automation Magazine
25(4), section Control allocation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from skyarm.algebra import Scalar, Scalars
from skyarm.algebra.scalars import (
    absolute,
    add,
    atan2,
    clip,
    cos,
    divide,
    exp,
    maximum,
    minimum,
    mul,
    sign,
    sin,
    sqrt,
    sub,
)
from skyarm.dynamics.actuators.command import Command
from skyarm.dynamics.actuators.rotor import push
from skyarm.records.immutable import positional
from skyarm.vehicle import Rotor, Vehicle
from skyarm.vehicle.tilt import Tilt

FASTEST = 1e9
"""Largest tilt rate (rad/s) in computations, for a servo without a limit."""


def angle_after(tilt: Tilt, angle: Scalar, setpoint: Scalar, dt: Scalar) -> Scalar:
    """Tilt angle (rad) of a rotor after ``dt`` seconds of a constant setpoint, with lag
    and rate limit.

    The rate is (setpoint - angle) / time_constant within +-max_rate: the angle moves at
    the largest rate until what is left is max_rate time_constant, then as a first-order
    lag. Both are solved exactly. The setpoint is limited to the servo's range.
    """
    goal = clip(setpoint, tilt.lower, tilt.upper)
    # an infinite rate times a time of 0 would be NaN
    rate = minimum(tilt.max_rate, FASTEST)
    error = sub(angle, goal)
    size = absolute(error)
    # time at the rate limit, until the lag alone is slower
    at_rate = clip(divide(sub(size, mul(rate, tilt.time_constant)), rate), 0.0, dt)
    left = mul(
        sub(size, mul(rate, at_rate)), exp(divide(sub(at_rate, dt), tilt.time_constant))
    )
    # no overshoot by rounding: the rest of the way is never negative
    return goal + mul(sign(error), maximum(left, 0.0))


def angles_after(
    vehicle: Vehicle, angles: Sequence[Scalar], setpoints: Sequence[Scalar], dt: Scalar
) -> Scalars:
    """Tilt angles (rad) of all tilting rotors after ``dt`` seconds of constant
    setpoints.
    """
    rows = zip(vehicle.tilts, angles, setpoints, strict=True)
    return tuple(
        angle_after(tilt, angle, setpoint, dt) for tilt, angle, setpoint in rows
    )


def turned_rotor(rotor: Rotor, angle: Scalar) -> Rotor:
    """Rotor with its axis turned about the tilt axis by an angle (rad)."""
    if rotor.tilt is None:
        return rotor
    axis = rotor.axis * cos(angle) + rotor.tilt.axis.cross(rotor.axis) * sin(angle)
    return replace(rotor, axis=axis, tilt=None)


def turn_rotors(vehicle: Vehicle, angles: Sequence[Scalar]) -> Vehicle:
    """Vehicle with the axes of its tilting rotors turned by given angles (rad)."""
    if not vehicle.tilts:
        return vehicle
    left = iter(angles)
    rotors = tuple(
        each if each.tilt is None else turned_rotor(each, next(left))
        for each in vehicle.rotors
    )
    # a rotation keeps the length of an axis, so nothing has to be checked again
    return vehicle.with_checked(rotors=rotors)


def with_rest(vehicle: Vehicle, command: Command) -> Command:
    """Command with tilt angles of zero where a vehicle has tilting rotors and the
    command gives no angles.
    """
    if not vehicle.tilts or command.tilts:
        return command
    return replace(command, tilts=(0.0,) * len(vehicle.tilts))


WIDEST = math.pi / 4.0
"""Largest used tilt angle (rad) to either side of rest, at which the axes of a pair are
perpendicular."""


@positional
class TiltedForce:
    """Force of one tilting rotor, given as squared rotor speed ((rad/s)^2) and tilt
    angle (rad).
    """

    push: Scalar
    angle: Scalar


def ends(tilt: Tilt) -> tuple[Scalar, Scalar]:
    """Angles (rad) of the two fixed axes that replace a tilting rotor in the control
    allocation.
    """
    return maximum(tilt.lower, -WIDEST), minimum(tilt.upper, WIDEST)


def as_pairs(vehicle: Vehicle) -> Vehicle:
    """Vehicle in which two fixed rotors replace each tilting rotor.

    Each of the two goes so far that both together give the rotor's largest thrust
    midway between them, and never more than it: at an end of the range that leaves 1 /
    (2 cos h) of it, h half the angle between them (0.71 at 45 deg).
    """
    if not vehicle.tilts:
        return vehicle
    rotors: list[Rotor] = []
    for each in vehicle.rotors:
        rotors += [each] if each.tilt is None else _pair(each, each.tilt)
    return replace(vehicle, rotors=tuple(rotors))


def _pair(rotor: Rotor, tilt: Tilt) -> list[Rotor]:
    low, high = ends(tilt)
    # length of the sum of both unit axes: the thrust of equal speeds midway
    both = mul(2.0, cos(mul(0.5, sub(high, low))))
    # hub drag is linear in the speeds, of which two make up for one
    share = mul(0.5, sqrt(both))
    rotors = []
    for mark, angle in (("low", low), ("high", high)):
        fixed = replace(
            turned_rotor(rotor, angle),
            name=f"{rotor.name} {mark}",
            max_speed=sqrt(divide(push(rotor, rotor.max_speed), both)),
            drag_coefficient=mul(rotor.drag_coefficient, share),
            rolling_moment_coefficient=mul(rotor.rolling_moment_coefficient, share),
            # spin is linear in the speed, and the two squared speeds of a pair add up
            inertia=0,
            table=None,
        )
        rotors.append(fixed)
    return rotors


def speeds_of_pairs(
    vehicle: Vehicle, speeds: Sequence[Scalar], angles: Sequence[Scalar]
) -> Scalars:
    """Speeds (rad/s) of the pairs of fixed rotors that give the force of tilting rotors
    at given angles.
    """
    pair_speeds: list[Scalar] = []
    left = iter(angles)
    for rotor, speed in zip(vehicle.rotors, speeds, strict=True):
        if rotor.tilt is None:
            pair_speeds.append(speed)
            continue
        angle = next(left)
        low, high = ends(rotor.tilt)
        # law of sines: the shares of two oblique axes
        square = mul(speed, speed)
        between = sin(sub(high, low))
        parts = sin(sub(high, angle)), sin(sub(angle, low))
        pair_speeds += [
            # an angle beyond the axes would need a negative square of one of them
            sqrt(maximum(divide(mul(square, part), between), 0.0))
            for part in parts
        ]
    return tuple(pair_speeds)


def forces_of_pairs(
    vehicle: Vehicle, speeds: Sequence[Scalar]
) -> tuple[TiltedForce, ...]:
    """Squared speeds and tilt angles of tilting rotors, from the speeds (rad/s) of
    their pairs of fixed rotors.
    """
    forces = []
    left = iter(speeds)
    for rotor in vehicle.rotors:
        first = next(left)
        if rotor.tilt is None:
            forces.append(TiltedForce(mul(first, first), 0))
            continue
        second = next(left)
        low, high = ends(rotor.tilt)
        a, b = mul(first, first), mul(second, second)
        along = add(mul(a, cos(low)), mul(b, cos(high)))
        across = add(mul(a, sin(low)), mul(b, sin(high)))
        size = sqrt(add(mul(along, along), mul(across, across)))
        forces.append(TiltedForce(size, atan2(across, along)))
    return tuple(forces)
