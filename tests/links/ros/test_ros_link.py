"""A session with live topics: what is sent is what a log of it holds; commands, goals,
and what is refused.
"""

from __future__ import annotations

import dataclasses
import struct
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.dynamics.actuators import Command
from skyarm.links.ros import RosLink, live_session
from skyarm.links.ros.goals import (
    FARTHEST,
    base_goal,
    changes_to,
    check_reach,
    joint_goal,
)
from skyarm.links.ros.ros_link import (
    APPLIED,
    COMMAND,
    GOAL,
    JOINT_GOAL,
    ROTORS,
    command_of,
)
from skyarm.log.ros.message_bytes import MessageError, decode, encode
from skyarm.log.ros.messages import DEFINITIONS, FLIGHT
from skyarm.log.ros.topics import CLOCK, FlightTopics
from skyarm.simulate.session import Session
from support.flights import estimated
from support.peers import MemoryNode

POSE, JOINTS, NUMBERS = (
    "geometry_msgs/PoseStamped",
    "sensor_msgs/JointState",
    "std_msgs/Float64MultiArray",
)


@cache
def scenario(name: str = "case3", duration: float = 0.6):
    return (
        estimated(duration=duration)
        if name == "estimated"
        else skyarm.load_scenario(name, duration=duration)
    )


def linked(name: str = "case3", duration: float = 0.6):
    node, told = MemoryNode(), list[str]()
    return (
        RosLink(live_session(scenario(name, duration))[0], node, warn=told.append),
        node,
        told,
    )


def flown(link: RosLink, periods: int) -> None:
    for _ in range(periods):
        link.step()


def without_topics(link: RosLink, periods: int = 1_000_000) -> None:
    """Fly under goals and publish nothing, which takes most of the time of a period."""
    for _ in range(periods):
        link.take_goals()
        if not link.session.step():
            break


def pose(position, yaw: float = 0.0, frame: str = "world") -> bytes:
    values = {
        "header": {"stamp": 0, "frame_id": frame},
        "pose": {
            "position": dict(zip("xyz", position, strict=True)),
            "orientation": {"w": np.cos(0.5 * yaw), "z": np.sin(0.5 * yaw)},
        },
    }
    return encode(POSE, DEFINITIONS, values, 1)[0].tobytes()


def joints(names, positions) -> bytes:
    values = {"name": names, "position": np.array(positions)}
    return encode(JOINTS, DEFINITIONS, values, 1)[0].tobytes()


def numbers(values) -> bytes:
    return encode(NUMBERS, DEFINITIONS, {"data": np.array(values)}, 1)[0].tobytes()


@pytest.mark.parametrize("name", ["case3_wind", "estimated", "press_and_hold"])
def test_live_messages_are_those_of_the_log_to_the_byte(name):
    link, node, told = linked(name, 0.3)
    while link.step():
        pass
    log = link.session.log
    topics = FlightTopics(log)
    compared = 0
    for topic in topics.topics:
        if topic.kind == FLIGHT:
            assert topic.name not in node.sent
            continue
        assert node.kinds[topic.name] == topic.kind
        assert (topic.name in node.latched) == (topic.every == 0)
        expected = [row.tobytes() for row in topics.encode(topic, log)[1]]
        assert node.sent[topic.name] == expected, topic.name
        compared += len(expected)
    assert compared > log.time.size
    assert not told


def test_clock_rotors_and_applied_commands_are_the_logs():
    link, node, _ = linked()
    flown(link, 40)
    log = link.session.log
    clocks = [
        decode("rosgraph_msgs/Clock", DEFINITIONS, each)["clock"]
        for each in node.sent[CLOCK]
    ]
    assert [each["sec"] + 1e-9 * each["nanosec"] for each in clocks] == pytest.approx(
        log.time, abs=1e-9
    )
    turning = [decode(JOINTS, DEFINITIONS, each) for each in node.sent[ROTORS]]
    assert np.array_equal([each["velocity"] for each in turning], log.rotor_speeds)
    assert turning[0]["name"] == [
        rotor.name for rotor in link.session.scenario.plant.vehicle.rotors
    ]
    applied = [
        decode(NUMBERS, DEFINITIONS, each)["data"] for each in node.sent[APPLIED]
    ]
    assert np.array_equal(applied, np.hstack([log.rotor_commands, log.efforts]))


