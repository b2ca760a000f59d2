"""Immutable records: dataclasses that are frozen, keyword-only and slotted unless they say otherwise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import Field, dataclass, field, fields, is_dataclass
from functools import cache
from typing import TypeVar, cast, dataclass_transform, overload

T = TypeVar("T")

F = TypeVar("F", bound=Callable[..., object])


def memoize(function: F) -> F:
    """Cache the results of a function and keep its static type, which ``functools.cache`` loses."""
    return cast("F", cache(function))


@memoize
def declarations(kind: type) -> tuple[Field[object], ...]:
    """Fields of a dataclass with their defaults and metadata; empty for any other type."""
    return fields(kind) if is_dataclass(kind) else ()


LONGEST = 300
"""Largest number of characters of a record's text, as a notebook prints it below a cell."""


def short_repr(record: object) -> str:
    """Text of a record in at most 300 characters: its class and fields, of which long values show only their class."""
    texts = {
        each.name: (type(value).__name__, " ".join(repr(value).split()))
        for each in declarations(type(record))
        if each.repr
        for value in [getattr(record, each.name)]
    }
    line = ""
    for longest in (LONGEST, 60, 24):
        shown = (text if len(text) <= longest else f"{kind}(...)" for kind, text in texts.values())
        words = ", ".join(f"{name}={text}" for name, text in zip(texts, shown, strict=True))
        line = f"{type(record).__qualname__}({words})"
        if len(line) <= LONGEST:
            return line
    return line[: LONGEST - 4] + "...)"


@overload
def immutable(kind: type[T], /) -> type[T]: ...


@overload
def immutable(*, kw_only: bool = True, **options: bool) -> Callable[[type[T]], type[T]]: ...


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(field,))
def immutable(
    kind: type[T] | None = None, /, *, kw_only: bool = True, **options: bool
) -> type[T] | Callable[[type[T]], type[T]]:
    """Make a class a frozen dataclass with slots and a short text (:func:`short_repr`) unless it has its own.

    Args:
        kind: the class, where the decorator has no arguments.
        kw_only: False allows positional arguments.
        options: options of a dataclass: ``eq=False`` compares by identity, for records that hold arrays;
            ``slots=False`` keeps ``__dict__``, for cached properties.
    """

    def make(kind: type[T]) -> type[T]:
        made = dataclass(**{"frozen": True, "slots": True, "kw_only": kw_only, "repr": False, **options})(kind)
        if made.__repr__ is object.__repr__:
            made.__repr__ = short_repr  # type: ignore[method-assign]
        return made

    return make if kind is None else make(kind)
