"""Edits of a TOML text by path: comments, order and blank lines of the rest stay as they are."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any

from skyarm.records.files.messages import shown
from skyarm.records.files.toml import toml_key, toml_value
from skyarm.records.immutable import immutable

TomlPath = tuple[str | int, ...]
"""Keys of tables and places in lists, from the top of a document."""

_KEYS = re.compile(r"""(\s*)((?:"(?:[^"\\]|\\.)*"|'[^']*'|[^="'#])+?)(\s*=\s*)""")
_PART = re.compile(r"([^.\[\]]+)|\[([^\]]*)\]")


@immutable
class _Statement:
    """Lines of a text that state one header or one key with its value."""

    lines: slice
    keys: tuple[str, ...]
    """Keys that are written in these lines, left to right."""
    path: TomlPath
    """Path of the header's table, or of the key's value, from the top."""
    header: str = ""
    """Opening bracket of a header; empty for a key with a value."""


@dataclass(kw_only=True)
class _Tables:
    """Counts of the arrays of tables so far, which turn the keys of a TOML header into the path of its table."""

    counts: dict[TomlPath, int] = field(default_factory=dict)

    def path(self, keys: Sequence[str], *, opens: bool = False) -> TomlPath:
        """Path of the table that keys lead to; a new table of a list if it opens one."""
        found: TomlPath = ()
        for place, key in enumerate(keys):
            found = (*found, key)
            if opens and place == len(keys) - 1:
                self.counts[found] = self.counts.get(found, -1) + 1
            if found in self.counts:
                found = (*found, self.counts[found])
        return found


def path_of(text: str, document: object) -> TomlPath | None:
    """Path of a field as a message names it, ``phases[0].kind`` or ``links[arm].mass``; None if it is not there."""
    found: TomlPath = ()
    for key, inside in _PART.findall(text):
        if key:
            found, document = (*found, key), document.get(key) if isinstance(document, Mapping) else None
        elif isinstance(document, list):
            named = (i for i, each in enumerate(document) if isinstance(each, Mapping) and each.get("name") == inside)
            place = int(inside) if inside.isdecimal() else next(named, -1)
            if not 0 <= place < len(document):
                return None
            found, document = (*found, place), document[place]
        else:
            return None
        if document is None:
            return None
    return found or None


def rename_key(text: str, path: TomlPath, new: str) -> str:
    """TOML text with the key at the end of a path renamed.

    Raises:
        ValueError: one line: the path is not there, or the text is of a form that is not edited.
    """
    old = path[-1]

    def change(document: Any) -> None:
        table = value_at(document, path[:-1])
        table[new] = table.pop(old)

    def lines(statement: _Statement, text: str) -> str | None:
        if statement.path[: len(path)] != path:
            return None
        # number of keys of the path that stand above this statement
        above = sum(isinstance(key, str) for key in statement.path) - len(statement.keys)
        place = sum(isinstance(key, str) for key in path) - 1 - above
        if not 0 <= place < len(statement.keys):
            return None
        written = ".".join(toml_key(new if i == place else key) for i, key in enumerate(statement.keys))
        if statement.header:
            inside = re.match(r"(\s*\[+\s*).*?(\s*\]+\s*(?:#.*)?)$", text.rstrip("\n"), re.S)
            return f"{inside[1]}{written}{inside[2]}\n" if inside else None
        begin = _KEYS.match(text)
        return f"{begin[1]}{written}{begin[3]}{text[begin.end() :]}" if begin else None

    return _edit(text, path, change, lines)


def set_value(text: str, path: TomlPath, value: object) -> str:
    """TOML text with another value at a path.

    Raises:
        ValueError: one line: the path is not there, or the text is of a form that is not edited.
    """

    def change(document: Any) -> None:
        value_at(document, path[:-1])[path[-1]] = value

    def lines(statement: _Statement, text: str) -> str | None:
        return _with_value(text, value) if statement.path == path and not statement.header else None

    return _edit(text, path, change, lines)


def leave_out(text: str, path: TomlPath) -> str:
    """TOML text without the key at a path, its comment and its value.

    Raises:
        ValueError: one line: the path is not there, or the text is of a form that is not edited.
    """

    def change(document: Any) -> None:
        del value_at(document, path[:-1])[path[-1]]

    def lines(statement: _Statement, text: str) -> str | None:
        return "" if statement.path == path and not statement.header else None

    return _edit(text, path, change, lines)


