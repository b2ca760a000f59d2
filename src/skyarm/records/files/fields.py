"""Reader of one table of a file, field by field."""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterable, Sequence
from itertools import islice
from typing import Any

from skyarm.records.files.messages import (
    comma_list,
    did_you_mean,
    must_be_one_of,
    shown,
)

_REQUIRED = object()

MOST_COMPARED = 1000
"""Largest number of keys of a table that are compared with a misspelt one, which takes
a twentieth of a second."""


class Fields:
    """Reader of a table: checks each value on access and raises an error for fields
    that were not read.

    Every error is a ValueError of one line: field, value, what is allowed. ``named``
    calls the tables of a list by their names: ``links[arm].mass``.
    """

    def __init__(self, table: object, where: str, named: bool = False) -> None:
        if not isinstance(table, dict):
            raise ValueError(f"{where} = {shown(table)}: must be a table")
        self.table, self.where, self._named = table, where, named
        self._asked: list[str] = []
        self._known: set[str] = set()

    def expect(self, names: Iterable[str]) -> None:
        """State the allowed keys of the table; none of them is then suggested as a
        misspelling of a missing key.
        """
        self._known.update(names)

    def at(self, name: str) -> str:
        """Full name of a field for error messages."""
        return f"{self.where}.{name}" if self.where else name

    def take(self, name: str, default: object = _REQUIRED) -> Any:
        """Value of a field of the table, without a check of its type; the field then
        counts as read.
        """
        self._asked.append(name)
        if name in self.table:
            return self.table[name]
        if default is not _REQUIRED:
            return default
        other = (
            word
            for word in self.table
            if word not in self._asked and word not in self._known
        )
        near = next(
            (
                word
                # compared the other way round: the misspelt key is in the table, the
                # right one is asked for
                for word in islice(other, MOST_COMPARED)
                if did_you_mean(word, [name])
            ),
            "",
        )
        there = f"is {near!r} a misspelling of it? " if near else ""
        there += (
            f"there are {comma_list(sorted(self.table))}"
            if self.table
            else "there are no fields"
        )
        raise ValueError(f"{self.at(name)}: is missing; {there}")

    def states(self, name: str) -> bool:
        """True if the table has a field, which then counts as read."""
        return self.take(name, None) is not None

    def require_schema(self) -> None:
        """Raise an error unless ``schema`` is 1 or left out."""
        schema = self.take("schema", 1)
        if schema != 1 or isinstance(schema, bool):
            raise ValueError(f"schema = {shown(schema)}: must be 1")

    def number(
        self,
        name: str,
        default: object = _REQUIRED,
        *,
        low: float = -math.inf,
        strict: bool = False,
        infinite: bool = False,
    ) -> float:
        """Read a number from a field of the table: finite by default, not below ``low``
        (above it if strict).
        """
        return number(
            self.take(name, default),
            self.at(name),
            low=low,
            strict=strict,
            infinite=infinite,
        )

    def vector(
        self, name: str, default: object = _REQUIRED
    ) -> tuple[float, float, float]:
        """Read three finite numbers from a field of the table."""
        return three_numbers(self.take(name, default), self.at(name))

    def numbers(
        self, name: str, *default: object, low: float = -math.inf
    ) -> tuple[float, ...]:
        """Read a list of finite numbers, none below ``low``, from a field of the
        table.
        """
        values, at = self.take(name, *default), self.at(name)
        if not isinstance(values, (list, tuple)):
            raise ValueError(f"{at} = {shown(values)}: must be a list of numbers")
        return tuple(
            number(value, f"{at}[{i}]", low=low) for i, value in enumerate(values)
        )

    def choice(
        self, name: str, options: tuple[str, ...], default: object = _REQUIRED
    ) -> str:
        """Read one of several allowed texts from a field of the table."""
        value = self.take(name, default)
        if value not in options:
            raise ValueError(
                f"{self.at(name)} = {shown(value)}: {must_be_one_of(options, value)}"
            )
        return str(value)

    def text(self, name: str, *default: str) -> str:
        """Read text from a field of the table; it must not be empty unless there is a
        default.
        """
        value = self.take(name, *default)
        if not isinstance(value, str) or (not value and not default):
            raise ValueError(
                f"{self.at(name)} = {shown(value)}: must be"
                f" text{'' if default else ' that is not empty'}"
            )
        return value

    def flag(self, name: str, *default: bool) -> bool:
        """Read true or false from a field of the table."""
        value = self.take(name, *default)
        if not isinstance(value, bool):
            raise ValueError(f"{self.at(name)} = {shown(value)}: must be true or false")
        return value

    def inner(self, name: str) -> Fields:
        """Reader of a nested table; a missing table counts as empty."""
        return Fields(self.take(name, {}), self.at(name), self._named)

    def tables(self, name: str) -> list[Fields]:
        """Return one `Fields` reader per table of a field that is a list of tables; []
        if the field is missing.
        """
        return list_of_tables(self.take(name, []), self.at(name), self._named)

    def done(self, beside: Sequence[str] = ()) -> None:
        """Raise an error if a field of the table was not read; ``beside`` lists fields
        that are read elsewhere.
        """
        names = [*dict.fromkeys([*self._asked, *beside])]
        for name, value in self.table.items():
            if name not in self._asked:
                allowed, meant = comma_list(names), did_you_mean(name, names)
                raise ValueError(
                    f"{self.at(name)} = {shown(value)}: unknown field; {meant}allowed:"
                    f" {allowed}"
                )


