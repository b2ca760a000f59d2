"""Wrong files of several agents: each is one line with field, value and what is allowed."""

from __future__ import annotations

import copy
import json
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

import skyarm
from support.teams import TEAMS

PINS = Path(__file__).with_name("pins") / "wrong_teams.json"
GONE = "(left out)"
"""Value of a key that a wrong file lacks."""


def message(path: str, value: object) -> str:
    """Message about the bar's file with another value at a path; empty if it is read."""
    tables: Any = copy.deepcopy(tomllib.loads((TEAMS / "bar.toml").read_text("utf-8")))
    *above, last = [int(name) if name.isdigit() else name for name in path.split("/")]
    inner = tables
    for name in above:
        inner = inner[name]
    if value == GONE:
        del inner[last]
    else:
        inner[last] = value
    try:
        skyarm.scenario_from(tables, TEAMS)
    except skyarm.ScenarioError as error:
        return str(error).replace(str(TEAMS), "TEAMS")
    return ""


CASES = json.loads(PINS.read_text("utf-8")) if PINS.exists() else []


@pytest.mark.parametrize(("path", "value", "words"), CASES)
def test_a_wrong_team_is_refused_in_one_line(path: str, value: object, words: str) -> None:
    assert words
    assert "\n" not in words
    assert message(path, value) == words


def test_there_are_more_than_fifty_of_them() -> None:
    assert len({json.dumps(case[:2]) for case in CASES}) > 50


if __name__ == "__main__" and "--write" in sys.argv:
    lines = ",\n".join(json.dumps([path, value, message(path, value)]) for path, value, _ in CASES)
    PINS.write_text(f"[\n{lines}\n]\n", "utf-8")
