"""The least tip error in gusts, by two roads; the filter of the shift that comes from it, and a flight with it."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm, solve_continuous_lyapunov, solve_discrete_are, solve_discrete_lyapunov

import skyarm
from skyarm.algebra import Vec3
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.attitude import Posture
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.base_shift import FIRST_SHIFT, Acting, bounded_shift
from skyarm.control.laws.centroidal.force_trend import rate_weight
from skyarm.control.laws.centroidal.shift_motion import gust_gains, slow_force, steady_force
from skyarm.control.model import Model
from skyarm.studies.compare.envelope_axes import AXES
from skyarm.studies.compare.envelope_setting import setting_of
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Frame

G = 9.81
DT = 0.005


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


def at_one_pace(model, share=1.0):
    """Constants of the law with the pace held by a force far beyond noise."""
    par = make_centroidal(model, mode="tip", preset="adaptive", gust_shift=share).par
    shift = dataclasses.replace(par.tip.shift, gust=dataclasses.replace(par.tip.shift.gust, size=1e-9))
    return dataclasses.replace(par, tip=dataclasses.replace(par.tip, shift=shift))


def test_the_shift_goes_to_a_force_that_stays_as_a_critically_damped_system(model):
    """Against the matrix exponential of c'' = -w^2 (c - d) - 2 w c', with the lever that has the pace w of the arm."""
    par = at_one_pace(model)
    w = float(par.tip.shift.gust.pace)
    assert w == pytest.approx(np.sqrt(G / 0.3))
    vehicle = dataclasses.replace(
        skyarm.load_vehicle("hummingbird"),
        frames=(Frame(name="tip", link=BASE, position=Vec3(0.0, 0.0, -0.3)),),
        end_effector="tip",
    )
    par = dataclasses.replace(par, model=Model(vehicle=vehicle, gravity=G))
    zero, still = Vec3(0.0, 0.0, 0.0), Taylor((0.0,) * 5)
    level = Posture(Vec3(still, still, still), Vec3(still, still, still - 0.3), ())
    push, force, shift, dt = Vec3(0.2, -0.1, 0.0), zero, FIRST_SHIFT, 5e-4
    base = [zero] * 5
    end = np.array([*push])[:2] * (-0.3 / (G * float(vehicle.mass)))
    A, drifts = np.array([[0.0, 1.0], [-w * w, -2.0 * w]]), []
    for k in range(1000):
        before, force = force, slow_force(par, force, push, dt)
        acting = Acting(force=force, rate=zero, drift=(force - before) * (1.0 / dt), drag=0.0)
        _, drift, shift = bounded_shift(par, shift, base, still, level, acting, (), dt)
        drifts.append(drift.x)
        if k % 200 == 199:
            value, _ = expm(A * ((k + 1) * dt)) @ np.array([-1.0, 0.0])
            np.testing.assert_allclose([shift.place.x, shift.place.y], (1.0 + value) * end, rtol=0.02)
    # c'' begins with w^2 d, all of it of the rate that nobody foretold
    assert drifts[0] == pytest.approx(w * w * end[0], rel=0.02)


def test_small_changes_are_followed_slowly(model):
    """The rate of the filter after one period: shift_rate below ``size``, the arm's pace above."""
    par = make_centroidal(model, mode="tip", preset="adaptive", gust_shift=1.0).par
    assert par.tip.shift.gust == gust_gains(1.0, model.vehicle, G)
    paces = []
    for size in (1e-4, float(par.tip.shift.gust.size), 1e3):
        moved = float(slow_force(par, Vec3(0.0, 0.0, 0.0), Vec3(0.0, size, 0.0), 1e-6).y)
        paces.append(moved / (size * 1e-6))
    slow, quick = float(par.tip.shift_rate), float(par.tip.shift.gust.pace)
    np.testing.assert_allclose(paces, [slow, 0.5 * (slow + quick), quick], rtol=1e-4)


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
    with pytest.raises(ControllerError, match=r"controller\.gust_shift = 1\.0: must be 0 without preview"):
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


def test_what_is_predicted_is_no_gust(model):
    """The trend's weight w leaves max(0, 1 - 3 w) to gusts, and its rate predicts over observer and filter."""
    par = make_centroidal(model, mode="tip", preset="adaptive", gust_shift=1.0).par
    for agreement in (0.0, 0.55, 0.6, 1.0):
        memory = dataclasses.replace(par.parts.trend.start(2), rate=Vec3(0.3, -0.2, 0.0), agreement=agreement, size=1.0)
        zero = Vec3(0.0, 0.0, 0.0)
        unknown = Disturbance(force=zero, torque=zero, efforts=(0.0, 0.0))
        step = SimpleNamespace(par=par, dt=DT, observed=SimpleNamespace(force=zero), external=0, unknown=unknown)
        weight = float(rate_weight(par.parts.trend, par.parts.trend.adjust_reference(memory, step)))
        assert (weight > 0.05) == (agreement > 0.5)
        assert float(step.gust) == pytest.approx(max(0.0, 1.0 - 3.0 * weight), abs=1e-12)
    slow, adapted = np.array([1.5, 0.2, 0.1]), np.array([2.5, 4.8, 5.9])
    rate = np.array([*step.rate])
    assert abs(rate[0]) > 0.1
    found = steady_force(par, step, Vec3(*slow), Vec3(*adapted))
    np.testing.assert_allclose([*found], slow + adapted + rate * (2.0 / 27.0 + 1.0 / 3.0), rtol=1e-12)


def test_the_pace_is_that_of_the_arm_and_of_a_short_one_10_rad_s(model):
    tip = Frame(name="tip", link=BASE, position=Vec3(0.0, 0.0, -0.02))
    short = dataclasses.replace(skyarm.load_vehicle("hummingbird"), frames=(tip,), end_effector="tip")
    assert gust_gains(0.5, short, G).pace == 5.0
    long = gust_gains(0.5, model.vehicle, G)
    assert (long.pace, long.size) == pytest.approx((0.5 * np.sqrt(G / 0.3), 2.0 * float(model.vehicle.mass)))


def test_without_the_shift_for_gusts_the_force_is_foretold_across_the_filter(model):
    """Two poles of the observer and the one that the shift follows by, no slower than 1 rad/s."""
    slow, adapted, rate = Vec3(1.5, 0.2, 0.1), Vec3(0.1, 0.0, -0.2), Vec3(0.3, -0.2, 0.05)
    step = SimpleNamespace(rate=rate, force=Vec3(9.0, 9.0, 9.0))
    for shift_rate, late in ((3.0, 1.0 / 3.0), (0.5, 1.0)):
        par = make_centroidal(model, mode="tip", preset="adaptive", shift_rate=shift_rate).par
        found = steady_force(par, step, slow, adapted)
        np.testing.assert_allclose([*found], [*(slow + adapted + rate * (2.0 / 27.0 + late))], rtol=1e-12)
    joint = make_centroidal(model, mode="joint", preset="adaptive").par
    found = steady_force(joint, step, slow, adapted)
    np.testing.assert_allclose([*found], [*(step.force + adapted + rate * (2.0 / 27.0))], rtol=1e-12)
