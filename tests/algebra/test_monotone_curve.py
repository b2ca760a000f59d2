"""Monotone cubic curves against SciPy's, beyond their ends too, and back again."""

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from skyarm.algebra.monotone_curve import curve, inverse_curve

XS = [0.0, 0.4, 1.0, 1.3, 2.5]
YS = [0.5, 0.6, 1.9, 2.8, 3.0]
SCIPY = PchipInterpolator(XS, YS)


@pytest.mark.parametrize("x", np.linspace(0.0, 2.5, 26))
def test_a_value_between_points_is_scipy_s(x):
    assert curve(x, XS, YS) == pytest.approx(float(SCIPY(x)), rel=1e-14)


def test_beyond_the_ends_it_is_constant_and_linear():
    steep = [0.5, 0.6, 1.9, 2.0, 3.5]
    last = float(PchipInterpolator(XS, steep).derivative()(2.5))
    assert last > 1.0
    assert [curve(x, XS, YS) for x in (-1.0, 0.0)] == [0.5, 0.5]
    assert curve(4.0, XS, steep) == pytest.approx(3.5 + 1.5 * last, rel=1e-14)
    assert inverse_curve(3.5 + 1.5 * last, XS, steep) == pytest.approx(4.0, rel=1e-14)


@pytest.mark.parametrize("x", np.linspace(0.05, 2.45, 13))
def test_the_inverse_comes_back(x):
    assert inverse_curve(curve(x, XS, YS), XS, YS) == pytest.approx(x, abs=1e-12)
