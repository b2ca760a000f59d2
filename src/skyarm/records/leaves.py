"""Conversion between nested dataclasses and flat lists of their scalars.

A record is a frozen dataclass or a tuple of records. Its *leaves* are the scalars that
may vary; integers, strings, booleans, None and enums are structure: they shape the
program and are not leaves. :data:`Tree` is the type of all that is made of these alone.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from enum import Enum
from operator import attrgetter
from typing import Any, ClassVar, Protocol, TypeAlias, TypeGuard, TypeVar, cast

from skyarm.algebra import Scalar
from skyarm.algebra.scalars import where
from skyarm.records.immutable import memoize

Record = TypeVar("Record")


class Dataclass(Protocol):
    """Static type (typing.Protocol) of an instance of any dataclass."""

    __dataclass_fields__: ClassVar[dict[str, dataclasses.Field[Any]]]


Tree: TypeAlias = "Scalar | str | Enum | Dataclass | tuple[Tree, ...] | None"
"""Nested value of scalars: a scalar, a constant, or a frozen dataclass or tuple of such
values."""

_STRUCTURE = (int, str, bool, type(None), Enum)

Place = tuple[str, ...]
"""Field names and item numbers that lead from one record to a part of it."""


def leaves(record: object) -> list[Any]:
    """All variable scalars of a nested dataclass as a flat list, in field order."""
    scalars: list[Any] = []
    _visit_only(record, scalars.append)
    return scalars


def _visit_only(record: object, visit: Callable[[object], None]) -> None:
    if isinstance(record, tuple):
        for item in record:
            _visit_only(item, visit)
    elif (names := field_names(type(record))) is not None:
        for name in names:
            _visit_only(getattr(record, name), visit)
    elif not isinstance(record, _STRUCTURE):
        visit(record)


@memoize
def field_names(kind: type) -> tuple[str, ...] | None:
    """Field names of a dataclass, cached for use in every control period; None for any
    other type.
    """
    return (
        tuple(field.name for field in dataclasses.fields(kind))
        if dataclasses.is_dataclass(kind)
        else None
    )


@memoize
def values_of(kind: type) -> Callable[[Any], tuple[Any, ...]] | None:
    """Function that takes the values of all fields of a dataclass at once, in their
    order; None for any other type.
    """
    names = field_names(kind)
    return None if names is None else values_named(names)


def values_named(names: Sequence[str]) -> Callable[[Any], tuple[Any, ...]]:
    """Function that takes the values of several attributes at once."""
    if len(names) > 1:
        return attrgetter(*names)
    if not names:
        return lambda record: ()
    # of one name an attrgetter makes no tuple
    only = attrgetter(*names)
    return lambda record: (only(record),)


def is_record_class(kind: object) -> TypeGuard[type]:
    """True if a value, such as an annotation, is a dataclass itself."""
    return isinstance(kind, type) and field_names(kind) is not None


def is_record(value: object) -> bool:
    """True if a value is an instance of a dataclass."""
    return field_names(type(value)) is not None


def is_leaf(value: object) -> TypeGuard[Scalar]:
    """True if a value is a variable scalar; false for constants of compiled code, such
    as integers and texts.
    """
    return not isinstance(value, _STRUCTURE)


def parts(record: object) -> dict[str, Any]:
    """Fields of a dataclass, or items of a tuple, by name; empty for a scalar."""
    if isinstance(record, tuple):
        return {str(i): item for i, item in enumerate(record)}
    return {name: getattr(record, name) for name in field_names(type(record)) or ()}


def walk(record: object, place: Place = ()) -> Iterator[tuple[Place, Any]]:
    """Field names and value of each number, text or other innermost value of a nested
    dataclass.

    The leaves among them, which :func:`is_leaf` tells, come in the order of
    :func:`leaves`.
    """
    if isinstance(record, tuple) or is_record(record):
        for name, value in parts(record).items():
            yield from walk(value, (*place, name))
    else:
        yield place, record


def pairs(
    example: object, record: object, path: str
) -> list[tuple[object, object, str]] | None:
    """Fields of two dataclasses in pairs, each pair with its name; None if the two
    differ in structure.
    """
    if (
        isinstance(example, tuple)
        and isinstance(record, tuple)
        and len(example) == len(record)
    ):
        return [
            (a, b, f"{path}[{i}]")
            for i, (a, b) in enumerate(zip(example, record, strict=True))
        ]
    if (
        type(example) is type(record)
        and (names := field_names(type(example))) is not None
    ):
        return [
            (getattr(example, name), getattr(record, name), f"{path}.{name}")
            for name in names
        ]
    return None


def mismatch(example: object, record: object, path: str) -> str | None:
    """Message about the first difference in structure between two nested dataclasses;
    None if they match.
    """
    below = pairs(example, record, path)
    if below is None:
        # a leaf may differ in value and type, a constant may not
        kinds = (*_STRUCTURE, tuple)
        shaped = any(
            isinstance(one, kinds) or is_record(one) for one in (example, record)
        )
        alike = (
            type(example) is type(record) and not is_leaf(example) and example == record
        )
        return None if alike or not shaped else f"{path} is {record!r}, not {example!r}"
    return next(
        (message for a, b, name in below if (message := mismatch(a, b, name))), None
    )


def named_leaves(record: object, where: str = "") -> Iterator[tuple[str, Scalar]]:
    """Dotted path and value of every variable scalar of a nested dataclass."""
    return (
        (path, value) for path, value in named_parts(record, where) if is_leaf(value)
    )


def named_parts(record: object, where: str) -> Iterator[tuple[str, object]]:
    """Dotted path and value of every number, text or flag of a nested dataclass,
    constants included.
    """
    for place, value in walk(record):
        steps = "".join(f"[{i}]" if i.isdigit() else f".{i}" for i in place)
        yield f"{where}{steps}".removeprefix("."), value


def rebuild(template: Record, values: Iterable[object]) -> Record:
    """Copy of a nested dataclass with its scalars replaced, in order, by given values.

    An iterator is left at the first value that is not needed.
    """
    return _with_next(template, iter(values))


def _with_next(template: Record, values: Iterator[object]) -> Record:
    made: Any = template
    if isinstance(template, tuple):
        made = tuple(_with_next(item, values) for item in template)
    elif (names := field_names(type(template))) is not None:
        parts = {name: _with_next(getattr(template, name), values) for name in names}
        made = type(template)(**parts)
    elif is_leaf(template):
        made = next(values)
    return cast("Record", made)


def as_data(record: Record) -> Record:
    """Copy of nested dataclasses with floats for integers, which are structure: all
    numbers of a memory may vary.
    """
    if isinstance(record, tuple):
        return cast("Record", tuple(map(as_data, record)))
    if is_record(record):
        return type(record)(
            **{name: as_data(value) for name, value in parts(record).items()}
        )
    # type() and not isinstance: a truth value is an int, too, and stays
    return cast("Record", float(record)) if type(record) is int else record  # type: ignore[arg-type]


def shaped_like(template: Record, values: Sequence[object]) -> Record:
    """Copy of a nested dataclass with a list of scalars in place of its own; their
    number must match.
    """
    count = len(leaves(template))
    if count != len(values):
        raise ValueError(
            f"{type(template).__name__} has {count} scalars, got {len(values)}"
        )
    return rebuild(template, values)


def part(record: object, place: Place) -> Any:
    """Value inside nested dataclasses, found by a sequence of field names and
    indices.
    """
    for name in place:
        record = (
            record[int(name)] if isinstance(record, tuple) else getattr(record, name)
        )
    return record


def replace_at(record: Record, values: Mapping[Place, object]) -> Record:
    """Copy of nested dataclasses with some values inside replaced, each given by its
    sequence of field names.

    Every record on the way is made, and checked, once: numbers that only together make
    sense are replaced together.
    """
    whole: Any = record  # what it has is known by the names of the places alone
    below: dict[str, dict[Place, object]] = {}
    for place, value in values.items():
        if place:
            below.setdefault(place[0], {})[place[1:]] = value
    if () in values:
        whole = values[()]
    elif isinstance(whole, tuple):
        whole = tuple(
            # a place holds an index as text
            replace_at(item, below[str(i)]) if str(i) in below else item
            for i, item in enumerate(whole)
        )
    else:
        whole = dataclasses.replace(
            whole,
            **{
                name: replace_at(getattr(whole, name), inner)
                for name, inner in below.items()
            },
        )
    result: Record = whole
    return result


def blend(condition: Scalar, new: Record, old: Record) -> Record:
    """Select between two nested dataclasses, scalar by scalar: ``new`` where a
    condition holds, else ``old``.
    """
    # old decides the structure, because a memory must keep its shape
    values = [
        where(condition, a, b) for a, b in zip(leaves(new), leaves(old), strict=True)
    ]
    return rebuild(old, values)
