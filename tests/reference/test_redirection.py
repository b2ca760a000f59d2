"""Motions to a goal in flight: end conditions, derivatives, limits, and what is before
and after.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import skyarm
from skyarm.reference import Sine, Windowed, hover
from skyarm.reference.redirection import (
    NEVER,
    Redirected,
    quintic,
    redirectable,
    shortest_duration,
)

BEGIN = (0.4, -1.5, 2.5)
GOAL, DURATION = 3.0, 1.7


def polynomial() -> np.polynomial.Polynomial:
    """The quintic by a linear system of its six end conditions, by time."""
    T = DURATION
    rows = [
        [float(k == order) * math.factorial(order) for k in range(6)]
        for order in range(3)
    ]
    rows += [
        [
            math.perm(k, order) * T ** (k - order) if k >= order else 0.0
            for k in range(6)
        ]
        for order in range(3)
    ]
    return np.polynomial.Polynomial(np.linalg.solve(rows, [*BEGIN, GOAL, 0.0, 0.0]))


@pytest.mark.parametrize("u", [0.0, 0.1, 0.37, 0.5, 0.93, 1.0])
def test_the_quintic_is_the_polynomial_of_its_end_conditions(u):
    p = polynomial()
    expected = [
        p.deriv(order)(u * DURATION) if order else p(u * DURATION) for order in range(5)
    ]
    assert quintic(u, DURATION, *BEGIN, GOAL) == pytest.approx(
        expected, rel=1e-9, abs=1e-9
    )


def test_a_signal_is_its_own_until_it_leaves_for_its_goal_and_stays_there():
    own = Sine(amplitude=0.7, frequency_hz=0.5)
    value, velocity, acceleration, _, _ = own.derivatives(2.3)
    signal = Redirected(
        signal=own,
        start=2.3,
        duration=1.0,
        value=value,
        velocity=velocity,
        acceleration=acceleration,
        goal=-0.2,
    )
    for t in (0.0, 1.0, 2.2999):
        assert tuple(map(float, signal.derivatives(t))) == pytest.approx(
            own.derivatives(t), abs=0.0
        )
    assert tuple(map(float, signal.derivatives(2.3)))[:3] == pytest.approx(
        (value, velocity, acceleration), abs=1e-15
    )
    assert tuple(map(float, signal.derivatives(2.3))) == quintic(
        0.0, 1.0, value, velocity, acceleration, -0.2
    )
    for t in (3.3, 4.0, 1e4):
        assert tuple(map(float, signal.derivatives(t))) == (-0.2, 0.0, 0.0, 0.0, 0.0)
    for t in (2.5, 3.0, 3.2999):  # central differences of each derivative, 1e-5 s apart
        after, before = (
            np.array(signal.derivatives(t + d), dtype=float) for d in (1e-5, -1e-5)
        )
        assert (after - before)[:4] / 2e-5 == pytest.approx(
            np.array(signal.derivatives(t), dtype=float)[1:], abs=1e-4
        )
    assert signal.switch_times() == (2.3, 3.3)


def test_what_a_signal_would_have_done_after_its_start_is_no_switch_time():
    own = Windowed(Sine(amplitude=0.7, frequency_hz=0.5), 1.0, 5.0)
    assert Redirected(signal=own, start=3.0, duration=1.0).switch_times() == (
        1.0,
        3.0,
        4.0,
    )
    assert Redirected(signal=own).switch_times() == (1.0, 5.0)


def test_a_redirectable_reference_is_the_reference_to_the_bit():
    scenario = skyarm.load_scenario("case3")
    ours, own = redirectable(scenario.reference), scenario.reference
    assert ours.switch_times() == own.switch_times()
    for t in (0.0, 5.99, 6.0, 12.3, 25.0):
        a, b = ours.at(t), own.at(t)
        assert (a.position, a.yaw, a.joints, a.snap, a.joint_snaps) == (
            b.position,
            b.yaw,
            b.joints,
            b.snap,
            b.joint_snaps,
        )


def test_a_reference_without_a_goal_stays_for_longer_than_any_flight():
    assert Redirected(signal=Sine(amplitude=1.0, frequency_hz=1.0)).start == NEVER
    assert (
        redirectable(hover((1.0, 2.0, 3.0))).at(1e6).position
        == hover((1.0, 2.0, 3.0)).at(0.0).position
    )


def peaks(begins, goals, duration):
    """Largest speed and acceleration by a dense table."""
    u = np.linspace(0.0, 1.0, 2001)
    rows = [
        quintic(u, duration, *begin, goal)
        for begin, goal in zip(begins, goals, strict=True)
    ]
    return max(np.abs(row[1]).max() for row in rows), max(
        np.abs(row[2]).max() for row in rows
    )


@pytest.mark.parametrize(
    ("begins", "goals"),
    [
        ([(0.0, 0.0, 0.0)], [0.05]),
        ([(0.0, 0.0, 0.0)], [30.0]),
        ([(0.0, 0.0, 0.0), (1.0, 0.5, -0.3), (2.0, 0.0, 0.2)], [1.0, 2.0, 2.0]),
        ([(0.0, -0.6, 0.0)], [0.4]),
    ],
)
def test_a_motion_is_as_short_as_its_limits_let(begins, goals):
    duration = shortest_duration(begins, goals, 1.0, 1.0)
    # 1 %: between the instants that are looked at
    assert max(peaks(begins, goals, duration)) < 1.01
    assert max(peaks(begins, goals, duration / 1.06)) > 0.99


def test_rest_to_rest_has_the_known_peaks():
    """15/8 of the mean speed, 10/sqrt(3) of distance over time squared (Flash, Hogan
    1985).
    """
    assert shortest_duration([(0.0, 0.0, 0.0)], [20.0], 1.0, 100.0) == pytest.approx(
        37.5, rel=0.06
    )
    assert shortest_duration([(0.0, 0.0, 0.0)], [1.0], 100.0, 1.0) == pytest.approx(
        math.sqrt(10 / math.sqrt(3)), rel=0.06
    )


def test_a_motion_that_begins_too_fast_ends_all_the_same():
    duration = shortest_duration([(0.0, 3.0, 5.0)], [1.0], 1.0, 1.0)
    assert 0.1 <= duration < 20.0
    assert peaks([(0.0, 3.0, 5.0)], [1.0], duration)[1] < 8.0
