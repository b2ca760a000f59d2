"""Report of a feasibility check: alarms with remedies, notes, passed checks and
verdict.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from skyarm.records.text_tables import shown_number
from skyarm.studies.assess.assessment import Assessment
from skyarm.studies.assess.finding import FAULT, NOTE, OK, WARNING, Finding
from skyarm.view.pages import Line, Mark, Table, heading, table_of


def sheet(found: Assessment) -> list[Line]:
    """Report of a check as lines and tables: of each vehicle alarms with remedies,
    notes, then passed checks.
    """
    load = f", with {found.payload:g} kg at the tip" if found.payload else ""
    parts: list[Line] = [heading(f"{_title(found)}, g = {found.gravity:g} m/s^2{load}")]
    for each in found.agents.values():
        parts += [heading(_title(each)), *_answers(each.findings)]
    if found.findings or not found.agents:
        parts += [
            *([heading("all together")] if found.agents else []),
            *_answers(found.findings),
        ]
    faults, milder = (
        sum(each.level == level for each in found.every) for level in (FAULT, WARNING)
    )
    counted = f"{milder} warning{'s' if milder != 1 else ''}"
    verdict = (
        f"cannot fly as described: {faults} fault{'s' if faults != 1 else ''}"
        if faults
        else "can fly: no fault"
    )
    return [*parts, heading(f"{verdict}, {counted}")]


def _title(found: Assessment) -> str:
    """Name of a checked scenario or vehicle, with that of its vehicle if it has
    another.
    """
    return found.name + (
        f" ({found.vehicle.name})"
        if found.vehicle.name != found.name and not found.agents
        else ""
    )


def _answers(findings: Iterable[Finding]) -> list[Line]:
    """Results as a table of alarms with their remedies, one of notes, and a line of
    passed checks.
    """
    by_level = {
        level: [each for each in findings if each.level == level]
        for level in (FAULT, WARNING, NOTE, OK)
    }
    alarms = by_level[FAULT] + by_level[WARNING]
    parts: list[Line] = [_rows(alarms), ""] if alarms else []
    for each in alarms:
        limit = "" if math.isnan(each.limit) else f", limit {_number(each.limit, each)}"
        numbers = (
            ""
            if math.isnan(each.value) or not each.field
            else f" ({_number(each.value, each)}{limit})"
        )
        line = (
            f"{each.level} in {each.field or each.question}{numbers}:"
            f" {each.remedy or each.text}"
        )
        parts.append(Mark(text=line, title=each.level))
    parts += ["", _rows(by_level[NOTE])] if by_level[NOTE] else []
    # units are asked of the vehicle and of the scenario, and said once
    short = "; ".join(dict.fromkeys(map(_in_short, by_level[OK])))
    return [
        *parts,
        "",
        Mark(
            text=f"{len(by_level[OK])} without an alarm"
            + (f": {short}" if short else ""),
            title=OK,
        ),
        "",
    ]


def _in_short(each: Finding) -> str:
    """Short text of a passed check: the checked quantity with its value."""
    text = _number(each.value, each)
    # a missing number, or none of something, says no more than the question
    if text.split(" ")[0] in ("-", "0"):
        return each.question
    return f"{each.question} {text}"


def _rows(findings: Iterable[Finding]) -> Table:
    """Make a table of check results: severity, checked quantity and result."""
    rows = [
        (Mark(text=each.level, title=each.level), Mark(text=each.question), each.text)
        for each in findings
    ]
    return table_of(("",) * 3, rows, left=3)


def _number(value: float, finding: Finding) -> str:
    """Format the value of a check result with its unit; a dash for NaN."""
    return (
        "-" if math.isnan(value) else f"{shown_number(value)} {finding.unit}".rstrip()
    )
