"""Confidence intervals of proportions, quantiles and means from finitely many episodes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import NormalDist

import numpy as np

from skyarm.records.arrays import Array

RESAMPLES = 2000

GROUPS = 2**14
"""Number of values from which a mean is resampled; more are first averaged in groups of equal size."""

BLOCK = 2**18
"""Number of values resampled at a time: few resamples of many values, or many of few."""


def wilson(successes: int, count: int, confidence: float = 0.95) -> tuple[float, float]:
    """Wilson score interval of a proportion.

    Args:
        successes: number of successes.
        count: number of trials; the interval of none is (0, 1).
        confidence: coverage.

    Source: Wilson 1927, "Probable inference, the law of succession, and statistical inference".
    """
    if count == 0:
        return 0.0, 1.0
    z = NormalDist().inv_cdf(0.5 + 0.5 * confidence)
    share = successes / count
    scale = 1.0 + z * z / count
    center = (share + z * z / (2.0 * count)) / scale
    half = z / scale * math.sqrt(share * (1.0 - share) / count + z * z / (4.0 * count * count))
    # at 0 and 1 the interval ends there; rounding may leave it 1e-17 off
    low = 0.0 if successes == 0 else center - half
    high = 1.0 if successes == count else center + half
    return low, high


def quantiles(values: Array, shares: Sequence[float]) -> list[float]:
    """Quantiles as order statistics: least value that at least a given fraction of the values does not exceed."""
    ordered = np.sort(values)
    return [float(ordered[_rank(share, ordered.size) - 1]) for share in shares]


def bootstrap_quantiles(
    values: Array, shares: Sequence[float], seed: int = 0, confidence: float = 0.95, resamples: int = RESAMPLES
) -> list[tuple[float, float]]:
    """Percentile bootstrap intervals of quantiles.

    The r-th smallest of n values drawn with replacement is the value at place ceil(n U) with U the r-th smallest of n
    uniform numbers, which is Beta(r, n - r + 1): the resampled quantile is drawn without resampling the values.

    Source: Efron 1979; Hutson, Ernst 2000, "The exact bootstrap mean and variance of an L-estimator".
    """
    ordered = np.sort(values)
    n, generator = ordered.size, np.random.default_rng(seed)
    intervals = []
    for share in shares:
        r = _rank(share, n)
        places = np.ceil(n * generator.beta(r, n - r + 1, resamples)).astype(int)
        intervals.append(_percentile(ordered[np.clip(places, 1, n) - 1], confidence))
    return intervals


def bootstrap_mean(
    values: Array, seed: int = 0, confidence: float = 0.95, resamples: int = RESAMPLES
) -> tuple[float, float]:
    """Percentile bootstrap interval of a mean.

    Source: Efron 1979.
    """
    groups = _group_means(values)
    generator = np.random.default_rng(seed)
    means = np.empty(resamples)
    block = max(1, BLOCK // groups.size)
    for first in range(0, resamples, block):
        count = min(block, resamples - first)
        means[first : first + count] = groups[generator.integers(0, groups.size, (count, groups.size))].mean(axis=1)
    return _percentile(means, confidence)


def _rank(share: float, count: int) -> int:
    return min(max(math.ceil(share * count), 1), count)


def _percentile(resampled: Array, confidence: float) -> tuple[float, float]:
    ordered = np.sort(resampled)
    tail = 0.5 * (1.0 - confidence)
    return float(ordered[_rank(tail, ordered.size) - 1]), float(ordered[_rank(1.0 - tail, ordered.size) - 1])


def _group_means(values: Array) -> Array:
    """Values, or means of groups of consecutive values if there are many, for a faster bootstrap."""
    size = -(-values.size // GROUPS)
    if size == 1:
        return values
    whole = values.size // size * size
    return np.asarray(values[:whole].reshape(-1, size).mean(axis=1))
