"""Joints that nothing drives: a check lets them hang, and says which laws fall with
them.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Mat3, Vec3
from skyarm.control.catalogue import BEARS_UNDRIVEN
from skyarm.dynamics.array_front import center_of_mass
from skyarm.scenario.unlikely_numbers import unlikely_numbers
from skyarm.studies.assess.arm_poses import arm_poses, rest_of_hanging
from skyarm.studies.assess.assessment import assess_vehicle
from skyarm.studies.assess.thrust import locked_inertia
from skyarm.vehicle import BASE
from skyarm.vehicle.vehicle_records import undriven_joints
from support.cases import sampled

CARRIER = skyarm.load_vehicle("pelican_arm2")

SLUNG = """
schema = 1
name = "slung"
end_effector = "load"
base = { mass = 2.0, inertia = [0.02, 0.02, 0.035] }
rotor_defaults.thrust_coefficient = 1.7e-5
rotor_defaults.moment_coefficient = 0.016
rotor_defaults.max_speed = 900.0
frames = [{ name = "load", link = "cord", position = [0.0, 0.0, -1.5] }]
[[links]]
name = "hook"
parent = "base"
mass = 0.01
joint.name = "swing_x"
joint.axis = [1.0, 0.0, 0.0]
joint.effort_limit = 0.0
joint.damping = 1e-3
joint.armature = 1e-5
[[links]]
name = "cord"
parent = "hook"
mass = 0.8
com = [0.0, 0.0, -1.5]
inertia = [1e-3, 1e-3, 1e-3]
joint = { name = "swing_y", axis = [0.0, 1.0, 0.0], effort_limit = 0.0, damping = 1e-3 }
"""
ROTOR = """
[[rotors]]
name = "r{i}"
position = [{x}, {y}, 0.02]
direction = "{turn}"
"""
CORNERS = (
    (0.18, 0.18, "ccw"),
    (-0.18, 0.18, "cw"),
    (-0.18, -0.18, "ccw"),
    (0.18, -0.18, "cw"),
)

HOVER = """
schema = 1
name = "slung_hover"
duration = 4.0
plant = {{ vehicle = "slung.toml" }}
controller = {{ law = "{law}" }}
initial = {{ joints = [0.2, 0.0] }}
[reference.base]
kind = "hover"
position = [0.0, 0.0, 3.0]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    made = tmp_path_factory.mktemp("slung")
    rotors = (
        ROTOR.format(i=i, x=x, y=y, turn=turn) for i, (x, y, turn) in enumerate(CORNERS)
    )
    (made / "slung.toml").write_text(SLUNG + "".join(rotors))
    return made


def hover(folder: Path, law: str) -> skyarm.Scenario:
    (folder / f"{law}.toml").write_text(HOVER.format(law=law))
    return skyarm.load_scenario(folder / f"{law}.toml")


def with_joint(vehicle, index, **values):
    link = vehicle.links[index]
    links = list(vehicle.links)
    links[index] = dataclasses.replace(
        link, joint=dataclasses.replace(link.joint, **values)
    )
    return dataclasses.replace(vehicle, links=tuple(links))


def heights(vehicle, joints) -> np.ndarray:
    """Of the centre of mass in every pose, m: the energy of weight, over the weight."""
    count = len(joints)
    return center_of_mass(
        vehicle, np.zeros((count, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)), joints
    )[:, 2]


def test_a_slung_load_hovers_and_is_turned_as_if_it_gave_way(folder):
    vehicle = skyarm.load_vehicle(folder / "slung.toml")
    found = assess_vehicle(vehicle, poses=8)
    assert found.flies, [each.text for each in found.alarms()]
    (margin,) = [each for each in found.findings if each.question == "thrust margin"]
    # four rotors of 1.7e-5 N s^2 at 900 rad/s against the weight of 2.81 kg
    assert margin.value == pytest.approx(
        4.0 * 1.7e-5 * 900.0**2 / (2.81 * 9.81), rel=1e-9
    )
    inertia = locked_inertia(vehicle, np.zeros((1, 2)))[0]
    # the hinges lie in the base's own centre
    assert inertia[1, 1] == pytest.approx(0.02, rel=1e-6)
    # no hinge gives way about z
    assert inertia[2, 2] == pytest.approx(0.035 + 1e-3, rel=1e-6)


LIMITS = (
    (-math.inf, math.inf),
    (0.3, 1.2),
    (2.0, 7.0),
    (-1.5, -0.4),
    (-9.0, 9.0),
    (-math.inf, -1.0),
    (1.0, math.inf),
)


