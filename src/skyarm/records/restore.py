"""Restore dataclasses from plain data, bit for bit.

Plain data names classes and functions and never brings any: they are found in this
package or in plugins that are loaded (:mod:`skyarm.records.registry.registrations`).
Only frozen dataclasses are made, and only functions of laws are taken. A field whose
metadata says ``restored = False``, as the path of a program, has its default instead.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from enum import Enum
from typing import Any

from skyarm.records.files import shown
from skyarm.records.immutable import declarations
from skyarm.records.leaves import field_names
from skyarm.records.members import SOLE
from skyarm.records.plain import (
    NOT_FINITE,
    dotted_name,
    group_of,
    plain,
    written_if_any,
)
from skyarm.records.registry.plugins import code_of

FUNCTIONS = ("skyarm.control.", "skyarm.links.autopilots.autopilot:move_arm")
"""Prefixes of this package's functions that a record may contain: control laws, their
bounds and an autopilot's joint law."""


class RestoreError(ValueError):
    """Error: a dataclass cannot be restored from plain data."""


Table = dict[str, Any]
"""Table of plain data from outside; :func:`_restore` reports entries of the wrong
type."""


def restore(data: object, plugins: Mapping[str, str] | None = None) -> Any:
    """Restore nested dataclasses from the output of :func:`skyarm.records.plain.plain`;
    lists become tuples.

    Args:
        data: plain data.
        plugins: name -> identity of the plugins that were loaded when it was written.

    Raises:
        ValueError: one line: what is no plain data of a record, a function that only
            its maker could make again, a plugin that is not loaded, or a value that the
            record's class refuses.
    """
    try:
        return _restore(data, plugins or {}, "")
    except RecursionError:
        raise RestoreError(
            f"record = {shown(data)}: must not be nested so deep"
        ) from None


def _restore(data: object, plugins: Mapping[str, str], where: str) -> Any:
    # strict JSON has no inf and no nan, so they are texts in plain data
    if isinstance(data, str):
        return float(data) if data in NOT_FINITE else data
    if isinstance(data, list):
        return tuple(
            _restore(each, plugins, f"{where}[{i}]") for i, each in enumerate(data)
        )
    if not isinstance(data, dict):
        return data
    if "type" not in data:
        return _each(data, plugins, where)
    kind = data["type"]
    if not isinstance(kind, str):
        raise RestoreError(f"{where or 'record'}.type = {shown(kind)}: must be a name")
    try:
        # an unknown type is that of a record
        reader = _READERS.get(kind)
        return (
            _record(data, plugins, where)
            if reader is None
            else reader(data, plugins, where)
        )
    except (KeyError, TypeError, AttributeError, OverflowError) as error:
        raise RestoreError(
            f"{where or 'record'} = {shown(data)}: must be a record that was written"
            f" ({error})"
        ) from None


def _each(table: Table, plugins: Mapping[str, str], where: str) -> dict[str, object]:
    return {
        key: _restore(value, plugins, f"{where}.{key}" if where else key)
        for key, value in table.items()
    }


def _record(data: Table, plugins: Mapping[str, str], where: str) -> object:
    """Restore an instance of a frozen dataclass, whose fields must match exactly."""
    kind = code_of(data["type"], plugins)
    names = (
        field_names(kind)
        # the class that is found must be the one that was named, not another under an
        # alias
        if isinstance(kind, type) and dotted_name(kind) == data["type"]
        else None
    )
    # records are frozen dataclasses; a file may name no other class
    if names is None or not kind.__dataclass_params__.frozen:
        raise RestoreError(
            f"{where or 'record'}: {data['type']} is no frozen dataclass, it cannot be"
            " read back"
        )
    table = {key: value for key, value in data.items() if key != "type"}
    # a sole vehicle stands under its short name in records
    if (group := group_of(kind)) and group[1] in table:
        table[group[0]] = {SOLE: table.pop(group[1])}
    # fields that are written only if not empty may be missing
    odd = sorted((set(table) ^ set(names)) - set(written_if_any(kind)))
    if odd:
        raise RestoreError(
            f"{where or 'record'}: {data['type']} was written by another version"
            f" ({', '.join(odd)})"
        )
    taken = [
        field
        for field in declarations(kind)
        if field.init and field.metadata.get("restored", True)
    ]
    fields = [field.name for field in taken if field.name in table]
    return kind(**_each({name: table[name] for name in fields}, plugins, where))


def _function(data: Table, plugins: Mapping[str, str], where: str) -> object:
    """Restore a reference to a function of a module or a method of a record."""
    name = data["name"]
    # <locals> and <lambda> cannot be found by name
    if "<" in name:
        raise RestoreError(
            f"{where or 'record'}: {name} was made inside a function, it cannot be read"
            " back"
        )
    # a record from outside may name functions of laws only, none that reads or writes
    # files
    if name.startswith("skyarm.") and not name.startswith(FUNCTIONS):
        raise RestoreError(
            f"{where or 'record'} = {shown(name)}: must be a function of a law"
        )
    function = code_of(name, plugins)
    if "bound" in data and plain(function) != data:
        owner = _restore(data["bound"][0], plugins, where)
        function = getattr(owner, name.rpartition(".")[2])
    if not callable(function) or plain(function) != data:
        raise RestoreError(
            f"{where or 'record'}: {name} is another function than was written"
        )
    return function


def _partial(data: Table, plugins: Mapping[str, str], where: str) -> object:
    function, arguments, keywords = (
        _restore(data[part], plugins, where)
        for part in ("function", "arguments", "keywords")
    )
    return functools.partial(function, *arguments, **keywords)


def _array(data: Table, plugins: Mapping[str, str], where: str) -> object:
    import numpy as np

    if data["kind"] not in _ARRAYS:
        raise RestoreError(
            f"{where or 'record'}.kind = {shown(data['kind'])}: must be one of"
            f" {', '.join(_ARRAYS)}"
        )
    return np.array(_restore(data["entries"], plugins, where), dtype=data["kind"])


_ARRAYS = (
    "float64",
    "float32",
    "bool",
    *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)),
)


def _enum(data: Table, plugins: Mapping[str, str], where: str) -> object:
    kind = code_of(data["class"], plugins)
    if not (isinstance(kind, type) and issubclass(kind, Enum)):
        raise RestoreError(
            f"{where or 'record'} = {shown(data['class'])}: must be an enum"
        )
    return kind[data["name"]]


_READERS = {
    "text": lambda data, plugins, where: str(data["text"]),
    "table": lambda data, plugins, where: _each(data["entries"], plugins, where),
    "array": _array,
    "enum": _enum,
    "function": _function,
    "partial": _partial,
}
"""Readers of values that are not records: type -> function."""
