"""``skyarm replay`` and ``skyarm diff``: a flight flown again, and two logs compared."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from skyarm.cli.arguments import Controller
from skyarm.cli.lines import DIFFERENT, NOT_COMPLETED, say
from skyarm.cli.output import aligned_lines, bar, give, tell
from skyarm.cli.run_command import earlier_kept, log_files
from skyarm.log.flight_log import Log
from skyarm.log.flown_scenario import written_scenario
from skyarm.log.formats import save_log
from skyarm.log.log_differences import LogDifferences, log_differences
from skyarm.log.metrics.accumulate import CONTINUOUS
from skyarm.log.metrics.score import score
from skyarm.records.files import number, require_replaceable, require_writable, shown, taken_back
from skyarm.scenario.scenario_differences import scenario_differences
from skyarm.simulate.check_endings import RUNNING
from skyarm.simulate.loop import read, scenario_to_replay
from skyarm.simulate.loop import run as fly

MOST_COLUMNS, MOST_FIELDS = 12, 20
"""Quantities, and fields of two scenarios, that a terminal shows; ``--json`` has all."""

SHORT = (
    *(f"{what}_error_{how}{CONTINUOUS}" for what in ("position", "joint", "ee") for how in ("mean", "max")),
    *("tilt_max", "rotor_jitter"),
)
"""Metrics that a terminal shows side by side: errors against the continuous reference, as ``skyarm run`` has them."""


def replay(
    flight: Annotated[str, typer.Argument(help="the log of a flight (.npz)")],
    controller: Controller = None,
    out: Annotated[
        str | None, typer.Option("--out", "-o", metavar="FILE", help="log of the new flight, its format by its suffix")
    ] = None,
) -> None:
    """Fly a log's flight again, also under another law.

    The same scenario with the same noise, wind, pushes and changes. Without --controller the new flight is compared
    with the log to the bit; exit code 1 if it differs. With it both stand side by side, and the exit code is 3 if the
    new flight ended before its time. The new log is out/replay/NAME.npz, or FILE; an earlier one there is kept as
    NAME_1.npz.
    """
    before = read(flight)
    planned = scenario_to_replay(before, controller)
    usual = Path("out/replay") / f"{planned.name}.npz"
    (file,) = log_files([out] if out is not None else None, (usual,))
    with taken_back(*(() if out is not None else (usual.parent,))):
        if out is None:
            require_writable(usual.parent)
        require_replaceable(file)
        with bar(planned.name) as advance:
            log = fly(planned, advance)
    with earlier_kept([file]) as kept:
        save_log(log, file)
    again = controller is None
    equal, found = flown_again(before, log), log_differences(before, log)
    names = [str(each.info.get("controller", "")) for each in (before, log)]
    give(_document(before, log, found), bit_equal=equal, controllers=names, log=str(file))
    labels = ("log", "again") if again else (names[0] or "log", names[1])
    tell(f"{planned.name}: law {names[1]} on {log.info['plant_vehicle']}, plant {log.info['plant']}")
    if again and equal:
        tell(f"equal to the bit: {before.time.size} control periods")
    else:
        tell(*(_difference_lines(found, labels) if again else ()), *_metric_lines(before, log, labels))
    tell(f"log: {file}", *(f"the flight before it is kept: {name}" for name in kept))
    _say_versions(before, log)
    if again and not equal:
        raise typer.Exit(DIFFERENT)
    if not again and log.status != "completed":
        raise typer.Exit(NOT_COMPLETED)


def diff(
    first: Annotated[str, typer.Argument(help="the log of a flight (.npz)")],
    second: Annotated[str, typer.Argument(help="the log of another")],
    tolerance: Annotated[
        float, typer.Option(help="differences up to this, in the SI unit of each quantity, count as none")
    ] = 0.0,
) -> None:
    """Compare two logs: where they come apart.

    The first divergence in time, the largest difference of each quantity, metrics side by side, and what differs
    between the scenarios. Exit code: 0 if they are equal, 1 if they differ, 2 if the input was wrong.
    """
    number(tolerance, "--tolerance", low=0.0)
    a, b = read(first), read(second)
    found = log_differences(a, b, tolerance)
    give(_document(a, b, found))
    tell(*_difference_lines(found, ("the first", "the second"), tolerance))
    tell(*_metric_lines(a, b, ("first", "second")), *_scenario_lines(a, b))
    _say_versions(a, b)
    if not _are_equal(a, b, found):
        raise typer.Exit(DIFFERENT)


def flown_again(log: Log, again: Log) -> bool:
    """True if a replay matches its log bit by bit, up to the log's end if that was cut off."""
    count = log.time.size
    enough = again.time.size >= count if log.status == RUNNING else again.time.size == count
    if not enough or log.status not in (RUNNING, again.status):
        return False
    ours, theirs = log.arrays(), again.arrays()  # logs of earlier versions have other arrays
    return all(ours[name].tobytes() == np.asarray(theirs[name])[:count].tobytes() for name in ours.keys() & theirs)


