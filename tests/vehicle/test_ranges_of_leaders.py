"""Limits of joints that follow others: their leader keeps to them, on both plants."""

from __future__ import annotations

import dataclasses
import math

import pytest

from skyarm.algebra import Vec3
from skyarm.dynamics.kinematics import every_joint
from skyarm.vehicle.attach import Mimic, couple, limits_that_contradict
from skyarm.vehicle.linkage import Joint
from skyarm.vehicle.vehicle_files import load_vehicle

ARM2 = load_vehicle("hummingbird_arm2_rotors")


def coupled(own, followed, mimic):
    """Links and followers of an arm whose third joint follows the second."""
    second = ARM2.links[1]
    leader = dataclasses.replace(
        second, joint=dataclasses.replace(second.joint, lower=own[0], upper=own[1])
    )
    joint = Joint(
        name="finger",
        axis=Vec3(0, 1, 0),
        position=Vec3(0, 0, -0.1),
        lower=followed[0],
        upper=followed[1],
    )
    finger = dataclasses.replace(second, name="finger", joint=joint)
    links, followers, _ = couple([ARM2.links[0], leader, finger], (), {"finger": mimic})
    return links, followers


@pytest.mark.parametrize(
    ("own", "followed", "mimic", "expected"),
    [
        ((-1.0, 1.0), (-0.5, 0.5), Mimic("joint2", 2.0), (-0.25, 0.25)),
        ((-1.0, 1.0), (-0.1, 0.5), Mimic("joint2", -0.5, 0.2), (-0.6, 0.6)),
        ((-1.0, 1.0), (-9.0, 9.0), Mimic("joint2", -1.0), (-1.0, 1.0)),
        (
            (-math.inf, math.inf),
            (0.0, math.inf),
            Mimic("joint2", -1.0),
            (-math.inf, 0.0),
        ),
    ],
)
def test_a_leader_stays_where_its_follower_may_be(own, followed, mimic, expected):
    links, followers = coupled(own, followed, mimic)
    joint = links[1].joint
    assert (joint.lower, joint.upper) == pytest.approx(expected)
    vehicle = dataclasses.replace(
        ARM2, links=links, followers=followers, frames=(), end_effector=""
    )
    for end in (joint.lower, joint.upper):
        if math.isfinite(end):
            follower = every_joint(vehicle, (0.0, end))[2]
            assert followed[0] - 1e-12 <= follower <= followed[1] + 1e-12
    assert limits_that_contradict(links, followers) == ()


def test_limits_that_leave_no_range_do_not_count_and_are_noted():
    links, followers = coupled((0.0, 0.8), (0.0, 0.8757), Mimic("joint2", -1.0))
    assert (links[1].joint.lower, links[1].joint.upper) == (0.0, 0.8)
    (note,) = limits_that_contradict(links, followers)
    assert note.startswith("joint finger: has limits")


def test_a_file_s_follower_has_its_leader_stopped_in_time(tmp_path):
    inertia = 'ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"'
    inertial = (
        '<inertial><origin xyz="0 0 -0.1"/><mass value="0.05"/><inertia'
        f" {inertia}/></inertial>"
    )
    text = '<link name="{}">' + inertial + "</link>"
    joint = (
        '<joint name="{0}" type="revolute"><parent link="base"/><child'
        ' link="{1}"/><axis xyz="0 1 0"/>'
    )
    joint += '<limit lower="-{2}" upper="{2}" effort="5"/>{3}</joint>'
    urdf = "".join(text.format(name) for name in ("base", "l", "m")) + joint.format(
        "a", "l", 1.0, ""
    )
    urdf += joint.format("c", "m", 0.5, '<mimic joint="a" multiplier="2"/>')
    (tmp_path / "u.urdf").write_text(f'<robot name="r">{urdf}</robot>', "utf-8")
    (tmp_path / "u.toml").write_text(
        'schema = 1\nname = "u"\nurdf = "u.urdf"\nmimic = "couple"\n', "utf-8"
    )
    (link,) = load_vehicle(tmp_path / "u.toml").links
    assert (link.joint.lower, link.joint.upper) == (-0.25, 0.25)
    assert link.joint.has_stops
