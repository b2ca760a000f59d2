"""Checks and compilation of a sweep before its first flight."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from skyarm.log.metrics.metric_catalogue import catalogue_names
from skyarm.log.metrics.windows import Windows
from skyarm.plant.joint_rate import joint_rate
from skyarm.plant.largest_step import STATED, stated_step
from skyarm.records.files import Fields, PathLike, errors_as, must_be_one_of, shown
from skyarm.records.identity import all_files, identity
from skyarm.records.immutable import positional
from skyarm.records.path_names import word_of
from skyarm.records.read_table import record_from
from skyarm.records.registry import registrations
from skyarm.scenario.endings import STATUSES
from skyarm.scenario.in_flight import stretches
from skyarm.scenario.numbers import require_apart, unit_at, with_numbers
from skyarm.scenario.save import save_scenario
from skyarm.scenario.scenario_file import list_scenarios
from skyarm.scenario.scenario_record import Scenario, whole
from skyarm.simulate.draws import draws_needed
from skyarm.studies.flights import Work
from skyarm.studies.sweep.design import extremes, values
from skyarm.studies.sweep.expressions import ExpressionError
from skyarm.studies.sweep.manifest import Manifest, label_of
from skyarm.studies.sweep.study import Study, StudyError

PLANT = ("plant.vehicle.", "plant.joints.", "plant.payload.")
"""Prefixes of the paths that affect the plant's joint friction."""


@positional
class SweepPlan:
    """Study that has been checked at the extremes of its varied parameters and is ready
    to be simulated.

    Attributes:
        study: study as read.
        stiffest: the plant whose joint friction bounds the integration step of all
            episodes, with the air, forces and drives that state the shortest one.
        manifest: the facts on which the rows depend.
    """

    study: Study
    stiffest: Scenario
    manifest: Manifest

    def works(self, index: int) -> Iterator[Work]:
        """Flights of one chunk of episodes, with each controller."""
        study = self.study
        episodes = np.array(self.manifest.span(index))
        drawn = values(study, episodes)
        for label, scenario in study.scenarios.items():
            yield Work(
                label=label_of(index, label),
                scenario=scenario,
                columns={path: drawn[path] for path in study.paths},
                episodes=episodes,
                fixed={"controller": label}
                | {name: drawn[name] for name in drawn if name not in study.paths},
                metrics=study.metrics,
                windows=study.windows,
                seed=study.seed,
                precision=study.precision,
                stiffest=self.stiffest,
            )


@positional
class _Setting:
    """Extreme parameter values of a sweep to be checked, with their description for
    error messages.
    """

    path: str
    where: str
    numbers: Mapping[str, float]

    def of(self, scenario: Scenario) -> Scenario:
        """Scenario with the parameter values to be checked.

        Raises:
            StudyError: a vehicle that cannot be.
        """
        with errors_as(StudyError, f"{self.where}: "):
            return with_numbers(scenario, self.numbers)


def prepare(study: Study) -> SweepPlan:
    """Check a sweep at the extremes of its parameters, and return its plan of batches.

    Raises:
        StudyError: a vehicle that cannot be, with the path and the value that make it
            so.
    """
    for scenario in study.scenarios.values():
        with errors_as(StudyError, f"{study.source}: vary: "):
            require_apart(scenario, study.paths)
    with errors_as(StudyError, f"{study.source}: ", of=ExpressionError):
        ends = extremes(study)
        # derived numbers are no choice of their own: they come with what they derive
        # from
        singles = _singles(
            study.source,
            {path: ends[path][:2] for path in study.paths if path in study.vary},
        )
        together = _derived_settings(
            study, {path: ends[path][2:] for path in study.derived}
        )
    for scenario in study.scenarios.values():
        for setting in (*singles, *together):
            setting.of(scenario)
    first = next(iter(study.scenarios.values()))
    # as JSON gives it back: lists for tuples, so that both compare
    manifest = Manifest(
        study=json.loads(json.dumps({**study.document, **_code_and_endings(study)})),
        scenarios={
            label: identity(scenario) for label, scenario in study.scenarios.items()
        },
        title=study.title,
        success=dict(study.success),
        units={path: unit for path in study.paths if (unit := _unit(first, path))},
        noise=any(map(draws_needed, study.scenarios.values())),
    )
    return SweepPlan(study, _stiffest(study.source, first, singles, together), manifest)


def _unit(scenario: Scenario, path: str) -> str:
    """Unit of a scenario's parameter by its path; empty if there is no such
    parameter.
    """
    try:
        return unit_at(scenario, path)
    except ValueError:
        return ""


def _code_and_endings(study: Study) -> dict[str, dict[str, str] | list[str]]:
    """Digests of user code and user-defined termination statuses on which a sweep's
    results depend.
    """
    own = dict.fromkeys(
        ending.status
        for scenario in study.scenarios.values()
        for ending in scenario.endings
    )
    rows = [
        row.load()
        for name, row in registrations("metric").items()
        if name in catalogue_names(study.metrics)
    ]
    code = all_files(study.scenarios, rows)
    endings = [status for status in own if status not in STATUSES]
    return ({"plugins": code} if code else {}) | (
        {"endings": endings} if endings else {}
    )


def _singles(source: str, ends: Mapping[str, tuple[float, float]]) -> list[_Setting]:
    """Parameter values to check before a sweep: each varied parameter alone at its
    smallest and largest value.
    """
    return [
        _Setting(path, f'{source}: vary."{path}" reaches {value:.6g}', {path: value})
        for path, pair in ends.items()
        for value in pair
    ]


