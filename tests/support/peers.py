"""Stand-ins of the other side: a node of ROS in memory, a scene without a browser.

- A node of ROS: it keeps what it was sent and hands out what a test puts in.
- A scene of the studio without a browser: it keeps what its nodes were told.
"""

from __future__ import annotations

from collections import defaultdict
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest


class MemoryNode:
    """Node that keeps what is sent, and hands out what a test puts into its inbox."""

    def __init__(self) -> None:
        self.kinds: dict[str, str] = {}
        self.latched: set[str] = set()
        self.heard: list[str] = []
        self.sent: dict[str, list[bytes]] = defaultdict(list)
        self.inbox: dict[str, list[bytes]] = defaultdict(list)
        self.closed = False

    def advertise(self, topic: str, kind: str, *, latched: bool = False) -> None:
        self.kinds[topic] = kind
        self.latched |= {topic} if latched else set()

    def send(self, topic: str, data: bytes) -> None:
        assert topic in self.kinds
        self.sent[topic].append(data)

    def subscribe(self, topic: str, kind: str) -> None:
        self.heard.append(topic)

    def take(self, topic: str) -> list[bytes]:
        assert topic in self.heard
        return self.inbox.pop(topic, [])

    def subscribers(self, topic: str) -> int:
        return 0

    def close(self) -> None:
        self.closed = True


def memory_nodes(patch: pytest.MonkeyPatch) -> list[MemoryNode]:
    """Nodes that the program opens from now on: in memory, in place of those of ROS
    2.
    """
    found: list[MemoryNode] = []
    patch.setattr(
        "skyarm.links.ros.ros2_node.Ros2Node",
        lambda: found.append(MemoryNode()) or found[-1],
    )
    return found


class Node(SimpleNamespace):
    """Counts what is written to it."""

    def __setattr__(self, name: str, value: Any) -> None:
        self.__dict__["writes"] = self.__dict__.get("writes", 0) + 1
        self.__dict__[name] = np.array(value)


class Scene:
    """A scene without a browser: nodes by their names, each with the vertices or points
    that it was ``given``.
    """

    def __init__(self) -> None:
        self.nodes: dict[str, Node] = {}

    def __getattr__(self, _name: str) -> Any:
        def add(
            name: str = "", *given: Any, position: Any = (0.0, 0.0, 0.0), **_: Any
        ) -> Node:
            node = self.nodes.setdefault(name or "", Node())
            removed = {"remove": lambda: self.nodes.pop(name, None)}
            node.__dict__.update(
                given=given[0] if given else None,
                position=np.array(position),
                **removed,
            )
            return node

        return add
