"""Confidence intervals of proportions, quantiles and means from finitely many
episodes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from statistics import NormalDist

import numpy as np

from skyarm.records.arrays import Array

CONFIDENCE = 0.95
"""Usual coverage of an interval."""


def wilson(
    successes: float, count: int, confidence: float = CONFIDENCE
) -> tuple[float, float]:
    """Wilson score interval of a proportion.

    Args:
        successes: number of successes; one that is shared counts half.
        count: number of trials; the interval of none is (0, 1).
        confidence: coverage.

    Source: Wilson 1927, "Probable inference, the law of succession, and statistical
    inference".
    """
    if count == 0:
        return 0.0, 1.0
    z = NormalDist().inv_cdf(0.5 + 0.5 * confidence)
    share = successes / count
    scale = 1.0 + z * z / count
    center = (share + z * z / (2.0 * count)) / scale
    half = (
        z
        / scale
        * math.sqrt(share * (1.0 - share) / count + z * z / (4.0 * count * count))
    )
    # at 0 and 1 the interval ends there; rounding may leave it 1e-17 off
    low = 0.0 if successes == 0 else center - half
    high = 1.0 if successes == count else center + half
    return low, high


def quantiles(values: Array, shares: Sequence[float]) -> list[float]:
    """Quantiles as order statistics: least value that at least a given fraction of the
    values does not exceed.
    """
    ordered = np.sort(values)
    return [float(ordered[_rank(share, ordered.size) - 1]) for share in shares]


def quantile_intervals(
    values: Array, shares: Sequence[float], confidence: float = CONFIDENCE
) -> list[tuple[float, float] | None]:
    """Confidence intervals of quantiles between order statistics, for any distribution
    of the values.

    The number of values below a quantile is binomial. None where its ends would lie
    beyond the least or largest value: 95 % of a median takes 6 values, of the quantile
    0.95 72 of them.

    Source: David, Nagaraja 2003, "Order statistics", section 7.1.
    """
    ordered = np.sort(values)
    ranks = [_interval_ranks(ordered.size, share, confidence) for share in shares]
    return [
        pair and (float(ordered[pair[0]]), float(ordered[pair[1]])) for pair in ranks
    ]


# every metric asks for the same counts and shares; 256 is chosen: a miss takes about a
# millisecond for 10 000 values, and 4 s for a million (measured)
@lru_cache(maxsize=256)
def _interval_ranks(
    count: int, share: float, confidence: float
) -> tuple[int, int] | None:
    """Indices of the order statistics around a quantile, each end with half of the
    error; None if there are none.
    """
    tail = 0.5 * (1.0 - confidence)
    k = np.arange(1.0, count + 1.0)
    ratios = np.log((count + 1.0 - k) / k) + math.log(share / (1.0 - share))
    # P(at most 0, 1, ... values)
    below = np.cumsum(np.exp(np.cumsum([count * math.log1p(-share), *ratios])))
    low = int(np.searchsorted(below, tail, "right"))
    high = int(np.searchsorted(below, 1.0 - tail)) + 1
    return (low - 1, high - 1) if low >= 1 and high <= count else None


def mean_interval(
    values: Array, confidence: float = CONFIDENCE
) -> tuple[float, float] | None:
    """Confidence interval of a mean by Student's t; None for fewer than two values, or
    for equal ones.

    Source: Student 1908, "The probable error of a mean".
    """
    if values.size < 2 or values.min() == values.max():
        return None
    half = (
        _student_quantile(values.size - 1, confidence)
        * float(values.std(ddof=1))
        / math.sqrt(values.size)
    )
    return float(values.mean()) - half, float(values.mean()) + half


MOST_DEGREES = 10_000
"""Degrees of freedom of Student's t from which on they no longer count: its quantiles
are 0.01 % above the normal's."""


# as above: one number of degrees for all metrics; a miss takes up to 0.1 s (measured)
@lru_cache(maxsize=256)
def _student_quantile(degrees: int, confidence: float) -> float:
    """Largest size of Student's t that a probability of ``confidence`` leaves, by
    bisection of its finite series.

    Source: Abramowitz, Stegun 1964, equations 26.7.3 and 26.7.4.
    """
    n = min(degrees, MOST_DEGREES)
    # the first term is 1, then each is (k - 1) / k times the one before
    k = np.arange(2 + n % 2, n, 2)
    factors = np.cumprod([1.0, *((k - 1.0) / k)])
    low = 0.0
    high = 0.5 * math.pi
    # 60 halvings reach the last bit of a double
    for _ in range(60):
        angle = 0.5 * (low + high)
        powers = math.cos(angle) ** (2.0 * np.arange(factors.size) + n % 2)
        within = math.sin(angle) * float(factors @ powers)
        if n % 2:
            within = 2.0 / math.pi * (angle + (within if n > 1 else 0.0))
        low, high = (angle, high) if within < confidence else (low, angle)
    return math.sqrt(n) * math.tan(low)


def paired_difference(
    both: int,
    only_first: int,
    only_second: int,
    neither: int,
    confidence: float = CONFIDENCE,
) -> tuple[float, float]:
    """Score interval of the difference of two success rates on the same episodes, from
    the counts of pairs.

    Source: Newcombe 1998, "Improved confidence intervals for the difference between
    binomial proportions based on paired data", method 10.
    """
    count = both + only_first + only_second + neither
    first = both + only_first
    second = both + only_second
    low_1, high_1 = (
        abs(first / count - end) for end in wilson(first, count, confidence)
    )
    low_2, high_2 = (
        abs(second / count - end) for end in wilson(second, count, confidence)
    )
    spread = math.sqrt(first * (count - first) * second * (count - second))
    covariance = both * neither - only_first * only_second
    # a positive covariance is lessened by half a count, as in the source
    phi = (
        (max(covariance - 0.5 * count, 0.0) if covariance > 0 else covariance) / spread
        if spread
        else 0.0
    )

    def together(a: float, b: float) -> float:
        return math.sqrt(a * a - 2.0 * phi * a * b + b * b)

    difference = (only_first - only_second) / count
    return difference - together(low_1, high_2), difference + together(high_1, low_2)


def _rank(share: float, count: int) -> int:
    return min(max(math.ceil(share * count), 1), count)
