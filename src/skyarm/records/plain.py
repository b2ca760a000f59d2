"""Dataclasses as plain data for strict JSON, and a digest of such data."""

from __future__ import annotations

import functools
import hashlib
import json
import math
from collections.abc import Mapping
from enum import Enum
from types import ModuleType
from typing import Any, Protocol, TypeAlias

from skyarm.records.files.user_code import closed_over
from skyarm.records.immutable import UNWRITTEN, declarations, memoize
from skyarm.records.leaves import field_names
from skyarm.records.members import SOLE, alone

NOT_FINITE = ("inf", "-inf", "nan")
"""Texts of the floats that strict JSON cannot represent."""

Plain: TypeAlias = bool | int | float | str | list["Plain"] | dict[str, "Plain"] | None
"""Value that strict JSON can represent."""


class Named(Protocol):
    """Interface (typing.Protocol) of an object with a name, such as a class or
    function.
    """

    @property
    def __name__(self) -> str: ...


def plain(value: object) -> Any:
    """Convert nested dataclasses to plain data: tables, lists, numbers, texts, true,
    false, null.

    A record becomes a table of its fields with its class, by module and name, under
    ``type``. Functions, arrays, enums and tables that have a ``type`` of their own are
    tables with a type, too. Infinities and NaN become text, and texts that look like
    them tables. Integers stay integers: they are structure. What holds traced programs,
    such as an environment, is its type alone.
    """
    return _plain(value, ())


def digest(record: object) -> str:
    """SHA-256 digest of plain data, in hexadecimal, independent of the order of
    keys.
    """
    return hashlib.sha256(_text(record).encode()).hexdigest()


def _text(record: object) -> str:
    return json.dumps(record, sort_keys=True, separators=(",", ":"), allow_nan=False)


def _plain(value: object, above: tuple[int, ...]) -> Plain:
    """Convert any value to plain data; ``above`` are the ids of the objects that
    contain the value.
    """
    if value is None or (
        isinstance(value, (bool, str)) and not isinstance(value, Enum)
    ):
        # a text that reads inf would come back as a float
        return {"type": "text", "text": value} if value in NOT_FINITE else value
    if isinstance(value, Enum):
        return {"type": "enum", "class": dotted_name(type(value)), "name": value.name}
    # the bool case was taken above, since True is an int
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else str(float(value))
    if id(value) in above:
        # an object that refers to itself, as a recursive inner function does
        return "(itself)"
    above = (*above, id(value))
    if isinstance(value, (Mapping, list, tuple, set, frozenset)) or hasattr(
        value, "tolist"
    ):
        return _several(value, above)
    if isinstance(value, functools.partial):
        parts = {
            "function": value.func,
            "arguments": value.args,
            "keywords": value.keywords,
        }
        return {"type": "partial"} | {
            name: _plain(each, above) for name, each in parts.items()
        }
    # only what the closure holds tells two functions of one name apart
    if hasattr(value, "__name__"):
        bound = _bound(value)
        called: dict[str, Plain] = {"type": "function", "name": dotted_name(value)}
        return called | ({"bound": _plain(bound, above)} if bound else {})
    return {
        "type": dotted_name(type(value)),
        **{name: _plain(each, above) for name, each in fields_of(value)},
    }


def _several(value: Any, above: tuple[int, ...]) -> Plain:
    """Convert a container or array to plain data."""
    if isinstance(value, Mapping):
        table = {str(key): _plain(each, above) for key, each in value.items()}
        return {"type": "table", "entries": table} if "type" in table else table
    if isinstance(value, (list, tuple)):
        return [_plain(each, above) for each in value]
    if isinstance(value, (set, frozenset)):
        # a set has no order, a digest needs one
        return sorted((_plain(each, above) for each in value), key=_text)
    entries = _plain(value.tolist(), above)  # NumPy's and JAX's arrays and scalars
    return (
        {"type": "array", "kind": str(value.dtype), "entries": entries}
        if value.ndim
        else entries
    )


def dotted_name(named: type | Named) -> str:
    """Module and name of a class or function, as ``skyarm.algebra.vector:Vec3``."""
    module = getattr(named, "__module__", "")
    return f"{module}:{getattr(named, '__qualname__', named.__name__)}"


def fields_of(value: object) -> list[tuple[str, object]]:
    """Names and values of an object's fields; none of what holds traced programs."""
    names = field_names(type(value))
    if names is not None:
        fields = [(name, getattr(value, name)) for name in names]
        unwritten, group = written_if_any(type(value)), group_of(type(value))
        # a sole vehicle is written as before groups had names, so that older digests
        # stay
        if group and tuple(dict(fields)[group[0]]) == (SOLE,):
            fields = [
                (group[1], each[SOLE]) if name == group[0] else (name, each)
                for name, each in fields
            ]
        return [
            (n, each)
            for n, each in fields
            if n not in unwritten or (each and each != unwritten[n])
        ]
    if type(value).__module__.startswith(OF_PROGRAMS):
        return []
    slots = [
        name for kind in type(value).__mro__ for name in getattr(kind, "__slots__", ())
    ]
    return [
        # slots of all bases, since a subclass lists its own only
        *getattr(value, "__dict__", {}).items(),
        *((name, getattr(value, name, None)) for name in slots),
    ]


OF_PROGRAMS = ("skyarm.compile.", "skyarm.simulate.", "skyarm.envs.")
"""Rooms whose objects that are no records are written by their type alone, as an
environment in a closure: the nodes of the programs that they hold lead to each other in
more ways than can be walked."""


@memoize
def written_if_any(kind: type) -> dict[str, object]:
    """Fields of a dataclass that plain data contains only if their values are neither
    empty nor those given here.
    """
    every = ((field.name, field.metadata) for field in declarations(kind))
    return {
        name: metadata[UNWRITTEN] for name, metadata in every if UNWRITTEN in metadata
    }


@memoize
def group_of(kind: type) -> tuple[str, str] | tuple[()]:
    """Field of a dataclass that holds members by name, and the name of its only member;
    empty without such a field.
    """
    return next(
        ((field.name, alone(field)) for field in declarations(kind) if alone(field)), ()
    )


def _bound(function: object) -> list[object]:
    """Object of a bound method, or variables captured by a function, which distinguish
    it in a digest.
    """
    owner = getattr(function, "__self__", None)
    # the owner of a built-in function is its module, which distinguishes nothing
    return [
        *([] if owner is None or isinstance(owner, ModuleType) else [owner]),
        *closed_over(function),
    ]
