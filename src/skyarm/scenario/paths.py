"""Parameter paths: dotted names as in a scenario file, converted to fields of the
Scenario dataclass.

One number of a file may have several places in the records (a circle's radius is the
amplitude of two sines), and a file's word may be another than the record's (``force``
is ``force_W``). Both words lead to the record.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from typing import TypeVar

from skyarm.algebra import Scalar
from skyarm.records.files import did_you_mean, must_be_one_of
from skyarm.records.immutable import positional
from skyarm.records.leaves import Place, part, replace_at
from skyarm.records.path_names import (
    AGENTS,
    OF_AGENT,
    Names,
    NumberView,
    agent_of,
    path_names,
    word_of,
)
from skyarm.records.words import EACH, Slot, lifted_fields, slots
from skyarm.reference.path_time import PLANNED
from skyarm.scenario.scenario_record import Scenario, ScenarioError

V = TypeVar("V")

LATE = "delays.command"
"""Path of the command delay, which is not a parameter of a flight without one."""


OF_STUDIES = "the same for all episodes; fly two studies"
"""Advice in messages about structural numbers, for those who vary them between
episodes."""


def alone(scenario: Scenario, path: str) -> tuple[Scenario, str]:
    """Flight of the vehicle that a parameter path names, as a scenario, and the path in
    it.

    Of a path that names none the flight is the whole scenario, or that of the first of
    several vehicles.

    Raises:
        ScenarioError: there is no such vehicle, or the path is of one vehicle and does
            not say which.
    """
    name, word = agent_of(path), word_of(path)
    if name and word != path:
        if name not in scenario.agents:
            known = must_be_one_of(scenario.agents, name)
            raise ScenarioError(f"path = {path!r}: agents.{name}: {known}")
        if scenario.is_team and not is_of_agent(word):
            raise ScenarioError(f"path = {path!r}: is of all agents, must be {word}")
        return scenario.of(name), word
    if scenario.is_team and is_of_agent(path):
        names = ", ".join(scenario.agents)
        raise ScenarioError(
            f"path = {path!r}: is of one agent, must be agents.NAME.{path} with one of"
            f" {names}"
        )
    one = scenario.of(next(iter(scenario.agents)))
    # changes are numbered among those of all vehicles
    if one is not scenario and is_below(path, "changes"):
        one = replace(one, changes=scenario.changes)
    return one, path


def prefix_of(scenario: Scenario, name: str) -> str:
    """Beginning of the parameter paths of one of a scenario's vehicles; empty for the
    only one.
    """
    # paths of the only vehicle are those of a file without names
    return f"{OF_AGENT}{name}." if scenario.is_team else ""


def is_of_agent(path: str) -> bool:
    """True if a key path of a scenario file is of one vehicle, such as plant.gravity,
    and not of all.
    """
    return any(
        is_below(path, slot.table) or is_below(slot.table, path)
        for slot in slots(Scenario)
        if slot.place[0] == "agent"
    )


def by_agent(
    scenario: Scenario,
    values: Mapping[str, V],
    change: Callable[[Scenario, Mapping[str, V]], Scenario],
) -> Scenario:
    """Scenario of several vehicles with values replaced, in each vehicle's own flight
    or in what all share.

    Args:
        scenario: scenario of several vehicles.
        values: path -> value.
        change: function that replaces values in a scenario of one vehicle.

    Raises:
        ScenarioError: as :func:`alone`, and as ``change`` with the vehicle's name in
            the path.
    """
    groups: dict[str, dict[str, V]] = {}
    for path, value in values.items():
        _, word = alone(scenario, path)
        groups.setdefault(agent_of(path) if word != path else "", {})[word] = value
    changed = scenario
    shared = groups.pop("", {})
    # changes are stated by the scenario, not by the flight of one vehicle
    later = {
        path: shared.pop(path) for path in [*shared] if path.startswith("changes.")
    }
    if later:
        changed = replace_at(
            changed, {tuple(path.split(".")): value for path, value in later.items()}
        )
    if shared:
        # what all share is the same in the flight of each, so that of the first serves
        one = change(scenario.of(next(iter(scenario.agents))), shared)
        shared_parts = {
            name: getattr(one, name) for name in ("environment", "endings", "team")
        }
        changed = replace(changed, **shared_parts)
    agents = dict(changed.agents)
    for name, own in groups.items():
        with errors_of_agent(name):
            agents[name] = change(changed.of(name), own).agent
    return replace(changed, agents=agents) if groups else changed


@contextmanager
def errors_of_agent(name: str) -> Iterator[None]:
    """Context manager that puts a vehicle's name into the path with which an error
    message begins; "" for none.
    """
    try:
        yield
    except ValueError as error:
        if not name:
            raise
        words = str(error)
        if words.startswith("path = '"):
            raise ScenarioError(
                words.replace("path = '", f"path = '{OF_AGENT}{name}.", 1)
            ) from None
        of = is_of_agent(re.split(r"[ :\[]", words, maxsplit=1)[0])
        raise ScenarioError(f"{OF_AGENT}{name}.{words}" if of else words) from None


@positional
class Target:
    """Target of a parameter path: the fields that store the number, or a record that
    computes it from its fields.

    Attributes:
        places: fields; of a view its record. view: None for fields.
    """

    places: tuple[Place, ...]
    view: NumberView | None = None

    @property
    def names(self) -> tuple[Place, ...]:
        """Identifiers of the number at a parameter path; two paths with a common
        identifier denote the same number.
        """
        return (
            self.places
            if self.view is None
            else ((*self.places[0], f"view of {self.view.name}"),)
        )


def places_of(scenario: Scenario, path: str) -> tuple[Place, ...]:
    """Fields of a scenario that store the parameter at a path; several if one number is
    stored more than once.

    Raises:
        ScenarioError: as :func:`target_of`.
    """
    return target_of(scenario, path).names


def target_of(scenario: Scenario, path: str) -> Target:
    """Resolve a parameter path, in keys of a scenario file or field names of records,
    to the number that it denotes.

    Raises:
        ScenarioError: a field that does not exist (with those that do), or one that is
            structure.
    """
    if (delay := place_of_delay(scenario, path)) is not None:
        return Target((delay,))
    for slot in slots(Scenario):
        if slot.word.varies == "never" and is_below(path, slot.path):
            raise ScenarioError(
                f"path = {path!r}: {slot.path} is structure, {OF_STUDIES}"
            )
        if slot.type is Scalar and path == slot.path:
            return Target((slot.place,))
    if (
        path.startswith(("reference.", "model."))
        and scenario.agent.path_time is not None
    ):
        raise ScenarioError(
            f"path = {path!r}: {PLANNED}; make a scenario of each (skyarm.govern)"
        )
    if path.startswith("changes.") and not path.endswith(".value"):
        raise ScenarioError(
            f"path = {path!r}: must be changes.NUMBER.value; when a change comes is"
            " structure"
        )
    for root, start in roots(scenario).items():
        if path.startswith(f"{root}."):
            return _follow(scenario, path, start, path[len(root) + 1 :].split("."))
    beginnings = variable_words()
    near = did_you_mean(".".join(path.split(".")[:2]), beginnings) or did_you_mean(
        path.split(".", maxsplit=1)[0], beginnings
    )
    raise ScenarioError(
        f"path = {path!r}: {near}must start with one of {', '.join(beginnings)}"
    )


def path_of(scenario: Scenario, place: Place) -> str:
    """Parameter path of a scenario field, in keys of the scenario file and field names
    of records.
    """
    own = place_in_agent(place)
    if own != place:
        member = [*scenario.agents][int(place[2])]
        return prefix_of(scenario, member) + path_of(scenario.of(member), own)
    slot, name = slot_at(place)
    if EACH in slot.place:
        name = str(part(scenario, (*slot.record, name)).name)
    head = slot.path.replace(EACH, name) if EACH in slot.place else slot.path
    return ".".join((head, *place[len(slot.place) :]))


def place_in_agent(place: Place) -> Place:
    """Place below ``agent`` of a field of any of the vehicles, as in a scenario of it
    alone; others stay.
    """
    return ("agent", *place[3:]) if place[:2] == (AGENTS, "records") else place


def slot_at(place: Sequence[str]) -> tuple[Slot, str]:
    """Innermost scenario-file key that contains a field, and the item of the key's list
    in which the field lies.
    """
    inside = [
        slot
        for slot in slots(Scenario)
        if matches(place[: len(slot.place)], slot.place)
    ]
    # keys lie in one another, as model in controller
    slot = max(inside, key=lambda each: len(each.place))
    return slot, next(
        (a for a, b in zip(place, slot.place, strict=False) if b == EACH), ""
    )


def matches(place: Sequence[str], pattern: Place) -> bool:
    """True if a field path matches that of a scenario-file key, in which ``*`` matches
    any item of a list.
    """
    return len(place) == len(pattern) and all(
        b in (a, EACH) for a, b in zip(place, pattern, strict=True)
    )


def is_below(path: str, word: str) -> bool:
    """True if a parameter path equals a key path of a file or leads to something below
    it.
    """
    return path == word or path.startswith(f"{word}.")


@cache
def variable_words() -> dict[str, Place]:
    """Keys of a scenario file below which numbers may vary, each with the field that it
    denotes.
    """
    return {
        slot.path: slot.place
        for slot in slots(Scenario)
        if slot.word.varies != "never"
        and slot.type is not Scalar
        and EACH not in slot.path
    }


@cache
def delay_words() -> dict[str, tuple[Place, str]]:
    """Parameters that may vary only if another field is stated: path -> record, and
    name of that other field.
    """
    found: dict[str, tuple[Place, str]] = {}
    for slot in slots(Scenario):
        if isinstance(slot.type, type):
            for name, other in lifted_fields(slot.type).items():
                found[f"{slot.path}.{name}"] = (slot.place, other)
    return found


def place_of_delay(scenario: Scenario, path: str) -> Place | None:
    """Field of a delay that may vary because the scenario states an upper bound for it;
    None for other parameters.
    """
    record, other = delay_words().get(path, ((), ""))
    if not other or part(scenario, (*record, other)) is None:
        return None
    return (*record, path.rpartition(".")[2])


def roots(scenario: Scenario) -> dict[str, Place]:
    """Beginnings of parameter paths, such as plant or sensors.imu, with the scenario
    fields that they denote.
    """
    # drives of the vehicle's file; those that the scenario states for the same joints
    # come later and replace them
    carried = ("agent", "plant", "vehicle", "drives")
    places: dict[str, Place] = {
        f"plant.drives.{each.name}": (*carried, str(i), "drive")
        for i, each in enumerate(scenario.agent.vehicle.drives)
    }
    for slot in slots(Scenario):
        if EACH in slot.path:
            inside = slot.place[len(slot.record) + 1 :]
            for i, each in enumerate(part(scenario, slot.record)):
                places[f"{slot.table}.{each.name}"] = (*slot.record, str(i), *inside)
    return {**places, **variable_words()}


def _follow(scenario: Scenario, path: str, start: Place, names: list[str]) -> Target:
    places: tuple[Place, ...] = (start,)
    tree: Names | None = None
    view: NumberView | None = None
    whole = True
    for name in names:
        # a computed number has nothing below it
        options: Names = {}
        if view is None:
            options = path_names(part(scenario, places[0])) if tree is None else tree
        if name not in options:
            known = [*options]
            if whole and start in variable_words().values():
                known += _named_sensors_and_drives(scenario, path)
            there = (
                f"{did_you_mean(name, known)}there are"
                f" {', '.join(known) or 'no fields'}"
            )
            raise ScenarioError(f"path = {path!r}: no {name!r} here; {there}")
        denoted = options[name]
        whole = False
        view = denoted if isinstance(denoted, NumberView) else None
        tree = None if isinstance(denoted, (tuple, NumberView)) else denoted
        if isinstance(denoted, tuple):
            places = tuple((*head, *tail) for head in places for tail in denoted)
    if view is not None:
        return Target(((*places[0], *view.inside),), view)
    if tree is not None:
        raise ScenarioError(
            f"path = {path!r}: must lead to a number; there are {', '.join(tree)}"
        )
    return Target(
        tuple((*at, *getattr(part(scenario, at), "own_number", ())) for at in places)
    )


def _named_sensors_and_drives(scenario: Scenario, path: str) -> list[str]:
    """Names of sensors and drives, listed as suggestions for a misspelt parameter
    path.
    """
    head = path[: path.index(".") + 1]
    return [
        name.removeprefix(head)
        for name in roots(scenario)
        if name not in variable_words() and name.startswith(head)
    ]
