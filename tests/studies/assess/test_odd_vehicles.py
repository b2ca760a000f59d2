"""A check of vehicles that are out of the ordinary: no rotors, no hover, fingers,
limits on one side.
"""

from __future__ import annotations

import dataclasses
import math
import re

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.dynamics.actuators import AllocationError, make_mixer
from skyarm.dynamics.actuators.hover import highest_thrust, hover_trim
from skyarm.plant.joint_rate import friction_rate
from skyarm.scenario.unlikely_numbers import unlikely_in_vehicle
from skyarm.studies.assess.arm_poses import (
    Allocation,
    arm_poses,
    hover_efforts,
    joint_range,
)
from skyarm.studies.assess.assessment import Assessment, assess_vehicle
from skyarm.studies.assess.check_sheet import sheet
from skyarm.studies.assess.endurance import hover_time
from skyarm.studies.assess.finding import FAULT, NOTE, WARNING, Finding, finding_of_line
from skyarm.studies.assess.thrust import locked_inertia, torque_authority
from skyarm.vehicle.linkage import Joint

PELICAN = skyarm.load_vehicle("pelican_arm2")
HEXAROTOR12 = skyarm.load_vehicle("hexarotor12_arm5")
FEW = 8


def answer(found: Assessment, question: str) -> Finding:
    (one,) = [each for each in found.findings if each.question == question]
    return one


def with_base(vehicle, **values):
    return dataclasses.replace(
        vehicle, base=dataclasses.replace(vehicle.base, **values)
    )


def test_a_vehicle_without_rotors_and_with_a_tip_has_an_answer():
    found = assess_vehicle(dataclasses.replace(PELICAN, rotors=()), poses=FEW)
    (alarm,) = found.alarms()
    assert alarm.question == "rotors"
    assert "[[attach]]" in alarm.remedy, (
        "a bare arm flies on the multirotor of another file"
    )


@pytest.mark.parametrize("rotors", [0, 3], ids=["no rotors", "too few rotors"])
def test_a_battery_without_rotors_that_hover_is_not_to_blame(rotors):
    found = assess_vehicle(
        dataclasses.replace(HEXAROTOR12, rotors=HEXAROTOR12.rotors[:rotors]), poses=FEW
    )
    assert answer(found, "time aloft").level == NOTE


def test_a_vehicle_too_heavy_to_hover_does_not_lack_charge():
    found = assess_vehicle(with_base(HEXAROTOR12, mass=30.0), poses=FEW)
    assert answer(found, "thrust margin").level == FAULT
    aloft = answer(found, "time aloft")
    assert (aloft.level, aloft.field) == (NOTE, "rotors")


def test_a_vehicle_of_which_a_rotor_would_pull_down_does_not_lack_charge():
    found = assess_vehicle(
        with_base(HEXAROTOR12, mass=3.0, com=Vec3(-0.8, 0.0, 0.0)), poses=FEW
    )
    assert answer(found, "balance of the rotors").level == FAULT
    assert answer(found, "time aloft").level == NOTE


def test_an_empty_battery_is_to_blame_where_the_rotors_hover():
    empty = dataclasses.replace(
        HEXAROTOR12, battery=dataclasses.replace(HEXAROTOR12.battery, charge=0.0)
    )
    with pytest.raises(ValueError, match="battery"):
        hover_time(empty)
    assert answer(assess_vehicle(empty, poses=FEW), "time aloft").level == FAULT


def test_a_base_far_ahead_within_the_polygon_is_named_and_not_said_to_be_outside():
    found = answer(
        assess_vehicle(with_base(HEXAROTOR12, com=Vec3(-0.45, 0.0, 0.0)), poses=FEW),
        "balance of the rotors",
    )
    assert (found.level, found.field) == (FAULT, "base.com, links.com")
    assert "base.com" in found.remedy
    assert "outside" not in found.text


def test_nothing_that_can_be_held_follows_from_the_weight():
    found = answer(
        assess_vehicle(with_base(HEXAROTOR12, mass=30.0), poses=FEW), "largest payload"
    )
    assert found.level == NOTE
    assert found.text.startswith("none: ")
    assert "; follows from " in found.text
    assert found.remedy


@pytest.mark.parametrize("name", ["hexarotor12_arm5", "pelican_arm2"])
def test_no_pose_has_less_angular_acceleration_than_the_one_found(name):
    vehicle = skyarm.load_vehicle(name)
    poses, allocation = arm_poses(vehicle, 256), Allocation.of(vehicle)
    joints = arm_poses(vehicle, 2000).joints
    squared, inertia = (
        allocation.squared_speeds(hover_efforts(vehicle, 9.81, joints)),
        locked_inertia(vehicle, joints),
    )
    for axis, found in enumerate(torque_authority(poses)):
        room = np.minimum(
            *(allocation.room(squared, sign * np.eye(4)[axis]) for sign in (1.0, -1.0))
        )
        assert found.value <= 1.001 * (room / inertia[:, axis, axis]).min()


