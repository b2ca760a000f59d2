"""Metrics counted while an episode flies, one control period at a time, over any scalar.

The same definitions as :mod:`skyarm.simulate.metrics`, for engines that keep no log: sums, squares and extremes over
half-open windows. Settling time is not among them: it needs the steady mean before the flight is over.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm.algebra import Quaternion, Vec3
from skyarm.scalars import Scalar, absolute, asin, atan2, clip, logical_and, maximum, minimum, sqrt, where

HUGE = 1e300


@dataclass(frozen=True, kw_only=True, slots=True)
class Windows:
    """Half-open intervals, s: the steady window of means, the transient one of peaks."""

    steady_start: float = 10.0
    steady_stop: float = 20.0
    transient_start: float = 0.0
    transient_stop: float = 8.0


@dataclass(frozen=True, kw_only=True, slots=True)
class Totals:
    """Running sums and extremes.

    Attributes:
        count: periods inside the steady window.
        position, joint, tool: sums of error norms; *_max their largest; position_min the smallest.
        pitch, pitch_square, roll_square, effort_square: sums over the steady window.
        pitch_low, pitch_high: extremes of pitch over the steady window.
        peak_pitch, peak_position: largest magnitudes over the transient window.
        iae_position, iae_joint: sums over the whole run.
    """

    count: Scalar
    position: Scalar
    position_max: Scalar
    position_min: Scalar
    joint: Scalar
    joint_max: Scalar
    tool: Scalar
    tool_max: Scalar
    pitch: Scalar
    pitch_square: Scalar
    pitch_low: Scalar
    pitch_high: Scalar
    roll_square: Scalar
    effort_square: tuple[Scalar, ...]
    peak_pitch: Scalar
    peak_position: Scalar
    iae_position: Scalar
    iae_joint: Scalar


def nothing_yet(joints: int) -> Totals:
    """Totals before the first period."""
    zero = 0.0
    return Totals(
        count=zero,
        position=zero,
        position_max=zero,
        position_min=HUGE,
        joint=zero,
        joint_max=zero,
        tool=zero,
        tool_max=zero,
        pitch=zero,
        pitch_square=zero,
        pitch_low=HUGE,
        pitch_high=-HUGE,
        roll_square=zero,
        effort_square=(zero,) * joints,
        peak_pitch=zero,
        peak_position=zero,
        iae_position=zero,
        iae_joint=zero,
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class Instant:
    """What is counted at one control instant: error norms, attitude, joint efforts."""

    position: Scalar
    joint: Scalar
    tool: Scalar
    roll: Scalar
    pitch: Scalar
    efforts: tuple[Scalar, ...]


def roll_and_pitch(q: Quaternion) -> tuple[Any, Any]:
    """ZYX roll and pitch of a unit quaternion, rad."""
    w, x, y, z = q
    roll = atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    return roll, asin(clip(2.0 * (w * y - z * x), -1.0, 1.0))


def joint_norm(joints: tuple[Any, ...], wanted: tuple[Any, ...]) -> Any:
    """Euclidean norm of the joint errors."""
    total: Any = 0.0
    for q, q_d in zip(joints, wanted, strict=True):
        total = total + (q - q_d) * (q - q_d)
    return sqrt(total)


def distance(a: Vec3, b: Vec3) -> Any:
    """Length of a - b."""
    return (a - b).norm()


def counted(totals: Totals, now: Instant, time: Any, windows: Windows) -> Totals:
    """Totals with one more control instant."""
    steady = logical_and(time >= windows.steady_start, time < windows.steady_stop)
    early = logical_and(time >= windows.transient_start, time < windows.transient_stop)

    def sums(total: Any, value: Any) -> Any:
        return total + where(steady, value, 0.0)

    def highest(total: Any, value: Any, inside: Any) -> Any:
        return where(inside, maximum(value, total), total)

    return Totals(
        count=sums(totals.count, 1.0),
        position=sums(totals.position, now.position),
        position_max=highest(totals.position_max, now.position, steady),
        position_min=where(steady, minimum(now.position, totals.position_min), totals.position_min),
        joint=sums(totals.joint, now.joint),
        joint_max=highest(totals.joint_max, now.joint, steady),
        tool=sums(totals.tool, now.tool),
        tool_max=highest(totals.tool_max, now.tool, steady),
        pitch=sums(totals.pitch, now.pitch),
        pitch_square=sums(totals.pitch_square, now.pitch * now.pitch),
        pitch_low=where(steady, minimum(now.pitch, totals.pitch_low), totals.pitch_low),
        pitch_high=highest(totals.pitch_high, now.pitch, steady),
        roll_square=sums(totals.roll_square, now.roll * now.roll),
        effort_square=tuple(sums(t, e * e) for t, e in zip(totals.effort_square, now.efforts, strict=True)),
        peak_pitch=highest(totals.peak_pitch, absolute(now.pitch), early),
        peak_position=highest(totals.peak_position, now.position, early),
        iae_position=totals.iae_position + now.position,
        iae_joint=totals.iae_joint + now.joint,
    )


def metrics(totals: Totals, period: Any) -> dict[str, Any]:
    """Metrics under the names of :mod:`skyarm.simulate.metrics`, from totals (scalars or arrays) and the period, s."""
    n = totals.count
    found = {
        "position_error_mean": totals.position / n,
        "position_error_max": totals.position_max,
        "position_min": totals.position_min,
        "joint_error_mean": totals.joint / n,
        "joint_error_max": totals.joint_max,
        "ee_error_mean": totals.tool / n,
        "ee_error_max": totals.tool_max,
        "pitch_mean": totals.pitch / n,
        "pitch_rms": sqrt(totals.pitch_square / n),
        "pitch_ripple": 0.5 * (totals.pitch_high - totals.pitch_low),
        "roll_rms": sqrt(totals.roll_square / n),
        "peak_pitch": totals.peak_pitch,
        "peak_position": totals.peak_position,
        "iae_position": totals.iae_position * period,
        "iae_joint": totals.iae_joint * period,
    }
    return found | {f"tau{i + 1}_rms": sqrt(total / n) for i, total in enumerate(totals.effort_square)}
