"""The least tip error in gusts, by two roads; the filter of the shift that comes from it, and a flight with it."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm, solve_continuous_lyapunov, solve_discrete_are, solve_discrete_lyapunov

import skyarm
from skyarm.algebra import Mat3, Vec3
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.attitude import Attitude, posture
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.force_trend import rate_weight
from skyarm.control.laws.centroidal.shift_motion import (
    GustMemory,
    SlowForce,
    gust_gains,
    shift_acceleration,
    slow_force,
    steady_force,
)
from skyarm.control.model import Model
from skyarm.dynamics.kinematics import frame_pose
from skyarm.studies.compare.envelope_axes import AXES
from skyarm.studies.compare.envelope_setting import setting_of

G = 9.81
DT = 0.005
PUSHED = Vec3(5.0, -2.0, 1.0)


def least_error(lever, airspeed, length, deviation, late=0, dt=2.5e-3, effort=1e-7):
    """Root mean square of the tip, m, under Dryden's lateral gusts of the force, which a law knows.

    c'' = g theta + d and tip = c - lever theta; the discrete linear quadratic optimum of theta', ``late`` steps old.
    """
    time, n = length / airspeed, 5 + late
    A = np.zeros((5, 5))
    A[0, 1], A[1, 2] = 1.0, G
    A[3, 4], A[4, 3], A[4, 4] = 1.0, -1.0 / time**2, -2.0 / time
    gust, white = np.array([1.0, np.sqrt(3.0) * time]), np.diag([0.0, 0.0, 0.0, 0.0, 1.0])
    P = solve_continuous_lyapunov(A[3:, 3:], -white[3:, 3:])
    A[1, 3:] = gust * deviation / np.sqrt(gust @ P @ gust)
    B = np.array([0.0, 0.0, 1.0, 0.0, 0.0])
    step = expm(np.block([[A, B[:, None]], [np.zeros((1, 6))]]) * dt)
    F, H, C = np.zeros((n, n)), np.zeros((n, 1)), np.zeros((1, n))
    F[:5, :5] = step[:5, :5]
    if late:
        F[:5, 5] = step[:5, 5]
        F[5:-1, 6:] = np.eye(late - 1)
        H[-1] = 1.0
    else:
        H[:5, 0] = step[:5, 5]
    C[0, 0], C[0, 2] = 1.0, -lever
    S, Q = solve_discrete_are(F, H, C.T @ C, [[effort]]), np.zeros((n, n))
    K = (H.T @ S @ F) / (effort + (H.T @ S @ H)[0, 0])
    Q[4, 4] = dt
    return float(np.sqrt((C @ solve_discrete_lyapunov(F - H @ K, Q) @ C.T)[0, 0]))


def foretold_share(pace, airspeed, length):
    """D(p) per deviation: what a pulse of the white noise that makes d adds to the integral of exp(-p t) d(t) to come.

    Dryden's lateral spectrum: d = k (1 + sqrt(3) T s) / (1 + T s)^2 w, T = length / airspeed.
    """
    T = length / airspeed
    answer = lambda s: (1.0 + np.sqrt(3.0) * T * s) / (1.0 + T * s) ** 2  # noqa: E731
    variance = quad(lambda w: abs(answer(1j * w)) ** 2 / np.pi, 0.0, np.inf)[0]
    return answer(pace) / np.sqrt(variance)


@pytest.mark.parametrize("late", [0, 4, 20])
@pytest.mark.parametrize(("airspeed", "deviation"), [(3.0, 0.39), (6.0, 0.99)])
def test_the_least_error_of_a_hanging_tip_has_a_closed_form(airspeed, deviation, late):
    """E tip^2 = 2 D(p)^2 exp(2 p late) / p^3, p^2 = g / lever: the page's table has it."""
    lever, dt = 0.282, 2.5e-3
    p = np.sqrt(G / lever)
    # tip = (2 / p) eta with eta' = -p eta + D(p) w; what comes later has grown by exp(p late)
    closed = (2.0 / p) * foretold_share(p, airspeed, 3.0) * deviation / np.sqrt(2.0 * p) * np.exp(p * late * dt)
    assert least_error(lever, airspeed, 3.0, deviation, late, dt) == pytest.approx(closed, rel=0.05)


@pytest.fixture(scope="module")
def model():
    return Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"), gravity=G)


def test_the_shift_goes_to_a_force_that_stays_as_a_critically_damped_system(model):
    """Against the matrix exponential of c'' = -w^2 (c - d) - 2 w c', with the pace held by a force far beyond noise."""
    par = make_centroidal(model, mode="tip", preset="adaptive", gust_shift=1.0).par
    assert par.tip.shift.gust == gust_gains(1.0, model.vehicle, G)
    w = float(par.tip.shift.gust.pace)
    assert w == pytest.approx(np.sqrt(G / 0.3))
    shift = dataclasses.replace(par.tip.shift, gust=dataclasses.replace(par.tip.shift.gust, size=1e-9))
    par = dataclasses.replace(par, tip=dataclasses.replace(par.tip, shift=shift))
    force, memory, t = Vec3(0.0, 0.0, 0.0), GustMemory(rate=Vec3(0.0, 0.0, 0.0)), 0.0
    A = np.array([[0.0, 1.0], [-w * w, -2.0 * w]])
    for _ in range(60):
        found = slow_force(par, force, memory, PUSHED, DT)
        force, memory, t = found.force, found.memory, t + DT
        value, rate = expm(A * t) @ np.array([-1.0, 0.0])
        np.testing.assert_allclose([*force], (1.0 + value) * np.array([*PUSHED]), rtol=1e-9)
        np.testing.assert_allclose([*found.rate], rate * np.array([*PUSHED]), rtol=1e-9)
        bend = (A @ [value, rate])[1]
        np.testing.assert_allclose([*found.bend], bend * np.array([*PUSHED]), rtol=1e-8, atol=1e-9)


