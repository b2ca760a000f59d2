"""Evaluation and report of the contact suite: success rates, causes of failure, medians, tables."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping

import numpy as np

from skyarm.log.metrics.interaction import BAND
from skyarm.records.arrays import Mask
from skyarm.records.files import versions
from skyarm.studies.compare.cells import JITTER, LIMITED, Cell
from skyarm.studies.compare.contact_tasks import Task
from skyarm.studies.compare.run_suite import Document, Record
from skyarm.studies.sweep.intervals import wilson
from skyarm.view.pages import DASH, Report, Section, Table, number

HELD = 0.9
"""Share of the time that a force must be within 30 % of the wanted one."""

NEAR = 0.010
"""m, of the place where an object is set down."""

APART = 0.05
"""m, of a vehicle that stands from where it shall."""

METRICS = ("contact", "phases_done")
"""Beside what every comparison counts."""


NUMBERS: Mapping[str, tuple[str, str, float, float]] = {
    "force_error": ("contact_error_mean", "force error, N", 1.0, 50.0),
    "ripple": ("contact_ripple", "ripple, N", 1.0, 50.0),
    "peak": ("contact_largest", "peak, N", 1.0, 50.0),
    "tip": ("contact_tip_mean", "tip, mm", 1e3, 50.0),
    "losses": ("contact_losses", "losses", 1.0, 50.0),
    "time": ("phases_time", "time, s", 1.0, 50.0),
    "jitter": (JITTER, "rotor jitter, rad/s", 1.0, 50.0),
    "limited": (LIMITED, "a rotor at its limit, in 95 %, % of the periods", 100.0, 95.0),
    "radial": ("grip_force_mean", "radial force on a handle, N", 1.0, 50.0),
    "radial_most": ("grip_force_max", "largest, in 95 %, N", 1.0, 95.0),
    "lag_most": ("grip_lag_max", "largest lag, in 95 %, deg", 180.0 / math.pi, 95.0),
}
"""Number of a cell -> metric, head, factor from SI to its unit, percentile over flights that came to their end."""


def lacks(task: Task, cell: Cell, weight: float, phases: int) -> dict[str, Mask]:
    """Unmet success criteria of a contact task: criterion -> True for each flight that fails it.

    Args:
        task: with its success criteria.
        cell: its flights.
        weight: of the vehicle, N.
        phases: of the scenario that was flown; 0 where none waits.
    """
    m, late = cell.metrics, cell.status == "phase_failed"
    found = {"lost": ~(cell.tracked_to_end | (late & cell.upright))}
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


def cell_record(task: Task, cell: Cell, weight: float, phases: int) -> Document:
    """Results of one controller in a contact task as plain data: success rate, failure causes, median errors.

    Args:
        task: as of :func:`lacks`; a flight that lacks several things counts under the first.
        cell: its flights.
        weight: N, of the vehicle.
        phases: of the scenario.
    """
    bad = np.zeros(len(cell.status), dtype=bool)
    causes: Counter[str] = Counter()
    for word, flags in lacks(task, cell, weight, phases).items():
        for k in np.flatnonzero(flags & ~bad):
            causes[str(cell.status[k]) if word == "lost" and not cell.completed[k] else word] += 1
        bad |= flags
    count, good = len(bad), int((~bad).sum())
    found: Document = {"flights": count, "successes": good, "success_rate": good / count}
    found["success_interval"] = list(wilson(good, count))
    found["causes"] = dict(causes.most_common())
    for name, (metric, _, _, percentile) in NUMBERS.items():
        values = cell.metrics[metric][cell.completed]
        inside = np.abs(values[np.isfinite(values)])
        found[name] = float(np.percentile(inside, percentile)) if inside.size else None
    if not phases:  # the plan says when it is over
        found["time"] = None
    return found


CONDITIONS = {"perfect": "perfect state", "noisy": "noisy measurements"}
"""Both in the same perturbed worlds, with a delay of up to 10 ms that no law knows of."""

MEANING = (
    "A success is a flight that is not lost (it came to its end, tilted by at most 80 degrees, the tip within 0.5 m of "
    "its reference in the mean of the last seconds), with all phases done in time; where a force is held it is within "
    f"{100.0 * BAND:g} % for {100.0 * HELD:g} % of the time from 2 s after the first touch on; a box lies within "
    f"{1e3 * NEAR:g} mm of its place, a door is open by 55 degrees, a valve by 80, a button has clicked, a peg is "
    "90 % deep, a vehicle that landed carries a tenth of its weight on its skids, within 5 cm. A flight that lacks "
    "several counts under the first of them; names of endings are those of lost flights."
)

HOW = (
    "Every law meets the same worlds: stiffness 500 to 1e5 N/m, friction 0.1 to 0.8 (0.28 where the tip slides "
    "sideways), the believed normal wrong by up to 10 degrees, a hinge that is up to 6 % nearer or further, half "
    "to twice the friction, damping and closer behind a handle, half to twice the mass, thrust up to 10 % less, "
    "wind of up to 2 N and never more than half the push, commands up to 10 ms late. No law is told of any of it. "
    "A law that follows positions is led 1 cm behind the believed surface."
)

MEDIANS = (
    "Medians over the flights that came to their end; the force error by its size. Of a handle the force along its "
    "true radius, and by how much it was behind the angle that was asked for."
)


def contact_report(found: Record) -> Report:
    """Build the report of the contact suite's results."""
    drawn = [f"{name} {task['discarded']} of {task['drawn']}" for name, task in found["tasks"].items()]
    discarded = f"Worlds discarded, in which physics does not let the task be done: {', '.join(drawn)}."
    refused = [f"{law} does not fly: {why}" for law, why in found["not_flown"].items()]
    flown = [Section(name="What flew", notes=[MEANING, discarded, *refused], remark=HOW)]
    numbers = []
    for name, title in CONDITIONS.items():
        laws = laws_of(found, name)
        if not laws:
            continue
        successes = Table(head=["task", *(f">{law}" for law in laws)], rows=success_rows(found, name))
        flown.append(Section(title=f"Successes, {title}", tables=[successes]))
        head = ("task", "law", ">success", *(f">{h}" for _, h, *_ in NUMBERS.values()))
        table = Table(head=(*head, "lacked"), rows=number_rows(found, name))
        numbers.append(Section(title=f"Numbers, {title}", remark=MEDIANS, tables=[table]))
    return Report(
        title=f"Tasks in contact, {found['worlds']} wrong worlds each, on {found['plant']}",
        facts=f"{found['worlds']} worlds a task, seed {found['seed']}; skyarm {versions()['skyarm']}",
        sections=[*flown, *numbers],
    )


def laws_of(found: Record, condition: str) -> list[str]:
    """Names of the controllers with results in any contact task under a condition, in order."""
    flown = {law for task in found["tasks"].values() for law in task["conditions"][condition]}
    return [law for law in found["laws"] if law in flown]


def success_rows(found: Record, condition: str) -> list[list[str]]:
    """Table rows of success counts, one row per contact task, one column per controller."""
    return [
        [task["title"], *(_successes(task["conditions"][condition].get(law)) for law in laws_of(found, condition))]
        for task in found["tasks"].values()
    ]


def number_rows(found: Record, condition: str) -> list[list[str]]:
    """Table rows of median errors and failure causes, one row per contact task and controller."""
    return [
        [
            task["title"], law, _successes(cell),
            *(number(cell[name], factor) for name, (_, _, factor, _) in NUMBERS.items()), _causes(cell) or DASH,
        ]
        for task in found["tasks"].values()
        for law, cell in task["conditions"][condition].items()
    ]  # fmt: skip


def _successes(cell: Record | None) -> str:
    return DASH if cell is None else f"{cell['successes']} of {cell['flights']}"


def _causes(cell: Record) -> str:
    return ", ".join(f"{word} {count}" for word, count in cell["causes"].items())