def add_key(text: str, beside: TomlPath, key: str, value: object) -> str:
    """TOML text with a new key in the same table as the key at a path, on a line of its own below it.

    Raises:
        ValueError: one line: the path is not there, or the text is of a form that is not edited.
    """

    def change(document: Any) -> None:
        value_at(document, beside[:-1])[key] = value

    def lines(statement: _Statement, text: str) -> str | None:
        if statement.path != beside or statement.header:
            return None
        begin = _KEYS.match(text)
        if begin is None or len(statement.keys) > 1:
            return None
        return f"{text.rstrip(chr(10))}\n{begin[1]}{toml_key(key)} = {toml_value(value)}\n"

    return _edit(text, beside, change, lines)


def _edit(
    text: str,
    path: TomlPath,
    change: Callable[[Any], None],
    lines: Callable[[_Statement, str], str | None],
) -> str:
    """Apply an edit to the lines of its statements and prove by the parser that it did that and no more.

    A path inside of an inline value is edited by writing the whole value anew.
    """
    before = tomllib.loads(text)
    wanted = deepcopy(before)
    try:
        change(wanted)
    except (KeyError, IndexError, TypeError, AttributeError):
        raise ValueError(f"{shown(path_text(path))}: is not in the file") from None
    rows = text.splitlines(keepends=True)
    for statement in reversed([*_statements(text)]):
        own = "".join(rows[statement.lines])
        new = lines(statement, own)
        inside = statement.path == path[: len(statement.path)] and not statement.header
        if new is None and inside and len(path) > len(statement.path):
            new = _with_value(own, value_at(wanted, statement.path))
        if new is not None:
            rows[statement.lines] = [new]
    found = "".join(rows)
    try:
        right = tomllib.loads(found) == wanted
    except tomllib.TOMLDecodeError:
        right = False
    if not right:
        raise ValueError(f"{shown(path_text(path))}: is written in a form that only a person can change")
    return found


def path_text(path: TomlPath) -> str:
    """Path as messages name it, ``phases[0].kind``."""
    return "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in path).lstrip(".")


def value_at(document: Any, path: TomlPath) -> Any:
    """Table, list or value at a path."""
    for key in path:
        document = document[key]
    return document


def _with_value(text: str, value: object) -> str | None:
    """Lines of a key with another value; the comment after the old value stays."""
    begin = _KEYS.match(text)
    if begin is None:
        return None
    old, place = tomllib.loads(text), -1
    while (place := text.find("#", place + 1)) >= 0:
        try:
            if tomllib.loads(text[:place]) == old:
                break
        except tomllib.TOMLDecodeError:
            continue
    last = text[: place if place >= 0 else len(text)].rstrip()
    return f"{begin[0]}{toml_value(value)}{text[len(last) :]}"


def _statements(text: str) -> Iterator[_Statement]:
    """Headers and keys of a valid TOML text, top down."""
    rows, tables, row = text.splitlines(keepends=True), _Tables(), 0
    here: TomlPath = ()
    while row < len(rows):
        begin, line = row, rows[row].strip()
        row += 1
        if not line or line.startswith("#"):
            continue
        if line.startswith("["):
            keys = tuple(_chain(tomllib.loads(rows[begin])))
            bracket = "[[" if line.startswith("[[") else "["
            here = tables.path(keys, opens=bracket == "[[")
            yield _Statement(lines=slice(begin, row), keys=keys, path=here, header=bracket)
            continue
        while not _is_whole("".join(rows[begin:row])):
            row += 1
        own = "".join(rows[begin:row])
        match = _KEYS.match(own)
        keys = tuple(_chain(tomllib.loads(f"{match[2]} = 0"))) if match else ()
        yield _Statement(lines=slice(begin, row), keys=keys, path=(*here, *keys))


def _is_whole(text: str) -> bool:
    try:
        tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return False
    return True


def _chain(document: Any) -> Iterator[str]:
    """Keys of a document that holds one, from the outermost in."""
    while isinstance(document, (dict, list)) and document:
        if isinstance(document, list):
            document = document[0]
            continue
        ((key, document),) = document.items()
        yield key
