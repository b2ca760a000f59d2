"""Reference governor of the safety layer: errors bounded so that commanded tilt, climb and speed stay bounded.

A wrapper sees neither the law's attitude loop nor its gains, but it may move the reference. With the law taken for
a = stiffness e_p + damping e_v + a_ref, the errors and a_ref are scaled together, which keeps the balance of pull and
brake; a reference within the limits passes as it is, bit for bit.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from skyarm.algebra import Vec3
from skyarm.algebra.scalars import (
    Scalar,
    absolute,
    add,
    clip,
    divide,
    logical_or,
    maximum,
    minimum,
    mul,
    sqrt,
    sub,
    tan,
    where,
)
from skyarm.control.model import Model
from skyarm.control.safety.limits import Limits
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement

TINY = 1e-9
"""m, m/s or m/s^2 added to a length that divides."""


def govern_base(
    reference: Reference,
    measurement: Measurement,
    *,
    limits: Limits,
    stiffness: Scalar,
    damping: Scalar,
    gravity: Scalar,
) -> Reference:
    """The reference with position, velocity and acceleration as far from the measurement as the limits allow.

    1. No faster than ``speed``. 2. A position error pulls no harder than that speed brakes. 3. The acceleration asked
    stays within ``climb`` and, level, within tan(tilt) times the specific force along the vertical. 4. Errors within
    ``step`` and ``step_speed`` pass all the same: a stiff law bounds its own answer to those.
    """
    v_d = _limit_length(reference.velocity, limits.speed)
    pull = _limit_length(reference.position - measurement.position, divide(mul(limits.speed, damping), stiffness))
    brake = v_d - measurement.velocity
    asked = pull * stiffness + brake * damping + reference.acceleration
    rise = minimum(1.0, divide(limits.climb, absolute(asked.z) + TINY))
    room = mul(tan(limits.tilt), add(gravity, mul(rise, asked.z)))
    level = minimum(1.0, divide(room, sqrt(asked.x * asked.x + asked.y * asked.y) + TINY))
    least = minimum(1.0, divide(limits.step, _length(pull) + TINY))
    least = minimum(least, divide(limits.step_speed, _length(brake) + TINY))
    level, rise = maximum(level, least), maximum(rise, least)
    shares = Vec3(level, level, rise)
    far = _longer(reference.position - measurement.position, pull)
    fast = _longer(reference.velocity, v_d)
    bound = [logical_or(logical_or(share < 1.0, far), fast) for share in shares]

    def where_bound(new: Vec3, old: Vec3) -> Vec3:
        return Vec3(*(where(c, a, b) for c, a, b in zip(bound, new, old, strict=True)))

    return dataclasses.replace(
        reference,
        position=where_bound(measurement.position + pull.hadamard(shares), reference.position),
        velocity=where_bound(measurement.velocity + brake.hadamard(shares), reference.velocity),
        acceleration=where_bound(reference.acceleration.hadamard(shares), reference.acceleration),
        # a reference that moves with the measurement has no higher derivatives
        jerk=where_bound(Vec3(0.0, 0.0, 0.0), reference.jerk),
        snap=where_bound(Vec3(0.0, 0.0, 0.0), reference.snap),
    )


def _length(v: Vec3) -> Any:
    return sqrt(v.x * v.x + v.y * v.y + v.z * v.z)


def _limit_length(v: Vec3, longest: Scalar) -> Vec3:
    """A vector no longer than ``longest``; the same bits if it is not."""
    length = _length(v)
    share = divide(longest, length + TINY)
    return Vec3(*(where(length > longest, mul(c, share), c) for c in v))


def _longer(v: Vec3, shortened: Vec3) -> Any:
    """True where the second is a shortened first."""
    return _length(shortened) < _length(v)


def govern_joints(
    reference: Reference,
    before: Sequence[Any],
    ramping: Sequence[Scalar],
    speeds: Sequence[Scalar],
    steps: Sequence[Scalar],
    dt: Scalar,
    *,
    model: Model,
    limits: Limits,
) -> tuple[Reference, tuple[Scalar, ...]]:
    """Joint references inside the joints' limits and no faster than ``speeds`` beyond ``steps``; else as it is.

    Args:
        reference: wanted.
        before: rad or m, where the governed references stood one period ago.
        ramping: 1 for a joint whose reference was on its way.
        speeds: rad/s or m/s, on the way.
        steps: rad or m; a gap up to this is closed at once, unless it is what is left of a longer one.
        dt: s.
        model: joint limits.
        limits: margins, and the largest rate of a reference.

    Returns:
        The reference, and for each joint 1 if it is on its way.
    """
    at: list[Scalar] = []
    slowed: list[Any] = []
    rates: list[Scalar] = []
    on_way: list[Scalar] = []
    for wanted, rate, old, ramp, link, speed, free, most, margin in zip(
        reference.joints,
        reference.joint_rates,
        before,
        ramping,
        model.vehicle.links,
        speeds,
        steps,
        limits.joint_speed,
        limits.joint_margin,
        strict=True,
    ):
        low, high = add(link.joint.lower, 2.0 * margin), sub(link.joint.upper, 2.0 * margin)
        target = minimum(maximum(wanted, low), high)
        step = mul(speed, dt)
        gap = sub(target, old)
        slow = absolute(gap) > where(ramp > 0.5, step, maximum(step, free))
        outside = logical_or(wanted < low, wanted > high)
        at.append(where(slow, add(old, clip(gap, 0.0 - step, step)), target))
        on_way.append(where(slow, 1.0, 0.0))
        slowed.append(logical_or(slow, outside))
        moving = where(gap > 0.0, speed, 0.0 - speed)
        rates.append(where(slow, moving, where(outside, 0.0, clip(rate, 0.0 - most, most))))

    def still(values: Sequence[Any]) -> tuple[Scalar, ...]:
        # a reference may come without its higher derivatives
        return tuple(where(slow, 0.0, value) for slow, value in zip(slowed, values, strict=False))

    governed = dataclasses.replace(
        reference,
        joints=tuple(at),
        joint_rates=tuple(rates),
        joint_accelerations=still(reference.joint_accelerations),
        joint_jerks=still(reference.joint_jerks),
        joint_snaps=still(reference.joint_snaps),
    )
    return governed, tuple(on_way)
