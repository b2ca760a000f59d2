"""Logs of several vehicles: messages of ROS, comparison of two, and periods of
contact.
"""

from __future__ import annotations

import dataclasses
import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from messages_by_rosbags import by_rosbags, composed

import skyarm
from skyarm.log.contents import log_info
from skyarm.log.flight_log import rows_of
from skyarm.log.flight_summary import facts, summary
from skyarm.log.formats import load_log
from skyarm.log.ros.topics import FlightTopics
from skyarm.scenario.scenario_differences import changed_field_lines
from skyarm.scenario.scenario_record import NamedSensor
from support.commands import skyarm as typed
from support.components import Fix
from support.teams import TEAMS, nothing, team, with_law


@pytest.fixture(scope="module")
def armed() -> Any:
    """Log of two vehicles with arms, one with sensors of its own."""
    one, other = (
        skyarm.load_scenario(name, duration=0.2) for name in ("case1", "case3")
    )
    imu = skyarm.load_scenario("hover_swing").agent.sensors[0].sensor
    sensors = (
        NamedSensor(name="imu", sensor=imu),
        NamedSensor(name="fix", sensor=Fix(rate=40.0, delay=0.0, sigma=0.01)),
    )
    right = dataclasses.replace(other.agent, sensors=sensors)
    return skyarm.run(
        dataclasses.replace(one, agents={"left": one.agent, "right": right})
    )


@pytest.fixture(scope="module")
def bar() -> Any:
    return skyarm.run(team("bar", duration=0.2))


def test_a_members_log_shows_no_pictures_without_the_others(armed):
    with pytest.raises(ValueError, match=r"right, too, .* frames\('left.SENSOR'\)"):
        armed.agents["left"].frames("eye")


def test_what_a_world_has_of_all_vehicles_is_said_once_above_them(bar):
    values = facts(bar)
    taken = {
        "gripper": "claw",
        "held": "ball",
        "start": 3.0,
        "end": None,
        "gave_way": False,
        "peak": 1.3,
    }
    touches = [
        {"surface": "wall", "point": name, "first_touch": 1.0, "losses": 0, "peak": 2.0}
        for name in bar.agents
    ]
    for own, touch in zip(values["agents"].values(), touches, strict=True):
        own |= {"grasps": [taken], "contacts": [touch]}
    lines = [str(each) for each in summary(bar, values)]
    said = [
        k for k, line in enumerate(lines) if line.startswith("claw took ball at 3 s")
    ]
    below = [k for k, line in enumerate(lines) if line.startswith("wall touched")]
    assert said == [1]
    assert len(below) == len(bar.agents) == 2
    assert [lines[k].split()[2] for k in below] == list(bar.agents)


def topics_of(log: Any, folder: Path) -> dict[str, Any]:
    """Topics of a log's MCAP file as rosbags reads them, with types, times and
    messages.
    """
    return by_rosbags(skyarm.save_log(log, folder / "team.mcap"))[0]


@pytest.mark.parametrize("which", ["bar", "armed"])
def test_a_log_of_a_team_is_read_back_from_its_messages_file(which, request, tmp_path):
    log = request.getfixturevalue(which)
    again = load_log(skyarm.save_log(log, tmp_path / "team.mcap"))
    assert json.loads(json.dumps(log_info(again))) == json.loads(
        json.dumps(log_info(log))
    )
    assert again.arrays().keys() == log.arrays().keys()
    for name, array in log.arrays().items():
        np.testing.assert_array_equal(again[name], array)


@pytest.mark.parametrize("which", ["bar", "armed"])
def test_each_vehicle_has_the_topics_of_its_own_log_under_its_name(
    which, request, tmp_path
):
    log = request.getfixturevalue(which)
    found = topics_of(log, tmp_path)
    shared = {"/skyarm/flight", "/clock", "/tf", "/tf_static", "/sensors/components"}
    own = {
        f"/{name}{topic}"
        for name, each in log.agents.items()
        for topic in topics_of(each, tmp_path).keys() - shared
    }
    assert found.keys() - shared == own
    for name, each in log.agents.items():
        _, times, messages = found[f"/{name}/odom"]
        assert [t / 1e9 for t in times] == pytest.approx(each.time, abs=1e-9)
        places = [
            [getattr(message.pose.pose.position, axis) for axis in "xyz"]
            for message in messages
        ]
        np.testing.assert_array_equal(places, each.position)
        assert {(m.header.frame_id, m.child_frame_id) for m in messages} == {
            ("world", f"{name}/base_link")
        }
        np.testing.assert_array_equal(
            [
                getattr(message, f"{name}_position_x")
                for message in found["/skyarm/flight"][2]
            ],
            each.position[:, 0],
        )


def test_readings_and_joints_are_those_of_the_vehicle_that_has_them(armed, tmp_path):
    found = topics_of(armed, tmp_path)
    assert "/left/sensors/imu" not in found
    _, times, messages = found["/right/sensors/imu"]
    assert {message.header.frame_id for message in messages} == {"right/base_link"}
    gyro = armed.agents["right"].readings["imu"]["rate"]
    np.testing.assert_array_equal(
        [message.angular_velocity.x for message in messages[1:]],
        gyro[1 : len(times), 0],
    )
    joints = [message.position for message in found["/right/joint_states"][2]]
    np.testing.assert_array_equal(joints, armed.agents["right"].joints)


def test_messages_of_all_vehicles_are_due_again_after_the_least_common_multiple(armed):
    # 5 instants of the sensor at 40 Hz, 4 of the frames at 50 Hz
    assert FlightTopics(armed).period == 20


