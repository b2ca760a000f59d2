"""One table of a file, read field by field."""

from __future__ import annotations

import math
import numbers
from typing import Any

from skyarm.files.one_line import listed, shown
from skyarm.files.suggestions import did_you_mean, must_be_one_of

_REQUIRED: Any = object()


class Fields:
    """Reader of a table: checks each value it hands out, and refuses by name what nobody asked for.

    Every error is a ValueError of one line: field, value, what is allowed.
    """

    def __init__(self, table: Any, where: str) -> None:
        if not isinstance(table, dict):
            raise ValueError(f"{where} = {shown(table)}: must be a table")
        self.table, self.where = table, where
        self._asked: list[str] = []

    def at(self, name: str) -> str:
        """Name of a field as messages show it."""
        return f"{self.where}.{name}" if self.where else name

    def take(self, name: str, default: Any = _REQUIRED) -> Any:
        """Raw value of a field."""
        self._asked.append(name)
        if name in self.table:
            return self.table[name]
        if default is _REQUIRED:
            there = listed(sorted(self.table)) if self.table else "no fields"
            meant = did_you_mean(name, self.table)
            raise ValueError(f"{self.at(name)}: is missing; {meant}there are {there}")
        return default

    def number(
        self,
        name: str,
        default: Any = _REQUIRED,
        *,
        low: float = -math.inf,
        strict: bool = False,
        infinite: bool = False,
    ) -> float:
        """Check a number: finite unless told otherwise, not below ``low`` (above it if strict)."""
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

    def done(self) -> None:
        """Refuse fields that were not asked for."""
        for name in self.table:
            if name not in self._asked:
                meant = did_you_mean(name, self._asked)
                value = shown(self.table[name])
                raise ValueError(
                    f"{self.at(name)} = {value}: unknown field; {meant}allowed: {listed(dict.fromkeys(self._asked))}"
                )


def number(value: Any, at: str, *, low: float = -math.inf, strict: bool = False, infinite: bool = False) -> float:
    """Check a number: finite unless told otherwise, not below ``low`` (above it if strict)."""
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
