"""Tables of a scenario file, whose keys are read at their first use.

A reader of one word may ask for others: the reference for the plant that flies it,
payloads for the events of the reference's task. :class:`PartDocument` answers the same
questions for one part of a scenario that exists, so that a scheduled change of a part
is read by the reader of that part in a file.
"""

from __future__ import annotations

import copy
import dataclasses
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache, cached_property
from pathlib import Path
from typing import Any, get_args, get_origin

from skyarm.records.files import Fields, number, shown
from skyarm.records.files.toml import Entry
from skyarm.records.leaves import Place, Tree, field_names, part, replace_at
from skyarm.records.members import SOLE
from skyarm.records.path_names import AGENTS
from skyarm.records.read_table import (
    default_if_equal,
    registered_from,
    registered_value,
    registered_values,
    value_from,
)
from skyarm.records.units import declared_units
from skyarm.records.words import EACH, Slot, slots
from skyarm.reference.task_records import Setting, TaskEvent
from skyarm.scenario import readers
from skyarm.scenario.paths import is_below
from skyarm.scenario.scenario_record import Scenario
from skyarm.vehicle import Vehicle
from skyarm.world import Component

OF_AGENT_ALONE = {"environment.faults": "faults"}
"""Keys that have another name in the table of an agent."""

LEFT_OUT = object()
"""Marker of a key that a file leaves out."""

OPTIONAL: Mapping[str, object] = {
    "model": None,
    "reference": {},
    "reference.governor": False,
    "initial": None,
    "payloads": [],
    "world": None,
}
"""Keys that are read although a file leaves them out, each with the entry that their
reader then receives."""

OF_PLANT = ("plant", "model")
"""Keys that a reader of plant and model alone reads: of all agents that state neither
they are the same records."""

OF_SCENARIO = ("initial", "reference.governor")
"""Keys whose readers need all other fields of the scenario."""


@cache
def slot_of(path: str) -> Slot:
    """Declaration of the scenario-file key at a given key path."""
    return next(slot for slot in slots(Scenario) if slot.path == path)


def words_of_agent() -> tuple[str, ...]:
    """Keys that may stand in the table of one of several agents."""
    paths = [
        OF_AGENT_ALONE.get(slot.path, slot.path)
        for slot in slots(Scenario)
        if slot.place[0] == "agent"
    ]
    return tuple(dict.fromkeys(path.split(".")[0] for path in paths))


