"""Live topics of a flight under an autopilot: goals are its set points; commands are
none of ROS's.
"""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.links.ros.live_flight import fly_live
from skyarm.links.ros.ros_link import COMMAND, GOAL
from skyarm.log.ros.message_bytes import encode
from skyarm.log.ros.messages import DEFINITIONS
from support import ardupilot_stand_in
from support.peers import MemoryNode


class Steering(MemoryNode):
    """Node that gets a goal and a command at its tenth period."""

    def send(self, topic: str, data: bytes) -> None:
        super().send(topic, data)
        if topic == "/clock" and len(self.sent[topic]) == 10:
            pose = {
                "position": {"x": 0.2, "y": 0.0, "z": 1.1},
                "orientation": {"w": 1.0},
            }
            self.inbox[GOAL] = [
                encode("geometry_msgs/PoseStamped", DEFINITIONS, {"pose": pose}, 1)[
                    0
                ].tobytes()
            ]
            numbers = {"data": np.zeros(6)}
            self.inbox[COMMAND] = [
                encode("std_msgs/Float64MultiArray", DEFINITIONS, numbers, 1)[
                    0
                ].tobytes()
            ]


@pytest.mark.skipif(
    sys.platform == "win32", reason="the stand-in is started by a shell"
)
def test_an_autopilot_follows_goals_and_takes_no_commands(tmp_path, monkeypatch):
    program, script = tmp_path / "arducopter", Path(ardupilot_stand_in.__file__)
    program.write_text(
        f"#!/bin/sh\nexec {shlex.quote(sys.executable)} {shlex.quote(str(script))}"
        ' "$@"\n'
    )
    program.chmod(0o755)
    monkeypatch.setenv("SKYARM_ARDUPILOT", str(program))
    monkeypatch.setenv("PYTHONPATH", str(Path(skyarm.__file__).parents[1]))
    monkeypatch.setenv("STAND_IN_NOTE", str(tmp_path / "note.txt"))
    node = Steering()
    scenario = skyarm.load_scenario("case3", controller="ardupilot", duration=0.6)
    live = fly_live(scenario, node, pace=float("inf"), warn=pytest.fail)
    assert live.log.status == "completed", live.log.info["cause"]
    assert (live.goals, live.commanded) == (1, 0)
    assert COMMAND not in node.heard
    last = live.log.position_reference[-1] - live.log.position_reference[0]
    assert last @ (np.array([0.2, 0.0, 1.1]) - live.log.position_reference[0]) > 1e-3
    assert len(node.sent["/odom"]) > 100
    assert live.log.info["autopilot"]["name"] == "ardupilot"
