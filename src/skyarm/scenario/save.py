"""Writing of a scenario as a file: the tables that it was made from, with changed
entries and numbers by path.

Vehicles, gains and planned references have no words of their own in a scenario's file,
or more than one. So a scenario is written as what differs from a file: parts with words
are replaced, every other number stands under ``[numbers]`` by its path, which is
applied after all else is read.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from skyarm.control.catalogue import AUTOPILOTS, OWN, PRESETS, TUNED
from skyarm.records.files import (
    Fields,
    PathLike,
    errors_as,
    file_name,
    output_file,
    shown,
    taken_back,
    write_atomically,
)
from skyarm.records.files.names import read_named
from skyarm.records.files.toml import Entry, toml_key, toml_value
from skyarm.records.identity import DRAWN, identity
from skyarm.records.leaves import Place, is_leaf, mismatch, part, walk
from skyarm.records.members import SOLE
from skyarm.records.path_names import AGENTS, word_of
from skyarm.records.plain import digest, plain
from skyarm.records.read_table import entry_of
from skyarm.records.words import EACH, Slot, groups, slots
from skyarm.scenario.controller_table import LAYERS, SUFFIX, is_gains_file
from skyarm.scenario.document import LEFT_OUT, OF_AGENT_ALONE, slot_of
from skyarm.scenario.in_flight import measured_paths
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.paths import path_of, place_in_agent, prefix_of
from skyarm.scenario.readers import with_other_paths
from skyarm.scenario.scenario_differences import ABSENT, scenario_differences
from skyarm.scenario.scenario_file import LIBRARY, scenario_from
from skyarm.scenario.scenario_record import Scenario, ScenarioError, in_order

FOLLOWS: Place = ("agent", "controller", "par", "mixer")
"""Field that is recomputed from the rotors of the controller's model."""

GOVERNOR = "reference.governor"
PLANNED: Place = ("agent", "path_time")
"""Planning key and the field with its result, whose numbers no parameter path
replaces."""

INSTANTS = ("pick", "drop")
"""Keys of a payload that the phases of a task set."""

WRITTEN_ANEW = ("numbers", "changes")
"""Tables of the base that are not read: all of theirs is written anew, and files that
changes name need not be where the base's folder is."""

Tables = dict[str, Any]


def save_scenario(
    path: PathLike,
    scenario: Scenario,
    base: PathLike | Mapping[str, Entry],
    controller: PathLike | None = None,
) -> Path:
    """Write a scenario as a file that :func:`skyarm.load_scenario` reads as the same
    flight.

    The digest is the same, too, but of a scenario with what never takes effect, which
    is left out (windows and changes after the end of a flight that was shortened), or
    with changes by hand among those that follow from payloads: in the file they come
    first.

    Args:
        path: path of the .toml file to write.
        scenario: scenario to write.
        base: shipped name, path or tables of the scenario that it was made from: what
            both have is written as there.
        controller: name of its law as of :func:`skyarm.load_scenario`; "own" or left
            out, the base's [controller] if the law is of that name, or the catalogue's
            law of its name.

    Returns:
        The path.

    Raises:
        ScenarioError: one line: a base that differs by more than words and numbers can
            say, such as a law of Python; the first value that would be read otherwise.
        OSError: one line: the file cannot be written.
    """
    with errors_as(ScenarioError):
        file = Path(file_name(path, "path"))
    with errors_as(ScenarioError, "base: "):
        tables, folder = _tables_of(base)
    if not isinstance(scenario, Scenario):
        raise ScenarioError(f"scenario = {shown(scenario)}: must be a Scenario")
    with errors_as(ScenarioError):
        law = None if controller is None else file_name(controller, "controller")
        law = None if law == OWN else law
    with taken_back(file.parent):
        with errors_as(ScenarioError):
            output_file(str(path), "path", SUFFIX, force=True)
        with errors_as(ScenarioError, f"{file}: ", (ValueError, TypeError)):
            document = tables_of(
                scenario, _from_folder(tables, folder, file.parent), file.parent, law
            )
            return write_atomically(file, scenario_text(document).encode())


