"""Intervals against an independent library."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from skyarm.studies.sweep.intervals import GROUPS, bootstrap_mean, bootstrap_quantiles, quantiles, wilson


@pytest.mark.parametrize(("successes", "count"), [(0, 1), (1, 1), (0, 40), (40, 40), (7, 40), (39, 40), (123, 100_000)])
@pytest.mark.parametrize("confidence", [0.9, 0.95, 0.99])
def test_the_interval_of_a_share_is_that_of_an_independent_library(
    successes: int, count: int, confidence: float
) -> None:
    wanted = stats.binomtest(successes, count).proportion_ci(confidence, method="wilson")
    # the same closed form in another order of operations
    assert wilson(successes, count, confidence) == pytest.approx((wanted.low, wanted.high), rel=1e-12, abs=1e-15)


def test_no_trials_say_nothing() -> None:
    assert wilson(0, 0) == (0.0, 1.0)


def test_the_interval_of_a_share_covers_it_as_often_as_it_says() -> None:
    won = np.random.default_rng(0).binomial(200, 0.9, size=4000)
    covered = np.mean([low <= 0.9 <= high for low, high in (wilson(int(k), 200) for k in won)])
    # the deviation of the count is 0.0034; the score interval itself is off by up to 0.015 at such counts
    assert abs(covered - 0.95) < 0.02


@pytest.mark.parametrize("share", [0.05, 0.25, 0.5, 0.95])
def test_quantiles_are_order_statistics(share: float) -> None:
    values = np.random.default_rng(1).normal(size=1001)
    assert quantiles(values, [share]) == [np.quantile(values, share, method="inverted_cdf")]
    assert quantiles(np.array([3.0]), [share]) == [3.0]


@pytest.mark.parametrize("share", [0.05, 0.5, 0.95])
def test_quantile_intervals_are_those_of_a_plain_bootstrap(share: float) -> None:
    values = np.random.default_rng(2).exponential(size=400)
    (found,) = bootstrap_quantiles(values, [share], seed=5, resamples=20_000)
    wanted = stats.bootstrap(
        (values,),
        lambda each, axis: np.quantile(each, share, axis=axis, method="inverted_cdf"),
        n_resamples=20_000,
        method="percentile",
        rng=np.random.default_rng(3),
    ).confidence_interval
    # two bootstraps of 20000 resamples each end within two neighbouring values of the sample
    ordered = np.sort(values)
    for mine, theirs in zip(found, wanted, strict=True):
        assert abs(int(np.searchsorted(ordered, mine)) - int(np.searchsorted(ordered, theirs))) <= 2


def test_mean_intervals_are_those_of_a_plain_bootstrap() -> None:
    values = np.random.default_rng(4).exponential(size=300)
    found = bootstrap_mean(values, seed=5, resamples=5000)
    wanted = stats.bootstrap(
        (values,), np.mean, n_resamples=5000, method="percentile", rng=np.random.default_rng(3)
    ).confidence_interval
    # the ends of an interval of 5000 resamples are known to about 3 % of its width; three of these are allowed
    assert found == pytest.approx(tuple(wanted), abs=0.09 * (wanted.high - wanted.low))


def test_many_values_are_resampled_in_groups_without_changing_the_interval() -> None:
    values = np.random.default_rng(6).exponential(size=3 * GROUPS + 5)
    low, high = bootstrap_mean(values, seed=1, resamples=1000)
    half = stats.norm.ppf(0.975) * values.std() / np.sqrt(values.size)
    # 49157 values: the mean is normal; the ends are known to 6 % of the width
    assert (low, high) == pytest.approx((values.mean() - half, values.mean() + half), abs=0.2 * half)


def test_intervals_are_the_same_for_the_same_seed_only() -> None:
    values = np.random.default_rng(7).normal(size=500)
    assert bootstrap_mean(values, 1) == bootstrap_mean(values, 1) != bootstrap_mean(values, 2)
    assert bootstrap_quantiles(values, [0.5], 1) == bootstrap_quantiles(values, [0.5], 1)
