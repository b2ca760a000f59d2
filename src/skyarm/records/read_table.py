"""Read dataclasses from tables of a file, one key for each field."""

from __future__ import annotations

import inspect
import re
import types
import typing
from collections.abc import Callable, Collection, Mapping
from dataclasses import MISSING
from typing import Any, TypeVar

from skyarm.algebra import Quaternion, Scalar, Vec3
from skyarm.records import coerce
from skyarm.records.field_rules import defaults
from skyarm.records.files import Fields, errors_as, shown
from skyarm.records.files.fields import list_of_tables
from skyarm.records.files.toml import Entry
from skyarm.records.immutable import declarations, stated_fields
from skyarm.records.leaves import field_names, is_record_class
from skyarm.records.registry import find
from skyarm.records.registry.registrations import name_of
from skyarm.records.units import (
    NUMBER,
    Unit,
    declared_units,
    parameters_of,
    scalars,
    unresolved_field,
)
from skyarm.records.words import words_of_fields

Record = TypeVar("Record")


def record_from(kind: type[Record], fields: Fields, *, folds: bool = False) -> Record:
    """Read an instance of a given dataclass from a table of a file.

    A number may stand where the field is a ``float`` or ``Scalar``; three numbers where
    it is a ``Vec3``; a list where it is a tuple; a table where it is a record, or
    whatever its class reads by ``from_table``. Fields with a default may be left out. A
    class with other spellings reads them by ``short_spellings(fields)``: values by
    field.

    Args:
        kind: a dataclass.
        fields: the table; words that are no field are refused.
        folds: exact zeros of vectors whose fields say so become structure.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    if field_names(kind) is None:
        raise ValueError(
            f"{fields.where}: {kind.__name__} must be a dataclass to be read from a"
            " file"
        )
    declared, called = declared_units(kind), words_of_fields(kind)
    fields.expect((*stated_fields(kind), *called.values()))
    values: dict[str, object] = {}
    read_short: Callable[[Fields], dict[str, object]] | None = getattr(
        kind, "short_spellings", None
    )
    if read_short is not None:
        # asked for first, so that a missing key is refused in the order of the fields
        for name in field_names(kind) or ():  # in the order of a message
            fields.take(called.get(name, name), None)
        values = read_short(fields)
    for field in declarations(kind):
        if field.name not in stated_fields(kind):
            continue
        name, required = field.name, field.default is field.default_factory is MISSING
        if name in values:
            continue
        word = called.get(name, name)
        if word not in fields.table and name in fields.table and word not in declared:
            word = name  # as files of 0.3 call it
        if not field.init or (word not in fields.table and not required):
            fields.take(word, None)
        elif name in declared:
            values[name] = default_if_equal(
                value_from(*declared[name], fields, word, folds), field.default
            )
        else:
            # one of them hides the types of all
            at = fields.at(unresolved_field(kind) or word)
            raise ValueError(
                f"{at}: the annotation of this field names a type that cannot be found"
            )
    fields.done()
    return make_at(fields.where, kind, **values)


def entry_of(value: object) -> Entry:
    """Entry for a file from which a value can be read again; for a record, a table of
    its non-default fields.

    Raises:
        TypeError: a value that no file has words for.
    """
    if isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, Mapping):
        return {str(name): entry_of(each) for name, each in value.items()}
    if isinstance(value, (Vec3, Quaternion, tuple)):
        return [entry_of(each) for each in value]
    own: Callable[[], Entry] | None = getattr(value, "to_entry", None)
    return record_entry(value) if own is None else own()


def record_entry(value: object, always: Collection[str] = ()) -> dict[str, Entry]:
    """Table of a record's non-default fields, and of its kind if its class is
    registered.

    Args:
        value: a record.
        always: fields that stand in the table even so.

    Raises:
        TypeError: no record, or one of values that no file has words for.
    """
    names = field_names(type(value))
    if names is None:
        raise TypeError(f"{type(value).__name__} has no words in a file")
    kind = getattr(value, "registered_as", "")
    named = {"kind": _registered_name(kind, value)} if kind else {}
    usual, words = defaults(type(value)), words_of_fields(type(value))
    fields = ((name, getattr(value, name)) for name in stated_fields(type(value)))
    stated = (
        (name, each)
        for name, each in fields
        if each is not None and (name in always or not same_as(each, usual[name]))
    )
    return named | {words.get(name, name): entry_of(each) for name, each in stated}


def _registered_name(kind: str, value: object) -> Entry:
    name = name_of(kind, type(value))
    if name is None:
        raise TypeError(f"{type(value).__name__} is registered under no name")
    return name


def same_as(value: object, usual: object) -> bool:
    """True if a value is identical to a field's default: the constant 0 of compiled
    code differs from 0.0.
    """
    # repr tells -0.0 and nested structure apart, which == does not
    return type(value) is type(usual) and value == usual and repr(value) == repr(usual)


def make_at(where: str, kind: Callable[..., Record], /, **values: object) -> Record:
    """Create an instance of a class; an error message begins with the table of the file
    that states its values.

    Raises:
        ValueError: one line.
    """
    try:
        return kind(**values)
    except ValueError as error:
        # last word of the table's place, without the name or index in brackets
        words, last = str(error), re.sub(r"\[\w+\]$", "", where).rpartition(".")[2]
        # a table inside has named its whole place already
        if words.startswith(where):
            raise ValueError(words) from None
        called = words_of_fields(kind)
        # the record calls itself so
        if last and words.startswith((f"{last}.", f"{last}[")):
            raise ValueError(
                where + _by_words(words.removeprefix(last), called)
            ) from None
        own = (field_names(kind) if isinstance(kind, type) else None) or ()
        named, field = re.match(r"(\w*)\.?(\w*)", words).groups()  # type: ignore[union-attr]
        if named not in own and field in own:  # by the name of its class: surface.name
            words = words.removeprefix(f"{named}.")
        if named in own or field in own:
            raise ValueError(where + _by_words(f".{words}", called)) from None
        raise ValueError(f"{where}: {words}") from None


def _by_words(line: str, called: Mapping[str, str]) -> str:
    """Error message in which the field name at the beginning is replaced by the field's
    key in a file.
    """
    return re.sub(r"^\.(\w+)", lambda match: f".{called.get(match[1], match[1])}", line)


def numbers_from(
    kind: type, fields: Fields, *, partial: bool = False
) -> dict[str, float]:
    """Read the scalar fields of a dataclass that a table states, and check their
    declared bounds.

    Args:
        kind: a dataclass.
        fields: the table, which may have other words, too.
        partial: a field without a default may be left out.

    Raises:
        ValueError: one line with field, value and what is allowed, in which unit.
    """
    numbers = dict[str, float]()
    usual = defaults(kind)
    for name, unit in scalars(kind).items():
        if not fields.states(name) and (partial or usual[name] is not MISSING):
            continue
        try:
            value = fields.number(
                name, low=unit.low, strict=unit.strict, infinite=unit.infinite
            )
        except ValueError as error:
            # a missing field has no value whose unit could be wrong
            raise ValueError(
                f"{error}, {unit.unit}"
                if unit.unit and name in fields.table
                else str(error)
            ) from None
        numbers[name] = (
            0 if unit.folds and value == 0.0 else default_if_equal(value, usual[name])
        )
    return numbers


def default_if_equal(value: Any, usual: object) -> Any:
    """Default of a field in place of equal numbers of a file: an int 0 there is
    structure, unlike the file's 0.0.
    """
    # an int 0 of a default equals a file's 0.0, and must stay structure
    return usual if isinstance(value, (float, Vec3)) and value == usual else value


def takes_table(function: Callable[..., object]) -> bool:
    """True if a function's only parameter is a ``Fields`` reader, from which it reads a
    whole table.
    """
    parameters = list(parameters_of(function).values())
    return len(parameters) == 1 and parameters[0].annotation in (Fields, "Fields")


def options_from(function: Callable[..., object], fields: Fields) -> dict[str, object]:
    """Read the keyword arguments of a function from a table, by their annotated types.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    declared = declared_units(function)
    values: dict[str, object] = {}
    parameters = parameters_of(function)
    fields.expect(parameters)
    for name, parameter in parameters.items():
        if name in fields.table or parameter.default is inspect.Parameter.empty:
            value = value_from(*declared.get(name, (float, NUMBER)), fields, name)
            values[name] = default_if_equal(value, parameter.default)
        else:
            # the key counts as known, for the message on a misspelt one
            fields.take(name, None)
    return values


