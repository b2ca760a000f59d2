"""Central differences of fourth order: their points, and slopes of functions whose
derivatives are known.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from skyarm.algebra import Quaternion
from skyarm.studies.stability.open_loop import STEP_SIZE, derivatives, stencil_points

ATTITUDE = Quaternion(math.cos(0.2), math.sin(0.2), 0.0, 0.0)
PLAIN = (-2e8, 0.25, 40.0)


def base() -> np.ndarray:
    return np.array([3000.0, -0.5, -7.0, *ATTITUDE, *PLAIN])


def test_steps_are_relative_above_one_and_in_the_number_s_unit_below():
    points, widths = stencil_points(base(), ATTITUDE)
    assert widths == pytest.approx(
        STEP_SIZE * np.array([3000.0, 1.0, 7.0, 1.0, 1.0, 1.0, 2e8, 1.0, 40.0]),
        rel=1e-15,
    )
    moved = points[0, :4] - 3000.0
    assert moved == pytest.approx(np.array([-2.0, -1.0, 1.0, 2.0]) * 0.3, rel=1e-9)
    # each column moves one number, or turns
    others = (
        np.delete(points, [3, 4, 5, 6], axis=0)
        != np.delete(base(), [3, 4, 5, 6])[:, None]
    )
    assert others.sum(axis=0).tolist() == [1] * 12 + [0] * 12 + [1] * 12


def test_slopes_of_large_numbers_are_as_exact_as_of_small_ones():
    """Of 2 x at x = -2e8 a step of 1e-4 would leave 1e-4 of rounding, a relative one
    1e-12.
    """
    points, widths = stencil_points(base(), ATTITUDE)
    out = np.vstack([2.0 * points[7], np.sin(points[8]), points[9] ** 3])
    still = np.array([2.0 * PLAIN[0], math.sin(PLAIN[1]), PLAIN[2] ** 3])
    result, at = np.vstack([points, out]), np.append(base(), still)
    state, slopes, none, nothing = derivatives(result, at, widths, [10, 3, 0, 0])
    assert none.size == nothing.size == 0
    exact = np.zeros((3, 9))
    exact[0, 6], exact[1, 7], exact[2, 8] = 2.0, math.cos(0.25), 3.0 * 40.0**2
    np.testing.assert_allclose(slopes, exact, rtol=1e-10, atol=1e-12)
    # the state beside itself
    np.testing.assert_allclose(state, np.eye(9), rtol=1e-9, atol=1e-9)
