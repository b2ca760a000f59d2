"""Keys of a file: path of each field in the file and when its value may change,
declared next to the field.

``faults: Annotated[tuple[Fault, ...], Word("/environment.faults", whole=True)]`` stands
under that name; a field that says nothing stands under its own. Reading, parameter
paths, scheduled changes and differences all ask :func:`slots`.
"""

from __future__ import annotations

import typing
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, Literal, NamedTuple

from skyarm.records.field_rules import defaults
from skyarm.records.immutable import declarations, memoize, positional
from skyarm.records.leaves import Place, field_names
from skyarm.records.members import alone
from skyarm.records.units import (
    Unit,
    annotations_of,
    declared_fields,
    declared_units,
)

EACH = "*"
"""Step of a path that matches the name or index of every item of a list."""


@positional
class Word:
    """Declared key of a file: path of its field, type of entry allowed there, and when
    its value may change.

    Attributes:
        at: path below the table of the record that holds the field; from the top of the
            file if it begins with ``/``; empty for that table itself; None for the
            field's name.
        varies: ``"always"``, in flight too; ``"between"`` episodes; ``"never"``: it
            shapes the program.
        unless: name of a field beside it which, where it is stated, lifts a "never"
            above.
        kind: kind of the registry, one of whose classes a table names by ``kind =
            NAME``.
        whole: a scheduled change may replace it as a whole.
        entries: words below it that may be replaced alone, each with the names of the
            fields that it fills.
        inside: place from the field on to the record that the word means.
        group: its fields are words of the table.
        usual: name of the kind where a table names none.
        reader: function of :mod:`skyarm.scenario.readers` that reads it, where no type
            of a record can.
    """

    at: str | None = None
    varies: Literal["always", "between", "never"] = "always"
    unless: str = ""
    kind: str = ""
    usual: str = ""
    whole: bool = False
    entries: tuple[tuple[str, Place], ...] = ()
    inside: Place = ()
    group: bool = False
    reader: str = ""


STRUCTURAL = Word(varies="never")
"""Declaration of a key whose value is the same in all episodes and throughout a
flight."""


class Slot(NamedTuple):
    """Key of a file with its whole path, and the field of the record that holds its
    value.

    Attributes:
        path: dotted, from the top of the file. place: place from the record; in both
            ``*`` stands for every item.
        word: declared word.
        type, unit, default: type, unit and default of the field;
            ``dataclasses.MISSING`` if it has no default.
    """

    path: str
    place: Place
    word: Word
    type: Any
    unit: Unit
    default: object

    @property
    def table(self) -> str:
        """Path of a key's entry in a file; for a key of list items, path of the table
        that holds the items.
        """
        return self.path.removesuffix(f".{EACH}")

    @property
    def is_list(self) -> bool:
        """True if a key holds a list of records, and not one record or named tables."""
        return EACH not in self.place and typing.get_origin(self.type) is tuple

    @property
    def field(self) -> Place:
        """Path, from the outermost record, of the field that declares a key of a
        file.
        """
        return self.place[: len(self.place) - len(self.word.inside)]

    @property
    def record(self) -> Place:
        """Path, from the outermost record, of the field that holds a key's value or,
        for list items, the whole list.
        """
        return (
            self.place[: self.place.index(EACH)] if EACH in self.place else self.place
        )


@cache
def slots(kind: type) -> tuple[Slot, ...]:
    """Keys of a file that a dataclass and the groups inside it declare, in the order of
    their fields.
    """
    return tuple(_slots(kind, "", ()))


@cache
def groups(kind: type) -> dict[str, type]:
    """Fields of a dataclass that group keys of the same table, each with the class of
    the group.

    Of members by name it is the property for the only one
    (:mod:`skyarm.records.members`), with the class of a member.
    """
    types: dict[str, Any] = {name: t for name, (t, _) in declared_units(kind).items()}
    sole = {field.name: alone(field) for field in declarations(kind)}
    named = [name for name, word in _words_in(kind) if word.group]
    return {
        sole[name] or name: typing.get_args(types[name])[1]
        if sole[name]
        else types[name]
        for name in named
    }


def _slots(kind: type, table: str, place: Place) -> Iterator[Slot]:
    declared, usual = declared_fields(kind), defaults(kind)
    sole = {field.name: alone(field) for field in declarations(kind)}
    for field, word in _words_in(kind):
        name = sole[field] or field
        path = name if word.at is None else word.at
        # a leading slash counts from the top of the file
        path = (
            path[1:] if path.startswith("/") else ".".join(filter(None, (table, path)))
        )
        if word.group:
            yield from _slots(groups(kind)[name], path, (*place, name))
        else:
            yield Slot(
                path, (*place, name, *word.inside), word, *declared[name], usual[name]
            )


@cache
def lifted_fields(kind: type) -> dict[str, str]:
    """Fields of a dataclass that may change only if another field is stated, each with
    the name of that other field.
    """
    return {name: word.unless for name, word in _words_in(kind) if word.unless}


@memoize
def words_of_fields(of: type | Callable[..., object]) -> dict[str, str]:
    """Fields of a dataclass, or parameters of a function, that have another name in a
    file, each with that name.
    """
    return {
        name: word.at
        for name, word in _words_in(of)
        if word.at and word.at.isidentifier()
    }


def _words_in(of: type | Callable[..., object]) -> list[tuple[str, Word]]:
    """Key declarations of a dataclass' fields or a function's parameters; by default
    the key is the name.
    """
    if isinstance(of, type) and field_names(of) is None:
        return []
    try:
        full = annotations_of(of)
    except (NameError, TypeError):  # a name that only type checkers import
        return []
    names = (field_names(of) if isinstance(of, type) else None) or full
    declared = [name for name in names if name in full]
    return [(name, word) for name in declared for word in _words_said(full[name])]


def _words_said(annotation: object) -> tuple[Word, ...]:
    extras = (
        typing.get_args(annotation)[1:]
        if typing.get_origin(annotation) is typing.Annotated
        else ()
    )
    # a field that declares no key stands under its own name
    return tuple(each for each in extras if isinstance(each, Word)) or (Word(),)
