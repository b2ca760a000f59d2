"""Model of one rotor: speed lag, thrust, drag torque, hub drag and rolling moment.

Source: Furrer, Burri, Achtelik, Siegwart 2016 (RotorS), gazebo_motor_model.cpp at
commit cd813b7a8c37. Left out: RotorS's delay of one physics step between a filtered
speed and its force.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.algebra import ZERO3, Force, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import (
    absolute,
    add,
    divide,
    exp,
    log,
    maximum,
    minimum,
    mul,
    same,
    sqrt,
    sub,
    where,
)
from skyarm.records.coerce import concrete
from skyarm.vehicle import Rotor


def speed_after(rotor: Rotor, speed: Scalar, command: Scalar, dt: Scalar) -> Scalar:
    """Rotor speed (rad/s) after ``dt`` seconds of a constant command, by the exact
    first-order lag.

    The approach is monotonic, so the time constant (up or down) cannot change while the
    command is held. The command is limited to the rotor's highest speed; the loop has
    raised it to the least one (:func:`least_raised`).
    """
    # limited before the lag: the speed approaches its limit and never passes it
    target = minimum(command, rotor.max_speed)
    rising, falling = (
        exp(divide(-dt, tau))
        for tau in (rotor.time_constant_up, rotor.time_constant_down)
    )
    return target + (speed - target) * where(target > speed, rising, falling)


def speeds_after(
    rotors: Sequence[Rotor],
    speeds: Sequence[Scalar],
    commands: Sequence[Scalar],
    dt: Scalar,
) -> Scalars:
    """Speeds (rad/s) of all rotors after ``dt`` seconds of constant commands."""
    rows = zip(rotors, speeds, commands, strict=True)
    return tuple(
        speed_after(rotor, speed, command, dt) for rotor, speed, command in rows
    )


SHORT_LAG, SHORT_THROUGH_ZERO = 2e-3, 7e-3
"""Time constants (s) below which Simpson's rule over a step of 5 ms may err by more
than 1 % of a commanded change of thrust; the second for a reversible rotor, whose w |w|
is not smooth at 0."""


LEAST_LAG = 1e-3
"""Least equivalent lag over the true one: where it would be less there is only
rounding."""


def short_lag(rotor: Rotor) -> float:
    """Time constant (s) of a rotor below which its thrust has its exact impulse."""
    return SHORT_THROUGH_ZERO if rotor.reversible else SHORT_LAG


def has_short_lag(rotor: Rotor) -> bool:
    """True if a time constant of a rotor is below ``short_lag``, or may be."""
    lags = rotor.time_constant_up, rotor.time_constant_down
    return not concrete(*lags) or min(lags) < short_lag(rotor)


def lag_of(rotor: Rotor, speed: Scalar, command: Scalar) -> Scalar:
    """Time constant (s) by which a rotor follows a command (rad/s) from a speed
    (rad/s).
    """
    target = minimum(command, rotor.max_speed)
    return where(target > speed, rotor.time_constant_up, rotor.time_constant_down)


def equivalent_speed_and_lag(
    rotor: Rotor, speed: Scalar, command: Scalar, dt: Scalar
) -> tuple[Scalar, Scalar]:
    """Constant speed (rad/s) and lag (s) by which a rotor's thrust and spin have their
    impulse of a step.

    With w = T + D e, e = exp(-t / tau), the integral of w^2 from e = 1 on is tau (-T^2
    ln e + 2 T D (1 - e) + D^2 (1 - e^2) / 2); the thrust of a reversible rotor turns
    round where e = -T / D. The speed is the signed root of the mean of w |w|; with the
    lag its mean acceleration is that of w. Of a step of 0 s both are as they are.

    Args:
        rotor: its lags.
        speed: at the begin, rad/s.
        command: rad/s.
        dt: length of the step, s.
    """
    target = minimum(command, rotor.max_speed)
    lag = lag_of(rotor, speed, command)
    change = speed - target
    share = divide(lag, dt)
    passed = divide(dt, lag)
    end = exp(-passed)

    def squares(e: Scalar, lags: Scalar) -> Scalar:
        """Integral of w^2 until e, which takes so many lags, over the step."""
        return share * (
            target * target * lags
            + change * (1.0 - e) * (2.0 * target + 0.5 * change * (1.0 + e))
        )

    mean = squares(end, passed)
    if rotor.reversible:
        # the thrust w |w| changes its sign within the step: integrate in two pieces
        through = target * speed < 0.0
        zero = maximum(
            where(through, divide(-target, where(through, change, 1.0)), 0.0), end
        )
        mean = 2.0 * squares(zero, -log(zero)) - mean
        mean = where(where(through, speed, speed + target) < 0.0, -mean, mean)
    equivalent = _with_sign(rotor, mean, sqrt(absolute(mean)))
    gap = change * share * (end - 1.0)
    # a rotor that keeps its speed has no gap, and any lag does
    turns = absolute(gap) > 0.0
    ratio = where(
        turns,
        maximum(divide(target - equivalent, where(turns, gap, 1.0)), LEAST_LAG),
        1.0,
    )
    # a step of 0 s would divide by 0
    return where(dt > 0.0, equivalent, speed), where(dt > 0.0, lag * ratio, lag)


def rotor_force(rotor: Rotor, speed: Scalar, velocity: Vec3) -> Force:
    """Force of a rotor on the base: torque about and force at the base origin, base
    axes.

    Args:
        rotor: pose and coefficients.
        speed: rad/s, negative of a reversible rotor that turns backwards.
        velocity: velocity of the hub against the air, base axes, m/s.

    thrust k_f W |W| along the axis; drag torque k_m thrust against the direction of
    rotation; hub drag -c_d |W| v_perp; rolling moment -c_r |W| v_perp, with v_perp the
    velocity in the rotor's plane, times the direction of rotation where it is signed:
    backwards both the advancing side and the lift change, and it stays.
    """
    return _group_force([(rotor, speed, 1)], [ZERO3], velocity, ZERO3).at_origin(
        rotor.position
    )


def rotor_forces(
    rotors: Sequence[Rotor],
    speeds: Sequence[Scalar],
    velocity: Vec3,
    rate: Vec3,
    effectiveness: Sequence[Scalar] = (),
) -> Force:
    """Total force and torque of all rotors on the base, about the base origin, base
    axes.

    Rotors with one axis and one set of coefficients are summed before their
    coefficients enter, about a point that has what their positions have in common.

    Args:
        rotors: poses and coefficients.
        speeds: rad/s, negative only of a reversible rotor.
        velocity: velocity of the base origin against the air, base axes, m/s.
        rate: angular velocity of the base, base axes, rad/s.
        effectiveness: share of each rotor's forces and torques that is left; all whole
            if left out.
    """
    total = Force(ZERO3, ZERO3)
    # equal rotors share products with their coefficients, which saves operations
    left = list(zip(rotors, speeds, effectiveness or (1,) * len(rotors), strict=True))
    while left:
        first = left[0][0]
        group = [pair for pair in left if _similar(pair[0], first)]
        left = [pair for pair in left if not _similar(pair[0], first)]
        coordinates = zip(*(rotor.position for rotor, *_ in group), strict=True)
        center = Vec3(
            *(
                # a common coordinate, as one height of all hubs, then folds out of the
                # arms
                c if all(same(c, other) for other in rest) else 0
                for c, *rest in coordinates
            )
        )
        beside = [_offset(rotor.position, center) for rotor, *_ in group]
        hub = _group_force(group, beside, velocity + rate.cross(center), rate)
        total = total + hub.at_origin(center)
    return total


Turning = tuple[Rotor, Scalar, Scalar]
"""Rotor, its speed (rad/s) and its effectiveness."""


def _offset(position: Vec3, center: Vec3) -> Vec3:
    """Position relative to ``center``, with a constant zero where both have the same
    coordinate.
    """
    return Vec3(
        *(0 if same(a, b) else a for a, b in zip(position, center, strict=True))
    )


def _similar(a: Rotor, b: Rotor) -> bool:
    """True if two rotors have the same axis and the same coefficients."""

    def numbers(rotor: Rotor) -> Scalars:
        drags = (rotor.drag_coefficient, rotor.rolling_moment)
        return (*rotor.axis, rotor.thrust_coefficient, rotor.moment_coefficient, *drags)

    # each rotor's own table is evaluated for it, whose sums are alike by the
    # coefficients
    return all(map(same, numbers(a), numbers(b)))


def push(rotor: Rotor, speed: Scalar) -> Any:
    """Effective squared rotor speed, (rad/s)^2: thrust over thrust coefficient,
    negative backwards.
    """
    return _with_sign(
        rotor, speed, speed * speed if rotor.table is None else rotor.table.push(speed)
    )


def _with_sign(rotor: Rotor, speed: Scalar, value: Scalar) -> Scalar:
    """Value with the sign of the speed of a reversible rotor; of any other as it is."""
    return where(speed < 0.0, -value, value) if rotor.reversible else value


def speed_size(rotor: Rotor, speed: Scalar) -> Scalar:
    """Size |W| of a rotor's speed, rad/s; only a reversible rotor has a negative
    one.
    """
    return absolute(speed) if rotor.reversible else speed


def require_speeds(
    rotors: Sequence[Rotor], speeds: Sequence[Scalar], field: str
) -> None:
    """Refuse stated rotor speeds (rad/s) out of the range of their rotors; NaN passes,
    and ends a flight.

    Raises:
        ValueError: one line with the rotor and its range.
    """
    for i, (rotor, speed) in enumerate(zip(rotors, speeds, strict=True)):
        # NaN compares false, so it passes and ends a flight as diverged
        if concrete(speed, rotor.max_speed) and (
            speed < rotor.min_speed or speed > rotor.max_speed
        ):
            allowed = (
                f"must be from {rotor.min_speed:g} to {rotor.max_speed:g} rad/s, the"
                " range of rotor"
            )
            cure = (
                ""
                if speed > 0.0 or rotor.reversible
                else "; one that turns backwards states reversible = true"
            )
            raise ValueError(
                f"{field}[{i}] = {speed!r}: {allowed} {rotor.name!r}{cure}"
            )


def least_raised(rotors: Sequence[Rotor], commands: Sequence[Scalar]) -> Scalars:
    """Speed commands (rad/s) raised to the least speed of each rotor: a motor that is
    not reversible stops there.
    """
    return tuple(
        maximum(command, rotor.min_speed)
        for rotor, command in zip(rotors, commands, strict=True)
    )


def speed_of_push(rotor: Rotor, value: Scalar) -> Scalar:
    """Rotor speed (rad/s) of an effective squared speed, the inverse of
    :func:`push`.
    """
    size = absolute(value) if rotor.reversible else value
    speed = (
        sqrt(maximum(size, 0.0))
        if rotor.table is None
        else rotor.table.speed_of_push(size)
    )
    return _with_sign(rotor, value, speed)


def spin_torque(
    rotors: Sequence[Rotor],
    speeds: Sequence[Scalar],
    commands: Sequence[Scalar],
    rate: Vec3,
) -> Vec3:
    """Reaction torque (N m, base axes) on the base by accelerating and gyroscopic
    rotors.

    The spin h = J direction W n of each is part of the angular momentum: the base feels
    -dh/dt = -J direction (dW/dt n + W w x n), with dW/dt of the lag. Source: Hughes
    1986, Spacecraft Attitude Dynamics, section 3.4, of gyrostats.

    Args:
        rotors: axes, directions and inertia.
        speeds: rad/s, now.
        commands: rad/s; empty for rotors that keep their speed.
        rate: angular velocity of the base, base axes, rad/s.
    """
    total = ZERO3
    # rotors without inertia are structure: no lag enters the equations
    if all(same(rotor.inertia, 0) for rotor in rotors):
        return total
    for rotor, speed, command in zip(rotors, speeds, commands or speeds, strict=True):
        target = minimum(command, rotor.max_speed)
        lag = lag_of(rotor, speed, command)
        # the drag torque against the air is in rotor_forces already
        spin = mul(rotor.inertia, rotor.direction)
        turned = rate.cross(rotor.axis) * speed + rotor.axis * divide(
            target - speed, lag
        )
        total = total - turned * spin
    return total


def _group_force(
    group: Sequence[Turning], positions: Sequence[Vec3], velocity: Vec3, rate: Vec3
) -> Force:
    """Total torque and force about the origin of rotors that differ in position and
    direction of rotation only.

    v_perp = v - (v.n) n is written so that a structural axis leaves two components.
    """
    like = group[0][0]
    n = like.axis
    # sums of effective W^2, of it against the direction of rotation, of r by it
    pushing: Scalar = 0
    twist: Scalar = 0
    arm = ZERO3
    # sums of W v_perp and of r x (W v_perp)
    drag, drag_arm = ZERO3, ZERO3
    for (rotor, speed, left), r in zip(group, positions, strict=True):
        square = mul(left, push(rotor, speed))
        turning = (
            square
            if rotor.table is None
            else mul(left, _with_sign(rotor, speed, rotor.table.twist(speed)))
        )
        pushing = add(pushing, square)
        twist = sub(twist, mul(rotor.direction, turning))
        arm = arm + r * square
        # a double cross product, since v - (v.n) n keeps a third component
        slip = n.cross(velocity + rate.cross(r)).cross(n) * mul(
            left, speed_size(rotor, speed)
        )
        drag = drag + slip
        drag_arm = drag_arm + r.cross(slip)
    k, c = like.thrust_coefficient, like.drag_coefficient
    force = n * mul(k, pushing) - drag * c
    torque = arm.cross(n) * k + n * mul(mul(k, like.moment_coefficient), twist)
    return Force(torque - drag_arm * c - drag * like.rolling_moment, force)
