"""Digest of a scenario, by which stored results are matched with the scenario that is
loaded now.
"""

from __future__ import annotations

import functools
import sys
import types
from collections.abc import Iterable, Mapping
from enum import Enum
from pathlib import Path

from skyarm.records.files.user_code import (
    closed_over,
    codes_of,
    file_of,
    identity_of_file,
    is_own,
    is_own_file,
    number_duplicates,
    source_of,
)
from skyarm.records.plain import digest, fields_of, plain
from skyarm.records.registry.plugins import loaded_plugins, plugin_of
from skyarm.records.registry.registrations import registrations

DRAWN = ("mesh", "looks", "notes")
"""Fields that concern only pictures and notes of a vehicle; they do not change a
flight."""

FOR_PEOPLE = ("title", "sources", *DRAWN)
"""Fields that do not change a flight."""


def identity(record: object) -> str:
    """SHA-256 digest of all content of a scenario that affects a flight, thus without
    titles and sources.

    Where plugins are loaded, or code of the record is the user's, their files are part
    of it: a file that has changed flies something else.
    """
    # titles and sources may be improved without making results of a flight invalid
    content, files = _without(plain(record), FOR_PEOPLE), all_files(record)
    return digest({"record": content, "plugins": files} if files else content)


def log_digest(written: object, files: Mapping[str, str]) -> str:
    """SHA-256 digest of the scenario that is stored in a log.

    Args:
        written: plain data of the scenario, titles included; paths of meshes and notes
            are left out of the digest.
        files: name -> identity of the files of user code in it (:func:`own_files`).
    """
    flown = _without(written, DRAWN)
    return digest({"record": flown, "code": dict(files)} if files else flown)


def _without(data: object, names: tuple[str, ...]) -> object:
    """Plain data with all fields of the given names left out, at any depth."""
    if isinstance(data, dict):
        return {
            key: _without(value, names)
            for key, value in data.items()
            if key not in names
        }
    return [_without(each, names) for each in data] if isinstance(data, list) else data


Pair = tuple[str, str]
"""Name and digest of a file."""


def own_files(*things: object) -> dict[str, str]:
    """Digests, by file name, of all user files that define the functions and classes in
    the given objects.

    A plugin's file brings along the modules beside it that it imported. A scenario's
    plant is in it, though a scenario says only its name.

    Args:
        things: records, functions, classes, or containers of such; what ships, and
            numbers, have none.
    """
    return number_duplicates(sorted(_pairs(things)))


def all_files(*things: object) -> dict[str, str]:
    """Digests, by file name, of all user files that define the given objects, and of
    all loaded plugins.
    """
    return number_duplicates(
        sorted(
            _pairs(things)
            | {pair for plugin in loaded_plugins() for pair in plugin.identities()}
        )
    )


def _pairs(things: Iterable[object]) -> set[Pair]:
    pairs: set[Pair] = set()
    waiting = list(things)
    seen = {}
    while waiting:
        value = waiting.pop()
        # an enum's class may be the user's, even if its members are numbers
        if value is None or (
            isinstance(value, (bool, int, float, str)) and not isinstance(value, Enum)
        ):
            continue
        if id(value) not in seen:
            seen[id(value)] = value  # kept, so that no other object gets its id
            pairs |= _sources(value)
            waiting += _parts(value)
    return pairs


def _sources(value: object) -> set[Pair]:
    """User files, with their digests, that define a function or a class."""
    if isinstance(value, type):
        # a class is what all its bases define
        return {pair for kind in value.__mro__ for pair in _of_class(kind)}
    code = getattr(value, "__code__", None)
    if not isinstance(code, types.CodeType):
        return set()
    module = str(getattr(value, "__globals__", {}).get("__name__", ""))
    return _of_code(code, module)


def _of_code(code: types.CodeType, module: str) -> set[Pair]:
    if not is_own(code, module):
        return set()
    # a plugin counts with all modules that it brought along
    plugin = plugin_of(module)
    return {source_of(code)} if plugin is None else set(plugin.identities())


def _of_class(kind: type) -> set[Pair]:
    module = sys.modules.get(kind.__module__)
    file = getattr(module, "__file__", None)
    # a class of a notebook has no file; its methods have code
    if isinstance(file, str):
        if not is_own_file(file, kind.__module__):
            return set()
        plugin = plugin_of(kind.__module__)
        file = file_of(module)
        return (
            {(Path(file).name, identity_of_file(file))}
            if plugin is None
            else set(plugin.identities())
        )
    return {
        pair
        for code in codes_of(vars(kind).values())
        for pair in _of_code(code, kind.__module__)
    }


def _parts(value: object) -> list[object]:
    """Objects inside an object, such as items, fields and captured variables, in which
    user code is searched.
    """
    if isinstance(value, Mapping):
        return [*value.values()]
    if isinstance(value, (list, tuple, set, frozenset)):
        return [type(value), *value]
    if isinstance(value, functools.partial):
        return [value.func, *value.args, *value.keywords.values()]
    # arrays hold numbers only, and modules have files that are found by their functions
    if isinstance(value, (type, types.ModuleType)) or hasattr(value, "tolist"):
        return []
    if isinstance(value, (types.FunctionType, types.MethodType)) or hasattr(
        value, "__wrapped__"
    ):
        named = (
            getattr(value, name, None)
            for name in ("__func__", "__self__", "__wrapped__")
        )
        return [
            *named,
            *(getattr(value, "__defaults__", None) or ()),
            *closed_over(value),
        ]
    # members of an enum refer to their class, which is listed in any case
    fields = [] if isinstance(value, Enum) else [each for _, each in fields_of(value)]
    plant = getattr(value, "kind", None)
    # a scenario names its plant by a text, which a user may have registered
    named_plant = registrations("plant").get(plant) if isinstance(plant, str) else None
    return [
        type(value),
        *fields,
        *([] if named_plant is None else [named_plant.target]),
    ]
