"""What folds away of a measurement: an attitude that no draw turns, and no other."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm.algebra import Vec3
from skyarm.sensing.measurement import SensorNoise, measure, noise_count
from support.vehicles import hummingbird_arm, tumbling

STATE = tumbling(hummingbird_arm())
COUNT = noise_count(2, 4)
ATTITUDE = 6
"""Place of the first of the attitude's three draws: after position and velocity."""


def measured(turn, noise):
    draws = [0] * COUNT
    draws[ATTITUDE : ATTITUDE + 3] = turn
    return measure(noise, 0.0, STATE, Vec3(0.0, 0.0, 9.8), draws).quaternion


def rotation(q):
    return Rotation.from_quat([float(q.x), float(q.y), float(q.z), float(q.w)])


@pytest.mark.parametrize(
    "turn",
    [
        (1.0, 0, 0),
        (0, 1.0, 0),
        (0, 0, 1.0),
        (0, 1.0, -2.0),
        (1.0, 0, -2.0),
        (1.0, 2.0, 0),
    ],
)
def test_an_attitude_turns_by_the_draws_that_there_are(turn):
    """Some of them structural zeros: the rotation vector in base axes, by SciPy."""
    found = rotation(measured(turn, SensorNoise(attitude=0.01)))
    expected = rotation(STATE.quaternion) * Rotation.from_rotvec(
        0.01 * np.array(turn, dtype=float)
    )
    assert (expected.inv() * found).magnitude() < 1e-12


@pytest.mark.parametrize(
    ("turn", "noise"),
    [((0, 0, 0), SensorNoise(attitude=0.01)), ((1.0, 2.0, 3.0), SensorNoise())],
)
def test_an_attitude_that_nothing_turns_is_handed_on_untouched(turn, noise):
    assert measured(turn, noise) is STATE.quaternion


def test_a_whole_number_that_turns_is_no_zero():
    """Draws and deviations may be structure too."""
    expected = rotation(STATE.quaternion) * Rotation.from_rotvec([1.0, 0.0, 2.0])
    found = rotation(measured((1, 0, 2), SensorNoise(attitude=1)))
    assert (expected.inv() * found).magnitude() < 1e-12
