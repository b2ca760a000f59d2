"""Low-pass filters against SciPy, and INDI's use of them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from skyarm.control.blocks.filters import (
    Taps,
    apply_butterworth,
    butterworth,
    low_pass,
    settle,
)

DT = 0.005
INPUT = np.cumsum(np.random.default_rng(3).normal(size=200))


@pytest.mark.parametrize("cutoff", [0.5, 15.0, 40.0, 90.0])
def test_the_filter_is_scipys_butterworth(cutoff):
    """1e-9 of the input's size: at 0.5 Hz both forms lose six digits to poles near
    one.
    """
    b, a = signal.butter(2, cutoff, fs=1.0 / DT)
    wanted, _ = signal.lfilter(b, a, INPUT, zi=signal.lfilter_zi(b, a) * 2.0)
    par = butterworth(cutoff, DT)
    taps, found = settle(2.0, par), []
    for value in INPUT.tolist():
        taps, out = apply_butterworth(taps, value, par)
        found.append(out)
    np.testing.assert_allclose(found, wanted, atol=1e-9 * np.abs(INPUT).max())


def test_a_settled_filter_does_not_move_at_its_value():
    par = butterworth(15.0, DT)
    taps = settle(3.5, par)
    for _ in range(100):
        taps, out = apply_butterworth(taps, 3.5, par)
        assert out == pytest.approx(3.5, rel=1e-14)


def test_a_filter_that_has_seen_nothing_starts_at_zero():
    par = butterworth(15.0, DT)
    assert apply_butterworth(Taps(), 1.0, par)[1] == pytest.approx(par.b0)


@pytest.mark.parametrize("bandwidth", [0.5, 20.0, 400.0])
def test_the_first_order_low_pass_is_scipys_zero_order_hold(bandwidth):
    a, b, *_ = signal.cont2discrete(
        tuple(np.array([[x]]) for x in (-bandwidth, bandwidth, 1.0, 0.0)), DT
    )
    found = wanted = 0.7
    for value in INPUT.tolist():
        found = low_pass(found, value, bandwidth, DT)
        wanted = float(a[0, 0] * wanted + b[0, 0] * value)
        assert found == pytest.approx(wanted, rel=1e-11, abs=1e-11)