def value_from(
    annotation: object, unit: Unit, fields: Fields, name: str, folds: bool = False
) -> object:
    """Read a field of a table as the type that the dataclass declares for it."""
    origin = typing.get_origin(annotation)
    if origin in (typing.Union, types.UnionType):
        annotation = next(
            each for each in typing.get_args(annotation) if each is not type(None)
        )
        origin = typing.get_origin(annotation)
    if annotation in (float, Scalar):
        # a field without a unit accepts infinity in code, but no file means it
        infinite = unit.infinite and unit is not NUMBER
        return fields.number(name, low=unit.low, strict=unit.strict, infinite=infinite)
    if annotation is int:
        return coerce.whole(fields.at(name), fields.take(name))
    if annotation is Vec3:
        return (
            fields.vector(name) if folds and unit.folds else Vec3(*fields.vector(name))
        )
    if annotation is str:
        return coerce.text(fields.at(name), fields.take(name))
    if origin is typing.Literal:
        return fields.choice(name, typing.get_args(annotation))
    if annotation is bool:
        return fields.flag(name)
    if origin is tuple:
        return _several(typing.get_args(annotation)[0], fields, name)
    value, at = fields.take(name), fields.at(name)
    if annotation is Any:
        return value
    if hasattr(annotation, "from_table"):
        return annotation.from_table(value, at)
    if is_record_class(annotation):
        return record_from(annotation, Fields(value, at), folds=folds)
    raise ValueError(f"{at}: a field of type {annotation} cannot be read from a file")


