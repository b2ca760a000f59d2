"""Autoregressive noise models against normal equations by hand and a series without noise."""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.studies.identify.autoregression import ar_coefficients, innovations


def test_rounding_counts_as_white_noise_in_the_past():
    """Normal equations by hand of a series without mean and slope, with the rounding's variance on the diagonal."""
    rng = np.random.default_rng(1)
    lines = np.stack([np.ones(200), np.linspace(-1.0, 1.0, 200)], axis=1)
    raw = np.convolve(rng.normal(size=201), [1.0, 0.7], "valid")
    # what is fitted without the first three rows
    series = raw - lines @ np.linalg.lstsq(lines[3:], raw[3:], rcond=None)[0]
    past = np.stack([series[2 - i : 199 - i] for i in range(3)], axis=1)
    exact = np.linalg.solve(past.T @ past + 197 * 0.25 * np.eye(3), past.T @ series[3:])
    assert ar_coefficients([raw], 3, None, 0.5) == pytest.approx(exact, rel=1e-6)
    assert np.abs(ar_coefficients([raw], 3) - exact).max() > 0.05


def test_a_series_without_noise_has_moderate_coefficients():
    """Of a sine two of eight would do; the least of all that do are taken."""
    found = ar_coefficients([np.sin(0.3 * np.arange(400.0))], 8)
    assert np.abs(found).max() < 1.2
    left = innovations([np.sin(0.3 * np.arange(400.0))[:, None]], found[None, :])
    assert left.shape == (392, 1)
    assert np.abs(left).max() < 1e-2


def test_windows_are_means_of_what_is_past():
    """Each twice as long as the one before; before the series, the mean of its first rows."""
    rng, order = np.random.default_rng(3), 4
    rows = rng.normal(size=(90, 2)) + 5.0
    whole = np.concatenate([np.tile(rows[:order].mean(axis=0), (40, 1)), rows])
    for k, (near, far) in enumerate([(4, 8), (8, 16), (16, 32)]):
        filters = np.zeros((2, order + 3))
        filters[:, order + k] = 0.5, -2.0
        found = innovations([rows], filters, 3)
        for i in (4, 9, 30, 89):
            past = whole[40 + i - far : 40 + i - near].mean(axis=0)
            assert found[i - order] == pytest.approx(rows[i] - np.array([0.5, -2.0]) * past)


def test_white_noise_on_a_slow_random_walk_leaves_no_colour_over_seconds():
    """Innovations of it: their spectrum below a hundredth of the clock is flat with windows."""
    rng, size = np.random.default_rng(4), 20_000
    series = rng.normal(size=size) + 0.05 * np.cumsum(rng.normal(size=size))

    def slow_share(windows):
        left = innovations([series[:, None]], ar_coefficients([series], 8, windows=windows)[None, :], windows)[:, 0]
        power = np.abs(np.fft.rfft(left)) ** 2
        return power[10 : len(left) // 100].mean() / power.mean()

    assert slow_share(6) == pytest.approx(1.0, abs=0.2)
    assert slow_share(0) < 0.6
