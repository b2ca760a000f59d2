"""The trend of a force: ramps and turns are foretold, noise and steps are not."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from law_parts import demanded
from scipy.signal import lfilter, lsim

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.force_trend import (
    foresee,
    lateness,
    rate_weights,
    trend_gains,
    update_trend,
)
from skyarm.control.laws.centroidal.parameters import at_shares
from skyarm.control.laws.centroidal.step_records import Effect
from skyarm.control.model import Model
from skyarm.dynamics import State

DT = 0.005
GAINS = trend_gains(10.0, 0.8)

CHANCE, FORGET, HORIZON, STAGES, STEEPEST = 0.5, 0.7, 0.25, 3, 5.0 * 0.8
"""Constants of the page, for 0.8 kg."""


def fed(forces, gains=GAINS):
    """Memories after each of the forces (n, 3)."""
    memory, found = gains.start(2), []
    for each in forces:
        memory = update_trend(gains, memory, Vec3(*map(float, each)), DT)
        found.append(memory)
    return found


def rates(memories, gains=GAINS):
    return np.array(
        [list(each.rate * rate_weights(gains, each)[0]) for each in memories]
    )


def test_a_steady_rate_is_found_and_trusted():
    t = np.arange(0.0, 9.0, DT)
    slope = np.array([1.5, -0.7, 0.4])
    memories = fed(np.outer(t, slope))
    last = memories[-1]
    assert list(last.rate) == pytest.approx(slope, rel=1e-6)
    assert list(last.level) == pytest.approx(slope * t[-1], rel=1e-6)
    # half of a step's rate was taken to have foretold nothing at first: forgotten by
    # now
    assert last.agreement / last.size == pytest.approx(1.0, rel=0.06)
    # a force that rises for ever is never ahead of itself: the trust stays within 1
    assert (
        np.linalg.norm(rates(memories), axis=1)
        <= np.linalg.norm([list(m.rate) for m in memories], axis=1)
    ).all()


def test_the_tracker_and_the_chain_are_those_of_their_transfer_functions():
    """Against SciPy's integration of w^2 s / (s + w)^2 and of (1 + s T / n)^-n in
    continuous time.
    """
    t = np.arange(0.0, 3.0, DT)
    force = np.sin(2.0 * t) + 0.3 * np.sin(5.0 * t)
    memories = fed(np.stack([force, 0 * t, 0 * t], axis=1))
    w, T = 10.0, HORIZON / STAGES
    _, rate, _ = lsim(([w * w, 0.0], [1.0, 2.0 * w, w * w]), force, t)
    _, late, _ = lsim(([1.0], np.poly1d([T, 1.0]) ** STAGES), force, t)
    assert [m.rate.x for m in memories] == pytest.approx(rate, abs=0.06)
    assert [m.forces[-1].x for m in memories] == pytest.approx(late, abs=0.04)
    _, held, _ = lsim(([1.0], np.poly1d([T, 1.0]) ** STAGES), rate, t)
    assert [m.rates[-1].x for m in memories] == pytest.approx(held, abs=0.1)


def test_a_turning_force_is_foretold_noise_is_not():
    t = np.arange(0.0, 20.0, DT)
    turn = 2.0 * np.stack([np.cos(1.256 * t), np.sin(1.256 * t), 0 * t], axis=1)
    settled = slice(int(5.0 / DT), None)
    told = rates(fed(turn))[settled]
    true = np.gradient(turn, DT, axis=0)[settled]
    assert (
        np.linalg.norm(told - true, axis=1).mean()
        < 0.4 * np.linalg.norm(true, axis=1).mean()
    )
    rng = np.random.default_rng(3)
    share = []
    for _ in range(2):
        noise = 0.3 * rng.normal(size=(len(t), 3))
        memories = fed(noise)
        raw = np.linalg.norm([list(m.rate) for m in memories], axis=1)[settled]
        share.append(
            np.linalg.norm(rates(memories), axis=1)[settled].mean() / raw.mean()
        )
    assert np.mean(share) < 0.12


def test_what_was_found_is_forgotten_at_its_rate():
    memory = dataclasses.replace(GAINS.start(2), agreement=1.0, size=2.0)
    for _ in range(200):
        memory = update_trend(GAINS, memory, Vec3(0.0, 0.0, 0.0), DT)
    assert memory.agreement == pytest.approx(np.exp(-FORGET * 1.0), rel=1e-9)
    assert memory.size == pytest.approx(2.0 * np.exp(-FORGET * 1.0), rel=1e-9)


def test_trust_stays_within_nothing_and_all():
    rate = np.array([1.0, 2.0, -1.0])
    for agreement, slope in (
        (-3.0, CHANCE),
        (1.0, CHANCE),
        (1.5, 1.5 / (2.0 + GAINS.noise)),
        (30.0, 1.0),
    ):
        memory = dataclasses.replace(
            GAINS.start(2), rate=Vec3(*rate), agreement=agreement, size=2.0
        )
        even = 1.0 / (1.0 + (rate @ rate / GAINS.steep**2) ** 2)
        own = min(max(agreement / (2.0 + GAINS.noise), 0.0), 1.0)
        assert rate_weights(GAINS, memory) == pytest.approx(
            ((slope - CHANCE) / (1.0 - CHANCE) * even, own * even)
        )


def test_a_step_leaves_no_evidence_and_is_not_followed():
    """Of 10 N within one period: the rate that the tracker sees is a step's, and so is
    the change.
    """
    force = np.zeros((400, 3))
    force[200:, 0] = 10.0
    memories = fed(force)
    raw, told = np.array([m.rate.x for m in memories]), rates(memories)[:, 0]
    assert raw.max() > 30.0
    assert np.abs(told).max() < 0.02 * raw.max()
    assert memories[-1].agreement < 0.2 * memories[-1].size


def test_evidence_is_the_mean_of_what_no_step_has_said():
    """Of 2 N at 3 rad/s with a step of 10 N in it, by SciPy's filter over the records
    of both chains.
    """
    t = np.arange(0.0, 4.0, DT)
    force = np.stack(
        [2.0 * np.sin(3.0 * t) + 10.0 * (t > 2.0), np.cos(t), 0.1 * t], axis=1
    )
    memories = fed(force)
    rate, late = (
        np.array([list(getattr(m, name)[-1]) for m in memories])
        for name in ("rates", "forces")
    )
    change = (force - late) / HORIZON
    told = rate / (1.0 + ((change**2).sum(axis=1, keepdims=True) / STEEPEST**2) ** 2)
    b, begin = np.exp(-FORGET * DT), (0.5 * STEEPEST) ** 2
    for name, products, first in (
        ("agreement", told * change, 0.0),
        ("size", told * rate, begin),
    ):
        mean, _ = lfilter([1.0 - b], [1.0, -b], products.sum(axis=1), zi=[b * first])
        assert [getattr(m, name) for m in memories] == pytest.approx(mean, rel=1e-9)


def test_the_observer_is_late_by_its_poles_and_at_most_by_those_of_1_rad_s():
    """Two of the velocity's observer, one with an accelerometer."""
    model = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"))
    seen, heard = (
        make_centroidal(model, mode="tip", **told).par
        for told in ({"accelerometer": (0.0, 0.0)}, {})
    )
    assert [lateness(seen), lateness(heard)] == pytest.approx([2.0 / 27.0, 1.0 / 40.0])
    assert [lateness(at_shares(each, 0.01, 1.0)) for each in (seen, heard)] == [
        2.0,
        1.0,
    ]


