"""Flights at a pace with live topics, in this process and as ``skyarm run --ros``."""

from __future__ import annotations

import dataclasses
import json
import math
import sys
from collections.abc import Callable

import numpy as np
import pytest

import skyarm as package
from skyarm.links.ros import RosError, live_flight
from skyarm.links.ros.live_flight import Pace, fly_live
from support.commands import refused, skyarm
from support.peers import MemoryNode, memory_nodes

SHORT = 0.5


class Clock:
    """Wall clock that goes on when it is slept on, and by what a test adds."""

    def __init__(self) -> None:
        self.now, self.slept = 100.0, 0.0

    def perf_counter(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        assert seconds > 0.0
        self.now += seconds
        self.slept += seconds


@pytest.fixture
def clock(monkeypatch):
    found = Clock()
    monkeypatch.setattr(live_flight, "time", found)
    return found


@pytest.mark.parametrize("speed", [0.5, 1.0, 4.0])
def test_periods_begin_at_their_times(clock, speed):
    pace = Pace(speed)
    for k in range(401):
        pace.wait(k / 200)
        assert clock.now == pytest.approx(100.0 + k / 200 / speed, abs=1e-9)
        clock.now += 0.001 / speed
    assert pace.late == 0.0


def test_a_short_pause_is_caught_up_and_a_long_one_is_not(clock):
    pace = Pace(1.0)
    pace.wait(0.0)
    clock.now += 0.2
    for k in range(1, 100):
        pace.wait(k / 200)
    assert clock.now == pytest.approx(100.495)
    clock.now += 1.0
    pace.wait(0.5)
    pace.wait(0.6)
    assert pace.late == pytest.approx(0.995)
    assert clock.now == pytest.approx(101.595)


def test_an_infinite_pace_waits_for_nothing(clock):
    pace = Pace(math.inf)
    for k in range(100):
        pace.wait(float(k))
    assert clock.slept == 0.0


def test_a_flight_takes_its_time_and_its_numbers_are_those_of_run(clock):
    scenario, node, seen = (
        package.load_scenario("case3_wind", duration=SHORT),
        MemoryNode(),
        [],
    )
    live = fly_live(
        scenario, node, advance=lambda *counts: seen.append(counts), warn=pytest.fail
    )
    assert clock.now == pytest.approx(100.0 + SHORT - 0.005)
    plain = package.run(scenario)
    for name in ("position", "rotor_commands", "joints", "time"):
        assert np.array_equal(live.log[name], plain[name])
    assert live.log.status == "completed"
    assert (live.commanded, live.goals, live.interrupted, live.lines) == (
        0,
        0,
        None,
        [],
    )
    assert seen[-1] == (100, 100)
    assert node.closed


class Ending(MemoryNode):
    """Node in which something happens after some messages of the clock."""

    def __init__(self, happens: Callable[[Ending], None]) -> None:
        super().__init__()
        self._happens = happens

    def send(self, topic: str, data: bytes) -> None:
        super().send(topic, data)
        if topic == "/clock" and len(self.sent[topic]) == 20:
            self._happens(self)


def interrupt(_node: Ending) -> None:
    raise KeyboardInterrupt


def test_ctrl_c_keeps_what_was_flown():
    node = Ending(interrupt)
    live = fly_live(
        package.load_scenario("case3", duration=SHORT),
        node,
        pace=math.inf,
        warn=pytest.fail,
    )
    assert isinstance(live.interrupted, KeyboardInterrupt)
    assert (live.log.status, live.log.time.size) == ("running", 20)
    assert node.closed


def test_an_error_closes_the_node_and_goes_on():
    def fail(_node: Ending) -> None:
        raise OSError("the socket is gone")

    node = Ending(fail)
    with pytest.raises(OSError, match="gone"):
        fly_live(
            package.load_scenario("case3", duration=SHORT),
            node,
            pace=math.inf,
            warn=pytest.fail,
        )
    assert node.closed


def test_a_topic_that_cannot_be_written_ends_the_flight_and_keeps_its_log():
    def fail(_node: Ending) -> None:
        raise RosError("ROS 2 topic /clock: cannot be written (out of resources)")

    told: list[str] = []
    node = Ending(fail)
    live = fly_live(
        package.load_scenario("case3", duration=SHORT),
        node,
        pace=math.inf,
        warn=told.append,
    )
    assert told == [
        "ROS 2 topic /clock: cannot be written (out of resources); the flight ends"
        " after 0.1 s"
    ]
    assert (live.log.status, live.log.time.size, live.interrupted) == (
        "running",
        20,
        None,
    )
    assert node.closed


def test_a_reference_that_takes_no_goals_says_so_once():
    told: list[str] = []
    changes = (package.Change(at=0.1, path="reference.z.value", value=1.1),)
    scenario = dataclasses.replace(
        package.load_scenario("case3", duration=SHORT), changes=changes
    )
    live = fly_live(scenario, MemoryNode(), pace=math.inf, warn=told.append)
    assert len(told) == 1
    assert told[0].startswith(
        "no goals are taken on /skyarm/goal and /skyarm/joint_goal, since of the"
        " reference it"
    )
    assert np.array_equal(live.log.position, package.run(scenario).position)


def test_the_command_flies_with_topics_and_closes_its_node(tmp_path, monkeypatch):
    nodes = memory_nodes(monkeypatch)
    done = skyarm(
        "run",
        "case3",
        "--duration",
        "0.5",
        "--ros",
        "2",
        "--pace",
        "0",
        "--json",
        "--log",
        str(tmp_path / "flight.npz"),
    )
    assert (done.code, done.err) == (0, "")
    assert json.loads(done.out)["ros"] == {
        "version": 2,
        "commanded": 0,
        "goals": 0,
        "late_s": 0.0,
    }
    (node,) = nodes
    assert node.kinds["/odom"] == "nav_msgs/Odometry"
    assert "/skyarm/command" in node.heard
    assert node.closed
    flown = package.load_log(tmp_path / "flight.npz")
    assert np.array_equal(
        flown.position,
        package.run(package.load_scenario("case3", duration=0.5)).position,
    )


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--ros", "3"), "--ros = 3: must be 2;"),
        (("--pace", "2"), "--pace: must be left out without --ros"),
        (
            ("--ros", "2", "--pace", "-1"),
            "--pace = -1: must be a finite number, 0 or above",
        ),
        (("--ros", "2", "--pace", "inf"), "--pace = inf: must be a finite number"),
        (
            ("--ros", "1"),
            (
                "--ros = 1: must be 2; ROS 1 ended in May 2025, and ros1_bridge"
                " connects its nodes to --ros 2"
            ),
        ),
    ],
)
def test_what_cannot_be_is_one_line_and_writes_nothing(
    tmp_path, monkeypatch, words, said
):
    monkeypatch.chdir(tmp_path)
    refused(skyarm("run", "case3", "--duration", "0.5", *words), said)
    assert not any(tmp_path.iterdir())


def test_ros_2_without_its_library_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "cyclonedds", None)
    monkeypatch.setitem(sys.modules, "cyclonedds.core", None)
    refused(
        skyarm("run", "case3", "--duration", "0.5", "--ros", "2"),
        "cyclonedds: is missing; ROS 2 needs the extra",
    )
