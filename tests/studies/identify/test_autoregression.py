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
