"""Warnings before a flight that need neither simulated flights nor sampled arm poses."""

from __future__ import annotations

from skyarm.scenario.scenario_record import Scenario
from skyarm.scenario.unlikely_numbers import unlikely_numbers
from skyarm.studies.assess.along_reference import along_reference
from skyarm.studies.assess.causes import ALARMS, causes_first
from skyarm.studies.assess.finding import FAULT, UNITS, WARNING, finding_of_line
from skyarm.studies.assess.push_limits import largest_push, push_limits


def warnings_before_flight(scenario: Scenario) -> list[str]:
    """Warnings about suspicious values, a reference beyond limits, and a contact force that cannot be held."""
    if len(scenario.agents) > 1:
        found = {name: warnings_before_flight(scenario.of(name)) for name in scenario.agents}
        first, *others = found.values()
        shared = [line for line in first if all(line in lines for lines in others)]  # as those of the world
        own = [f"{name}: {line}" for name, lines in found.items() for line in lines if line not in shared]
        return [*shared, *own]
    lines, at = unlikely_numbers(scenario), largest_push(scenario)
    findings, pushing = along_reference(scenario), push_limits(scenario)
    if at is not None and scenario.worlds:
        from skyarm.studies.assess.pressing_flights import contact_steps  # which can fly batches

        pushing += contact_steps(scenario, at)
    findings += [each for each in pushing if each.level == FAULT]
    alarms = causes_first([*(finding_of_line(line, UNITS, WARNING) for line in lines), *findings])[len(lines) :]
    return [*lines, *(f"{each.field}: {each.text}; {each.remedy}" for each in alarms if each.level in ALARMS)]
