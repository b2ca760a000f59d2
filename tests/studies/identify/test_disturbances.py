"""Disturbances estimated from a flight's past: planted constants and noises, and what they do to predictions."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from test_motion_model import ABOUT, PERIOD, log_of, stretch_of, vehicle

from skyarm.studies.identify.disturbances import (
    AxisNoise,
    DisturbanceModel,
    begin_at,
    characteristic,
    fit_disturbances,
    steady_spread,
    unexplained_sums,
)
from skyarm.studies.identify.open_loop import (
    Poses,
    Weights,
    fit_weights,
    hold,
    predict_ahead,
    predict_flights,
    rotations,
)

NOISE = AxisNoise(measured=0.02, white=0.01, process=1.5, time_constant=0.3, walk=0.1)
H = 0.02
HORIZON = 0.1


@pytest.fixture(scope="module")
def flown():
    log = log_of(2.0)
    return stretch_of(log), Poses(
        position=log.position, quaternion=log.quaternion, velocity=log.velocity, known_velocity=log.velocity
    )


def drawn(noise, size, seed, constant=0.0):
    """Measured velocities of an axis and its process, step by step."""
    rng = np.random.default_rng(seed)
    step, spread, measured = noise.matrices(H)
    state, rows = np.array([0.0, noise.process * rng.normal(), constant]), []
    for _ in range(size):
        rows.append([state[0] + np.sqrt(measured) * rng.normal(), state[1], state[2]])
        state = step @ state + np.sqrt(np.diag(spread)) * rng.normal(size=3)
    return np.array(rows)


def test_the_steady_covariance_solves_its_equation():
    step, noise, measured = NOISE.matrices(H)
    spread = steady_spread(step, noise, measured)
    gain = spread[:, :1] / (spread[0, 0] + measured)
    again = step @ (spread - gain @ spread[:1]) @ step.T + noise
    np.testing.assert_allclose(again, spread, rtol=1e-8, atol=1e-12)
    assert (np.linalg.eigvalsh(spread) > 0.0).all()


def test_the_characteristic_polynomial_is_that_of_the_eigenvalues():
    rows = np.random.default_rng(0).normal(size=(3, 3))
    np.testing.assert_allclose(characteristic(rows), np.poly(rows), atol=1e-12)


def test_the_filter_finds_process_and_constant():
    """Errors are those that the steady covariance promises; a constant of 30 deviations is no matter."""
    rows = drawn(NOISE, 4000, 3, constant=45.0)
    model = DisturbanceModel((NOISE,))
    _, found = model.estimate(rows[:, :1], np.ones(len(rows) - 1, dtype=bool), H)
    off = (found[:, 0] - rows[:, 1:])[500:]
    step, noise, measured = NOISE.matrices(H)
    before = steady_spread(step, noise, measured)
    after = before - before[:, :1] @ before[:1] / (before[0, 0] + measured)
    assert np.std(off.sum(axis=1)) == pytest.approx(np.sqrt(after[1:, 1:].sum()), rel=0.15)
    assert np.std(off[:, 0]) < 0.8 * NOISE.process


def test_ahead_the_process_decays_and_the_constant_stays():
    model = DisturbanceModel((NOISE,))
    rows = np.array([[[2.0, 0.5]]])
    steps = np.array([float(model.ahead(rows, H, k)[0, 0]) for k in range(200)])
    exact = 0.5 * 200 * H + 2.0 * 0.3 * (1.0 - np.exp(-200 * H / 0.3))
    assert steps.sum() * H == pytest.approx(exact, rel=1e-9)


def test_a_torque_that_the_model_does_not_know_is_estimated_from_the_past(flown):
    """The flight without noise, its model with a torque too much: the prediction is as good as without it."""
    wrong = dataclasses.replace(ABOUT, torque=(0.004, -0.003, 0.001))
    noises = AxisNoise(measured=1e-5, white=1e-4, process=1e-3, time_constant=0.5, walk=0.5)
    model = DisturbanceModel((noises,) * 6)
    ((plain, _),) = predict_flights(vehicle(), wrong, [flown], [HORIZON])
    ((better, held),) = predict_flights(vehicle(), wrong, [flown], [HORIZON], disturbances=model)
    assert better.attitude < 0.05 * plain.attitude
    assert better.rate < 0.05 * plain.rate
    assert better.begins == held.begins > 5


def test_a_measured_velocity_that_jumps_is_corrected(flown):
    """One sample is 1 m/s and 1 rad/s off: nearly all of it is taken for noise, in world and in base axes."""
    stretch, poses = flown
    begin = np.array([800])
    jump, turn = np.array([1.0, -1.0, 1.0]), np.array([-1.0, 1.0, 1.0])
    velocity, rate = poses.velocity.copy(), stretch.rate.copy()
    velocity[begin] += jump
    rate[begin] += turn
    off = dataclasses.replace(stretch, rate=rate), dataclasses.replace(poses, velocity=velocity)
    model = DisturbanceModel((AxisNoise(measured=0.05, white=1e-3, process=1e-3, time_constant=0.5, walk=1e-3),) * 6)
    sums = unexplained_sums(vehicle(), ABOUT, *off, 9.81)
    moved, turned, _ = begin_at(model, sums, *off, begin)
    assert np.abs(moved - poses.velocity[begin]).max() < 0.2
    assert np.abs(turned - stretch.rate[begin]).max() < 0.2


def test_nothing_measured_after_a_begin_matters(flown):
    stretch, poses = flown
    model = DisturbanceModel((NOISE,) * 6)
    begin, periods = 700, 10
    first = predict_ahead(vehicle(), ABOUT, stretch, poses, [begin], periods, disturbances=model)[-1]
    rate, velocity = stretch.rate.copy(), poses.velocity.copy()
    rate[begin + 1 :] += 3.0
    velocity[begin + 1 :] -= 2.0
    later = dataclasses.replace(stretch, rate=rate), dataclasses.replace(poses, velocity=velocity)
    other = predict_ahead(vehicle(), ABOUT, *later, [begin], periods, disturbances=model)[-1]
    np.testing.assert_array_equal(first.position, other.position)
    np.testing.assert_array_equal(first.quaternion, other.quaternion)
    earlier = rate.copy()
    earlier[begin - 5 : begin] += 0.5
    moved = predict_ahead(
        vehicle(), ABOUT, dataclasses.replace(stretch, rate=earlier), poses, [begin], periods, disturbances=model
    )[-1]
    assert np.abs(moved.rate - first.rate).max() > 1e-3


@pytest.mark.thorough
def test_planted_noises_are_found(flown):
    """Of a flight whose rates get noise and a Gauss-Markov torque: the angular noises, within a factor of 1.6."""
    pytest.importorskip("scipy", reason="needs the extra 'identify'")
    stretch, poses = flown
    rate = stretch.rate.copy()
    planted = AxisNoise(measured=0.01, white=1e-3, process=4.0, time_constant=0.2, walk=0.05)
    rng = np.random.default_rng(1)
    for i in range(3):
        push = np.zeros(len(rate))
        decay = np.exp(-PERIOD / planted.time_constant)
        for k in range(1, len(rate)):
            push[k] = decay * push[k - 1] + planted.process * np.sqrt(1.0 - decay**2) * rng.normal()
        rate[:, i] += np.cumsum(push) * PERIOD + planted.measured * rng.normal(size=len(rate))
    model = fit_disturbances(vehicle(), ABOUT, [(dataclasses.replace(stretch, rate=rate), poses)])
    for axis in model.axes[3:]:
        assert axis.measured == pytest.approx(planted.measured, rel=0.15)
        white = np.sqrt(2.0 * axis.time_constant) * axis.process
        assert white / (np.sqrt(2.0 * planted.time_constant) * planted.process) == pytest.approx(1.0, abs=0.6)


def test_sums_of_the_true_model_stay_and_those_of_a_wrong_one_grow(flown):
    stretch, poses = flown
    true = unexplained_sums(vehicle(), ABOUT, stretch, poses, 9.81)
    wrong = unexplained_sums(vehicle(), dataclasses.replace(ABOUT, torque=(0.004, 0.0, 0.0)), stretch, poses, 9.81)
    # once the rotors turn as they are commanded
    true, wrong = (rows[100:, 3:] - rows[100, 3:] for rows in (true, wrong))
    assert np.abs(true).max() < 0.01 * np.abs(stretch.rate).max()
    assert wrong[-1, 0] < -20.0 * np.abs(true).max()


def test_weights_stand_between_model_holding_and_rest(flown):
    stretch, poses = flown
    begins = [600, 800]
    held = hold(stretch, poses, begins, HORIZON)
    model = predict_ahead(vehicle(), ABOUT, stretch, poses, begins, round(HORIZON / PERIOD))[-1]
    rest = dataclasses.replace(held, quaternion=poses.quaternion[begins], rate=0.0 * held.rate)
    one, none = np.ones(3), np.zeros(3)
    whole = Weights(one, one, np.stack([one, none]), np.stack([one, none])).mix(model, held, rest)
    np.testing.assert_allclose(rotations(whole.quaternion, model.quaternion), 0.0, atol=1e-12)
    np.testing.assert_allclose(whole.position, model.position)
    np.testing.assert_allclose(whole.rate, model.rate)
    still = Weights(none, none, np.stack([none, one]), np.stack([none, one])).mix(model, held, rest)
    np.testing.assert_allclose(rotations(still.quaternion, rest.quaternion), 0.0, atol=1e-12)
    np.testing.assert_allclose(still.velocity, held.velocity)
    np.testing.assert_allclose(still.rate, 0.0, atol=1e-15)


@pytest.mark.thorough
def test_all_of_a_true_model_counts_and_little_of_a_wrong_one(flown):
    (true,) = fit_weights(vehicle(), ABOUT, [flown], [HORIZON])
    np.testing.assert_allclose(true.attitude, [[1.0] * 3, [0.0] * 3], atol=0.01)
    np.testing.assert_allclose(true.position, 1.0, atol=0.01)
    late = dataclasses.replace(ABOUT, torque=(0.05, -0.04, 0.01))
    weights = fit_weights(vehicle(), late, [flown], [HORIZON])
    assert np.abs(weights[0].attitude[0]).max() < 0.5
    ((model, held),) = predict_flights(vehicle(), late, [flown], [HORIZON], weights=weights)
    assert model.attitude < held.attitude
