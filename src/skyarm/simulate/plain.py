"""Records as plain data that strict JSON holds, and a digest of it: what was flown, in a log that outlives the code."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
import math
from collections.abc import Mapping
from enum import Enum
from types import ModuleType
from typing import Any


def plain(value: Any) -> Any:
    """Any record as tables, lists, numbers, texts, true, false and null.

    A record becomes a table of its fields with its class under ``type``; a function becomes its name, with the values
    it was closed over if there are any; infinities and NaN become text. Integers stay integers: they are structure.
    """
    return _plain(value, ())


def digest(record: Any) -> str:
    """SHA-256 of plain data, in hexadecimal: the same for the same content, whatever the order of its tables."""
    return hashlib.sha256(_text(record).encode()).hexdigest()


def _text(record: Any) -> str:
    return json.dumps(record, sort_keys=True, separators=(",", ":"), allow_nan=False)


def _plain(value: Any, above: tuple[int, ...]) -> Any:
    """Plain data of a value; ``above`` are the ids of the objects it stands in."""
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else str(float(value))
    if id(value) in above:
        return "(itself)"  # an object that refers to itself, as a recursive inner function does
    above = (*above, id(value))
    if isinstance(value, Mapping):
        return {str(key): _plain(each, above) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(each, above) for each in value]
    if isinstance(value, (set, frozenset)):
        return sorted((_plain(each, above) for each in value), key=_text)
    if hasattr(value, "tolist"):  # NumPy's and JAX's arrays and scalars
        return _plain(value.tolist(), above)
    if isinstance(value, functools.partial):
        parts = {"function": value.func, "arguments": value.args, "keywords": value.keywords}
        return {"type": "partial"} | {name: _plain(each, above) for name, each in parts.items()}
    if hasattr(value, "__name__"):
        bound = _bound(value)
        return {"type": "function", "name": _name(value), "bound": _plain(bound, above)} if bound else _name(value)
    return {"type": _name(type(value))} | {name: _plain(each, above) for name, each in _fields(value)}


def _name(named: Any) -> str:
    """Name of a class or function; of one that is not ours with its module."""
    name = str(getattr(named, "__qualname__", named.__name__))
    module = str(getattr(named, "__module__", ""))
    return name if module == "skyarm" or module.startswith("skyarm.") else f"{module}.{name}"


def _fields(value: Any) -> list[tuple[str, Any]]:
    """Names and values of an object's fields."""
    if dataclasses.is_dataclass(value):
        return [(field.name, getattr(value, field.name)) for field in dataclasses.fields(value)]
    slots = [name for kind in type(value).__mro__ for name in getattr(kind, "__slots__", ())]
    return [*getattr(value, "__dict__", {}).items(), *((name, getattr(value, name, None)) for name in slots)]


def _bound(function: Any) -> list[Any]:
    """Object a method is bound to, and values an inner function was closed over."""
    owner = getattr(function, "__self__", None)
    cells = getattr(function, "__closure__", None) or ()
    return [*([] if owner is None or isinstance(owner, ModuleType) else [owner]), *(c.cell_contents for c in cells)]
