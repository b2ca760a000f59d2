"""Suspicious numbers of a vehicle and a scenario, as findings: units, plan of the reference, law."""

from __future__ import annotations

import re

from skyarm.assess.finding import FAULT, OK, WARNING, Finding
from skyarm.scenario.scenario_record import Scenario
from skyarm.scenario.unlikely_numbers import law_warnings, plan_warnings, unlikely_in_vehicle, unlikely_units
from skyarm.vehicle.vehicle_records import Vehicle

UNITS, PLAN, LAW = "units", "plan of the reference", "law for this vehicle"
"""Questions."""


def units_of_vehicle(vehicle: Vehicle) -> list[Finding]:
    """Lines of :func:`unlikely_in_vehicle` as faults: with such a number nothing flies as it is meant to."""
    found = [_finding(line, UNITS, FAULT) for line in unlikely_in_vehicle(vehicle)]
    return found or [Finding(question=UNITS, level=OK, text="every number of the vehicle is of a likely size")]


def warnings_of_scenario(scenario: Scenario) -> list[Finding]:
    """Units of a scenario's other numbers, the plan of its reference, and its law on this vehicle, as warnings."""
    units = [_finding(line, UNITS, WARNING) for line in unlikely_units(scenario)]
    good = Finding(question=UNITS, level=OK, text="every number of the scenario is of a likely size")
    return [
        *(units or [good]),
        *(_finding(line, PLAN, WARNING) for line in plan_warnings(scenario)),
        *(_finding(line, LAW, WARNING) for line in law_warnings(scenario)),
    ]


BEHIND_A_FIELD = re.compile(r": | of | reaches ")
"""What stands in a line between the field and what is said of it where there is no equals sign."""


def _finding(line: str, question: str, level: str) -> Finding:
    head, equals, _ = line.partition(" = ")
    field = head.replace(": ", ".") if equals else BEHIND_A_FIELD.split(line, maxsplit=1)[0]
    # the question at the end says what is perhaps meant; it stands behind the last semicolon, else behind a colon
    said, _, hint = line.rpartition("; " if "; " in line else ": ")
    remedy = f"check {field}: {hint}" if said else f"check {field}"
    return Finding(question=question, level=level, text=line, field=field, remedy=remedy)
