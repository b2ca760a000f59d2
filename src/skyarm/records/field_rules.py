"""Checks of dataclass fields, derived from their type annotations.

``mass: Annotated[Scalar, Unit("kg", low=0.0)]`` is coerced and checked as such when the
record is made (:func:`accept_fields`), and described in those words in exported files
and documents (:mod:`skyarm.records.units`). A field without a :class:`Unit` is checked
by its type alone: the records of plugins need none.
"""

from __future__ import annotations

import math
import types
import typing
from collections.abc import Callable, Mapping
from functools import partial
from operator import attrgetter
from typing import Any, TypeGuard, TypeVar

from skyarm.algebra import Mat3, Quaternion, Scalar, Sym3, Vec3
from skyarm.records import coerce
from skyarm.records.coerce import RecordError, Rule, concrete, refuse
from skyarm.records.immutable import declarations, memoize
from skyarm.records.leaves import values_named, values_of
from skyarm.records.units import Unit, declared_fields

Record = TypeVar("Record")

Several = TypeVar("Several", Vec3, Quaternion)


WHOLE = 2**53
"""Integers below this size are exact as floats."""


def accept_fields(
    record: object, where: str, error: type[ValueError] = RecordError
) -> None:
    """Check all fields of a frozen dataclass under construction, and convert them to
    their stored types.

    Args:
        record: a dataclass, in its ``__post_init__``.
        where: name of the record in messages; empty for none.
        error: class of what is raised.

    Raises:
        ValueError: of the class ``error``: one line with field, value and what is
            allowed.
    """
    kind = type(record)
    given = zip(rules(kind).items(), _checked_values(kind)(record), strict=True)
    try:
        for (name, rule), value in given:
            converted = rule(f"{where}.{name}" if where else name, value)
            if converted is not value:
                # frozen records are set past their own guard while they are made
                object.__setattr__(record, name, converted)
    # rules raise one class; each record has an error of its own for its users
    except RecordError as refusal:
        raise error(str(refusal)) from None


def checked(
    where: str, error: type[ValueError] = RecordError, *, often: bool = False
) -> Callable[[type[Record]], type[Record]]:
    """Decorator, below ``immutable``, of dataclasses that need no more than checks of
    their fields when constructed.

    Args:
        where: as of :func:`accept_fields`.
        error: as there.
        often: True for records that are made in every period or stage of an integrator:
            values that have the fields' own types already are not looked at.
    """

    def mark(kind: type[Record]) -> type[Record]:
        def check(record: object) -> None:
            own = type(record)
            if not often or not _are_stored(
                own, tuple(map(type, _checked_values(own)(record)))
            ):
                accept_fields(record, where, error)

        kind.__post_init__ = check  # type: ignore[attr-defined]
        return kind

    return mark


@memoize
def _are_stored(kind: type, given: tuple[type, ...]) -> bool:
    """True if values of some types are those that a dataclass stores in its fields of
    :func:`rules`.
    """
    declared = declared_fields(kind)
    stored = (declared[name][0] for name in rules(kind))
    return all(
        each in (float, int)
        if annotation is Scalar
        else each is (typing.get_origin(annotation) or annotation)
        for each, annotation in zip(given, stored, strict=True)
    )


def require_fields(record: object, where: str, skipped: tuple[type, ...] = ()) -> None:
    """Raise an error if a field of a dataclass, at any depth, has a value that its
    annotation does not allow.

    Args:
        record: a dataclass, a tuple of them, or anything else, which passes.
        where: name of it in messages.
        skipped: classes whose records are checked where they are made.

    Raises:
        RecordError: one line with field, value and what is allowed.
    """
    if isinstance(record, skipped):
        return
    if isinstance(record, tuple):
        for i, item in enumerate(record):
            require_fields(item, f"{where}[{i}]", skipped)
    elif (values := values_of(type(record))) is not None:
        checks, usual = rules(type(record)), defaults(type(record))
        for (name, default), value in zip(usual.items(), values(record), strict=True):
            at = f"{where}.{name}"
            # a default says itself what a field may hold
            if name in checks and value is not default:
                checks[name](at, value)
            # numbers and texts, which are most values, contain no others
            if type(value) not in (float, int, str, bool):
                require_fields(value, at, skipped)


@memoize
def rules(kind: type) -> Mapping[str, Rule]:
    """Check and conversion of each field of a dataclass, by field name; fields with
    nothing to check are left out.
    """
    by_field = {
        name: _rule(annotation, unit)
        for name, (annotation, unit) in declared_fields(kind).items()
    }
    return {name: rule for name, rule in by_field.items() if rule is not None}


@memoize
def _checked_values(kind: type) -> Callable[[object], tuple[object, ...]]:
    """Function that takes the values of a dataclass' fields of :func:`rules`."""
    return values_named([*rules(kind)])


@memoize
def defaults(kind: type) -> Mapping[str, object]:
    """Default of each field of a dataclass; ``dataclasses.MISSING`` for none and for a
    default factory.
    """
    return {field.name: field.default for field in declarations(kind)}


