"""Numbers that look as if they were in other units, as findings."""

from __future__ import annotations

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


def _finding(line: str, level: str) -> Finding:
    head, _, rest = line.partition(" = " if " = " in line else " of ")
    hint = rest.rpartition("; ")[2].rstrip("?")
    return Finding(
        question=QUESTION, level=level, text=line, field=head.strip(), remedy=f"check {head.strip()}: {hint}?"
    )