def tables_of(
    scenario: Scenario,
    tables: Mapping[str, Entry],
    folder: PathLike,
    controller: str | None,
) -> Tables:
    """Tables of a scenario file for a scenario, derived from the tables of the scenario
    that it was made from.

    Args:
        scenario: scenario to write.
        tables: tables of the scenario that it was made from.
        folder: folder where paths in the tables begin.
        controller: name of its law as of :func:`save_scenario`.

    Raises:
        ScenarioError: as :func:`save_scenario`.
    """
    target = _until_end(scenario)
    stated = _with_agents(
        {name: each for name, each in tables.items() if name not in WRITTEN_ANEW},
        target.agents,
    )
    laws = {
        name: controller or each.controller.name for name, each in target.agents.items()
    }
    others = laws
    if controller is None:
        begun = scenario_from(stated, folder)
        others = {
            name: law
            for name, law in laws.items()
            if law != begun.of(name).agent.controller.name
        }
    if others:
        return _tables_from(target, _under_laws(stated, others, folder), folder)
    try:
        return _tables_from(target, stated, folder)
    except ScenarioError as error:
        # the law of this name may have other options than the base's
        with suppress(ValueError):
            return _tables_from(target, _under_laws(stated, laws, folder), folder)
        raise error from None


def _with_agents(tables: Tables, names: Iterable[str]) -> Tables:
    """Scenario-file tables with a table for each vehicle by name; without one if the
    only vehicle has no name there.
    """
    if AGENTS not in tables and [*names] == [SOLE]:
        return tables
    stated = Fields(tables, "").inner(AGENTS)
    # an agent without a reference beside others that have one is taken for a misspelt
    # name (readers.reference)
    further: Tables = {} if "reference" in tables else {"reference": {}}
    return tables | {
        AGENTS: {name: stated.inner(name).table or further for name in names}
    }


def _of_agent(tables: Tables, name: str) -> Tables:
    """Scenario-file tables as one vehicle reads them: its own in place of those at the
    top.
    """
    return tables | tables[AGENTS][name] if AGENTS in tables else tables


def _tables_from(target: Scenario, stated: Tables, folder: PathLike) -> Tables:
    """Tables of a scenario file for a scenario, derived from given tables that already
    have its control law.

    Raises:
        ScenarioError: one line: they are read as another one.
    """
    begun = scenario_from(stated, folder)
    tables = _with_entries(begun, target, stated)
    if target.changes:
        tables = tables | {"changes": entry_of(target.changes)}
    read = scenario_from(tables, folder)
    rate = target.rates.control
    # only the order within one period is a part of the flight
    if in_order(read.changes, rate) == in_order(target.changes, rate):
        target = replace(target, changes=read.changes)
    # a varied payload is written as the numbers of the body that holds it, but where a
    # sensor feels the payload alone
    target = target.with_loads_of(read)
    loads = _added_loads(read, target)
    numbers = loads | _numbers(with_numbers(read, loads), target)
    # what follows from the law inside a safety layer is measured again where the file
    # is read
    measured = {path for name in target.agents for path in measured_paths(target, name)}
    numbers = {path: value for path, value in numbers.items() if path not in measured}
    written = tables | ({"numbers": numbers} if numbers else {})
    made = scenario_from(written, folder)
    if identity(made) != identity(target):
        raise ScenarioError(f"base: {_difference(made, target)}")
    return written


def _added_loads(begun: Scenario, target: Scenario) -> dict[str, Any]:
    """Masses (kg) by parameter path of the point masses that a scenario has at frames,
    beyond those of another.
    """
    paths: dict[Any, str] = {}
    for name, agent in target.agents.items():
        prefix = f"{prefix_of(target, name)}plant.payload."
        # further loads stand behind those of the other scenario
        for load in agent.plant.loads[len(begun.agents[name].plant.loads) :]:
            for frame in agent.vehicle.frames:
                if load == agent.vehicle.point_mass(load[1].mass, frame.name):
                    paths[load] = f"{prefix}{frame.name}.mass"
    return {path: body.mass for (_, body), path in paths.items()}