def effect_of(force, **more):
    """What a step compensates of a force (N)."""
    unknown = Disturbance(force=force, torque=Vec3(0.0, 0.0, 0.0), efforts=(0.0, 0.0))
    return Effect(signals=(), unknown=unknown, force=force, **more)


def believed(rate, share=1.0):
    """A trend whose rate (N/s) came true so far, or a share of it."""
    trend = make_centroidal(
        Model(vehicle=skyarm.load_vehicle("hummingbird_arm2")), mode="tip"
    ).par.parts.trend
    return dataclasses.replace(
        trend.start(2), rate=rate, agreement=share * 1e9, size=1e9
    )


def test_the_force_is_foretold_across_observer_and_filter():
    """The observer's pole and the one that the shift follows by, no slower than 1
    rad/s; in mode "joint" the first.
    """
    model = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"))
    slow, adapted, rate = (
        Vec3(1.5, 0.2, 0.1),
        Vec3(0.1, 0.0, -0.2),
        Vec3(0.3, -0.2, 0.05),
    )
    effect, trend = effect_of(Vec3(9.0, 9.0, 9.0)), believed(rate)
    rate = (
        rate
        * rate_weights(make_centroidal(model, mode="tip").par.parts.trend, trend)[0]
    )
    assert [*rate] == pytest.approx([0.3, -0.2, 0.05], rel=1e-4)
    for shift_rate, late in ((3.0, 1.0 / 3.0), (0.5, 1.0)):
        par = make_centroidal(model, mode="tip", shift_rate=shift_rate).par
        found = foresee(par, trend, effect, slow, adapted).steady
        np.testing.assert_allclose(
            [*found], [*(slow + adapted + rate * (1.0 / 40.0 + late))], rtol=1e-12
        )
    joint = make_centroidal(model, mode="joint").par
    found = foresee(joint, trend, effect, slow, adapted).steady
    np.testing.assert_allclose(
        [*found], [*(effect.force + adapted + rate * (1.0 / 40.0))], rtol=1e-12
    )
    without = make_centroidal(model, mode="tip", force_trend=0.0).par
    assert [*foresee(without, None, effect, slow, adapted).steady] == [
        *(slow + adapted)
    ]


