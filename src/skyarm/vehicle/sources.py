"""Where the numbers of a vehicle's file come from: the table ``[sources]`` against the fields it speaks of.

A key is a dotted path, ``base.mass`` or ``links.upper.joint.damping``; the names of array entries may be left out
(``links.joint.damping`` speaks of every link), and a key speaks of all that stands below it (``rotor_defaults``).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from skyarm.vehicle.check import refuse

Step = tuple[str, bool]
"""A key of a table, or the name of an array's entry (True)."""


def fields(document: Mapping[str, Any]) -> Iterator[tuple[tuple[Step, ...], Any]]:
    """Path and value of every field that is no table; an array of numbers is one field."""
    for key, value in document.items():
        if key not in ("schema", "sources"):
            yield from _below(((key, False),), value)


def _below(path: tuple[Step, ...], value: Any) -> Iterator[tuple[tuple[Step, ...], Any]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _below((*path, (key, False)), inner)
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for index, inner in enumerate(value):
            yield from _below((*path, (str(inner.get("name", index)), True)), inner)
    else:
        yield path, value


def speaks_of(key: str, path: Sequence[Step]) -> bool:
    """True if a key of ``[sources]`` covers the field at a path."""
    parts = key.split(".")
    full = [text for text, _ in path]
    unnamed = [text for text, is_name in path if not is_name]
    return full[: len(parts)] == parts or unnamed[: len(parts)] == parts


def check_keys(document: Mapping[str, Any], sources: Mapping[str, str]) -> None:
    """Refuse a key that speaks of no field of the file, and an empty source."""
    paths = [path for path, _ in fields(document)]
    for key, text in sources.items():
        if not any(speaks_of(key, path) for path in paths):
            refuse(f"sources.{key}", text, "must speak of a field of this file (a dotted path)")
        if not text.strip():
            refuse(f"sources.{key}", text, "must say where the number comes from")


def without_source(document: Mapping[str, Any]) -> list[str]:
    """Numeric fields that no key of ``[sources]`` covers, as dotted paths."""
    keys = list(document.get("sources", {}))
    return [
        ".".join(text for text, _ in path)
        for path, value in fields(document)
        if _numeric(value) and not any(speaks_of(key, path) for key in keys)
    ]


def _numeric(value: Any) -> bool:
    if isinstance(value, list):
        return bool(value) and all(_numeric(item) for item in value)
    return isinstance(value, (int, float)) and not isinstance(value, bool)