def _difference(made: Scenario, target: Scenario) -> str:
    """Error message about the first value of a scenario that would be read differently
    from the written file.
    """
    differences = scenario_differences(plain(target), plain(made))
    if any(word_of(path).startswith(GOVERNOR) for path in differences):
        return (
            f"must have the [{GOVERNOR}] that planned the scenario's time: no file"
            " states a plan by its numbers"
        )
    flown = {
        path: pair
        for path, pair in differences.items()
        if not {*path.split(".")} & {*DRAWN}
    }
    if not flown:
        return (
            "must be of the same classes as the scenario in"
            f" {', '.join(sorted(_different_words(made, target)))}"
        )
    # numbers differ, too, where others of another structure keep them from being
    # written
    path = min(
        flown, key=lambda each: all(isinstance(value, float) for value in flown[each])
    )
    own, other = (value if value == ABSENT else shown(value) for value in flown[path])
    but = (
        "which words and numbers do not change; choose the base it was made from, and"
        " its law by controller"
    )
    return (
        f"must have {path.removeprefix('agent.')} = {own} like the scenario, not"
        f" {other}, {but}"
    )


def law_entry(name: str) -> Tables:
    """Keys of [controller] for a law, a preset, an autopilot or ``LAW_tuned`` by its
    name.
    """
    if name in PRESETS:
        return {"preset": name}
    if name in AUTOPILOTS:
        return {"autopilot": name}
    return (
        {"law": name.removesuffix(TUNED), "tuned": True}
        if name.endswith(TUNED)
        else {"law": name}
    )


def _under_laws(tables: Tables, laws: Mapping[str, str], folder: PathLike) -> Tables:
    """Tables of a scenario file with other control laws in the same layers.

    Args:
        tables: tables of a scenario file.
        laws: name of the law of each vehicle that gets another.
        folder: folder where paths in the tables begin.
    """
    document = tables
    for agent, name in laws.items():
        if is_gains_file(name):
            entry = {
                "tuned": os.path.relpath(Path(name).resolve(), Path(folder).resolve())
            }
        else:
            entry = law_entry(name)
        stated = _of_agent(tables, agent).get("controller", {})
        layers = {word: each for word, each in stated.items() if word in LAYERS}
        document = _with_entry_of(
            document, agent, slot_of("controller"), entry | layers
        )
    return document


def _until_end(scenario: Scenario) -> Scenario:
    """Scenario without metric windows and scheduled changes that lie beyond its end."""
    coming = tuple(
        each
        for each in scenario.changes
        if each.tick(scenario.rates.control) < scenario.steps
    )
    return replace(
        scenario, windows=scenario.windows.within(scenario.duration), changes=coming
    )


def _tables_of(base: PathLike | Mapping[str, Entry]) -> tuple[Tables, Path]:
    """Tables of a base scenario, given or read from its file, and the folder from which
    their relative paths start.
    """
    if isinstance(base, Mapping):
        return dict(base), Path()
    return read_named(file_name(base, "base"), "scenario", LIBRARY)


def _from_folder(tables: Tables, old: Path, new: Path) -> Tables:
    """Scenario-file tables with relative file paths converted to start from another
    folder; absolute paths stay.
    """

    def from_new(path: str) -> str:
        if os.path.isabs(path):
            return path
        # a link leads elsewhere than its name
        return os.path.relpath((old / path).resolve(), new.resolve())

    return with_other_paths(tables, from_new)


def _different_words(one: Scenario, other: Scenario) -> dict[str, Slot]:
    """Keys of a scenario file whose values differ between two scenarios."""

    def content(scenario: Scenario, slot: Slot) -> str:
        # of a group, such as one vehicle's fields, each field is compared by itself
        field = slot.record[: 2 if slot.record[0] in groups(Scenario) else 1]
        return digest(plain(part(scenario, field)))

    return {
        slot.path: slot
        for slot in slots(Scenario)
        if content(one, slot) != content(other, slot)
    }


def _with_entries(begun: Scenario, scenario: Scenario, tables: Tables) -> Tables:
    """Scenario-file tables with new entries for sections whose differences cannot be
    written as numbers by path.
    """
    document = tables
    for name in scenario.agents:
        document = _with_entries_of(begun.of(name), scenario.of(name), name, document)
    return document


