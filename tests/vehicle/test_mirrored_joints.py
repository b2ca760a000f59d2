"""Joints that are mirror images of each other get equal stops, dry friction and step
numbers, in any order of links.

The mirror is the oracle: nothing is compared with what the program computed before.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from vehicle_documents import file_of

import skyarm
from skyarm.plant.joint_rate import stop_numbers
from skyarm.vehicle import Joint, Vehicle
from skyarm.vehicle.mobility import joint_mobility, of_mirrored
from skyarm.vehicle.stops import with_smooth_friction

PAIRS = (("upper 1", "upper -1"), ("lower 1", "lower -1"))


def two_arms(rng: np.random.Generator, folder: Path, **joints: Any) -> Vehicle:
    """Drawn vehicle with a left and a right arm, which may state opposite axes, and the
    links of both in any order.
    """
    length, aside, mass = (
        float(rng.uniform(*ends)) for ends in ((0.08, 0.2), (0.03, 0.1), (0.02, 0.08))
    )
    low, high = -float(rng.uniform(0.2, 1.5)), float(rng.uniform(0.2, 1.5))
    links = list[dict[str, Any]]()
    for name, parent, axis, place in (
        ("upper", "base", np.array([1.0, 0.3, 0.0]), [0.0, aside, -0.03]),
        ("lower", "upper", np.array([0.1, 1.0, 0.2]), [0.0, 0.0, -length]),
    ):
        for side in (1, -1):
            # of a turn the mirror keeps the part about y; an axis stated the other way
            # round changes the limits
            stated = int(rng.choice([1, -1])) if side == -1 else 1
            turned = (
                stated * axis * ([1.0, 1.0, 1.0] if side == 1 else [-1.0, 1.0, -1.0])
            )
            limits = (
                {"lower": low, "upper": high}
                if stated == 1
                else {"lower": -high, "upper": -low}
            )
            joint = {
                "name": f"{name} {side}",
                "axis": turned.tolist(),
                **limits,
                "effort_limit": 2.0,
                **joints,
            }
            links.append(
                {
                    "name": f"{name}{side}",
                    "parent": parent if parent == "base" else f"{parent}{side}",
                    "mass": mass,
                    "com": [0.01, side * 0.01, -length / 2.0],
                    "inertia": [1e-4, 1.2e-4, 3e-5],
                    "joint": {
                        **joint,
                        "position": [place[0], side * place[1], place[2]],
                    },
                }
            )
    order = [int(i) for half in ([0, 1], [2, 3]) for i in rng.permutation(half)]
    if rng.random() < 0.5:  # arm after arm
        order = sorted(order, key=lambda i: i % 2)
    document = {
        "schema": 1,
        "name": "drawn",
        "base": {"mass": 1.2, "inertia": [0.015, 0.017, 0.025]},
        "links": [links[i] for i in order],
    }
    return skyarm.load_vehicle(file_of(folder, document))


@pytest.mark.parametrize("seed", range(4, 36, 5))
def test_mirrored_joints_get_equal_stops_and_step_numbers(
    seed: int, tmp_path: Path
) -> None:
    vehicle = two_arms(np.random.default_rng(seed), tmp_path)
    numbers = dict(zip(vehicle.joint_names, stop_numbers(vehicle), strict=True))
    joints = {joint.name: joint for joint in vehicle.joints}
    for left, right in PAIRS:
        assert numbers[left] == numbers[right]
        stops = [
            (joints[side].stop_stiffness, joints[side].stop_damping)
            for side in (left, right)
        ]
        assert stops[0] == pytest.approx(stops[1], rel=1e-12)
        assert stops[0] > (0.0, 0.0)


@pytest.mark.parametrize("seed", range(4, 36, 5))
def test_dry_friction_of_mirrored_joints_is_bent_equally(
    seed: int, tmp_path: Path
) -> None:
    stiff = two_arms(np.random.default_rng(seed), tmp_path, coulomb=0.2)
    bent = with_smooth_friction(stiff, stiff.joint_names)
    rates = {joint.name: joint.coulomb_rate for joint in bent.joints}
    assert max(rates.values()) > Joint(name="unbent").coulomb_rate
    for left, right in PAIRS:
        assert rates[left] == rates[right]


def test_joints_without_a_partner_keep_their_own_numbers() -> None:
    """No two joints of one arm are alike: stops and steps of shipped vehicles are those
    of their own postures.
    """
    for vehicle in map(skyarm.load_vehicle, skyarm.list_vehicles()):
        own = np.random.default_rng(0).uniform(1.0, 2.0, (2, vehicle.n))
        alone = np.array_equal(of_mirrored(own, joint_mobility(vehicle)), own)
        assert alone == (vehicle.name != "octo_coaxial_two_arms")


def test_joints_of_two_shipped_arms_share_the_larger_number() -> None:
    # a torso, the right arm, the left arm
    vehicle = skyarm.load_vehicle("octo_coaxial_two_arms")
    own = np.array([9.0, 1.0, 4.0, 3.0, 2.0])
    assert of_mirrored(own, joint_mobility(vehicle)).tolist() == [
        9.0,
        3.0,
        4.0,
        3.0,
        4.0,
    ]
