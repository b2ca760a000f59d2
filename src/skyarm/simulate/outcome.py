"""What a batch of episodes left."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy.typing as npt

from skyarm.dynamics import State
from skyarm.log.batch_log import BatchLog

Array = npt.NDArray[Any]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a batch of episodes left, one entry per lane.

    Attributes:
        metrics: by name; they count only the time an episode was alive. NaN where it ended before their window.
        completed: True where the episode flew its whole duration without an ending, even at its very end. end_time: s.
        status: "completed", or why it ended (:mod:`skyarm.scenario.endings`).
        state: the last one of each lane.
        log: of a batch that keeps one, else None.
    """

    metrics: dict[str, Array]
    completed: Array
    end_time: Array
    status: Array
    state: State
    log: BatchLog | None = None
