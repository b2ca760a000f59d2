"""Conversion between records and flat lists of scalars.

A record is a frozen dataclass or a tuple of records. Its *leaves* are the scalars that may vary; integers, strings,
booleans, None and enums are structure: they shape the program and are not leaves.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from enum import Enum
from functools import cache
from typing import Any, TypeVar

from skyarm.algebra.scalars import where

Record = TypeVar("Record")

_STRUCTURE = (int, str, bool, type(None), Enum)

Place = tuple[str, ...]
"""Field names and item numbers that lead from one record to a part of it."""


def _map(record: object, visit: Callable[[Any], Any]) -> Any:
    if isinstance(record, tuple):
        return tuple(_map(item, visit) for item in record)
    names = field_names(type(record))
    if names is not None:
        return type(record)(**{name: _map(getattr(record, name), visit) for name in names})
    return record if isinstance(record, _STRUCTURE) else visit(record)


def leaves(record: object) -> list[Any]:
    """Variable scalars of a record in field order, as a flat list."""
    found: list[Any] = []

    def visit(leaf: object) -> Any:
        found.append(leaf)
        return leaf

    _visit_only(record, visit)
    return found


def _visit_only(record: object, visit: Callable[[Any], Any]) -> None:
    if isinstance(record, tuple):
        for item in record:
            _visit_only(item, visit)
    elif (names := field_names(type(record))) is not None:
        for name in names:
            _visit_only(getattr(record, name), visit)
    elif not isinstance(record, _STRUCTURE):
        visit(record)


def _field_names(kind: type) -> tuple[str, ...] | None:
    return tuple(field.name for field in dataclasses.fields(kind)) if dataclasses.is_dataclass(kind) else None


field_names: Callable[[type], tuple[str, ...] | None] = cache(_field_names)
"""Fields of a dataclass; None for any other type. Laws that are called with floats ask at every step."""


def is_record(value: object) -> bool:
    """True if a value is an instance of a record class."""
    return field_names(type(value)) is not None


def is_leaf(value: object) -> bool:
    """True if a value is a variable scalar; False if it is a constant that compiled code contains."""
    return not isinstance(value, _STRUCTURE)


def parts(record: object) -> dict[str, Any]:
    """Direct parts of a value by name: fields of a record or items of a tuple; empty for a scalar."""
    if isinstance(record, tuple):
        return {str(i): item for i, item in enumerate(record)}
    return {name: getattr(record, name) for name in field_names(type(record)) or ()}


def walk(record: object, place: Place = ()) -> Iterator[tuple[Place, Any]]:
    """Field path and value of every number, text or other innermost value of a record, constants included.

    The leaves among them, which :func:`is_leaf` tells, come in the order of :func:`leaves`.
    """
    if isinstance(record, tuple) or is_record(record):
        for name, value in parts(record).items():
            yield from walk(value, (*place, name))
    else:
        yield place, record


def pairs(example: object, record: object, path: str) -> list[tuple[Any, Any, str]] | None:
    """Direct parts of two records in pairs, each with its path; None if the records differ in structure."""
    if isinstance(example, tuple) and isinstance(record, tuple) and len(example) == len(record):
        return [(a, b, f"{path}[{i}]") for i, (a, b) in enumerate(zip(example, record, strict=True))]
    if type(example) is type(record) and (names := field_names(type(example))) is not None:
        return [(getattr(example, name), getattr(record, name), f"{path}.{name}") for name in names]
    return None


def mismatch(example: object, record: object, path: str) -> str | None:
    """Message on where ``record`` differs in structure from ``example``; None if they have the same structure."""
    below = pairs(example, record, path)
    if below is None:
        kinds = (*_STRUCTURE, tuple)
        shaped = any(isinstance(one, kinds) or is_record(one) for one in (example, record))
        same = type(example) is type(record) and example == record if shaped else True
        return None if same else f"{path} is {record!r}, not {example!r}"
    return next((found for a, b, name in below if (found := mismatch(a, b, name))), None)


def named_leaves(record: object, where: str = "") -> Iterator[tuple[str, Any]]:
    """Path and value of every variable scalar of a record, in the order of :func:`leaves`."""
    return ((path, value) for path, value in named_parts(record, where) if is_leaf(value))


def named_parts(record: object, where: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted path and value of every innermost value of a record, constants included, in field order."""
    for place, value in walk(record):
        yield f"{where}{''.join(f'[{i}]' if i.isdigit() else f'.{i}' for i in place)}".removeprefix("."), value


def rebuild(template: Record, values: Iterator[Any]) -> Record:
    """Return a copy of the template with its scalars replaced, in order, by ``values``."""
    result: Record = _map(template, lambda _leaf: next(values))
    return result


def shaped_like(template: Record, values: Sequence[Any]) -> Record:
    """Return a copy of the template with the given scalars; raises ValueError if their number differs."""
    iterator = iter(values)
    count = len(leaves(template))
    if count != len(values):
        raise ValueError(f"{type(template).__name__} has {count} scalars, got {len(values)}")
    return rebuild(template, iterator)


def part(record: object, place: Place) -> Any:
    """Value that is found in a record along a path of field names and indices."""
    for name in place:
        record = record[int(name)] if isinstance(record, tuple) else getattr(record, name)
    return record


def replace_at(record: Any, values: Mapping[Place, Any]) -> Any:
    """Record with the values at some field paths replaced; no path may be a prefix of another.

    Every record on the way is made, and checked, once: numbers that only together make sense are replaced together.
    """
    if () in values:
        return values[()]
    below: dict[str, dict[Place, Any]] = {}
    for place, value in values.items():
        below.setdefault(place[0], {})[place[1:]] = value
    if isinstance(record, tuple):
        return tuple(replace_at(item, below[str(i)]) if str(i) in below else item for i, item in enumerate(record))
    return dataclasses.replace(
        record, **{name: replace_at(getattr(record, name), inner) for name, inner in below.items()}
    )


def blend(condition: object, new: object, old: object) -> Any:
    """Select ``new`` where a condition holds, else ``old``, scalar by scalar; constants are those of ``old``."""
    values = (where(condition, a, b) for a, b in zip(leaves(new), leaves(old), strict=True))
    return rebuild(old, values)
