"""Command ``skyarm check``: whether a vehicle can fly, and why not."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated

import typer
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from skyarm.cli.arguments import name_completion
from skyarm.cli.lines import DIFFERENT
from skyarm.cli.output import Lines, bar, give, heading, tell
from skyarm.records.files import printable
from skyarm.records.text_tables import shown_number
from skyarm.studies.assess.assessment import Assessment
from skyarm.studies.assess.assessment import check as assess
from skyarm.studies.assess.finding import FAULT, NOTE, OK, WARNING, Finding

STYLES = {OK: "green", NOTE: "dim", WARNING: "yellow", FAULT: "bold red"}


def check(
    what: Annotated[
        str,
        typer.Argument(
            metavar="VEHICLE|SCENARIO",
            help="a file or a shipped name",
            autocompletion=name_completion("vehicle", "scenario"),
        ),
    ],
    payload: Annotated[float, typer.Option(help="kg held at the tip")] = 0.0,
    poses: Annotated[int, typer.Option("--arm-poses", help="sampled arm poses")] = 1024,
    gravity: Annotated[float | None, typer.Option(help="m/s^2, for a vehicle; 9.81 if left out")] = None,
) -> None:
    """Check whether a vehicle can fly, and why not.

    Thrust, torques, joint limits, workspace, largest payload and side force, units that look wrong; of a scenario also
    its reference against limits. Exit code 1 if a fault was found.
    """
    with bar(f"{what}: checking"):
        found = assess(what, payload=payload, poses=poses, gravity=gravity)
    give(found.plain())
    tell(*sheet(found))
    if not found.flies:
        raise typer.Exit(DIFFERENT)


def sheet(found: Assessment) -> Lines:
    """Report of a vehicle check as lines and tables: alarms with remedies, notes, then passed checks."""
    load = f", with {found.payload:g} kg at the tip" if found.payload else ""
    vehicle = f" ({found.vehicle.name})" if found.vehicle.name != found.name else ""
    parts: Lines = [heading(f"{found.name}{vehicle}, g = {found.gravity:g} m/s^2{load}")]
    alarms = found.alarms()
    parts += [_rows(alarms), ""] if alarms else []
    for each in alarms:
        limit = "" if math.isnan(each.limit) else f", limit {_number(each.limit, each)}"
        numbers = "" if math.isnan(each.value) or not each.field else f" ({_number(each.value, each)}{limit})"
        line = f"{each.level} in {each.field or each.question}{numbers}: {each.remedy or each.text}"
        parts.append(Text(printable(line), style=STYLES[each.level]))
    notes, well = ([each for each in found.findings if each.level == level] for level in (NOTE, OK))
    parts += ["", _rows(notes)] if notes else []
    short = "; ".join(dict.fromkeys(map(_in_short, well)))
    parts += ["", Text(printable(f"{len(well)} without an alarm: {short}"), style=STYLES[OK]), ""]
    faults, milder = (sum(each.level == level for each in found.findings) for level in (FAULT, WARNING))
    counted = f"{milder} warning{'s' if milder != 1 else ''}"
    verdict = f"cannot fly as described: {faults} fault{'s' if faults != 1 else ''}" if faults else "can fly: no fault"
    return [*parts, heading(f"{verdict}, {counted}")]


def _in_short(each: Finding) -> str:
    """Short text of a passed check: its question with the number found."""
    found = _number(each.value, each)
    return each.question if found.split(" ")[0] in ("-", "0") else f"{each.question} {found}"


def _rows(findings: Iterable[Finding]) -> RenderableType:
    """Make a table of check results: level, question and answer."""
    table = Table(box=None, pad_edge=False, show_header=False)
    for each in findings:
        cells = Text(printable(each.question)), Text(printable(each.text), overflow="fold")
        table.add_row(Text(each.level, style=STYLES[each.level]), *cells)
    return table


def _number(value: float, finding: Finding) -> str:
    """Format a number of a check result with its unit; a dash for NaN."""
    return "-" if math.isnan(value) else f"{shown_number(value)} {finding.unit}".rstrip()
