"""One table of a file, read field by field."""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

from skyarm.records.files.messages import comma_list, did_you_mean, must_be_one_of, shown

_REQUIRED: Any = object()

_Wrong = dict[tuple[str, str], str]
"""(table, word of it) -> line about it."""

_wrong_words: ContextVar[_Wrong | None] = ContextVar("wrong_words", default=None)
"""Of the file that is being read."""


@contextmanager
def all_wrong_words() -> Iterator[None]:
    """Collect the unknown fields of all tables read inside into one error line.

    They are reported before any other error, which one of them may have caused.

    Raises:
        ValueError: as :meth:`Fields.done` raises it for one.
    """
    found: _Wrong = {}
    token = _wrong_words.set(found)
    try:
        yield
    except ValueError:
        if not found:
            raise
    finally:
        _wrong_words.reset(token)
    if found:
        raise ValueError("; ".join(found.values()))


class Fields:
    """Reader of a table: checks each value on access, and refuses unread fields by name.

    Every error is a ValueError of one line: field, value, what is allowed. ``named`` calls the tables of a list by
    their names: ``links[arm].mass``.
    """

    def __init__(self, table: Any, where: str, named: bool = False) -> None:
        if not isinstance(table, dict):
            raise ValueError(f"{where} = {shown(table)}: must be a table")
        self.table, self.where, self._named = table, where, named
        self._asked: list[str] = []
        self._stands_for: dict[str, str] = {}  # a word of the file -> the required field that it may have meant

    def at(self, name: str) -> str:
        """Name of a field as messages show it."""
        return f"{self.where}.{name}" if self.where else name

    def take(self, name: str, default: Any = _REQUIRED) -> Any:
        """Raw value of a field."""
        self._asked.append(name)
        if name in self._stands_for:  # a word of its own after all
            raise self._missing(self._stands_for[name])
        if name in self.table:
            return self.table[name]
        if default is not _REQUIRED:
            return default
        unread = [word for word in self.table if word not in self._asked]
        meant = next((word for word in unread if did_you_mean(word, [name])), None)
        wrong = _wrong_words.get()
        if meant is None or wrong is None:
            raise self._missing(name)
        self._stands_for[meant] = name
        self._asked.append(meant)
        wrong[self.where, meant] = self._unknown_field(meant, [name])
        return self.table[meant]

    def _missing(self, name: str) -> ValueError:
        there = comma_list(sorted(self.table)) if self.table else "no fields"
        if (wrong := _wrong_words.get()) is not None:
            for word in self._stands_for:
                wrong.pop((self.where, word), None)
        return ValueError(f"{self.at(name)}: is missing; there are {there}")

    def _unknown_field(self, name: str, known: Iterable[str]) -> str:
        allowed, meant = comma_list(dict.fromkeys(known)), did_you_mean(name, known)
        return f"{self.at(name)} = {shown(self.table[name])}: unknown field; {meant}allowed: {allowed}"

    def number(
        self,
        name: str,
        default: Any = _REQUIRED,
        *,
        low: float = -math.inf,
        strict: bool = False,
        infinite: bool = False,
    ) -> float:
        """Check a number: finite by default, not below ``low`` (above it if strict)."""
        return number(self.take(name, default), self.at(name), low=low, strict=strict, infinite=infinite)

    def vector(self, name: str, default: Any = _REQUIRED) -> tuple[float, float, float]:
        """Three finite numbers."""
        value, at = self.take(name, default), self.at(name)
        if not isinstance(value, (list, tuple)) or len(value) != 3:
            raise ValueError(f"{at} = {shown(value)}: must be three numbers")
        x, y, z = (number(item, f"{at}[{index}]") for index, item in enumerate(value))
        return x, y, z

    def numbers(self, name: str, *default: Any, low: float = -math.inf) -> tuple[float, ...]:
        """A list of finite numbers, none below ``low``."""
        values, at = self.take(name, *default), self.at(name)
        if not isinstance(values, (list, tuple)):
            raise ValueError(f"{at} = {shown(values)}: must be a list of numbers")
        return tuple(number(value, f"{at}[{i}]", low=low) for i, value in enumerate(values))

    def choice(self, name: str, options: tuple[str, ...], default: Any = _REQUIRED) -> str:
        """One of several words."""
        value = self.take(name, default)
        if value not in options:
            raise ValueError(f"{self.at(name)} = {shown(value)}: {must_be_one_of(options, value)}")
        return str(value)

    def text(self, name: str, *default: str) -> str:
        """Text; not empty where there is no default."""
        value = self.take(name, *default)
        if not isinstance(value, str) or (not value and not default):
            raise ValueError(f"{self.at(name)} = {shown(value)}: must be text{'' if default else ' that is not empty'}")
        return value

    def flag(self, name: str, *default: bool) -> bool:
        """True or false."""
        value = self.take(name, *default)
        if not isinstance(value, bool):
            raise ValueError(f"{self.at(name)} = {shown(value)}: must be true or false")
        return value

    def inner(self, name: str) -> Fields:
        """Reader of a table within this one; of an empty table where it is left out."""
        return Fields(self.take(name, {}), self.at(name), self._named)

    def tables(self, name: str) -> list[Fields]:
        """Readers of a list of tables; none where it is left out."""
        return list_of_tables(self.take(name, []), self.at(name), self._named)

    def done(self) -> None:
        """Refuse fields that were not read, at once or with the other wrong words of the file."""
        wrong = _wrong_words.get()
        known = [name for name in self._asked if name not in self._stands_for]
        for name in self.table:
            if name in known:
                continue
            line = self._unknown_field(name, known)
            if wrong is None:
                raise ValueError(line)
            wrong[self.where, name] = line


def list_of_tables(value: Any, where: str, named: bool = False) -> list[Fields]:
    """Readers of a list of tables, in order."""
    if not isinstance(value, list):
        raise ValueError(f"{where} = {shown(value)}: must be a list of tables")
    names = [table.get("name") if named and isinstance(table, dict) else None for table in value]
    called = [name if isinstance(name, str) and name else i for i, name in enumerate(names)]
    return [Fields(table, f"{where}[{name}]", named) for table, name in zip(value, called, strict=True)]


def number(value: Any, at: str, *, low: float = -math.inf, strict: bool = False, infinite: bool = False) -> float:
    """Check a number: finite by default, not below ``low`` (above it if strict)."""
    if isinstance(value, bool) or not isinstance(value, numbers.Real):  # NumPy's numbers are Real too
        raise ValueError(f"{at} = {shown(value)}: must be a {'number' if infinite else 'finite number'}")
    try:
        held = float(value)
    except OverflowError:  # a whole number beyond 1e308
        held = math.inf
    if math.isnan(held) or (math.isinf(held) and not infinite):
        raise ValueError(f"{at} = {shown(value)}: must be a {'number' if infinite else 'finite number'}")
    if held < low or (strict and held == low):
        raise ValueError(f"{at} = {shown(value)}: must be {'above' if strict else 'at least'} {low:g}")
    return held
