"""Probability distributions of varied parameters, as quantile functions.

Random and Sobol designs differ only in where the uniform numbers come from. ``grid``
and ``list`` are finite: a grid design takes their Cartesian product, any other design
picks among their values with equal chances. Exponentials and logarithms are the
library's own: those of libm differ between processors.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from skyarm.algebra.scalars.elementary import exp, horner, log
from skyarm.records.arrays import Array
from skyarm.records.files import Fields, number, shown
from skyarm.records.files.fields import whole_number
from skyarm.records.immutable import positional

MOST_VALUES = 100_000
"""Largest number of points of a grid or list."""


CENTRE = (
    (
        3.3871328727963666080e0,
        1.3314166789178437745e2,
        1.9715909503065514427e3,
        1.3731693765509461125e4,
        4.5921953931549871457e4,
        6.7265770927008700853e4,
        3.3430575583588128105e4,
        2.5090809287301226727e3,
    ),
    (
        1.0,
        4.2313330701600911252e1,
        6.8718700749205790830e2,
        5.3941960214247511077e3,
        2.1213794301586595867e4,
        3.9307895800092710610e4,
        2.8729085735721942674e4,
        5.2264952788528545610e3,
    ),
)
NEAR_TAIL = (
    (
        1.42343711074968357734e0,
        4.63033784615654529590e0,
        5.76949722146069140550e0,
        3.64784832476320460504e0,
        1.27045825245236838258e0,
        2.41780725177450611770e-1,
        2.27238449892691845833e-2,
        7.74545014278341407640e-4,
    ),
    (
        1.0,
        2.05319162663775882187e0,
        1.67638483018380384940e0,
        6.89767334985100004550e-1,
        1.48103976427480074590e-1,
        1.51986665636164571966e-2,
        5.47593808499534494600e-4,
        1.05075007164441684324e-9,
    ),
)
FAR_TAIL = (
    (
        6.65790464350110377720e0,
        5.46378491116411436990e0,
        1.78482653991729133580e0,
        2.96560571828504891230e-1,
        2.65321895265761230930e-2,
        1.24266094738807843860e-3,
        2.71155556874348757815e-5,
        2.01033439929228813265e-7,
    ),
    (
        1.0,
        5.99832206555887937690e-1,
        1.36929880922735805310e-1,
        1.48753612908506148525e-2,
        7.86869131145613259100e-4,
        1.84631831751005468180e-5,
        1.42151175831644588870e-7,
        2.04426310338993978564e-15,
    ),
)
"""Numerator and denominator of the normal quantile near the median, and in the near and
far tails, by powers."""


def normal_quantile(u: Array) -> Array:
    """Quantile of the standard normal distribution at probability ``u``, with the same
    bits on every processor.

    Source: Wichura 1988, AS 241.
    """
    q = u - 0.5
    r = np.sqrt(-np.asarray(log(np.where(q <= 0.0, u, 1.0 - u))))
    side = np.where(q < 0.0, -1.0, 1.0)
    # where each fraction holds (0.425, whose square is 0.180625; 1.6; 5) is the
    # source's
    central, near, far = (
        np.asarray(horner(x, above) * factor / horner(x, below))
        for x, factor, (above, below) in (
            (0.180625 - q * q, q, CENTRE),
            (r - 1.6, side, NEAR_TAIL),
            (r - 5.0, side, FAR_TAIL),
        )
    )
    return np.asarray(
        np.where(np.abs(q) <= 0.425, central, np.where(r <= 5.0, near, far))
    )


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
        return np.asarray(self.low * exp(log(self.high / self.low) * u))


@positional
class Normal:
    """Normal distribution."""

    mean: float
    std: float

    def quantile(self, u: Array) -> Array:
        """Quantile of the distribution at probability ``u``."""
        return self.mean + self.std * normal_quantile(u)


@positional
class Values:
    """Discrete uniform distribution over a list or an evenly spaced grid."""

    values: tuple[float, ...]

    def quantile(self, u: Array) -> Array:
        """Quantile of the discrete distribution at probability ``u``."""
        # a product just below the count may round up to it
        index = np.minimum((u * len(self.values)).astype(int), len(self.values) - 1)
        return np.asarray(np.array(self.values)[index])


Distribution = Uniform | LogUniform | Normal | Values


def finite(vary: Mapping[str, Distribution]) -> dict[str, Values]:
    """Select the varied parameters with discrete distributions (grids and lists), by
    path.
    """
    return {path: each for path, each in vary.items() if isinstance(each, Values)}


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
    count = whole_number(given, f"{at}[2]", 2, MOST_VALUES)
    return Values(tuple(np.linspace(start, stop, count).tolist()))


def _interval(value: object, at: str) -> tuple[float, float]:
    low, high = _numbers(value, at, (2, 2), "2 numbers, low and high")
    _require_ascending((low, high), at, value)
    return low, high


def _require_ascending(ends: tuple[float, float], at: str, value: object) -> None:
    # a range beyond the largest double would overflow
    if not ends[0] < ends[1] or not math.isfinite(ends[1] - ends[0]):
        raise ValueError(
            f"{at} = {shown(value)}: must be two numbers, the first below the second"
        )


def _numbers(
    value: object, at: str, counts: tuple[int, int], expected: str
) -> tuple[float, ...]:
    """Read a distribution's list of numbers from a file's value and check its
    length.
    """
    if not isinstance(value, list) or not counts[0] <= len(value) <= counts[1]:
        raise ValueError(f"{at} = {shown(value)}: must be a list of {expected}")
    return tuple(number(item, f"{at}[{i}]") for i, item in enumerate(value))


KINDS: Mapping[str, Callable[[object, str], Distribution]] = {
    "uniform": lambda value, at: Uniform(*_interval(value, at)),
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
        raise ValueError(
            f"{at} = {shown(table)}: must have exactly one of {', '.join(KINDS)}"
        )
    ((kind, value),) = fields.table.items()
    return KINDS[kind](value, f"{at}.{kind}")