def test_a_received_command_flies_in_the_laws_place_until_it_is_too_old():
    link, node, _ = linked()
    other = Session(scenario())
    values = [420.0, 430.0, 440.0, 450.0, 0.01, -0.02]
    flown(link, 5)
    node.inbox[COMMAND] = [numbers([1.0] * 6), numbers(values)]  # the newest counts
    flown(link, 35)
    command = Command(rotor_speeds=tuple(values[:4]), efforts=tuple(values[4:]))
    for k in range(40):  # 0.1 s at 200 Hz
        other.step(command if 5 <= k < 25 else None)
    assert link.commanded == 20
    for name in ("position", "rotor_commands", "efforts"):
        assert np.array_equal(link.session.log[name], other.log[name])


def test_commands_that_keep_coming_keep_the_law_away():
    link, node, _ = linked()
    for _ in range(50):
        node.inbox[COMMAND] = [numbers([430.0] * 4 + [0.0] * 2)]
        link.step()
    assert link.commanded == 50
    assert (link.session.log.rotor_commands == 430.0).all()


REFUSED = {
    "too few": [400.0] * 5,
    "nan": [400.0, np.nan, 400.0, 400.0, 0.0, 0.0],
    "infinite": [400.0, 400.0, 400.0, 400.0, 0.0, np.inf],
    "negative": [-1.0, 400.0, 400.0, 400.0, 0.0, 0.0],
    "too fast": [400.0, 400.0, 400.0, 838.1, 0.0, 0.0],
    "none": [],
}


@pytest.mark.parametrize("values", REFUSED.values(), ids=REFUSED)
def test_a_command_that_cannot_be_is_refused_in_one_line_and_the_law_flies(values):
    link, node, told = linked()
    plain = Session(scenario())
    for _ in range(10):
        node.inbox[COMMAND] = [numbers(values), b"garbage", b""]
        link.step()
        plain.step()
    assert link.commanded == 0
    assert np.array_equal(link.session.log.position, plain.log.position)
    assert len(told) == 1
    assert told[0].startswith(f"{COMMAND}: a message is ignored")
    assert "\n" not in told[0]


def test_a_command_of_tilting_rotors_may_leave_their_angles_out():
    vehicle = skyarm.load_vehicle("voliro_like")
    turning, angles = [1.0 + k for k in range(6)], [0.1 * k for k in range(6)]
    speeds, arm = tuple(turning), tuple(0.5 for _ in range(vehicle.n))
    assert command_of([*turning, *arm], vehicle) == Command(
        rotor_speeds=speeds, efforts=arm
    )
    found = command_of([*turning, *arm, *angles], vehicle)
    assert found == Command(rotor_speeds=speeds, efforts=arm, tilts=tuple(angles))
    with pytest.raises(MessageError, match="6 tilts"):
        command_of([*turning, *arm, 0.1], vehicle)


def test_a_goal_moves_the_base_there_and_the_joints_go_on():
    link, node, _ = linked(duration=8.0)
    flown(link, 20)
    node.inbox[GOAL] = [pose((0.5, -0.4, 1.3), yaw=0.6)]
    without_topics(link)
    log = link.session.log
    assert link.goals == 1
    assert log.position_reference[-1] == pytest.approx((0.5, -0.4, 1.3), abs=1e-12)
    assert log.yaw_reference[-1] == pytest.approx(0.6, abs=1e-12)
    assert np.abs(np.diff(log.position_reference, axis=0)).max() * 200.0 < 1.01  # m/s
    plain = skyarm.run(scenario(duration=8.0))
    assert np.array_equal(log.joints_reference, plain.joints_reference)
    assert np.abs(log.position[-1] - (0.5, -0.4, 1.3)).max() < 0.1


