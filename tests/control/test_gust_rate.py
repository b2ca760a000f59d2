"""The rate of gusts: its filter against NumPy, whose force is answered, and what an unknown load then does."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from measure_gusts import fly
from scipy.signal import lfilter

import skyarm
from law_parts import with_parts
from skyarm.algebra import Vec3
from skyarm.control.blocks.disturbance_observer import disturbance, first_observed, observe
from skyarm.control.blocks.prediction import actuation
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.force_trend import lateness
from skyarm.control.laws.centroidal.gust_rate import gust_rate_gains
from skyarm.control.laws.centroidal.shift_motion import slow_force
from skyarm.control.model import Model
from skyarm.dynamics.actuators import Command
from skyarm.sensing.measurement import Measurement
from skyarm.studies.compare.envelope_axes import TIP
from skyarm.studies.compare.envelope_setting import PAPER
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Frame

DT, LENGTH = 0.005, 0.3


@pytest.fixture(scope="module")
def par():
    model = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"), gravity=9.81)
    return make_centroidal(model, mode="tip", preset="gusts").par


def gone(par, forces, torques, efforts=None, free=None):
    """Rates, shares and roughness, a row each period, of rows of observed disturbances and free actuators."""
    part, rows = par.parts.gusts, []
    efforts = np.zeros((len(forces), 2)) if efforts is None else efforts
    free = np.ones((len(forces), 3)) if free is None else free
    memory, before = part.start(2), SimpleNamespace(torque=Vec3(0.0, 0.0, 0.0), efforts=(0.0, 0.0))
    for force, torque, effort, each in zip(forces, torques, efforts, free, strict=True):
        now = SimpleNamespace(force=Vec3(*map(float, force)), torque=Vec3(*map(float, torque)), efforts=effort)
        law = SimpleNamespace(observed=before, free=tuple(each))
        step = SimpleNamespace(par=par, dt=DT, observed=now, memory=law, gust=1.0)
        memory, before = part.adjust_reference(memory, step), now
        rows.append([*map(float, step.change), float(step.gust), float(step.rough)])
    return np.array(rows)


def written(par, forces, torques, efforts, free):
    """The same by SciPy's filters over the whole record; the means are of the periods in which rotors are free."""
    mass = float(par.model.vehicle.mass)
    low = lambda x, w: lfilter([1 - np.exp(-w * DT)], [1, -np.exp(-w * DT)], x, axis=0)  # noqa: E731
    rates = np.diff(low(forces, 60.0), axis=0, prepend=0.0) / DT
    loads = np.column_stack([torques[:, :2], efforts])
    arm = (np.diff(loads, axis=0, prepend=0.0) ** 2).sum(axis=1) / (DT * LENGTH) ** 2
    size, most = (rates**2).sum(axis=1), (7.0 * mass) ** 2
    both = 1.0 + (size + arm) / most
    stopped = most * (1.0 - free[:, 1:]).sum(axis=1)
    squares = np.column_stack([(rates[:, :2] ** 2).sum(axis=1) / both, arm / both + stopped])
    last = np.cumsum(free[:, 0]).astype(int) - 1
    means = low(squares[free[:, 0] > 0.5], 1.5)[last].T
    share = np.maximum(0.0, 1.0 - 3.0 * means[1] / (means[0] + (0.3 * mass) ** 2))
    rough = 1.0 + 6.0 * share * means[0] / most
    limited = rates / np.sqrt(1.0 + size / most)[:, None]
    return np.column_stack([limited * share[:, None], share, rough])


@pytest.fixture(scope="module")
def record():
    """Forces and torques of 400 periods, as random walks."""
    draws = np.random.default_rng(7).normal(size=(2, 400, 3))
    return np.cumsum(draws[0], axis=0) * 0.02, np.cumsum(draws[1], axis=0) * 0.002


def test_the_filter_is_that_of_the_page(par, record):
    """With efforts, a joint at its limit for a while, and rotors at theirs later."""
    efforts = np.cumsum(np.random.default_rng(8).normal(size=(400, 2)), axis=0) * 0.0003
    free = np.ones((400, 3))
    free[120:122, 2], free[250:330, 0] = 0.0, 0.0
    forces, torques, efforts = record[0], 0.1 * record[1], 0.3 * efforts
    found = written(par, forces, torques, efforts, free)
    assert found[121, 3] < found[119, 3] < 1.0
    assert (found[250:330, 3] == found[249, 3]).all()
    assert 0.0 < found[249, 3] < found[399, 3]
    np.testing.assert_allclose(gone(par, forces, torques, efforts, free), found, rtol=1e-9, atol=1e-9)
    half = with_parts(par, gusts=dataclasses.replace(par.parts.gusts, share=0.5))
    halved = found * [0.5, 0.5, 0.5, 1.0, 1.0]
    np.testing.assert_allclose(gone(half, forces, torques, efforts, free), halved, rtol=1e-9, atol=1e-9)


def test_rates_turn_with_the_axes(par, record):
    """Forces and torques turned about the vertical, or mirrored: rates likewise, shares and roughness the same."""
    forces, torques = record
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    found = gone(par, forces, torques)
    for M in (turn, -np.eye(3)):
        moved = gone(par, forces @ M.T, torques @ M.T)
        np.testing.assert_allclose(moved, np.column_stack([found[:, :3] @ M.T, found[:, 3:]]), atol=1e-12)