def test_each_topic_has_one_channel(armed, tmp_path):
    reader = pytest.importorskip("mcap.reader")
    with skyarm.save_log(armed, tmp_path / "team.mcap").open("rb") as stream:
        channels = [
            each.topic
            for each in reader.make_reader(stream).get_summary().channels.values()
        ]
    assert len(channels) == len({*channels})


def test_frames_of_all_vehicles_are_one_tree(armed, tmp_path):
    found = topics_of(armed, tmp_path)
    fixed = [each for message in found["/tf_static"][2] for each in message.transforms]
    moving = [each for message in found["/tf"][2][-2:] for each in message.transforms]
    tree = {each.child_frame_id: each for each in (*fixed, *moving)}
    assert len(tree) == len(fixed) + len(moving)
    at = found["/tf"][1][-1] / 1e9
    for name, log in armed.agents.items():
        k = int(np.abs(log.time - at).argmin())
        _, base = composed(tree, f"{name}/base_link")
        np.testing.assert_array_equal(base, log.position[k])
        tip = f"{name}/{skyarm.load_scenario('case1').plant.vehicle.end_effector}"
        assert np.abs(composed(tree, tip)[1] - log.tip[k]).max() < 1e-12
        markers = found[f"/{name}/vehicle"][2][0].markers
        assert {marker.header.frame_id for marker in markers} <= tree.keys()
        assert all(marker.header.frame_id.startswith(f"{name}/") for marker in markers)


def test_what_all_share_is_written_once(bar, tmp_path):
    found = topics_of(bar, tmp_path)
    assert [topic for topic in found if "components" in topic] == [
        "/sensors/components"
    ]
    messages = found["/sensors/components"][2]
    column = messages[0].name.index("object_position_bar/z")
    np.testing.assert_array_equal(
        [message.value[column] for message in messages], bar.object_position[:, 2]
    )


def test_some_instants_of_a_team_are_a_log_of_it(bar):
    some = rows_of(bar, slice(3, 9))
    assert (some.time.size, [*some.agents], some.info) == (
        6,
        ["left", "right"],
        bar.info,
    )
    np.testing.assert_array_equal(
        some.agents["right"].position, bar.agents["right"].position[3:9]
    )
    np.testing.assert_array_equal(some.object_position, bar.object_position[3:9])


@pytest.mark.thorough
def test_two_logs_of_a_team_are_compared_vehicle_by_vehicle(bar, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    heavy = skyarm.with_numbers(
        team("bar", duration=0.2), {"agents.left.plant.vehicle.base.mass": 0.26}
    )
    skyarm.save_log(bar, "bar.npz")
    skyarm.save_log(skyarm.run(heavy), "heavy.mcap")
    session = skyarm.Session(team("bar", duration=0.2))
    session.step()
    skyarm.save_log(session.log, "left.npz")
    for name, count in (("bar.npz", 40), ("left.npz", 1)):
        same = typed("diff", name)
        assert (same.code, same.out.splitlines()[0]) == (
            0,
            f"every number is the same in {count} control periods",
        )
    other = typed("diff", "bar.npz", "heavy.mcap", "--json")
    document = json.loads(other.out)
    assert other.code == 1
    assert document["scenario"] == {"agents.left.plant.vehicle.base.mass": [0.25, 0.26]}
    errors = [
        document["metrics"][k]["left_position_error_max_continuous"] for k in (0, 1)
    ]
    name = "position_error_max_continuous"
    assert errors == [
        skyarm.score(load_log(file).agents["left"], [name])[name]
        for file in ("bar.npz", "heavy.mcap")
    ]
    said = typed("diff", "bar.npz", "heavy.mcap").out
    assert "right_tilt_max" in said
    skyarm.save_log(bar.agents["left"], "one.npz")
    assert "\ntilt_max" in typed("diff", "one.npz", "one.npz").out
    assert ["law", "centroidal_joint", "centroidal_joint"] in [
        line.split() for line in said.splitlines()
    ]


def test_another_law_of_a_vehicle_is_one_line():
    fields = {
        "agents.left.controller.law.name": ("a", "b"),
        "agents.left.controller.gain": (1.0, 2.0),
        "seed": (0, 1),
    }
    said = [
        "the scenarios differ in",
        "  controller: 'a and c' and 'b and c'",
        "  seed: 0 and 1",
    ]
    assert changed_field_lines(fields, ["a and c", "b and c"]) == said


def test_contacts_of_a_team_are_listed_for_all(bar):
    tables = tomllib.loads((TEAMS / "bar.toml").read_text("utf-8")) | {"duration": 0.1}
    floor = {
        "name": "floor",
        "shape": "box",
        "size": [0.02, 0.02, 0.1],
        "position": [0.0, 0.19, 0.889],
    }
    tables["world"] = {
        "points": [{"name": "foot", "agent": "left", "frame": "grip", "radius": 0.06}],
        "surfaces": [floor],
    }
    log = skyarm.run(with_law(skyarm.scenario_from(tables), nothing))
    touch, again = log.contact_periods
    assert (touch.surface, touch.point) == ("floor", "foot")
    assert max(touch.peak, again.peak) == log.contact_force.max() > 5.0
    with pytest.raises(
        ValueError,
        match=(
            r"^log\.phase_ends: is of one agent; log\.agents\[NAME\]\.phase_ends, of"
            r" left, right$"
        ),
    ):
        bar.phase_ends  # noqa: B018
