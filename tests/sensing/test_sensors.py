"""Measurements: perfect ones are the state, noisy ones have the stated deviation."""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.algebra import Vec3
from skyarm.records.leaves import leaves
from skyarm.sensing.measurement import SensorNoise, measure, noise_count
from support.vehicles import hummingbird_arm, rotation_matrix, tumbling

STATE = tumbling(hummingbird_arm())
FORCE = Vec3(0.3, -0.2, 9.7)
COUNT = noise_count(2, 4)
VECTORS = ("position", "velocity", "rate", "specific_force")
LISTS = ("joints", "joint_rates", "rotor_speeds")


def truth(name):
    return FORCE if name == "specific_force" else getattr(STATE, name)


def test_a_measurement_takes_one_draw_a_channel():
    assert COUNT == 3 * 5 + 2 * 2 + 4
    for wrong in (COUNT - 1, COUNT + 1):
        with pytest.raises(
            ValueError, match=rf"noise has {wrong} numbers: must be {COUNT}"
        ):
            measure(SensorNoise(), 0.0, STATE, FORCE, (0.0,) * wrong)


@pytest.mark.parametrize(
    "noise",
    [(0,) * COUNT, tuple(np.linspace(-3.0, 3.0, COUNT).tolist())],
    ids=["no draws", "draws"],
)
def test_a_perfect_measurement_is_the_state(noise):
    reading = measure(SensorNoise(), 1.25, STATE, FORCE, noise)
    assert reading.time == 1.25
    assert reading.quaternion == STATE.quaternion
    for name in (*VECTORS, *LISTS):
        assert getattr(reading, name) == truth(name)


@pytest.mark.parametrize("name", [*VECTORS, *LISTS])
def test_noise_is_sigma_times_the_draw_on_its_own_channel(name):
    draws = np.arange(1.0, COUNT + 1.0)
    reading = measure(
        SensorNoise(**{name: 0.01}), 0.0, STATE, FORCE, tuple(draws.tolist())
    )
    for other in (*VECTORS, *LISTS):
        if other != name:
            assert getattr(reading, other) == truth(other)
    assert reading.quaternion == STATE.quaternion
    error = np.subtract(tuple(getattr(reading, name)), tuple(truth(name))) / 0.01
    # whole, positive and consecutive draws
    np.testing.assert_allclose(error, error[0] + np.arange(len(error)), atol=1e-9)
    assert 1.0 - 1e-9 <= error[0] <= COUNT


def test_no_two_channels_share_a_draw():
    used = []
    for name in (*VECTORS, *LISTS):
        reading = measure(
            SensorNoise(**{name: 1.0}),
            0.0,
            STATE,
            FORCE,
            tuple(np.arange(COUNT, dtype=float).tolist()),
        )
        error = np.subtract(tuple(getattr(reading, name)), tuple(truth(name)))
        used += np.round(error).astype(int).tolist()
    turn = _turn(
        measure(
            SensorNoise(attitude=1e-3),
            0.0,
            STATE,
            FORCE,
            tuple(np.arange(COUNT, dtype=float).tolist()),
        )
    )
    used += np.round(turn / 1e-3).astype(int).tolist()
    assert sorted(used) == list(range(COUNT))


def _turn(reading):
    """Rotation vector, base axes, from the true to the measured attitude."""
    from scipy.spatial.transform import Rotation

    true, read = (
        rotation_matrix(np.array(tuple(q)))
        for q in (STATE.quaternion, reading.quaternion)
    )
    return Rotation.from_matrix(true.T @ read).as_rotvec()


def test_attitude_noise_is_a_rotation_vector_in_base_axes():
    draws = [0.0] * COUNT
    draws[6:9] = [0.5, -1.0, 2.0]
    reading = measure(SensorNoise(attitude=0.1), 0.0, STATE, FORCE, tuple(draws))
    np.testing.assert_allclose(_turn(reading), [0.05, -0.1, 0.2], atol=1e-15)
    assert np.linalg.norm(tuple(reading.quaternion)) == pytest.approx(1.0, abs=1e-15)


def test_many_draws_have_the_stated_deviation():
    """40000 lanes at once: the deviation of a sample is known to 0.35 %, five of these
    are allowed.
    """
    lanes = 40_000
    noise = np.random.default_rng(12).standard_normal((COUNT, lanes))
    sigmas = {
        "position": 0.01,
        "velocity": 0.02,
        "rate": 0.03,
        "specific_force": 0.4,
        "joints": 0.005,
        "joint_rates": 0.06,
        "rotor_speeds": 7.0,
    }
    reading = measure(
        SensorNoise(attitude=0.02, **sigmas), 0.0, STATE, FORCE, tuple(noise)
    )
    for name, sigma in sigmas.items():
        for value, true in zip(getattr(reading, name), truth(name), strict=True):
            assert np.std(value - true) == pytest.approx(sigma, rel=0.018)
            assert np.mean(value - true) == pytest.approx(
                0.0, abs=5.0 * sigma / lanes**0.5
            )
    from scipy.spatial.transform import Rotation

    w, x, y, z = (np.broadcast_to(c, lanes) for c in reading.quaternion)
    true = Rotation.from_quat(
        [STATE.quaternion.x, STATE.quaternion.y, STATE.quaternion.z, STATE.quaternion.w]
    )
    turns = (
        true.inv() * Rotation.from_quat(np.stack([x, y, z, w], axis=1))
    ).as_rotvec()
    np.testing.assert_allclose(turns.std(axis=0), 0.02, rtol=0.018)


def test_a_perfect_measurement_costs_nothing():
    """Structural zeros of noise and deviation leave the state's own scalars."""
    reading = measure(SensorNoise(), 0.0, STATE, FORCE, (0,) * COUNT)
    for mine, yours in zip(
        leaves(reading.position), leaves(STATE.position), strict=True
    ):
        assert mine is yours
