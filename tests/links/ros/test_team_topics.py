"""Live topics of several vehicles: the log's to the byte under each name, and commands
and goals of one of them.
"""

from __future__ import annotations

import dataclasses
import json
import math
from functools import cache

import numpy as np
import pytest

import skyarm
from skyarm.dynamics.actuators import Command
from skyarm.links.ros import RosLink, live_session
from skyarm.links.ros.live_flight import fly_live
from skyarm.log.ros.message_bytes import decode, encode
from skyarm.log.ros.messages import DEFINITIONS, FLIGHT
from skyarm.log.ros.topics import FlightTopics
from skyarm.scenario.scenario_record import NamedSensor
from skyarm.simulate.session import Session
from support.commands import skyarm as typed
from support.peers import MemoryNode, memory_nodes
from support.teams import TEAMS, team

NUMBERS, POSE, JOINTS = (
    "std_msgs/Float64MultiArray",
    "geometry_msgs/PoseStamped",
    "sensor_msgs/JointState",
)


@cache
def armed() -> skyarm.Scenario:
    """A vehicle without an arm, and one with an arm and a sensor of its own."""
    other = skyarm.load_scenario("case3", duration=1.5)
    tables = {
        **{
            "schema": 1,
            "name": "hover",
            "duration": 1.5,
            "controller": {"preset": "centroidal_joint"},
        },
        "plant": {"vehicle": "dragonfly", "gravity": float(other.agent.plant.gravity)},
        "reference": {"base": {"kind": "hover", "position": [0.0, 1.0, 1.2]}},
    }
    imu = skyarm.load_scenario("hover_swing").agent.sensors[0].sensor
    right = dataclasses.replace(
        other.agent, sensors=(NamedSensor(name="imu", sensor=imu),)
    )
    return dataclasses.replace(
        other, agents={"left": skyarm.scenario_from(tables).agent, "right": right}
    )


def linked(scenario: skyarm.Scenario) -> tuple[RosLink, MemoryNode, list[str]]:
    """A link of a session that takes goals, its node, and what it warns of."""
    node, told = MemoryNode(), list[str]()
    return RosLink(live_session(scenario)[0], node, warn=told.append), node, told


def message(kind: str, values: dict[str, object]) -> bytes:
    return encode(kind, DEFINITIONS, values, 1)[0].tobytes()


@pytest.mark.parametrize(
    "make",
    [
        pytest.param(armed, marks=pytest.mark.thorough, id="armed"),
        pytest.param(lambda: team("cables", duration=0.3), id="cables"),
    ],
)
def test_live_messages_of_a_team_are_those_of_its_log_to_the_byte(make):
    link, node, told = linked(make())
    for _ in range(50):
        link.step()
    log, own = link.session.log, {"/clock"}
    topics = FlightTopics(log)
    for topic in topics.topics:
        if topic.kind != FLIGHT and topic.name not in ("/tf", "/tf_static"):
            expected = [row.tobytes() for row in topics.encode(topic, log)[1]]
            assert node.sent[topic.name] == expected, topic.name
    for name in log.agents:
        own |= {f"/{name}{topic}" for topic in ("/rotor_states", "/skyarm/applied")}
    assert (
        node.kinds.keys()
        == {topic.name for topic in topics.topics if topic.kind != FLIGHT} | own
    )
    assert len([each for each in node.kinds if each.startswith("/right/")]) > 6
    assert not told


def test_frames_of_both_vehicles_are_sent_on_one_topic():
    link, node, _ = linked(armed())
    link.step()
    log = link.session.log
    sent = [
        decode("tf2_msgs/TFMessage", DEFINITIONS, each)["transforms"]
        for each in node.sent["/tf"]
    ]
    moving = {
        each["child_frame_id"]: each for transforms in sent for each in transforms
    }
    for name, own in log.agents.items():
        place = moving[f"{name}/base_link"]["transform"]["translation"]
        assert moving[f"{name}/base_link"]["header"]["frame_id"] == "world"
        assert [place[axis] for axis in "xyz"] == own.position[0].tolist()
    assert len(sent) == 2
    assert {each.split("/")[0] for each in moving} == {"left", "right"}


def test_rotors_and_applied_commands_are_those_of_the_vehicle_in_the_name():
    link, node, _ = linked(armed())
    for _ in range(10):
        link.step()
    for name, own in link.session.log.agents.items():
        turning = [
            decode(JOINTS, DEFINITIONS, each)
            for each in node.sent[f"/{name}/rotor_states"]
        ]
        np.testing.assert_array_equal(
            [each["velocity"] for each in turning], own.rotor_speeds
        )
        assert turning[0]["name"] == [
            rotor.name for rotor in armed().agents[name].plant.vehicle.rotors
        ]
        applied = [
            decode(NUMBERS, DEFINITIONS, each)["data"]
            for each in node.sent[f"/{name}/skyarm/applied"]
        ]
        np.testing.assert_array_equal(
            applied, np.hstack([own.rotor_commands, own.efforts])
        )