def _are_equal(a: Log, b: Log, found: LogDifferences) -> bool:
    return found.equal and a.status == b.status


def _metrics(log: Log) -> dict[str, float]:
    """Metrics of a log; none of one that is too short for any."""
    return score(log, ("standard", f"standard{CONTINUOUS}", "tilt_max", "rotor_jitter")) if log.time.size else {}


def _scenarios(a: Log, b: Log) -> dict[str, tuple[Any, Any]]:
    return scenario_differences(written_scenario(a.info), written_scenario(b.info))


def _document(a: Log, b: Log, found: LogDifferences) -> dict[str, Any]:
    """All results, as plain data."""
    return {
        "equal": _are_equal(a, b, found),
        "instants": dict(zip(("both", "first", "second"), found.instants, strict=True)),
        "status": [a.status, b.status],
        "versions": [a.info.get("versions"), b.info.get("versions")],
        "differences": [dataclasses.asdict(each) for each in found.columns],
        "unmatched": list(found.unmatched),
        "metrics": [_metrics(a), _metrics(b)],
        "scenario": {path: list(pair) for path, pair in _scenarios(a, b).items()},
    }


def _say_versions(a: Log, b: Log) -> None:
    """Say which versions wrote two logs where they differ: bits may differ for that."""
    ours, theirs = (log.info.get("versions") or {} for log in (a, b))
    other = [name for name in {**ours, **theirs} if ours.get(name) != theirs.get(name)]
    if other:
        words = ", ".join(f"{name} {ours.get(name, 'unknown')} and {theirs.get(name, 'unknown')}" for name in other)
        say(f"note: the logs are of other versions: {words}")


def _difference_lines(found: LogDifferences, labels: tuple[str, str], tolerance: float = 0.0) -> list[str]:
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
        f"{one.first!r} and {one.second!r}{unit}, {abs(one.first - one.second):.3g} apart"
        f"{more}"
    )
    rows = [("quantity", "unit", "from, s", "largest", "at, s")]
    rows += [
        (each.name, each.unit, f"{each.time:g}", f"{each.largest:.3g}", f"{each.at:g}")
        for each in found.columns[:MOST_COLUMNS]
    ]
    lines += [line.rstrip() for line in aligned_lines(rows)]
    if len(found.columns) > MOST_COLUMNS:
        lines.append(f"and {len(found.columns) - MOST_COLUMNS} quantities more, which --json lists")
    return lines


def _metric_lines(a: Log, b: Log, labels: tuple[str, str]) -> list[str]:
    """Metrics side by side."""
    ours, theirs = _metrics(a), _metrics(b)
    ends = [f"{log.status} at {log.info['end_time']:g} s" for log in (a, b)]
    both = [name for name in SHORT if name in ours and name in theirs]
    rows = [(name, f"{ours[name]:.4g}", f"{theirs[name]:.4g}") for name in both]
    return aligned_lines([("", *labels), ("ended", *ends), *rows])


def _scenario_lines(a: Log, b: Log) -> list[str]:
    """Fields of the scenarios that differ; two different laws are listed by name, without their constants."""
    found = _scenarios(a, b)
    if not found:
        return []
    lines = ["the scenarios differ in"]
    if any(path.startswith("controller.law.") for path in found):
        lines.append("  controller: " + " and ".join(shown(str(log.info.get("controller", ""))) for log in (a, b)))
        found = {path: pair for path, pair in found.items() if not path.startswith("controller.")}
    lines += [f"  {path}: {shown(ours)} and {shown(theirs)}" for path, (ours, theirs) in found.items()][:MOST_FIELDS]
    if len(found) > MOST_FIELDS:
        lines.append(f"  and {len(found) - MOST_FIELDS} fields more, which --json lists")
    return lines