def _with_entries_of(
    begun: Scenario, scenario: Scenario, agent: str, tables: Tables
) -> Tables:
    """Scenario-file tables with new entries for one vehicle and what all share;
    scenarios of that vehicle alone.
    """
    document = tables
    stated = _of_agent(tables, agent)
    for slot in _different_words(begun, scenario).values():
        before, after = part(begun, slot.record), part(scenario, slot.record)
        numbers_alone = slot.word.varies == "always" and _alike(before, after)
        if after is None:
            document = _with_entry_of(document, agent, slot, LEFT_OUT)
            continue
        if slot.word.reader in WITHOUT_ENTRY or slot.path == "changes" or numbers_alone:
            continue
        with errors_as(ScenarioError, f"{slot.path}: ", TypeError):
            entry = _entry(slot, after)
        if slot.path == "payloads":
            entry = _without_instants(entry, stated.get("payloads", []))
        # of the full state its numbers stand there, of others tables by their names
        if slot.table == "sensors":
            beside = _of_agent(document, agent).get("sensors", {}).items()
            entry = {
                name: each
                for name, each in beside
                if isinstance(each, dict) is (slot.path == slot.table)
            } | entry
        document = _with_entry_of(document, agent, slot, entry)
    return document


def _without_instants(entry: list[Tables], stated: list[Tables]) -> list[Tables]:
    """Entry of payloads in a scenario file, without pick and drop times that the phases
    of a task determine.
    """
    by_name = {each.get("name", str(i)): each for i, each in enumerate(stated)}
    return [
        {
            word: value
            for word, value in each.items()
            if word not in INSTANTS
            or word in by_name.get(each.get("name", str(i)), INSTANTS)
        }
        for i, each in enumerate(entry)
    ]


WITHOUT_ENTRY = ("plant", "model", "controller", "reference", "world", "team")
"""Keys whose values other keys produce; their numbers are written by parameter path."""


def _alike(one: object, other: object) -> bool:
    """True if two records have the same structure and differ in numbers at most."""
    ours, theirs = list(walk(one)), list(walk(other))
    if [place for place, _ in ours] != [place for place, _ in theirs] or mismatch(
        one, other, ""
    ) is not None:
        return False
    return all(
        is_leaf(x) or x == y for (_, x), (_, y) in zip(ours, theirs, strict=True)
    )


def _entry(slot: Slot, value: Any) -> Any:
    """Entry that a scenario file has for the value of a key."""
    if slot.path == GOVERNOR:
        # the plan follows from it
        return True
    if slot.path != slot.table:
        # named items, each a table: NAME = { kind = ..., ... }
        inner = slot.place[slot.place.index(EACH) + 1]
        return {each.name: entry_of(getattr(each, inner)) for each in value}
    entry = entry_of(value)
    if slot.path == "sensors" and isinstance(entry, dict):
        entry.pop("kind")
    if slot.path == "environment.wind" and isinstance(entry, dict):
        return {"mode": entry.pop("kind"), **entry}
    return entry


def _with_entry_of(tables: Tables, agent: str, slot: Slot, entry: object) -> Tables:
    """Copy of scenario-file tables with the entry of a key replaced, in a vehicle's own
    table if it is of one.

    Args:
        tables: tables of a scenario file.
        agent: name of the vehicle.
        slot: declaration of the key.
        entry: its new entry; ``LEFT_OUT`` for none.
    """
    path = slot.table.split(".")
    if AGENTS not in tables or slot.place[0] != "agent":
        return _with_entry(tables, path, entry)
    named = OF_AGENT_ALONE.get(slot.table, slot.table).split(".")
    own, first = tables[AGENTS][agent], named[0]
    top, stated = ([first], tables.get(first, {})) if first == path[0] else (path, {})
    others = [each.path for each in slots(Scenario) if each.place[0] != "agent"]
    shared = (
        {key: stated[key] for key in stated if f"{first}.{key}" in others}
        if len(path) > 1
        else {}
    )
    # the vehicle's own table takes the place of the whole one at the top
    if len(named) > 1 and first not in own:
        own = own | {
            first: {key: each for key, each in stated.items() if key not in shared}
        }
    agents = tables[AGENTS] | {agent: _with_entry(own, named, entry)}
    # an entry at the top that no vehicle reads is refused
    if all(first in each for each in agents.values()):
        tables = _with_entry(tables, top, shared or LEFT_OUT)
    return tables | {AGENTS: agents}