def read_part(
    slot: Slot, entry: object, reading: readers.ScenarioWords, at: str = ""
) -> Any:
    """Read the value of a scenario field from the entry that a scenario file has for
    it, at another path if given.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    word, path = slot.word, at or slot.table
    if word.reader:
        return getattr(readers, word.reader)(entry, path, reading)
    if EACH in slot.path:
        return _read_by_name(slot, Fields(entry, path))
    if word.kind:
        if get_origin(slot.type) is tuple:
            return registered_values(
                word.kind, get_args(slot.type)[0], entry, path, word.usual
            )
        return registered_value(word.kind, slot.type, entry, path, word.usual)
    # the record says what it must be
    if slot.type in (str, int):
        return entry
    within, _, name = path.rpartition(".")
    return default_if_equal(
        value_from(slot.type, slot.unit, Fields({name: entry}, within), name),
        slot.default,
    )


def _read_by_name(slot: Slot, tables: Fields) -> tuple[object, ...]:
    """Read records such as sensors and joint drives from named tables; each record gets
    its table's name.
    """
    kind, inner = get_args(slot.type)[0], slot.word.inside[-1]
    of: Any = declared_units(kind)[inner][0]
    # such a record has one more field, its name
    name = next(field for field in field_names(kind) or () if field != inner)
    return tuple(
        kind(
            **{
                name: each,
                inner: registered_from(slot.word.kind, of, table, tables.at(each)),
            }
        )
        for each, table in tables.table.items()
    )


class Document:
    """Tables of a scenario file, read key by key.

    Args:
        tables: plain, as read from TOML.
        folder: folder where its paths of files begin.
        replaced: entries in the place of the file's, by path.
        law: name of a law, or file of gains, in place of what [controller] says; None
            for none.
    """

    _whole: Document | None = None

    def __init__(
        self,
        tables: Mapping[str, object],
        folder: Path,
        replaced: Mapping[str, object],
        law: str | None = None,
    ) -> None:
        self.folder, self.replaced, self.law = folder, replaced, law
        self._tables = {"": Fields(dict(tables), "")}
        self._words: dict[str, Any] = {}
        self._vehicles: dict[str, Vehicle] = {}
        self._worlds: list[Component[Tree]] = []
        named = self.table("").take(AGENTS, None)
        if named is not None and (not isinstance(named, dict) or not named):
            raise ValueError(
                f"{AGENTS} = {shown(named)}: must be tables of agents, as"
                f" [{AGENTS}.left]"
            )
        self._prefix = ""
        self._own: frozenset[str] = frozenset()
        self._members = {name: self._member(name) for name in named or ()} or {
            SOLE: self
        }

    def _member(self, name: str) -> Document:
        """Reader of the keys of one agent: each from its own table, as a whole, or else
        from the top.
        """
        if not name.isidentifier():
            raise ValueError(
                f"{AGENTS} = {shown(name)}: must be names that are words: letters,"
                " digits and underscores"
            )
        member = copy.copy(self)
        member._prefix = f"{AGENTS}.{name}"
        member._own = frozenset(self.table(member._prefix).table)
        # words of its own, while tables and vehicles are read once for all
        member._words = {}
        member._members = {name: member}
        member._whole = self
        return member

    @property
    def members(self) -> Mapping[str, Document]:
        """Reader of each agent's words, by the agent's name; of a file without names it
        is this one.
        """
        return self._members

    @property
    def name(self) -> str:
        """Name of the agent whose words are read; empty for the only one and for what
        all share.
        """
        return self._prefix.rpartition(".")[2]

    @property
    def agents(self) -> Collection[str]:
        """Names of all agents."""
        return (self._whole or self).members

    def entry_at(self, path: str) -> Entry:
        """Unread entry of the file at a path from its top; an empty table if the file
        has none.
        """
        within, _, name = path.rpartition(".")
        first = path.split(".", maxsplit=1)[0]
        fields = self.table("")
        fields.take(first, {})
        entry: Entry = (fields.inner(within) if within else fields).table.get(name, {})
        return entry

    def at(self, path: str) -> str:
        """Path of a word in the file: below the agent's own table if that has it."""
        named = OF_AGENT_ALONE.get(path, path)
        return f"{self._prefix}.{named}" if named.split(".")[0] in self._own else path

    @contextmanager
    def errors_at(self) -> Iterator[None]:
        """Context manager that puts the agent before an error about a word of the
        agent's own table.
        """
        try:
            yield
        except ValueError as error:
            # a fault of what all share is not in the agent's table
            words = str(error)
            if re.split(r"\W", words, maxsplit=1)[0] not in self._own:
                raise
            raise ValueError(f"{self._prefix}.{words}") from None

    def table(self, path: str) -> Fields:
        """Reader of the table at a path of a scenario file, shared by all keys of the
        table.
        """
        if path not in self._tables:
            within, _, name = path.rpartition(".")
            self._tables[path] = self.table(within).inner(name)
        return self._tables[path]

    def stated_table(self, path: str) -> Fields:
        """Reader of a table that the file must have, by the path of its word."""
        at = self.at(path)
        within, _, name = at.rpartition(".")
        return Fields(self.table(within).take(name), at)

    def word(self, path: str) -> Any:
        """Value of a scenario-file key, read at its first use; the field's default if
        the file leaves the key out.
        """
        slot = slot_of(path)
        shared = slot.place[0] != "agent" or (
            path in OF_PLANT and self._own.isdisjoint(OF_PLANT)
        )
        if self._whole is not None and shared:
            return self._whole.word(path)
        if path not in self._words:
            entry = self.entry(slot)
            at = self.at(slot.table)
            self._words[path] = (
                slot.default if entry is LEFT_OUT else read_part(slot, entry, self, at)
            )
        return self._words[path]

    def entry(self, slot: Slot) -> object:
        """Entry of a key in the scenario file, without nested keys that are read into
        scenario fields of their own.
        """
        within, _, name = self.at(slot.table).rpartition(".")
        if slot.path in self.replaced:
            self.table(within).take(name, None)
            return self.replaced[slot.path]
        above, _, last = within.rpartition(".")
        if slot.table.rpartition(".")[0] in PATHS and not isinstance(
            self.table(above).table.get(last, {}), dict
        ):
            # the reader of the word above says what must be there
            return LEFT_OUT
        required = slot.default is dataclasses.MISSING and slot.path not in OPTIONAL
        entry = self.table(within).take(
            name, *(() if required else (OPTIONAL.get(slot.path, LEFT_OUT),))
        )
        if not isinstance(entry, dict) or slot.table not in PATHS:
            return entry
        named = EACH in slot.path
        if self._whole is not None and self.at(slot.table) != slot.table:
            for each in entry:
                at = f"{slot.table}.{each}"
                if at in PATHS and slot_of(at).place[0] != "agent":
                    words = (
                        f"must be left out; [{slot.table}] at the top has it for all"
                        " agents"
                    )
                    raise ValueError(f"{self.at(slot.table)}.{each}: {words}")
        return {
            each: inner
            for each, inner in entry.items()
            if _is_word(slot.table, each, inner) is named
        }

    def vehicle(self, path: str) -> Vehicle:
        """Vehicle that [plant] or [model] names, loaded once, without the table's
        payload and joint values.
        """
        named = self.table(self.at(path)).take("vehicle")
        if not isinstance(named, str) or named not in self._vehicles:
            # one file for plant and model, and for all agents that name it
            self._vehicles[str(named)] = readers.vehicle(
                named, f"{self.at(path)}.vehicle", self.folder
            )
        return self._vehicles[str(named)]

    @property
    def stated_world(self) -> Component[Tree]:
        """Contact model as [world] states it, without commands of a task; read once
        for the team and for the scenario.
        """
        if not self._worlds:
            entry = self.entry_at("world")
            self._worlds.append(readers.stated_world(entry, "world", self.folder))
        return self._worlds[0]

    @cached_property
    def setting(self) -> Setting:
        """Flight data for reading a reference, with the events of a task once its
        reference is read.
        """
        # the file's duration where less is flown, so that the reference stays the same;
        # a longer flight needs one for all of its time
        stated = number(self.table("").take("duration", 0.0), "duration")
        return readers.setting_of(
            self.word("plant"), max(self.word("duration"), stated)
        )

    @property
    def events(self) -> list[tuple[str, Sequence[TaskEvent]]]:
        """Events of the task of each agent's reference, with the agent's name; "" if it
        is the only one.
        """
        # grippers of the only vehicle need not say whose they are
        several = len(self.members) > 1
        events: list[tuple[str, Sequence[TaskEvent]]] = []
        for name, member in self.members.items():
            # the phases of a reference are the events, so that it is read first
            member.word("reference")
            events.append((name if several else "", member.setting.events))
        return events

    def fields(self, within: str = "", agent: bool | None = None) -> dict[Place, Any]:
        """Values of the scenario fields below a key path; those in :data:`OF_SCENARIO`
        are given their defaults.

        Args:
            within: the path; empty for all.
            agent: True for fields of one agent, False for those of all; None for both.
        """
        below = (
            slot
            for slot in slots(Scenario)
            if not within or is_below(slot.path, within)
        )
        slots_below = (
            slot
            for slot in below
            if agent is None or (slot.place[0] == "agent") is agent
        )
        return {
            slot.field: (
                slot.default if slot.path in OF_SCENARIO else self.word(slot.path)
            )
            for slot in slots_below
        }

    @property
    def has_governor(self) -> bool:
        """True if [reference.governor] is stated and not false."""
        return self.entry(slot_of("reference.governor")) is not False

    def plan_time(self, scenario: Scenario) -> Scenario:
        """Apply the time scaling that [reference.governor] requests to the reference of
        a scenario.
        """
        if not self.has_governor:
            return scenario
        from skyarm.scenario.path_governor import governed_by_table

        entry = self.entry(slot_of("reference.governor"))
        return governed_by_table(scenario, entry, self.setting.events)


