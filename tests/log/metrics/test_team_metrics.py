"""Metrics of flights of several vehicles: names, and numbers against the arrays of the
log.
"""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import Any

import pytest

import skyarm
from skyarm.log.metrics.metric_catalogue import metric_words, names_by_agent, row_names
from skyarm.records.members import SOLE
from skyarm.simulate.batch import Batch
from support.teams import team

ARMS = {"left": (False, False), "right": (False,)}
"""Vehicles of two joints and of one, all under torques."""


@cache
def flown() -> Any:
    """Flight of three vehicles that hold a plate, whose grasps bear different loads."""
    return skyarm.run(team("triangle", duration=0.3))


def test_metrics_of_a_vehicle_are_those_of_its_own_log() -> None:
    scores = skyarm.score(flown(), ["standard", "grasp_largest"])
    for name, own in flown().agents.items():
        alone = skyarm.score(own, ["standard", "grasp_largest"])
        assert {metric: scores[f"{name}/{metric}"] for metric in alone} == alone
    assert len(scores) == 3 * len(alone)


def test_the_largest_force_at_a_grasp_is_that_of_the_vehicles_own_grasp() -> None:
    in_file = ("right", "front", "left")
    assert [each.agent for each in flown().scenario.world.grasps] == [*in_file]
    largest = dict(zip(in_file, flown().grasp_force.max(axis=0), strict=True))
    scores = skyarm.score(flown(), ["grasp_largest"])
    assert scores == {f"{name}/grasp_largest": value for name, value in largest.items()}
    assert largest["front"] != pytest.approx(largest["left"], rel=1e-3)


def test_what_is_of_the_world_has_no_vehicles_name() -> None:
    scores = skyarm.score(flown(), ["object_last_z", "left/tip_lowest"])
    assert scores["object_last_z"] == flown().object_position[-1, 2]
    assert {*scores} == {"object_last_z", "left/tip_lowest"}


def test_names_are_written_out_for_each_vehicle_or_for_the_one_that_is_named() -> None:
    assert row_names(["efforts"], ARMS) == (
        "left/tau1_rms",
        "left/tau2_rms",
        "right/tau1_rms",
    )
    assert row_names(["right/efforts", "mechanism_last"], ARMS) == (
        "mechanism_last",
        "right/tau1_rms",
    )
    assert row_names(["tilt_max", "left/tilt_max"], ARMS) == (
        "left/tilt_max",
        "right/tilt_max",
    )
    written = row_names(["standard", "contact"], ARMS)
    # what stands in a file of rows means the same again
    assert row_names(written, ARMS) == written
    assert names_by_agent(["efforts"], {SOLE: (False,)}) == {
        SOLE: {"tau1_rms": "tau1_rms"}
    }


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (
            ["lft/tilt_max"],
            (
                r"metrics: 'lft/tilt_max': agent = 'lft': did you mean 'left'\? must be"
                r" one of left, right"
            ),
        ),
        (["left/tilt_mx"], r"metrics: 'tilt_mx': did you mean 'tilt_max'\?"),
        (["right/tau2_rms"], r"metrics: 'tau2_rms': .*must be one of"),
        (["/tilt_max"], r"metrics: '/tilt_max'"),
        ("tilt_max", r"metrics = 'tilt_max': must be a list of names and groups"),
        ([3], r"metrics: 3: must be one of"),
    ],
)
def test_wrong_names_are_refused_in_one_line(words: Any, line: str) -> None:
    with pytest.raises(ValueError, match=f"^{line}") as error:
        row_names(words, ARMS)
    assert "\n" not in str(error.value)


def test_axes_name_the_vehicle() -> None:
    assert metric_words("left/tilt_max") == ("left: largest tilt", "rad")
    assert metric_words("left/tau2_rms") == ("left: RMS torque of joint 2", "N m")
    assert metric_words("tilt_max") == ("largest tilt", "rad")


@pytest.mark.thorough
def test_contact_counts_at_the_vehicles_own_points() -> None:
    """Two vehicles that press the same wall, which nothing joins: each feels its own
    force, not the sum.
    """
    one = skyarm.load_scenario("press_and_hold", duration=2.5)
    world = dataclasses.replace(one.world, points=())
    pair = dataclasses.replace(
        one, agents={"left": one.agent, "right": one.agent}, world=world
    )
    metrics = ["contact_peak", "contact_largest", "contact_losses", "contact_first"]
    alone, both = (
        skyarm.score(skyarm.run(one), metrics),
        skyarm.score(skyarm.run(pair), metrics),
    )
    assert alone["contact_peak"] > 0.5
    for name in ("left", "right"):
        assert {each: both[f"{name}/{each}"] for each in metrics} == pytest.approx(
            alone, rel=1e-6
        )
    counted = Batch(pair, metrics=metrics, effort=0).fly({}).metrics
    assert {name: float(value[0]) for name, value in counted.items()} == pytest.approx(
        both, rel=1e-6
    )
