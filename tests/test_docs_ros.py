"""docs/ros.md: its topics are those that a link has, its commands and its Python fly on
stand-ins of ROS.
"""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

import skyarm as package
from skyarm.links.ros import RosLink, live_session, ros_link
from skyarm.links.ros.goals import ACCELERATION, SPEED
from skyarm.log.ros.messages import FLIGHT, full_name
from skyarm.log.ros.topics import FlightTopics
from support.commands import skyarm
from support.peers import MemoryNode, memory_nodes

PAGE = (Path(__file__).resolve().parents[1] / "docs" / "ros.md").read_text("utf-8")
ROWS = [
    [cell.strip() for cell in line.strip("| ").split(" | ")]
    for line in PAGE.splitlines()
    if line.startswith("| `/")
]
COMMANDS = [line for line in PAGE.splitlines() if line.startswith("skyarm ")]


def test_the_tables_name_every_topic_beside_those_of_a_log_with_its_type():
    node = MemoryNode()
    heard: dict[str, str] = {}
    node.subscribe = lambda topic, kind: heard.update({topic: kind})
    session, _ = live_session(package.load_scenario("case3", duration=0.1))
    RosLink(session, node)
    of_a_log = {
        topic.name for topic in FlightTopics(session.log).topics if topic.kind != FLIGHT
    }
    assert of_a_log < {*node.kinds}
    own = {
        topic: kind
        for topic, kind in node.kinds.items()
        if topic not in of_a_log - {"/clock"}
    }
    named = {row[0].strip("`"): row[1].strip("`") for row in ROWS}
    assert named == {topic: full_name(kind) for topic, kind in (own | heard).items()}


def test_the_numbers_are_those_of_the_code():
    text = " ".join(PAGE.split())
    assert f"holds for {ros_link.TIMEOUT:g} s of flight" in text
    assert f"within {SPEED:g} m/s and {ACCELERATION:g} m/s²" in text
    assert (
        f"at most {'five' if ros_link.GOAL_PAUSE == 0.2 else ros_link.GOAL_PAUSE} times"
        " a second" in text
    )


@pytest.mark.parametrize("line", COMMANDS)
def test_the_commands_fly(line, tmp_path, monkeypatch):
    """In memory, since ROS 2 needs its library, and no longer than it takes."""
    monkeypatch.chdir(tmp_path)
    nodes = memory_nodes(monkeypatch)
    done = skyarm(
        *shlex.split(line, comments=True)[1:], "--duration", "0.2", "--pace", "0"
    )
    assert (done.code, done.err) == (0, "")
    assert len(nodes[0].sent["/clock"]) == 40
    assert len(COMMANDS) == 1


def test_the_python_flies(monkeypatch):
    (text,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    nodes = memory_nodes(monkeypatch)
    monkeypatch.setattr(
        package,
        "load_scenario",
        lambda name, load=package.load_scenario: load(name, duration=0.2),
    )
    names: dict[str, object] = {}
    exec(text, names)
    log = names["fly"]()
    assert log.time.size == len(nodes[0].sent["/clock"]) == 40
    assert nodes[0].closed
