"""What differs between two scenarios as their logs keep them, by the sweep's paths as far as these reach."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from skyarm.scenario.places import ROOTS

ABSENT = "(none)"
"""Stands for what only one of two scenarios has."""

FOR_PEOPLE = ("title", "sources", "notes", "type")
"""Words that say nothing of a flight, or what a table is of."""

Words = tuple[str, ...]


def scenario_differences(a: Any, b: Any) -> dict[str, tuple[Any, Any]]:
    """Path -> values in two scenarios, where they differ.

    Args:
        a: plain data of a scenario (``log.info["scenario_record"]``); anything else has nothing in it.
        b: of the other.
    """
    ours, theirs = (dict(_leaves(each, ())) if isinstance(each, Mapping) else {} for each in (a, b))
    found = {}
    for words in {**ours, **theirs}:
        pair = ours.get(words, ABSENT), theirs.get(words, ABSENT)
        if type(pair[0]) is not type(pair[1]) or pair[0] != pair[1]:
            found[_path(words)] = pair
    return found


def _leaves(data: Any, words: Words) -> Iterator[tuple[Words, Any]]:
    """Words and value of everything in plain data that has no parts itself."""
    inner = data.items() if isinstance(data, Mapping) else enumerate(data) if isinstance(data, list) else ()
    if not inner:
        yield words, data
    for name, each in inner:
        # a class is told where it is a law, a plant or another kind of wind; elsewhere it follows from the field
        if name not in FOR_PEOPLE or (name == "type" and isinstance(each, str) and _chosen(words)):
            yield from _leaves(each, (*words, str(name)))


def _chosen(words: Words) -> bool:
    """Whether what stands there may be of several classes."""
    return words in (("wind",), ("estimator",)) or (len(words) == 2 and words[0] in ("air", "forces", "endings"))


def _path(words: Words) -> str:
    """The sweep's path of a place in the record; the record's own words where there is none."""
    roots = sorted(ROOTS.items(), key=lambda pair: -len(pair[1]))
    for root, place in roots:
        if words[: len(place)] == place and len(words) > len(place):
            return ".".join((root, *words[len(place) :]))
    return ".".join(words)
