"""The comparison's tables as Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from skyarm.compare.columns import COST, COST_CASE, TOOL, TRACKING, WHICH, WRONG, Column, value
from skyarm.compare.entrants import ENTRANTS, Entrant
from skyarm.compare.suite import CASES, Condition

DASH = "-"

FEW = 10
"""Below this a share says how many flights it is of; and where others flew more."""


def number(found: float | None) -> str:
    """Two or three significant digits for reading; a dash for nothing."""
    if found is None:
        return DASH
    if found >= 100.0:
        return f"{found:.0f}"
    return f"{found:.1f}" if found >= 10.0 else f"{found:.2f}"


def markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; the first column is text, the others are numbers."""
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" + " ---: |" * (len(head) - 1)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


def truth_rows(
    summaries: Mapping[str, Any], entrants: Mapping[str, Entrant], columns: Sequence[Column]
) -> list[list[str]]:
    """One row per entrant that flew any of the columns."""
    rows = []
    for name in entrants:
        cells = [number(value(summaries, column, name)) for column in columns]
        if any(name in summaries.get(column.case, {}) for column in columns):
            rows.append([name, *cells])
    return rows


def plants_rows(summaries: Mapping[str, Any], entrants: Mapping[str, Entrant], cases: Sequence[str]) -> list[list[str]]:
    """One row per entrant: success with its interval, and tip error over 10 to 20 s (mean, 95th percentile)."""
    rows = []
    for name in entrants:
        cells = []
        for case in cases:
            found = summaries.get(case, {}).get(name)
            if found is None:
                cells += [DASH, DASH]
                continue
            low, high = found["success_interval"]
            spread = found["metrics"].get(TOOL)
            others = max(each["episodes"] for each in summaries[case].values())
            few = f" of {found['episodes']}" if found["episodes"] < max(FEW, others) else ""
            cells.append(f"{found['success_rate']:.1%} [{low:.1%}, {high:.1%}]{few}")
            cells.append(DASH if spread is None else f"{number(spread['mean'] * 1e3)} / {number(spread['p95'] * 1e3)}")
        if any(cell != DASH for cell in cells):
            rows.append([name, *cells])
    return rows


def step_rows(found: Mapping[str, Any]) -> list[list[str]]:
    """One row per law: median and 99th percentile of a control step, microseconds; one more for steps that solve."""
    rows = []
    for name, each in (found.get("step_times") or {}).items():
        rows.append([name, *_times(each)])
        if each and each.get("solving"):
            rows.append([f"{name}, solving", *_times(each["solving"])])
    return rows


def _times(found: Mapping[str, float] | None) -> list[str]:
    return [DASH, DASH] if found is None else [f"{found[which]:.2f}" for which in ("p50_us", "p99_us")]


def title_of(laws: Sequence[str]) -> str:
    """What a comparison of these laws is called: of two "A against B"."""
    if len(laws) == 2:
        return f"{laws[0]} against {laws[1]}"
    if set(ENTRANTS) <= set(laws):
        return "All laws compared"
    return laws[0] if len(laws) == 1 else f"{len(laws)} laws compared"


def report(found: Mapping[str, Any], entrants: Mapping[str, Entrant], conditions: Mapping[str, Condition]) -> str:
    """Every table under the comparison's title, one section per condition.

    Args:
        found: ``summaries`` by condition, case, entrant and ``step_times`` by entrant.
        entrants: in order.
        conditions: in order.
    """
    parts = [f"# {title_of(list(entrants))}"]
    for name, condition in conditions.items():
        summaries = found["summaries"].get(name)
        if not summaries:
            continue
        parts.append(f"## {name}: {condition.title}\n\n{condition.episodes} flights of each case.")
        if condition.spread:
            head = [
                "law",
                *(part for case in condition.cases for part in (f"{case} success", f"{case} tip, mm: mean / 95 %")),
            ]
            parts.append(markdown(head, plants_rows(summaries, entrants, condition.cases)))
            continue
        columns = WRONG if condition.change else TRACKING
        parts.append(f"Errors ({WHICH}):")
        parts.append(markdown(["law", *(c.head for c in columns)], truth_rows(summaries, entrants, columns)))
        rows = truth_rows(summaries, entrants, COST)
        parts.append(f"What they were bought with, in {COST_CASE}:")
        parts.append(markdown(["law", *(c.head for c in COST)], rows))
    rows = step_rows(found)
    if rows:
        parts.append("## One control step, microseconds\n\n" + markdown(["law", "median", "99 %"], rows))
    parts.append("## Cases\n\n" + "\n".join(f"* {case.name}: {case.title}" for case in CASES.values()))
    return "\n\n".join(parts) + "\n"
