"""What a panel shows: one number per control instant, read from a log.

Errors are actual minus desired, against the published and held reference, as a recorded bag would show them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skyarm.log.flight_log import Log

Array = npt.NDArray[np.float64]
AXES = "xyz"


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """One curve.

    Attributes:
        label: words for the axis. unit: SI.
        of: log -> (N,). desired: log -> (N,), drawn dotted.
        magnitude: never negative, so the axis begins at zero.
    """

    label: str
    unit: str
    of: Callable[[Log], Array]
    desired: Callable[[Log], Array] | None = None
    magnitude: bool = False


def _norm(values: Array) -> Array:
    return np.asarray(np.linalg.norm(values, axis=1))


def _euler(i: int) -> Callable[[Log], Array]:
    return lambda log: log.euler[:, i]


ROLL = Quantity(label="Roll", unit="rad", of=_euler(0))
PITCH = Quantity(label="Pitch", unit="rad", of=_euler(1))
POSITION_ERROR = Quantity(
    label="Position error",
    unit="m",
    of=lambda log: _norm(log.position - log.position_held),
    magnitude=True,
)
TOOL_ERROR = Quantity(
    label="Tip error",
    unit="m",
    of=lambda log: _norm(log.tool - log.tool_held),
    magnitude=True,
)


def position_error(i: int) -> Quantity:
    """Error of the base along world axis i, m."""
    return Quantity(label=f"Error {AXES[i]}", unit="m", of=lambda log: (log.position - log.position_held)[:, i])


def tool_error(i: int) -> Quantity:
    """Error of the tip along world axis i, m."""
    return Quantity(label=f"Tip error {AXES[i]}", unit="m", of=lambda log: (log.tool - log.tool_held)[:, i])


def tool_position(i: int) -> Quantity:
    """Tip along world axis i, m, with where a level base on reference would put it."""
    return Quantity(
        label=f"Tip {AXES[i]}",
        unit="m",
        of=lambda log: log.tool[:, i],
        desired=lambda log: log.tool_held[:, i],
    )


def joint_error(i: int) -> Quantity:
    """Error of joint i, rad."""
    return Quantity(label=f"Joint {i + 1} error", unit="rad", of=lambda log: (log.joints - log.joints_held)[:, i])


def joint_error_size(i: int) -> Quantity:
    """Absolute error of joint i, rad."""
    return Quantity(
        label=f"Joint {i + 1} abs. error",
        unit="rad",
        of=lambda log: np.abs(log.joints - log.joints_held)[:, i],
        magnitude=True,
    )


def joint_angle(i: int) -> Quantity:
    """Angle of joint i, rad, with its reference."""
    return Quantity(
        label=f"Joint {i + 1}", unit="rad", of=lambda log: log.joints[:, i], desired=lambda log: log.joints_held[:, i]
    )


def gust_interval(log: Log) -> tuple[float, float] | None:
    """When a force of the wind blows during part of the episode, s; None for no wind or a constant one."""
    blowing = np.flatnonzero(_norm(log.wind_force) > 0.0)
    if not blowing.size or blowing.size == log.time.size:
        return None
    end = min(int(blowing[-1]) + 1, log.time.size - 1)
    return float(log.time[blowing[0]]), float(log.time[end])


@dataclass(frozen=True, slots=True)
class Holds:
    """A curve by holds of the reference: an error against held samples is a sawtooth, too fast for a line.

    Attributes:
        time: (K,) middle of each hold, s. mean, low, high: (K,) of the curve within it.
    """

    time: Array
    mean: Array
    low: Array
    high: Array


def by_hold(log: Log, values: Array) -> Holds:
    """Reduce a curve (N,) at control instants to mean and range over each hold of the reference."""
    rates = log.info["rates_hz"]
    block = max(1, round(rates["control"] / rates["reference"]))
    starts = np.arange(0, values.size, block)
    if not starts.size:
        return Holds(values, values, values, values)
    counts = np.diff(np.append(starts, values.size))
    time, total = np.add.reduceat(log.time, starts), np.add.reduceat(values, starts)
    low, high = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
    return Holds(time / counts, total / counts, low, high)


def end_time(log: Log) -> float:
    """End of the last control period of a log, s."""
    return round(float(log.time[-1]) + 1.0 / float(log.info["rates_hz"]["control"]), 9) if log.time.size else 0.0
