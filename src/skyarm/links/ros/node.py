"""A node of ROS: publishes and receives messages as bytes, whichever version carries them."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any, Protocol

LOOPBACK = "127.0.0.1"

MOST_WAITING = 100
"""Messages that wait for a slow receiver, or for the flight; older ones are dropped."""

Content = dict[str, Any]
"""Content of a message: field -> number, text, list of these, or content of the message inside."""


class RosError(ValueError):
    """Error of a missing or unreachable ROS, as one line."""


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
        """Reason for which the node has lost its ROS; empty while it has not."""

    @property
    def end_reason(self) -> str:
        """Reason for which ROS has ended the node; empty while it has not."""

    def advertise(self, topic: str, kind: str, *, latched: bool = False) -> None:
        """Offer a topic; the last message of a latched one is sent to every later subscriber."""

    def send(self, topic: str, data: bytes) -> None:
        """Publish a message on an advertised topic; never waits for a receiver."""

    def subscribe(self, topic: str, kind: str) -> None:
        """Subscribe to a topic."""

    def take(self, topic: str) -> list[bytes]:
        """Messages that have arrived on a topic since the last call, oldest first."""

    def subscribers(self, topic: str) -> int:
        """Number of subscribers that an advertised topic has now."""

    def close(self) -> None:
        """Unregister, close all sockets and end all threads."""


class Inbox:
    """Messages of one topic that wait to be read; the newest are kept."""

    def __init__(self) -> None:
        self._waiting: deque[bytes] = deque(maxlen=MOST_WAITING)

    def put(self, data: bytes) -> None:
        """Add a message, from any thread."""
        self._waiting.append(data)

    def take(self) -> list[bytes]:
        """Remove and return all messages, oldest first."""
        messages = []
        while self._waiting:
            messages.append(self._waiting.popleft())
        return messages
