"""Probability distributions of varied parameters, as quantile functions.

Random and Sobol designs differ only in where the uniform numbers come from. ``grid`` and ``list`` are finite: a grid
design takes their Cartesian product, any other design picks among their values with equal chances.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from statistics import NormalDist

import numpy as np

from skyarm.records.arrays import Array
from skyarm.records.files import Fields, number, shown
from skyarm.records.immutable import positional

MOST_VALUES = 100_000
"""Largest number of points of a grid or list."""


@positional
class Uniform:
    """Uniform distribution on [low, high]."""

    low: float
    high: float

    def quantile(self, u: Array) -> Array:
        """Quantile of the distribution at probability ``u``."""
        return self.low + (self.high - self.low) * u


@positional
class LogUniform:
    """Log-uniform distribution on [low, high], both positive."""

    low: float
    high: float

    def quantile(self, u: Array) -> Array:
        """Quantile of the distribution at probability ``u``."""
        return self.low * np.exp(math.log(self.high / self.low) * u)


@positional
class Normal:
    """Normal distribution."""

    mean: float
    std: float

    def quantile(self, u: Array) -> Array:
        """Quantile of the distribution at probability ``u``.

        Source: Wichura 1988, AS 241, as the standard library has it.
        """
        flat = np.fromiter(map(NormalDist().inv_cdf, u.ravel().tolist()), dtype=float, count=u.size)
        return self.mean + self.std * flat.reshape(u.shape)


@positional
class Values:
    """Discrete uniform distribution over a list or an evenly spaced grid."""

    values: tuple[float, ...]

    def quantile(self, u: Array) -> Array:
        """Quantile of the discrete distribution at probability ``u``."""
        index = np.minimum((u * len(self.values)).astype(int), len(self.values) - 1)
        return np.asarray(np.array(self.values)[index])


Distribution = Uniform | LogUniform | Normal | Values


def finite(vary: Mapping[str, Distribution]) -> dict[str, Values]:
    """Select the varied parameters with discrete distributions (grids and lists), by path."""
    return {path: each for path, each in vary.items() if isinstance(each, Values)}


def _uniform(value: object, at: str) -> Uniform:
    return Uniform(*_interval(value, at))


def _log_uniform(value: object, at: str) -> LogUniform:
    low, high = _interval(value, at)
    number(low, f"{at}[0]", low=0.0, strict=True)
    return LogUniform(low, high)


def _normal(value: object, at: str) -> Normal:
    mean, std = _numbers(value, at, (2, 2), "2 numbers, mean and standard deviation")
    return Normal(mean, number(std, f"{at}[1]", low=0.0, strict=True))


def _list(value: object, at: str) -> Values:
    numbers = _numbers(value, at, (1, MOST_VALUES), f"1 to {MOST_VALUES} numbers")
    if len(set(numbers)) != len(numbers):
        raise ValueError(f"{at} = {shown(value)}: must not hold a number twice")
    return Values(numbers)


def _grid(value: object, at: str) -> Values:
    start, stop, _ = _numbers(value, at, (3, 3), "3 numbers, [start, stop, count]")
    _require_ascending((start, stop), at, value)
    given = value[2] if isinstance(value, list) else None
    if type(given) is not int or not 2 <= given <= MOST_VALUES:
        raise ValueError(f"{at}[2] = {shown(given)}: must be a whole number from 2 to {MOST_VALUES}")
    return Values(tuple(np.linspace(start, stop, given).tolist()))


def _interval(value: object, at: str) -> tuple[float, float]:
    low, high = _numbers(value, at, (2, 2), "2 numbers, low and high")
    _require_ascending((low, high), at, value)
    return low, high


def _require_ascending(ends: tuple[float, float], at: str, value: object) -> None:
    if not ends[0] < ends[1] or not math.isfinite(ends[1] - ends[0]):
        raise ValueError(f"{at} = {shown(value)}: must be two numbers, the first below the second")


def _numbers(value: object, at: str, counts: tuple[int, int], expected: str) -> tuple[float, ...]:
    """Read a distribution's list of numbers from a file's value and check its length."""
    if not isinstance(value, list) or not counts[0] <= len(value) <= counts[1]:
        raise ValueError(f"{at} = {shown(value)}: must be a list of {expected}")
    return tuple(number(item, f"{at}[{i}]") for i, item in enumerate(value))


KINDS: Mapping[str, Callable[[object, str], Distribution]] = {
    "uniform": _uniform,
    "normal": _normal,
    "log_uniform": _log_uniform,
    "list": _list,
    "grid": _grid,
}


def distribution_from(table: object, at: str) -> Distribution:
    """Distribution from a table with one field, such as ``{ uniform = [0.5, 1.5] }``.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    fields = Fields(table, at)
    if len(fields.table) != 1 or next(iter(fields.table)) not in KINDS:
        raise ValueError(f"{at} = {shown(table)}: must have exactly one of {', '.join(KINDS)}")
    ((kind, value),) = fields.table.items()
    return KINDS[kind](value, f"{at}.{kind}")