def test_small_changes_are_followed_slowly(model):
    """The rate of the shift after one period, over that of a filter of one pace: shift_rate below ``size``, p above."""
    par = make_centroidal(model, mode="tip", preset="adaptive", gust_shift=1.0).par
    still = Vec3(0.0, 0.0, 0.0), GustMemory(rate=Vec3(0.0, 0.0, 0.0))
    paces = []
    for size in (1e-4, float(par.tip.shift.gust.size), 1e3):
        rate = float(slow_force(par, *still, Vec3(0.0, size, 0.0), 1e-6).rate.y)
        paces.append(np.sqrt(rate / (size * 1e-6)))
    slow, quick = float(par.tip.shift_rate), float(par.tip.shift.gust.pace)
    np.testing.assert_allclose(paces, [slow, 0.5 * (slow + quick), quick], rtol=1e-4)


def test_of_a_hover_the_shift_is_that_of_the_lever(model):
    """Sideways by the tip's height, along the arm's plane by that of its first joint, whose links stay level."""
    par = make_centroidal(model, mode="tip", preset="adaptive", gust_shift=1.0).par
    still = Attitude(Mat3.identity(), Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0))
    weight = float(model.vehicle.mass) * G
    force = Vec3(*(Taylor((value, 0.0, 0.0)) for value in (0.0, 0.0, weight)))
    joints = (Taylor((0.0,) * 5),) * 2
    moved = shift_acceleration(par, still, force, joints, posture(model.vehicle, joints, 4), PUSHED)
    tip = float(frame_pose(model.vehicle, model.vehicle.frame(), (0.0, 0.0)).p.z)
    joint = float(model.vehicle.links[0].joint.position.z)
    np.testing.assert_allclose([*moved], np.array([joint * 5.0, tip * -2.0, 0.0]) / weight, atol=1e-4)


@pytest.mark.thorough
def test_wind_steps_move_the_tip_less(model):
    """Steps of 3 N from the side, perfect state; and the axis of the envelope is flown to its end."""
    setting = setting_of(duration=9.5)
    hover = dataclasses.replace(AXES["wind_steps"].scenario(setting, 3.0), noise=setting.hover.noise)
    errors = []
    for share in (0.0, 1.0):
        law = make_centroidal(
            hover.controller.par.model, mode="tip", preset="adaptive", delay=hover.delays.measurement, gust_shift=share
        )
        log = skyarm.run(dataclasses.replace(hover, controller=law))
        assert log.status == "completed"
        off = np.linalg.norm(log.tip - log.tip_reference, axis=1)
        errors.append(off[log.time >= 5.5].mean())
    assert errors[1] < 0.9 * errors[0]


def test_it_is_refused_where_the_shift_has_no_motion(model):
    with pytest.raises(ControllerError, match=r"controller\.gust_shift = 1\.0: must be 0 without shift_bandwidth"):
        make_centroidal(model, mode="tip", preset="robust", gust_shift=1.0)


def test_it_is_refused_where_the_tip_is_not_held_and_no_pace_is_below_nothing(model):
    with pytest.raises(ControllerError, match=r"controller\.gust_shift = 1\.0: must be 0 in mode 'joint'"):
        make_centroidal(model, mode="joint", preset="adaptive", gust_shift=1.0)
    scenario = skyarm.load_scenario("case3_wind", controller="centroidal_tip")
    law = make_centroidal(scenario.controller.par.model, mode="tip", preset="adaptive", gust_shift=1.0)
    for name, value in (("pace", -1.0), ("size", 0.0)):
        with pytest.raises(ValueError, match=rf"gust\.{name}"):
            skyarm.Batch(dataclasses.replace(scenario, controller=law), [f"controller.tip.shift.gust.{name}"]).fly(
                {f"controller.tip.shift.gust.{name}": [value]}
            )


def test_what_is_foretold_passes_the_filter_by(model):
    """As far as the trend is believed: force, rate and bend against the mixture written out."""
    par = make_centroidal(model, mode="tip", preset="adaptive", gust_shift=1.0).par
    trend = dataclasses.replace(
        par.parts.trend.start(2), level=Vec3(2.0, 1.0, 0.0), rate=Vec3(0.3, -0.2, 0.0), agreement=0.75, size=1.0
    )
    slow = SlowForce(Vec3(1.5, 0.2, 0.1), Vec3(0.1, 0.5, 0.0), Vec3(-1.0, 2.0, 0.5))
    adapted, rate, late = np.array([2.5, 4.8, 5.9]), np.array([0.2, -0.1, 0.05]), 2.0 / 27.0
    steady = adapted + np.array([1.5, 0.2, 0.1])
    for engaged in (0.0, 0.5, 1.0):
        share = float(rate_weight(par.parts.trend, trend)) * (1.0 - engaged)
        assert (share > 0.1) == (engaged < 1.0)
        step = SimpleNamespace(rate=Vec3(*rate), trend=(trend.level, share), force=None)
        force, found = steady_force(par, step, slow, Vec3(*adapted))
        level, held = np.array([*trend.level]), np.array([*slow.force])
        np.testing.assert_allclose([*force], steady + (level - held) * share + rate * late, rtol=1e-12)
        np.testing.assert_allclose([*found.rate], np.array([*slow.rate]) * (1.0 - share) + rate, rtol=1e-12)
        np.testing.assert_allclose([*found.bend], np.array([*slow.bend]) * (1.0 - share), rtol=1e-12, atol=1e-15)
