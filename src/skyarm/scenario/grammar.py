"""Grammar of a scenario file: its keys with type, unit, bounds and the times at which
they may change.

Left out are the words of tasks (``waypoints``, ``phases``), of ``reference.tip``,
``push`` and ``object``, which functions read from a table (:data:`BY_HAND`). The
documents list them.
"""

from __future__ import annotations

import dataclasses
import math
import re
import typing
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

from skyarm.algebra import Quaternion, Scalar, Vec3
from skyarm.control.catalogue import AUTOPILOTS, LAWS, PRESETS, entry_of
from skyarm.control.model import Model, Options, Terms
from skyarm.control.option_units import option_texts
from skyarm.control.safety.limits import Limits
from skyarm.dynamics.state import State
from skyarm.log.metrics.windows import Window
from skyarm.records.field_rules import defaults
from skyarm.records.immutable import stated_fields
from skyarm.records.leaves import field_names, is_record_class
from skyarm.records.read_table import takes_table
from skyarm.records.registry import find, names
from skyarm.records.units import NUMBER, Unit, declared_fields, declared_units
from skyarm.records.words import Slot, lifted_fields, slots, words_of_fields
from skyarm.reference.planned_motion import PlannedBody
from skyarm.reference.signal_tables import SignalList
from skyarm.reference.signals import Signal
from skyarm.scenario import word_texts
from skyarm.scenario.controller_table import option_words
from skyarm.scenario.path_governor import GovernorOptions
from skyarm.scenario.scenario_record import SETTINGS, Scenario
from skyarm.vehicle import Joint, Vehicle
from skyarm.vehicle.linkage import JOINT_NUMBERS
from skyarm.world.gust import SHAPES, Gust
from skyarm.world.payload import Payload
from skyarm.world.signal_vector import SignalVector

WHOLE = "as a whole in flight"
"""Description of a part that a scheduled change may replace as a whole."""

WHEN = {
    "always": "in flight, between episodes",
    "between": "between episodes",
    "never": "never",
    "whole": WHOLE,
    "whole and numbers": f"{WHOLE}; its numbers in flight, between episodes",
}
"""Times at which a number may change -> their description in words."""

SHAPING = (str, int, bool)
"""Types of entries that determine the structure of the compiled program."""

SIGNAL = "number, list or table: a signal"

ENTRIES: Mapping[object, str] = {
    **{
        float: "number",
        Scalar: "number",
        int: "whole number",
        str: "text",
        bool: "true or false",
    },
    **{
        Vec3: "three numbers",
        Quaternion: "four numbers",
        Window: "[start, stop]",
        Terms: "list of names",
    },
    **{
        "Command": SIGNAL,
        SignalList: "list of signals",
        SignalVector: "list of three signals",
    },
}
"""Description in words of the entry for each type that is not a table of its fields."""

NAMED_BY = {"environment.wind": "mode", "team": "law"}
"""Keys that name the class of a table otherwise than by ``kind``, by the table's
path."""

NO_WORDS = (("Fault", "signal"), ("Team", "motion"))
"""Fields that have no key of their own because another key states them, by class and
field."""

BY_HAND = ("reference.base", "reference.tip", "reference.push", "reference.object")
"""Tables of which some or all keys, except the kinds, are not listed."""


class GrammarRow(NamedTuple):
    """One key of a scenario file, with its type, unit, bounds and meaning.

    Attributes:
        path: dotted; ``*`` stands for a name of one's own, ``[]`` for each item of a
            list, ``SIGNAL`` for any signal.
        of: kind of the table that has the word, where tables have kinds.
        entry: its type, in words.
        unit: SI. bounds: bounds in words. varies: times at which its numbers may
            change.
        whole: True if a change may replace all of it.
        meaning: meaning in words.
        effect: consequence of a higher or lower value, of a number that people tune.
        default: value of a key that is left out, or "required".
    """

    path: str
    of: str
    entry: str
    unit: str = ""
    bounds: str = ""
    varies: str = WHEN["never"]
    whole: bool = False
    meaning: str = ""
    effect: str = ""
    default: str = ""


def grammar() -> tuple[GrammarRow, ...]:
    """List the keys of a scenario file in field order; keys of registered classes
    follow the key that holds them.
    """
    of_slots = (row for slot in slots(Scenario) for row in _rows(slot))
    rows = (
        GrammarRow("schema", "", "whole number", bounds="1"),
        *of_slots,
        *_by_hand(word_texts.PARTS, "top"),
        *_of_signals(),
    )
    return tuple(map(_with_texts, rows))