def test_a_force_at_the_tip_is_answered_less_than_one_on_the_base(par, record):
    """It turns the base by r x f and loads the joints by J^T f: not at all of a stretched arm, 0.3 m below, and less of
    a bent one, whose tip is 0.1 m below the joints. A joint that is stuck loads itself alone, and is not answered."""
    forces, _ = record
    assert gone(par, forces, 0.0 * forces)[-1, 3] == 1.0
    for depth in (LENGTH, 0.1):
        at_tip = np.cross([0.0, 0.0, -depth], forces)
        bent = depth * forces[:, [0, 0]] * [1.0, 0.0 if depth < LENGTH else 0.5]
        found = gone(par, forces, at_tip, bent)
        assert found[50:, 3].max() < (1e-12 if depth == LENGTH else 0.85)
    stuck = gone(par, 0.1 * forces, 0.0 * forces, 0.1 * forces[:, :2])
    assert stuck[50:, 3].max() == 0.0
    assert not stuck[50:, :3].any()


def test_a_step_on_the_base_is_a_gust(par):
    """5 N within 20 ms, of which a tenth appears as torque: both are too steep, and their ratio counts."""
    forces = np.zeros((200, 3))
    forces[20:, 1] = 5.0 * np.minimum(np.arange(180) / 4.0, 1.0)
    torques = 0.1 * LENGTH * forces[:, [1, 0, 2]]
    assert gone(par, forces, torques)[21:, 3].min() > 0.5


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_the_share_goes_from_the_measured_velocity_alone_to_the_accelerometer(par, share):
    """One step of the observer, and gains: at 0 those of a law without an accelerometer, linear between both ends."""
    part = par.parts.gusts
    memory = dataclasses.replace(part.start(2), pushing=1e6, turning=1e6 / 3.0 * (1.0 - share))
    now = part.adjust_gains(memory, par, DT)
    assert float(now.observer.accelerometer.share) == pytest.approx(share, abs=1e-6)
    assert float(lateness(now)) == pytest.approx(share / 30.0 + (1.0 - share) * 2.0 / 27.0)
    np.testing.assert_allclose([*now.base.attitude], [205.0 * (1 + 0.5 * share)] * 2 + [30.0], rtol=1e-6)

    def observed(gains):
        model, start = par.model, first_observed(2, (400.0,) * 4, accelerometer=True)
        seen = Measurement(
            time=0.0,
            position=Vec3(0.0, 0.0, 1.0),
            quaternion=start.quaternion,
            velocity=Vec3(0.03, -0.02, 0.01),
            rate=Vec3(0.1, 0.2, 0.0),
            joints=(0.1, 0.2),
            joint_rates=(0.3, -0.1),
            rotor_speeds=(400.0,) * 4,
            specific_force=Vec3(0.5, 0.4, 9.0),
        )
        if gains.accelerometer is None:
            start = dataclasses.replace(start, bias=())
        done = actuation(model, start.rotor_speeds, Command(rotor_speeds=(400.0,) * 4, efforts=(0.0, 0.0)), DT)
        found, _ = observe(model, gains, start, seen, done, disturbance(start), 1.0, (1.0, 1.0, 1.0), DT)
        return np.array([*found.force, *found.velocity, *found.torque, *found.efforts])

    heard = dataclasses.replace(now.observer, accelerometer=dataclasses.replace(now.observer.accelerometer, share=1))
    deaf, full = observed(dataclasses.replace(now.observer, accelerometer=None)), observed(heard)
    assert abs(full - deaf)[:6].min() > 1e-6
    np.testing.assert_allclose(observed(now.observer), deaf + share * (full - deaf), rtol=1e-5, atol=1e-9)


def test_the_shift_is_calm_in_gusts_and_of_a_pushed_tip(par):
    """The filter for a jump of 1 kN: the arm's pace in calm air, a third where ``rough`` is 3, else shift_rate."""
    moved = [
        float(slow_force(par, Vec3(0.0, 0.0, 0.0), Vec3(0.0, 1e3, 0.0), 1e-6, *told).y) / 1e-3
        for told in ((1.0, 1.0), (1.0, 3.0), (0.0, 1.0))
    ]
    pace = float(par.tip.shift.gust.pace)
    np.testing.assert_allclose(moved, [pace, pace / 3.0, float(par.tip.shift_rate)], rtol=1e-4)


def test_an_unknown_load_does_not_swing_with_the_rate():
    """0.2 kg at the tip, of which nobody knows: 10 mm; without the share they swing by more than 50 mm."""
    flown = fly("payload", 0.2, "gusts", PAPER, [431])
    assert list(flown.status) == ["completed"]
    assert float(flown.metrics[TIP][0]) < 0.010


def test_it_is_left_out_or_refused(par):
    """By 0 in the preset; without an accelerometer it is refused, by name and value."""
    model = par.model
    # an arm of no length has one of 10 mm: no torque over nothing
    tip, base = Frame(name="tip", link=BASE, position=Vec3(0.0, 0.0, 0.0)), skyarm.load_vehicle("hummingbird")
    stump = dataclasses.replace(base, frames=(tip,), end_effector="tip")
    assert gust_rate_gains(1.0, stump).length == 0.01
    assert make_centroidal(model, mode="tip", preset="gusts", gust_rate=0.0).par.parts.gusts is None
    assert make_centroidal(model, mode="tip", preset="adaptive").par.parts.gusts is None
    assert (
        dataclasses.replace(par.parts.gusts, share=0.5)
        == make_centroidal(model, mode="tip", preset="gusts", gust_rate=0.5).par.parts.gusts
    )
    with pytest.raises(ControllerError, match=r"controller\.gust_rate = 1\.0: must be 0 without an accelerometer"):
        make_centroidal(model, mode="tip", preset="adaptive", gust_rate=1.0)