@pytest.mark.parametrize(("lower", "upper"), LIMITS)
def test_hanging_joints_rest_where_their_energy_is_least(lower, upper):
    vehicle = with_joint(
        with_joint(CARRIER, 0, effort_limit=0.0),
        1,
        effort_limit=0.0,
        lower=lower,
        upper=upper,
    )
    vehicle = with_joint(vehicle, 0, lower=-math.inf, upper=math.inf)
    rng = np.random.default_rng(3)
    low, high = max(lower, -7.0), min(upper, 7.0)
    starts = np.stack([rng.uniform(-7.0, 7.0, 6), rng.uniform(low, high, 6)], axis=1)
    rest = rest_of_hanging(vehicle, starts)
    tried = np.stack([rng.uniform(-7.0, 7.0, 400), rng.uniform(low, high, 400)], axis=1)
    assert np.all((lower <= rest[:, 1]) & (rest[:, 1] <= upper))
    assert heights(vehicle, rest).max() <= heights(vehicle, tried).min() + 1e-9


def test_a_sliding_joint_without_a_drive_comes_to_its_lower_end():
    vehicle = with_joint(
        CARRIER,
        0,
        kind="prismatic",
        axis=(0.0, 0.0, 1.0),
        lower=-0.2,
        upper=0.4,
        effort_limit=0.0,
    )
    assert rest_of_hanging(vehicle, np.array([[0.1, 0.5]])).tolist() == [[-0.2, 0.5]]


def test_driven_joints_stay_where_the_poses_put_them():
    poses = arm_poses(CARRIER, 8)
    assert rest_of_hanging(CARRIER, poses.joints).tolist() == poses.joints.tolist()
    assert len(np.unique(poses.joints[:, 0])) > 8
    hung = arm_poses(with_joint(CARRIER, 1, effort_limit=0.0), 8)
    assert hung.joints[:, 0].tolist() == poses.joints[:, 0].tolist()
    assert undriven_joints(with_joint(CARRIER, 1, effort_limit=0.0)) == (
        CARRIER.links[1].joint.name,
    )


def test_a_rope_of_many_joints_hangs_straight_down_in_every_pose_of_a_check():
    """Its centre of mass is then below the hook by the mean of its links' places."""
    link = skyarm.load_vehicle("pelican_arm2").links[0]
    hinge = dataclasses.replace(
        link.joint,
        effort_limit=0.0,
        lower=-math.inf,
        upper=math.inf,
        rotation=Mat3.identity(),
    )
    links = [
        dataclasses.replace(
            link,
            name=f"piece{i}",
            parent=i - 1 if i else BASE,
            joint=dataclasses.replace(
                hinge,
                name=f"hinge{i}",
                axis=Vec3(1, 0, 0) if i else Vec3(0, 0, 1),
                position=Vec3(0.0, 0.0, -0.1),
            ),
            body=dataclasses.replace(link.body, mass=0.01, com=Vec3(0.0, 0.0, -0.05)),
        )
        for i in range(12)
    ]
    rope = dataclasses.replace(CARRIER, links=tuple(links), frames=(), end_effector="")
    poses = arm_poses(rope)
    # the swivel, which no weight turns, is looked at all round
    assert len(np.unique(poses.joints[:, 0])) > 8
    assert np.ptp(poses.joints[:, 0]) > 3.0
    assert np.abs(poses.joints[:, 1:]).max() < 1e-6
    height = -sum(0.01 * (0.1 * (i + 1) + 0.05) for i in range(12))
    body = CARRIER.base.mass * CARRIER.base.com.z
    mean = (height + body) / (CARRIER.base.mass + 0.12)
    assert heights(rope, poses.joints) == pytest.approx(mean, abs=1e-6)


LAWS = (
    *BEARS_UNDRIVEN,
    *(
        "centroidal",
        "hybrid_computed_torque",
        "indi",
        "ct_ladder",
        "li2024",
        "kim2013",
        "bulut2019",
        "l1_adaptive",
    ),
    "nmpc",
)


@pytest.mark.parametrize("law", LAWS)
def test_laws_that_count_on_passive_joints_are_named_and_others_are_not(folder, law):
    lines = [
        line
        for line in unlikely_numbers(hover(folder, law))
        if line.startswith("controller.law")
    ]
    assert bool(lines) == (law not in BEARS_UNDRIVEN)
    if lines:
        assert (
            f"'{law}': counts on the torque of joints swing_x, swing_y, which no drive"
            " gives" in lines[0]
        )


@pytest.mark.parametrize("law", sampled(LAWS, len(LAWS)))
def test_the_laws_that_bear_a_slung_load_are_those_that_fly_it(folder, law):
    assert (skyarm.run(hover(folder, law)).status == "completed") == (
        law in BEARS_UNDRIVEN
    )


def test_driven_joints_name_no_law():
    planned = skyarm.load_scenario("case1")
    assert not [
        line for line in unlikely_numbers(planned) if line.startswith("controller.law")
    ]
