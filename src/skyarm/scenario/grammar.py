"""Grammar of a scenario file: every word with type, unit, bounds, and when it may be another, from the declarations."""

from __future__ import annotations

import typing
from collections.abc import Iterator
from typing import NamedTuple

from skyarm.algebra import Quaternion, Vec3
from skyarm.algebra.scalars import Scalar
from skyarm.records.leaves import field_names
from skyarm.records.registry import find, names
from skyarm.records.units import Unit, declared_fields, declared_units
from skyarm.records.words import Slot, lifted_fields, slots, words_of_fields
from skyarm.scenario.scenario_record import Scenario
from skyarm.vehicle.linkage import JOINT_NUMBERS, Joint
from skyarm.world.payload import Payload

WHEN = {
    "always": "in flight, between episodes",
    "between": "between episodes",
    "never": "never",
}
"""When a number may change, in words."""


SHAPING = (str, int, bool)
"""Types of entries that shape the program."""


class Row(NamedTuple):
    """One word of a scenario file.

    Attributes:
        path: dotted; ``*`` stands for a name of one's own, ``[]`` for each table of a list.
        of: kind of the table that has the word, where tables have kinds.
        entry: its type, in words.
        unit: SI. bounds: in words. varies: when its numbers may change. whole: a change may replace all of it.
        meaning: in words.
    """

    path: str
    of: str
    entry: str
    unit: str
    bounds: str
    varies: str
    whole: bool
    meaning: str


def grammar() -> tuple[Row, ...]:
    """All words of a scenario file, in the order of their fields, those of registered kinds below their lists."""
    return tuple(row for slot in slots(Scenario) for row in _rows(slot))


def _rows(slot: Slot) -> Iterator[Row]:
    at = f"{slot.path}[]" if _is_list(slot) else slot.path
    varies = WHEN[slot.word.varies]
    unit = slot.unit
    yield Row(at, "", _type(slot.type, slot), unit.unit, _bounds(unit), varies, slot.word.whole, unit.meaning)
    if slot.word.kind:
        for each in slot.word.kind.split():
            for named in names(each):
                kind = find(each, named)
                if field_names(kind) is not None:
                    yield from _of_record(kind, at, varies, named)
    elif slot.path in ("plant", "model"):
        yield from _of_truth(slot.path, slot.type if slot.path == "plant" else None)
    elif field_names(slot.type) is not None and not slot.word.reader:
        yield from _of_record(slot.type, at, varies, "")


def _of_record(kind: type, at: str, varies: str, named: str) -> Iterator[Row]:
    """Words of a record's fields below a table."""
    words = words_of_fields(kind)
    lifted, known = lifted_fields(kind), declared_fields(kind)
    for name, (wanted, unit) in known.items():
        if words.get(name) in known:
            continue  # another spelling of that field's word
        when = f"where {lifted[name]} is stated" if name in lifted else "never" if unit.fixed else varies
        when = when if wanted not in SHAPING else "never"
        yield Row(
            f"{at}.{words.get(name, name)}", named, _type(wanted), unit.unit, _bounds(unit), when, False, unit.meaning
        )


def _of_truth(path: str, truth: object) -> Iterator[Row]:
    """Words of [plant] and [model], whose vehicle is a file of its own."""
    always = WHEN["always"]
    gravity = declared_units(truth)["gravity"][1] if truth is not None else Unit("m/s^2", low=0.0)
    yield Row(f"{path}.vehicle", "", "text", "", "", "never", False, "name of a shipped vehicle, or a path")
    yield Row(f"{path}.gravity", "", "number", gravity.unit, _bounds(gravity), always, False, gravity.meaning)
    yield from _of_record(Payload, f"{path}.payload", always, "")
    known = declared_fields(Joint)
    for name in JOINT_NUMBERS:
        unit = known[name][1]
        words = "number, or one for each joint"
        yield Row(f"{path}.joints.{name}", "", words, unit.unit, _bounds(unit), always, False, unit.meaning)


def _is_list(slot: Slot) -> bool:
    return slot.path == slot.table and typing.get_origin(slot.type) is tuple


def _type(wanted: object, slot: Slot | None = None) -> str:
    """Type of an entry in words."""
    options = [each for each in typing.get_args(wanted) if each is not type(None)]
    plain = {float: "number", Scalar: "number", int: "whole number", str: "text", bool: "true or false"}
    if wanted in plain:
        return plain[wanted]
    if wanted in (Vec3, Quaternion):
        return "three numbers" if wanted is Vec3 else "four numbers"
    if typing.get_origin(wanted) is typing.Literal:
        return " or ".join(repr(each) for each in typing.get_args(wanted))
    if slot is not None and slot.path != slot.table:
        return "table"
    if typing.get_origin(wanted) is tuple:
        return "list of tables" if slot is not None and slot.path == slot.table else f"list of {_type(options[0])}"
    if options and len(options) < len(typing.get_args(wanted)):
        return _type(options[0])
    return "number, list or table: a signal" if getattr(wanted, "registered_as", "") == "signal" else "table"


def _bounds(unit: Unit) -> str:
    """Bounds of a number in words; empty for none."""
    low = f"{'above' if unit.strict else 'at least'} {unit.low:g}" if unit.low > -float("inf") else ""
    high = f"{'below' if unit.strict else 'at most'} {unit.high:g}" if unit.high < float("inf") else ""
    return ", ".join(filter(None, (low, high)))
