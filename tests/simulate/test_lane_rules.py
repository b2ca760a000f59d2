"""Numbers of a batch's lanes: what a scenario would refuse is refused before it flies,
with its path and lane.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.simulate import lane_numbers
from skyarm.simulate.batch import Batch
from skyarm.simulate.lane_numbers import LaneRules
from skyarm.world import ForceWind, Gust
from support.components import Tether

BASE = load_scenario("case1", duration=0.05)
GUSTY = dataclasses.replace(BASE, wind=ForceWind(gust=Gust(start=0.01, duration=0.01)))
LOAD, MASS = "plant.payload.mass", "plant.vehicle.base.mass"
GRAVITY = "plant.gravity"


def column(*numbers: float) -> np.ndarray:
    return np.array(numbers)


@pytest.fixture(scope="module")
def loaded():
    batch = Batch(BASE, [LOAD], effort=0)
    return batch


def test_a_number_that_its_field_refuses_does_not_fly(loaded):
    wrong = {LOAD: column(0.01, -5.0, 0.02)}
    words = (
        r"values\['plant.payload.mass'\] = -5 \(lane 1\): plant.payload.mass = -5\.0:"
        r" must be at least 0"
    )
    with pytest.raises(ScenarioError, match=words):
        loaded.fly(wrong)
    assert (loaded.fly({LOAD: column(0.01, 0.02)}).status == "completed").all()


@pytest.mark.parametrize(
    ("value", "lane"), [(np.nan, 0), (np.nan, 1), (np.inf, 1), (-np.inf, 0)]
)
def test_a_number_that_is_none_does_not_fly(loaded, value, lane):
    numbers = column(0.01, 0.02)
    numbers[lane] = value
    words = (
        rf"values\['plant.payload.mass'\] = {value} \(lane {lane}\): .*must be a"
        r" (finite )?number"
    )
    with pytest.raises(ScenarioError, match=words):
        loaded.fly({LOAD: numbers})


def test_a_number_without_a_unit_is_one_too():
    path = "environment.forces.0.stiffness"
    rules = LaneRules(dataclasses.replace(BASE, forces=(Tether(),)), [path])
    rules.require({path: column(1.0, 2.0)})
    with pytest.raises(
        ScenarioError, match=r"stiffness'\] = nan \(lane 1\): must be a number"
    ):
        rules.require({path: column(1.0, np.nan)})


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (MASS, 0.0),
        (GRAVITY, -1.0),
        ("environment.wind.gust.duration", -0.1),
        ("initial.rotor_speeds.0", -400.0),
        ("initial.rotor_speeds.0", 900.0),
    ],
)
def test_what_the_scenario_says_is_said(path, value):
    with pytest.raises(ValueError, match="must be") as caught:
        with_numbers(GUSTY, {path: value})
    with pytest.raises(ScenarioError) as raised:
        LaneRules(GUSTY, [path]).require({path: column(value)})
    assert str(raised.value) == f"values[{path!r}] = {value:g} (lane 0): {caught.value}"


def test_a_lane_is_looked_at_with_all_of_its_numbers(monkeypatch):
    made = []
    monkeypatch.setattr(
        lane_numbers,
        "with_numbers",
        lambda scenario, numbers: made.append(numbers) or scenario,
    )
    values = {MASS: column(1.0, 3.0, 2.0, 1.5), GRAVITY: column(9.0, 9.1, 9.2, 9.05)}
    LaneRules(BASE, [MASS, GRAVITY]).require(values)
    # the lane of the least mass is that of the least gravity
    assert made == [
        {MASS: 1.0, GRAVITY: 9.0},
        {MASS: 3.0, GRAVITY: 9.1},
        {MASS: 2.0, GRAVITY: 9.2},
    ]


def test_of_numbers_that_are_wrong_only_together_the_lane_is_named(monkeypatch):
    def refuse(scenario, numbers):
        if numbers.get(MASS, 9.0) < 2.0 and numbers.get(GRAVITY, 0.0) > 9.0:
            raise ValueError("too light")
        return scenario

    monkeypatch.setattr(lane_numbers, "with_numbers", refuse)
    with pytest.raises(ScenarioError, match="values of lane 1: too light"):
        LaneRules(BASE, [MASS, GRAVITY]).require(
            {MASS: column(2.0, 1.0), GRAVITY: column(9.9, 9.5)}
        )


def test_what_passed_once_is_not_looked_at_again(monkeypatch):
    made = []
    monkeypatch.setattr(
        lane_numbers,
        "with_numbers",
        lambda scenario, numbers: made.append(numbers[MASS]) or scenario,
    )
    rules = LaneRules(BASE, [MASS])
    for numbers, looked_at in (
        ((1.0, 2.0), [1.0, 2.0]),
        ((1.1, 1.9, 1.0, 2.0), []),
        ((1.5, 2.5), [2.5]),
        ((0.5, 2.5), [0.5]),
        ((0.5, 2.5), []),
    ):
        made.clear()
        rules.require({MASS: column(*numbers)})
        assert made == looked_at


def test_one_number_for_all_lanes_and_none_at_all():
    rules = LaneRules(BASE, [MASS, GRAVITY])
    with pytest.raises(ScenarioError, match=r"= -9 \(lane 0\)"):
        rules.require({GRAVITY: -9.0, MASS: column(1.0, 2.0)})
    rules.require({})
    rules.require({MASS: column()})


def test_a_batch_is_of_the_rigid_body_plant_and_says_so() -> None:
    with pytest.raises(
        ScenarioError, match=r"^plant\.kind = 'mujoco': must be rigid_body for a batch$"
    ):
        Batch(load_scenario("case3", plant="mujoco", duration=0.1))
