"""The time of a governed reference: its curve against SciPy's, what a law is told
against differences of it.
"""

import dataclasses

import numpy as np
import pytest
from scipy.interpolate import BSpline

from skyarm.reference import Constant, Sine, Trajectory, hover
from skyarm.reference.path_time import PathTime, governed_reference

GENERATOR = np.random.default_rng(5)
STEP = 0.2
POINTS = np.cumsum(GENERATOR.uniform(0.0, STEP, 40))
PATH = PathTime(points=tuple(POINTS), step=STEP)
TIMES = np.linspace(0.3, PATH.duration - 0.3, 240)
# the spline's fifth derivative jumps at its knots: differences are taken between them
TIMES = TIMES[np.abs(TIMES / STEP - np.round(TIMES / STEP)) > 0.05]
MOTION = Trajectory(
    x=Sine(amplitude=1.3, frequency_hz=0.4),
    y=Sine(amplitude=0.7, frequency_hz=0.6, phase=0.4) + Constant(2.0),
    z=Constant(1.5),
    yaw=Sine(amplitude=0.5, frequency_hz=0.3),
    joints=(Sine(amplitude=0.8, frequency_hz=0.5), Constant(0.2)),
)


def test_the_curve_is_the_uniform_quintic_spline_of_its_points():
    knots = STEP * (np.arange(len(POINTS) + 6) - 5.0)
    spline = BSpline(knots, POINTS, 5)
    for order, found in enumerate(PATH.derivatives(TIMES)):
        assert np.allclose(
            found, spline(TIMES, nu=order), rtol=1e-11, atol=1e-9 / STEP**order
        )


def test_its_rate_stays_within_the_steps_between_its_points():
    rate = PATH.derivatives(np.linspace(0.0, PATH.duration, 5000))[1]
    steps = np.diff(POINTS) / STEP
    assert steps.min() <= rate.min()
    assert rate.max() <= steps.max()
    assert rate.min() >= 0.0


def test_even_points_are_the_flight_s_own_time():
    even = PathTime(points=tuple((i - 2) * STEP for i in range(30)), step=STEP)
    t = np.linspace(0.0, even.duration, 50)
    s, rate, *higher = even.derivatives(t)
    assert np.allclose(s, t, atol=1e-14)
    assert np.allclose(rate, 1.0, atol=1e-13)
    assert all(np.abs(each).max() < 1e-8 for each in higher)


def test_one_time_and_many_have_the_same_bits():
    many = PATH.derivatives(TIMES)
    for k in (0, 77, 199):
        assert [float(each) for each in PATH.derivatives(float(TIMES[k]))] == [
            float(each[k]) for each in many
        ]


def test_when_is_where_the_curve_has_come_to():
    for s in (1.0, 2.5, 3.7):
        assert abs(float(PATH.derivatives(PATH.instant_of(s))[0]) - s) < 1e-12
    assert PATH.instant_of(1e9) == PATH.duration


def numerically(read, order, h=2e-3):
    """A derivative of what a law is told, by central differences of the lower one."""
    weights = {-2: 1.0, -1: -8.0, 1: 8.0, 2: -1.0}
    return sum(
        w * np.stack(read(governed_reference(MOTION, PATH, TIMES + k * h))[order - 1])
        for k, w in weights.items()
    ) / (12.0 * h)


def base(r):
    zero = 0.0 * TIMES
    return [
        [c + zero for c in v]
        for v in (r.position, r.velocity, r.acceleration, r.jerk, r.snap)
    ]


def joints(r):
    named = (
        r.joints,
        r.joint_rates,
        r.joint_accelerations,
        r.joint_jerks,
        r.joint_snaps,
    )
    return [[c + 0.0 * TIMES for c in values] for values in named]


def heading(r):
    return [[c + 0.0 * TIMES] for c in (r.yaw, r.yaw_rate, r.yaw_acceleration)]


@pytest.mark.parametrize(
    ("read", "orders"),
    [(base, 4), (joints, 4), (heading, 2)],
    ids=["base", "joints", "heading"],
)
def test_what_is_told_are_derivatives_of_what_is_told(read, orders):
    told = read(governed_reference(MOTION, PATH, TIMES))
    for order in range(1, orders + 1):
        found = numerically(read, order)
        assert (
            np.abs(np.stack(told[order]) - found).max()
            < 2e-6 * np.abs(found).max() + 1e-9
        ), order


def test_what_rests_by_structure_rests_when_governed():
    told = governed_reference(hover([0.0, 0.0, 1.0], joints=[0.1]), PATH, 1.0)
    assert all(
        type(c) is int
        for c in (*told.velocity, *told.snap, *told.joint_rates, told.yaw_rate)
    )


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        (
            {"points": (0.0,) * 5, "step": 0.1},
            "path_time.points: 5, must be at least 6",
        ),
        (
            {"points": (0.0, 0.1, 0.2, 0.1, 0.3, 0.4), "step": 0.1},
            "never runs backwards",
        ),
        ({"points": (0.0,) * 6, "step": 0.0}, "path_time.step = 0.0: must be above 0"),
        (
            {"points": (0.0, float("nan"), 0.0, 0.0, 0.0, 0.0), "step": 0.1},
            "finite number",
        ),
    ],
)
def test_what_is_no_time_is_refused_in_one_line(fields, words):
    with pytest.raises(ValueError, match=words) as caught:
        PathTime(**fields)
    assert "\n" not in str(caught.value)


def test_a_path_s_time_is_a_record_that_can_be_replaced():
    assert dataclasses.replace(PATH, step=0.4).duration == 2.0 * PATH.duration
