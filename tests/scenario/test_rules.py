"""A consistency check reads the words that it says it reads, and runs where one of them
may have changed.
"""

from __future__ import annotations

import dataclasses
import inspect
import warnings
from collections import Counter
from collections.abc import Callable, Iterable
from functools import cache, partial
from pathlib import Path
from typing import Any

import pytest

import skyarm
from skyarm.envs import env_lanes
from skyarm.envs.env_task import make_task
from skyarm.records.leaves import Place, field_names
from skyarm.records.members import SOLE, Members
from skyarm.records.words import slots
from skyarm.scenario import scenario_checks
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_checks import (
    RULES,
    SHARED_RULES,
    Rule,
    check_scenario,
    read_places,
)
from skyarm.scenario.scenario_file import TwoLoadsWarning
from skyarm.scenario.scenario_record import Scenario
from skyarm.scenario.without_effect import WithoutEffectWarning
from skyarm.simulate import batch
from skyarm.simulate.flight_programs import FlightPrograms
from skyarm.simulate.loop import run_in_python
from skyarm.simulate.session import open_session
from skyarm.view.studio.fleet import _session

ROOT = Path(__file__).resolve().parents[2]
RICH = "tests/scenario/pins/rich.toml"
FLOWN = (
    *(RICH, "case3_wind", "pick_and_carry", "examples/press_and_slide.toml"),
    *("examples/servo_swing.toml", "tests/data/servo_flight.toml"),
    "tests/data/touch_flight.toml",
)
"""Scenarios with sensors, an estimator, drives, payloads, a world, phases that wait,
a load that is learned, and an ending by shapes that touch."""

RECORDS = {
    place: {
        slot.record
        for slot in slots(Scenario)
        if slot.place[: len(slot.place) - len(slot.word.inside)] == place
    }
    for place in (
        slot.place[: len(slot.place) - len(slot.word.inside)]
        for slot in slots(Scenario)
    )
}
"""Field that is a word of the file -> records that its words mean."""

OPENED = {
    place[:k]
    for place in (
        *RECORDS,
        *(
            place
            for each in RULES
            for word in each.reads
            for place in read_places(word)
        ),
    )
    for k in range(1, len(place))
} - {place for place, records in RECORDS.items() if records != {place}}
"""Groups, and records of which rules read a part; of all others a reader has the
whole."""


@cache
def scenario(name: str) -> Scenario:
    with warnings.catch_warnings():
        # of the rich one, as the next
        warnings.simplefilter("ignore", WithoutEffectWarning)
        warnings.simplefilter("ignore", TwoLoadsWarning)
        return skyarm.load_scenario(ROOT / name if name.endswith(".toml") else name)


class Reader:
    """Stand-in for a scenario, or a record inside it, that notes the fields that are
    read.
    """

    def __init__(self, held: Any, place: Place, seen: set[Place]) -> None:
        self._held, self._place, self._seen = held, place, seen

    @property  # type: ignore[misc]
    def __class__(self) -> type:
        return type(self._held)

    def __getattr__(self, name: str) -> Any:
        kind, place = type(self._held), (*self._place, name)
        if name == "agents":
            return Members((SOLE,), (self.agent,))
        if name not in (*(field_names(kind) or ()), "agent"):
            # what it reads in turn is noted
            return inspect.getattr_static(kind, name).__get__(self, kind)
        if place in OPENED:
            return Reader(getattr(self._held, name), place, self._seen)
        self._seen |= RECORDS.get(place, {place})
        return getattr(self._held, name)


def seen_by(
    check: Callable[[Scenario], None], names: Iterable[str] = FLOWN
) -> set[Place]:
    """Fields that a check reads of some scenarios."""
    seen: set[Place] = set()
    for name in names:
        reader: Any = Reader(scenario(name), (), seen)
        check(reader)
    return seen


def unsaid(seen: set[Place], words: Iterable[str]) -> set[Place]:
    """Fields outside some words of the file."""
    said = [read for word in words for read in read_places(word)]
    return {
        place for place in seen if not any(place[: len(read)] == read for read in said)
    }


def name_of(each: Rule) -> str:
    return (
        f"fields of {each.reads[0]}"
        if isinstance(each.check, partial)
        else each.check.__name__
    )


@pytest.mark.parametrize("each", [*RULES, *SHARED_RULES], ids=name_of)
def test_a_rule_reads_what_it_says_and_says_no_more(each: Rule) -> None:
    seen = seen_by(each.check)
    assert unsaid(seen, each.reads) == set()
    needless = [
        word
        for word in each.reads
        if not unsaid(seen, [other for other in each.reads if other != word])
    ]
    assert needless == []