def _several(kind: object, fields: Fields, name: str) -> tuple[object, ...]:
    """Read a tuple of numbers, of tuples of numbers, or of dataclasses from a list in a
    table.
    """
    if kind in (float, Scalar):
        return fields.numbers(name)
    at = fields.at(name)
    read = {str: lambda value, place: coerce.text(place, value)}.get(
        kind,  # type: ignore[call-overload]
        getattr(kind, "from_table", None),
    )
    if read is not None:
        values = fields.take(name)
        if not isinstance(values, list):
            raise ValueError(f"{at} = {shown(values)}: must be a list")
        return tuple(read(each, f"{at}[{i}]") for i, each in enumerate(values))
    # a Vec3 is a record as well, but three numbers in a file
    if is_record_class(kind) and kind is not Vec3:
        return tuple(record_from(kind, table) for table in fields.tables(name))
    if kind is not Vec3 and typing.get_origin(kind) is not tuple:
        raise ValueError(f"{at}: a field of several {kind} cannot be read from a file")
    lists = fields.take(name)
    if not isinstance(lists, (list, tuple)):
        raise ValueError(f"{at} = {shown(lists)}: must be a list of lists of numbers")
    # rows as fields of a table, so that messages name their index
    rows = Fields({str(i): each for i, each in enumerate(lists)}, at)
    vectors = (Vec3(*rows.vector(name)) for name in rows.table)
    return tuple(vectors if kind is Vec3 else map(rows.numbers, rows.table))


def registered_from(
    kind: str,
    base: type[Record],
    table: object,
    where: str,
    usual: str = "",
    *,
    word: str = "kind",
    folds: bool = False,
) -> Record:
    """Read a table ``{ kind = NAME, ... }`` as an instance of the class that is
    registered as NAME.

    Args:
        kind: kind of the registry, or several with a space between them.
        base: class that the registered one must have.
        table: table of the file.
        where: place of the table, for messages.
        usual: NAME where the table states none.
        word: word that names the kind.
        folds: zeros become structure, as of :func:`record_from`.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    fields = Fields(table, where)
    name = usual if usual and word not in fields.table else fields.take(word)
    registered = find(kind, name, fields.at(word))
    if not isinstance(registered, type) or not issubclass(registered, base):
        raise ValueError(
            f"{fields.at(word)} = {name!r}: must be registered as a subclass of"
            f" {base.__name__}"
        )
    record = record_from(registered, fields, folds=folds)
    require_stated = getattr(registered, "require_stated", None)
    if require_stated is not None:  # numbers that others of the table need
        with errors_as(ValueError, f"{where}."):
            require_stated(fields.table.keys())
    return record


def registered_value(
    kind: str, base: type[Record], entry: object, where: str, usual: str
) -> Record:
    """Read one registered record (:func:`registered_from`) from its table or, with
    default values, from its name.
    """
    return registered_from(
        kind, base, {"kind": entry} if isinstance(entry, str) else entry, where, usual
    )


def registered_values(
    kind: str, base: type[Record], entry: object, where: str, usual: str
) -> tuple[Record, ...]:
    """Read several registered records (:func:`registered_from`) from a list of
    tables.
    """
    return tuple(
        registered_from(kind, base, each.table, each.where, usual)
        for each in list_of_tables(entry, where)
    )
