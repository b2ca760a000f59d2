"""A study checked and compiled: what is known before the first episode flies."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from skyarm.files import versions
from skyarm.plant.joint_rate import joint_rate
from skyarm.plant.largest_step import STATED, stated_step
from skyarm.records.identity import identity
from skyarm.records.own_files import all_files
from skyarm.registry import registrations
from skyarm.scenario.endings import STATUSES
from skyarm.scenario.in_flight import stretches
from skyarm.scenario.numbers import require_apart, with_numbers
from skyarm.scenario.scenario_record import Scenario
from skyarm.scenario.units_of_numbers import unit_at
from skyarm.simulate.batch import Batch
from skyarm.simulate.draws import draws_needed
from skyarm.sweep.design import derived_extremes, extremes, values
from skyarm.sweep.expressions import ExpressionError
from skyarm.sweep.origin import Origin
from skyarm.sweep.study import Study, StudyError

PLANT = ("plant.vehicle.", "plant.joints.", "plant.payload.")
"""Beginnings of the paths on which the plant's joint friction depends."""


@dataclass(frozen=True)
class Plan:
    """A study whose every extreme was checked; small, and sent whole to the processes that fly it.

    Attributes:
        study: as read.
        stiffest: the plant whose joint friction bounds the integration step of all episodes, with the air, forces and
            drives that state the shortest one.
        origin: what the rows depend on, as they and the manifest say it.
    """

    study: Study
    stiffest: Scenario
    origin: Origin

    @property
    def digest(self) -> str:
        """Digest of all that the rows depend on."""
        return self.origin.digest

    @cached_property
    def units(self) -> dict[str, str]:
        """SI unit of each varied number, where its field declares one."""
        scenario = next(iter(self.study.scenarios.values()))
        return {path: unit for path in self.study.paths if (unit := _unit(scenario, path))}

    @cached_property
    def noise(self) -> bool:
        """Whether an episode draws random numbers while it flies."""
        return any(draws_needed(scenario) for scenario in self.study.scenarios.values())

    def batches(self) -> dict[str, Batch]:
        """The closed loop of each controller in machine code."""
        study = self.study
        return {
            label: Batch(
                scenario,
                study.paths,
                metrics=study.metrics,
                windows=study.windows,
                single=study.precision == "single",
                bit_exact=study.precision == "bit_exact",
                stiffest=self.stiffest,
            )
            for label, scenario in study.scenarios.items()
        }


def _unit(scenario: Scenario, path: str) -> str:
    """Unit of a number; empty for one that is no field of a record."""
    try:
        return unit_at(scenario, path)
    except ValueError:
        return ""


def prepare(study: Study) -> Plan:
    """Check the extremes that episodes of the study take.

    Raises:
        StudyError: a vehicle that cannot be, with the path and the value that make it so.
    """
    for scenario in study.scenarios.values():
        try:
            require_apart(scenario, study.paths)
        except ValueError as error:
            raise StudyError(f"{study.source}: vary: {error}") from None
    try:
        ends = {path: pair for path, pair in extremes(study).items() if path in study.paths and path in study.vary}
        together = _derived_settings(study)
    except ExpressionError as error:
        raise StudyError(f"{study.source}: {error}") from None
    for scenario in study.scenarios.values():
        for path, value in ((path, value) for path, pair in ends.items() for value in pair):
            _changed(study, scenario, path, value)
        for path, numbers in together:
            _changed_together(study, scenario, path, numbers)
    origin = Origin(
        study=json.loads(json.dumps({**study.document, **_added(study)})),
        scenarios={label: identity(scenario) for label, scenario in study.scenarios.items()},
        version=versions()["skyarm"],
    )
    return Plan(study, _stiffest(study, next(iter(study.scenarios.values())), ends, together), origin)


def _added(study: Study) -> dict[str, Any]:
    """What the rows depend on beside the study's file: files of code, and words for endings of their own."""
    own = dict.fromkeys(ending.status for scenario in study.scenarios.values() for ending in scenario.endings)
    code = all_files(
        study.scenarios, [row.load() for name, row in registrations("metric").items() if name in study.metrics]
    )
    found: dict[str, Any] = {"plugins": code, "endings": [status for status in own if status not in STATUSES]}
    return {name: each for name, each in found.items() if each}


def _changed(study: Study, scenario: Scenario, path: str, value: float) -> Scenario:
    try:
        return with_numbers(scenario, {path: value})
    except ValueError as error:
        raise StudyError(f'{study.source}: vary."{path}" reaches {value:.6g}: {error}') from None


