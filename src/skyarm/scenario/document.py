"""Tables of a scenario file, read word by word at the first use of each.

A reader of one word may ask for others: the reference for the plant that flies it, payloads for the events of the
reference's task. A scenario that exists answers the same questions, so that a scheduled change of a part is read by the
reader of that part in a file.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol, get_args, get_origin

from skyarm.records.field_rules import defaults
from skyarm.records.files import Fields, errors_as, number
from skyarm.records.files.fields import list_of_tables
from skyarm.records.leaves import field_names, part
from skyarm.records.read_table import record_from, registered_from
from skyarm.records.words import EACH, Slot, groups, slots
from skyarm.reference.task_records import Setting
from skyarm.scenario import readers
from skyarm.scenario.controller_table import require_servos_said
from skyarm.scenario.numbers import require_apart, with_numbers
from skyarm.scenario.paths import is_below
from skyarm.scenario.scenario_checks import check_scenario, require_start_outside
from skyarm.scenario.scenario_record import Change, Scenario, ScenarioError
from skyarm.vehicle.vehicle_records import Vehicle

LEFT_OUT: Any = object()
"""Entry of a word that a file does not have."""


OPTIONAL: Mapping[str, Any] = {"model": None, "reference": {}}
"""Words that a file may leave out though their fields have no default, with what their readers get then."""


class Reading(Protocol):
    """Source of the other words of a scenario, for the reader of one.

    Attributes:
        folder: where paths of files begin.
        replaced: entries that take the place of the file's, by path.
    """

    folder: Path
    replaced: Mapping[str, Any]

    @property
    def setting(self) -> Setting:
        """Setting of the flight."""
        ...

    def word(self, path: str) -> Any:
        """Value of a word, as its field holds it."""
        ...

    def vehicle(self, path: str) -> Vehicle:
        """Vehicle that the table at a path names, without that table's other words."""
        ...


def slot_of(path: str) -> Slot:
    """Word of a scenario's file at a path."""
    return next(slot for slot in slots(Scenario) if slot.path == path)


def read_part(slot: Slot, entry: Any, reading: Reading) -> Any:
    """Value of a word's field, from what a file has in its place.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    word, path = slot.word, slot.table
    if word.reader:
        return getattr(readers, word.reader)(entry, path, reading)
    if get_origin(slot.type) is tuple:
        kind, tables = get_args(slot.type)[0], list_of_tables(entry, path)
        if not word.kind:
            return tuple(record_from(kind, each) for each in tables)
        return tuple(registered_from(word.kind, kind, each.table, each.where, word.usual) for each in tables)
    if word.kind:  # a text alone names the kind
        named = {"kind": entry} if isinstance(entry, str) else entry
        return registered_from(word.kind, slot.type, named, path, word.usual)
    if field_names(slot.type) is not None:
        return record_from(slot.type, Fields(entry, path))
    within, _, name = path.rpartition(".")
    if slot.type is bool:
        return Fields({name: entry}, within).flag(name)
    return Fields({name: entry}, within).text(name, "") if name == "title" else entry


class OfScenario:
    """A scenario as what its parts were read from."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self.folder = Path()
        self.replaced: Mapping[str, Any] = {}
        self.setting = readers.setting_of(scenario.plant, scenario.duration)

    def word(self, path: str) -> Any:
        """Value of a word of the scenario."""
        return part(self._scenario, slot_of(path).record)

    def vehicle(self, path: str) -> Vehicle:
        """Vehicle of the plant or the model."""
        found: Vehicle = self.word(path).vehicle
        return found


