"""Scenarios from parameter paths and values: attitudes, payloads, delays, servos,
starts inside a surface.
"""

import dataclasses
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.scenario.endings import lowest_point
from skyarm.scenario.scenario_checks import check_scenario
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import Delays, ScenarioError, first_state
from skyarm.vehicle.linkage import BASE

DATA = Path(__file__).parents[1] / "data"

CASE = skyarm.load_scenario("case1")


@pytest.mark.parametrize(
    "given",
    [
        {"roll": 0.3},
        {"pitch": -0.4, "yaw": 1.1},
        {"roll": 0.3, "pitch": 0.2, "yaw": 0.1},
    ],
)
def test_angles_that_are_not_given_stay(given):
    stays = {"roll": 0.1, "pitch": 0.25, "yaw": -0.7}
    begun = skyarm.with_numbers(
        CASE, {f"initial.{name}": angle for name, angle in stays.items()}
    )
    turned = skyarm.with_numbers(
        begun, {f"initial.{name}": angle for name, angle in given.items()}
    )
    angles = stays | given
    x, y, z, w = Rotation.from_euler(
        "ZYX", [angles["yaw"], angles["pitch"], angles["roll"]]
    ).as_quat()
    assert tuple(turned.initial.quaternion) == pytest.approx((w, x, y, z), abs=1e-15)


def test_a_vehicle_without_a_tip_carries_loads_at_its_frames():
    vehicle = dataclasses.replace(CASE.plant.vehicle, end_effector="")
    flight = CASE.with_plant(dataclasses.replace(CASE.plant, vehicle=vehicle))
    frame = vehicle.frames[0].name
    heavier = skyarm.with_numbers(flight, {f"plant.payload.{frame}.mass": 0.05})
    assert float(heavier.plant.vehicle.mass) == pytest.approx(
        float(vehicle.mass) + 0.05
    )
    with pytest.raises(ScenarioError, match=f"no 'mass' here; there are {frame}"):
        skyarm.with_numbers(flight, {"plant.payload.mass": 0.05})


def test_a_payload_is_at_the_tip_or_at_a_frame_of_the_vehicle():
    own = float(CASE.plant.vehicle.mass)
    for path in ("plant.payload.mass", "plant.payload.tip.mass"):
        assert float(
            skyarm.with_numbers(CASE, {path: 0.05}).plant.vehicle.mass
        ) == pytest.approx(own + 0.05)
    for path in (
        "plant.payload.hand.mass",
        "plant.payload.tip",
        "plant.payload.tip.mass.kg",
    ):
        with pytest.raises(
            ScenarioError, match=r"there are mass|must lead to a number|no 'kg' here"
        ):
            skyarm.with_numbers(CASE, {path: 0.05})


@pytest.mark.parametrize("name", ["command", "rotors", "joints"])
def test_a_delay_is_of_whole_steps_unless_its_longest_is_given(name):
    odd = 0.00123
    assert (
        getattr(
            dataclasses.replace(
                CASE, delays=Delays(**{name: odd}, longest_command=0.01)
            ).delays,
            name,
        )
        == odd
    )
    with pytest.raises(ScenarioError, match=rf"delays\.{name} = 0\.00123"):
        check_scenario(dataclasses.replace(CASE, delays=Delays(**{name: odd})))
    with pytest.raises(ScenarioError, match=rf"delays\.{name} = 0\.00123"):
        check_scenario(
            dataclasses.replace(
                CASE, delays=Delays(**{name: odd}, longest_command=0.01), kind="mujoco"
            )
        )


def test_a_believed_latency_gives_the_law_s_servos_their_queues():
    flight = scenario_from(
        tomllib.loads((DATA / "servo_flight.toml").read_text()), DATA
    )
    late = skyarm.with_numbers(
        flight, {"model.vehicle.drives.shoulder.drive.latency": 0.02}
    )
    waiting = [
        [len(each.waiting) for each in made.controller.memory.drives]
        for made in (flight, late)
    ]
    assert waiting == [[1, 1], [round(0.02 * flight.rates.control), 1]]


def test_a_vehicle_that_starts_inside_a_surface_is_refused_before_the_flight():
    scenario = skyarm.load_scenario("press_and_hold")
    state = first_state(scenario)
    tip, _ = skyarm.frame_pose_world(
        scenario.plant.vehicle,
        np.array([*state.position]),
        np.array([*state.quaternion]),
        np.array(state.joints),
    )
    middle = np.array([0.342, 0.0, 0.45]) - tip + np.array([*state.position])
    inside = skyarm.with_numbers(
        scenario,
        {
            f"initial.position.{c}": x
            for c, x in zip("xyz", middle.tolist(), strict=True)
        },
    )
    with pytest.raises(ScenarioError, match="'wall'"):
        skyarm.run(inside)


def test_the_lowest_point_is_that_of_frames_of_base_and_arm_turned_with_them():
    vehicle = CASE.plant.vehicle
    foot = dataclasses.replace(
        vehicle.frames[0], name="foot", link=BASE, position=Vec3(0.1, 0.2, -0.5)
    )
    standing = dataclasses.replace(vehicle, frames=(*vehicle.frames, foot))
    turned = Rotation.from_euler("ZYX", [0.4, 0.3, -0.2])
    x, y, z, w = turned.as_quat()
    state = dataclasses.replace(
        first_state(CASE), quaternion=Quaternion(w, x, y, z), joints=(0.4, -0.3)
    )
    height = float(state.position.z)
    assert lowest_point(standing, state) == pytest.approx(
        height + turned.apply([0.1, 0.2, -0.5])[2], abs=1e-12
    )
    tip, _ = skyarm.frame_pose_world(
        vehicle,
        np.array([*state.position]),
        np.array([*state.quaternion]),
        np.array(state.joints),
    )
    assert lowest_point(vehicle, state) == pytest.approx(tip[2], abs=1e-12)