def _derived_settings(study: Study) -> list[tuple[str, dict[str, float]]]:
    """(path, all numbers) of the episodes in which a derived path is smallest and largest: they only fit together."""

    def numbers(episode: int) -> dict[str, float]:
        drawn = values(study, [episode])
        return {name: float(drawn[name][0]) for name in study.paths}

    ends = derived_extremes(study)
    return [(path, numbers(episode)) for path, episodes in ends.items() for episode in dict.fromkeys(episodes)]


def _changed_together(study: Study, scenario: Scenario, path: str, numbers: Mapping[str, float]) -> Scenario:
    try:
        return with_numbers(scenario, numbers)
    except ValueError as error:
        reached = f" reaches {numbers[path]:.6g}" if path in numbers else ""
        raise StudyError(f'{study.source}: derived."{path}"{reached}: {error}') from None


def fastest_plant(scenario: Scenario, ends: Mapping[str, tuple[float, float]]) -> Scenario:
    """The scenario that asks for the shortest integration steps while each number is anywhere between its ends.

    Args:
        scenario: as it is.
        ends: path -> least and greatest number.

    Raises:
        StudyError: a vehicle that cannot be, with the path and the value that make it so.
    """
    study = Study(name=scenario.name, source=scenario.name, scenarios={}, vary={}, episodes=1, document={})
    return _stiffest(study, scenario, ends, ())


def _stiffest(
    study: Study,
    scenario: Scenario,
    ends: Mapping[str, tuple[float, float]],
    derived: Sequence[tuple[str, Mapping[str, float]]],
) -> Scenario:
    """The plant with the fastest joint friction, each number at the end that makes friction faster.

    Derived numbers count as they come together in the episodes of their ends.

    One end for each number is exact where friction grows or falls with each of them, as it does with damping and
    masses; FRICTION_STEP leaves a margin of four for those that do neither.
    """
    worst: dict[str, float] = {}
    rate = _fastest_friction(scenario)
    best, best_rate = scenario, rate
    for path, pair in ends.items():
        if not path.startswith((*PLANT, "changes.")):
            continue
        for value in pair:
            single = _changed(study, scenario, path, value)
            found = _rate(study, path, value, single)
            if found > rate:
                worst[path] = value
            if found > best_rate:
                best, best_rate = single, found
    for together in (*_valid(scenario, worst), *(_changed_together(study, scenario, *each) for each in derived)):
        found = _rate(study, "", 0.0, together)
        if found > best_rate:
            best, best_rate = together, found
    return _with_shortest_step(study, best, ends, derived)


def _with_shortest_step(
    study: Study,
    scenario: Scenario,
    ends: Mapping[str, tuple[float, float]],
    derived: Sequence[tuple[str, Mapping[str, float]]],
) -> Scenario:
    """Air, forces and drives with each number at the end with which they bear only the shorter steps."""
    for path, pair in ends.items():
        if path.startswith(STATED):
            changed = [_changed(study, scenario, path, value) for value in pair]
            scenario = min((scenario, *changed), key=lambda each: stated_step(each) or math.inf)
    for path, numbers in derived:
        if path.startswith(STATED):
            changed = [_changed_together(study, scenario, path, numbers)]
            scenario = min((scenario, *changed), key=lambda each: stated_step(each) or math.inf)
    return scenario


def _rate(study: Study, path: str, value: float, scenario: Scenario) -> float:
    try:
        return _fastest_friction(scenario)
    except ValueError as error:
        at = f'vary."{path}" reaches {value:.6g}' if path else "vary"
        raise StudyError(f"{study.source}: {at}: {error}") from None


def _fastest_friction(scenario: Scenario) -> float:
    """Of the joints of the plant, 1/s, whatever holds in the course of the flight."""
    return max(joint_rate(stretch.overrides.of(scenario).world.vehicle) for stretch in stretches(scenario))


def _valid(scenario: Scenario, values: Mapping[str, float]) -> Iterator[Scenario]:
    """The scenario with these numbers, if such a vehicle can be: extremes of several need not come together."""
    try:
        yield with_numbers(scenario, values)
    except ValueError:
        return


def at_episode(study: Study, label: str, values: Mapping[str, float], episode: int) -> Scenario:
    """One episode of a study as a scenario of its own, for a single run that keeps its log."""
    scenario = with_numbers(study.scenarios[label], {path: float(values[path]) for path in study.paths})
    return dataclasses.replace(scenario, seed=study.seed, episode=episode)
