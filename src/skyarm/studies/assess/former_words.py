"""Upgrade of files of earlier versions: their renamed words and dropped options in the words of this version."""

from __future__ import annotations

import ast
import re
import tomllib
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from skyarm.control.controller import FormerNameWarning
from skyarm.records.files import errors_as, one_line, read_toml, require_file, shown
from skyarm.records.files.messages import present_names
from skyarm.records.files.names import kind_of
from skyarm.records.files.toml_edits import (
    TomlPath,
    add_key,
    leave_out,
    path_of,
    path_text,
    rename_key,
    set_value,
    value_at,
)
from skyarm.records.immutable import immutable
from skyarm.scenario.scenario_file import scenario_from
from skyarm.studies.sweep.study_file import study_from
from skyarm.vehicle.vehicle_files import vehicle_of_text

MOST = 200
"""Changes of one file."""

_FIELD = re.compile(r"(?P<path>[^\s=:]+)(?: = .*?)?: ")
_NOW = re.compile(r"is now '(?P<now>[^']+)'(?: = (?P<value>\w+)| with (?P<options>[^;]*))?(?:;|$)")
_MISSING = re.compile(r"(?P<path>[^\s=:]+): is missing; is it '(?P<former>[^']+)'\? ")
_LAW = re.compile(r"is no preset but a law: law = '(?P<law>[^']+)'")
_FLIES = re.compile(r"is gone, '(?P<now>[^']+)' flies")
_STATED = re.compile(r"(?P<option>\w+) = (?P<value>[\d.]+) in the file ends this note")
_GONE = ("is gone; leave it out", "there is one; ", "the next version does not read it")
"""Beginnings of messages on a key that this version does without."""


_PLAIN = re.compile(r"skyarm(\.\w+)+")
"""Present name of a module or class without further words."""


@immutable
class Change:
    """One word of an earlier version in a file, and what replaces it."""

    field: str
    """Path in the file; a line number in a Python file."""
    before: str
    now: str

    def __str__(self) -> str:
        return f"{self.field}: {self.before} -> {self.now}"


@immutable
class Upgrade:
    """A file of an earlier version in the words of this one."""

    text: str
    changes: tuple[Change, ...]
    fault: str
    """Error that the changed file still has; empty for a file that loads."""
    notes: tuple[str, ...]
    """Warnings of the changed file about words of an earlier version, which no edit mends."""


def upgrade_file(path: Path) -> Upgrade:
    """Find the words of earlier versions in a file and write its text anew.

    A scenario, vehicle or study is read as often as its reader objects to such a word; comments, order and blank lines
    stay. In a Python file the former names of modules and classes are replaced; it is not run.

    Raises:
        ValueError: one line: the file cannot be read, or is none of these kinds.
    """
    require_file(path, str(path))
    content = path.read_bytes()
    try:
        text = content.decode()
    except UnicodeDecodeError:
        raise ValueError(f"{path}: must be text in UTF-8") from None
    if path.suffix == ".py":
        return _upgrade_python(path, text)
    with errors_as(ValueError, f"{path}: "):
        load = _loader(read_toml(content), path)
    changes: list[Change] = []
    while True:
        fault, noted = _faults(load, text)
        try:
            found = next(_edits(fault, noted, tomllib.loads(text)), None)
            if found is None or len(changes) == MOST:
                return Upgrade(text=text, changes=tuple(changes), fault=fault, notes=tuple(noted))
            change, edit = found
            text = edit(text)
        except ValueError as error:  # of a form that only a person can change
            return Upgrade(text=text, changes=tuple(changes), fault=fault or str(error), notes=tuple(noted))
        changes.append(change)


def _loader(document: Mapping[str, Any], path: Path) -> Callable[[str], object]:
    """Reader of the text of a file, by the kind of the file."""
    kind = kind_of(document)
    if kind == "scenario":
        return lambda text: scenario_from(tomllib.loads(text), path.parent)
    if kind == "study":
        return lambda text: study_from(tomllib.loads(text), path.parent)
    if kind == "vehicle":
        return lambda text: vehicle_of_text(text, path)
    raise ValueError("must be a scenario, a vehicle, a study or a Python file")


def _faults(load: Callable[[str], object], text: str) -> tuple[str, list[str]]:
    """Error that reading a text raises, empty for none, and its warnings of words of earlier versions."""
    with warnings.catch_warnings(record=True) as noted:
        warnings.simplefilter("ignore")
        warnings.simplefilter("always", FormerNameWarning)
        try:
            load(text)
            fault = ""
        except ValueError as error:
            fault = one_line(str(error))
    return fault, [str(each.message) for each in noted if issubclass(each.category, FormerNameWarning)]


Edit = Callable[[str], str]
"""Function from the text of a file to its edited text."""


def _edits(fault: str, noted: list[str], document: Mapping[str, Any]) -> Iterator[tuple[Change, Edit]]:
    """Changes that messages about a document ask for, each with its edit of the text."""
    for message in filter(None, (fault, *noted)):
        yield from _edit_of(message, document)


