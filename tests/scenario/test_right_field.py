"""What is wrong in a file is said of the field in which it stands, by the words that
its writer used.
"""

from __future__ import annotations

import copy
import dataclasses
import tomllib
from pathlib import Path

import pytest

import skyarm
from skyarm.records.files import Fields
from skyarm.reference.phases import phases_table
from skyarm.reference.task_records import Setting, TaskEvent
from skyarm.scenario.payload_tables import with_instants
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.vehicle_files import load_vehicle

ARM = tomllib.loads(
    (Path(__file__).resolve().parents[1] / "data" / "servo_arm.toml").read_text("utf-8")
)

TIP = {
    "name": "task",
    "duration": 4.0,
    "plant": {"vehicle": "hummingbird_arm2_rotors"},
    "controller": {"preset": "paper_ct"},
    "reference": {
        "tip": {
            "posture": [0.4, -0.8],
            "path": {"kind": "hover", "position": [0.0, 0.0, 0.7]},
        }
    },
}


def refused(document, **changed):
    with pytest.raises(ScenarioError) as caught:
        skyarm.scenario_from(copy.deepcopy(document) | changed)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("duration", [0.0, -1.0])
def test_a_flight_of_no_duration_is_named_before_its_reference(duration):
    assert refused(TIP, duration=duration).startswith(
        f"duration = {duration!r}: must be above 0"
    )


def test_an_empty_name_of_a_vehicle_is_shown_empty():
    assert refused(TIP, plant={"vehicle": ""}).startswith(
        "plant.vehicle = '': must be a name of the library or a path"
    )


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        (
            {"latency": 1e9},
            "latency = 1000000000.0: must be at most 1000 control periods, 5 s",
        ),
        ({"latency": 5.1}, "latency = 5.1: must be at most 1000 control periods, 5 s"),
        ({"stiffness": 1e11}, "stiffness = 1e+11, "),
        ({"inertia": 1e-12}, "inertia = 1e-12 move the joint within"),
    ],
)
def test_a_servo_that_no_step_affords_is_named_by_its_own_numbers(changed, words):
    drive = {
        "kind": "position_servo",
        "stiffness": 6.9,
        "damping": 0.2,
        "inertia": 2e-3,
    } | changed
    plant = TIP["plant"] | {"drives": {"joint1": drive}}
    found = refused(TIP, plant=plant)
    assert found.startswith("plant.drives.joint1")
    assert words in found
    assert "largest_step" not in found


def test_a_servo_on_a_joint_without_torque_is_told_the_joint():
    drive = {
        "kind": "position_servo",
        "stiffness": 6.9,
        "damping": 0.2,
        "inertia": 2e-3,
    }
    scenario = skyarm.scenario_from(
        TIP | {"plant": TIP["plant"] | {"drives": {"joint1": drive}}}
    )
    with pytest.raises(
        ScenarioError,
        match=r"effort_limit = 0.*: it leaves plant\.drives\.joint1 no torque$",
    ):
        skyarm.with_numbers(scenario, {"plant.vehicle.links.0.joint.effort_limit": 0.0})


@pytest.mark.parametrize("name", ["resistance", "torque_constant"])
def test_a_motor_without_a_number_that_its_voltage_needs_is_refused(name):
    motor = {
        "gear": 257.4,
        "torque_constant": 7.3e-3,
        "resistance": 8.57,
        "voltage": 12.0,
    }
    drive = {"kind": "position_servo", "stiffness": 6.9, "inertia": 2e-3} | motor
    del drive[name]
    found = refused(TIP, plant=TIP["plant"] | {"drives": {"joint1": drive}})
    assert (
        found
        == f"plant.drives.joint1.{name}: must be stated beside voltage, which bounds"
        " the torque by it"
    )


def test_a_vehicle_file_says_the_same_of_its_drives(tmp_path):
    document = copy.deepcopy(ARM)
    joint, drive = next((k, v) for k, v in document["drives"].items() if "voltage" in v)
    text = (Path(__file__).resolve().parents[1] / "data" / "servo_arm.toml").read_text(
        "utf-8"
    )
    lines = [line for line in text.splitlines() if not line.startswith("resistance")]
    (tmp_path / "arm.toml").write_text("\n".join(lines))
    with pytest.raises(
        VehicleError,
        match=rf"drives\.{joint}\.resistance: must be stated beside voltage",
    ):
        load_vehicle(tmp_path / "arm.toml")
    assert drive["resistance"] > 0.0