def test_a_command_flies_one_vehicle_while_the_other_is_under_its_law():
    link, node, told = linked(armed())
    other, values = Session(armed()), [420.0, 430.0, 440.0, 450.0, 0.01, -0.02]
    command = Command(rotor_speeds=tuple(values[:4]), efforts=tuple(values[4:]))
    for k in range(40):
        if k == 5:
            node.inbox["/right/skyarm/command"] = [
                message(NUMBERS, {"data": np.array(values)})
            ]
            node.inbox["/left/skyarm/command"] = [
                message(NUMBERS, {"data": np.array(values)})
            ]
        link.step()
        other.step({"right": command} if 5 <= k < 25 else None)  # 0.1 s at 200 Hz
    assert link.commanded == 20
    for name, own in link.session.log.agents.items():
        np.testing.assert_array_equal(
            own.rotor_commands, other.log.agents[name].rotor_commands
        )
        np.testing.assert_array_equal(own.position, other.log.agents[name].position)
    (line,) = told
    assert line.startswith(
        "/left/skyarm/command: a message is ignored: 6 numbers: must be 4 rotor speeds,"
        " 0 efforts"
    )


def test_goals_move_the_vehicle_that_they_are_sent_to_and_the_log_repeats_them(
    tmp_path,
):
    link, node, told = linked(armed())
    goal = {
        "header": {"stamp": 0, "frame_id": "world"},
        "pose": {"position": {"x": 0.1, "y": 0.8, "z": 1.1}},
    }
    names = [each.joint.name for each in armed().agents["right"].plant.vehicle.links]
    assert {*node.heard} == {
        *("/left/skyarm/command", "/left/skyarm/goal"),
        *("/right/skyarm/command", "/right/skyarm/goal", "/right/skyarm/joint_goal"),
    }
    while link.session.running:
        if link.session.tick == 10:
            node.inbox["/left/skyarm/goal"] = [message(POSE, goal)]
            joints = {"name": names[1:2], "position": np.array([0.2])}
            node.inbox["/right/skyarm/joint_goal"] = [message(JOINTS, joints)]
        link.take_goals()
        link.session.step()
    log = link.session.log
    assert link.goals == 2
    assert not told
    assert log.agents["left"].position_reference[-1] == pytest.approx(
        (0.1, 0.8, 1.1), abs=1e-12
    )
    assert log.agents["right"].joints_reference[-1, 1] == pytest.approx(0.2, abs=1e-12)
    own = armed().agents["right"].reference.at(log.time[-1])
    assert log.agents["right"].position_reference[-1] == pytest.approx(
        [float(c) for c in own.position], abs=1e-12
    )
    assert log.agents["right"].joints_reference[-1, 0] == pytest.approx(
        float(own.joints[0]), abs=1e-12
    )
    again = skyarm.run(
        skyarm.load_log(skyarm.save_log(log, tmp_path / "flight.npz")).scenario
    )
    for name, own in log.agents.items():
        np.testing.assert_array_equal(again.agents[name].position, own.position)


def test_a_vehicle_that_takes_no_goals_is_named_by_its_topic():
    told: list[str] = []
    change = skyarm.Change(at=0.1, path="agents.right.reference.z.value", value=1.01)
    scenario = dataclasses.replace(team("bar", duration=0.2), changes=(change,))
    node = MemoryNode()
    live = fly_live(scenario, node, pace=math.inf, warn=told.append)
    assert told == [
        "no goals are taken on /right/skyarm/goal, since of the reference it changes in"
        " flight"
    ]
    assert {*node.heard} == {
        "/left/skyarm/command",
        "/left/skyarm/goal",
        "/right/skyarm/command",
    }
    assert live_session(scenario)[1] == "right: it changes in flight"
    plain = skyarm.run(scenario)
    for name, own in live.log.agents.items():
        np.testing.assert_array_equal(own.position, plain.agents[name].position)


@pytest.mark.thorough
def test_the_command_flies_a_team_with_topics(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    nodes = memory_nodes(monkeypatch)
    words = (
        "run",
        str(TEAMS / "bar.toml"),
        "--duration",
        "0.2",
        "--ros",
        "2",
        "--pace",
        "0",
        "--json",
    )
    done = typed(*words, "--log", str(tmp_path / "flight.npz"))
    assert (done.code, done.err) == (0, "")
    assert json.loads(done.out)["ros"] == {
        "version": 2,
        "commanded": 0,
        "goals": 0,
        "late_s": 0.0,
    }
    assert {nodes[0].kinds[f"/{name}/odom"] for name in ("left", "right")} == {
        "nav_msgs/Odometry"
    }
    flown = skyarm.load_log(tmp_path / "flight.npz")
    plain = skyarm.run(team("bar", duration=0.2))
    np.testing.assert_array_equal(
        flown.agents["right"].position, plain.agents["right"].position
    )
