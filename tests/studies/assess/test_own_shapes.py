"""``check`` says at which joint angles two shapes of a vehicle meet, as a sampler of
MuJoCo's distances finds.
"""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
import pytest

from skyarm.algebra import ZERO3, Mat3, Vec3
from skyarm.plant.mujoco_model import joint_addresses
from skyarm.studies.assess.arm_poses import arm_poses
from skyarm.studies.assess.assessment import assess_vehicle
from skyarm.studies.assess.check_sheet import sheet
from skyarm.studies.assess.data_sheet import sheet as data_sheet
from skyarm.studies.assess.data_sheet import vehicle_facts
from skyarm.studies.assess.finding import NOTE, OK
from skyarm.studies.assess.joints import OWN, own_collision
from skyarm.vehicle import Vehicle
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.world.scene.clearance import clearances
from support.mujoco_shapes import boxed, distance, spec_with_shapes


def least_by_mujoco(vehicle: Vehicle, joints: np.ndarray) -> float:
    """Least distance (m) of the own shapes that count, in given arm poses."""
    model = spec_with_shapes(vehicle).compile()
    data, (addresses, _) = mujoco.MjData(model), joint_addresses(vehicle, model)
    pairs = [
        (pair.volume, pair.other)
        for pair in clearances(vehicle).pairs
        if "rotor/" not in pair.volume + pair.other
    ]
    least = np.inf
    for pose in joints:
        data.qpos[addresses] = pose
        mujoco.mj_kinematics(model, data)
        least = min(least, *(distance(model, data, *pair) for pair in pairs))
    return least


def within(vehicle: Vehicle, low: float, high: float) -> Vehicle:
    """The same vehicle with other limits of its joints."""
    links = tuple(
        dataclasses.replace(
            link, joint=dataclasses.replace(link.joint, lower=low, upper=high)
        )
        for link in vehicle.links
    )
    return vehicle.with_checked(links=links)


def drawn(rng: np.random.Generator) -> Vehicle:
    """The vehicle with a tool of another length and narrower joints."""
    vehicle = boxed()
    longer = dataclasses.replace(
        vehicle.collisions[-1], position=Vec3(0.0, 0.0, float(-rng.uniform(0.0, 0.1)))
    )
    most = float(rng.choice([0.1, 0.6, 2.0]))
    shapes = (*vehicle.collisions[:-1], longer)
    return within(dataclasses.replace(vehicle, collisions=shapes), -most, most)


@pytest.mark.parametrize("seed", range(3))
def test_own_shapes_meet_where_a_sampler_of_mujoco_finds_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vehicle = drawn(rng)
    vehicle = dataclasses.replace(vehicle, rotors=())
    (found,) = own_collision(arm_poses(vehicle, 64))
    limit = vehicle.joints[0].ends[1]
    sampled = least_by_mujoco(vehicle, rng.uniform(-limit, limit, (500, 2)))
    if sampled < -1e-3:
        assert found.level == NOTE
    if found.level == NOTE:
        assert least_by_mujoco(vehicle, np.array([found.joints])) < 0.0
        assert "overlap at joint1 = " in found.text
    else:
        # the search goes on where the sampler ends
        assert found.value <= sampled + 1e-6
        assert found.value == pytest.approx(sampled, abs=0.02)
    assert np.all(np.abs(found.joints) <= limit)


def test_narrow_joints_keep_the_shapes_apart() -> None:
    (wide,), (narrow,) = (
        own_collision(arm_poses(within(boxed(), -most, most), 16))
        for most in (2.0, 0.05)
    )
    assert (wide.level, narrow.level) == (NOTE, OK)
    assert wide.value < 0.0 < narrow.value
    assert " are nearest at joint1 = " in narrow.text


def test_the_pose_is_worse_than_all_that_were_sampled() -> None:
    vehicle = dataclasses.replace(boxed(), rotors=())
    poses = arm_poses(vehicle, 4)
    (found,) = own_collision(poses)
    gaps = clearances(vehicle).distances(ZERO3, Mat3.identity(), tuple(poses.joints.T))
    assert found.value < np.min(np.array(gaps)) - 1e-3


def test_a_check_says_it_in_one_line_and_the_vehicle_flies() -> None:
    found = assess_vehicle(boxed(), poses=64)
    assert found.flies
    (line,) = (each for each in found.findings if each.question == OWN)
    assert line.text.startswith("link/link2/")
    assert " and base/" in line.text
    assert OWN in repr(sheet(found))
    assert own_collision(arm_poses(boxed(), 64)) == [line]


def test_a_vehicle_without_shapes_is_not_asked() -> None:
    assert not own_collision(arm_poses(load_vehicle("hummingbird_arm2"), 8))
    base_alone = dataclasses.replace(
        boxed(), collisions=boxed().collisions[:2], rotors=()
    )
    assert not own_collision(arm_poses(base_alone, 8))


def test_the_data_sheet_lists_the_shapes_that_touch() -> None:
    vehicle = boxed()
    facts = vehicle_facts(vehicle, 9.81)
    assert [each["body"] for each in facts["shapes"]] == [
        *["base"] * 2,
        "link1",
        *["link2"] * 2,
    ]
    assert facts["shapes"][1]["size_m"] == [0.01, 0.15]
    assert facts["shapes"][-1]["corners"] == 4
    captions = {each.caption for each in data_sheet(vehicle, facts)}
    bare = dataclasses.replace(vehicle, collisions=())
    without = data_sheet(bare, vehicle_facts(bare, 9.81))
    assert captions - {each.caption for each in without} == {"shapes that touch"}
