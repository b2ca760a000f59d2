"""Records as flat lists of scalars and back.

A record is a frozen dataclass or a tuple of records. Its *leaves* are the scalars that may vary; integers, strings,
booleans, None and enums are structure: they shape the program and are not leaves.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from enum import Enum
from functools import cache
from typing import Any, TypeVar

Record = TypeVar("Record")

_STRUCTURE = (int, str, bool, type(None), Enum)


def _map(record: Any, visit: Callable[[Any], Any]) -> Any:
    if isinstance(record, tuple):
        return tuple(_map(item, visit) for item in record)
    names = _names(type(record))  # type: ignore[arg-type]
    if names is not None:
        return type(record)(**{name: _map(getattr(record, name), visit) for name in names})
    return record if isinstance(record, _STRUCTURE) else visit(record)


def leaves(record: Any) -> list[Any]:
    """Scalars of a record in field order."""
    found: list[Any] = []

    def visit(leaf: Any) -> Any:
        found.append(leaf)
        return leaf

    _visit_only(record, visit)
    return found


def _visit_only(record: Any, visit: Callable[[Any], Any]) -> None:
    if isinstance(record, tuple):
        for item in record:
            _visit_only(item, visit)
    elif (names := _names(type(record))) is not None:  # type: ignore[arg-type]
        for name in names:
            _visit_only(getattr(record, name), visit)
    elif not isinstance(record, _STRUCTURE):
        visit(record)


@cache
def _names(kind: type) -> tuple[str, ...] | None:
    """Fields of a dataclass; None for any other type. Laws that are called with floats ask at every step."""
    return tuple(field.name for field in dataclasses.fields(kind)) if dataclasses.is_dataclass(kind) else None


def mismatch(example: Any, record: Any, path: str) -> str | None:
    """Describe where ``record`` has another structure than ``example``; None where they have the same."""
    if isinstance(example, tuple) and isinstance(record, tuple) and len(example) == len(record):
        pairs = [(a, b, f"{path}[{i}]") for i, (a, b) in enumerate(zip(example, record, strict=True))]
    elif dataclasses.is_dataclass(example) and type(example) is type(record):
        names = [field.name for field in dataclasses.fields(example)]
        pairs = [(getattr(example, name), getattr(record, name), f"{path}.{name}") for name in names]
    else:
        kinds = (*_STRUCTURE, tuple)
        shaped = any(isinstance(one, kinds) or dataclasses.is_dataclass(one) for one in (example, record))
        same = type(example) is type(record) and example == record if shaped else True
        return None if same else f"{path} is {record!r}, not {example!r}"
    return next((found for a, b, name in pairs if (found := mismatch(a, b, name))), None)


def rebuild(template: Record, values: Iterator[Any]) -> Record:
    """Return the template with its leaves replaced, in order, by ``values``."""
    result: Record = _map(template, lambda _leaf: next(values))
    return result


def shaped_like(template: Record, values: Sequence[Any]) -> Record:
    """Return the template with exactly these leaves; raises ValueError when their number differs."""
    iterator = iter(values)
    count = len(leaves(template))
    if count != len(values):
        raise ValueError(f"{type(template).__name__} has {count} scalars, got {len(values)}")
    return rebuild(template, iterator)
