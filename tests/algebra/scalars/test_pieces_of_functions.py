"""Where elementary functions change from one formula to another: no bias in a piece,
and the library's exact values.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from skyarm.algebra.scalars import elementary
from skyarm.algebra.scalars.taylor import Taylor

mpmath = pytest.importorskip("mpmath")

EDGES = [
    0.0,
    math.atan(0.66),
    math.pi / 4,
    1.0,
    math.pi / 2 - math.atan(0.66),
    math.pi / 2,
]
EDGES += [
    2.0,
    math.pi / 2 + math.atan(0.66),
    3 * math.pi / 4,
    math.pi - math.atan(0.66),
    math.pi,
]
PIECES = list(pairwise(sorted(EDGES)))


def errors(y, x):
    """Errors of atan2 in units of the last place of the true angle."""
    with mpmath.workdps(50):
        exact = [
            mpmath.atan2(mpmath.mpf(b), mpmath.mpf(a))
            for b, a in zip(y, x, strict=True)
        ]
        found = [elementary.atan2(b, a) for b, a in zip(y, x, strict=True)]
        return np.array(
            [
                float((f - e) / math.ulp(abs(float(e))))
                for f, e in zip(found, exact, strict=True)
            ]
        )


@pytest.mark.parametrize(
    "piece", PIECES, ids=lambda piece: f"{piece[0]:.3f}-{piece[1]:.3f}"
)
def test_no_piece_of_atan2_leans_to_one_side(piece):
    """Its mean error is at most half a unit, as what a constant lacks is rounded to the
    nearer whole number of units.

    Between 45 degrees and one radian pi/2 lacks 0.55: one is added and 0.45 are too
    much. 600 points let the mean stray by 0.015. The lower half plane is the upper
    one's mirror to the bit.
    """
    rng = np.random.default_rng(7)
    angles, radii = rng.uniform(*piece, 600), 10.0 ** rng.uniform(-3.0, 3.0, 600)
    y, x = (radii * np.sin(angles)).tolist(), (radii * np.cos(angles)).tolist()
    found = errors(y, x)
    assert abs(found.mean()) <= 0.5
    assert np.abs(found).max() <= 1.5
    assert [elementary.atan2(-b, a) for b, a in zip(y, x, strict=True)] == [
        -elementary.atan2(b, a) for b, a in zip(y, x, strict=True)
    ]


QUARTERS = [
    (0.0, 1.0),
    (1.0, 1.0),
    (1.0, 0.0),
    (1.0, -0.0),
    (1.0, -1e-300),
    (1e300, -1e-300),
    (1.0, -1.0),
    (0.0, -1.0),
]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("y", "x"), QUARTERS)
def test_multiples_of_an_eighth_turn_are_rounded_correctly(y, x, sign):
    """To the last bit: laws ask for them, and a right angle must not depend on the sign
    of a zero.
    """
    with mpmath.workdps(700):
        exact = float(
            mpmath.atan2(mpmath.mpf(y), mpmath.mpf(x))
            if (y, x) != (1.0, -0.0)
            else mpmath.pi / 2
        )
    assert elementary.atan2(sign * y, x) == sign * exact


@pytest.mark.parametrize("t", [0.66, 1.0, math.tan(math.pi / 8), 0.6666, 0.625])
def test_the_arctangent_has_no_step_where_its_formula_changes(t):
    """Both neighbours of a seam, in each of the eight sectors that it is used for."""
    for slope in (math.nextafter(t, 0.0), t, math.nextafter(t, 2.0)):
        points = [(slope, 1.0), (1.0, slope), (1.0, -slope), (slope, -1.0)]
        y, x = zip(*(points + [(-b, a) for b, a in points]), strict=True)
        assert np.abs(errors(y, x)).max() <= 1.5


def test_the_first_derivative_of_a_series_is_its_own_coefficient():
    """k c_k of a polynomial, which NumPy differentiates; the whole numbers of structure
    are kept, as no power is 0.
    """
    coefficients = (0.5, -1.25, 2.0, 3.0, -4.0)
    found = Taylor(coefficients).derivative_series()
    assert list(found.c) == np.polynomial.Polynomial(coefficients).deriv().coef.tolist()
    still = Taylor((7.0, 1, 0, 0)).derivative_series()
    assert still.c == (1, 0, 0)
    assert [type(c) for c in still.c] == [int, int, int]


def test_structure_of_a_series_survives_its_derivatives():
    """A time that runs: value t, slope 1; the first derivative is the structural one,
    those above fold away.
    """
    time = Taylor.of_derivatives((3.0, 1, 0, 0))
    assert [type(c) for c in time.c] == [float, int, int, int]
    assert [type(time.derivative(k)) for k in range(4)] == [float, int, int, int]
    assert (time.derivative(1), time.derivative(2)) == (1, 0)
    cubes = (time * time * time).derivative_series()
    assert [float(cubes.derivative(k)) for k in range(3)] == [27.0, 18.0, 6.0]
