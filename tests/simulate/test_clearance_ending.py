"""The ending `clearance`: a flight ends where a body comes too near to a surface or to
the vehicle itself.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from skyarm import Batch, Scenario, run
from skyarm.scenario.endings import Clearance, clearances_of
from skyarm.scenario.scenario_file import load_scenario, scenario_from
from support.flights import document

PLANTS = ("rigid_body", "mujoco")

BALL = {"name": "ball", "shape": "sphere", "size": [0.05], "position": [1.2, 0.0, 1.0]}


def towards_a_ball(plant: str = "rigid_body", **ending: Any) -> Scenario:
    """A vehicle without an arm that drifts along x to a ball; only its rotor discs can
    touch it, not its hubs.
    """
    surge = {
        "kind": "signals",
        "x": {"kind": "ramp", "start": 0.5, "duration": 3.0, "height": 0.9},
        "z": 1.0,
    }
    endings = [{"kind": "clearance", **ending}] if "none" not in ending else []
    made = document(
        "case1",
        duration=5.0,
        reference__base=surge,
        world={"surfaces": [BALL]},
        endings=endings,
    )
    return scenario_from(
        made, replaced={"plant": plant} if plant != "rigid_body" else {}
    )


def nearest_to_ball(log: Any) -> np.ndarray:
    """Distance (m) of the ball from a flat round disc of the front rotor, whose rim is
    1 % of the boom thick, (N,).
    """
    front = next(
        each for each in log.scenario.agent.plant.vehicle.rotors if each.name == "front"
    )
    hub, boom = (
        np.array(front.position),
        float(np.linalg.norm(np.array(front.position))),
    )
    radius = min(0.5 * boom, 0.45 * boom * np.sqrt(2.0))
    w, x, y, z = log.quaternion.T
    along = np.stack(
        [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=1
    )
    up = np.stack(
        [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1
    )
    side = np.cross(up, along)
    at = log.position + along * hub[0] + side * hub[1] + up * hub[2]
    apart = np.array(BALL["position"]) - at
    height = np.einsum("ij,ij->i", apart, up)
    out = np.linalg.norm(apart - up * height[:, None], axis=1) - (radius - 0.01 * boom)
    return np.hypot(np.maximum(out, 0.0), height) - 0.01 * boom - 0.05


@pytest.mark.parametrize("plant", PLANTS)
def test_a_flight_ends_where_a_rotor_comes_within_the_margin_of_a_surface(
    plant: str,
) -> None:
    log = run(towards_a_ball(plant, margin=0.02))
    assert log.status == "clearance"
    assert log.info["cause"].startswith("rotor/front and surface 'ball' are 0.0")
    gaps = nearest_to_ball(log)
    assert gaps.min() >= 0.02 - 1e-9
    # the next control period, at nearly the same speed, would be inside
    assert 2.0 * gaps[-1] - gaps[-2] < 0.02 + 1e-4


def test_without_the_ending_the_flight_goes_on_and_is_unchanged() -> None:
    free, ended = run(towards_a_ball(none=True)), run(towards_a_ball())
    assert (free.status, ended.status) == ("completed", "clearance")
    assert nearest_to_ball(free).min() < 0.0
    np.testing.assert_array_equal(ended.position, free.position[: len(ended.position)])


@pytest.mark.parametrize("plant", PLANTS)
def test_an_arm_that_folds_into_a_rotor_ends_the_flight(plant: str) -> None:
    up = [{"kind": "ramp", "start": 0.2, "duration": 2.0, "height": -2.6}, 0.0]
    made = document(
        "case1", duration=3.0, reference__joints=up, endings=[{"kind": "clearance"}]
    )
    log = run(
        scenario_from(made, replaced={"plant": plant} if plant != "rigid_body" else {})
    )
    assert log.status == "clearance"
    assert log.info["cause"].startswith("link/link2/tip and ")


def test_a_batch_names_the_ending_and_each_lane_has_its_margin() -> None:
    margin, place = "endings.clearance.margin", "world.surfaces.ball.position.x"
    base = towards_a_ball(margin=0.0)
    outcome = Batch(base, [margin, place]).fly(
        {
            margin: np.array([0.0, 0.05, 0.05, 0.0]),
            place: np.array([1.2, 1.2, 1.3, 3.0]),
        }
    )
    assert outcome.status.tolist() == [
        "clearance",
        "clearance",
        "clearance",
        "completed",
    ]
    assert (
        outcome.end_time[0]
        == run(base).info["end_time"]
        > outcome.end_time[1]
        < outcome.end_time[2]
    )


@pytest.mark.parametrize(
    ("name", "bearer"), [("press_and_hold", "link2"), ("pick_and_carry", "link2")]
)
def test_rods_of_the_link_with_the_tip_or_a_gripper_may_touch_surfaces(
    name: str, bearer: str
) -> None:
    names = clearances_of(load_scenario(name)).names
    met = {each.split(" and surface")[0] for each in names if " and surface " in each}
    assert "link/link1/joint2" in met
    assert not [each for each in met if each.startswith(f"link/{bearer}/")]
    assert [each for each in names if each.startswith(f"link/{bearer}/")]


@pytest.mark.thorough
def test_a_tip_that_presses_does_not_end_the_flight() -> None:
    base = scenario_from(document("press_and_hold", duration=6.0))
    log, same = run(dataclasses.replace(base, endings=(Clearance(),))), run(base)
    assert log.status == same.status == "completed"
    np.testing.assert_array_equal(log.position, same.position)


def test_a_margin_below_zero_is_refused() -> None:
    with pytest.raises(ValueError, match=r"endings\[0\].margin = -0.1: must be"):
        towards_a_ball(margin=-0.1)