@pytest.mark.parametrize("external", [0.0, 0.4, 1.0])
def test_a_rate_is_believed_as_far_as_no_force_acts_on_the_tip(external):
    """What it has foretold goes to the force that is compensated, over the observer's
    lateness.
    """
    model = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"))
    par = make_centroidal(model, mode="tip").par
    memory, zero = believed(Vec3(0.3, -0.2, 0.0), share=0.8), Vec3(0.0, 0.0, 0.0)
    effect = effect_of(Vec3(0.5, 0.6, 0.7), external=external)
    coming = foresee(par, memory, effect, zero, zero)
    far, own = rate_weights(par.parts.trend, memory)
    rate = np.array([*memory.rate]) * far * (1.0 - external)
    near = rate * (own / far)
    np.testing.assert_allclose([*coming.near_rate], near, rtol=1e-12)
    np.testing.assert_allclose([*coming.rate], rate, rtol=1e-12)
    np.testing.assert_allclose(
        [*coming.unknown.force], [0.5, 0.6, 0.7] + near / 40.0, rtol=1e-12
    )
    assert external == 1.0 or abs(rate[0]) > 0.05


def test_the_attitude_turns_against_a_force_as_fast_as_that_is_led():
    """Thrust balances m g - d: b_3 turns at d' / (m g) with the rate gain; meanwhile d'
    moves the base, against k_v.
    """
    par = make_centroidal(
        Model(vehicle=skyarm.load_vehicle("hummingbird_arm2")), mode="joint"
    ).par
    zero, level = Vec3(0.0, 0.0, 0.0), Quaternion(1.0, 0.0, 0.0, 0.0)
    state = State(
        position=zero,
        quaternion=level,
        velocity=zero,
        rate=zero,
        joints=(0.0, 0.0),
        joint_rates=(0.0, 0.0),
        rotor_speeds=(0.0,) * 4,
    )
    signals = [Taylor((0.0,) * 5)] * 6
    nothing = Disturbance(force=zero, torque=zero, efforts=(0.0, 0.0))

    def turned(**rates):
        return np.array(
            [*demanded(par, state, signals, nothing, **rates).alpha], dtype=float
        )

    still = turned()
    weight = float(par.model.vehicle.mass) * float(par.model.gravity)
    gain = float(par.base.rate.x) + float(par.base.velocity.y)
    asked = turned(near_rate=Vec3(0.0, 0.03, 0.0)) - still
    assert asked == pytest.approx([gain * 0.03 / weight, 0.0, 0.0], rel=1e-3, abs=1e-9)
    asked = turned(rate=Vec3(0.0, 0.03, 0.0)) - still
    assert abs(asked).max() < 1e-9
