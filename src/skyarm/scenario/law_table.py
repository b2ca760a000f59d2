"""[controller] with a law: its options in the words of a file."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Mapping
from typing import Any

from skyarm.algebra import Vec3
from skyarm.control.catalogue import (
    LAWS,
    PRESETS,
    full_name,
    make_controller,
    make_tuned,
    preset,
    suitable_options,
    tuned_factors,
)
from skyarm.control.catalogue.law_entries import no_option
from skyarm.control.controller import Controller
from skyarm.control.laws.paper.make import ABLATIONS
from skyarm.control.model import GeometricGains, JointGains, Model, Terms
from skyarm.files import Fields, must_be_one_of, number, shown
from skyarm.records.leaves import is_record, parts
from skyarm.registry.plugins import is_law_of_file

WORDS: Mapping[str, str] = {"mixer_policy": "mixer", "terms": "without"}
"""A file's words for options that are called otherwise."""

PYTHON_ONLY = ("network",)
"""Options that no file can hold."""


def law_words(law: str) -> tuple[str, ...]:
    """Words that a table may have beside a law: its options as a file calls them, and those of any law."""
    options = (WORDS.get(option, option) for option in LAWS[law].options() if option not in PYTHON_ONLY)
    return (*options, *(("tuned",) if law in tuned_factors() else ()), "safety", "servos")


def by_words(fields: Fields, model: Model, known: Mapping[str, Any]) -> Controller:
    """A preset, or a law and its options, for a belief; ``known`` is what it may know of its loop."""
    return preset_from(fields, model, known) if "law" not in fields.table else law_from(fields, model, known)


def preset_from(fields: Fields, model: Model, known: Mapping[str, Any]) -> Controller:
    """The preset of a table, which takes no options."""
    name = fields.take("preset", None)
    if name is None:
        raise ValueError(f"{fields.where}: must have a preset, as 'centroidal_tip', or a law; 'skyarm list' shows all")
    if isinstance(name, str) and name not in PRESETS and name in LAWS:
        raise ValueError(f"{fields.at('preset')} = {name!r}: is no preset but a law: law = {name!r}")
    for word, value in fields.table.items():
        if word not in ("preset", "safety", "servos"):
            raise ValueError(
                f"{fields.at(word)} = {shown(value)}: unknown field; beside a preset only safety and servos are "
                f"allowed, a law in its place takes options"
            )
    return preset(name, model, known)


def law_from(fields: Fields, model: Model, known: Mapping[str, Any]) -> Controller:
    """The law of a table; ``known`` is what it may know of its loop.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    law = fields.table.get("law")
    if is_law_of_file(law):
        raise ValueError(
            f"{fields.at('law')} = {shown(law)}: must not be a file's; only --controller takes FILE.py:make"
        )
    return registered_law_from(fields, model, known)


def registered_law_from(fields: Fields, model: Model, known: Mapping[str, Any]) -> Controller:
    """The same, where the law of a file is allowed that the command line has loaded."""
    law, best = fields.take("law"), fields.take("tuned", False)
    if not isinstance(law, str) or law not in LAWS:
        hint = f"; it is a preset: preset = {law!r}" if isinstance(law, str) and law in PRESETS else ""
        raise ValueError(f"{fields.at('law')} = {shown(law)}: {must_be_one_of(LAWS, law, 'skyarm list')}{hint}")
    if not isinstance(best, bool):
        raise ValueError(f"{fields.at('tuned')} = {shown(best)}: must be true or false")
    law = full_name(law)
    words = law_words(law)
    for word, value in fields.table.items():
        if word not in (*words, "law") and (word, value) != ("tuned", False):
            raise ValueError(f"{fields.at(word)} = {shown(value)}: {no_option(law, word, words)}")
    options = suitable_options(law, known)
    for option in LAWS[law].options():
        word = WORDS.get(option, option)
        if word in fields.table:
            options[option] = _read(fields, law, option, word)
    _require_clock(fields, known)
    return (make_tuned if best else make_controller)(law, model, **options)


def _read(fields: Fields, law: str, option: str, word: str) -> Any:
    """An option's value; tables become the records that they stand for."""
    value, at = fields.take(word), fields.at(word)
    if option in READERS:
        return READERS[option](Fields(value, at))
    if option == "terms":
        return _terms(law, value, at)
    default = inspect.signature(LAWS[law].function()).parameters.get(option)
    if default is None or not is_record(default.default):
        return value
    table = Fields(value, at)
    numbers = {name: table.number(name, usual, low=0.0) for name, usual in parts(default.default).items()}
    table.done()
    return dataclasses.replace(default.default, **numbers)


def _terms(law: str, value: Any, at: str) -> Terms:
    """Terms without those of a list."""
    allowed = ABLATIONS[law]
    if not isinstance(value, list) or any(name not in allowed for name in value):
        there = f"a list of {', '.join(allowed)}" if allowed else f"left out, law {law!r} has nothing to leave out"
        raise ValueError(f"{at} = {shown(value)}: must be {there}")
    return Terms(**dict.fromkeys(value, False))


def _require_clock(fields: Fields, known: Mapping[str, Any]) -> None:
    """Refuse another control period than the loop's: constants hold the delay that was counted with it."""
    if "control_period" not in fields.table:
        return
    at, ticking = fields.at("control_period"), known["control_period"]
    value = number(fields.table["control_period"], at)
    if abs(value / ticking - 1.0) > 1e-6:
        raise ValueError(f"{at} = {value!r}: must be {ticking:g} s, as rates.control has it")


def _gains(fields: Fields) -> GeometricGains:
    names = ("position", "velocity", "attitude", "rate")
    vectors = {name: Vec3(*fields.vector(name)) for name in names}
    fields.done()
    for name, vector in vectors.items():
        for axis, value in zip("xyz", vector, strict=True):
            number(value, f"{fields.where}.{name}.{axis}", low=0.0)
    return GeometricGains(**vectors)


def _joint_gains(fields: Fields) -> JointGains:
    rows = {name: fields.numbers(name, low=0.0) for name in ("stiffness", "damping")}
    fields.done()
    return JointGains(**rows)


READERS: Mapping[str, Callable[[Fields], Any]] = {"gains": _gains, "joint_gains": _joint_gains}
