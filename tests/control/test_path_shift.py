"""The attitude of a base that shifts along a path: closed forms of a linear vehicle, and a flown circle."""

import dataclasses

import numpy as np
import pytest

import skyarm
from law_parts import step_of
from skyarm.algebra import Mat3, Quaternion, Vec3
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.attitude import Attitude, Posture
from skyarm.control.catalogue import preset
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.demands import _course
from skyarm.control.laws.centroidal.shift_motion import (
    ABOVE,
    AT_REST,
    BELOW,
    SwingPace,
    axis_step,
    path_step,
    swing_pace,
    with_shift,
)
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.log.metrics.windows import Window, Windows
from skyarm.reference import Constant, Sine, hover

TIP = "ee_error_mean_continuous"
G, DT, SIZE = 9.81, 0.005, 2.0


def constant(x, y, z, rate=0.0):
    still = Taylor((0.0,) * 5)
    return Vec3(still + x, still + y, Taylor((z, rate, 0.0, 0.0, 0.0)))


def hanging(lever, rate=0.0, com=0.0):
    """A posture whose tip hangs below the base's origin, farther by ``rate`` in m/s; the centre of mass at ``com``."""
    return Posture(constant(0.0, 0.0, com), constant(0.0, 0.0, -lever, -rate), ())


def sine(t, w):
    """Base along y, value to fourth derivative."""
    return [Vec3(0.0, SIZE * w**k * np.sin(w * t + 0.5 * np.pi * k), 0.0) for k in range(5)]


def flown(lever, w, seconds=3.0):
    """Memory, and base with what the attitude answers, after a linear vehicle's motion: u = (l / g) (a + u'')."""
    path, level, per = (AT_REST, AT_REST), hanging(lever), lever / G
    for k in range(round(seconds / DT)):
        base = sine(k * DT, w)
        answered = with_shift(path, base, level, G)
        asked = per * answered[3].y, per * answered[4].y
        kept = path, base, answered
        y = axis_step(path[1], tuple(each.y for each in base), asked, per, 5.0, DT)
        path = (AT_REST, y)
    return kept


@pytest.mark.parametrize(("lever", "w"), [(0.3, 1.0), (0.3, 3.0), (0.3, 5.0), (0.05, 6.0), (-0.3, 3.0)])
def test_on_a_sine_the_attitude_answers_the_shifted_path(lever, w):
    """u - (l / g) u'' = (l / g) a: u = (l / g) a / (1 + r) with r = l w^2 / g, so that a + u'' = a / (1 + r)."""
    _, base, answered = flown(lever, w)
    left = 1.0 / (1.0 + lever * w * w / G)
    size = [SIZE * w**k for k in range(5)]
    for k in (1, 2, 3, 4):
        assert answered[k].y == pytest.approx(left * base[k].y, abs=0.03 * abs(1.0 - left) * size[k])
        assert answered[k].x == 0.0
    assert answered[0] == base[0]


@pytest.mark.parametrize(("lever", "most"), [(0.3, BELOW), (-0.3, ABOVE)])
def test_a_pace_beyond_the_bound_counts_as_the_bound(lever, most):
    w = 1.5 * np.sqrt(most * G / abs(lever))
    (_, y), base, answered = flown(lever, w)
    assert y.size == pytest.approx((SIZE * w * w) ** 2, rel=0.02)
    assert answered[4].y - base[4].y == pytest.approx(-y.acceleration * most * G / abs(lever), rel=0.2)


def test_the_pace_of_a_sine_has_no_ripple():
    """Both means are constant along a sine, so that the pace is the same at its ends and in its middle."""
    found = []
    axis = AT_REST
    for k in range(400):
        axis = axis_step(axis, tuple(each.y for each in sine(k * DT, 3.0)), (0.0, 0.0), 0.03, 2.0, DT)
        found.append(axis.change / axis.size)
    assert found == pytest.approx([9.0] * len(found), rel=1e-9)


@pytest.mark.parametrize("rate", [50.0, 1000.0])
def test_means_that_are_faster_than_the_law_stay_means(rate):
    """At 20 Hz: two and a half time constants in a period and more, where a step by the slope goes far beyond."""
    axis, pace = AT_REST, SwingPace(rate=0.0, acceleration=0.0)
    for k in range(200):
        base = sine(0.05 * k, 3.0)
        axis = axis_step(axis, tuple(each.y for each in base), (0.0, 0.0), 0.03, rate, 0.05)
        pace = swing_pace(pace, [0.3, *(each.y for each in base[:4])], rate, 0.05)
    assert axis.size == pytest.approx((SIZE * 9.0) ** 2, rel=1e-9)
    assert axis.change == pytest.approx((SIZE * 27.0) ** 2, rel=1e-9)
    assert 0.0 <= pace.rate <= SIZE**2
    assert 0.0 <= pace.acceleration <= (SIZE * 3.0) ** 2


def test_a_path_at_rest_is_answered_as_it_is():
    """Whatever a wind that changes asks for: that is no motion along the path."""
    path, level, base = (AT_REST, AT_REST), hanging(0.3), [Vec3(0.0, 0.0, 1.5), *[Vec3(0.0, 0.0, 0.0)] * 4]
    for _ in range(400):
        path = tuple(axis_step(axis, tuple(each.y for each in base), (0.1, 0.5), 0.03, 2.0, DT) for axis in path)
    assert path[0].rate == pytest.approx(0.1)
    answered = with_shift(path, base, level, G)
    assert (answered[0], answered[2:]) == (base[0], base[2:])
    assert with_shift((), base, level, G) is base


