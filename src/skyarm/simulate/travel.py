"""Records on their way to another process, with functions made inside functions, which pickle alone does not carry.

A law of one's own is mostly made so: ``def make(model): def law(...): ...``. Such a function travels as its code, its
defaults and what it was closed over; its globals are those of its module, which the other process has loaded.
"""

from __future__ import annotations

import io
import marshal
import pickle
from importlib import import_module
from types import CellType, CodeType, FunctionType
from typing import Any


def packed(value: Any) -> bytes:
    """A value as bytes that :func:`pickle.loads` reads in a process of the same Python with the same plugins.

    Raises:
        ValueError: something in it cannot travel; names it.
    """
    stream = io.BytesIO()
    try:
        _Pickler(stream, pickle.HIGHEST_PROTOCOL).dump(value)
    except (pickle.PicklingError, TypeError, AttributeError) as error:
        raise ValueError(f"workers: {error}; what flies in other processes must be able to travel there") from error
    return stream.getvalue()


class _Pickler(pickle.Pickler):
    """Pickle, and functions made inside functions."""

    def reducer_override(self, value: Any) -> Any:
        """Code and contents of an inner function; anything else as usual."""
        if not isinstance(value, FunctionType) or "<locals>" not in value.__qualname__:
            return NotImplemented
        cells = value.__closure__ or ()
        code = marshal.dumps(value.__code__)
        held = (tuple(map(_content, cells)), value.__defaults__, value.__kwdefaults__)
        return _empty, (code, value.__module__, value.__qualname__, len(cells)), held, None, None, _fill


def _content(cell: CellType) -> tuple[Any, ...]:
    """What a cell holds, if anything yet."""
    try:
        return (cell.cell_contents,)
    except ValueError:
        return ()


def _empty(code: bytes, module: str, qualname: str, cells: int) -> FunctionType:
    """The function before what it was closed over is there: it may have been closed over itself."""
    inner: CodeType = marshal.loads(code)
    closure = tuple(CellType() for _ in range(cells))
    made = FunctionType(inner, import_module(module).__dict__, inner.co_name, None, closure)
    made.__module__, made.__qualname__ = module, qualname
    return made


def _fill(function: FunctionType, held: tuple[Any, ...]) -> None:
    contents, function.__defaults__, function.__kwdefaults__ = held
    for cell, content in zip(function.__closure__ or (), contents, strict=True):
        if content:
            (cell.cell_contents,) = content
