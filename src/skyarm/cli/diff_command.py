"""Command ``skyarm diff``: compare two logs, or a log with a repeated flight."""

from __future__ import annotations

from typing import Annotated

import typer

from skyarm.cli.lines import DIFFERENT, say
from skyarm.cli.output import bar, give, tell
from skyarm.log.flight_log import Log, rows_of
from skyarm.log.flown_scenario import written_scenario
from skyarm.log.log_differences import difference_lines, log_differences
from skyarm.log.metrics.accumulate import CONTINUOUS
from skyarm.log.metrics.score import score
from skyarm.records.files import number
from skyarm.records.text_tables import aligned_lines
from skyarm.scenario.scenario_differences import (
    changed_field_lines,
    scenario_differences,
)
from skyarm.simulate.check_endings import RUNNING
from skyarm.simulate.loop import read, replay

SHORT = (
    *(
        f"{what}_error_{how}{CONTINUOUS}"
        for what in ("position", "joint", "ee")
        for how in ("mean", "max")
    ),
    "tilt_max",
    "rotor_jitter",
    "rotor_saturation",
)
"""Metrics that a terminal shows side by side: errors against the continuous reference,
as in ``skyarm run``."""


def diff(
    flight: str,
    other: Annotated[str | None, typer.Argument()] = None,
    tolerance: float = 0.0,
) -> None:
    """Compare two logs, or a log with its flight flown again.

    First divergence in time, largest difference of each quantity, metrics side by side,
    and fields in which the scenarios differ. Exit code 1 if the logs differ.

    Options:
        flight LOG: the log of a flight
        other OTHER: another log; left out: the flight is flown again and compared
        tolerance: largest difference that counts as none, in the SI unit of each
            quantity
    """
    number(tolerance, "--tolerance", low=0.0)
    a = read(flight)
    if other is None:
        labels = ("log", "again")
        with bar(str(a.info["scenario"])) as advance:
            b = replay(a, progress=advance)
        if a.status == RUNNING:  # the log of a session that was left before its end
            # a session's log ends where it was left; the repetition is cut there
            b = rows_of(b, slice(0, a.time.size))
            b.info["status"] = RUNNING
    else:
        labels, b = ("first", "second"), read(other)
    differences, logs = log_differences(a, b, tolerance), (a, b)
    equal = differences.equal and a.status == b.status
    metrics = [_metrics(log) for log in logs]
    scenarios = scenario_differences(written_scenario(a.info), written_scenario(b.info))
    give(
        equal=equal,
        instants=dict(
            zip(("both", "first", "second"), differences.instants, strict=True)
        ),
        status=[log.status for log in logs],
        versions=[log.info.get("versions") for log in logs],
        differences=differences.columns,
        unmatched=differences.unmatched,
        metrics=metrics,
        scenario=scenarios,
    )
    laws = [
        " and ".join(
            {str(own.info.get("controller", "")): None for own in log.agents.values()}
        )
        for log in logs
    ]
    tell(*difference_lines(differences, labels, tolerance))
    ends = [f"{log.status} at {log.info['end_time']:g} s" for log in logs]
    names = [before + name for before in _by_prefix(a) for name in SHORT]
    rows = [
        (name, *(f"{each[name]:.4g}" for each in metrics))
        for name in names
        if all(name in of for of in metrics)
    ]
    tell(*aligned_lines([("", *labels), ("law", *laws), ("ended", *ends), *rows]))
    tell(*changed_field_lines(scenarios, laws))
    _say_versions(a, b)
    if not equal:
        raise typer.Exit(DIFFERENT)


def _by_prefix(log: Log) -> dict[str, Log]:
    """Log of each vehicle by the beginning of the names of its metrics; empty for the
    only one.
    """
    # keys of the document: those of one vehicle have been without its name
    return {
        f"{name}_" if len(log.agents) > 1 else "": own
        for name, own in log.agents.items()
    }


def _metrics(log: Log) -> dict[str, float]:
    """Compute metrics of a log; empty for a log without instants."""
    if not log.time.size:
        return {}
    metrics = ("standard", f"standard{CONTINUOUS}", *SHORT)
    return {
        before + name: value
        for before, own in _by_prefix(log).items()
        for name, value in score(own, metrics).items()
    }


def _say_versions(a: Log, b: Log) -> None:
    """Warn if two logs were written by different software versions."""
    ours, theirs = (log.info.get("versions") or {} for log in (a, b))
    other = [name for name in {**ours, **theirs} if ours.get(name) != theirs.get(name)]
    if other:
        words = ", ".join(
            f"{name} {ours.get(name, 'unknown')} and {theirs.get(name, 'unknown')}"
            for name in other
        )
        say(f"note: the logs are of other versions: {words}")
