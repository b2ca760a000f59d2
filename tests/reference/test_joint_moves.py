"""Moves of joints that do not carry the tip keep their limits and the largest planned
speed.
"""

import pytest

import skyarm
from skyarm.reference.phases import _require_within
from skyarm.reference.task_records import JointMove

VEHICLE = skyarm.load_vehicle("hummingbird_arm2")
PEAK = 35.0 / 16.0
"""Largest rate over the mean rate of a motion of least snap from rest to rest."""


@pytest.mark.parametrize("start", [0.0, 3.0])
def test_a_move_takes_as_long_as_its_peak_rate_asks(start):
    def move(seconds):
        return JointMove(
            joint="joint1", value=0.5, start=start, end=start + seconds, where="here"
        )

    least = PEAK * 0.4 / 2.0
    _require_within(move(1.05 * least), 0.1, VEHICLE, 0, 2.0)
    with pytest.raises(
        ValueError,
        match=r"here = 0\.5: moves by 0\.4 rad in .* s; must have .* s or more",
    ):
        _require_within(move(0.95 * least), 0.1, VEHICLE, 0, 2.0)
