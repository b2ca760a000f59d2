"""Reference of the tip mode: tip and links as a level base would have them, and the shift of the base.

What the arm cannot reach goes to a slow, bounded shift of the base, and base errors beyond the arm's reach go to the
tip's reference.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Mat3, Vec3
from skyarm.control.blocks.attitude import Attitude
from skyarm.control.blocks.select import vector_data
from skyarm.control.blocks.series_kinematics import Posture, derivative
from skyarm.records.units import Unit
from skyarm.scalars import add, cos, divide, sin, sqrt
from skyarm.scalars.taylor import Taylor
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle


@dataclass(frozen=True, slots=True)
class Goal:
    """Level-base reference, world axes: the tip and the links, value to second derivative.

    Attributes:
        tip: position (m), velocity, acceleration. tip_B: position against the base.
        links: R_WL of every link. rates, accelerations: angular, of every link.
    """

    tip: tuple[Vec3, Vec3, Vec3]
    tip_B: Vec3
    links: tuple[Mat3, ...]
    rates: tuple[Vec3, ...]
    accelerations: tuple[Vec3, ...]


def turn_by_yaw(yaw: Taylor, v: Vec3) -> Vec3:
    """Return R_z(yaw) v as a series."""
    c, s = cos(yaw), sin(yaw)
    x, y = (Taylor.constant(k, len(yaw.c) - 1) if not isinstance(k, Taylor) else k for k in (v.x, v.y))
    return Vec3(c * x - s * y, s * x + c * y, v.z)


def goal(vehicle: Vehicle, base: list[Vec3], yaw: Taylor, joints: Sequence[Taylor], level: Posture) -> Goal:
    """Return where a level base at its reference has tip and links."""
    yaw = yaw.truncated(2)
    arm = turn_by_yaw(yaw, level.tip)
    tip = (base[0] + derivative(arm, 0), base[1] + derivative(arm, 1), base[2] + derivative(arm, 2))
    spin = Vec3(0, 0, yaw.differentiated())
    rates: list[Vec3] = []
    links = []
    for link, pose, q in zip(vehicle.links, level.links, joints, strict=True):
        columns = [turn_by_yaw(yaw, pose.R.column(k)) for k in range(3)]
        links.append(Mat3.columns(*(derivative(column, 0) for column in columns)))
        rate = spin if link.parent == BASE else rates[link.parent]
        if link.joint.kind == "revolute":
            axis = Vec3(*(Taylor.constant(c, 1) for c in link.joint.axis))
            along = Vec3(*(row.dot(axis) for row in Mat3.columns(*columns).rows))
            slope = q.differentiated().truncated(1)
            rate = Vec3(*(add(a, b * slope) for a, b in zip(rate, along, strict=True)))
        rates.append(rate)
    return Goal(
        tip,
        derivative(arm, 0),
        tuple(links),
        tuple(derivative(rate, 0) for rate in rates),
        tuple(derivative(rate, 1) for rate in rates),
    )


def move_goal(goal: Goal, error: Sequence[Vec3], reach: Any) -> Goal:
    """Move the goal by base errors (value to second derivative) that are longer than the arm shall compensate.

    The tip takes over e |e|^4 / (|e|^4 + reach^4): nothing of small errors, all of large ones.
    """
    series = [Taylor.of_derivatives(each) for each in zip(*error, strict=True)]
    square = series[0] * series[0] + series[1] * series[1] + series[2] * series[2]
    fourth = square * square * divide(1.0, reach * reach * reach * reach)
    share = fourth / (fourth + 1.0)
    moved = [each * share for each in series]
    p, v, a = (old + Vec3(*(each.derivative(k) for each in moved)) for k, old in enumerate(goal.tip))
    return dataclasses.replace(goal, tip=(p, v, a))


def shift(level: Posture, yaw: Taylor, turned_arm: Posture, still: Attitude, limit: Any) -> list[Vec3]:
    """Offset of the base that puts the tip of a tilted vehicle on its level-base reference, with two derivatives.

    Args:
        level: posture of the references, base axes.
        yaw: heading.
        turned_arm: posture whose links are turned as those of a level base.
        still: quasi-static attitude with its rate and acceleration; slow, as its disturbance is.
        limit: m; the offset stays within it, hardly changed up to half of it.
    """
    needed = needed_shift(level.tip, yaw, turned_arm.tip, still)
    series = [Taylor.of_derivatives(each) for each in zip(*needed, strict=True)]
    square = (series[0] * series[0] + series[1] * series[1] + series[2] * series[2]) * divide(1.0, limit * limit)
    eighth = square * square * square * square
    share = 1.0 / sqrt(sqrt(sqrt(eighth + 1.0)))
    return [Vec3(*((each * share).derivative(k) for each in series)) for k in range(3)]


def needed_shift(level: Vec3, yaw: Taylor, turned: Vec3, still: Attitude) -> list[Vec3]:
    """How far a point of a level vehicle is from the same point of a tilted one, with two derivatives.

    Args:
        level: the point of the references, base axes.
        yaw: heading.
        turned: of the arm whose links are turned as those of a level base.
        still: attitude with its rate and acceleration.
    """
    R, w, alpha = still.R, still.rate, still.acceleration
    r, rd, rdd = (derivative(turned, k) for k in range(3))
    arm = turn_by_yaw(yaw.truncated(2), level)
    return [
        derivative(arm, 0) - R.apply(r),
        derivative(arm, 1) - R.apply(w.cross(r) + rd),
        derivative(arm, 2) - R.apply(alpha.cross(r) + w.cross(w.cross(r)) + w.cross(rd) * 2.0 + rdd),
    ]


@dataclass(frozen=True, kw_only=True, slots=True)
class ShiftMotion:
    """Memory of two differentiators in a row, of the acceleration of the base's shift: what they have followed."""

    acceleration: Annotated[Vec3, Unit("m/s^2", "of the base's shift, filtered")]
    jerk: Annotated[Vec3, Unit("m/s^3", "of the base's shift, filtered")]


def differentiated(memory: ShiftMotion, acceleration: Vec3, bandwidth: Any, dt: Any) -> tuple[ShiftMotion, Vec3, Vec3]:
    """The memory one period later, jerk and snap of the shift; ``bandwidth`` of each differentiator in rad/s."""
    jerk = (acceleration - memory.acceleration) * bandwidth
    snap = (jerk - memory.jerk) * bandwidth
    following = ShiftMotion(
        acceleration=vector_data(memory.acceleration + jerk * dt), jerk=vector_data(memory.jerk + snap * dt)
    )
    return following, jerk, snap
