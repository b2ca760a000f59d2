"""Interface of a ROS node that publishes and receives messages as bytes."""

from __future__ import annotations

from typing import Any, Protocol

Content = dict[str, Any]
"""Content of a message: field -> number, text, list of these, or content of the message
inside."""


class RosError(ValueError):
    """Error if ROS is missing or unreachable, with a one-line message."""


class Node(Protocol):
    """Publishers and subscriptions of one ROS node."""

    def advertise(self, topic: str, kind: str, *, latched: bool = False) -> None:
        """Advertise a topic; a latched one sends its last message to every later
        subscriber.
        """

    def send(self, topic: str, data: bytes) -> None:
        """Publish a message on an advertised topic; never waits for a receiver."""

    def subscribe(self, topic: str, kind: str) -> None:
        """Subscribe to a topic."""

    def take(self, topic: str) -> list[bytes]:
        """Messages that have arrived on a topic since the last call, oldest first."""

    def subscribers(self, topic: str) -> int:
        """Number of subscribers that an advertised topic has now."""

    def close(self) -> None:
        """Leave ROS, close all sockets and end all threads."""