def test_a_swing_under_a_steady_tilt_is_no_motion_along_the_path():
    """The tip of an arm that grows longer goes sideways under a tilt; the swing's own part answers that."""
    tilt, rate = 0.2, 0.4
    s, c = np.sin(tilt), np.cos(tilt)
    R = Mat3(Vec3(1.0, 0.0, 0.0), Vec3(0.0, c, -s), Vec3(0.0, s, c))
    zero, level = Vec3(0.0, 0.0, 0.0), hanging(0.3, rate)
    asked = [Vec3(0.0, -0.3 * s, 0.3 * (c - 1.0)), Vec3(0.0, -rate * s, rate * (c - 1.0)), zero]
    arguments = Taylor((0.0,) * 5), level, level, Attitude(R, zero, zero)
    model = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"), gravity=G)
    par = make_centroidal(model, mode="tip", path_rate=2.0, shift_bandwidth=60.0).par
    with pytest.raises(ControllerError, match=r"controller\.path_rate = 2\.0: must be 0 without shift_bandwidth"):
        make_centroidal(model, path_rate=2.0)
    base = sine(0.0, 2.0)
    _, y = path_step((AT_REST, AT_REST), base, asked, *arguments, par, DT)
    assert abs(y.rate) < 0.02 * abs(asked[1].y)
    # the same without a swing, of a base that turns: all of it is motion along the path, less the centre of mass's own
    turning, lower = Attitude(R, Vec3(0.5, 0.0, 0.0), zero), hanging(0.3, 0.0, -0.05)
    asked[1] = Vec3(0.0, -0.5 * 0.3 * c, 0.0)
    _, y = path_step((AT_REST, AT_REST), base, asked, arguments[0], lower, lower, turning, par, DT)
    assert y.rate == pytest.approx(-0.5 * (0.3 - 0.05) * c)


def test_one_step_finds_the_rate_of_a_known_pace():
    """Of u' = (l / g) (a' - w^2 u'), whatever it was before: a Newton step of a linear equation."""
    per, w2, jerk = 0.03, 9.0, 7.0
    axis = dataclasses.replace(AT_REST, size=1e6, change=w2 * 1e6, rate=0.4)
    found = axis_step(axis, (0.0, 0.0, 1.0, jerk, 0.0), (per * (jerk - w2 * axis.rate), 0.0), per, 2.0, 1e-9)
    assert found.rate == pytest.approx(per * jerk / (1.0 + per * w2), rel=1e-6)
    # of an arm above the base a Newton step would be a longer one, up to twice: what is asked for is taken as it is
    above = axis_step(axis, (0.0, 0.0, 1.0, jerk, 0.0), (-0.1, 0.0), -per, 2.0, 1e-9)
    assert above.rate == pytest.approx(-0.1, rel=1e-6)


def test_the_drag_that_is_answered_is_that_of_the_base_as_it_shifts():
    """A base that shifts with 2 m/s beside a reference at rest leans as one whose reference goes with 2 m/s."""
    model = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2_rotors"), gravity=G)
    made = make_centroidal(model, mode="tip", path_rate=2.0, shift_bandwidth=60.0)
    zero, joints = Vec3(0.0, 0.0, 0.0), (0.3, -0.4)
    state = State(position=zero, quaternion=Quaternion(1.0, 0.0, 0.0, 0.0), velocity=zero, rate=zero, joints=joints,
                  joint_rates=(0.0, 0.0), rotor_speeds=(500.0,) * 4)  # fmt: skip

    def leans(shifting, going):
        path = (dataclasses.replace(AT_REST, rate=shifting), AT_REST)
        x = Taylor((0.0, going, 0.0, 0.0, 0.0))
        signals = [x, *(Taylor((c, 0.0, 0.0, 0.0, 0.0)) for c in (0.0, 1.0, 0.0, *joints))]
        before = dataclasses.replace(made.memory.following, path=path)
        return np.array(_course(step_of(made.par, state, signals, DT, following=before)).still.R.rows)

    assert leans(2.0, 0.0) == pytest.approx(leans(0.0, 2.0), abs=1e-12)
    assert np.abs(leans(2.0, 0.0) - leans(0.0, 0.0)).max() > 1e-3


def test_the_tip_stays_on_a_fast_circle():
    """A circle of 1 m at 1.5 m/s: 1.9 mm without the part, and without what the rotors' hub drag changes along it."""
    scenario, turn = skyarm.load_scenario("case3", duration=5.0), 0.75 / np.pi
    x, y = Sine(amplitude=1.0, frequency_hz=turn, phase=0.5 * np.pi), Sine(amplitude=1.0, frequency_hz=turn)
    motion = dataclasses.replace(hover((0.0, 0.0, 1.5)), x=x, y=y, joints=(Constant(0.0), Constant(0.0)))
    # the law believes what it flies
    model = Model(vehicle=scenario.plant.vehicle, gravity=scenario.plant.gravity)
    windows = Windows(steady=Window(3.0, 5.0), gust=Window(3.0, 5.0), last=2.0)
    controller = preset("centroidal_tip", model)
    log = skyarm.run(dataclasses.replace(scenario, reference=motion, controller=controller, windows=windows))
    assert skyarm.score(log, [TIP])[TIP] < 0.001
