"""Columns of a log: every number once, by the vehicle's own names, with its unit."""

from __future__ import annotations

import dataclasses
import re

import pytest

import skyarm
from skyarm.dynamics.actuators.drive import Drive, TorqueDrive
from skyarm.dynamics.actuators.servo import PositionServo, VelocityServo
from skyarm.log.log_columns import columns, distinct, layout, names_of, word
from skyarm.records.plain import plain
from skyarm.vehicle.vehicle_records import MountedDrive
from support.logs import drawn

VEHICLES = [skyarm.load_vehicle(name) for name in skyarm.list_vehicles()]


@pytest.mark.parametrize("vehicle", VEHICLES, ids=lambda vehicle: vehicle.name)
def test_every_number_has_one_column_whose_name_is_one_of_ros(vehicle):
    log = drawn(vehicle)
    found = columns(log)
    assert len({each.name for each in found}) == len(found)
    places = [(each.array, each.index) for each in found]
    assert (
        len(set(places))
        == len(places)
        == sum(1 if a.ndim == 1 else a.shape[1] for a in log.arrays().values())
    )
    for each in found:
        # https://design.ros2.org/articles/legacy_interface_definition.html: field names
        assert re.fullmatch(r"[a-z](_?[a-z0-9])*", each.name), each.name
        assert each.of(log).shape == log.time.shape
    assert [name for array in layout(log).values() for name in array["columns"]] == [
        each.name for each in found
    ]


def test_columns_are_called_as_the_vehicle_calls_its_joints_and_rotors():
    log = drawn(skyarm.load_vehicle("hexarotor_arm6"))
    found = {each.name: each for each in columns(log)}
    for name in (
        "joint_shoulder",
        "joint_rate_wrist_roll",
        "joint_effort_elbow",
        "measured_joint_yaw",
        "rotor_speed_3",
    ):
        assert name in found
    assert (
        found["joint_shoulder"].of(log)
        == log.joints[:, names_of(log).joints.index("shoulder")]
    ).all()
    assert (found["quaternion_w"].of(log) == log.quaternion[:, 0]).all()
    assert (found["tip_held_z"].of(log) == log.tip_held[:, 2]).all()
    assert not any(re.search(r"tool|joints_|rotor_speeds", name) for name in found)


def test_units_are_those_of_the_joint():
    vehicle = skyarm.load_vehicle("hexarotor_arm6")
    links = list(vehicle.links)
    links[2] = dataclasses.replace(
        links[2], joint=dataclasses.replace(links[2].joint, kind="prismatic")
    )
    units = {
        each.name: each.unit
        for each in columns(drawn(dataclasses.replace(vehicle, links=tuple(links))))
    }
    name = links[2].joint.name
    assert (units["joint_shoulder"], units[f"joint_{name}"]) == ("rad", "m")
    assert (units["joint_rate_shoulder"], units[f"joint_rate_{name}"]) == (
        "rad/s",
        "m/s",
    )
    assert (units["joint_effort_shoulder"], units[f"joint_effort_{name}"]) == (
        "N m",
        "N",
    )
    assert (units["position_x"], units["quaternion_w"], units["wind_force_y"]) == (
        "m",
        "",
        "N",
    )


def test_a_command_that_is_a_setpoint_is_called_one_in_the_unit_of_its_drive():
    vehicle = skyarm.load_vehicle("hexarotor_arm6")
    links = list(vehicle.links)
    links[2] = dataclasses.replace(
        links[2], joint=dataclasses.replace(links[2].joint, kind="prismatic")
    )
    angle, rate = (
        PositionServo(stiffness=5.0, inertia=0.01),
        VelocityServo(gain=5.0, inertia=0.01),
    )
    drives = zip(
        vehicle.links, (angle, rate, angle, TorqueDrive(), OwnDrive()), strict=False
    )
    mounted = tuple(
        MountedDrive(name=link.joint.name, drive=drive) for link, drive in drives
    )
    log = drawn(dataclasses.replace(vehicle, links=tuple(links), drives=mounted))
    found = [(each.name, each.unit) for each in columns(log) if each.array == "efforts"]
    names = names_of(log).joints
    units = ["rad", "rad/s", "m", "N m", "", "N m"]
    words = [
        f"joint_{'effort' if unit == 'N m' else 'setpoint'}_{name}"
        for name, unit in zip(names, units, strict=True)
    ]
    assert found == list(zip(words, units, strict=True))
    agent = {
        **log.info["scenario_record"]["agent"],
        "drives": [{"joint": names[0], "drive": plain(rate)}],
    }
    own = {"agent": agent}
    again = columns(dataclasses.replace(log, info={**log.info, "scenario_record": own}))
    assert (words[0], "rad/s") in [(each.name, each.unit) for each in again], (
        "the scenario's own drive wins"
    )


@dataclasses.dataclass(frozen=True)
class OwnDrive(Drive):
    """A drive whose class no reader knows."""


def test_a_log_that_keeps_no_names_has_numbers():
    log = drawn(skyarm.load_vehicle("hummingbird_arm2"))
    for record in (
        None,
        {},
        {"world": 3},
        {"world": {"vehicle": {"links": [1, 2], "rotors": [3, 4, 5, 6]}}},
    ):
        bare = dataclasses.replace(log, info={**log.info, "scenario_record": record})
        names = [each.name for each in columns(bare)]
        assert {"joint_0", "joint_1", "rotor_speed_3"} <= set(names)
        assert "rad or m" in {each.unit for each in columns(bare)}


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Wrist-Roll", "wrist_roll"),
        ("joint1", "1"),
        ("joint_1", "1"),
        ("__a  b__", "a_b"),
        ("ü", "unnamed"),
        ("joint", "joint"),
    ],
)
def test_a_name_becomes_a_word(name, words):
    assert word(name, "joint") == words


def test_equal_words_are_numbered_and_meet_no_other_name():
    assert distinct(["a", "b", "a", "a"]) == ["a", "b", "a_2", "a_3"]
    assert distinct(["a", "a", "a_2"]) == ["a", "a_3", "a_2"]
