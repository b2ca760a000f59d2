"""Numbers that look as if they were in other units, as findings."""

from __future__ import annotations

import re
from collections.abc import Iterable

from skyarm.assess.finding import FAULT, OK, WARNING, Finding
from skyarm.scenario.scenario_record import Scenario
from skyarm.scenario.unlikely_numbers import unlikely_numbers
from skyarm.scenario.unlikely_vehicle import unlikely_in_vehicle
from skyarm.vehicle.vehicle_records import Vehicle

QUESTION = "units"


def units_of_vehicle(vehicle: Vehicle) -> list[Finding]:
    """Lines of :func:`unlikely_in_vehicle` as faults: with such a number nothing flies as it is meant to."""
    return _findings(unlikely_in_vehicle(vehicle), FAULT, "every number of the vehicle is of a likely size")


def units_of_scenario(scenario: Scenario) -> list[Finding]:
    """Lines about a scenario's other numbers as warnings; those of its plant are the vehicle's."""
    lines = [line for line in unlikely_numbers(scenario) if not line.startswith("plant: ")]
    return _findings(lines, WARNING, "every number of the scenario is of a likely size")


def _findings(lines: Iterable[str], level: str, good: str) -> list[Finding]:
    found = [_finding(line, level) for line in lines]
    return found or [Finding(question=QUESTION, level=OK, text=good)]


BEHIND_A_FIELD = re.compile(r": | of | reaches ")
"""What stands in a line between the field and what is said of it where there is no equals sign."""


def _finding(line: str, level: str) -> Finding:
    head, equals, _ = line.partition(" = ")
    field = head.replace(": ", ".") if equals else BEHIND_A_FIELD.split(line, maxsplit=1)[0]
    # the question at the end says what is perhaps meant; it stands behind the last semicolon, else behind a colon
    said, _, hint = line.rpartition("; " if "; " in line else ": ")
    remedy = f"check {field}: {hint}" if said else f"check {field}"
    return Finding(question=QUESTION, level=level, text=line, field=field, remedy=remedy)