def _rule(annotation: object, unit: Unit) -> Rule | None:
    """Function that checks and converts values of an annotated type; None if there is
    nothing to check.
    """
    if unit.rule is not None:
        return _with_bounds(unit.rule, unit)
    origin, options = typing.get_origin(annotation), typing.get_args(annotation)
    # the first member decides: a union's rule tries its options in order
    if origin in (typing.Union, types.UnionType):
        return _one_of(options, unit)
    if annotation in _NUMBERS:
        return _numeric(annotation, unit)
    # checks of a record's class are cheap, so no rule is made for each item
    if origin is tuple and len(options) == 2 and options[1] is Ellipsis:
        if _is_record(options[0]):
            return _many_records(options[0])
        return _many(_rule(options[0], unit), None, options[0] is Scalar)
    if origin is tuple:
        return _many(None, tuple(_rule(each, unit) for each in options))
    if origin is typing.Literal:
        return coerce.word_of(options)
    if origin is not None and issubclass(origin, Callable):  # type: ignore[arg-type]
        return _callable
    if annotation in (bool, str):
        return coerce.flag if annotation is bool else coerce.text
    return coerce.one(annotation) if _is_record(annotation) else None


def _with_bounds(rule: Rule, unit: Unit) -> Rule:
    """Extend a field's own conversion function by a check of the field's bounds."""

    def check(field: str, value: object) -> object:
        converted = rule(field, value)
        if isinstance(converted, (Vec3, Sym3)):
            for name in type(converted).__slots__:
                if concrete(each := getattr(converted, name)):
                    _within(f"{field}.{name}", each, unit)
        # True is a number to Python, and no bound is meant for it
        elif concrete(converted) and type(converted) is not bool:
            _within(field, converted, unit)
        return converted

    return check


def _numeric(annotation: object, unit: Unit) -> Rule:
    """Make a check for a number, vector or matrix.

    Numbers of the stored type between the bounds, as almost all are, pass it at once.
    """
    make, stored = _NUMBERS[annotation], _STORED.get(annotation, ())
    low = max(unit.low, -unit.largest, -WHOLE)
    high = min(unit.high, unit.largest, WHOLE)
    if annotation in (Vec3, Quaternion):
        numbers = attrgetter(*annotation.__slots__)

        def several(field: str, value: Any) -> object:
            if type(value) is annotation:
                for each in numbers(value):
                    if not (type(each) in stored and low < each < high):
                        break
                else:
                    return value
            return make(field, value, unit)

        return several

    def one(field: str, value: Any) -> object:
        # a bound itself goes to make, which knows whether it is allowed
        if type(value) in stored and low < value < high:
            return value
        return make(field, value, unit)

    return one


def _is_record(annotation: object) -> TypeGuard[type]:
    """True if an annotation is a class whose instances ``isinstance`` can test, such as
    a dataclass.
    """
    # numbers have rules of their own, and a protocol cannot be tested by isinstance
    said = isinstance(annotation, type) and annotation not in (
        Any,
        object,
        bool,
        str,
        *_NUMBERS,
    )
    # a generic class has it, too: False
    return said and not getattr(annotation, "_is_protocol", False)


def _number(field: str, value: object, unit: Unit) -> Scalar:
    """Convert a number and check its bounds; the number stays variable in compiled
    code.
    """
    # a float needs no conversion: this is the case of almost every field
    converted = value if type(value) is float else coerce.number(field, value)
    if type(converted) is float:
        _within(field, converted, unit)
    return converted


def accept_scalar(field: str, value: object, unit: Unit) -> Scalar:
    """Convert a scalar to its stored type and check the bounds of its unit; integers
    become constants of compiled code.

    Raises:
        RecordError: one line with field, value and what is allowed.
    """
    if type(value) is int and abs(value) < WHOLE:
        _within(field, value, unit)
        return value
    return _number(field, value, unit)


def _whole(field: str, value: object, unit: Unit) -> int:
    """Convert a whole number (an index, a count) and check its bounds."""
    converted = coerce.whole(field, value)
    if abs(converted) >= WHOLE:
        refuse(field, value, "must be below 2**53 in size")
    _within(field, converted, unit)
    return converted


def _within(field: str, value: float, unit: Unit) -> None:
    if math.isnan(value) or (math.isinf(value) and not unit.infinite):
        refuse(
            field, value, f"must be a {'number' if unit.infinite else 'finite number'}"
        )
    # such as 60 or [-15, 15]
    end = " rad, not degrees" if unit.unit == "rad" and abs(value) > math.tau else ""
    if value < unit.low or (unit.strict and value == unit.low):
        refuse(
            field,
            value,
            f"must be {'above' if unit.strict else 'at least'} {unit.low:g}{end}",
        )
    # an infinite bound that is strict excludes nothing
    if value > unit.high or (unit.strict and value == unit.high < math.inf):
        refuse(
            field,
            value,
            f"must be {'below' if unit.strict else 'at most'} {unit.high:g}{end}",
        )
    if abs(value) > unit.largest:
        refuse(
            field,
            value,
            f"must be at most {unit.largest:g}{' in size' if unit.low < 0.0 else ''}",
        )


