"""Definition of a search for settings that a publication does not state, as plain
tables.

The grammar is that of ``research/inference/study.py`` of the source, which searches. A
study is its file's tables; settings are parameter -> number and choice -> option, and
what they do not name stays as the scenarios have it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from skyarm.records.arrays import Array, Mask, doubles
from skyarm.records.files import read_toml
from skyarm.records.immutable import positional
from skyarm.scenario.scenario_file import LIBRARY

Tables = Mapping[str, Any]

SHARES = (0.05, 0.10, 0.25)

WORST = 1e6
"""Error |u| of a cell that is missing or has another sign: the loss at its upper
bound."""


@positional
class PublishedNumber:
    """Published number of one metric of one flight.

    Attributes:
        flight: name of the flight. name: name in tables. metric: name in
            :mod:`skyarm.log.metrics.metric_catalogue`.
        measured: the number. half: half a unit of its last digit: that much of a
            difference is rounding.
    """

    flight: str
    name: str
    metric: str
    measured: float
    half: float


def table_by_name(tables: Iterable[Tables], name: str) -> Tables:
    """Find a table by its entry ``name`` in a list of tables."""
    return next(each for each in tables if each["name"] == name)


def digest_of(facts: Tables) -> str:
    """SHA-256 digest of nested plain values."""
    # sorted, as a study is the same in any order of its entries
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()


def study_digest(study: Tables, flights: Tables) -> str:
    """SHA-256 digest of a search definition and of the scenarios of its flights."""
    return digest_of({"study": study, "flights": flights})


def fits(patterns: Iterable[str], flight: str) -> bool:
    """True if a flight's name matches one of the patterns."""
    return any(fnmatchcase(flight, pattern) for pattern in patterns)


def laid_over(below: Tables, above: Tables) -> dict[str, Any]:
    """Merge nested tables, the upper one overriding; an empty upper table removes a
    field.
    """
    merged = dict(below)
    for name, value in above.items():
        stored = merged.get(name)
        # TOML has no null: an empty table stands for one
        if value == {}:
            merged.pop(name, None)
            continue
        merged[name] = (
            laid_over(stored, value)
            if isinstance(stored, Mapping) and isinstance(value, Mapping)
            else value
        )
    return merged


def stated_tables(study: Tables, flight: str) -> dict[str, Any]:
    """Shipped scenario of a flight as nested tables, with the overrides of the search
    definition.
    """
    entry = table_by_name(study["flights"], flight)
    tables = dict(read_toml((LIBRARY / f"{entry['scenario']}.toml").read_bytes()))
    for name in entry.get("over", ()):
        tables = laid_over(tables, study["tables"][name])
    return tables


def scenario_tables(
    study: Tables, stated: Tables, flight: str, settings: Tables
) -> dict[str, Any]:
    """Scenario of a flight as nested tables, with the overrides of the selected
    discrete options.
    """
    tables = dict(stated)
    for option in _options(study, settings):
        for each in option.get("tables", ()):
            if fits(each["flights"], flight):
                tables = laid_over(tables, study["tables"][each["table"]])
    return tables


def numbers(study: Tables, flight: str, settings: Tables) -> dict[str, float]:
    """Parameter values of a flight by path, for given settings of the search."""

    def acts(target: Tables) -> bool:
        chosen = all(
            settings.get(choice) == option
            for choice, option in target.get("when", {}).items()
        )
        return chosen and fits(target["flights"], flight)

    sets = [
        each for option in _options(study, settings) for each in option.get("sets", ())
    ]
    values: dict[str, float] = {
        each["path"]: float(each["value"]) for each in sets if acts(each)
    }
    for parameter in study.get("parameters", ()):
        if parameter["name"] in settings:
            value = settings[parameter["name"]]
            acting = [each for each in parameter.get("targets", ()) if acts(each)]
            values |= {
                t["path"]: (
                    float(t.get("factor", 1.0)) * value + float(t.get("offset", 0.0))
                )
                for t in acting
            }
    return values


def _options(study: Tables, settings: Tables) -> list[Tables]:
    """Tables of the options that given settings select for each discrete choice."""
    choices = [each for each in study.get("choices", ()) if each["name"] in settings]
    return [table_by_name(each["options"], settings[each["name"]]) for each in choices]


def group_places(
    patterns: Iterable[str], cells: Sequence[PublishedNumber]
) -> tuple[int, ...]:
    """Indices of the published numbers that match FLIGHT/METRIC patterns; "!" removes
    earlier matches.
    """
    chosen: set[int] = set()
    for pattern in patterns:
        matches = {
            i
            for i, c in enumerate(cells)
            if fnmatchcase(f"{c.flight}/{c.name}", pattern.removeprefix("!"))
        }
        chosen = chosen - matches if pattern.startswith("!") else chosen | matches
    return tuple(sorted(chosen))


def slack_distance(ours: Array, cells: Sequence[PublishedNumber]) -> Array:
    """Distances (settings, numbers) of simulated values from published ones beyond
    their rounding.
    """
    measured, half = _columns(cells)
    apart = np.maximum(np.abs(ours - measured) - half, 0.0)
    # a missing number agrees within no share
    return np.where(np.isfinite(ours), apart, np.inf)


def within(ours: Array, cells: Sequence[PublishedNumber], share: float) -> Mask:
    """True (settings, numbers) where a simulated value is within a relative distance of
    the published number.
    """
    measured, _ = _columns(cells)
    # 1e-9: a number on the very edge is within
    return slack_distance(ours, cells) <= share * np.abs(measured) * (1.0 + 1e-9)


def losses(
    ours: Array, cells: Sequence[PublishedNumber], width: float, knee: float
) -> Array:
    """Robust loss (settings, numbers): u^2 / (1 + u^2 / knee^2), u = ln(simulated /
    published) / width.

    Quadratic near the measured number, at most knee^2 however far, so that one cell
    that a model cannot make does not decide over the others (Geman, McClure 1987). The
    rounding of the measured number is taken off the difference first; another sign and
    a missing number are as far as can be.
    """
    measured, half = _columns(cells)
    # of our number, give or take the printed rounding, the value closest to the paper's
    nearest = np.clip(measured, ours - half, ours + half)
    # numbers of other signs have no logarithm: they get WORST below
    with np.errstate(all="ignore"):
        u = np.log(nearest / measured) / width
    u = np.where(np.isfinite(u), np.minimum(np.abs(u), WORST), WORST)
    return u**2 / (1.0 + (u / knee) ** 2)


def _columns(cells: Sequence[PublishedNumber]) -> tuple[Array, Array]:
    pairs = doubles([(cell.measured, cell.half) for cell in cells]).reshape(-1, 2)
    return pairs[:, 0], pairs[:, 1]


def tally(ours: Array, cells: Sequence[PublishedNumber]) -> dict[str, int]:
    """Number of simulated values within 5, 10 and 25 % of the published numbers."""
    lane = doubles(ours).reshape(1, -1)
    return {"cells": len(cells)} | {
        f"within_{share:.0%}": int(within(lane, cells, share).sum()) for share in SHARES
    }
