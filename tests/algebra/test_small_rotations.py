"""The series of a small rotation, term by term."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest

from skyarm.algebra import Quaternion, Vec3


@pytest.mark.parametrize("angle", [1.0, 3.0, 6.0, 10.0])
@pytest.mark.parametrize("seconds", [1.0, 0.25])
def test_the_series_are_taylors_of_sine_and_cosine_of_a_quarter_of_the_angle(
    angle, seconds
):
    """In exact fractions, up to y^11 and y^12: what is left out hides no wrong
    coefficient. Rounding is 1e-15.
    """
    y = Fraction(angle) / 4
    sine = sum(
        (-1) ** k * y ** (2 * k + 1) / math.factorial(2 * k + 1) for k in range(6)
    )
    cosine = sum((-1) ** k * y ** (2 * k) / math.factorial(2 * k) for k in range(7))
    w, x, y, z = Quaternion.of_small_rotation(
        Vec3(0.6 * angle / seconds, 0.0, -0.8 * angle / seconds), seconds
    )
    assert w == pytest.approx(float(1 - 2 * sine * sine), abs=4e-15)
    assert [x, y, z] == pytest.approx(
        [s * float(2 * sine * cosine) for s in (0.6, 0.0, -0.8)], abs=4e-15
    )
