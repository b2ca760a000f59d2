"""A gripper closes where a task picks something up and opens where it puts it down;
other joints are refused.
"""

from __future__ import annotations

import copy
import tomllib

import numpy as np
import pytest

import skyarm
from skyarm.scenario.scenario_record import ScenarioError

CLAW = """
schema = 1
name = "claw"
end_effector = "grip"
base = { mass = 1.5, inertia = [0.02, 0.02, 0.035] }
rotor_defaults.thrust_coefficient = 1.7e-5
rotor_defaults.moment_coefficient = 0.016
rotor_defaults.max_speed = 900.0
frames = [{ name = "grip", link = "arm", position = [0.2, 0.0, -0.1] }]
[[links]]
name = "arm"
parent = "base"
mass = 0.1
com = [0.1, 0.0, -0.05]
inertia = [2e-4, 4e-4, 4e-4]
joint.name = "shoulder"
joint.axis = [0.0, 1.0, 0.0]
joint.lower = -1.0
joint.upper = 1.0
joint.effort_limit = 4.0
[[links]]
name = "jaw"
parent = "arm"
mass = 0.02
com = [0.02, 0.0, 0.0]
inertia = [1e-5, 1e-5, 1e-5]
[links.joint]
name = "finger"
kind = "prismatic"
axis = [0.0, 1.0, 0.0]
position = [0.18, 0.0, -0.1]
lower = 0.0
upper = 0.05
effort_limit = 20.0
"""
ROTORS = "".join(
    f'[[rotors]]\nname = "r{i}"\nposition = [{x}, {y}, 0.02]\ndirection = "{turn}"\n'
    for i, (x, y, turn) in enumerate(
        (
            (0.18, 0.18, "ccw"),
            (-0.18, 0.18, "cw"),
            (-0.18, -0.18, "ccw"),
            (0.18, -0.18, "cw"),
        )
    )
)
TASK = """
name = "grip"
duration = 3.2
plant = { vehicle = "claw.toml" }
controller = { law = "hybrid_computed_torque" }
payloads = [{ name = "box", mass = 0.05, frame = "grip" }]
[reference.tip]
posture = [0.2, 0.03]
[reference.tip.path]
kind = "phases"
position = [0.0, 0.0, 0.7]
[[reference.tip.path.phases]]
kind = "hold"
duration = 0.4
joints = { finger = 0.05 }
[[reference.tip.path.phases]]
kind = "pick"
start = 0.9
payload = "box"
position = [0.0, 0.0, 0.7]
approach = [0.0, 0.0, 0.0]
dwell = 0.6
joints = { finger = 0.01 }
[[reference.tip.path.phases]]
kind = "go_to"
position = [0.1, 0.0, 0.7]
[[reference.tip.path.phases]]
kind = "place"
payload = "box"
position = [0.1, 0.0, 0.7]
approach = [0.0, 0.0, 0.0]
dwell = 0.6
joints = { finger = 0.04 }
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("claw")
    (made / "claw.toml").write_text(CLAW + ROTORS)
    return made


def planned(folder, plant="rigid_body", **phase):
    document = tomllib.loads(TASK)
    document["plant"] |= {"vehicle": str(folder / "claw.toml")}
    document["plant"]["kind"] = plant
    document["reference"]["tip"]["path"]["phases"][0] |= phase
    return skyarm.scenario_from(document)


def finger_at(scenario, t):
    return float(scenario.reference.at(t).joints[1])


def test_fingers_move_within_their_phases_and_are_at_rest_between(folder):
    scenario = planned(folder)
    (box,) = scenario.payloads
    # start = 0.9 holds the pick back; it closes in the first half of its dwell of 0.6 s
    assert box.pick == pytest.approx(1.2)
    assert [finger_at(scenario, t) for t in (0.0, 0.4, 0.9)] == pytest.approx(
        [0.03, 0.05, 0.05]
    )
    assert finger_at(scenario, 0.2) == pytest.approx(0.04)  # half-way, by symmetry
    assert finger_at(scenario, 1.05) == pytest.approx(0.03)
    assert [
        finger_at(scenario, t) for t in (box.pick, 1.5, box.drop - 0.3)
    ] == pytest.approx([0.01] * 3)
    assert finger_at(scenario, box.drop) == pytest.approx(0.04)
    for t in (0.4, 0.9, box.pick, box.drop):
        assert float(scenario.reference.at(t).joint_rates[1]) == pytest.approx(
            0.0, abs=1e-12
        )
    still = tomllib.loads(TASK)["reference"]["tip"]["posture"][0]
    assert [float(scenario.reference.at(t).joints[0]) for t in (0.0, 1.0, 3.0)] == [
        still
    ] * 3


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_a_gripper_closes_and_opens_in_flight(folder, plant):
    log = skyarm.run(planned(folder, plant))
    assert log.status == "completed"
    finger = np.asarray(log.joints)[:, 1]
    for t, where in ((0.6, 0.05), (1.3, 0.01), (3.15, 0.04)):
        assert finger[round(t * 200)] == pytest.approx(where, abs=2e-3)


def test_a_guard_holds_the_fingers_of_the_next_phase_back(folder):
    early = planned(folder, until={"error": 1e-12, "hold": 0.1, "timeout": 0.3})
    log = skyarm.run(early)
    finger = log.joints_reference[:, 1]
    assert finger[round((1.2 + 0.3) * 200)] == pytest.approx(0.01)
    assert finger[round((0.9 + 0.3) * 200)] == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("phase", "words"),
    [
        (
            {"joints": {"shoulder": 0.1}},
            "joints.shoulder: must be left out, joint 'shoulder' carries the tip",
        ),
        ({"joints": {"fingr": 0.1}}, "phases[0].joints.fingr: did you mean 'finger'?"),
        (
            {"joints": {"finger": 0.2}},
            "phases[0].joints.finger = 0.2: must be within 0 and 0.05 of 'finger'",
        ),
        ({"joints": {"finger": "open"}}, "phases[0].joints.finger = 'open': must be"),
        ({"joints": {}}, "phases[0].joints = {}: must be a table of joints"),
        ({"joints": 0.02}, "phases[0].joints = 0.02: must be a table of joints"),
        (
            {"duration": 0.01},
            (
                "moves by 0.02 m in 0.01 s; must have 0.0219 s or more (joint_speed = 2"
                " m/s)"
            ),
        ),
        (
            {"duration": 1.0},
            (
                "phases[1].start = 0.9: must be at or after 1 s, the end of the phase"
                " before"
            ),
        ),
        ({"start": -1.0}, "phases[0].start = -1: must be from 0"),
    ],
)
def test_moves_that_cannot_be_get_one_line(folder, phase, words):
    with pytest.raises(ScenarioError) as caught:
        planned(folder, **copy.deepcopy(phase))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_phases_of_the_base_move_joints_that_have_no_motion_of_their_own(folder):
    document = tomllib.loads(TASK)
    document["plant"] |= {"vehicle": str(folder / "claw.toml")}
    path = document["reference"].pop("tip")["path"]
    document["reference"] = {"base": path}
    scenario = skyarm.scenario_from(document)
    assert finger_at(scenario, 0.9) == pytest.approx(0.05)
    signal = {"kind": "sine", "amplitude": 0.01, "frequency_hz": 1.0}
    document["reference"]["joints"] = [{"kind": "constant", "value": 0.0}, signal]
    with pytest.raises(
        ScenarioError, match=r"reference.joints\[1\] moves joint 'finger' already"
    ):
        skyarm.scenario_from(document)
