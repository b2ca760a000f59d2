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
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.gust_rate import gust_rate_gains
from skyarm.control.laws.centroidal.shift_motion import slow_force
from skyarm.control.model import Model
from skyarm.studies.compare.envelope_axes import TIP
from skyarm.studies.compare.envelope_setting import PAPER
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Frame

DT, LENGTH = 0.005, 0.3


@pytest.fixture(scope="module")
def par():
    model = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"), gravity=9.81)
    return make_centroidal(model, mode="tip", preset="gusts").par


def gone(par, forces, torques):
    """Rates, shares and roughness, a row each period, of rows of observed forces and torques."""
    part, rows = par.parts.gusts, []
    memory, before = part.start(2), Vec3(0.0, 0.0, 0.0)
    for force, torque in zip(forces, torques, strict=True):
        now = SimpleNamespace(force=Vec3(*map(float, force)), torque=Vec3(*map(float, torque)))
        step = SimpleNamespace(
            par=par, dt=DT, observed=now, memory=SimpleNamespace(observed=SimpleNamespace(torque=before))
        )
        memory, before = part.adjust_reference(memory, step), now.torque
        rows.append([*map(float, step.change), float(step.gust), float(step.rough)])
    return np.array(rows)


def limit(rates, steep):
    return rates / np.sqrt(1.0 + (rates**2).sum(axis=1, keepdims=True) / steep**2)


def written(par, forces, torques):
    """The same by SciPy's filters over the whole record."""
    mass = float(par.model.vehicle.mass)
    low = lambda x, w: lfilter([1 - np.exp(-w * DT)], [1, -np.exp(-w * DT)], x, axis=0)  # noqa: E731
    filtered = low(forces, 60.0)
    rates = limit(np.diff(filtered, axis=0, prepend=0.0) / DT, 7.0 * mass)
    turns = limit(np.diff(torques, axis=0, prepend=0.0) / DT / LENGTH, 7.0 * mass)
    pushing, turning = ((low(each[:, :2] ** 2, 1.5)).sum(axis=1) for each in (rates, turns))
    share = np.maximum(0.0, 1.0 - 2.0 * turning / (pushing + (0.3 * mass) ** 2))
    rough = 1.0 + 6.0 * share * pushing / (7.0 * mass) ** 2
    return np.column_stack([rates * share[:, None], share, rough])


@pytest.fixture(scope="module")
def record():
    """Forces and torques of 400 periods, as random walks."""
    draws = np.random.default_rng(7).normal(size=(2, 400, 3))
    return np.cumsum(draws[0], axis=0) * 0.02, np.cumsum(draws[1], axis=0) * 0.002


def test_the_filter_is_that_of_the_page(par, record):
    found = written(par, *record)
    np.testing.assert_allclose(gone(par, *record), found, rtol=1e-9, atol=1e-9)
    half = with_parts(par, gusts=dataclasses.replace(par.parts.gusts, share=0.5))
    np.testing.assert_allclose(gone(half, *record), found * [0.5, 0.5, 0.5, 1.0, 1.0], rtol=1e-9, atol=1e-9)


def test_rates_turn_with_the_axes(par, record):
    """Forces and torques turned about the vertical, or mirrored: rates likewise, shares and roughness the same."""
    forces, torques = record
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    found = gone(par, forces, torques)
    for M in (turn, -np.eye(3)):
        moved = gone(par, forces @ M.T, torques @ M.T)
        np.testing.assert_allclose(moved, np.column_stack([found[:, :3] @ M.T, found[:, 3:]]), atol=1e-12)


def test_only_a_force_on_the_base_is_answered(par, record):
    """One at the tip, 0.3 m below, turns the base by r x f."""
    forces, _ = record
    assert gone(par, forces, 0.0 * forces)[-1, 3] == 1.0
    at_tip = np.cross([0.0, 0.0, -LENGTH], forces)
    assert gone(par, forces, at_tip)[50:, 3].max() == 0.0
    assert not gone(par, forces, at_tip)[50:, :3].any()


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
