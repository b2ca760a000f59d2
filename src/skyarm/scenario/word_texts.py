"""Meanings, defaults and allowed values of keys of scenario and vehicle files that no
field of a record declares.

Fields with a unit declare their meaning in the unit. Texts, flags, tables and computed
defaults are described in ``word_texts.toml``, for ``skyarm show words`` and for the
reference pages.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from skyarm.records.files import shipped_tables


class WordText(NamedTuple):
    """Description of one key of a file.

    Attributes:
        meaning: meaning where the field's unit has none.
        default: value that a left-out key has, in words, where the program computes it.
        allowed: allowed values in words, where bounds do not say them.
        effect: effect of a higher or lower value.
        entry: type in words, where that of the field says less.
    """

    meaning: str = ""
    default: str = ""
    allowed: str = ""
    effect: str = ""
    entry: str = ""


_TABLES = shipped_tables(__file__)

PATHS: Mapping[str, WordText] = {
    path: WordText(**texts) for path, texts in _TABLES["paths"].items()
}
"""Key of a scenario file -> its description."""

FIELDS: Mapping[tuple[str, str], WordText] = {
    (kind, name): WordText(**texts)
    for kind, fields in _TABLES["fields"].items()
    for name, texts in fields.items()
}
"""Class of a record and its field -> description, wherever a file has the record."""


def of_field(bases: tuple[str, ...], name: str) -> WordText:
    """Description of a field by the names of its class and base classes; an empty one
    if there is none.
    """
    return next(
        (FIELDS[base, name] for base in bases if (base, name) in FIELDS), WordText()
    )


def of_path(path: str) -> WordText:
    """Description of a key by its path; an empty one if there is none."""
    return PATHS.get(path, WordText())


TYPES: Mapping[str, str] = {
    "Channel": "[errors](scenario_sensors.md) of this channel",
    "Material": "stiffness, damping and friction",
}
"""Class of a field's value -> meaning of a field that states none."""


class HandWord(NamedTuple):
    """Key that a function reads from a table which no record declares.

    Attributes:
        kind: kind of the signal or motion, or table of a vehicle file, or part of a
            scenario file. name: key.
        entry: type in words. meaning: in words; empty where ``PATHS`` has it. unit: SI.
            default: in words; empty for a required key.
        allowed: allowed values in words. bounds: bounds of a number in words.
        varies: when it may change, a key of ``skyarm.scenario.grammar.WHEN``; empty for
            always of numbers and never of others.
    """

    kind: str
    name: str
    entry: str
    meaning: str = ""
    unit: str = ""
    default: str = ""
    allowed: str = ""
    bounds: str = ""
    varies: str = ""


def _by_hand(table: str) -> tuple[HandWord, ...]:
    return tuple(
        HandWord(kind, name, **texts)
        for kind, keys in _TABLES[table].items()
        for name, texts in keys.items()
    )


SIGNALS, MOTIONS = _by_hand("signals"), _by_hand("motions")
"""Keys of the signals, and of the motions but for tasks, that are read by hand."""

PARTS = _by_hand("parts")
"""Keys of a scenario file that readers take beside those of records, by part of the
file or class of the record."""

TASKS = _by_hand("tasks")
"""Keys of motions, of studies, suites and other tables that functions read, by kind."""

IMPORTS: tuple[tuple[str, str, str, str], ...] = tuple(
    (each["form"], each["found"], each["read"], each.get("gaps", ""))
    for each in _TABLES["imports"]
)
"""Format of a file, what stands there, how a vehicle has it, and what the file lacks of
a rotor.
"""

PHASES, GUARDS = _by_hand("phases"), _by_hand("until")
"""Keys of the phases of a task by the kinds that have them, and of ``until`` by what
they are: conditions or others."""

VEHICLE = _by_hand("vehicle")
"""Keys of a vehicle file that are no field of a record, or mean more than the field."""
