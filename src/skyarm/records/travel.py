"""Values as bytes for another process: records, and the functions and classes that it
cannot import.
"""

from __future__ import annotations

import io
import pickle
import sys
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from importlib import import_module
from types import CellType, CodeType, FunctionType
from typing import Any

from skyarm.records.registry.plugins import (
    load_again,
    loaded_plugins,
    sources_of_plugins,
)
from skyarm.records.registry.registrations import own_registrations, take_over


def pack(value: object) -> bytes:
    """Serialise a value for another process: importable objects by name, everything
    else by content.

    A function that was made inside another one works there on the variables of its own
    module, as those that go by name do. Copies of these variables would be none of what
    the module's other functions return.

    Raises:
        ValueError: something in it cannot travel; names it.
    """
    stream = io.BytesIO()
    try:
        _pickler()(stream, pickle.HIGHEST_PROTOCOL).dump(value)
        return stream.getvalue()
    except (pickle.PicklingError, TypeError, AttributeError, ValueError) as error:
        raise ValueError(
            f"workers: {error}; what flies in other processes must be able to travel"
            " there"
        ) from error


Cells = tuple[tuple[object, ...], ...]
"""Values of a function's closure, as returned by :func:`_cell_content`."""


@cache
def _pickler() -> type[pickle.Pickler]:
    """Class of the pickler, made when it is needed because its package is slow to
    import.
    """
    import cloudpickle

    class Pickler(cloudpickle.Pickler):  # type: ignore[misc]
        def reducer_override(self, value: object) -> object:
            # what can be imported travels by its name; classes and others go the
            # package's own way
            if type(value) is not FunctionType or not _is_made_in_a_module(value):
                return super().reducer_override(value)
            cells = value.__closure__ or ()
            state = (
                tuple(map(_cell_content, cells)),
                {name: getattr(value, name) for name in KEPT},
            )
            arguments = (value.__code__, value.__globals__["__name__"], len(cells))
            return _empty_function, arguments, state, None, None, _fill_function

    return Pickler


KEPT = (
    "__defaults__",
    "__kwdefaults__",
    "__dict__",
    "__module__",
    "__qualname__",
    "__annotations__",
)
"""Attributes of a function that are serialised in addition to its code and closure."""


def _is_made_in_a_module(function: FunctionType) -> bool:
    """True for a function that its importable module does not hold by name, such as an
    inner function.
    """
    home = sys.modules.get(str(function.__globals__.get("__name__")))
    # a module without a spec, such as a script, cannot be imported elsewhere
    if getattr(home, "__spec__", None) is None or home is sys.modules["__main__"]:
        return False
    named: object = sys.modules.get(function.__module__)
    for name in function.__qualname__.split("."):
        named = getattr(named, name, None)
    return named is not function and vars(home) is function.__globals__


def _cell_content(cell: CellType) -> tuple[object, ...]:
    """Value of a closure's cell, as a tuple; () if it is not assigned yet."""
    try:
        return (cell.cell_contents,)
    except ValueError:
        return ()


def _empty_function(code: CodeType, home: str, cells: int) -> FunctionType:
    """Make a function of a module with empty closure cells, since its closure may
    contain the function itself.
    """
    return FunctionType(
        code,
        vars(import_module(home)),
        code.co_name,
        None,
        tuple(CellType() for _ in range(cells)),
    )


def _fill_function(
    function: FunctionType, state: tuple[Cells, dict[str, object]]
) -> None:
    contents, attributes = state
    for name, value in attributes.items():
        setattr(function, name, value)
    for cell, content in zip(function.__closure__ or (), contents, strict=True):
        # a cell that was empty stays empty
        if content:
            (cell.cell_contents,) = content


def unpack(content: bytes) -> Any:
    """Deserialise a value that :func:`pack` has serialised."""
    return pickle.loads(content)


def luggage() -> bytes:
    """Serialised plugins and registered names of this process, which another one needs
    to deserialise its values.

    The other process may run on another machine, which sees none of the files.
    """
    return pack((sources_of_plugins(), loaded_plugins(), [*_packed_registrations()]))


def _packed_registrations() -> Iterator[bytes]:
    for row in own_registrations():
        # one that cannot travel is missed only by what uses it, and is named then
        with suppress(ValueError):
            yield pack(row)


def unload(content: bytes) -> None:
    """Load the plugins and registered names that :func:`luggage` has serialised in
    another process.

    Raises:
        RegistryError: a plugin fails here, or an installed one is missing or of another
            version.
    """
    sources, plugins, rows = unpack(content)
    load_again(plugins, sources)
    for row in rows:
        # of a module that is not here: named by what uses it
        with suppress(Exception):
            take_over(unpack(row))