def _with_texts(row: GrammarRow) -> GrammarRow:
    """Row with the meaning and the default that only the texts of its path have."""
    text = word_texts.of_path(row.path) if not row.of else word_texts.WordText()
    return row._replace(
        entry=text.entry or row.entry,
        meaning=text.meaning or row.meaning,
        effect=text.effect or row.effect,
        default=text.default or row.default,
    )


def without_links(row: GrammarRow) -> GrammarRow:
    """Row for a terminal: links of the reference page are their words."""
    return row._replace(
        meaning=LINK.sub(r"\1", row.meaning), default=LINK.sub(r"\1", row.default)
    )


LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")
"""Link of Markdown."""


def default_in_words(value: object) -> str:
    """Default value as a file writes it; "required" if there is none, empty for a
    table.
    """
    if value is dataclasses.MISSING:
        return "required"
    if value is None or value in ((), ""):
        return "none"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, float | int):
        return "no limit" if math.isinf(value) else _exact(value)
    if isinstance(value, Vec3 | Quaternion | tuple) and all(
        isinstance(each, float | int) for each in value
    ):
        return "[" + ", ".join(map(_exact, value)) + "]"
    return ""


def _exact(value: float) -> str:
    """Number with the digits that a file needs for the same one."""
    # ten digits where they are the same number, else all that it has
    text = f"{value:.10g}"
    return text if float(text) == value else repr(float(value))


def _of_signals() -> Iterator[GrammarRow]:
    """Keys of time signals whose class is a dataclass, and the kinds of all time
    signals.
    """
    yield GrammarRow(
        "SIGNAL.kind",
        "",
        _one_of(names("signal")),
        meaning="of every signal that is a table",
    )
    for named in names("signal"):
        kind = find("signal", named)
        if isinstance(kind, type):
            yield from _of_record(kind, "SIGNAL", WHEN["always"], named)
        yield from _by_hand(word_texts.SIGNALS, named, "SIGNAL", named)


def _by_hand(
    keys: tuple[word_texts.HandWord, ...], named: str, at: str = "", of: str = ""
) -> Iterator[GrammarRow]:
    """Keys that a function reads from the table of a kind, or from another part of a
    file.

    Args:
        keys: descriptions of keys of many kinds and parts.
        named: the kind or part.
        at: path of its table; empty for the top of a file.
        of: the kind, where a table has kinds.
    """
    for each in keys:
        if each.kind == named:
            entry = SIGNAL if each.entry == "signal" else each.entry
            numbers = "number" in entry or entry == SIGNAL
            yield GrammarRow(
                f"{at}.{each.name}" if at else each.name,
                of,
                entry,
                each.unit,
                each.bounds,
                WHEN[each.varies or ("always" if numbers else "never")],
                each.varies == "whole and numbers",
                each.meaning,
                "",
                each.default or "required",
            )


def _of_unit(
    path: str,
    of: str,
    entry: str,
    unit: Unit,
    varies: str,
    default: str = "",
    *,
    whole: bool = False,
) -> GrammarRow:
    """Row of a key whose field declares unit, bounds and meaning; the other arguments
    are fields of the row.
    """
    return GrammarRow(
        path,
        of,
        entry,
        unit.unit,
        _bounds(unit),
        varies,
        whole,
        unit.meaning,
        unit.effect,
        default,
    )


def _rows(slot: Slot) -> Iterator[GrammarRow]:
    at = f"{slot.path}[]" if slot.is_list else slot.path
    varies = WHEN[slot.word.varies]
    entry = _slot_entry(slot)
    when = varies
    if slot.word.varies == "always" and "table" in entry:
        when = f"its numbers {varies}"
    if slot.word.whole:
        when = f"{WHOLE}; {when}" if slot.word.varies == "always" else WHOLE
    yield _of_unit(
        at,
        "",
        entry,
        slot.unit,
        when,
        default_in_words(slot.default),
        whole=slot.word.whole,
    )
    if slot.word.kind:
        kinds = [named for each in slot.word.kind.split() for named in names(each)]
        usual = f" ({slot.word.usual} if left out)" if slot.word.usual else ""
        yield GrammarRow(
            f"{at}.{NAMED_BY.get(slot.path, 'kind')}", "", f"{_one_of(kinds)}{usual}"
        )
        for each in slot.word.kind.split():
            for named in names(each):
                kind = find(each, named)
                if field_names(kind) is not None:
                    yield from _of_record(kind, at, varies, named)
    elif slot.path in ("plant", "model"):
        yield from _of_truth(slot.path, slot.type if slot.path == "plant" else None)
    elif slot.path in SPECIAL:
        yield from SPECIAL[slot.path]()
    else:
        for kind in _records_in(slot.type):
            yield from _of_record(kind, at, varies, "")


