"""Phases of a task that went on because their time was over, not because the flight showed what they wait for."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from skyarm.reference.task_records import Guard

if TYPE_CHECKING:
    from skyarm.log.flight_log import Log

SAME = 1e-6
"""s of the reference within which it rests at one place."""


def waits_of(guards: Iterable[Guard]) -> list[dict[str, Any]]:
    """What a log keeps of each guard: its phase, where the reference rests (s) and for how long at most (s)."""
    return [{"phase": each.phase, "at": float(each.at), "timeout": float(each.timeout)} for each in guards]


def timed_out(log: Log) -> frozenset[int]:
    """Numbers of the phases at whose guard the reference rested for the whole timeout.

    A guard that is met in the very last period of its timeout counts among them.
    """
    found = set()
    for wait in log.info.get("waits", ()):
        if not log.path_time.size:
            continue
        resting = log.time[np.abs(log.path_time - wait["at"]) < SAME]
        if resting.size and resting[-1] - resting[0] > wait["timeout"] - SAME:
            found.add(int(wait["phase"]))
    return frozenset(found)
