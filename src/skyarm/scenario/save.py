"""Scenario written back as a file: the tables that it was made from, entries in place of theirs, and numbers by path.

Vehicles, gains and planned references have no words of their own in a scenario's file, or more than one. So a scenario
is written as what differs from a file: parts with words are replaced, every other number stands under ``[numbers]`` by
its path, which is applied after all else is read.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from skyarm.records.files import PathLike, errors_as, file_name, shown
from skyarm.records.files.names import read_named
from skyarm.records.files.toml import toml_key, toml_value
from skyarm.records.files.writing import write_atomically
from skyarm.records.identity import identity
from skyarm.records.leaves import Place, is_leaf, mismatch, part, walk
from skyarm.records.plain import digest, plain
from skyarm.records.read_table import entry_of
from skyarm.records.words import EACH, Slot, groups, slots
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.paths import path_of
from skyarm.scenario.scenario_file import LIBRARY, scenario_from
from skyarm.scenario.scenario_record import Scenario, ScenarioError

FOLLOWS: Place = ("agent", "controller", "par", "mixer")
"""What is computed anew from the rotors that the law believes in."""

Tables = dict[str, Any]


def save_scenario(path: PathLike, scenario: Scenario, base: PathLike | Mapping[str, Any]) -> Path:
    """Write a scenario as a file that :func:`skyarm.load_scenario` reads as the same scenario, digest included.

    Args:
        path: of the .toml file to write.
        scenario: to be written.
        base: shipped name, path or tables of the scenario that it was made from: what both have is written as there.

    Returns:
        The path.

    Raises:
        ScenarioError: one line: a base that differs by more than words and numbers can say, such as another law.
    """
    with errors_as(ScenarioError):
        file = Path(file_name(path, "scenario"))
        tables, folder = _tables_of(base)
    if not isinstance(scenario, Scenario):
        raise ScenarioError(f"scenario = {shown(scenario)}: must be a Scenario")
    tables = _from_folder(tables, folder, file.parent)
    with errors_as(ScenarioError, f"{file}: ", (ValueError, TypeError)):
        found = tables_of(scenario, tables, file.parent)
        return write_atomically(file, scenario_text(found).encode())


def tables_of(scenario: Scenario, tables: Mapping[str, Any], folder: PathLike = "") -> Tables:
    """Tables that a scenario is read from, made of those of another one.

    Args:
        scenario: to be written.
        tables: of the scenario that it was made from.
        folder: where paths in the tables begin.

    Raises:
        ScenarioError: as :func:`save_scenario`.
    """
    begun = scenario_from(tables, folder)
    found = _with_entries(begun, scenario, {name: each for name, each in tables.items() if name != "numbers"})
    numbers = _numbers(scenario_from(found, folder), scenario)
    written = found | ({"numbers": numbers} if numbers else {})
    if identity(scenario_from(written, folder)) != identity(scenario):
        others = ", ".join(sorted(_different_words(scenario_from(written, folder), scenario)))
        raise ScenarioError(f"base: must be of the same structure; words and numbers do not say how {others} differ")
    return written


def _tables_of(base: PathLike | Mapping[str, Any]) -> tuple[Tables, Path]:
    """Tables of the scenario that another one was made from, and the folder where their paths begin."""
    if isinstance(base, Mapping):
        return dict(base), Path()
    return read_named(file_name(base, "base"), "scenario", LIBRARY)


def _from_folder(entry: Any, old: Path, new: Path) -> Any:
    """Entries with paths of files as seen from another folder."""
    if isinstance(entry, Mapping):
        return {name: _from_folder(each, old, new) for name, each in entry.items()}
    if isinstance(entry, list):
        return [_from_folder(each, old, new) for each in entry]
    if isinstance(entry, str) and Path(entry).suffix and (old / entry).is_file():
        return os.path.relpath((old / entry).resolve(), new.resolve())  # a link leads elsewhere than its name
    return entry


def _different_words(one: Scenario, other: Scenario) -> dict[str, Slot]:
    """Words whose values differ between two scenarios."""

    def content(scenario: Scenario, slot: Slot) -> str:
        field = slot.record[: 2 if slot.record[0] in groups(Scenario) else 1]
        return digest(plain(part(scenario, field)))

    return {slot.path: slot for slot in slots(Scenario) if content(one, slot) != content(other, slot)}


def _with_entries(begun: Scenario, scenario: Scenario, tables: Tables) -> Tables:
    """Tables with the entries of parts that differ in more than numbers, or whose words are numbers themselves."""
    found = tables
    for slot in _different_words(begun, scenario).values():
        before, after = part(begun, slot.record), part(scenario, slot.record)
        if slot.word.reader in WITHOUT_ENTRY or (slot.word.varies == "always" and _alike(before, after)):
            continue
        entry = _entry(slot, after)
        if slot.table == "sensors":  # of the full state its numbers stand there, of others tables by their names
            beside = found.get("sensors", {}).items()
            entry = {name: each for name, each in beside if isinstance(each, dict) is (slot.path == slot.table)} | entry
        found = _with_entry(found, slot.table.split("."), entry)
    return found


WITHOUT_ENTRY = ("plant", "model", "controller", "reference", "world")
"""Readers of words whose values other words made: their numbers are written by path."""


def _alike(one: object, other: object) -> bool:
    """True if two records differ in numbers alone."""
    ours, theirs = list(walk(one)), list(walk(other))
    if [place for place, _ in ours] != [place for place, _ in theirs] or mismatch(one, other, "") is not None:
        return False
    return all(is_leaf(x) or x == y for (_, x), (_, y) in zip(ours, theirs, strict=True))


def _entry(slot: Slot, value: Any) -> Any:
    """Entry of a word in a file."""
    if slot.path != slot.table:  # named items, each a table: NAME = { kind = ..., ... }
        inner = slot.place[slot.place.index(EACH) + 1]
        return {each.name: entry_of(getattr(each, inner)) for each in value}
    found = entry_of(value)
    if slot.path == "sensors" and isinstance(found, dict):
        found.pop("kind")
    if slot.path == "environment.wind" and isinstance(found, dict):
        return {"mode": found.pop("kind"), **found}
    return found


def _with_entry(tables: Tables, path: list[str], entry: Any) -> Tables:
    """Tables with the entry at a path replaced."""
    first, *rest = path
    inner = tables.get(first, {})
    return tables | {first: _with_entry(inner if isinstance(inner, dict) else {}, rest, entry) if rest else entry}


def _numbers(begun: Scenario, scenario: Scenario) -> dict[str, float]:
    """Numbers by path that make one scenario of another, without those that follow from others where that is enough."""
    ours, theirs = list(walk(begun)), list(walk(scenario))
    if [place for place, _ in ours] != [place for place, _ in theirs]:
        return {}  # of another structure, which numbers do not mend
    places = [
        place
        for (place, before), (_, after) in zip(ours, theirs, strict=True)
        if is_leaf(after) and isinstance(after, float) and (type(before) is not float or before != after)
    ]
    stated = [place for place in places if place[: len(FOLLOWS)] != FOLLOWS]
    numbers = {path_of(begun, place): float(part(scenario, place)) for place in stated}
    if len(stated) < len(places) and identity(with_numbers(begun, numbers)) != identity(scenario):
        numbers |= {path_of(begun, place): float(part(scenario, place)) for place in places}
    return numbers


def scenario_text(tables: Mapping[str, Any]) -> str:
    """TOML text of a scenario's tables."""
    lines, later = list[str](), list[tuple[str, Mapping[str, Any]]]()
    for name, entry in tables.items():
        if isinstance(entry, Mapping):
            later.append((name, entry))
        else:
            lines.append(f"{toml_key(name)} = {toml_value(entry)}")
    for name, table in later:
        lines += [
            "",
            f"[{toml_key(name)}]",
            *(f"{toml_key(word)} = {toml_value(each)}" for word, each in table.items()),
        ]
    return "\n".join(lines) + "\n"
