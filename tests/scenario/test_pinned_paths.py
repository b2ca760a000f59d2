"""All parameter paths of the shipped scenarios lead to the fields that they led to, and
are refused in the same words.

Where this is meant to change: ``pinned_paths.py --write`` and ``refused_paths.py
--write`` in this folder.
"""

from __future__ import annotations

import json
from typing import Any

import pinned_paths
import pytest
import refused_paths
from shipped_files import NAMES, RICH, only_shipped, scenario

from support.cases import sampled

HELD: dict[str, dict[str, list[Any]]] = json.loads(pinned_paths.FILE.read_text("utf-8"))
ANSWERS: dict[str, list[dict[str, Any]]] = json.loads(
    refused_paths.FILE.read_text("utf-8")
)

KEPT = (
    "case3_wind",
    RICH,
    "examples/fast_circle",
    "examples/press_in_phases",
    "examples/servo_swing",
    "tasks/hover",
)
"""Tried by every run of the tests; all take half a minute."""

SHOWN = 20
"""Differences that a failure shows."""


def difference(name: str, found: pinned_paths.Pinned) -> list[str]:
    """What differs from the pins: paths where they are kept as a whole, else the words
    that they begin with.
    """
    told, held = pinned_paths.summary(found), HELD.get(name, {})
    if told == held:
        return []
    groups = [
        f"{group}: {told.get(group, [0])[0]} paths, pinned {held.get(group, [0])[0]}"
        for group in sorted(told.keys() | held.keys())
        if told.get(group) != held.get(group)
    ]
    if name not in pinned_paths.WHOLE:
        return groups
    now, before = (
        pinned_paths.read_tree(text)
        for text in (
            pinned_paths.tree(found),
            pinned_paths.tree_file(name).read_text("utf-8"),
        )
    )
    lines = [
        f"{path}{now.get(path, ' is gone')}, pinned{before.get(path, ' not at all')}"
        for path in sorted(now.keys() | before.keys())
        if now.get(path) != before.get(path)
    ]
    return groups[:SHOWN] + lines


@pytest.mark.parametrize("name", sampled(NAMES, len(NAMES), keep=KEPT))
def test_all_paths_lead_to_the_fields_that_they_led_to(name: str) -> None:
    found = difference(name, pinned_paths.pinned(scenario(name)))
    assert found == [], "\n".join([f"{name}: {len(found)} differences", *found[:SHOWN]])


def test_every_scenario_that_ships_has_its_paths_pinned() -> None:
    assert set(HELD) == set(NAMES)


def test_a_path_that_leads_elsewhere_is_named() -> None:
    found = dict(pinned_paths.pinned(scenario("case3_wind")))
    found["plant.gravity"] = (
        (("agent", "controller", "par", "model", "gravity"),),
        "number",
    )
    del found["model.gravity"]
    lines = "\n".join(difference("case3_wind", found))
    assert "model.gravity is gone, pinned" in lines
    assert (
        "plant.gravity = agent.controller.par.model.gravity: number, pinned ="
        " agent.plant.gravity: number" in lines
    )
    assert len(lines.splitlines()) == 4


def test_a_tree_of_paths_is_read_as_it_was_written() -> None:
    found = pinned_paths.pinned(scenario("case3_wind"))
    assert (
        list(pinned_paths.read_tree(pinned_paths.tree(found)).keys() ^ found.keys())
        == []
    )


@pytest.mark.parametrize("name", refused_paths.TRIED)
def test_paths_are_refused_and_changed_in_flight_as_they_were(name: str) -> None:
    with only_shipped():
        found = [
            refused_paths.answers(scenario(name), path, value)
            for path, value in json_pairs(refused_paths.TRIED[name])
        ]
    wrong = [
        (now, before)
        for now, before in zip(found, ANSWERS[name], strict=True)
        if now != before
    ]
    lines = [
        f"{now['path']} ({key}):\n  now    {now.get(key)}\n  pinned {before.get(key)}"
        for now, before in wrong
        for key in sorted(now.keys() | before.keys())
        if now.get(key) != before.get(key)
    ]
    assert lines == [], "\n".join(lines[:SHOWN])


def json_pairs(rows: Any) -> Any:
    """Paths and values as the file keeps them."""
    return json.loads(json.dumps(rows))
