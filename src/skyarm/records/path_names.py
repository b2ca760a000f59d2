"""Names that may continue a parameter path inside a record: its fields, their keys in a
file, items of a list.

A class whose numbers a file calls otherwise has a method ``path_names`` that says how:
a circle is three signals, and its radius the amplitude of two.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Protocol, Self, TypeAlias

from skyarm.algebra import Quaternion, Scalar, Vec3
from skyarm.records.immutable import positional, stated_fields
from skyarm.records.leaves import Place, parts
from skyarm.records.registry.registrations import name_of
from skyarm.records.units import Unit
from skyarm.records.words import words_of_fields


@positional
class NumberView:
    """Value that is not stored in a record but follows from several fields, such as an
    angle of an attitude.

    Attributes:
        name: name that the methods of :class:`Viewed` take. unit: unit of the number.
        inside: place of the record with these methods.
        adds: a number in its place comes on top of what the record has.
    """

    name: str
    unit: Unit
    inside: Place = ()
    adds: bool = False


Denoted: TypeAlias = "tuple[Place, ...] | NumberView | Names"
"""Target of a name in a parameter path: one or several fields, a computed view, or
further names."""

Names = Mapping[str, Denoted]
"""Names that may follow in a parameter path, each with its target."""


class Viewed(Protocol):
    """Interface (typing.Protocol) of a record with values that are computed from
    several of its fields.
    """

    def number_of_view(self, name: str) -> float:
        """Return a computed value of the record by its name."""
        ...

    def with_views(self, values: Mapping[str, Scalar]) -> Self:
        """Return a copy of the record with some computed values, given by name,
        replaced together.
        """
        ...


AGENTS = "agents"
"""Key of the tables of several vehicles in a file, and field of a scenario that holds
its vehicles by name."""

OF_AGENT = f"{AGENTS}."
"""Beginning of a path that names a vehicle: agents.NAME.plant.gravity."""


def agent_of(path: str) -> str:
    """Name of the vehicle that a parameter path begins with; empty for a path of the
    only one, or of all.
    """
    return path.split(".")[1] if path.startswith(OF_AGENT) and path.count(".") else ""


def word_of(path: str) -> str:
    """Parameter path without the name of the vehicle that it begins with, as in a
    scenario of that vehicle alone.
    """
    return (
        path.split(".", 2)[2]
        if path.startswith(OF_AGENT) and path.count(".") > 1
        else path
    )


def path_names(record: object) -> Names:
    """Names that may continue a parameter path inside a given dataclass or tuple, each
    with what it denotes.
    """
    own: Callable[[], Names] | None = getattr(record, "path_names", None)
    return field_paths(record) if own is None else own()


def field_paths(record: object) -> dict[str, Denoted]:
    """Names of a dataclass' fields and of their keys in a file, or of a tuple's items
    by index and name.
    """
    if isinstance(record, tuple):
        named = [_name(item) for item in record]
        places: dict[str, Denoted] = {number: ((number,),) for number in parts(record)}
        return places | {
            name: ((str(i),),)
            for i, name in enumerate(named)
            if name and named.count(name) == 1
        }
    fields = stated_fields(type(record))
    places = {field: ((field,),) for field in fields}
    if isinstance(record, (Vec3, Quaternion)):
        places |= {str(i): ((field,),) for i, field in enumerate(fields)}
    return places | {
        word: ((field,),)
        for field, word in words_of_fields(type(record)).items()
        # a field's own name wins over another field's word
        if word not in places
    }


def _name(item: object) -> str | None:
    """Name of a list item: its ``name`` field, else the name under which its class is
    registered.
    """
    own = getattr(item, "name", None)
    if isinstance(own, str):
        return own
    kind = getattr(item, "registered_as", None)
    return name_of(kind, type(item)) if isinstance(kind, str) else None


def below(head: Place, names: Names) -> dict[str, Denoted]:
    """Names of the parameters inside a nested record, with field paths that start from
    the outer record.
    """

    def from_head(inner: Denoted) -> Denoted:
        if isinstance(inner, NumberView):
            return dataclasses.replace(inner, inside=(*head, *inner.inside))
        return (
            tuple((*head, *place) for place in inner)
            if isinstance(inner, tuple)
            else below(head, inner)
        )

    return {name: from_head(inner) for name, inner in names.items()}