def test_the_least_angular_acceleration_is_that_of_a_search_by_other_means():
    # differential evolution over forces and bodies put together from the file alone:
    # roll 41.75, pitch 35.35 rad/s^2
    roll, pitch, _ = torque_authority(arm_poses(HEXAROTOR12))
    assert (roll.value, pitch.value) == pytest.approx((41.75, 35.35), rel=2e-3)


QUAD = skyarm.load_vehicle("hummingbird")


def with_rotors(changes):
    rotors = (
        dataclasses.replace(each, **change)
        for each, change in zip(QUAD.rotors, changes, strict=True)
    )
    return dataclasses.replace(QUAD, rotors=tuple(rotors))


DOWN = {"axis": Vec3(0, 0, -1)}
BOTH_WAYS = {**DOWN, "reversible": True}


def test_no_shipped_law_flies_a_vehicle_whose_hover_turns_rotors_backwards():
    vehicle = with_rotors([BOTH_WAYS, {}, {}, BOTH_WAYS])
    found = assess_vehicle(vehicle, poses=FEW)
    (fault,) = found.alarms()
    assert (fault.question, fault.level, fault.field) == (
        "balance of the rotors",
        FAULT,
        "rotors.reversible",
    )
    first, _, _, last = (each.name for each in QUAD.rotors)
    assert (
        fault.text == f"no shipped law flies it: hover turns {first}, {last} backwards"
    )
    assert "the shipped ones turn no rotor backwards" in fault.remedy
    upright = assess_vehicle(QUAD, poses=FEW)
    for question in (
        "thrust margin",
        "senses of rotation",
        "roll authority",
        "pitch authority",
        "largest side force",
    ):
        assert answer(found, question).value == pytest.approx(
            answer(upright, question).value, rel=1e-9
        ), question
    each = QUAD.rotors[0]  # thrust of a quarter of the weight, by hand
    speed = math.sqrt(float(QUAD.mass) * 9.81 / 4 / float(each.thrust_coefficient))
    trim = hover_trim(vehicle, (), 9.81)
    assert trim.needs_no_pull
    assert [float(w) for w in trim.speeds] == pytest.approx(
        [-speed, speed, speed, -speed], rel=1e-9
    )
    assert float(highest_thrust(vehicle)) == pytest.approx(
        sum(float(r.thrust_coefficient) * float(r.max_speed) ** 2 for r in QUAD.rotors),
        rel=1e-12,
    )


def test_reversible_rotors_that_hover_forwards_fly():
    assert not assess_vehicle(
        with_rotors([{"reversible": True}] * 4), poses=FEW
    ).alarms()


def test_thrusts_that_cancel_are_a_matter_of_axes_and_not_of_units():
    # by symmetry no thrust is left
    found = assess_vehicle(with_rotors([DOWN, {}, {}, DOWN]), poses=FEW)
    assert {each.question for each in found.alarms()} == {"axes of the rotors"}
    assert "max_speed" not in answer(found, "units").text


def test_a_joint_that_no_plant_takes_is_a_fault_and_its_rate_is_told_from_the_limit():
    """The decay rate of a light link is close to its damping over its inertia about the
    joint.
    """
    vehicle = skyarm.load_vehicle("hummingbird_arm2")
    assert not any(
        each.question == "simulation"
        for each in assess_vehicle(vehicle, poses=FEW).findings
    )
    tip = vehicle.links[-1]
    # linear in the damping of one joint
    rate = friction_rate(with_damping(vehicle, 1e-4)) / 1e-4
    found = assess_vehicle(with_damping(vehicle, 10000.4 / rate), poses=FEW)
    fault = answer(found, "simulation")
    assert (fault.level, fault.field) == (FAULT, f"joints[{tip.joint.name}].damping")
    assert "decays at 10000.4 1/s: must be at most 10000" in fault.text
    assert not found.flies


def with_damping(vehicle, damping):
    links = [
        dataclasses.replace(
            each, joint=dataclasses.replace(each.joint, damping=0.0, coulomb=0.0)
        )
        for each in vehicle.links
    ]
    links[-1] = dataclasses.replace(
        links[-1], joint=dataclasses.replace(links[-1].joint, damping=damping)
    )
    return dataclasses.replace(vehicle, links=tuple(links))


def test_a_rotor_upside_down_that_turns_one_way_is_a_fault():
    found = assess_vehicle(with_rotors([DOWN, {}, {}, BOTH_WAYS]), poses=FEW)
    assert not found.flies
    (fault,) = (
        each
        for each in found.alarms()
        if each.question == "axes of the rotors" and each.level == FAULT
    )
    assert fault.field == f"rotors[{QUAD.rotors[0].name}].axis"
    assert "reversible = true if it turns both ways" in fault.remedy


