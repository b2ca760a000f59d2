"""A check of a scenario names the nearest pair of bodies along its reference, and
when.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.scenario.scenario_file import scenario_from
from skyarm.studies.assess.along_reference import CLEARANCES, along_reference
from skyarm.studies.assess.finding import OK, WARNING, Finding
from support.flights import document


def clearances(scenario: skyarm.Scenario) -> list[Finding]:
    return [
        each
        for each in along_reference(scenario, clearance=True)
        if each.question in CLEARANCES
    ]


def past_a_ball(height: float, speed: float = 0.2) -> skyarm.Scenario:
    """A level motion along x at a constant speed, with a ball at x = 1 m, a height
    above the base's.
    """
    along = {
        "kind": "signals",
        "x": {"kind": "ramp", "start": 0.0, "duration": 10.0, "height": 10.0 * speed},
        "z": 1.0,
    }
    ball = {
        "name": "ball",
        "shape": "sphere",
        "size": [0.1],
        "position": [1.0, 0.0, 1.0 + height],
    }
    made: dict[str, Any] = document(
        "case1", duration=10.0, reference__base=along, world={"surfaces": [ball]}
    )
    return scenario_from(made)


def test_the_smallest_distance_is_the_hulls_below_a_ball_and_at_its_time() -> None:
    scenario = past_a_ball(0.4)
    found, arm = clearances(scenario)
    boom = max(
        np.linalg.norm(np.array(rotor.position))
        for rotor in scenario.agent.plant.vehicle.rotors
    )
    # half the hull is 0.15 of the boom, and flat for 0.2 of the boom to either side;
    # the ball is above it at 5 s
    assert found.value == pytest.approx(0.4 - 0.1 - 0.15 * boom, abs=2e-3)
    assert found.text.startswith("hull and surface 'ball' are 0.27")
    assert float(found.text.split(" at ")[1].removesuffix(" s")) == pytest.approx(
        5.0, abs=0.2 * boom / 0.2 + 0.01
    )
    assert (found.level, arm.level) == (OK, OK)
    assert arm.text.startswith("link/link1/joint2 and rotor/")


def test_an_overlap_is_a_warning_with_its_share_of_the_flight() -> None:
    scenario = past_a_ball(0.0)
    found, _ = clearances(scenario)
    assert (found.level, found.field) == (WARNING, "reference")
    assert found.value < 0.0
    assert "overlap for" in found.text
    share = float(found.text.split("overlap for ")[1].split("%")[0]) / 100.0
    reach = max(
        abs(float(rotor.position.x)) for rotor in scenario.agent.plant.vehicle.rotors
    )
    # from the first rotor disc, of half a boom, to the last: twice this length and the
    # ball's, at 0.2 m/s
    assert share == pytest.approx(2.0 * (1.5 * reach + 0.1) / 0.2 / 10.0, rel=0.03)
    assert "clearance from surfaces" in [
        each.question for each in skyarm.check(scenario).alarms()
    ]


def test_nothing_is_said_of_what_can_touch_nothing_and_before_a_flight() -> None:
    bare = skyarm.load_scenario("case1")
    assert [each.question for each in clearances(bare)] == ["clearance of the arm"]
    assert not {each.question for each in along_reference(bare)} & CLEARANCES.keys()
    arm = skyarm.load_scenario("two_hold_a_bar")
    assert not clearances(arm.of(next(iter(arm.agents))))


MORE = [
    pytest.param(name, marks=pytest.mark.thorough)
    for name in ("peg_in_hole", "write_on_wall", "turn_valve")
]


@pytest.mark.parametrize("name", ["press_and_hold", *MORE])
def test_tasks_in_contact_have_no_overlap(name: str) -> None:
    assert {each.level for each in clearances(skyarm.load_scenario(name))} == {OK}
