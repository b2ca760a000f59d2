"""Intervals against an independent library."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from skyarm.studies.sweep.intervals import (
    mean_interval,
    paired_difference,
    quantile_intervals,
    quantiles,
    wilson,
)


@pytest.mark.parametrize(
    ("successes", "count"),
    [(0, 1), (1, 1), (0, 40), (40, 40), (7, 40), (39, 40), (123, 100_000)],
)
@pytest.mark.parametrize("confidence", [0.9, 0.95, 0.99])
def test_the_interval_of_a_share_is_that_of_an_independent_library(
    successes: int, count: int, confidence: float
) -> None:
    wanted = stats.binomtest(successes, count).proportion_ci(
        confidence, method="wilson"
    )
    # the same closed form in another order of operations
    assert wilson(successes, count, confidence) == pytest.approx(
        (wanted.low, wanted.high), rel=1e-12, abs=1e-15
    )


def test_no_trials_say_nothing() -> None:
    assert wilson(0, 0) == (0.0, 1.0)


def test_the_interval_of_a_share_covers_it_as_often_as_it_says() -> None:
    won = np.random.default_rng(0).binomial(200, 0.9, size=4000)
    covered = np.mean(
        [low <= 0.9 <= high for low, high in (wilson(int(k), 200) for k in won)]
    )
    # the deviation of the count is 0.0034; the score interval itself is off by up to
    # 0.015 at such counts
    assert abs(covered - 0.95) < 0.02


@pytest.mark.parametrize("share", [0.05, 0.25, 0.5, 0.95])
def test_quantiles_are_order_statistics(share: float) -> None:
    values = np.random.default_rng(1).normal(size=1001)
    assert quantiles(values, [share]) == [
        np.quantile(values, share, method="inverted_cdf")
    ]
    assert quantiles(np.array([3.0]), [share]) == [3.0]


@pytest.mark.parametrize(
    ("share", "count"),
    [(0.5, 6), (0.5, 400), (0.05, 72), (0.95, 72), (0.95, 1000), (0.25, 37)],
)
def test_a_quantile_interval_leaves_at_most_half_of_the_error_at_each_end(
    share: float, count: int
) -> None:
    # a value is its rank
    values = np.random.default_rng(2).permutation(np.arange(1.0, count + 1.0))
    (found,) = quantile_intervals(values, [share])
    low, high = found or (0.0, 0.0)
    below = stats.binom(count, share)
    assert below.cdf(low - 1) <= 0.025 < below.cdf(low), (
        "the next value would leave more"
    )
    assert below.sf(high - 1) <= 0.025 < below.sf(high - 2)


@pytest.mark.parametrize(
    ("share", "enough"), [(0.5, 6), (0.95, 72), (0.05, 72), (0.25, 13)]
)
def test_few_values_have_no_quantile_interval(share: float, enough: int) -> None:
    assert (
        max(share, 1.0 - share) ** enough
        <= 0.025
        < max(share, 1.0 - share) ** (enough - 1)
    )
    assert quantile_intervals(np.arange(enough - 1.0), [share]) == [None]
    assert quantile_intervals(np.arange(float(enough)), [share]) != [None]


@pytest.mark.parametrize("count", [2, 3, 4, 7, 8, 300, 1001])
@pytest.mark.parametrize("confidence", [0.9, 0.95, 0.99])
def test_mean_intervals_are_those_of_an_independent_library(
    count: int, confidence: float
) -> None:
    values = np.random.default_rng(4).exponential(size=count)
    wanted = stats.ttest_1samp(values, 0.0).confidence_interval(confidence)
    assert mean_interval(values, confidence) == pytest.approx(tuple(wanted), rel=1e-9)


def test_the_mean_interval_of_many_values_is_that_of_the_normal() -> None:
    values = np.random.default_rng(6).exponential(size=50_000)
    low, high = mean_interval(values) or (0.0, 0.0)
    half = stats.norm.ppf(0.975) * values.std() / np.sqrt(values.size)
    # quantiles of Student's t with 10000 degrees of freedom are 1.2e-4 above the
    # normal's
    assert (low, high) == pytest.approx(
        (values.mean() - half, values.mean() + half), abs=2e-4 * half
    )


def test_a_mean_of_one_value_or_of_equal_ones_has_no_interval() -> None:
    assert [mean_interval(np.full(count, 0.02)) for count in (1, 2, 8)] == [None] * 3


@pytest.mark.parametrize(
    ("counts", "wanted"),
    [
        # Altman et al. 2000, "Statistics with confidence", table 6.2
        ((14, 5, 0, 22), (0.011, 0.226)),
        # Fagerland, Lydersen, Laake 2014, "Recommended tests and confidence intervals
        # for paired binomial proportions"
        ((1, 1, 7, 12), (-0.507, -0.026)),
    ],
)
def test_the_interval_of_paired_successes_is_the_published_one(
    counts: tuple[int, int, int, int], wanted: tuple[float, float]
) -> None:
    assert paired_difference(*counts) == pytest.approx(wanted, abs=5e-4)
    both, one, other, neither = counts
    assert paired_difference(both, other, one, neither) == pytest.approx(
        (-wanted[1], -wanted[0]), abs=5e-4
    )


def test_intervals_of_paired_successes_cover_as_often_as_they_say() -> None:
    shares, count = np.array([0.5, 0.3, 0.1, 0.1]), 20
    drawn = np.random.default_rng(0).multinomial(count, shares, size=4000)
    covered = np.mean(
        [
            low <= 0.2 <= high
            for low, high in (paired_difference(*map(int, row)) for row in drawn)
        ]
    )
    # the deviation of the count is 0.0034; Newcombe 1998 finds 0.943 to 0.99 for tables
    # of such counts
    assert 0.93 < covered < 0.99


def test_eight_successes_against_none_leave_an_interval() -> None:
    low, high = paired_difference(0, 8, 0, 0)
    assert (low, high) == pytest.approx((1.0 - np.sqrt(2.0) * wilson(0, 8)[1], 1.0))
    low, high = paired_difference(0, 0, 0, 8)
    assert low == -high < -0.3, (
        "no success of either in 8 episodes is no proof that they are alike"
    )
