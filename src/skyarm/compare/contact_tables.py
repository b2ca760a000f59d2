"""The contact suite as tables: successes of every law in every task, what the others lacked, numbers, a CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from typing import Any

from skyarm.compare.comparison_tables import DASH, markdown, number
from skyarm.compare.contact_flights import CONDITIONS
from skyarm.compare.contact_record import HANDLE, HELD, MOST, NEAR, SHOWN, SOON
from skyarm.metrics.contact_totals import BAND

MEANING = (
    "A success is a flight that is not lost (it came to its end, tilted by at most 80 degrees, the tip within 0.5 m of "
    "its reference in the mean of the last seconds), with all phases done in time; where a force is held it is within "
    f"{100.0 * BAND:g} % for {100.0 * HELD:g} % of the time from 2 s after the first touch on; a box lies within "
    f"{1e3 * NEAR:g} mm of its place, a door is open by 55 degrees, a valve by 80, a button has clicked, a peg is "
    "90 % deep, a vehicle that landed carries a tenth of its weight on its skids, within 5 cm. A flight that lacks "
    "several counts under the first of them; names of endings are those of lost flights."
)

NUMBERS: Mapping[str, tuple[str, float]] = {
    "force_error": ("force error, N", 1.0),
    "ripple": ("ripple, N", 1.0),
    "peak": ("peak, N", 1.0),
    "tip": ("tip, mm", 1e3),
    "losses": ("losses", 1.0),
    "time": ("time, s", 1.0),
}
"""Number of a cell -> head, factor from SI to the unit of the head: medians over flights that came to their end."""


def laws_of(found: Mapping[str, Any], condition: str) -> list[str]:
    """Laws that flew any task under a condition, in order."""
    flown = {law for task in found["tasks"].values() for law in task["conditions"][condition]}
    return [law for law in found["laws"] if law in flown]


def success_rows(found: Mapping[str, Any], condition: str) -> list[list[str]]:
    """One row per task: successes of each law."""
    return [
        [task["title"], *(_successes(task["conditions"][condition].get(law)) for law in laws_of(found, condition))]
        for task in found["tasks"].values()
    ]


def number_rows(found: Mapping[str, Any], condition: str) -> list[list[str]]:
    """One row per task and law: medians, and what was lacked."""
    rows = []
    for task in found["tasks"].values():
        for law, cell in task["conditions"][condition].items():
            numbers = [_scaled(cell[name], factor) for name, (_, factor) in NUMBERS.items()]
            rows.append([task["title"], law, _successes(cell), _successes(cell["soon"]), *numbers, _causes(cell)])
    return rows


def number_head() -> list[str]:
    """Heads of :func:`number_rows`."""
    return ["task", "law", "success", f"delay to {1e3 * SOON:g} ms", *(head for head, _ in NUMBERS.values()), "lacked"]


HANDLES: Mapping[str, tuple[str, float]] = {
    "radial": ("radial force, mean, N", 1.0),
    "radial_most": (f"largest, in {MOST:g} %, N", 1.0),
    "lag_most": (f"largest lag, in {MOST:g} %, deg", 180.0 / math.pi),
}
"""Number of a cell -> head, factor: of a handle that is held."""


def handle_rows(found: Mapping[str, Any], condition: str) -> list[list[str]]:
    """One row per task with a handle and law; the first number is a median."""
    return [
        [task["title"], law, *(_scaled(cell[name], factor) for name, (_, factor) in HANDLES.items())]
        for task in found["tasks"].values()
        for law, cell in task["conditions"][condition].items()
        if cell["radial"] is not None
    ]


def handle_head() -> list[str]:
    """Heads of :func:`handle_rows`."""
    return ["task", "law", *(head for head, _ in HANDLES.values())]


def worlds_line(found: Mapping[str, Any]) -> str:
    """How many worlds were drawn for each task and discarded."""
    told = [f"{name} {task['discarded']} of {task['drawn']}" for name, task in found["tasks"].items()]
    return f"Worlds discarded, in which physics does not let the task be done: {', '.join(told)}."


def contact_report(found: Mapping[str, Any]) -> str:
    """All tables as Markdown."""
    parts = [f"# Tasks in contact, {found['worlds']} wrong worlds each, on {found['plant']}", MEANING]
    parts.append(worlds_line(found))
    for name, title in CONDITIONS.items():
        laws = laws_of(found, name)
        if laws:
            parts += [f"## Successes, {title}", markdown(["task", *laws], success_rows(found, name))]
    for name, title in CONDITIONS.items():
        if laws_of(found, name):
            parts += [f"## Numbers, {title}", markdown(number_head(), number_rows(found, name))]
        if handle_rows(found, name):
            parts += [f"## Handles, {title}", markdown(handle_head(), handle_rows(found, name))]
    parts += [f"{law} does not fly: {why}" for law, why in found["not_flown"].items()]
    return "\n\n".join(parts) + "\n"


def contact_csv(found: Mapping[str, Any]) -> str:
    """Every cell in a row, SI units."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    numbers: Sequence[str] = ("flights", "successes", *SHOWN, *HANDLE)
    writer.writerow(["task", "condition", "law", *numbers, "soon_flights", "soon_successes", "lacked"])
    for name, task in found["tasks"].items():
        for condition, laws in task["conditions"].items():
            for law, cell in laws.items():
                values = ["" if cell[key] is None else cell[key] for key in numbers]
                soon = [cell["soon"][key] for key in ("flights", "successes")]
                writer.writerow([name, condition, law, *values, *soon, _causes(cell)])
    return stream.getvalue()


def _successes(cell: Mapping[str, Any] | None) -> str:
    return DASH if cell is None else f"{cell['successes']} of {cell['flights']}"


def _scaled(value: float | None, factor: float) -> str:
    return DASH if value is None else number(factor * value)


def _causes(cell: Mapping[str, Any]) -> str:
    return ", ".join(f"{word} {count}" for word, count in cell["causes"].items()) or DASH
