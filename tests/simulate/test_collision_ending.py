"""The ending `collision`: a flight ends where chosen shapes of the vehicle press on a
surface at rest or on each other.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skyarm import Batch, Scenario, run
from skyarm.algebra import Vec3
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import first_state
from support.flights import document
from support.shaped import shaped

PLANTS = ("rigid_body", "mujoco")

ARMED = "hummingbird_arm2_rotors"

RADIUS, FACE = 0.2, 0.8
"""Radius of the ball around the base, and place of the wall's face along x, m."""

WALL = {
    "name": "wall",
    "shape": "box",
    "size": [0.2, 4.0, 4.0],
    "position": [FACE + 0.1, 0.0, 1.0],
}

SURGE = {
    "kind": "signals",
    "x": {"kind": "ramp", "start": 0.2, "duration": 2.0, "height": 0.9},
    "z": 1.0,
}


def towards_a_wall(
    folder: Path, *endings: dict[str, Any], plant: str = "rigid_body", **world: Any
) -> Scenario:
    """A ball with rotors drifts along x to a wall."""
    ball = {"shape": "sphere", "size": [RADIUS]}
    made = document(
        "case1",
        duration=3.0,
        plant__vehicle=shaped(folder, [ball], ARMED),
        reference__base=SURGE,
        world={"surfaces": [WALL], **world},
        endings=[{"kind": "collision", **each} for each in endings],
    )
    return scenario_from(
        made, folder, {"plant": plant} if plant != "rigid_body" else {}
    )


@pytest.mark.parametrize("plant", PLANTS)
def test_a_flight_ends_where_a_ball_reaches_a_wall(tmp_path: Path, plant: str) -> None:
    log = run(towards_a_wall(tmp_path, {}, plant=plant))
    assert log.status == "collision"
    assert log.info["cause"] == "base/wall press with more than 0.0 N"
    reach = log.position[:, 0] + RADIUS
    assert reach.max() <= FACE
    # the next control period, at nearly the same speed, would be inside
    assert 2.0 * reach[-1] - reach[-2] > FACE - 1e-5


@pytest.mark.parametrize("plant", PLANTS)
def test_a_force_is_that_of_the_contact_itself(tmp_path: Path, plant: str) -> None:
    free = run(towards_a_wall(tmp_path, plant=plant))
    force = free.component("collision_force")[:, 0]
    first = int(np.argmax(force > 3.0))
    assert force.max() > 3.0
    ended = run(towards_a_wall(tmp_path, {"force": 3.0}, plant=plant))
    assert ended.status == "collision"
    assert ended.info["cause"] == "base/wall press with more than 3.0 N"
    assert len(ended.time) == first
    np.testing.assert_array_equal(ended.position, free.position[:first])


def test_a_batch_names_the_ending_and_each_lane_has_its_force(tmp_path: Path) -> None:
    path = "endings.collision.force"
    base = towards_a_wall(tmp_path, {"force": 1.0})
    most = float(run(towards_a_wall(tmp_path)).component("collision_force").max())
    forces = [0.0, 0.8 * most, 1.2 * most]
    outcome = Batch(base, [path]).fly({path: np.array(forces)})
    assert outcome.status.tolist() == ["collision", "collision", "completed"]
    alone = [run(towards_a_wall(tmp_path, {"force": each})) for each in forces[:2]]
    ends = [log.info["end_time"] for log in alone]
    assert outcome.end_time[:2].tolist() == ends
    assert ends[0] < ends[1]


@pytest.mark.parametrize(
    ("pair", "status"),
    [("base/wall", "collision"), ("wall", "collision"), ("base/roof", "completed")],
)
def test_an_ending_is_about_the_pairs_that_it_names(
    tmp_path: Path, pair: str, status: str
) -> None:
    roof = {**WALL, "name": "roof", "position": [0.0, 0.0, 9.0]}
    log = run(towards_a_wall(tmp_path, {"pair": pair}, surfaces=[WALL, roof]))
    assert log.status == status


def test_what_its_end_does_not_see_is_refused(tmp_path: Path) -> None:
    """Bodies that move by themselves, and names of nothing."""
    crate = {"name": "crate", "shape": "sphere", "size": [0.1], "mass": 0.1}
    moving = {**WALL, "name": "lift", "motion": [0.0, 0.0, SURGE["x"]]}
    there = r"must be base/wall of a vehicle's shapes with surfaces at rest or its own"
    for pair in ("base/crate", "crate", "bas", "base/wal"):
        with pytest.raises(ValueError, match=r"endings\[0\].pair = .*" + there):
            towards_a_wall(
                tmp_path, {"pair": pair}, objects=[{**crate, "position": [3, 0, 1]}]
            )
    with pytest.raises(ValueError, match=r"endings\[0\].pair = 'lift': .*" + there):
        towards_a_wall(tmp_path, {"pair": "lift"}, surfaces=[WALL, moving])
    with pytest.raises(
        ValueError, match=r"endings\[0\]: kind = 'collision' must be left out"
    ):
        scenario_from(document("case1", endings=[{"kind": "collision"}]))
    with pytest.raises(ValueError, match=r"endings\[0\].force = -1.0: must be"):
        towards_a_wall(tmp_path, {"force": -1.0})


def test_shapes_of_one_vehicle_end_a_flight_on_request(tmp_path: Path) -> None:
    """A ball at the tip of an arm that folds to one at the base."""
    tip = {"shape": "sphere", "size": [0.03], "link": "link2"}
    made = document(
        "case1",
        duration=3.0,
        reference__joints=[
            {"kind": "ramp", "start": 0.2, "duration": 1.0, "height": each}
            for each in (0.5, 2.2)
        ],
        endings=[{"kind": "collision"}],
    )
    vehicle = scenario_from({**made, "endings": []}).agent.vehicle
    tip["position"] = [float(c) for c in vehicle.frame().position]
    made["plant"] |= {
        "vehicle": shaped(tmp_path, [{"shape": "sphere", "size": [0.12]}, tip], ARMED)
    }
    made["world"] = {
        "self_collision": True,
        "surfaces": [{"name": "far", "position": [0.0, 0.0, -9.0]}],
    }
    log = run(scenario_from(made, tmp_path))
    assert log.status == "collision"
    assert log.info["cause"].startswith("base/link2 press")
    apart = np.linalg.norm(log.tool - log.position, axis=1)
    assert apart.min() >= 0.15
    assert 2.0 * apart[-1] - apart[-2] < 0.15 + 1e-4


@pytest.mark.parametrize(("apart", "fine"), [(0.1, True), (2e-5, True), (5e-6, False)])
def test_slack_is_a_distance_within_which_a_touch_counts(
    tmp_path: Path, apart: float, fine: bool
) -> None:
    """Of what machine code may have found outside, with other rounding."""
    scenario = towards_a_wall(tmp_path, {})
    state = dataclasses.replace(
        first_state(scenario), position=Vec3(FACE - RADIUS - apart, 0.0, 1.0)
    )
    (ending,) = scenario.endings
    assert ending.fine(scenario, state, state.position, 1e-5) == fine
    assert ending.fine(scenario, state, state.position, 0)