def list_of_tables(value: object, where: str, named: bool = False) -> list[Fields]:
    """Make a reader for each table in a list of tables, in order."""
    if not isinstance(value, list):
        hint = f", each below [[{where}]]" if isinstance(value, dict) else ""
        raise ValueError(f"{where} = {shown(value)}: must be a list of tables{hint}")
    names = [
        table.get("name") if named and isinstance(table, dict) else None
        for table in value
    ]
    called = [
        name if isinstance(name, str) and name else i for i, name in enumerate(names)
    ]
    return [
        Fields(table, f"{where}[{name}]", named)
        for table, name in zip(value, called, strict=True)
    ]


def filled_list(value: object, at: str, allowed: str, count: int = 0) -> list[Any]:
    """Check that a value is a list that is not empty, and of ``count`` entries if that
    is given.
    """
    # count 0 compares the length with itself
    if not isinstance(value, list) or not value or len(value) != (count or len(value)):
        raise ValueError(f"{at} = {shown(value)}: must be {allowed}")
    return value


def filled_text(value: object, at: str, allowed: str) -> str:
    """Check that a value is text that is not empty."""
    if not isinstance(value, str) or not value:
        raise ValueError(f"{at} = {shown(value)}: must be {allowed}")
    return value


def three_numbers(value: object, at: str) -> tuple[float, float, float]:
    """Check that a value is a list of three finite numbers."""
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        raise ValueError(f"{at} = {shown(value)}: must be three numbers")
    x, y, z = (number(item, f"{at}[{index}]") for index, item in enumerate(value))
    return x, y, z


def whole_number(value: object, at: str, low: int, high: int) -> int:
    """Check that a value of a file is a whole number from ``low`` to ``high``.

    Raises:
        ValueError: one line that begins with the place ``at``.
    """
    # not isinstance: True is an int to it
    if type(value) is not int or not low <= value <= high:
        raise ValueError(
            f"{at} = {shown(value)}: must be a whole number from {low} to {high}"
        )
    return value


def number(
    value: object,
    at: str,
    *,
    low: float = -math.inf,
    strict: bool = False,
    infinite: bool = False,
) -> float:
    """Check that a value is a number: finite by default, not below ``low`` (above it if
    strict).
    """
    # almost all values, without the slower checks that follow
    if type(value) is float and low < value < math.inf:
        return value
    try:  # NumPy's numbers are Real too
        converted = (
            math.nan
            if isinstance(value, bool) or not isinstance(value, numbers.Real)
            else float(value)
        )
    except OverflowError:  # a whole number beyond 1e308
        converted = math.inf
    if math.isnan(converted) or (math.isinf(converted) and not infinite):
        raise ValueError(
            f"{at} = {shown(value)}: must be a"
            f" {'number' if infinite else 'finite number'}"
        )
    if converted < low or (strict and converted == low):
        raise ValueError(
            f"{at} = {shown(value)}: must be {'above' if strict else 'at least'}"
            f" {low:g}"
        )
    return converted