class Document:
    """Tables of a scenario file.

    Args:
        tables: plain, as read from TOML.
        folder: where its paths of files begin.
        replaced: entries in the place of the file's, by path; of ``controller`` the name of a law.
    """

    def __init__(self, tables: Mapping[str, Any], folder: Path, replaced: Mapping[str, Any]) -> None:
        self.folder, self.replaced = folder, replaced
        self._tables = {"": Fields(dict(tables), "")}
        self._words = dict[str, Any]()
        self._vehicles = dict[str, Vehicle]()

    def table(self, path: str) -> Fields:
        """Reader of the table at a path, one for all words of the table."""
        if path not in self._tables:
            within, _, name = path.rpartition(".")
            self._tables[path] = self.table(within).inner(name)
        return self._tables[path]

    def word(self, path: str) -> Any:
        """Value of a word, read at its first use; the default of its field where the file leaves it out."""
        if path not in self._words:
            slot = slot_of(path)
            entry = self._entry(slot)
            self._words[path] = _default(slot) if entry is LEFT_OUT else read_part(slot, entry, self)
        return self._words[path]

    def vehicle(self, path: str) -> Vehicle:
        """Vehicle that [plant] or [model] names, without the table's payload and joint values; each is loaded once."""
        named = self.table(path).table.get("vehicle")
        if not isinstance(named, str) or named not in self._vehicles:
            found = readers.vehicle(named, f"{path}.vehicle", self.folder)
            self._vehicles[str(named)] = found
        return self._vehicles[str(named)]

    @cached_property
    def setting(self) -> Setting:
        """Setting of the flight, with a task's events once its reference is read."""
        stated = number(self.table("").take("duration"), "duration")
        return readers.setting_of(self.word("plant"), max(self.word("duration"), stated))

    def _entry(self, slot: Slot) -> Any:
        """Entry of a word in the file, without the words below it that have fields of their own."""
        within, _, name = slot.table.rpartition(".")
        above = self.table("").table.get(within, {}) if within else {}
        if within in NAMED and not isinstance(above, dict):
            return LEFT_OUT  # the reader of the word above says what must be there
        entry = self.table(within).take(name, LEFT_OUT)
        if slot.path in self.replaced and not slot.word.entries:
            return self.replaced[slot.path]
        if slot.path == "payloads":
            entry = self._payload_tables(entry)
        if entry is LEFT_OUT and _default(slot) is dataclasses.MISSING:
            return OPTIONAL[slot.path] if slot.path in OPTIONAL else self.table(within).take(name)  # is missing
        if not isinstance(entry, dict):
            return entry
        if slot.path != slot.table and slot.table in NAMED:
            return {word: each for word, each in entry.items() if isinstance(each, dict)} or LEFT_OUT
        below = NAMED[slot.path] if slot.path == slot.table else ()
        return {
            word: each
            for word, each in entry.items()
            if word not in below and not (EACH in below and isinstance(each, dict))
        }

    def _payload_tables(self, entry: Any) -> Any:
        """Tables of payloads, with the instants at which the phases of a task take and leave them."""
        self.word("reference")
        handled = [event for event in self.setting.events if not event.gripper]
        if entry in (LEFT_OUT, []) and not handled:
            return LEFT_OUT
        from skyarm.scenario import payload_tables as loads

        return loads.with_instants([] if entry is LEFT_OUT else entry, handled, self.word("rates").control)

    def scenario(self) -> Scenario:
        """Scenario of all words; unknown ones are refused.

        Raises:
            ValueError: one line with field, value and what is allowed.
        """
        top = self.table("")
        top.require_schema()
        vehicle, _ = self.word("plant").vehicle, self.word("duration")
        readers.require_plugins(top)
        require_servos_said(Fields(top.take("controller"), "controller"), vehicle, self.word("model"))
        self._apply_task()
        fields = self._fields()
        scenario = Scenario(**fields | {name: kind(**fields.get(name, {})) for name, kind in groups(Scenario).items()})
        check_scenario(scenario)
        self.table("environment").done()
        if "duration" not in self.replaced:  # what takes its place shortens the flight, not the file
            scenario.windows.require_within(scenario.duration)
            require_within(scenario.changes, scenario.steps, scenario.rates.control)
        numbers = self.table("numbers").table
        if "controller" in self.replaced:  # gains of a law that does not fly, as changes of it are
            numbers = {path: value for path, value in numbers.items() if not is_below(path, "controller")}
        initial, governor = self._entry(slot_of("initial")), self._entry(slot_of("reference.governor"))
        top.done()
        if scenario.changes:
            from skyarm.scenario.in_flight import require_changes

            require_changes(scenario)
        planned = readers.governor(False if governor is LEFT_OUT else governor, self.setting)
        made = planned(readers.at_start(scenario, None if initial is LEFT_OUT else initial))
        with errors_as(ScenarioError, "numbers: "):
            return _with_stated_numbers(made, numbers) if numbers else made

    def _fields(self) -> dict[str, Any]:
        """Fields of the scenario by name, those of its groups as tables."""
        found = dict[str, Any]()
        for slot in slots(Scenario):
            if slot.path not in LATER_READ and (value := self.word(slot.path)) is not dataclasses.MISSING:
                name, *inner = slot.record
                if name in groups(Scenario):
                    found.setdefault(name, {})[inner[0]] = value
                else:
                    found[name] = value
        return found

    def _apply_task(self) -> None:
        """Let the law's model follow payloads that are known in advance, and grippers the phases of a task."""
        changes = tuple(each for each in self.word("changes") if not (each.of_law and "controller" in self.replaced))
        payloads, events = self.word("payloads"), self.setting.events
        if payloads or events:
            from skyarm.scenario import payload_tables as loads

            rate = self.word("rates").control
            trajectory, duration = self.word("reference"), self.word("duration")
            self._words["payloads"], more = loads.with_model_changes(payloads, trajectory, duration, rate)
            closing = [event for event in events if event.gripper]
            self._words["world"] = loads.with_commands(self.word("world"), closing, rate)
            changes = (*changes, *more)
        self._words["changes"] = changes


def require_within(changes: Iterable[Change], steps: int, rate: int) -> None:
    """Raise an error if a scheduled change lies outside of the flight's control periods.

    Raises:
        ScenarioError: one line.
    """
    for i, change in enumerate(changes):
        if change.tick(rate) >= steps:
            last = (steps - 1) / rate
            raise ScenarioError(f"changes[{i}].at = {change.at!r}: must be at most {last:g} s, the last control period")


def _with_stated_numbers(scenario: Scenario, numbers: Mapping[str, Any]) -> Scenario:
    """Scenario with the numbers that a file states by path, checked as if they were stated in words."""
    require_apart(scenario, tuple(numbers))
    changed = with_numbers(scenario, numbers)
    if changed.changes:
        from skyarm.scenario.in_flight import require_changes

        require_changes(changed)
    if changed.world is not None:
        require_start_outside(changed)
    return changed


def _default(slot: Slot) -> Any:
    """Default of the field that holds a word; ``dataclasses.MISSING`` if there is none."""
    *above, name = slot.field
    owner = groups(Scenario)[above[0]] if above else Scenario
    return defaults(owner)[name]


def _words_below() -> dict[str, frozenset[str]]:
    """Words of a file that are tables, each with the words inside that have a field of their own."""
    paths = [slot.path for slot in slots(Scenario)]
    return {
        path: frozenset(w[len(path) + 1 :].split(".")[0] for w in paths if w.startswith(f"{path}.")) for path in paths
    }


NAMED = _words_below()
"""Words of a file, each with those inside that have a field of their own."""

LATER_READ = ("initial", "reference.governor")
"""Words whose readers need the scenario of all others."""
