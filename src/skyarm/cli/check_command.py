"""``skyarm check``: what it prints and gives."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from skyarm.assess.assessment import Assessment, assess_scenario, assess_vehicle
from skyarm.assess.finding import FAULT, NOTE, OK, WARNING, Finding
from skyarm.cli.named_files import is_scenario
from skyarm.cli.terminal_tables import shown, table_of
from skyarm.files import output_file, printable
from skyarm.files import shown as shown_text
from skyarm.scenario.scenario_file import load_scenario
from skyarm.vehicle.vehicle_files import load_vehicle

FOUND = 1
"""Exit code of a check that found a fault."""

STYLES = {OK: "green", NOTE: "dim", WARNING: "yellow", FAULT: "bold red"}


def assess(name: str, payload: float, poses: int, seed: int, gravity: float | None) -> Assessment:
    """Check what a name or a file stands for: a vehicle, or a scenario with its vehicle and reference.

    Raises:
        ValueError: one line.
    """
    if is_scenario(name):
        if gravity is not None:
            raise ValueError(f"--gravity = {gravity:g}: must be left out: the scenario states its own (plant.gravity)")
        return assess_scenario(load_scenario(name), payload=payload, poses=poses, seed=seed)
    vehicle = load_vehicle(name)
    return assess_vehicle(
        vehicle, gravity=9.81 if gravity is None else gravity, payload=payload, poses=poses, seed=seed
    )


def page_file(name: str) -> Path:
    """Where the page is to be written.

    Raises:
        ValueError, OSError: one line: it does not end in .html, or cannot be written.
    """
    file = output_file(name, "--html")
    if file.suffix not in (".html", ".htm"):
        raise ValueError(f"--html = {shown_text(name)}: must end in .html")
    return file


def sheet(found: Assessment) -> RenderableType:
    """Alarms with what to change, then notes, then all other answers in short."""
    alarms = found.alarms()
    parts: list[RenderableType] = [Text(printable(title(found)), style="bold")]
    if alarms:
        parts += [_rows(alarms), Text("")]
    for each in alarms:
        numbers = "" if math.isnan(each.value) or not each.field else f" ({_against_limit(each)})"
        line = f"{each.level} in {each.field or each.question}{numbers}: {each.remedy or each.text}"
        parts.append(Text(printable(line), style=STYLES[each.level]))
    notes, well = ([each for each in found.findings if each.level == level] for level in (NOTE, OK))
    parts += [Text(""), _rows(notes)] if notes else []
    short = "; ".join(dict.fromkeys(map(_in_short, well)))
    fine = Text(printable(f"{len(well)} without an alarm: {short}"), style=STYLES[OK])
    return Group(*parts, Text(""), fine, Text(""), Text(printable(verdict(found)), style="bold"))


def _in_short(each: Finding) -> str:
    """A question with its number; without one that is rounding, or none."""
    found = number(each.value, each)
    return each.question if found.split(" ")[0] in ("-", "0") else f"{each.question} {found}"


def _rows(findings: Iterable[Finding]) -> RenderableType:
    """A table of findings: level, question, answer."""
    table = table_of("", "", "", left=3)
    for each in findings:
        table.add_row(
            Text(each.level, style=STYLES[each.level]), Text(printable(each.question)), Text(printable(each.text))
        )
    return table


def title(found: Assessment) -> str:
    """What was checked, in a line."""
    load = f", with {found.payload:g} kg at the tip" if found.payload else ""
    vehicle = f" ({found.vehicle.name})" if found.vehicle.name != found.name else ""
    return f"{found.name}{vehicle}, g = {found.gravity:g} m/s^2{load}"


def verdict(found: Assessment) -> str:
    """Whether it can fly, in a line."""
    faults = sum(each.level == FAULT for each in found.findings)
    warnings = sum(each.level == WARNING for each in found.findings)
    counted = f"{warnings} warning{'s' if warnings != 1 else ''}"
    if faults:
        return f"cannot fly as described: {faults} fault{'s' if faults != 1 else ''}, {counted}"
    return f"can fly: no fault, {counted}"


def _against_limit(each: Finding) -> str:
    """A finding's number, and what it is held against where there is such a thing."""
    found = number(each.value, each)
    return found if math.isnan(each.limit) else f"{found}, limit {number(each.limit, each)}"


def number(value: float, finding: Finding) -> str:
    """A number with its unit; a dash where there is none."""
    return "-" if math.isnan(value) else f"{shown(value)} {finding.unit}".rstrip()


def document(found: Assessment) -> dict[str, Any]:
    """What ``--json`` gives."""
    return found.plain()
