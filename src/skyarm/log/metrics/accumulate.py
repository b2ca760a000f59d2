"""Running sums and extremes for the metrics of an episode.

A total is a sum, a sum of squares, a largest or smallest value, or the value of largest
magnitude with its sign, of one quantity over one window. Only the totals that the
requested metrics need are counted; what they do not need is not even traced. Over a log
the same functions count: :mod:`skyarm.log.metrics.score`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from skyarm.algebra import Quaternion, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import (
    absolute,
    asin,
    atan2,
    clip,
    maximum,
    minimum,
    sqrt,
    where,
)
from skyarm.log.metrics import interaction
from skyarm.log.metrics.metric import Metric, MetricInstant
from skyarm.records import coerce
from skyarm.records.files.user_code import place_of
from skyarm.records.leaves import Tree, leaves, named_parts, rebuild
from skyarm.records.registry import RegistryError, find
from skyarm.records.registry.contract import class_mistake, refuse_mistake

HUGE = 1e300
"""Start of an extreme or a last value, beyond every number of a flight: a result of
this size is that of a quantity which the flight lacks."""

CONTINUOUS = "_continuous"
"""Suffix of metrics against the continuous reference; without it, against the held
samples."""


def joint_norm(joints: Scalars, desired: Scalars) -> Scalar:
    """Euclidean norm of the joint position errors."""
    total: Scalar = 0.0
    for q, q_d in zip(joints, desired, strict=True):
        total = total + (q - q_d) * (q - q_d)
    return sqrt(total)


def distance(a: Vec3, b: Vec3) -> Scalar:
    """Distance between two points."""
    return (a - b).norm()


def roll_and_pitch(q: Quaternion) -> tuple[Scalar, Scalar]:
    """ZYX roll and pitch of a unit quaternion, rad."""
    w, x, y, z = q
    roll = atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    # rounding may pass the pole by 1e-16, where asin has no value
    return roll, asin(clip(2.0 * (w * y - z * x), -1.0, 1.0))


def tilt(q: Quaternion) -> Scalar:
    """Tilt (rad) of the body's z axis against the vertical, from a unit quaternion;
    accurate near zero.
    """
    # from the sine of the half angle: acos loses half the digits near zero
    return 2.0 * asin(minimum(sqrt(q.x * q.x + q.y * q.y), 1.0))


def _jitter(now: MetricInstant, size: Callable[[Scalar], Scalar]) -> Scalar:
    """Change of the commanded rotor speeds since the last control period, by size,
    averaged over the rotors.
    """
    total: Scalar = 0.0
    for new, old in zip(now.command.rotor_speeds, now.before, strict=True):
        total = total + size(new - old)
    return total / float(len(now.before))


ROUNDING = 1e-9
"""Fraction of a limit below it at which a command that the law itself limits still
counts as at the limit."""


def _limited_rotors(now: MetricInstant) -> Scalar:
    """1 if a rotor command is at a limit at the battery's voltage or beyond it, else 0;
    NaN without known limits.
    """
    if now.limits is None:
        return math.nan
    limited: Scalar = 0.0
    ranges = now.limits.rotor_ranges(now.part("battery_voltage"))
    for speed, (least, highest) in zip(now.command.rotor_speeds, ranges, strict=True):
        # a reversible rotor's least speed is negative, and rest is the least of others
        stopped = speed <= (1.0 - ROUNDING) * least
        limited = where(
            stopped, 1.0, where(speed >= (1.0 - ROUNDING) * highest, 1.0, limited)
        )
    return limited


def _limited_joints(now: MetricInstant) -> Scalar:
    """1 if a joint's torque or force is at its limit or beyond it, else 0; NaN without
    known limits.
    """
    if now.limits is None:
        return math.nan
    limited: Scalar = 0.0
    for effort, highest in zip(now.command.efforts, now.limits.efforts, strict=True):
        limited = where(absolute(effort) >= (1.0 - ROUNDING) * highest, 1.0, limited)
    return limited


NEAR = 0.05
"""Distance (m) above which a tip counts as away from its reference."""

QUANTITIES: Mapping[str, interaction.Quantity] = {
    "position": lambda now, goal: distance(now.state.position, goal.position),
    "joint": lambda now, goal: joint_norm(now.state.joints, goal.joints),
    "ee": lambda now, goal: distance(now.tool, goal.tool),
    "ee_outside": lambda now, goal: where(
        distance(now.tool, goal.tool) > NEAR, 1.0, 0.0
    ),
    "x": lambda now, goal: now.state.position.x - goal.position.x,
    "ee_x": lambda now, goal: now.tool.x - goal.tool.x,
    "height": lambda now, goal: goal.position.z - now.state.position.z,
    "altitude": lambda now, goal: absolute(now.state.position.z - goal.position.z),
    "roll": lambda now, _: roll_and_pitch(now.state.quaternion)[0],
    "pitch": lambda now, _: roll_and_pitch(now.state.quaternion)[1],
    "pitch_size": lambda now, _: absolute(roll_and_pitch(now.state.quaternion)[1]),
    "tilt": lambda now, _: tilt(now.state.quaternion),
    "rate_square": lambda now, _: now.state.rate.dot(now.state.rate),
    "jitter_size": lambda now, _: _jitter(now, absolute),
    "lag": lambda now, _: now.lag,
    "phase": lambda now, _: now.phase,
    "rotor_limited": lambda now, _: _limited_rotors(now),
    "joint_limited": lambda now, _: _limited_joints(now),
    "jitter_square": lambda now, _: _jitter(now, lambda change: change * change),
    **interaction.QUANTITIES,
}
"""Quantity -> function: errors (m, rad), attitude (rad), squared body rate, rotor
jitter (rad/s, and squared), commands at limits (1 or 0); efforts are ``effort`` + i."""

Total = tuple[str, str, str]
"""Running total: kind ("sum", "square", "max", "min", "peak", "last"), window, and
quantity, which may end with ``_continuous``.