def _slot_entry(slot: Slot) -> str:
    """Description of the entry that a file may have for a key, such as a number, one of
    some names, or a table.
    """
    if slot.place[0] == "solver":
        return _one_of({"kind": names("plant"), **SETTINGS}[slot.place[1]])
    if slot.path == "reference.governor":
        return "true, false or a table"
    if slot.is_list:
        return "list of tables"
    return "table" if slot.path != slot.table else entry_in_words(slot.type)


def _of_record(
    kind: type,
    at: str,
    varies: str,
    named: str,
    called: Mapping[str, str] | None = None,
) -> Iterator[GrammarRow]:
    """Keys for the fields of a dataclass below a table, and for the fields of
    dataclasses inside it.

    Args:
        kind: class of the record.
        at: path of the table.
        varies: times at which its numbers may change.
        named: kind of the registry.
        called: fields that the record around it calls otherwise.
    """
    called = called or {}
    keys = {**words_of_fields(kind), **called}
    lifted, declared, usual = lifted_fields(kind), declared_fields(kind), defaults(kind)
    bases = [each.__name__ for each in kind.__mro__]
    inside: set[tuple[str, type]] = set()
    for name, (annotation, unit) in declared.items():
        if any((base, name) in NO_WORDS for base in bases) or (
            name not in stated_fields(kind)
        ):
            continue
        word = keys.get(name, name)
        is_list = typing.get_origin(annotation) is tuple and _records_in(annotation)
        lists = "[]" if is_list and word == name else ""
        # else it is another spelling of that field's word
        if keys.get(name) not in declared:
            when = "never" if unit.fixed else varies
            if name in lifted:
                when = f"where {lifted[name]} is stated"
            # a quotation mark is of a choice of texts, which shapes the program, too
            if annotation in SHAPING or "'" in entry_in_words(annotation):
                when = "never"
            text = word_texts.of_field(tuple(bases), name)
            entry = text.entry or entry_in_words(annotation)
            held = next((each.__name__ for each in _records_in(annotation)), "")
            meaning = text.meaning or unit.meaning or word_texts.TYPES.get(held, "")
            row = _of_unit(
                f"{at}.{word}{lists}",
                named,
                entry,
                unit,
                when,
                text.default or default_in_words(usual[name]),
            )._replace(meaning=meaning, effect=text.effect or unit.effect)
            blows = called.get("peak", "")
            if blows and name == "peak":
                in_unit, meaning = PEAKS[blows]
                row = row._replace(unit=in_unit, meaning=meaning)
            elif kind is Gust and name == "shape":
                # of a gust of force a file states the first alone
                shapes = SHAPES[:1] if blows == "force" else SHAPES
                row = row._replace(entry=_one_of(shapes))
            yield row
        for each in _records_in(annotation):
            # a record that has one of its own kind would never end
            if (word, each) not in inside and each is not kind:
                inside.add((word, each))
                peak = (
                    {"peak": kind.blows}
                    if each is Gust and hasattr(kind, "blows")
                    else None
                )
                yield from _of_record(each, f"{at}.{word}{lists}", varies, named, peak)
                yield from _by_hand(
                    word_texts.PARTS, each.__name__, f"{at}.{word}", named
                )


PEAKS: Mapping[str, tuple[str, str]] = {
    "force": ("N", "largest force of the gust, world axes"),
    "velocity": ("m/s", "largest air velocity of the gust, world axes"),
}
"""Word of a gust's peak in a file -> unit and meaning."""


def _of_truth(path: str, truth: object) -> Iterator[GrammarRow]:
    """Keys of [plant] and [model], without those of the vehicle, which has a file of
    its own.
    """
    always = WHEN["always"]
    gravity = declared_units(Model if truth is None else truth)["gravity"][1]
    yield GrammarRow(f"{path}.vehicle", "", "text")
    yield _of_unit(f"{path}.gravity", "", "number", gravity, always)
    yield from _of_record(Payload, f"{path}.payload", always, "")
    declared = declared_fields(Joint)
    for name in JOINT_NUMBERS:
        yield _of_unit(
            f"{path}.joints.{name}",
            "",
            "number, or one for each joint",
            declared[name][1],
            always,
            "the vehicle's",
        )