@pytest.mark.parametrize("seed", range(20))
def test_the_heading_of_a_goal_is_that_of_its_rotation(seed):
    """Of any length: scipy's first angle of ZYX."""
    x, y, z, w = np.random.default_rng(seed).normal(size=4)
    expected = Rotation.from_quat([x, y, z, w]).as_euler("ZYX")[0]
    position, orientation = (
        {"x": 1.0, "y": 2.0, "z": 3.0},
        {
            "x": x,
            "y": y,
            "z": z,
            "w": w,
        },
    )
    goal = base_goal(
        {
            "header": {"frame_id": "/world"},
            "pose": {"position": position, "orientation": orientation},
        }
    )
    assert goal == {**position, "yaw": pytest.approx(expected, abs=1e-12)}


def test_a_goal_without_a_rotation_has_no_heading_and_the_shorter_way_is_turned():
    link, node, _ = linked(duration=13.0)
    node.inbox[GOAL] = [pose((0.0, 0.0, 1.0), yaw=3.0)]
    without_topics(link, 1250)
    node.inbox[GOAL] = [pose((0.0, 0.0, 1.0), yaw=-3.0)]
    without_topics(link)
    assert link.session.log.yaw_reference[1249] == pytest.approx(3.0, abs=1e-12)
    assert link.session.log.yaw_reference.max() > 3.0
    assert link.session.log.yaw_reference.min() > -1e-9
    empty = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 0.0}
    message = {
        "header": {"frame_id": ""},
        "pose": {"position": {"x": 1.0, "y": 0.0, "z": 2.0}, "orientation": empty},
    }
    assert base_goal(message) == {"x": 1.0, "y": 0.0, "z": 2.0}


def test_a_goal_during_a_motion_begins_where_the_reference_is():
    link, node, _ = linked(duration=8.0)
    for k, goal in enumerate([(1.0, 0.0, 1.5), (0.0, 1.0, 1.5), (-0.3, 0.2, 0.8)]):
        node.inbox[GOAL] = [pose(goal)]
        without_topics(link, 130 + k)
    without_topics(link)
    log = link.session.log
    assert link.goals == 3
    assert log.position_reference[-1] == pytest.approx((-0.3, 0.2, 0.8), abs=1e-12)
    acceleration = np.diff(log.position_reference, n=2, axis=0) * 200.0**2
    # a jerk of 20 m/s^3; a jump of the velocity would be some hundred m/s^2, of the
    # acceleration about 1
    assert np.abs(np.diff(acceleration[1:], axis=0)).max() < 20.0 / 200.0


def test_joint_goals_move_the_joints_that_they_name():
    link, node, told = linked(duration=3.0)
    names = [each.joint.name for each in link.session.scenario.plant.vehicle.links]
    node.inbox[JOINT_GOAL] = [joints([names[1]], [0.3])]
    without_topics(link)
    log = link.session.log
    assert log.joints_reference[-1] == pytest.approx(
        (log.joints_reference[0, 0], 0.3), abs=1e-12
    )
    assert not told


@pytest.mark.parametrize(
    ("topic", "make"),
    [
        (GOAL, lambda: pose((0.0, np.nan, 1.0))),
        (GOAL, lambda: pose((0.0, 0.0, 1.0), frame="map")),
        (GOAL, lambda: pose((1e308, 0.0, 1.0))),
        (GOAL, lambda: pose((0.0, -5000.0, 1.0))),
        (GOAL, lambda: struct.pack("<I", 7)),
        (JOINT_GOAL, lambda: joints(["elbow"], [0.1])),
        (JOINT_GOAL, lambda: joints([], [0.1])),
        (JOINT_GOAL, lambda: joints(["joint1"], [np.nan])),
        (JOINT_GOAL, lambda: joints(["joint1"], [np.inf])),
    ],
)
def test_a_goal_that_cannot_be_is_refused_in_one_line(topic, make):
    link, node, told = linked()
    node.inbox[topic] = [make()]
    flown(link, 3)
    node.inbox[topic] = [make()]
    flown(link, 3)
    assert link.goals == 0
    assert len(told) == 1
    assert told[0].startswith(f"{topic}: ")
    assert not link.session.plan.changes


