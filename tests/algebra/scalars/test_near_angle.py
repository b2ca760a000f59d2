"""Angles beside known ones, against the sine and cosine of their sums, and what they cost."""

import math

import numpy as np
import pytest

from skyarm.algebra.scalars import cos, sin
from skyarm.algebra.scalars.near_angle import NearAngle
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.compile import trace
from skyarm.compile.tracing.lower import operations


@pytest.mark.parametrize(("rest", "off"), [(0.0, 3e-16), (0.2, 1e-12), (-0.5, 4e-10), (1.0, 2e-7), (-3.0, 2e-3)])
def test_sine_and_cosine_are_those_of_the_sum(rest, off):
    for known in np.linspace(-7.0, 7.0, 41).tolist():
        angle = NearAngle(known, rest)
        assert sin(angle) == pytest.approx(math.sin(known + rest), abs=off)
        assert cos(angle) == pytest.approx(math.cos(known + rest), abs=off)


def test_a_sum_is_that_of_the_known_and_of_the_rests():
    angle = NearAngle(0.4, 0.1) + NearAngle(-1.3, 0.2)
    assert (angle.known, angle.rest) == pytest.approx((-0.9, 0.3))
    assert sin(angle) == pytest.approx(math.sin(-0.6), abs=1e-11)


def test_a_series_may_begin_with_one():
    near, plain = Taylor((NearAngle(0.7, 0.02), 1.1, -0.3)), Taylor((0.72, 1.1, -0.3))
    for function in (sin, cos):
        assert function(near).c == pytest.approx(function(plain).c, abs=1e-15)


def test_beside_a_known_angle_it_takes_half_of_the_operations():
    def both(x):
        return sin(x), cos(x)

    alone = operations(trace(both, 0.3).lowered.nodes)
    beside = operations(trace(lambda x, d: (both(x), both(NearAngle(x, d))), 0.3, 0.1).lowered.nodes)
    assert beside <= 1.5 * alone


def test_more_terms_reach_farther():
    assert sin(NearAngle(0.4, 3.0, 6)) == pytest.approx(math.sin(3.4), abs=2e-6)
    assert cos(NearAngle(0.2, 1.5, 6) + NearAngle(0.2, 1.5, 6)) == pytest.approx(math.cos(3.4), abs=2e-6)
