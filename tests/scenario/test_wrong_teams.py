"""Wrong files of several agents: each is one line with field, value and what is
allowed.
"""

from __future__ import annotations

import copy
import dataclasses
import json
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

import skyarm
from skyarm.reference.signals import Constant
from support.teams import TEAMS

PINS = Path(__file__).with_name("pins") / "wrong_teams.json"
GONE = "(left out)"
"""Value of a key that a wrong file lacks."""


def message(path: str, value: object) -> str:
    """Message about the bar's file with another value at a path; empty if it is
    read.
    """
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
def test_a_wrong_team_is_refused_in_one_line(
    path: str, value: object, words: str
) -> None:
    assert words
    assert "\n" not in words
    assert message(path, value) == words


def test_there_are_more_than_fifty_of_them() -> None:
    assert len({json.dumps(case[:2]) for case in CASES}) > 50


PAIR = """
schema = 1
name = "pair"
duration = 0.5
plant = { vehicle = "dragonfly" }
controller = { preset = "centroidal_joint" }
[agents.left.reference]
base = { kind = "hover", position = [0.0, 0.0, 1.0] }
[agents.right.reference]
base = { kind = "hover", position = [0.0, 3.0, 1.0] }
"""


@pytest.mark.parametrize(
    "table",
    ["sensors.imu]\nkind = 'imu'", "sensors]\nposition = 0.1", "delays]", "payloads]"],
)
def test_a_table_of_an_agent_that_is_misspelt_makes_no_further_agent(
    table: str,
) -> None:
    with pytest.raises(
        skyarm.ScenarioError,
        match=(
            r"^agents\.lefft: did you mean 'left'\? must have a reference of its own,"
            r" or be one of left, right$"
        ),
    ):
        skyarm.scenario_from(tomllib.loads(f"{PAIR}[agents.lefft.{table}\n"), TEAMS)


def test_words_of_an_agent_are_listed_once() -> None:
    with pytest.raises(
        skyarm.ScenarioError, match=r"agents\.left\.sensor = .*did you mean 'sensors'"
    ) as caught:
        skyarm.scenario_from(tomllib.loads(f"{PAIR}[agents.left.sensor]\n"), TEAMS)
    names = str(caught.value).rpartition("allowed: ")[2].split(", ")
    assert len(names) == len(set(names))


def test_agents_without_a_reference_of_their_own_fly_that_at_the_top() -> None:
    text = PAIR.replace("[agents.right.", "[agents.right]\n[")
    assert list(skyarm.scenario_from(tomllib.loads(text), TEAMS).agents) == [
        "left",
        "right",
    ]


def test_an_agent_that_is_added_is_saved_with_a_reference(tmp_path: Path) -> None:
    scenario = skyarm.scenario_from(tomllib.loads(PAIR), TEAMS)
    one = scenario.agents["left"]
    third = dataclasses.replace(
        one, reference=dataclasses.replace(one.reference, x=Constant(5.0))
    )
    more = dataclasses.replace(scenario, agents={**scenario.agents, "third": third})
    skyarm.save_scenario(tmp_path / "three.toml", more, tomllib.loads(PAIR))
    assert skyarm.load_scenario(tmp_path / "three.toml") == more


def test_a_misspelt_agent_beside_a_team_is_told_of_the_members() -> None:
    tables = tomllib.loads((TEAMS / "long_bar.toml").read_text("utf-8"))
    tables["agents"]["midle"] = {"delays": {}}
    with pytest.raises(
        skyarm.ScenarioError,
        match=(
            r"^agents\.midle: did you mean 'middle'\? must have a reference of its own,"
            r" or be one of left, "
        ),
    ):
        skyarm.scenario_from(tables, TEAMS)


if __name__ == "__main__" and "--write" in sys.argv:
    lines = ",\n".join(
        json.dumps([path, value, message(path, value)]) for path, value, _ in CASES
    )
    PINS.write_text(f"[\n{lines}\n]\n", "utf-8")