def _with_entry(tables: Tables, path: list[str], entry: object) -> Tables:
    """Copy of scenario-file tables with the entry at a key path replaced; without it
    for ``LEFT_OUT``.
    """
    first, *rest = path
    inner = tables.get(first, {})
    if rest:
        return tables | {
            first: _with_entry(inner if isinstance(inner, dict) else {}, rest, entry)
        }
    return {
        name: each
        for name, each in (tables | {first: entry}).items()
        if each is not LEFT_OUT
    }


def _numbers(begun: Scenario, scenario: Scenario) -> dict[str, float]:
    """Numbers by parameter path that turn one scenario into another; dependent ones are
    left out unless needed.
    """
    ours, theirs = list(walk(begun)), list(walk(scenario))
    if [place for place, _ in ours] != [place for place, _ in theirs]:
        # of another structure, which numbers do not mend
        return {}
    places = [
        place
        for (place, before), (_, after) in zip(ours, theirs, strict=True)
        if (isinstance(after, float) and (type(before) is not float or before != after))
        # structure, which tables of some kinds lack
        or (type(after) is int and after == 0 and type(before) is float)
    ]
    places = [
        place for place in places if place_in_agent(place)[: len(PLANNED)] != PLANNED
    ]
    stated = [
        place for place in places if place_in_agent(place)[: len(FOLLOWS)] != FOLLOWS
    ]
    numbers = {path_of(begun, place): part(scenario, place) for place in stated}
    # the mixer's numbers stand in the file only where the model's rotors do not give
    # them
    if len(stated) < len(places) and identity(with_numbers(begun, numbers)) != identity(
        scenario
    ):
        numbers |= {path_of(begun, place): part(scenario, place) for place in places}
    return numbers


def scenario_text(document: Mapping[str, Entry]) -> str:
    """Text of a scenario file, in which each table or list inside a list has its own
    line.
    """
    return "\n".join(_document_lines(document, "")) + "\n"


def _document_lines(document: Mapping[str, Entry], within: str) -> list[str]:
    """Text lines of a scenario file, or of the table of one of its vehicles, whose
    heads then begin with its name.
    """
    lines: list[str] = []
    # TOML reads a plain key below a table's head as one of that table
    for name, entry in sorted(
        document.items(), key=lambda each: isinstance(each[1], Mapping)
    ):
        key = toml_key(name)
        if name == AGENTS:
            for agent, own in Fields(entry, "").table.items():
                lines += [
                    "",
                    f"[{AGENTS}.{agent}]",
                    *_document_lines(own, f"{AGENTS}.{agent}."),
                ]
        elif isinstance(entry, Mapping):
            lines += _table_lines(within + key, entry)
        else:
            lines += _value_lines(f"{key} = ", entry, "")
    return lines


def _table_lines(name: str, table: Mapping[str, Entry]) -> list[str]:
    """Text lines of a TOML table: plain values and inline tables, then nested tables
    that contain lists.
    """
    inner = {
        k: v
        for k, v in table.items()
        if isinstance(v, Mapping) and any(isinstance(x, list) for x in v.values())
    }
    lines = ["", f"[{name}]"]
    for key, value in table.items():
        if key not in inner:
            lines += _value_lines(f"{toml_key(key)} = ", value, "")
    for key, value in inner.items():
        lines += _table_lines(f"{name}.{toml_key(key)}", value)
    return lines


def _value_lines(begin: str, value: Entry, indent: str) -> list[str]:
    """Text lines of a TOML value; each entry of a list of tables or lists begins a new
    line.
    """
    if not isinstance(value, list) or not any(
        isinstance(each, (Mapping, list)) for each in value
    ):
        return [f"{indent}{begin}{toml_value(value)}"]
    lines = [f"{indent}{begin}["]
    for each in value:
        inner = _value_lines("", each, indent + "    ")
        lines += [*inner[:-1], inner[-1] + ","]
    return [*lines, f"{indent}]"]
