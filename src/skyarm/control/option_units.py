"""Type, unit, default, allowed values, meaning and effect of each option of the control
laws.

A field of a law's constants declares its own unit and meaning. ``option_units.toml``
has the others: options that are written otherwise than they are stored, and texts.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

from skyarm.control.blocks.geometric import RATE_ERRORS
from skyarm.control.catalogue import entry_of
from skyarm.control.laws.centroidal.options import GAINS, RANGES, VALUES
from skyarm.control.laws.centroidal.parameters import MODES
from skyarm.control.model import Options, Parameters, Terms
from skyarm.dynamics.actuators.mixer import POLICIES
from skyarm.records.files import shipped_tables
from skyarm.records.immutable import positional
from skyarm.records.leaves import field_names
from skyarm.records.units import (
    NUMBER,
    Unit,
    declared_fields,
    declared_units,
    parameters_of,
)


@positional
class OptionText:
    """Description of one option of a control law for tables and for ``skyarm show
    words``.

    Attributes:
        unit: unit, meaning and bounds.
        entry: type in words; empty for that of ``default``.
        allowed: allowed values in words; empty for the bounds of ``unit``.
        usual: default in words; empty for ``default``.
        effect: effect of a higher or lower value; empty if obvious, or if nobody tunes
            the option.
        default: value in the signature of the law's maker.
    """

    unit: Unit = NUMBER
    entry: str = ""
    allowed: str = ""
    usual: str = ""
    effect: str = ""
    default: object = None


_TEXTS = shipped_tables(__file__)
"""Texts of the options that laws share, and of the options of each law, which change
those."""

_OF_UNIT = ("unit", "meaning", "low", "high", "strict")


def _either(choices: Iterable[str], between: str = " or ") -> str:
    return between.join(f'"{each}"' for each in choices)


CHOICES: Mapping[str, str] = {
    "mixer_policy": _either(POLICIES),
    "rate_error": _either(RATE_ERRORS),
    "mode": _either(MODES),
    "terms": _either(field_names(Terms) or (), ", "),
}
"""Option -> allowed texts in words, where a law does not state its own."""


def _text_of(law: str, option: str) -> OptionText:
    """Description of an option of a law in words; an empty one if there is none."""
    # a law's own text stands last, because it changes the shared one
    row = {**_TEXTS["shared"].get(option, {}), **_TEXTS.get(law, {}).get(option, {})}
    if not row:
        return OptionText()
    unit = Unit(**{name: row.pop(name) for name in _OF_UNIT if name in row})
    return OptionText(unit, **{"allowed": CHOICES.get(option, ""), **row})


COUNTS = {2: "two", 3: "three", 4: "four"}


def option_texts(law: str) -> dict[str, OptionText]:
    """Descriptions of the options of a law or an autopilot, by name, in the order of
    its maker.
    """
    entry = entry_of(law)
    maker = entry.function()
    # of a law of law_maker, of an autopilot, of other functions
    kind = getattr(maker, "constants", getattr(maker, "kind", Parameters))
    fields = declared_fields(kind)
    declared = declared_units(Options) | declared_units(maker)
    usual = {name: each.default for name, each in parameters_of(maker).items()}
    texts = {}
    for option in entry.options():
        own = _text_of(law, option)
        _, unit = fields.get(option) or declared.get(option) or (None, NUMBER)
        value = (
            # its gains are keywords that the signature does not name, so they have no
            # default there
            VALUES.get(option, "")
            if law == "centroidal" and option not in usual
            else usual[option]
        )
        unit = _merge_units(unit, own.unit)
        # its options are checked by a table of ranges and not by fields, so the bounds
        # come from there
        if law == "centroidal" and option in RANGES:
            low, high = RANGES[option]
            unit = replace(unit, low=low, high=high)
        elif law == "centroidal" and option in GAINS:
            unit = replace(unit, low=0.0)
        texts[option] = replace(
            own, unit=unit, default=value, entry=own.entry or _entry(value)
        )
    return texts


def _entry(value: object) -> str:
    """Type of an option in words, from its default; empty if the default does not
    tell.
    """
    if isinstance(value, tuple) and len(value) in COUNTS:
        return f"{COUNTS[len(value)]} numbers"
    types = {bool: "true or false", int: "whole number", float: "number", str: "text"}
    return types.get(type(value), "") if value != "" else ""


def _merge_units(declared: Unit, described: Unit) -> Unit:
    """Unit of a field with the meaning that it has as an option."""
    # a field that says neither unit nor meaning nor bound tells less than the option's
    # text
    if declared is NUMBER or not (
        declared.unit or declared.meaning or math.isfinite(declared.low)
    ):
        return described
    return replace(
        declared,
        unit=declared.unit or described.unit,
        meaning=described.meaning or declared.meaning,
    )