def _derived_settings(
    study: Study, extreme: Mapping[str, tuple[int, int]]
) -> list[_Setting]:
    """Parameter values to check before a sweep: episodes in which a derived parameter
    is smallest or largest.
    """
    settings = []
    for path, episodes in extreme.items():
        for episode in dict.fromkeys(episodes):
            drawn = values(study, [episode])
            numbers = {name: float(drawn[name][0]) for name in study.paths}
            reached = f" reaches {numbers[path]:.6g}" if path in numbers else ""
            settings.append(
                _Setting(path, f'{study.source}: derived."{path}"{reached}', numbers)
            )
    return settings


def fastest_plant(
    scenario: Scenario, ends: Mapping[str, tuple[float, float]]
) -> Scenario:
    """Scenario that requires the shortest integration steps within the ranges of the
    varied parameters.

    Args:
        scenario: scenario as it is.
        ends: path -> least and greatest number.

    Raises:
        StudyError: a vehicle that cannot be, with the path and the value that make it
            so.
    """
    return _stiffest(scenario.name, scenario, _singles(scenario.name, ends), ())


def _stiffest(
    source: str,
    scenario: Scenario,
    singles: Sequence[_Setting],
    derived: Sequence[_Setting],
) -> Scenario:
    """Worst case for the integration step: shortest time constants of joint friction,
    air, forces and drives.

    Each number is at the end that makes friction faster; derived numbers count as they
    come together in the episodes of their ends. One end for each number is exact where
    friction grows or falls with each of them, as it does with damping and masses;
    FRICTION_STEP leaves a margin of four for those that do neither.
    """
    worst: dict[str, float] = {}
    rate = _fastest_friction(scenario)
    best, best_rate = scenario, rate
    for each in singles:
        if word_of(each.path).startswith((*PLANT, "changes.")):
            single = each.of(scenario)
            single_rate = _rate(each.where, single)
            if single_rate > rate:
                worst |= each.numbers
            if single_rate > best_rate:
                best, best_rate = single, single_rate
    all_worst = _Setting("", "", worst)
    for each in (all_worst, *derived):
        try:
            together = each.of(scenario)
        except StudyError:
            if each is all_worst:  # extremes of several need not come together
                continue
            raise
        single_rate = _rate(f"{source}: vary", together)
        if single_rate > best_rate:
            best, best_rate = together, single_rate
    for each in (*singles, *derived):
        if word_of(each.path).startswith(STATED):
            best = min((best, each.of(best)), key=_shortest_step)
    return best


def _shortest_step(scenario: Scenario) -> float:
    """Longest integration step (s) that is stable with any integrator of the plant; inf
    for no limit.
    """
    steps = (
        stated_step(scenario),
        *(each.largest_verlet_step for each in scenario.worlds),
    )
    return min((float(step) for step in steps if step is not None), default=math.inf)


def _rate(where: str, scenario: Scenario) -> float:
    with errors_as(StudyError, f"{where}: "):
        return _fastest_friction(scenario)


def _fastest_friction(scenario: Scenario) -> float:
    """Largest rate constant of joint friction over the flight, 1/s."""
    flown = (stretch.overrides.of(scenario) for stretch in stretches(scenario))
    return max(
        joint_rate(vehicle) for each in flown for vehicle in each.vehicles.values()
    )


def at_episode(
    study: Study, label: str, values: Mapping[str, float], episode: int
) -> Scenario:
    """Scenario of a single episode of a study, to run it alone and store its log."""
    scenario = with_numbers(
        study.scenarios[label], {path: float(values[path]) for path in study.paths}
    )
    return replace(scenario, seed=study.seed, episode=episode)


def save_episode(path: PathLike, study: Study, label: str, episode: int) -> Path:
    """Write a single episode of a study as a scenario file, whose flight has the
    metrics of the episode's row.

    Args:
        path: path of the .toml file to write.
        study: study from :func:`skyarm.studies.sweep.load_study`, beside whose file
            that of its scenario is.
        label: label of the controller.
        episode: number of the episode.

    Raises:
        StudyError: one line: a label or an episode that the study does not have.
        ScenarioError: one line: a scenario that no file can say, as under a law of
            FILE.py:make.
        OSError: one line: the file cannot be written.
    """
    if label not in study.scenarios:
        raise StudyError(
            f"label = {shown(label)}: {must_be_one_of(study.scenarios, label)}"
        )
    index = whole(episode)
    if index is None or not 0 <= index < study.episodes:
        raise StudyError(
            f"episode = {shown(episode)}: must be a whole number from 0 to"
            f" {study.episodes - 1}"
        )
    episode = index
    drawn = values(study, [index])
    scenario = at_episode(
        study, label, {name: column[0] for name, column in drawn.items()}, episode
    )
    # resolved: a scenario's file has no study to take windows from
    windows = study.windows.of_flight(scenario.duration, scenario.windows)
    flight = replace(
        scenario, windows=record_from(Windows, Fields(windows.plain(), "windows"))
    )
    # the scenario beside the study's file, not beside the file that is written
    named = study.document["scenario"]
    base = named if named in list_scenarios() else Path(study.source).parent / named
    return save_scenario(
        path, flight, base, label if study.document["controllers"] else None
    )


LOOKED_AT = 1000
"""Number of episodes among which the one with the largest numbers is searched."""


def largest_episode(study: Study) -> Scenario:
    """Scenario of the episode with the largest varied parameters, each relative to its
    largest value.
    """
    drawn = values(study, np.arange(min(study.episodes, LOOKED_AT)))
    # zeros alone have no largest to be relative to
    episode = int(
        np.argmax(
            sum(np.abs(each) / (np.abs(each).max() or 1.0) for each in drawn.values())
        )
    )
    # all scenarios of a study fly the same draws, so the first one serves
    label = next(iter(study.scenarios))
    return at_episode(
        study, label, {path: each[episode] for path, each in drawn.items()}, episode
    )
