"""Taylor series against mpmath's numerical derivatives of the same functions of
time.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from skyarm.algebra.scalars import (
    absolute,
    clip,
    cos,
    divide,
    maximum,
    minimum,
    sign,
    sin,
    sqrt,
    where,
)
from skyarm.algebra.scalars.taylor import Taylor, choose, inverse_root
from skyarm.compile import trace

mpmath = pytest.importorskip("mpmath")

A, B = (0.3, 1.1, -0.4, 0.25, 0.05), (1.7, -0.2, 0.3, 0.1, -0.06)
"""Coefficients of two polynomials of time."""


def polynomial(coefficients, t):
    return sum(mpmath.mpf(c) * t**k for k, c in enumerate(coefficients))


FUNCTIONS = {
    "product": (lambda a, b: a * b, lambda a, b: a * b),
    "quotient": (lambda a, b: a / b, lambda a, b: a / b),
    "reciprocal": (lambda a, b: 2.5 / b, lambda a, b: 2.5 / b),
    "divide": (divide, lambda a, b: a / b),
    "sine": (lambda a, b: sin(a), lambda a, b: mpmath.sin(a)),
    "cosine": (lambda a, b: cos(a), lambda a, b: mpmath.cos(a)),
    "root": (lambda a, b: sqrt(b), lambda a, b: mpmath.sqrt(b)),
    "inverse root": (lambda a, b: inverse_root(b), lambda a, b: 1 / mpmath.sqrt(b)),
    "inverse eighth root": (
        lambda a, b: inverse_root(b, 3),
        lambda a, b: b ** mpmath.mpf("-0.125"),
    ),
    "difference": (lambda a, b: 1.0 - a - (b - 2.0), lambda a, b: 1 - a - (b - 2)),
    "absolute": (lambda a, b: absolute(-a) + absolute(b), lambda a, b: a + b),
    "maximum": (lambda a, b: maximum(a, b) - maximum(0.0, a), lambda a, b: b - a),
    "minimum": (lambda a, b: minimum(a, 2.0) * sign(-b), lambda a, b: -a),
    "clip": (lambda a, b: clip(b, a, 1.0) + clip(b, 0.0, 2.0), lambda a, b: 1 + b),
    "all": (
        lambda a, b: sin(a * b) / sqrt(b) - cos(a) * 3.0,
        lambda a, b: mpmath.sin(a * b) / mpmath.sqrt(b) - 3 * mpmath.cos(a),
    ),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_derivatives_are_those_of_a_high_precision_differentiation(name):
    ours, theirs = FUNCTIONS[name]
    found = ours(Taylor(A), Taylor(B))
    with mpmath.workdps(60):
        expected = mpmath.taylor(
            lambda t: theirs(polynomial(A, t), polynomial(B, t)), 0, 4
        )
    # a handful of roundings of numbers near one
    np.testing.assert_allclose(
        found.c, [float(c) for c in expected], rtol=1e-13, atol=1e-14
    )


def test_derivatives_carry_the_factorials():
    derivatives = (0.5, -1.0, 2.0, 3.0, -4.0)
    series = Taylor.of_derivatives(derivatives)
    assert [series.derivative(k) for k in range(5)] == pytest.approx(
        derivatives, rel=1e-15
    )
    assert series.c[4] == pytest.approx(-4.0 / math.factorial(4), rel=1e-15)
    assert [
        series.derivative_series().derivative(k) for k in range(4)
    ] == pytest.approx(derivatives[1:], rel=1e-15)


def test_a_constant_costs_nothing():
    moving, still = Taylor(A), Taylor.constant(2.0, 4)
    assert all(type(c) is int for c in (still * still).c[1:])
    assert (moving * still).c == (moving * 2.0).c


def test_a_choice_takes_every_coefficient_of_one_side():
    assert choose(True, Taylor(A), Taylor(B)).c == A
    assert choose(False, Taylor(A), 3.0).c == (3.0, 0.0, 0.0, 0.0, 0.0)


def test_a_traced_number_and_a_series_of_traced_numbers_combine_in_either_order():
    def function(x, dx, y):
        t = Taylor((x, dx))
        both = [
            y + t,
            t + y,
            y - t,
            t - y,
            y * t,
            t * y,
            y / t,
            t / y,
            divide(y, t),
            divide(t, y),
        ]
        both += [
            maximum(y, t),
            maximum(t, y),
            where(y > t, t, y),
            where(y < t, t, y),
            where(y >= t, y, t),
        ]
        both += [where(y <= t, y, t)]
        return tuple(c for each in both for c in each.c)

    x, dx, y = 0.7, -0.3, 1.9
    slope = 1.0 / (x * x)
    values = [
        y + x,
        x + y,
        y - x,
        x - y,
        y * x,
        x * y,
        y / x,
        x / y,
        y / x,
        x / y,
        y,
        y,
        x,
        y,
        y,
        x,
    ]
    slopes = [
        dx,
        dx,
        -dx,
        dx,
        y * dx,
        y * dx,
        -y * slope * dx,
        dx / y,
        -y * slope * dx,
        dx / y,
        0,
        0,
        dx,
        0,
        0,
        dx,
    ]
    given = trace(function, x, dx, y).flat((x, dx, y))
    np.testing.assert_allclose(given[::2], values, rtol=1e-15)
    np.testing.assert_allclose(given[1::2], slopes, rtol=1e-15)
