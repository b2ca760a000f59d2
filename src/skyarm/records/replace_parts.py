"""A part of a record by its place, and records with other values at some places."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from skyarm.records.leaves import Place


def part(record: Any, place: Place) -> Any:
    """What stands at a place."""
    for name in place:
        record = record[int(name)] if isinstance(record, tuple) else getattr(record, name)
    return record


def replaced(record: Any, values: Mapping[Place, Any]) -> Any:
    """The record with other values at some places, none of which lies inside another.

    Every record on the way is made, and checked, once: numbers that only together make sense are replaced together.
    """
    if () in values:
        return values[()]
    below: dict[str, dict[Place, Any]] = {}
    for place, value in values.items():
        below.setdefault(place[0], {})[place[1:]] = value
    if isinstance(record, tuple):
        return tuple(replaced(item, below[str(i)]) if str(i) in below else item for i, item in enumerate(record))
    return dataclasses.replace(
        record, **{name: replaced(getattr(record, name), inner) for name, inner in below.items()}
    )
