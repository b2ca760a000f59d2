"""The facts of a study, read from files that may come from anyone."""

from __future__ import annotations

import json
from typing import Any

from skyarm.files import Fields, shown
from skyarm.scenario.scenario_record import check_name, noise_key
from skyarm.sweep.derived_numbers import derived_from
from skyarm.sweep.distributions import distribution_from
from skyarm.sweep.origin import FACTS, MARK, VERSION, Origin, parquet
from skyarm.sweep.seal import is_whole
from skyarm.sweep.study import DESIGNS, PRECISIONS

LARGEST_CHUNK = 2**20
"""Episodes of one file: a chunk is held in memory, about 300 bytes an episode and controller."""

MOST_EPISODES = 2**32
"""The noise generator numbers episodes with 32 bits."""

DEEPEST = 32
"""Tables and lists in each other, in anything that is read."""

LONGEST_NAME = 200
"""Characters of the name of a controller or a metric."""


def origin_in(content: bytes) -> Origin | None:
    """The study that a file says it is of; None if it is not whole or does not say."""
    found = parquet(content) if is_whole(content) else None
    said = (found.schema_arrow.metadata or {}) if found else {}
    try:
        origin = origin_from(plain_json(said[FACTS]), said[VERSION].decode(), "study")
    except (KeyError, ValueError):
        return None
    return origin if said.get(MARK, b"").startswith(origin.digest.encode()) else None


def plain_json(content: bytes) -> Any:
    """What a JSON file holds that may come from anyone.

    Raises:
        json.JSONDecodeError, UnicodeDecodeError: it is cut off, or no JSON.
        ValueError: numbers that are none or too long, or too many tables in each other.
    """
    try:
        found = json.loads(content, parse_constant=_refuse)
    except RecursionError:
        raise ValueError(f"must not have more than {DEEPEST} tables in each other") from None
    level = [found]
    for _ in range(DEEPEST):
        level = [inner for each in level for inner in _inside(each)]
        if not level:
            return found
    raise ValueError(f"must not have more than {DEEPEST} tables in each other")


def _inside(value: Any) -> list[Any]:
    held = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return [each for each in held if isinstance(each, (dict, list))]


def _refuse(word: str) -> Any:
    raise ValueError(f"{word}: must be a finite number")


def origin_from(table: Any, version: str, where: str = "") -> Origin:
    """Check the facts of a study.

    Args:
        table: with ``study`` and ``scenarios``, as read from JSON.
        version: of skyarm.
        where: what messages call it.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    top = Fields(table, where)
    study = Fields(top.take("study"), top.at("study"))
    check_name(study.take("name"))
    study.choice("design", DESIGNS)
    study.choice("precision", PRECISIONS)
    noise_key(study.at("seed"), study.take("seed"))
    whole(study.at("episodes"), study.take("episodes"), MOST_EPISODES)
    whole(study.at("chunk"), study.take("chunk"), LARGEST_CHUNK)
    _texts(study.at("metrics"), study.take("metrics"))
    if "endings" in study.table:
        _texts(study.at("endings"), study.take("endings"))
    vary = study.take("vary")
    for path, distribution in (Fields(vary, study.at("vary")).table if vary is not None else {}).items():
        distribution_from(distribution, f'{study.at("vary")}."{text(study.at("vary"), path)}"')
    if "derived" in study.table:
        derived_from(study.take("derived"), tuple(vary or {}), study.at("derived"))
    scenarios = Fields(top.take("scenarios"), top.at("scenarios"))
    _texts(scenarios.where, list(scenarios.table))
    for label, digest in scenarios.table.items():
        text(scenarios.at(label), digest)
    return Origin(study=study.table, scenarios=scenarios.table, version=version)


def whole(at: str, value: Any, most: int, low: int = 1) -> int:
    """Check a whole number."""
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= most:
        raise ValueError(f"{at} = {shown(value)}: must be a whole number from {low} to {most}")
    return value


def text(at: str, value: Any) -> str:
    """Check a text: one that can be written down, so no half of a character."""
    if not isinstance(value, str) or value.encode(errors="replace").decode() != value:
        raise ValueError(f"{at} = {shown(value)}: must be text")
    return value


def _texts(at: str, value: Any) -> None:
    if not isinstance(value, list) or not value or not all(map(_is_name, value)):
        raise ValueError(
            f"{at} = {shown(value)}: must be names of 1 to {LONGEST_NAME} printable characters, one at least"
        )
    if len(set(value)) != len(value):
        raise ValueError(f"{at} = {shown(value)}: must not hold a name twice")


def _is_name(value: Any) -> bool:
    return isinstance(value, str) and 1 <= len(value) <= LONGEST_NAME and value.isprintable()
