"""Warnings before a flight that need neither simulated flights nor sampled arm
poses.
"""

from __future__ import annotations

from collections.abc import Sequence

from skyarm.scenario.scenario_record import Scenario
from skyarm.scenario.unlikely_numbers import unlikely_numbers
from skyarm.studies.assess.along_reference import along_reference
from skyarm.studies.assess.causes import ALARMS, causes_first
from skyarm.studies.assess.finding import FAULT, UNITS, WARNING, finding_of_line
from skyarm.studies.assess.flight_loads import Load
from skyarm.studies.assess.layout import senses_of_rotation
from skyarm.studies.assess.load_sharing import balances, carried_loads
from skyarm.studies.assess.push_limits import largest_push, push_limits


def warnings_before_flight(scenario: Scenario) -> list[str]:
    """Warnings about suspicious values, a reference beyond limits, and a contact force
    that cannot be held.
    """
    # only a team carries bodies in shares
    bodies = balances(scenario) if scenario.team is not None else []
    found = {
        name: _warnings_of(scenario.of(name), carried_loads(scenario, name, bodies))
        for name in scenario.agents
    }
    first, *others = found.values()
    # of the world, or of the only vehicle
    shared = [line for line in first if all(line in lines for lines in others)]
    lines = list(shared)
    for name, own in found.items():
        lines += [f"{name}: {line}" for line in own if line not in shared]
    return lines


def _warnings_of(scenario: Scenario, carried: Sequence[Load]) -> list[str]:
    """Warnings about the flight of one vehicle with its shares of bodies that several
    carry.
    """
    lines, at = unlikely_numbers(scenario), largest_push(scenario)
    findings = along_reference(scenario, carried=carried)
    pushing = push_limits(scenario)
    if at is not None and scenario.worlds:
        # which can fly batches
        from skyarm.studies.assess.pressing_flights import contact_steps

        pushing += contact_steps(scenario, at)
    world = scenario.agent.plant
    turned = (
        [senses_of_rotation(world.vehicle, float(world.gravity))]
        if world.vehicle.rotors
        else []
    )
    # of pushes only what cannot be held is said here; the rest is for skyarm check
    findings += [each for each in (*turned, *pushing) if each.level == FAULT]
    # the lines take part as causes only: they are stated in full
    alarms = causes_first(
        [*(finding_of_line(line, UNITS, WARNING) for line in lines), *findings]
    )[len(lines) :]
    return [
        *lines,
        *(
            f"{each.field}: {each.text}; {each.remedy}"
            for each in alarms
            if each.level in ALARMS
        ),
    ]