def test_senses_by_sides_name_each_pair_of_rotors_that_mends_them():
    """Rotors of one side turn against those of the other: yaw follows roll, as in a
    public file of a quadrotor.
    """
    places = [(-0.14, -0.18), (-0.14, 0.18), (0.14, 0.18), (0.14, -0.18)]
    senses = (1, -1, -1, 1)
    changes = [
        {"position": Vec3(x, y, 0), "direction": s}
        for (x, y), s in zip(places, senses, strict=True)
    ]
    vehicle = with_rotors(changes)
    # thrust, roll, pitch, yaw
    arms = np.array([(1, y, -x, -s) for (x, y), s in zip(places, senses, strict=True)])
    assert np.linalg.matrix_rank(arms) == 3
    with pytest.raises(
        AllocationError,
        match=r"must be 4; .* skyarm check names rotors whose other direction would do",
    ):
        make_mixer(vehicle)
    found = answer(assess_vehicle(vehicle, poses=FEW), "senses of rotation")
    assert (found.level, "another sense of two rotors" in found.text) == (FAULT, True)
    # a mirrored vehicle is as likely, so both are told and no table is printed
    choices = found.remedy.partition(": ")[2].split(", or ")
    assert len(choices) > 1
    for choice in choices:
        turned = set(re.findall(r"rotors\[(\w+)\]", choice))
        mended = with_rotors(
            [
                {**change, "direction": -s if each.name in turned else s}
                for change, s, each in zip(changes, senses, QUAD.rotors, strict=True)
            ]
        )
        alarms = assess_vehicle(mended, poses=FEW).alarms()
        assert (len(turned), [each.level for each in alarms]) == (2, [])


def test_the_workspace_of_a_planar_arm_ends_where_it_is_stretched_out():
    # 0.1 m below the base, two links: -0.23 ... 0.23 m to the sides, 0.27 m down
    text = answer(assess_vehicle(PELICAN, poses=2), "workspace").text
    assert "x -0.23 ... 0.23" in text
    assert "z -0.27" in text


@pytest.mark.parametrize(
    ("kind", "limits", "expected"),
    [
        ("prismatic", (1.5, math.inf), (1.5, 2.5)),
        ("prismatic", (-math.inf, -3.0), (-4.0, -3.0)),
        ("prismatic", (-3.0, 2.0), (-3.0, 2.0)),
        ("prismatic", (-math.inf, math.inf), (-1.0, 1.0)),
        ("revolute", (-math.inf, math.inf), (-math.pi, math.pi)),
        ("revolute", (4.0, 5.0), (4.0, 5.0)),
        ("revolute", (-0.5, math.inf), (-0.5, math.pi)),
        ("revolute", (-20.0, 1.0), (1.0 - 2.0 * math.pi, 1.0)),
        ("revolute", (-2.0, 3.5), (-2.0, 3.5)),
    ],
)
def test_poses_lie_within_the_limits_that_are_stated(kind, limits, expected):
    joint = Joint(
        name="j", kind=kind, axis=Vec3(0, 0, 1), lower=limits[0], upper=limits[1]
    )
    assert joint_range(joint) == pytest.approx(expected)


@pytest.mark.parametrize(("limit", "suspected"), [(10.0, False), (90.0, True)])
def test_a_joint_may_turn_by_two_turns_but_hardly_by_ninety_radians(limit, suspected):
    """ANYmal's joints turn by 9.42 rad, others' by 10 rad; 90 are degrees."""
    lines = unlikely_in_vehicle(PELICAN.with_joints(lower=-limit, upper=limit))
    assert [line.partition(" = ")[0][-5:] for line in lines] == [
        "lower",
        "upper",
    ] * suspected


@pytest.mark.parametrize(
    ("line", "field", "remedy"),
    [
        ("mass = 700 kg: is that of a car; kg, not g?", "mass", "kg, not g?"),
        (
            "reference.base reaches 1275 m from the origin: m, not mm?",
            "reference.base",
            "m, not mm?",
        ),
        (
            "reference.tip: asks for a tilt of 1.2 rad; slower?",
            "reference.tip",
            "slower?",
        ),
        (
            (
                "reference.joints[0] reaches 90 rad: is more than a turn; rad, not"
                " degrees?"
            ),
            "reference.joints[0]",
            "rad, not degrees?",
        ),
        (
            "rotors: max_speed = 9e3 rad/s: lifts 90 times; rad/s, not rev/min?",
            "rotors.max_speed",
            "rad/s, not rev/min?",
        ),
    ],
)
def test_a_line_about_units_becomes_field_and_remedy(line, field, remedy):
    found = finding_of_line(line, "units", WARNING)
    assert (found.field, found.remedy) == (field, f"check it: {remedy}")


def test_an_alarm_without_a_number_shows_none(capsys):
    from rich.console import Console

    console = Console(width=300)
    console.print(*sheet(assess_vehicle(with_base(HEXAROTOR12, mass=700.0), poses=FEW)))
    assert "(-," not in (said := capsys.readouterr().out)
    assert "limit -" not in said


def test_a_remedy_names_each_field_once():
    heavy = [
        dataclasses.replace(rotor, position=rotor.position * 0.01)
        for rotor in PELICAN.rotors
    ]
    found = assess_vehicle(dataclasses.replace(PELICAN, rotors=tuple(heavy)), poses=FEW)
    told = [
        each for each in found.findings if "authority" in each.question and each.remedy
    ]
    assert told
    assert all(each.remedy.count("base.inertia") == 1 for each in told)
