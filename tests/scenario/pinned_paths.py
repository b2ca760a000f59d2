"""Parameter paths of scenarios, with the fields of the records that they lead to, as
text that can be pinned.

``python tests/scenario/pinned_paths.py --write`` writes ``pins/paths.json`` and the
trees ``pins/paths_*.txt`` anew.

The paths are found through :mod:`skyarm.scenario.paths` by :func:`paths` alone: whoever
replaces that module replaces this one function.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import sys
from collections.abc import Iterator, Mapping
from itertools import groupby
from pathlib import Path
from typing import Any

from shipped_files import NAMES, PINS, RICH, scenario

import skyarm
from skyarm.records.leaves import Place, is_record, part
from skyarm.records.path_names import NumberView, path_names
from skyarm.scenario.numbers import number_at, unit_at
from skyarm.scenario.paths import delay_words, places_of, roots
from skyarm.scenario.scenario_record import ScenarioError, first_state

FILE = PINS / "paths.json"
WHOLE = ("case3_wind", RICH)
"""Scenarios whose paths are kept as a whole, to read what has changed."""

Pinned = Mapping[str, tuple[tuple[Place, ...], str]]
"""Path -> the fields that it leads to, none where it leads to no field, and what is
there."""


def started(given: skyarm.Scenario) -> skyarm.Scenario:
    """A scenario with an initial state, so that there are paths of it."""
    return (
        given
        if given.initial is not None
        else dataclasses.replace(given, initial=first_state(given))
    )


def paths(given: skyarm.Scenario) -> Iterator[str]:
    """Every path that begins with a root and goes on through names, those of records
    and lists included.
    """
    for root, start in roots(given).items():
        if part(given, start) is not None:
            yield from _below(given, root, (start,), path_names(part(given, start)))
    yield from (*delay_words(), "reference.tracking_start")


def _below(
    given: skyarm.Scenario,
    path: str,
    heads: tuple[Place, ...],
    options: Mapping[str, Any],
) -> Iterator[str]:
    for name, found in options.items():
        if isinstance(found, NumberView) or name == "payload":
            continue  # computed
        yield f"{path}.{name}"
        if isinstance(found, tuple):
            places = tuple((*head, *tail) for head in heads for tail in found)
            yield from _below(
                given, f"{path}.{name}", places, path_names(part(given, places[0]))
            )
        else:
            yield from _below(given, f"{path}.{name}", heads, found)


def computed(given: skyarm.Scenario) -> Iterator[str]:
    """Paths of numbers that are no field: loads at each frame, and angles of the
    attitude.
    """
    for root, vehicle in (
        ("plant", given.plant.vehicle),
        ("model", given.controller.par.model.vehicle),
    ):
        frames = (
            ("", *(f"{frame.name}." for frame in vehicle.frames))
            if vehicle.end_effector
            else ()
        )
        yield from (f"{root}.payload.{frame}mass" for frame in frames)
    yield from (f"initial.{angle}" for angle in ("roll", "pitch", "yaw"))


def pinned(given: skyarm.Scenario) -> Pinned:
    """All paths of a scenario with their fields, and what is there: a number, what
    varies not, or a refusal.

    Of several agents, those of the flight of each, under its name.
    """
    if len(given.agents) == 1:
        return _pinned_of_one(started(given))
    each = {name: _pinned_of_one(started(given.of(name))) for name in given.agents}
    return {
        f"agents.{name}.{path}": row
        for name, rows in each.items()
        for path, row in rows.items()
    }


def _pinned_of_one(given: skyarm.Scenario) -> Pinned:
    found = dict[str, tuple[tuple[Place, ...], str]]()
    for path in computed(given):
        try:
            found[path] = (), f"computed in {unit_at(given, path)}"
        except ScenarioError as error:
            found[path] = (), _refusal(error)
    for path in paths(given):
        try:
            places = places_of(given, path)
        except ScenarioError as error:
            found[path] = (), _refusal(error)
            continue
        found[path] = places, _kind(given, path, part(given, places[0]))
    return found


def _refusal(error: ScenarioError) -> str:
    """What a refusal says of a path, without the cure."""
    return str(error).split(": ", 1)[1].split("; ")[0]


def _kind(given: skyarm.Scenario, path: str, value: object) -> str:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return (
            type(value).__name__
            if is_record(value)
            else {"tuple": "list"}.get(kind := type(value).__name__, kind)
        )
    try:
        number_at(given, path)
    except ScenarioError:
        return "fixed"
    return "number" if isinstance(value, float) else "structure"


def _text(places: tuple[Place, ...]) -> str:
    return " & ".join(map(".".join, places))


def summary(found: Pinned) -> dict[str, list[Any]]:
    """Number of paths and SHA-256 of them with their fields, by the two words that they
    begin with.
    """
    lines = sorted(
        f"{path} -> {_text(places)} {kind}\n" for path, (places, kind) in found.items()
    )
    told: dict[str, list[Any]] = {}
    for group, found_there in groupby(
        lines, lambda line: ".".join(line.split(" ", 1)[0].split(".")[:2])
    ):
        several = list(found_there)
        told[group] = [
            len(several),
            hashlib.sha256("".join(several).encode()).hexdigest()[:12],
        ]
    return told


def tree(found: Pinned) -> str:
    """The paths as an indented tree; fields are written where they are not those of the
    line above and the word.
    """
    lines = []
    above: list[tuple[str, tuple[Place, ...]]] = []
    for path in sorted(
        found, key=lambda path: [_order(word) for word in path.split(".")]
    ):
        places, kind = found[path]
        while above and not path.startswith(f"{above[-1][0]}."):
            above.pop()
        head, over = above[-1] if above else ("", ())
        word = path[len(head) + 1 :] if head else path
        usual = tuple((*place, word) for place in over)
        own = "" if places == usual else f" = {_text(places)}"
        lines.append(f"{' ' * len(above)}{word}{own}: {kind}\n")
        above.append((path, places))
    return "".join(lines)


def _order(word: str) -> tuple[int, str]:
    return (int(word), "") if word.isdecimal() else (-1, word)


def read_tree(text: str) -> dict[str, str]:
    """Path -> what :func:`tree` wrote of it."""
    found, above = dict[str, str](), list[str]()
    for line in text.splitlines():
        words, depth = line.lstrip(" "), len(line) - len(line.lstrip(" "))
        name, _, kind = words.rpartition(": ")
        word, _, own = name.partition(" = ")
        above = [*above[:depth], f"{above[depth - 1]}.{word}" if depth else word]
        found[above[-1]] = f" = {own}: {kind}" if own else f": {kind}"
    return found


def tree_file(name: str) -> Path:
    """File of a scenario's tree."""
    return PINS / f"paths_{name}.txt"


def main() -> None:
    """Write the pins."""
    told = {}
    before = json.loads(FILE.read_text("utf-8"))
    for name in NAMES:
        try:
            found = pinned(scenario(name))
        except skyarm.ScenarioError:
            # a governor refuses some of the paths before they lead anywhere
            told[name] = before[name]
            continue
        told[name] = summary(found)
        if name in WHOLE:
            tree_file(name).write_text(tree(found), "utf-8")
    lines = (
        f"{json.dumps(name)}: {{\n{_rows(groups)}\n}}" for name, groups in told.items()
    )
    FILE.write_text("{\n" + ",\n".join(lines) + "\n}\n", "utf-8")
    print(
        sum(count for groups in told.values() for count, _ in groups.values()),
        "paths of",
        len(told),
        "scenarios",
    )


def _rows(groups: dict[str, list[Any]]) -> str:
    return ",\n".join(
        f" {json.dumps(group)}: {json.dumps(each)}" for group, each in groups.items()
    )


if __name__ == "__main__":
    if sys.argv[1:] != ["--write"]:
        sys.exit("usage: python tests/scenario/pinned_paths.py --write")
    main()