def test_a_task_without_rotors_names_the_vehicle():
    path = {
        "kind": "phases",
        "position": [0.0, 0.0, 1.0],
        "phases": [{"kind": "hold", "duration": 1.0}],
    }
    bare = dataclasses.replace(skyarm.load_vehicle("hummingbird_arm2"), rotors=())
    setting = Setting(vehicle=bare, thrust_to_weight=0.0)
    with pytest.raises(
        ValueError,
        match="path: needs a vehicle with rotors; 'hummingbird_arm2' has none",
    ):
        phases_table(Fields(path, "path"), setting)


def event(kind, i, payload="box"):
    return TaskEvent(kind=kind, payload=payload, time=float(i), where=f"phases[{i}]")


@pytest.mark.parametrize(
    ("events", "words"),
    [
        (
            (event("pick", 2), event("pick", 3)),
            "must be the name of another payload: phases[2] picks it",
        ),
        (
            (event("place", 2), event("place", 3)),
            "must be the name of another payload: phases[2] places it",
        ),
        (
            (event("place", 2), event("pick", 3)),
            "must be picked before phases[2] places it",
        ),
    ],
)
def test_phases_that_take_a_payload_twice_are_named(events, words):
    with pytest.raises(ValueError, match="payload = 'box'") as caught:
        with_instants([{"name": "box", "mass": 0.1}], events, 200.0)
    assert str(caught.value).startswith("phases[3].payload = 'box': must be")
    assert words in str(caught.value)


def test_two_payloads_of_one_name_are_named():
    with pytest.raises(
        ValueError,
        match=r"payloads\[1\].name = 'box': must differ from that of payloads\[0\]",
    ):
        with_instants(
            [{"name": "box"}, {"name": "box", "pick": 1.0}], [event("pick", 2)], 200.0
        )


URDF = """<robot name="r">
<link name="base"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="a"><inertial><mass value="0.1"/>
<inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="b"/>
<joint name="left" type="revolute"><parent link="base"/><child link="a"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="2" velocity="1"/></joint>
<joint name="right" type="revolute"><parent link="base"/><child link="b"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="2" velocity="1"/>
<mimic joint="left"/></joint></robot>"""


def of_urdf(tmp_path, more):
    (tmp_path / "r.urdf").write_text(URDF)
    (tmp_path / "r.toml").write_text(
        f'schema = 1\nname = "r"\nurdf = "r.urdf"\nmimic = "couple"\n{more}'
    )
    return load_vehicle(tmp_path / "r.toml")


def test_numbers_of_a_joint_that_follows_are_refused(tmp_path):
    with pytest.raises(
        VehicleError,
        match=r"joints.name = 'right': must be left out: it follows 'left'",
    ):
        of_urdf(tmp_path, '[[joints]]\nname = "right"\ndamping = 1.0\n')


def test_a_stop_whose_stiffness_is_left_out_is_chosen(tmp_path):
    chosen, stiff, damped, none = (
        of_urdf(tmp_path, f'[[joints]]\nname = "left"\n{more}\n').links[0].joint
        for more in (
            "damping = 0.0",
            "stop_stiffness = 300.0",
            "stop_damping = 0.7",
            "stop_stiffness = 0.0",
        )
    )
    assert (float(stiff.stop_stiffness), float(stiff.stop_damping)) == (300.0, 0.0)
    # 2 zeta / (sqrt(k / m) depth), zeta one half, at the depth to which the effort of 2
    # N m presses; m = 1e-3 beside 1
    stiffness = float(chosen.stop_stiffness)
    frequency = (stiffness / 1e-3 * (1.0 + 1e-3)) ** 0.5
    assert float(chosen.stop_damping) == pytest.approx(
        1.0 / (frequency * (2.0 / stiffness)), rel=1e-3
    )
    assert (float(damped.stop_stiffness), float(damped.stop_damping)) == (
        float(chosen.stop_stiffness),
        0.7,
    )
    assert float(none.stop_stiffness) == float(none.stop_damping) == 0.0


@pytest.mark.parametrize(
    ("wrong", "meant"), [("pusch", "push"), ("tips", "tip"), ("joint", "joints")]
)
def test_a_misspelt_part_of_the_reference_is_told_what_is_meant(wrong, meant):
    table = {"base": {"kind": "hover", "position": [0.0, 0.0, 1.0]}, wrong: {}}
    said = refused(TIP, reference=table)
    assert (
        f"reference.{wrong} = {{}}: unknown field; did you mean '{meant}'? allowed:"
        " base, yaw, joints, push" in said
    )
