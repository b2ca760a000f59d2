"""Piecewise polynomials, curves of B-splines and motions of least snap, against
SciPy.
"""

import numpy as np
import pytest
from scipy.interpolate import BSpline, make_interp_spline

from skyarm.compile import trace
from skyarm.reference.splines import (
    Polynomials,
    interpolating_points,
    minimum_snap,
    snap_cost,
    span_powers,
    uniform_curve,
)

TIMES, VALUES = (0.5, 1.5, 3.0, 3.7, 5.0), (0.0, 1.0, 0.5, 2.0, 1.0)
REST = [(1, 0.0), (2, 0.0), (3, 0.0)]
MOTION = minimum_snap(TIMES, VALUES)


def test_the_motion_of_least_snap_is_the_spline_of_seventh_degree():
    spline = make_interp_spline(TIMES, VALUES, k=7, bc_type=(REST, REST))
    t = np.linspace(0.5, 5.0 - 1e-9, 101)
    for order, found in enumerate(MOTION.derivatives(t)):
        # rounding of seventh powers
        np.testing.assert_allclose(found, spline(t, order), atol=1e-9)


def test_no_other_derivatives_at_the_inner_points_cost_less():
    # an own cost of Hermite pieces, minimised by SciPy from zero
    def cost(free):
        total = 0.0
        ends = np.zeros((5, 4))
        ends[:, 0], ends[1:4, 1:] = VALUES, free.reshape(3, 3)
        for i in range(4):
            pair = make_interp_spline(
                TIMES[i : i + 2],
                VALUES[i : i + 2],
                k=7,
                bc_type=(
                    [(k, ends[i, k]) for k in (1, 2, 3)],
                    [(k, ends[i + 1, k]) for k in (1, 2, 3)],
                ),
            )
            nodes, weights = np.polynomial.legendre.leggauss(8)
            half = 0.5 * (TIMES[i + 1] - TIMES[i])
            total += (
                half * (weights * pair(TIMES[i] + half * (nodes + 1.0), 4) ** 2).sum()
            )
        return total

    inner = np.array([list(MOTION.derivatives(t)[1:4]) for t in TIMES[1:4]]).ravel()
    least = cost(inner)
    assert snap_cost(span_powers(TIMES), MOTION.coefficients) == pytest.approx(
        least, rel=1e-9
    )
    # a quadratic cost whose slope is zero along each of the nine directions has its
    # minimum here
    for way in np.diag(1e-2 * np.abs(inner) + 1e-3):
        up, down = cost(inner + way), cost(inner - way)
        assert min(up, down) > least
        assert abs(up - down) < 1e-6 * (up + down - 2.0 * least) + 1e-9 * least


def test_it_is_held_before_and_after():
    assert MOTION.derivatives(0.0) == (0.0, 0.0, 0.0, 0.0, 0.0)
    value, *rest = MOTION.derivatives(7.0)
    assert (value, rest) == (pytest.approx(1.0, abs=1e-12), [0.0] * 4)
    assert MOTION.switch_times() == (0.5, 5.0)


def test_floats_arrays_and_programs_agree_to_the_last_bit():
    times = [0.1, 0.5, 1.49, 1.5, 2.2, 3.0, 3.69, 4.99, 5.0, 6.0]
    table = np.array(
        [
            np.broadcast_to(row, len(times))
            for row in MOTION.derivatives(np.array(times))
        ]
    )
    program = trace(lambda inputs: MOTION.derivatives(inputs[0]), (0.0,))
    for column, t in zip(table.T, times, strict=True):
        assert tuple(column) == MOTION.derivatives(t) == tuple(program.flat([t]))


def test_the_uniform_curve_is_the_b_spline_of_its_control_points():
    points = list(np.random.default_rng(3).normal(size=12))
    curve = uniform_curve(points, 2.0, 0.25)
    spline = BSpline(2.0 + 0.25 * np.arange(-5, 13), points, 5)
    t = np.linspace(2.0, 2.0 + 0.25 * 7 - 1e-9, 60)
    for order, found in enumerate(curve.derivatives(t)):
        np.testing.assert_allclose(found, spline(t, order), rtol=1e-9, atol=1e-9)
    assert min(points) <= curve.derivatives(t)[0].min()
    assert curve.derivatives(t)[0].max() <= max(points)


def test_control_points_interpolate_what_is_smooth():
    points = interpolating_points(np.sin(3.0 * np.arange(-14, 45) * 0.1))[12:-12]
    curve = uniform_curve(points, 0.0, 0.1)
    t = np.linspace(0.0, 2.99, 50)
    # the curve's own error is h^6 w^6 / 30 = 2.4e-5 at most
    np.testing.assert_allclose(curve.derivatives(t)[0], np.sin(3.0 * t), atol=2.4e-5)


def test_knots_and_pieces_must_fit():
    with pytest.raises(
        ValueError,
        match=r"polynomials\.knots: 3, must be one more than the 1 polynomials",
    ):
        Polynomials((0.0, 1.0, 2.0), ((0.0,),))
