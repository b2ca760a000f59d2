"""What flights of the contact suite say: success, what a flight lacked, and numbers over the flights of a cell."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.compare.cells import Cell
from skyarm.compare.contact_tasks import Task
from skyarm.sweep.intervals import wilson

Array = npt.NDArray[Any]
Flags = npt.NDArray[np.bool_]

HELD = 0.9
"""Share of the time that a force must be within 30 % of the wanted one."""

NEAR = 0.010
"""m, of the place where an object is set down."""

APART = 0.05
"""m, of a vehicle that stands from where it shall."""

SOON = 0.005
"""s: worlds whose commands are late by at most this are counted by themselves, too."""

METRICS = ("contact", "phases_done")
"""Beside what every comparison counts."""

SHOWN: Mapping[str, str] = {
    "force_error": "contact_error_mean",
    "ripple": "contact_ripple",
    "peak": "contact_largest",
    "tip": "contact_tip_mean",
    "losses": "contact_losses",
    "time": "phases_time",
}
"""Number of a cell -> its metric."""

HANDLE: Mapping[str, str] = {
    "radial": "grip_force_mean",
    "radial_most": "grip_force_max",
    "lag_most": "grip_lag_max",
}
"""Number of a cell in which a handle is held -> its metric; the first a median, the others in 95 % of the flights."""

MOST = 95.0
"""Percent of the flights that stay below a largest value."""


def lacks(task: Task, cell: Cell, weight: float, phases: int) -> dict[str, Flags]:
    """What each flight lacked, by a word, in the order in which it is asked for.

    Args:
        task: says what counts.
        cell: its flights.
        weight: of the vehicle, N.
        phases: of the scenario that was flown; 0 where none waits.
    """
    m, late = cell.metrics, cell.status == "phase_failed"
    found = {"lost": ~(cell.flown | (late & cell.upright))}
    found["phases"] = late | ~(m["phases_done"] >= phases)
    if task.held:
        found["force"] = ~(m["contact_held"] >= HELD)
    if task.angle is not None:
        found["opening"] = ~(m["mechanism_furthest"] >= task.angle)
    if task.depth is not None:
        found["depth"] = ~(m["tip_lowest"] <= task.depth)
    if task.place is not None:
        x, y = task.place
        found["place"] = ~(np.hypot(m["object_last_x"] - x, m["object_last_y"] - y) <= NEAR)
    if task.stands is not None:
        found["standing"] = ~(m["contact_last"] >= task.stands * weight)
        found["place"] = ~(m["ee_error_last_mean_continuous"] <= APART)
    return found


def cell_record(task: Task, cell: Cell, weight: float, phases: int, delays: Array) -> dict[str, Any]:
    """A cell as plain data: success with its interval, causes, and medians over flights that came to their end.

    Args:
        task: as of :func:`lacks`; a flight that lacks several things counts under the first.
        cell: its flights.
        weight: N, of the vehicle.
        phases: of the scenario.
        delays: of the commands in each flight, s.
    """
    bad = np.zeros(len(cell.status), dtype=bool)
    causes: Counter[str] = Counter()
    for word, flags in lacks(task, cell, weight, phases).items():
        for k in np.flatnonzero(flags & ~bad):
            causes[str(cell.status[k]) if word == "lost" and not cell.completed[k] else word] += 1
        bad |= flags
    count, good = len(bad), int((~bad).sum())
    found: dict[str, Any] = {"flights": count, "successes": good, "success_rate": good / count}
    found["success_interval"] = list(wilson(good, count))
    soon = np.asarray(delays) <= SOON
    found["soon"] = {"flights": int(soon.sum()), "successes": int((soon & ~bad).sum())}
    found["causes"] = dict(causes.most_common())
    for name, metric in SHOWN.items():
        values = cell.metrics[metric][cell.completed]
        inside = np.abs(values[np.isfinite(values)])
        found[name] = float(np.median(inside)) if inside.size else None
    if not phases:  # the plan says when it is over
        found["time"] = None
    return found | _handle(cell)


def _handle(cell: Cell) -> dict[str, float | None]:
    """Numbers of a handle that is held; None where there is none."""
    found: dict[str, float | None] = {}
    for name, metric in HANDLE.items():
        values = cell.metrics[metric][cell.completed]
        inside = values[np.isfinite(values)]
        share = MOST if name.endswith("_most") else 50.0
        found[name] = float(np.percentile(inside, share)) if inside.size else None
    return found