def test_the_farthest_goal_is_reached_within_the_limits():
    link, _, _ = linked()
    reference = link.session.scenario.reference
    x = float(reference.x.derivatives(0.0)[0])
    changes = changes_to(reference, 0.0, {"x": x + FARTHEST})
    u = np.linspace(0.0, 1.0, 1001)
    speed = 30.0 * u**2 * (1.0 - u) ** 2 * FARTHEST / changes["reference.x.duration"]
    assert speed.max() == pytest.approx(1.0, rel=1e-6)
    check_reach(reference, 0.0, {"x": x + FARTHEST, "yaw": 1e3})
    for goals in ({"x": x + FARTHEST + 0.1}, {"joints.0": -1e308}):
        with pytest.raises(
            MessageError,
            match=r"(x|joints\.0) = .*: must be within 160 of the reference, ",
        ):
            check_reach(reference, 0.0, goals)


@pytest.mark.parametrize("size", [1e308, 1e-320])
def test_the_heading_of_a_rotation_of_any_length_is_finite(size):
    position, rotation = (
        {"x": 0.0, "y": 0.0, "z": 1.0},
        {
            "x": 0.0,
            "y": 0.0,
            "z": size,
            "w": size,
        },
    )
    goal = base_goal(
        {
            "header": {"frame_id": ""},
            "pose": {"position": position, "orientation": rotation},
        }
    )
    assert goal["yaw"] == pytest.approx(0.5 * np.pi)


def test_a_joint_goal_is_within_the_limits_of_its_joint():
    vehicle = skyarm.load_vehicle("hexarotor_arm6")
    joint = vehicle.links[2].joint
    goals = joint_goal(
        {"name": [joint.name], "position": [float(joint.upper)]}, vehicle
    )
    assert goals == {"joints.2": float(joint.upper)}
    for value in (float(joint.upper) + 0.01, float(joint.lower) - 0.01):
        with pytest.raises(
            MessageError, match=f"{joint.name} = .*must be a finite number from"
        ):
            joint_goal({"name": [joint.name], "position": [value]}, vehicle)


def test_a_flight_with_goals_is_flown_again_to_the_bit(tmp_path):
    link, node, _ = linked(duration=2.0)
    for goal in [(0.4, 0.0, 1.2), (0.0, 0.3, 1.0)]:
        flown(link, 60)
        node.inbox[GOAL] = [pose(goal)]
    without_topics(link)
    log = link.session.log
    again = skyarm.run(
        skyarm.load_log(skyarm.save_log(log, tmp_path / "flight.npz")).scenario
    )
    assert link.goals == 2
    assert np.array_equal(again.position, log.position)
    assert np.array_equal(again.rotor_commands, log.rotor_commands)


def test_many_goals_are_taken_five_times_a_second():
    link, node, _ = linked(duration=1.0)
    for k in range(190):
        node.inbox[GOAL] = [pose((0.001 * k, 0.0, 1.0))]
        link.step()
    assert link.goals == 5


def test_a_session_without_goals_flies_as_it_is():
    node = MemoryNode()
    link = RosLink(Session(scenario()), node)
    flown(link, 20)
    assert node.heard == [COMMAND]
    plain = Session(scenario())
    for _ in range(20):
        plain.step()
    assert np.array_equal(link.session.log.position, plain.log.position)


def test_a_reference_that_is_planned_says_why_it_takes_no_goals():
    changed = dataclasses.replace(
        scenario(),
        changes=(skyarm.Change(at=0.1, path="reference.z.value", value=1.1),),
    )
    session, reason = live_session(changed)
    assert reason == "it changes in flight"
    assert session.scenario.reference == changed.reference


def test_a_link_that_cannot_be_made_closes_its_node():
    class Refusing(MemoryNode):
        def subscribe(self, topic, kind):
            raise ValueError("no")

    node = Refusing()
    with pytest.raises(ValueError, match="no"):
        RosLink(Session(scenario()), node)
    assert node.closed
    with pytest.raises(ValueError, match="timeout"):
        RosLink(Session(scenario()), MemoryNode(), timeout=0.0)


def test_a_link_to_a_running_session_sends_what_is_sent_once():
    session = Session(scenario())
    for _ in range(7):
        session.step()
    node = MemoryNode()
    with RosLink(session, node) as link:
        flown(link, 5)
    assert (
        {topic for topic in node.latched if len(node.sent[topic]) == 1}
        == node.latched
        != set()
    )
    assert node.closed