def _edit_of(message: str, document: Mapping[str, Any]) -> Iterator[tuple[Change, Edit]]:
    if missing := _MISSING.match(message):
        above = missing["path"].rpartition(".")
        path = path_of("".join((*above[:2], missing["former"])), document)
        if path is not None and missing["former"] in present_names("word"):
            yield _renaming(path, above[2])
        return
    named = _FIELD.match(message)
    path = path_of(named["path"], document) if named else None
    if named is None or path is None:
        return
    field, key, value = named["path"], str(path[-1]), value_at(document, path)
    if now := _NOW.search(message):
        is_key = key in present_names("word") and value not in (*present_names("word"),)
        yield from _replacement(path, now, shown(value), is_key=is_key)
    elif law := _LAW.search(message):
        yield _renaming(path, "law", law["law"])
    elif flies := _FLIES.search(message):
        change = Change(field=field, before=shown(value), now=shown(flies["now"]))
        yield change, lambda text: set_value(text, path, flies["now"])
    elif stated := _STATED.search(message):
        option, number = stated["option"], float(stated["value"])
        change = Change(
            field=field, before=shown(value), now=f"{option} = {number} beside it, the former gains are gone"
        )
        yield change, lambda text: add_key(text, path, option, number)
    elif any(words in message for words in _GONE):
        reason = message.partition(": ")[2]
        for words in ("is gone; ", "leave it out: ", "must be left out; "):
            reason = reason.removeprefix(words)
        disabled = key == "shift_bandwidth" and value == 0.0
        now_is = "preview = 0.0" if disabled else f"left out: {reason}"
        change = Change(field=field, before=shown(value), now=now_is)
        if disabled and "preview" not in value_at(document, path[:-1]):
            yield change, lambda text: set_value(rename_key(text, path, "preview"), (*path[:-1], "preview"), 0.0)
        else:
            yield change, lambda text: leave_out(text, path)


def _renaming(path: TomlPath, new: str, value: str = "") -> tuple[Change, Edit]:
    field = path_text(path)
    now = f"{new} = {shown(value)}" if value else new
    return Change(field=field, before=str(path[-1]), now=now), lambda text: rename_key(text, path, new)


def _replacement(path: TomlPath, now: re.Match[str], former: str, *, is_key: bool) -> Iterator[tuple[Change, Edit]]:
    """Edit that renames a key of an earlier version, or replaces a value and adds the options that belong to it."""
    new = now["now"]
    if is_key or now["value"]:
        value = tomllib.loads(f"x = {now['value']}")["x"] if now["value"] else None

        def edit_key(text: str) -> str:
            named = rename_key(text, path, new)
            return named if value is None else set_value(named, (*path[:-1], new), value)

        told = new if value is None else f"{new} = {now['value']}"
        yield Change(field=path_text(path), before=str(path[-1]), now=told), edit_key
        return
    options = tomllib.loads(now["options"].replace(" and ", "\n")) if now["options"] else {}

    def edit(text: str) -> str:
        text = set_value(text, path, new)
        for option, value in reversed(options.items()):
            text = add_key(text, path, option, value)
        return text

    yield Change(field=path_text(path), before=former, now=now[0].removeprefix("is now ").rstrip(";")), edit


def _upgrade_python(path: Path, text: str) -> Upgrade:
    """Replace former names of modules and classes of the library in a Python file."""
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError) as error:
        raise ValueError(f"{path}: must be Python ({one_line(str(error))})") from None
    names = present_names("module")
    rows, changes, notes = text.splitlines(keepends=True), list[Change](), list[str]()
    whole = re.compile(rf"(?<![\w.])({'|'.join(map(re.escape, sorted(names, key=len, reverse=True)))})(?!\w)")

    def present(found: re.Match[str]) -> str:
        now = names[found[0]]
        if not _PLAIN.fullmatch(now):
            notes.append(f"line {row + 1}: {found[0]} is now {now}")
            return found[0]
        changes.append(Change(field=f"line {row + 1}", before=found[0], now=now))
        return now

    for row, line in enumerate(rows):
        rows[row] = whole.sub(present, line)
    for node in ast.walk(tree):
        if not isinstance(node, ast.ImportFrom) or node.module != "skyarm":
            continue
        row = node.lineno - 1
        for each in node.names:
            now = names.get(f"skyarm.{each.name}")
            if now is None:
                continue
            if len(node.names) > 1 or not _PLAIN.fullmatch(now):
                notes.append(f"line {node.lineno}: skyarm.{each.name} is now {now}")
                continue
            home, _, name = now.rpartition(".")
            alias = "" if (each.asname or each.name) == name else f" as {each.asname or each.name}"
            before = ast.get_source_segment(text, node) or ""
            rows[row] = rows[row].replace(before, f"from {home} import {name}{alias}")
            changes.append(Change(field=f"line {node.lineno}", before=f"skyarm.{each.name}", now=now))
    return Upgrade(text="".join(rows), changes=tuple(changes), fault="", notes=tuple(notes))
