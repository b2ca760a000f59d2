"""Stand-ins of the other side: nodes, a master and sockets of ROS, a scene without a browser.

- Stand-ins for ROS: a node in memory, a master of ROS 1, and a subscriber and a publisher on plain sockets.
- A scene of the studio without a browser: it keeps what its nodes were told.

They share no code with :mod:`skyarm.links.ros`; bytes are read and written by rosbags.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
import xmlrpc.client
from collections import defaultdict
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any
from xmlrpc.server import SimpleXMLRPCServer

import numpy as np

from skyarm.log.ros.messages import DEFINITIONS, ROS1_DEFINITIONS


class MemoryNode:
    """Node that keeps what is sent, and hands out what a test puts into its inbox."""

    problem = end_reason = ""

    def __init__(self, *, packed: bool = False) -> None:
        self.packed, self.definitions = packed, ROS1_DEFINITIONS if packed else DEFINITIONS
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


class Master:
    """Master of ROS 1 that knows who publishes and subscribes, and tells subscribers of new publishers."""

    def __init__(self) -> None:
        self.server = SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False, allow_none=True)
        self.address = f"http://127.0.0.1:{self.server.server_address[1]}"
        self.publishers: dict[str, list[str]] = defaultdict(list)
        self.listeners: dict[str, list[str]] = defaultdict(list)
        self.kinds: dict[str, str] = {}
        for name in (
            "getPid",
            "registerPublisher",
            "registerSubscriber",
            "unregisterPublisher",
            "unregisterSubscriber",
        ):
            self.server.register_function(getattr(self, name), name)
        self.thread = threading.Thread(target=self.server.serve_forever, args=(0.02,), daemon=True)
        self.thread.start()

    def getPid(self, caller: str) -> list[Any]:
        return [1, "", 1]

    def registerPublisher(self, caller: str, topic: str, kind: str, api: str) -> list[Any]:
        self.publishers[topic].append(api)
        self.kinds[topic] = kind
        for each in self.listeners[topic]:
            asked(each, "publisherUpdate", "/master", topic, self.publishers[topic])
        return [1, "", self.listeners[topic]]

    def registerSubscriber(self, caller: str, topic: str, kind: str, api: str) -> list[Any]:
        self.listeners[topic].append(api)
        return [1, "", self.publishers[topic]]

    def unregisterPublisher(self, caller: str, topic: str, api: str) -> list[Any]:
        self.publishers[topic].remove(api)
        return [1, "", 1]

    def unregisterSubscriber(self, caller: str, topic: str, api: str) -> list[Any]:
        self.listeners[topic].remove(api)
        return [1, "", 1]

    def close(self) -> None:
        self.server.shutdown()
        self.server.server_close()
        self.thread.join()


@contextlib.contextmanager
def master() -> Iterator[Master]:
    """Master of ROS 1 for the length of a block."""
    found = Master()
    try:
        yield found
    finally:
        found.close()


def asked(api: str, method: str, *words: Any) -> Any:
    """Answer of a node's API."""
    with xmlrpc.client.ServerProxy(api) as proxy:
        return getattr(proxy, method)(*words)


def header(**fields: str) -> bytes:
    """Connection header of TCPROS."""
    rows = [f"{name}={value}".encode() for name, value in fields.items()]
    body = b"".join(struct.pack("<I", len(row)) + row for row in rows)
    return struct.pack("<I", len(body)) + body


def exactly(connection: socket.socket, count: int) -> bytes:
    """So many bytes; an error if the other side ends before."""
    found = b""
    while len(found) < count:
        more = connection.recv(count - len(found))
        assert more, "the other side has ended"
        found += more
    return found


def framed(connection: socket.socket) -> bytes:
    """Bytes behind their length."""
    return exactly(connection, struct.unpack("<I", exactly(connection, 4))[0])


def fields_of(content: bytes) -> dict[str, str]:
    """Fields of a connection header."""
    found = {}
    while content:
        size = struct.unpack("<I", content[:4])[0]
        name, _, value = content[4 : 4 + size].decode().partition("=")
        found[name], content = value, content[4 + size :]
    return found


def subscribe(api: str, topic: str, kind: str, checksum: str) -> tuple[socket.socket, dict[str, str]]:
    """Connection to a publisher that is found by its node's API, and the header that it answers."""
    status, words, place = asked(api, "requestTopic", "/test", topic, [["UDPROS"], ["TCPROS"]])
    assert (status, place[0]) == (1, "TCPROS"), words
    connection = socket.create_connection((place[1], place[2]), timeout=5.0)
    connection.sendall(header(callerid="/test", topic=topic, type=kind, md5sum=checksum, tcp_nodelay="1"))
    return connection, fields_of(framed(connection))


class Talker:
    """Node of ROS 1 that publishes one topic from a plain socket."""

    def __init__(self, found: Master, topic: str, kind: str, checksum: str, answer: object = None) -> None:
        self._fields = {"callerid": "/talker", "type": kind, "md5sum": checksum, "topic": topic}
        self._data = socket.create_server(("127.0.0.1", 0))
        self._api = SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False)
        port = self._data.getsockname()[1]
        place = [1, "", ["TCPROS", "127.0.0.1", port]] if answer is None else answer
        self.calls = 0
        self._api.register_function(lambda *_: self._answer(place), "requestTopic")
        threading.Thread(target=self._api.serve_forever, args=(0.02,), daemon=True).start()
        found.registerPublisher("/talker", topic, kind, f"http://127.0.0.1:{self._api.server_address[1]}")

    def _answer(self, place: object) -> object:
        self.calls += 1
        return place

    def accept(self) -> socket.socket:
        """Connection of the next subscriber, whose header is answered."""
        self._data.settimeout(5.0)
        connection, _ = self._data.accept()
        connection.settimeout(5.0)
        self.asked = fields_of(framed(connection))
        connection.sendall(header(**self._fields))
        return connection

    def close(self) -> None:
        self._api.shutdown()
        self._api.server_close()
        self._data.close()


class Node(SimpleNamespace):
    """Counts what is written to it."""

    def __setattr__(self, name: str, value: Any) -> None:
        self.__dict__["writes"] = self.__dict__.get("writes", 0) + 1
        self.__dict__[name] = np.array(value)


class Scene:
    """A scene without a browser: nodes by their names, each with the vertices or points that it was ``given``."""

    def __init__(self) -> None:
        self.nodes: dict[str, Node] = {}

    def __getattr__(self, _name: str) -> Any:
        def add(name: str = "", *given: Any, position: Any = (0.0, 0.0, 0.0), **_: Any) -> Node:
            node = self.nodes.setdefault(name or "", Node())
            removed = {"remove": lambda: self.nodes.pop(name, None)}
            node.__dict__.update(given=given[0] if given else None, position=np.array(position), **removed)
            return node

        return add
