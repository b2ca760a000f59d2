"""Gains from a file: a law by its words, and numbers in place of those of its constants.

``skyarm tune`` writes such files, and anyone may. A scenario names one by ``[controller] tuned = "FILE.toml"``, a
command line by ``--controller FILE.toml``::

    schema = 1
    [law]                 the words of a scenario's [controller]: preset, or law and its options
    [gains]               "gains.position" = 4.2, or a list: all numbers below a path of the law's constants
    [about]               where they come from; nothing of it is flown

A law of someone's own, FILE.py:make, must have been loaded: ``--plugin FILE.py`` does so; no file that is read runs
code.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from skyarm.control.catalogue import make_named
from skyarm.control.controller import Controller
from skyarm.control.model import Model
from skyarm.files import Fields, all_wrong_words, did_you_mean, number, read_toml, shown, unreadable
from skyarm.files.names import require_kind
from skyarm.records.leaves import Place, is_leaf, is_record, parts, walk
from skyarm.records.replace_parts import replaced
from skyarm.registry.plugins import is_law_of_file, register_loaded_law
from skyarm.registry.registrations import LOADED_BY
from skyarm.scenario.law_table import by_words, registered_law_from

SUFFIX = ".toml"


def is_gains_file(name: Any) -> bool:
    """Whether the name of a controller is that of a file of gains."""
    return isinstance(name, str) and name.endswith(SUFFIX)


def make_named_or_tuned(name: str, model: Model, known: Mapping[str, Any]) -> Controller:
    """A controller by its name in the catalogue, or by the path of a file of gains.

    Raises:
        ValueError: one line.
    """
    if is_gains_file(name):
        return controller_of_file(name, Path(), model, known, "controller")
    return make_named(name, model, known)


def load_controller(
    file: str | Path,
    model: Model,
    *,
    delay: float = 0.0,
    control_period: float = 0.005,
    reference_period: float = 0.02,
) -> Controller:
    """The law of a file of gains, as ``skyarm tune`` writes it, for a belief.

    Args:
        file: path, .toml.
        model: what the law believes.
        delay: known age of the measurement, s; for laws with such an option, as all that follow.
        control_period: s.
        reference_period: between published samples, s.

    Raises:
        ValueError: one line: file, field, value, what is allowed.
    """
    if not isinstance(model, Model):
        raise ValueError(f"model = {shown(model)}: must be a Model of vehicle and gravity")
    late = number(delay, "delay", low=0.0)
    ticking = number(control_period, "control_period", low=0.0, strict=True)
    known = {
        "control_period": ticking,
        "reference_period": number(reference_period, "reference_period", low=0.0, strict=True),
        "delay": late,
        "delay_periods": round(late / ticking),
    }
    return controller_of_file(os.fspath(file), Path(), model, known, "file")


def controller_of_file(name: Any, folder: Path, model: Model, known: Mapping[str, Any], field: str) -> Controller:
    """The law of a file with its gains.

    Args:
        name: path of the file.
        folder: where it starts.
        model: what the law believes.
        known: what it may know of its loop.
        field: that names the file, for messages.

    Raises:
        ValueError: one line: file, field, value, what is allowed.
    """
    if not is_gains_file(name):
        raise ValueError(f"{field} = {shown(name)}: must be true, false, or a file that 'skyarm tune' wrote (.toml)")
    path = folder / name
    reason = unreadable(path)
    if reason:
        raise ValueError(f"{field} = {shown(os.fspath(path))}: {reason}")
    try:
        document = read_toml(path.read_bytes())
        require_kind(document, "gains")
        with all_wrong_words():
            return _controller(Fields(document, ""), model, known)
    except OSError as error:
        raise ValueError(f"{field} = {shown(os.fspath(path))}: must be readable ({error.strerror})") from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _controller(top: Fields, model: Model, known: Mapping[str, Any]) -> Controller:
    schema = top.take("schema", 1)
    if schema != 1 or isinstance(schema, bool):
        raise ValueError(f"schema = {shown(schema)}: must be 1")
    words, gains = Fields(top.take("law"), "law"), top.take("gains", {})
    top.take("about", None)
    top.done()
    if "tuned" in words.table and isinstance(words.table["tuned"], str):
        raise ValueError(f"law.tuned = {shown(words.table['tuned'])}: must be left out: one file does not name another")
    law = words.table.get("law")
    if isinstance(law, str) and is_law_of_file(law):
        if not register_loaded_law(law):
            raise ValueError(f"law.law = {shown(law)}: must be loaded: {LOADED_BY.format(law.rpartition(':')[0])}")
        found = registered_law_from(words, model, known)
    else:
        found = by_words(words, model, known)
    return with_gains(found, gains, "gains")


def with_gains(controller: Controller, gains: Any, where: str) -> Controller:
    """The controller with other numbers at some paths of its constants.

    Raises:
        ValueError: a path that they do not have, or numbers that do not fit it: one line.
    """
    if not isinstance(gains, Mapping):
        raise ValueError(f"{where} = {shown(gains)}: must be a table of paths and numbers")
    numbers: dict[Place, float] = {}
    for path, value in gains.items():
        numbers |= _numbers(controller, path, value, f"{where}.{path!r}")
    return dataclasses.replace(controller, par=replaced(controller.par, numbers)) if numbers else controller


def _numbers(controller: Controller, path: str, value: Any, field: str) -> dict[Place, float]:
    record: Any = controller.par
    place = tuple(path.split("."))
    for i, name in enumerate(place):
        below = parts(record) if is_record(record) or isinstance(record, tuple) else {}
        if name not in below or name in ("model", "mixer"):
            there = [each for each in below if each not in ("model", "mixer")]
            at = ".".join(place[:i])
            has = f"{at or 'the constants'} of {controller.name!r} " + (f"have {', '.join(there)}" if there else "end")
            raise ValueError(f"{field}: {did_you_mean(name, there)}must be a path of the law's constants; {has}")
        record = below[name]
    leaves = [at for at, each in walk(record, place) if is_leaf(each)]
    given = list(value) if isinstance(value, list) else [value] * len(leaves)
    if not leaves or len(given) != len(leaves):
        raise ValueError(f"{field} = {shown(value)}: must be one number, or a list of {len(leaves)}")
    return {at: number(each, field, low=0.0) for at, each in zip(leaves, given, strict=True)}