class PartDocument(Document):
    """Reader of one section of a scenario file, such as [reference]; other values come
    from an existing scenario.

    Args:
        path: path of the part.
        entry: entry that a file would have there.
        scenario: scenario with the part before the change.
    """

    def __init__(self, path: str, entry: object, scenario: Scenario) -> None:
        tables = entry
        for name in reversed(path.split(".")):
            tables = {name: tables}
        super().__init__(tables, Path(), {})  # type: ignore[arg-type]
        self._path, self._scenario = path, scenario

    def word(self, path: str) -> Any:
        """Value of a key: read from the new section if the key lies in it, else taken
        from the existing scenario.
        """
        return (
            super().word(path)
            if is_below(path, self._path)
            else part(self._scenario, slot_of(path).record)
        )

    def planned_fields(self) -> dict[Place, object]:
        """Scenario fields, with values, that a new section sets; a new reference is
        time-scaled if requested.
        """
        fields = self.fields(self._path)
        planned = self.plan_time(replace_at(self._scenario, fields))
        return {field: part(planned, field) for field in fields}


PATHS = frozenset(slot.path for slot in slots(Scenario))
"""Paths of the scenario-file keys that have a field of their own."""


def _is_word(table: str, name: str, entry: object) -> bool:
    """True if a key inside a table of a scenario file is read into a scenario field of
    its own.
    """
    at = f"{table}.{name}"
    return not PATHS.isdisjoint((at, f"{at}.{EACH}")) or (
        isinstance(entry, dict) and f"{table}.{EACH}" in PATHS
    )
