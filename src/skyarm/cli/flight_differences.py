"""``skyarm replay`` and ``skyarm diff``: what they find and what they print of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from skyarm.cli.lines import say
from skyarm.cli.terminal_tables import aligned
from skyarm.files import shown
from skyarm.log.flight_log import Log
from skyarm.log.log_differences import LogDifferences, log_differences
from skyarm.metrics.accumulate import CONTINUOUS
from skyarm.metrics.score import score
from skyarm.scenario.scenario_text import scenario_differences
from skyarm.simulate.check_endings import RUNNING

MOST_COLUMNS = 12
"""Quantities that a terminal shows; ``--json`` has all."""

MOST_FIELDS = 20
"""Fields of two scenarios that a terminal shows."""

SHORT = (
    *(f"{what}_error_{how}{CONTINUOUS}" for what in ("position", "joint", "ee") for how in ("mean", "max")),
    *("tilt_max", "rotor_jitter"),
)
"""Metrics that a terminal shows side by side: errors against the continuous reference, as ``skyarm run`` has them."""


COURSES = {"grows": "grows", "shrinks": "shrinks", "stays": "keeps its size"}
"""What becomes of a difference, in words."""


def metrics_of(log: Log) -> dict[str, float]:
    """Metrics of a log; none of one that is too short for any."""
    return score(log, ("standard", f"standard{CONTINUOUS}", "tilt_max", "rotor_jitter")) if log.time.size else {}


def same_bits(a: Log, b: Log) -> bool:
    """Whether two logs hold the same bits, as far as the shorter goes."""
    count = min(a.time.size, b.time.size)
    ours, theirs = a.arrays(), b.arrays()
    both = [name for name in ours if name in theirs]  # logs of earlier versions have other arrays
    return all(ours[name][:count].tobytes() == np.asarray(theirs[name])[:count].tobytes() for name in both)


def flown_again(log: Log, again: Log) -> bool:
    """Whether a flight was flown again to the bit, as far as its log goes if that was cut off."""
    if log.status == RUNNING:
        return again.time.size >= log.time.size and same_bits(log, again)
    return again.time.size == log.time.size and again.status == log.status and same_bits(log, again)


def are_equal(a: Log, b: Log, found: LogDifferences) -> bool:
    """Whether two logs are of the same numbers and ended in the same way."""
    return found.equal and a.status == b.status


def document(a: Log, b: Log, found: LogDifferences) -> dict[str, Any]:
    """Everything that was found, as plain data."""
    return {
        "equal": are_equal(a, b, found),
        "instants": dict(zip(("both", "first", "second"), found.instants, strict=True)),
        "status": [a.status, b.status],
        "versions": [a.info.get("versions"), b.info.get("versions")],
        "differences": [{name: getattr(each, name) for name in type(each).__slots__} for each in found.columns],
        "unmatched": list(found.unmatched),
        "metrics": [metrics_of(a), metrics_of(b)],
        "scenario": {path: list(pair) for path, pair in _scenarios(a, b).items()},
    }


def _scenarios(a: Log, b: Log) -> dict[str, tuple[Any, Any]]:
    return scenario_differences(a.info.get("scenario_record"), b.info.get("scenario_record"))


def say_versions(a: Log, b: Log) -> None:
    """Say which versions wrote two logs where they differ: bits may differ for that."""
    ours, theirs = (log.info.get("versions") or {} for log in (a, b))
    other = [name for name in {**ours, **theirs} if ours.get(name) != theirs.get(name)]
    if other:
        words = ", ".join(f"{name} {ours.get(name, 'unknown')} and {theirs.get(name, 'unknown')}" for name in other)
        say(f"note: the logs are of other versions: {words}")


def difference_lines(found: LogDifferences, labels: tuple[str, str], tolerance: float = 0.0) -> list[str]:
    """First divergence, and the largest difference of each quantity."""
    both, first, second = found.instants
    within = f" within {tolerance:g}" if tolerance else ""
    lines = []
    if first != second:
        lines.append(f"control periods: {first} in {labels[0]}, {second} in {labels[1]}, {both} in both")
    if not found.columns:
        return [*lines, f"every number is the same{within} in {both} control periods"]
    one, *_ = found.columns
    unit = f" {one.unit}" if one.unit else ""
    many = sum(each.time == one.time for each in found.columns)
    more = f" (and {many - 1} more at this instant)" if many > 1 else ""
    lines.append(
        f"first difference{f' above {tolerance:g}' if tolerance else ''}: at {one.time:g} s, {one.name} = "
        f"{one.first!r} and {one.second!r}{unit}, {abs(one.first - one.second):.3g} apart; "
        f"it {COURSES[one.course]}{more}"
    )
    rows = [("quantity", "unit", "from, s", "largest", "at, s", "")]
    rows += [
        (each.name, each.unit, f"{each.time:g}", f"{each.largest:.3g}", f"{each.at:g}", COURSES[each.course])
        for each in found.columns[:MOST_COLUMNS]
    ]
    lines += [line.rstrip() for line in aligned(rows)]
    if len(found.columns) > MOST_COLUMNS:
        lines.append(f"and {len(found.columns) - MOST_COLUMNS} quantities more, which --json lists")
    return lines


def metric_lines(a: Log, b: Log, labels: tuple[str, str]) -> list[str]:
    """Metrics side by side."""
    ours, theirs = metrics_of(a), metrics_of(b)
    rows = [("metric", *labels)]
    rows += [(name, f"{ours[name]:.4g}", f"{theirs[name]:.4g}") for name in SHORT if name in ours and name in theirs]
    ends = [f"{log.status} at {log.info['end_time']:g} s" for log in (a, b)]
    return aligned([("", *labels), ("ended", *ends), *rows[1:]])


def scenario_lines(a: Log, b: Log) -> list[str]:
    """Fields of the scenarios that differ; of two laws their names stand for all of their constants."""
    found = _scenarios(a, b)
    if not found:
        return []
    lines = ["the scenarios differ in"]
    if any(path.startswith("controller.law.") for path in found):
        lines.append(f"  controller: {shown(_law(a))} and {shown(_law(b))}")
        found = {path: pair for path, pair in found.items() if not path.startswith("controller.")}
    lines += [f"  {path}: {shown(ours)} and {shown(theirs)}" for path, (ours, theirs) in found.items()][:MOST_FIELDS]
    if len(found) > MOST_FIELDS:
        lines.append(f"  and {len(found) - MOST_FIELDS} fields more, which --json lists")
    return lines


def replay_document(a: Log, b: Log, file: Path) -> dict[str, Any]:
    """What a replay found, as plain data."""
    found = document(a, b, log_differences(a, b))
    return {**found, "bit_equal": flown_again(a, b), "controllers": [_law(a), _law(b)], "log": str(file)}


def _law(log: Log) -> str:
    return str(log.info.get("controller", ""))