def test_a_rule_that_reads_more_than_it_says_is_found() -> None:
    def check(given: Scenario) -> None:  # by the scenario's own properties, too
        assert given.steps > 0
        assert given.agent.plant.gravity > 0.0
        assert len(given.agent.all_drives) == given.plant.vehicle.n
        assert all(hasattr(each, "require_vehicle") for each in given.components)

    plant = (
        *("plant.gravity", "plant.vehicle", "plant.drives"),
        *("plant.closure", "plant.contact"),
    )
    words = ("duration", "rates", *plant, "environment", "payloads", "team", "world")
    seen = seen_by(check, [RICH])
    assert unsaid(seen, words) == set()
    left_out = {
        word: unsaid(seen, [other for other in words if other != word])
        for word in words
    }
    assert left_out == {
        "duration": {("duration",)},
        "rates": {("rates",)},
        "plant.gravity": {("agent", "plant", "gravity")},
        "plant.vehicle": {("agent", "plant", "vehicle")},
        "plant.drives": {("agent", "drives")},
        "plant.closure": {("solver", "closure")},
        "plant.contact": {("solver", "contact")},
        "environment": {
            ("environment", "wind"),
            ("environment", "air"),
            ("environment", "forces"),
        },
        "payloads": {("agent", "payloads")},
        "team": {("team",)},
        "world": {("environment", "world")},
    }


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Rules by name, with how often each has run."""
    counts: Counter[str] = Counter()

    def counted(each: Rule) -> Rule:
        def check(given: Scenario) -> None:
            counts[name_of(each)] += 1
            each.check(given)

        return each._replace(check=check)

    for name, rules in (("RULES", RULES), ("SHARED_RULES", SHARED_RULES)):
        monkeypatch.setattr(scenario_checks, name, [counted(each) for each in rules])
    return counts


ONCE = {name_of(each): 1 for each in (*RULES, *SHARED_RULES)}
TOUCHED = {
    "plant.gravity": (
        "initial_state_is_possible",
        "surroundings_fit",
        "shared_surroundings_fit",
    ),
    "controller.gains.position.x": (
        "clocks_of_law_agree",
        "sensors_suffice",
        "law_can_be_called",
    ),
    "environment.wind.velocity.0": (
        "drives_fit",
        "surroundings_fit",
        "shared_surroundings_fit",
        "fields of environment.wind",
    ),
    "plant.drives.joint1.time_constant": (
        "sensors_suffice",
        "drives_fit",
        "fields of plant.drives",
    ),
    "payloads.0.mass": ("surroundings_fit", "fields of payloads"),
    "world.surfaces.wall.material.friction": (
        "sensors_suffice",
        "shared_surroundings_fit",
        "fields of world",
    ),
    "initial.roll": ("initial_state_is_possible",),
    "plant.payload.mass": (
        *(
            "initial_state_is_possible",
            "reference_fits",
            "sensors_suffice",
            "drives_fit",
            "plant_can_fly",
        ),
        *(
            "surroundings_fit",
            "shared_surroundings_fit",
            "times_are_whole",
            "fields of plant.drives",
        ),
    ),
}
"""Path of a number -> rules that read it."""


@pytest.mark.parametrize("path", TOUCHED)
def test_a_replaced_number_runs_the_rules_that_read_it(
    path: str, runs: Counter[str]
) -> None:
    given = scenario("case3_wind" if path.startswith("controller.") else RICH)
    runs.clear()
    with_numbers(given, {path: number_at(given, path)})
    assert runs == dict.fromkeys(TOUCHED[path], 1)


def test_a_replaced_seed_runs_no_rule_and_a_check_runs_all_once(
    runs: Counter[str],
) -> None:
    given = scenario(RICH)
    other = dataclasses.replace(given, seed=given.seed + 1)
    assert not runs
    check_scenario(other)
    assert runs == ONCE


class BeforeFlightError(Exception):
    """End of a test where the first code would be made."""


def refuse(*_: object, **__: object) -> None:
    raise BeforeFlightError


FLIGHTS: dict[str, Callable[[Scenario], object]] = {
    "run": skyarm.run,
    "run_in_python": run_in_python,
    "open_session": open_session,
    "Session": skyarm.Session,
    "Session of the studio": lambda given: _session(given, ("plant.gravity",)),
    "Batch": skyarm.Batch,
    "environment": lambda given: env_lanes.EnvLanes(make_task(given), 1),
}


@pytest.mark.parametrize("flight", FLIGHTS)
def test_what_flies_runs_all_rules_once_before(
    flight: str, runs: Counter[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(FlightPrograms, "engine", refuse)
    monkeypatch.setattr(batch, "Leg", refuse)
    monkeypatch.setattr(env_lanes, "EnvProgram", refuse)
    given = scenario("case3_wind")
    runs.clear()
    with pytest.raises(BeforeFlightError):
        FLIGHTS[flight](given)
    assert runs == ONCE


@pytest.mark.parametrize("flight", FLIGHTS)
def test_what_flies_refuses_a_scenario_made_by_hand(flight: str) -> None:
    given = dataclasses.replace(scenario("case3_wind"), duration=1.0005)
    with pytest.raises(
        skyarm.ScenarioError,
        match=r"^duration = 1\.0005: must be a whole number of control periods",
    ):
        FLIGHTS[flight](given)
    if flight != "Session of the studio":
        with pytest.raises(skyarm.ScenarioError, match=r"^scenario = 3"):
            FLIGHTS[flight](3)  # type: ignore[arg-type]
