"""Immutable records: dataclasses that are frozen, keyword-only and slotted unless they say otherwise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar, dataclass_transform, overload

T = TypeVar("T")


@overload
def immutable(kind: type[T], /) -> type[T]: ...


@overload
def immutable(*, kw_only: bool = True, eq: bool = True) -> Callable[[type[T]], type[T]]: ...


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(field,))
def immutable(
    kind: type[T] | None = None, /, *, kw_only: bool = True, eq: bool = True
) -> type[T] | Callable[[type[T]], type[T]]:
    """Make a class a frozen dataclass with slots.

    Args:
        kind: the class, where the decorator has no arguments.
        kw_only: False allows positional arguments.
        eq: False compares by identity, for records that hold arrays.
    """
    make = dataclass(frozen=True, slots=True, kw_only=kw_only, eq=eq)
    return make if kind is None else make(kind)
