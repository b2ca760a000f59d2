"""Command ``skyarm diff``: compare two logs, or a log with a repeated flight."""

from __future__ import annotations

import dataclasses
from typing import Annotated

import typer

from skyarm.cli.lines import DIFFERENT, say
from skyarm.cli.output import bar, give, tell
from skyarm.log.flight_log import Log, rows_of
from skyarm.log.flown_scenario import written_scenario
from skyarm.log.log_differences import LogDifferences, log_differences
from skyarm.log.metrics.accumulate import CONTINUOUS
from skyarm.log.metrics.score import score
from skyarm.records.files import number, shown
from skyarm.records.text_tables import aligned_lines
from skyarm.scenario.scenario_differences import scenario_differences
from skyarm.simulate.check_endings import RUNNING
from skyarm.simulate.loop import read, replay

MOST_COLUMNS, MOST_FIELDS = 12, 20
"""Quantities, and fields of two scenarios, that a terminal shows; ``--json`` has all."""

SHORT = (
    *(f"{what}_error_{how}{CONTINUOUS}" for what in ("position", "joint", "ee") for how in ("mean", "max")),
    *("tilt_max", "rotor_jitter", "rotor_saturation"),
)
"""Metrics that a terminal shows side by side: errors against the continuous reference, as ``skyarm run`` has them."""


def diff(
    flight: Annotated[str, typer.Argument(help="the log of a flight")],
    other: Annotated[str | None, typer.Argument(help="another log; left out: the flight is flown again")] = None,
    tolerance: Annotated[
        float, typer.Option(help="largest difference that counts as none, in the SI unit of each quantity")
    ] = 0.0,
) -> None:
    """Compare two logs, or a log with its flight flown again.

    First divergence in time, largest difference of each quantity, metrics side by side, and fields in which the
    scenarios differ. Exit code 1 if the logs differ.
    """
    number(tolerance, "--tolerance", low=0.0)
    a = read(flight)
    if other is None:
        labels = ("log", "again")
        with bar(str(a.info["scenario"])) as advance:
            b = replay(a, progress=advance)
        if a.status == RUNNING:  # the log of a session that was left before its end
            b = rows_of(b, slice(0, a.time.size))
            b = dataclasses.replace(b, info={**b.info, "status": RUNNING})
    else:
        labels, b = ("first", "second"), read(other)
    found, logs = log_differences(a, b, tolerance), (a, b)
    equal = found.equal and a.status == b.status
    metrics = [_metrics(log) for log in logs]
    scenarios = scenario_differences(written_scenario(a.info), written_scenario(b.info))
    give(
        equal=equal,
        instants=dict(zip(("both", "first", "second"), found.instants, strict=True)),
        status=[log.status for log in logs],
        versions=[log.info.get("versions") for log in logs],
        differences=found.columns,
        unmatched=found.unmatched,
        metrics=metrics,
        scenario=scenarios,
    )
    laws = [str(log.info.get("controller", "")) for log in logs]
    tell(*_difference_lines(found, labels, tolerance))
    ends = [f"{log.status} at {log.info['end_time']:g} s" for log in logs]
    rows = [(name, *(f"{each[name]:.4g}" for each in metrics)) for name in SHORT if all(name in of for of in metrics)]
    tell(*aligned_lines([("", *labels), ("law", *laws), ("ended", *ends), *rows]))
    tell(*_scenario_lines(scenarios, laws))
    _say_versions(a, b)
    if not equal:
        raise typer.Exit(DIFFERENT)


def _metrics(log: Log) -> dict[str, float]:
    """Compute metrics of a log; empty for a log without instants."""
    return score(log, ("standard", f"standard{CONTINUOUS}", *SHORT)) if log.time.size else {}


def _say_versions(a: Log, b: Log) -> None:
    """Warn if two logs were written by different software versions."""
    ours, theirs = (log.info.get("versions") or {} for log in (a, b))
    other = [name for name in {**ours, **theirs} if ours.get(name) != theirs.get(name)]
    if other:
        words = ", ".join(f"{name} {ours.get(name, 'unknown')} and {theirs.get(name, 'unknown')}" for name in other)
        say(f"note: the logs are of other versions: {words}")


def _difference_lines(found: LogDifferences, labels: tuple[str, str], tolerance: float) -> list[str]:
    """Text of the first difference between two logs, and of the largest difference in each quantity."""
    both, first, second = found.instants
    within = f" within {tolerance:g}" if tolerance else ""
    lines = []
    if first != second:
        lines.append(f"control periods: {first} in {labels[0]}, {second} in {labels[1]}, {both} in both")
    if found.unmatched:
        lines.append(f"columns of one log alone: {', '.join(found.unmatched)}")
    if not found.columns:
        return [*lines, f"every number is the same{within} in {both} control periods"]
    one, *_ = found.columns
    numbers = f"{one.first!r} and {one.second!r} {one.unit}".rstrip()
    lines.append(f"first difference{f' above {tolerance:g}' if tolerance else ''}: at {one.time:g} s, {one.name} = "
                 f"{numbers}, {abs(one.first - one.second):.3g} apart")  # fmt: skip
    rows = [("quantity", "unit", "from, s", "largest", "at, s")]
    rows += [
        (each.name, each.unit, f"{each.time:g}", f"{each.largest:.3g}", f"{each.at:g}")
        for each in found.columns[:MOST_COLUMNS]
    ]
    lines += [line.rstrip() for line in aligned_lines(rows)]
    return lines + _more(len(found.columns) - MOST_COLUMNS, "quantities")


def _scenario_lines(found: dict[str, tuple[object, object]], laws: list[str]) -> list[str]:
    """Text of the scenario fields in which two logs differ."""
    lines = ["the scenarios differ in"] if found else []
    if any(path.startswith("controller.law.") for path in found):
        lines.append("  controller: " + " and ".join(map(shown, laws)))
        found = {path: pair for path, pair in found.items() if not path.startswith("controller.")}
    lines += [f"  {path}: {shown(ours)} and {shown(theirs)}" for path, (ours, theirs) in found.items()][:MOST_FIELDS]
    return lines + _more(len(found) - MOST_FIELDS, "fields")


def _more(count: int, what: str) -> list[str]:
    return [f"and {count} {what} more, which --json lists"] if count > 0 else []