def _of_controller() -> Iterator[GrammarRow]:
    """Keys of [controller]: presets, laws and autopilots, the options of each, and the
    layers around a law.
    """
    yield GrammarRow("controller.preset", "", _one_of(PRESETS), varies=WHOLE)
    yield GrammarRow("controller.law", "", _one_of(LAWS), varies=WHOLE)
    yield GrammarRow("controller.autopilot", "", _one_of(AUTOPILOTS))
    yield from _by_hand(word_texts.PARTS, "controller", "controller")
    yield from _of_record(Limits, "controller.safety", WHEN["always"], "")
    yield from _by_hand(word_texts.PARTS, "safety", "controller.safety")
    for law in (*LAWS, *AUTOPILOTS):
        kinds = declared_units(Options) | declared_units(entry_of(law).function())
        texts = option_texts(law)
        for word, option in option_words(law).items():
            text, annotation = texts[option], kinds.get(option, (None, NUMBER))[0]
            entry = text.entry or (
                "as the law takes it"
                if annotation is None
                else entry_in_words(annotation)
            )
            yield _of_unit(
                f"controller.{word}",
                law,
                entry,
                text.unit,
                WHOLE,
                text.usual or default_in_words(text.default),
            )._replace(
                bounds=text.allowed.replace("`", "") or _bounds(text.unit),
                effect=text.effect or text.unit.effect,
            )
            for each in _records_in(annotation):
                yield from _of_record(each, f"controller.{word}", WHEN["always"], law)


def _of_reference() -> Iterator[GrammarRow]:
    """Keys of [reference], except those of motions and signals that read their whole
    table themselves.
    """
    yield from _by_hand(word_texts.PARTS, "base", "reference")
    yield GrammarRow("reference.base.kind", "", _one_of(names("motion")))
    for named in names("motion"):
        yield from _by_hand(word_texts.MOTIONS, named, "reference.base", named)
        make = find("motion", named)
        if not takes_table(make) and "setting" not in declared_units(make):
            for name, (annotation, unit) in declared_units(make).items():
                if name != "return":
                    yield _of_unit(
                        f"reference.base.{name}",
                        named,
                        entry_in_words(annotation),
                        unit,
                        WHEN["always"],
                    )
    yield from _by_hand(word_texts.PARTS, "reference", "reference")
    yield from _of_record(PlannedBody, "reference.planned", WHEN["never"], "")


def _of_start() -> Iterator[GrammarRow]:
    """Keys of [initial]."""
    yield from _of_record(State, "initial", WHEN["between"], "")
    yield from _by_hand(word_texts.PARTS, "initial", "initial")


SPECIAL: Mapping[str, Callable[[], Iterator[GrammarRow]]] = {
    "controller": _of_controller,
    "reference": _of_reference,
    "initial": _of_start,
    "reference.governor": lambda: _of_record(
        GovernorOptions, "reference.governor", WHEN["never"], ""
    ),
}
"""Tables whose keys differ from the fields of their record, each with the function that
lists them."""


def _records_in(annotation: object) -> tuple[type, ...]:
    """Dataclasses within a field's type that a file writes as tables; none for a
    vehicle, which has its own file.
    """
    options = typing.get_args(annotation)
    if options:
        return tuple(record for each in options for record in _records_in(each))
    if (
        not is_record_class(annotation)
        or _in_words(annotation)
        or annotation is Vehicle
    ):
        return ()
    return () if issubclass(annotation, Signal) else (annotation,)


def _in_words(annotation: object) -> str:
    """Description of the entry for a type in a file; empty for a type that is written
    as a table of its fields.
    """
    return ENTRIES.get(annotation) or ENTRIES.get(
        getattr(annotation, "__name__", ""), ""
    )


def entry_in_words(annotation: object) -> str:
    """Description of the entry for a type in a file."""
    options = [each for each in typing.get_args(annotation) if each is not type(None)]
    if words := _in_words(annotation):
        return words
    if typing.get_origin(annotation) is typing.Literal:
        return _one_of(options)
    if typing.get_origin(annotation) is tuple:
        inner = entry_in_words(options[0])
        return {"number": "list of numbers", "table": "list of tables"}.get(
            inner, f"list of {inner}"
        )
    if options and len(options) < len(typing.get_args(annotation)):
        return entry_in_words(options[0])
    return (
        SIGNAL
        if isinstance(annotation, type) and issubclass(annotation, Signal)
        else "table"
    )


def _one_of(texts: typing.Iterable[object]) -> str:
    """Text that lists the allowed values of an entry."""
    return " or ".join(map(repr, texts))


def _bounds(unit: Unit) -> str:
    """Text of a number's bounds; empty if it has none."""
    low = (
        f"{'above' if unit.strict else 'at least'} {unit.low:g}"
        if unit.low > -float("inf")
        else ""
    )
    high = (
        f"{'below' if unit.strict else 'at most'} {unit.high:g}"
        if unit.high < float("inf")
        else ""
    )
    return ", ".join(filter(None, (low, high)))