Of kind "added" it is the memory of a registered metric, by its name."""

Totals = tuple[Any, ...]
"""Values of some totals in order: scalars, and internal states of registered
metrics."""

ADDED = "added"

STARTS = {
    # values that any first number replaces; the signed peak begins at 0
    "sum": 0.0,
    "square": 0.0,
    "max": -HUGE,
    "min": HUGE,
    "peak": 0.0,
    "last": HUGE,
}


def quantity(name: str, now: MetricInstant) -> Scalar | None:
    """Compute a named quantity, such as the position error, at an instant; None if the
    flight lacks it.
    """
    goal = now.held
    if name.endswith(CONTINUOUS):
        name, goal = name.removesuffix(CONTINUOUS), now.continuous
    if name.startswith("effort"):
        return now.command.efforts[int(name.removeprefix("effort"))]
    return QUANTITIES[name](now, goal)


def added_metric(name: str) -> Metric:
    """Return the metric object of a registered metric, or of a built-in contact, grasp
    or phase metric.

    Raises:
        RegistryError: what is registered is no metric, or cannot be called as one.
    """
    if name in interaction.TOTALS:
        return interaction.TOTALS[name]
    kind = find("metric", name)
    # a function may make the metric, so only a class is looked at
    refuse_mistake(
        class_mistake(kind) if isinstance(kind, type) else None, "metric", name
    )
    made = kind()
    if not isinstance(made, Metric):
        raise RegistryError(
            f"metric {name!r}: must be registered as a subclass of Metric"
        )
    return made


def first_totals(counted: Sequence[Total]) -> Totals:
    """Initial values of the running sums and extremes from which metrics are
    computed.
    """
    return tuple(
        (
            added_numbers(name, "start", added_metric(name).start())
            if kind == ADDED
            else STARTS[kind]
        )
        for kind, _, name in counted
    )


def added_numbers(name: str, method: str, result: Tree, like: Tree = None) -> Tree:
    """Check that a registered metric's method returned numbers, and return its result.

    Args:
        name: name of the metric.
        method: name of its method.
        result: result of that method.
        like: accumulator whose structure it must have; None for any.

    Raises:
        RecordError: one line with the metric's file and line, its method, value and
            what is allowed.
    """
    at = (
        f"{place_of(getattr(type(added_metric(name)), method))}: metric {name!r}:"
        f" {method}"
    )
    # the user's code is looked at each time, because its result may differ between
    # instants
    for path, each in named_parts(result, at):
        if getattr(coerce.number(path, each), "ndim", 0):
            coerce.refuse(path, each, "must be a number")
    if like is not None and len(leaves(result)) != len(leaves(like)):
        coerce.refuse(at, result, f"must be of {len(leaves(like))} floats, as start")
    return result


def advance_totals(
    totals: Totals,
    counted: Sequence[Total],
    now: MetricInstant,
    inside: Mapping[str, Scalar],
) -> Totals:
    """Add the quantities of one control instant to the running sums and extremes of the
    metrics.

    Args:
        totals: totals so far.
        counted: definition of each of them.
        now: control instant.
        inside: window -> whether the instant counts for it, a condition.
    """
    # each quantity once, also where several totals count it
    amounts = {
        name: quantity(name, now)
        for name in dict.fromkeys(name for kind, _, name in counted if kind != ADDED)
    }
    following: list[Tree] = []
    for total, (kind, window, name) in zip(totals, counted, strict=True):
        if kind == ADDED:
            more = leaves(
                added_numbers(
                    name, "count", added_metric(name).count(total, now), total
                )
            )
            pairs = zip(more, leaves(total), strict=True)
            following.append(
                rebuild(
                    total, iter([where(inside[window], new, old) for new, old in pairs])
                )
            )
        # a flight without contact has no such quantity
        elif (amount := amounts[name]) is None:
            following.append(total)
        else:
            following.append(
                where(inside[window], _with_one_more(kind, total, amount), total)
            )
    return tuple(following)


def _with_one_more(kind: str, total: Scalar, value: Scalar) -> Scalar:
    if kind == "sum":
        return total + value
    if kind == "square":
        return total + value * value
    if kind == "last":
        return value
    if kind == "max":
        return maximum(value, total)
    if kind == "min":
        return minimum(value, total)
    # peak: the value of the largest size, with its sign
    return where(absolute(value) > absolute(total), value, total)
