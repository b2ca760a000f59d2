"""Immutable records: dataclasses that are frozen, keyword-only and slotted unless they
say otherwise.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Mapping
from dataclasses import (
    Field,
    FrozenInstanceError,
    dataclass,
    field,
    fields,
    is_dataclass,
)
from functools import cache
from operator import attrgetter
from types import FunctionType
from typing import Any, TypeVar, cast, dataclass_transform, overload

T = TypeVar("T")

V = TypeVar("V")

F = TypeVar("F", bound=Callable[..., object])


def memoize(function: F) -> F:
    """Cache the results of a function and keep its static type, which
    ``functools.cache`` loses.
    """
    return cast("F", cache(function))


@memoize
def declarations(kind: type) -> tuple[Field[object], ...]:
    """Fields of a dataclass with their defaults and metadata; empty for any other
    type.
    """
    return fields(kind) if is_dataclass(kind) else ()


UNWRITTEN = "unwritten"
"""Key of a field's metadata: plain data contains the field only if it is neither empty
nor this value."""


def field_if_any(*, default: V, repr: bool = True) -> V:
    """Field that plain data contains only if it is not empty, so that digests of older
    records stay the same.
    """
    return field(default=default, repr=repr, metadata={UNWRITTEN: None})


DERIVED = "derived"
"""Key of a field's metadata: other fields determine the value, so no file states it and
no path leads to it."""


def derived_field() -> Any:
    """Field, empty at first, that the record or its owner computes from other
    fields.
    """
    return field(default=(), repr=False, metadata={UNWRITTEN: None, DERIVED: True})


@memoize
def stated_fields(kind: type) -> tuple[str, ...]:
    """Names of the fields of a dataclass that a file may state."""
    return tuple(
        each.name for each in declarations(kind) if DERIVED not in each.metadata
    )


LONGEST = 300
"""Largest number of characters of a record's text, as a notebook prints it below a
cell."""


def short_repr(record: object) -> str:
    """Text of a record in at most 300 characters: its class and fields, of which long
    values show only their class.
    """
    texts = dict[str, tuple[str, str]]()
    for each in declarations(type(record)):
        if each.repr:
            value = getattr(record, each.name)
            # the type's name stands in place of a value that is too long
            texts[each.name] = type(value).__name__, " ".join(repr(value).split())
    line = ""
    # ever shorter values, until the line fits
    for longest in (LONGEST, 60, 24):
        shown = (
            text if len(text) <= longest else f"{kind}(...)"
            for kind, text in texts.values()
        )
        words = ", ".join(
            f"{name}={text}" for name, text in zip(texts, shown, strict=True)
        )
        line = f"{type(record).__qualname__}({words})"
        if len(line) <= LONGEST:
            return line
    return line[: LONGEST - 4] + "...)"


def _compare_fields(kind: type, own: Mapping[str, object]) -> None:
    """Give a dataclass equality and hash by its fields, unless they are among its own
    methods.

    Python compiles these methods anew for every class, which for all classes of a
    command takes 40 ms.
    """
    names = [each.name for each in fields(kind) if each.compare]
    # of no field and of one an attrgetter makes no tuple: the class itself fills up to
    # two
    values = attrgetter(*names, *["__class__"] * (2 - len(names)))

    def equal(self: object, other: object) -> bool:
        return (
            values(self) == values(other)
            if other.__class__ is self.__class__
            else NotImplemented
        )

    def number(self: object) -> int:
        return hash(values(self))

    if "__eq__" not in own:
        kind.__eq__ = equal  # type: ignore[method-assign,assignment]
    # a class with __eq__ of its own has __hash__ = None until it states one
    if own.get("__hash__") is None:
        kind.__hash__ = number  # type: ignore[method-assign,assignment]


def _frozen_methods(
    kind: type, compared: Collection[Field[object]], *_: object
) -> tuple[Callable[..., None], ...]:
    """Methods of a frozen dataclass as Python makes them, but of code that all classes
    share.
    """
    names = {each.name for each in compared}

    def set_one(self: object, name: str, value: object) -> None:
        if type(self) is kind or name in names:
            raise FrozenInstanceError(f"cannot assign to field {name!r}")
        super(kind, self).__setattr__(name, value)  # type: ignore[arg-type]

    def delete_one(self: object, name: str) -> None:
        if type(self) is kind or name in names:
            raise FrozenInstanceError(f"cannot delete field {name!r}")
        super(kind, self).__delattr__(name)  # type: ignore[arg-type]

    set_one.__name__, delete_one.__name__ = "__setattr__", "__delattr__"
    return set_one, delete_one


def _quick_dataclass(
    replaced: str = "_frozen_get_del_attr",
) -> Callable[..., Callable[[type[T]], type[T]]]:
    """``dataclass`` whose frozen methods are :func:`_frozen_methods`, or itself if this
    Python makes them otherwise.

    Two functions a class to compile are 5 % of a short command. A copy of the module's
    functions is made, so that nobody else's dataclasses change.
    """
    own: dict[str, Any] = dict(vars(dataclasses))
    process = own.get("_process_class")
    # where dataclasses do not call it by that name, a replacement would have no effect
    if replaced not in own or replaced not in getattr(
        getattr(process, "__code__", None), "co_names", ()
    ):
        return dataclass
    own[replaced] = _frozen_methods
    # a function finds the others in the module that it was made with, hence new ones
    for name in ("_process_class", "dataclass"):
        theirs = own[name]
        own[name] = FunctionType(theirs.__code__, own, name, theirs.__defaults__)
        own[name].__kwdefaults__ = theirs.__kwdefaults__
    return cast("Callable[..., Callable[[type[T]], type[T]]]", own["dataclass"])


_dataclass = _quick_dataclass()


@overload
def immutable(kind: type[T], /) -> type[T]: ...


@overload
def immutable(
    *, kw_only: bool = True, **options: bool
) -> Callable[[type[T]], type[T]]: ...


@dataclass_transform(
    frozen_default=True, kw_only_default=True, field_specifiers=(field, field_if_any)
)
def immutable(
    kind: type[T] | None = None, /, *, kw_only: bool = True, **options: bool
) -> type[T] | Callable[[type[T]], type[T]]:
    """Make a class a frozen dataclass with slots and a short text (:func:`short_repr`)
    unless it has its own.

    Args:
        kind: the class, where the decorator has no arguments.
        kw_only: False allows positional arguments.
        options: options of a dataclass: ``eq=False`` compares by identity, for records
            that hold arrays; ``slots=False`` keeps ``__dict__``, for cached properties.
    """

    def make(kind: type[T]) -> type[T]:
        usual = {
            "frozen": True,
            "slots": True,
            "kw_only": kw_only,
            "repr": False,
            **options,
        }
        # eq is added below, from code that all classes share
        made = _dataclass(**usual | {"eq": False})(kind)
        if made.__repr__ is object.__repr__:
            made.__repr__ = short_repr  # type: ignore[method-assign]
        if usual.get("eq", True):
            _compare_fields(made, vars(kind))
        return made

    return make if kind is None else make(kind)


@overload
def positional(kind: type[T], /) -> type[T]: ...


@overload
def positional(**options: bool) -> Callable[[type[T]], type[T]]: ...


@dataclass_transform(frozen_default=True, field_specifiers=(field, field_if_any))
def positional(
    kind: type[T] | None = None, /, **options: bool
) -> type[T] | Callable[[type[T]], type[T]]:
    """Make a class an immutable record whose fields may be given by position; see
    :func:`immutable`.
    """
    make = immutable(kw_only=False, **options)
    return make if kind is None else make(kind)
