"""Text of a scenario file with other scheduled changes: a flight steered by hand, saved for a repeat."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from skyarm.control.catalogue import PRESETS, TUNED
from skyarm.records.files import Fields, number, read_toml, shown
from skyarm.records.files.toml import toml_text, toml_value
from skyarm.records.registry.plugins import is_law_of_file
from skyarm.scenario.paths import ROOTS
from skyarm.scenario.scenario_file import LIBRARY, list_scenarios
from skyarm.scenario.scenario_record import Change, Rates, ScenarioError

HEAD = re.compile(r"[ \t]*\[[ \t]*\[[ \t]*changes[ \t]*\][ \t]*\][ \t]*(#.*)?")
"""Line that begins one table of ``[[changes]]``."""

LAYERS = ("safety", "servos")
"""Words of a controller's table that stay when another law takes its place."""

REPLACED = ("name", "title", "plant", "controller", "seed", "episode", "duration")
"""What a saved scenario may say other than the file that it came from."""


def scenario_text(name_or_path: str | os.PathLike[str]) -> str:
    """The text of a scenario file: of a shipped one by its name, or of a file.

    Raises:
        OSError: it cannot be read. ScenarioError: it is not UTF-8 text.
    """
    name = os.fspath(name_or_path)
    content = (LIBRARY / f"{name}.toml").read_bytes() if name in list_scenarios() else Path(name).read_bytes()
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ScenarioError(f"{name}: must be UTF-8 text") from None


def with_changes_text(text: str, changes: Iterable[Change], **replaced: Any) -> str:
    """The text of a scenario file that flies with these changes in place of those that it had.

    Comments and order of the text stay, unless something is replaced beside the changes, or the text has changes that
    are not written as ``[[changes]]``: then all of it is written anew. A path of a vehicle's file stays as it is, from
    the folder of the file.

    Args:
        text: of a scenario file (:func:`scenario_text`).
        changes: all of the flight (``session.plan.changes``), in the order in which they take hold.
        replaced: "name", "title", "plant", "controller" (a preset, a law or LAW_tuned), "seed", "episode", "duration":
            what :func:`skyarm.load_scenario` was told beside the file, and a name of its own. None leaves the file's.

    Raises:
        ScenarioError: one line.
    """
    try:
        return _with_changes_text(text, read_toml(text.encode()), changes, replaced)
    except ValueError as error:
        raise ScenarioError(str(error)) from None


def _with_changes_text(
    text: str, document: Mapping[str, Any], changes: Iterable[Change], replaced: Mapping[str, Any]
) -> str:
    given = {field: value for field, value in replaced.items() if value is not None}
    odd = next((field for field in given if field not in REPLACED), None)
    if odd is not None:
        raise ScenarioError(f"{odd} = {shown(given[odd])}: must be left out; {', '.join(REPLACED)} may be replaced")
    for field in ("plant", "controller"):
        if not isinstance(given.get(field, ""), str) or is_law_of_file(given.get(field)):
            raise ScenarioError(f"{field} = {shown(given[field])}: must be a name that a scenario file may have")
    if "duration" in given:
        given["duration"] = number(given["duration"], "duration", low=0.0, strict=True)
    steps, rate = _periods(document, given)
    kept_changes = [each for each in changes if each.tick(rate) < steps]
    tables = [{"at": each.at, "path": each.path, "value": each.table} for each in kept_changes]
    wanted: dict[str, Any] = {name: value for name, value in document.items() if name != "changes"}
    wanted = document_with(wanted, given)
    if tables:
        wanted["changes"] = tables
    kept = _without_changes(text)
    made = "\n\n".join([kept.rstrip("\n"), *map(_table, tables)]) + "\n"
    return made if not given and _reads_as(made, wanted) else toml_text(wanted)


def _periods(document: Mapping[str, Any], given: Mapping[str, Any]) -> tuple[float, int]:
    """Control periods of the saved flight, without bound where the text's own duration stays; their rate, Hz."""
    rate = int(Fields(dict(_table_of(document, "rates")), "rates").number("control", Rates().control, low=1.0))
    return (given["duration"] * rate if "duration" in given else math.inf), rate


def document_with(document: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """The document with what is replaced in it."""
    changed = dict(document)
    for field, value in given.items():
        if field == "plant":
            changed["plant"] = {**_table_of(document, "plant"), "kind": value}
        elif field == "controller":
            changed["controller"] = _controller(value, _table_of(document, "controller"))
        else:
            changed[field] = value
    if "duration" in given and "windows" in changed:
        windows = {
            name: each for name, each in _table_of(document, "windows").items() if _ends(each) <= given["duration"]
        }
        changed["windows"] = windows
    return changed


def _ends(window: Any) -> float:
    """When a window, or the last of a list of them, ends; of ``last`` its length, as windows are required to end."""
    if not isinstance(window, list):
        return float(window)
    if not window:
        return 0.0
    return max(map(_ends, window)) if isinstance(window[-1], list) else float(window[-1])


def _controller(name: str, before: Mapping[str, Any]) -> dict[str, Any]:
    """The table of a controller by one name, under the layers of the file's."""
    layers = {word: before[word] for word in LAYERS if word in before}
    if name in PRESETS:
        return {"preset": name, **layers}
    if name.endswith(TUNED):
        return {"law": name.removesuffix(TUNED), "tuned": True, **layers}
    return {"law": name, **layers}


def _table_of(document: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    found = document.get(name, {})
    if not isinstance(found, Mapping):
        raise ScenarioError(f"{name} = {shown(found)}: must be a table")
    return found


def _table(change: Mapping[str, Any]) -> str:
    return "\n".join(["[[changes]]", *(f"{name} = {toml_value(value)}" for name, value in change.items())])


def _without_changes(text: str) -> str:
    """The text without its ``[[changes]]``, cut by lines; the caller reads the result back and compares."""
    kept, skipping = [], False
    for line in text.splitlines():
        if HEAD.fullmatch(line):
            skipping = True
        elif line.lstrip().startswith("["):
            skipping = False
        if not skipping:
            kept.append(line)
    return "\n".join(kept)


def _reads_as(text: str, document: Mapping[str, Any]) -> bool:
    try:
        return read_toml(text.encode()) == document
    except ValueError:
        return False


ABSENT = "(none)"
"""Stands for what only one of two scenarios has."""

FOR_PEOPLE = ("title", "sources", "notes", "type")
"""Words that say nothing of a flight, or what a table is of."""

Words = tuple[str, ...]

SEVERAL = (("environment", "air"), ("environment", "forces"), ("endings",))
"""Places of lists whose items are of several classes."""


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
    """Paths and values of all leaves of plain data."""
    inner = data.items() if isinstance(data, Mapping) else enumerate(data) if isinstance(data, list) else ()
    if not inner:
        yield words, data
    for name, each in inner:
        # a class is told where it is a law, a plant or another kind of wind; elsewhere it follows from the field
        if name not in FOR_PEOPLE or (name == "type" and isinstance(each, str) and _has_choice(words)):
            yield from _leaves(each, (*words, str(name)))


def _has_choice(words: Words) -> bool:
    """True if the value at this place may be of several classes."""
    return words in (("environment", "wind"), ("agent", "estimator")) or (
        words[:-1] in (("environment", "air"), ("environment", "forces"), ("endings",))
    )


def _path(words: Words) -> str:
    """The sweep's path of a place in the record; the record's own words where there is none."""
    roots = sorted(ROOTS.items(), key=lambda pair: -len(pair[1]))
    for root, place in roots:
        if words[: len(place)] == place and len(words) > len(place):
            return ".".join((root, *words[len(place) :]))
    return ".".join(words)