def _numbers(
    field: str,
    value: object,
    unit: Unit,
    kind: type[Several],
    letters: str,
    allowed: str,
) -> Several:
    """Convert a list of plain numbers, or an instance of the class, to a vector or
    quaternion class.
    """
    if isinstance(value, kind):
        given = [getattr(value, letter) for letter in letters]
        converted = [
            accept_scalar(f"{field}.{letter}", each, unit)
            for letter, each in zip(letters, given, strict=True)
        ]
        return (
            value
            if all(a is b for a, b in zip(converted, given, strict=True))
            else kind(*converted)
        )
    entries = [
        _number(field, each, unit)
        for each in coerce.items(field, value, (len(letters),), allowed)
    ]
    return kind(
        *(
            0 if unit.folds and concrete(each) and each == 0.0 else each
            for each in entries
        )
    )


_NUMBERS: Mapping[object, Callable[[str, object, Unit], object]] = {
    float: _number,
    int: _whole,
    Scalar: accept_scalar,
    Vec3: partial(_numbers, kind=Vec3, letters="xyz", allowed="must be three numbers"),
    Quaternion: partial(
        _numbers,
        kind=Quaternion,
        letters="wxyz",
        allowed="must be four numbers (w x y z)",
    ),
    Mat3: lambda field, value, _unit: coerce.matrix(field, value),
    Sym3: lambda field, value, _unit: coerce.inertia(field, value),
}


_STORED: Mapping[object, tuple[type, ...]] = {
    float: (float,),
    int: (int,),
    Scalar: (float, int),
    Vec3: (float, int),
    Quaternion: (float, int),
}
"""Types of the numbers that a field of each annotation stores as they are."""


def _one_of(options: tuple[object, ...], unit: Unit) -> Rule | None:
    """Make a check for a union type: the first member type that accepts a value
    converts it.
    """
    members = [each for each in options if each is not type(None)]
    member_rules = [
        rule for rule in (_rule(each, unit) for each in members) if rule is not None
    ]
    # one member without a rule accepts anything, so the union cannot refuse
    if len(member_rules) < len(members):
        return None
    kinds = tuple(each for each in members if _is_record(each))
    names = " or ".join(
        [
            *(each.__name__ for each in kinds),
            *(["None"] if type(None) in options else []),
        ]
    )

    def rule(field: str, value: object) -> object:
        if value is None and type(None) in options:
            return None
        # one message for all records, where the last rule's would name one
        if len(kinds) == len(member_rules):
            return (
                value
                if isinstance(value, kinds)
                else refuse(field, value, f"must be a {names}")
            )
        if len(member_rules) == 1:
            return member_rules[0](field, value)
        for each in member_rules:
            try:
                return each(field, value)
            except RecordError as error:
                refusal = error
        raise refusal

    return rule


def _many(
    each: Rule | None, exactly: tuple[Rule | None, ...] | None, scalars: bool = False
) -> Rule:
    """Make a check for a tuple type, with one check for all items or one check for each
    item.

    Whole numbers of a plain list of scalars are data.
    """

    def rule(field: str, value: object) -> object:
        if not coerce.is_sequence(value):
            refuse(field, value, "must be a sequence")
        given = value if isinstance(value, tuple) else tuple(value)
        if exactly is not None and len(given) != len(exactly):
            refuse(field, value, f"must have {len(exactly)} items")
        checks = exactly or (each,) * len(given)
        converted = tuple(
            item if follow is None else follow(f"{field}[{i}]", item)
            for i, (follow, item) in enumerate(zip(checks, given, strict=True))
        )
        # structure is stated by a tuple in code; a plain list comes from a file and is
        # data
        if given is not value and scalars:
            return tuple(
                float(item) if type(item) is int else item for item in converted
            )
        return (
            value
            if given is value
            and all(a is b for a, b in zip(converted, given, strict=True))
            else converted
        )

    return rule


def _many_records(kind: type) -> Rule:
    """Make a check for a tuple of any length whose items are instances of one class."""
    item: Rule = coerce.one(kind)

    def rule(field: str, value: object) -> object:
        if not coerce.is_sequence(value) or isinstance(value, _ALONE):
            refuse(field, value, f"must be a tuple of {kind.__name__}")
        records = value if isinstance(value, tuple) else tuple(value)
        for i, each in enumerate(records):
            if not isinstance(each, kind):
                item(f"{field}[{i}]", each)
        return records

    return rule


_ALONE = (Vec3, Quaternion)
"""Records that are iterable and nevertheless count as one value, not as a list."""


def _callable(field: str, value: object) -> object:
    if not callable(value):
        refuse(field, value, "must be a function")
    return value
