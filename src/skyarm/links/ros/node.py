"""Interface of a ROS node that publishes and receives messages as bytes, for ROS 1 and ROS 2."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any, Protocol

LOOPBACK = "127.0.0.1"

MOST_WAITING = 100
"""Largest number of waiting messages for a slow receiver or for the flight; older ones are dropped."""

Content = dict[str, Any]
"""Content of a message: field -> number, text, list of these, or content of the message inside."""


class RosError(ValueError):
    """Error if ROS is missing or unreachable, with a one-line message."""


class Node(Protocol):
    """Publishers and subscriptions of one ROS node.

    Attributes:
        packed: True where messages have the bytes of ROS 1.
        definitions: message types by name, as the version has them.
        problem: why the node has lost its ROS; empty while it has not.
        end_reason: why ROS has asked the node to end; empty while it has not.
    """

    packed: bool
    definitions: Mapping[str, str]

    @property
    def problem(self) -> str:
        """Reason why the node has lost its connection to ROS; empty while it is connected."""

    @property
    def end_reason(self) -> str:
        """Reason why ROS has shut the node down; empty while it runs."""

    def advertise(self, topic: str, kind: str, *, latched: bool = False) -> None:
        """Advertise a topic; a latched one sends its last message to every later subscriber."""

    def send(self, topic: str, data: bytes) -> None:
        """Publish a message on an advertised topic; never waits for a receiver."""

    def subscribe(self, topic: str, kind: str) -> None:
        """Subscribe to a topic."""

    def take(self, topic: str) -> list[bytes]:
        """Messages that have arrived on a topic since the last call, oldest first."""

    def subscribers(self, topic: str) -> int:
        """Number of subscribers that an advertised topic has now."""

    def close(self) -> None:
        """Unregister the node, close all sockets and end all threads."""


class Inbox:
    """Queue of received messages of one topic; the oldest are dropped if it is full."""

    def __init__(self) -> None:
        self._waiting: deque[bytes] = deque(maxlen=MOST_WAITING)

    def put(self, data: bytes) -> None:
        """Add a message to the queue, from any thread."""
        self._waiting.append(data)

    def take(self) -> list[bytes]:
        """Remove and return all messages of the queue, oldest first."""
        messages = []
        while self._waiting:
            messages.append(self._waiting.popleft())
        return messages
