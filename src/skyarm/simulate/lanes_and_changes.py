"""Numbers that must not differ from lane to lane in a scenario that changes in flight.

A lane flies as a single run of the scenario with its numbers would. Where a change is made from numbers that vary, code
that all lanes share cannot do so.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from skyarm.plant.largest_step import STATED
from skyarm.scenario.numbers import TURBULENCE, is_payload, means_the_same
from skyarm.scenario.scenario_record import Scenario, ScenarioError

LAWS = ("controller", "controller.law")
"""Parts that are made for the belief as it is."""


def require_apart_from_changes(scenario: Scenario, paths: Sequence[str]) -> None:
    """Refuse varied numbers that the scenario's changes depend on.

    Raises:
        ScenarioError: names the path and the change.
    """
    for path in paths if scenario.changes else ():
        for words in _refusals(scenario, path):
            raise ScenarioError(f"path = {path!r}: {words}")


def _refusals(scenario: Scenario, path: str) -> Iterator[str]:
    for i, change in enumerate(scenario.changes):
        where = f"changes[{i}].path = {change.path!r}"
        if path == f"changes.{i}.value" and change.path.startswith(STATED):
            yield f"must not vary, since a largest integration step may follow from {where}"
        if is_payload(path) and is_payload(change.path) and means_the_same(scenario, path, change.path):
            yield f"adds to {where}; vary changes.{i}.value, and set the payload of the start by a change at 0"
        if change.path in LAWS and path.startswith("model."):
            yield f"must not vary, since the law of {where} is made for one belief"
        if change.path.startswith(TURBULENCE) and path.startswith("environment.wind."):
            yield f"must not vary, since the turbulence of {where} is made for one wind"
