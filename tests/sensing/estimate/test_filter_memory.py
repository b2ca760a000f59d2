"""Queues of readings: each reading is taken in its turn, whatever its place in the
queue.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest

from skyarm.sensing.estimate.filter_constants import in_turn


@dataclass(frozen=True)
class Reading:
    time: Any
    value: Any


PERIOD = 0.005


@pytest.mark.parametrize("length", [1, 2, 3, 5])
def test_the_reading_of_an_instant_is_found_at_every_place_of_the_queue(length):
    queue = [Reading(time=k * PERIOD, value=float(10 + k)) for k in range(length)]
    for k, reading in enumerate(queue):
        due, found = in_turn(queue, (k - 1) * PERIOD, k * PERIOD)
        assert bool(due)
        assert found == reading


def test_between_readings_and_beyond_them_none_is_due():
    queue = [Reading(time=k * PERIOD, value=0.0) for k in (0, 4, 8)]
    for after, until in (
        (0.0, 3 * PERIOD),
        (4 * PERIOD, 7 * PERIOD),
        (8 * PERIOD, 9 * PERIOD),
        (-2.0, -1.0),
    ):
        assert not in_turn(queue, after, until)[0]
