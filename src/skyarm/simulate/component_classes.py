"""Classes of someone's own in a scenario, looked at before any of their functions is called: signatures and draws."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from skyarm.control.law_checks import kind_of
from skyarm.files import shown
from skyarm.files.user_code import own_code, place_of
from skyarm.records.leaves import named_parts
from skyarm.registry.class_signatures import class_mistake
from skyarm.scenario.scenario_record import Scenario, ScenarioError

MOST_UNIFORMS = 10_000
"""Random numbers of one component a period: beyond this it is a slip, and a program of it would take minutes."""


def check_classes(scenario: Scenario) -> None:
    """Refuse components whose functions cannot be called as the loop calls them, or that draw no count of numbers.

    Raises:
        ScenarioError: one line with file and line, place in the scenario, class and method.
    """
    for place, record in own_records(scenario):
        kind = type(record)
        mistake = class_mistake(kind)
        if mistake is not None:
            raise ScenarioError(f"{mistake[0]}: {place} ({kind.__name__}) {mistake[1]}")
        given = getattr(record, "uniforms", 0)
        count = given(scenario.world.vehicle) if callable(given) else given
        if type(count) is not int or not 0 <= count <= MOST_UNIFORMS:
            found = place_of(given if callable(given) and own_code(given) is not None else kind)
            said = "gives uniforms" if callable(given) else "has uniforms"
            words = f"{said} = {shown(count)}: must be a whole number from 0 to {MOST_UNIFORMS}"
            raise ScenarioError(f"{found}: {place} ({kind.__name__}) {words}")


def own_records(scenario: Scenario) -> Iterator[tuple[str, Any]]:
    """Place and record of everything of a scenario that is someone's own."""
    places: list[tuple[str, Any]] = [("environment.wind", scenario.wind)]
    places += [(f"environment.air[{i}]", each) for i, each in enumerate(scenario.air)]
    places += [(f"environment.forces[{i}]", each) for i, each in enumerate(scenario.forces)]
    places += [(f"plant.drives.{each.joint}", each.drive) for each in scenario.joint_drives]
    places += [(f"sensors.{named.name}", named.sensor) for named in scenario.instruments]
    places += [("estimator", scenario.estimator)]
    places += [(f"endings[{i}]", each) for i, each in enumerate(scenario.endings)]
    return ((place, record) for place, record in places if own_code(type(record)))


def reading_mistake(value: Any, path: str) -> str | None:
    """What of a reading is no number, in words; None where all of it is."""
    for at, each in named_parts(value, path):
        if kind_of(each) != "a number" and type(each) not in (int, bool):
            return f"{at} as {kind_of(each)}"
    return None
