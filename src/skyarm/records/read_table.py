"""A record from a table of a file: its fields are the table's words."""

from __future__ import annotations

import dataclasses
import inspect
import types
import typing
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from skyarm.algebra import Vec3
from skyarm.files import Fields, shown
from skyarm.records.leaves import field_names
from skyarm.records.units import Unit, declared
from skyarm.scalars import Scalar

Record = TypeVar("Record")


def record_from(kind: type[Record], fields: Fields) -> Record:
    """The record that a table describes.

    A number may stand where the field is a ``float`` or ``Scalar``; three numbers where it is a ``Vec3``; a list where
    it is a tuple; a table where it is a record, or whatever its class reads by ``from_table``. Fields with a default
    may be left out.

    Args:
        kind: a dataclass.
        fields: the table; words that are no field are refused.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    if field_names(kind) is None:
        raise ValueError(f"{fields.where}: {kind.__name__} must be a dataclass to be read from a file")
    said = declared(kind)
    values: dict[str, Any] = {}
    for field in dataclasses.fields(kind):  # type: ignore[arg-type]
        if not field.init or (field.name not in fields.table and _has_default(field)):
            fields.take(field.name, None)
            continue
        values[field.name] = _value(_type(said, field.name, fields), fields, field.name)
    fields.done()
    try:
        return kind(**values)
    except ValueError as error:
        raise ValueError(f"{fields.where}: {error}") from None


def takes_table(function: Callable[..., Any]) -> bool:
    """Whether a function reads its table itself: one parameter, which is annotated as Fields."""
    parameters = list(inspect.signature(function).parameters.values())
    return len(parameters) == 1 and parameters[0].annotation in (Fields, "Fields")


def options_from(function: Callable[..., Any], fields: Fields) -> dict[str, Any]:
    """Keyword arguments of a function from a table, each of the kind that its annotation says.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    said = declared(function)
    values: dict[str, Any] = {}
    for name, parameter in inspect.signature(function).parameters.items():
        if name in fields.table or parameter.default is inspect.Parameter.empty:
            values[name] = _value(said[name][0] if name in said else float, fields, name)
        else:
            fields.take(name, None)
    return values


def _lists_of_numbers(fields: Fields, name: str) -> tuple[tuple[float, ...], ...]:
    """A list of lists of numbers; how many each has, the record says."""
    lists, at = fields.take(name), fields.at(name)
    if not isinstance(lists, (list, tuple)):
        raise ValueError(f"{at} = {shown(lists)}: must be a list of lists of numbers")
    return tuple(Fields({str(i): each}, at).numbers(str(i)) for i, each in enumerate(lists))


def _type(said: Mapping[str, tuple[Any, Unit]], name: str, fields: Fields) -> Any:
    if name not in said:
        raise ValueError(f"{fields.at(name)}: the annotation of this field names a type that cannot be found")
    return said[name][0]


def _has_default(field: dataclasses.Field[Any]) -> bool:
    return field.default is not dataclasses.MISSING or field.default_factory is not dataclasses.MISSING


def _whole(fields: Fields, name: str) -> int:
    number = fields.number(name)
    if number != int(number):
        raise ValueError(f"{fields.at(name)} = {shown(number)}: must be a whole number")
    return int(number)


def _several(kind: Any, fields: Fields, name: str) -> tuple[Any, ...]:
    """A tuple of numbers, of tuples of numbers, or of records."""
    if kind in (float, Scalar):
        return fields.numbers(name)
    if typing.get_origin(kind) is tuple:
        return _lists_of_numbers(fields, name)
    at = fields.at(name)
    if not (isinstance(kind, type) and field_names(kind) is not None):
        raise ValueError(f"{at}: a field of several {kind} cannot be read from a file")
    tables = fields.take(name)
    if not isinstance(tables, list):
        raise ValueError(f"{at} = {shown(tables)}: must be a list of tables")
    return tuple(record_from(kind, Fields(each, f"{at}[{i}]")) for i, each in enumerate(tables))


def _value(wanted: Any, fields: Fields, name: str) -> Any:
    """A field's value, of the kind that its annotation says."""
    origin, options = typing.get_origin(wanted), typing.get_args(wanted)
    if origin in (typing.Union, types.UnionType):
        wanted = next(each for each in options if each is not type(None))
        origin, options = typing.get_origin(wanted), typing.get_args(wanted)
    if wanted is Vec3:
        return Vec3(*fields.vector(name))
    if wanted in (float, Scalar):
        return fields.number(name)
    if wanted is int:
        return _whole(fields, name)
    if origin is tuple and options:
        return _several(options[0], fields, name)
    value = fields.take(name)
    if hasattr(wanted, "from_table"):
        return wanted.from_table(value, fields.at(name))
    if wanted in (str, bool):
        if not isinstance(value, wanted):
            raise ValueError(
                f"{fields.at(name)} = {shown(value)}: must be {'text' if wanted is str else 'true or false'}"
            )
        return value
    if isinstance(wanted, type) and field_names(wanted) is not None:
        return record_from(wanted, Fields(value, fields.at(name)))
    raise ValueError(f"{fields.at(name)}: a field of type {wanted} cannot be read from a file")
