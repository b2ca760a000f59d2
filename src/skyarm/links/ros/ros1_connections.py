"""TCP connections of ROS 1 topics (TCPROS): to the node's subscribers, and to the publishers it subscribes to.

Both sides begin with a header of fields KEY=VALUE, each behind its length; then every message follows behind its own
length. Numbers are little endian. Source: wiki.ros.org/ROS/TCPROS, ROS/Connection Header.
"""

from __future__ import annotations

import socket
import struct
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress

from skyarm.links.ros.node import MOST_WAITING, Inbox
from skyarm.log.ros.messages import ROS1_DEFINITIONS, checksum, definition
from skyarm.records.immutable import positional

PATIENCE = 3.0
"""Time (s) within which a peer must answer."""

LONGEST_HEADER, LONGEST_MESSAGE = 1 << 16, 1 << 20
"""Largest length (bytes) of a connection's header and of a message."""

MOST_CONNECTIONS = 64
"""Largest number of connections of one topic, and of callers of one port; more are refused."""

LENGTH = struct.Struct("<I")

ANY = "*"
"""Type or checksum of a subscriber that accepts any message."""


@positional
class Identity:
    """Node name, topic and message type at one end of a connection."""

    node: str
    topic: str
    kind: str

    @property
    def checksum(self) -> str:
        """MD5 checksum of the ROS message type of a connection."""
        return checksum(self.kind, ROS1_DEFINITIONS)

    @property
    def fields(self) -> dict[str, str]:
        """Connection header that states node, topic, type, checksum and definition."""
        return {
            "callerid": self.node,
            "topic": self.topic,
            "type": self.kind,
            "md5sum": self.checksum,
            "message_definition": definition(self.kind, ROS1_DEFINITIONS),
        }

    def mismatch(self, header: Mapping[str, str]) -> str:
        """Reason why a connection header does not match this topic; empty if it matches."""
        for name, own in (("type", self.kind), ("md5sum", self.checksum)):
            if header.get(name, ANY) not in (ANY, own):
                return f"{name} of {self.topic} is {own}, not {header[name]}"
        return ""


class Publication:
    """Published topic with the connections of its subscribers.

    A thread for each subscriber writes what waits for it, so that a slow one delays nobody.
    """

    def __init__(self, identity: Identity, *, latched: bool) -> None:
        self.identity, self._latched = identity, latched
        self._last: bytes | None = None
        self._lock = threading.Lock()
        self._outlets: list[_Outlet] = []

    @staticmethod
    def welcome(connection: socket.socket, publications: Mapping[str, Publication]) -> None:
        """Answer the connection header of a new subscriber and add it to its topic, or refuse it."""
        connection.settimeout(PATIENCE)
        try:
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            header = read_header(connection)
            publication = publications.get(header.get("topic", ""))
            problem = (
                "the topic is not published here" if publication is None else publication.identity.mismatch(header)
            )
            if publication is None or problem:
                connection.sendall(header_bytes({"error": problem}))
                connection.close()
                return
            if publication.count >= MOST_CONNECTIONS:
                raise ConnectionError(f"{publication.identity.topic} has {MOST_CONNECTIONS} subscribers")
            connection.sendall(
                header_bytes({**publication.identity.fields, "latching": "1" if publication._latched else "0"})
            )
            publication._add(_Outlet(connection))
        except (OSError, ValueError):
            connection.close()

    @property
    def count(self) -> int:
        """Number of subscribers that are connected."""
        with self._lock:
            self._outlets = [each for each in self._outlets if each.alive]
            return len(self._outlets)

    def _add(self, outlet: _Outlet) -> None:
        with self._lock:
            self._outlets = [*(each for each in self._outlets if each.alive), outlet]
            if self._latched and self._last is not None:
                outlet.put(self._last)

    def send(self, data: bytes) -> None:
        """Send a message to all subscribers."""
        message = LENGTH.pack(len(data)) + data
        with self._lock:
            if self._latched:
                self._last = message
            for each in self._outlets:
                each.put(message)

    def close(self) -> None:
        """Send all waiting messages, then close all connections."""
        with self._lock:
            outlets, self._outlets = self._outlets, []
        for each in outlets:
            each.close()


class _Outlet:
    """Connection to one subscriber, with a queue of its waiting messages."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        self._waiting: deque[bytes] = deque(maxlen=MOST_WAITING)
        self._ready = threading.Condition()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="ros1 outlet", daemon=True)
        self._thread.start()

    @property
    def alive(self) -> bool:
        """True until the subscriber disconnects."""
        return self._thread.is_alive()

    def put(self, message: bytes) -> None:
        """Add a message to the queue; the oldest is dropped if the queue is full."""
        with self._ready:
            self._waiting.append(message)
            self._ready.notify()

    def close(self) -> None:
        """Send all waiting messages within the connection's time limit, then close it."""
        with self._ready:
            self._closing = True
            self._ready.notify()
        self._thread.join(timeout=PATIENCE)
        self._connection.close()

    def _run(self) -> None:
        try:
            while True:
                with self._ready:
                    self._ready.wait_for(lambda: self._waiting or self._closing)
                    if not self._waiting:
                        return
                    content = b"".join(self._waiting)
                    self._waiting.clear()
                self._connection.sendall(content)
        except OSError:
            return
        finally:
            self._connection.close()


Finder = Callable[[str, str], tuple[str, int]]
"""Function (address of a node, topic) -> host and port at which the node offers the topic."""


class Subscription:
    """Subscribed topic with a connection, and a thread, for each of its publishers."""

    def __init__(self, identity: Identity, inbox: Inbox, find: Finder) -> None:
        self.identity, self.inbox, self._find = identity, inbox, find
        self._lock = threading.Lock()
        self._sources: dict[str, _Source] = {}

    def update(self, publishers: list[str]) -> None:
        """Connect to new publishers, up to a limit, and disconnect from those that have left."""
        publishers = list(dict.fromkeys(publishers))[:MOST_CONNECTIONS]
        with self._lock:
            gone = [self._sources.pop(each) for each in list(self._sources) if each not in publishers]
            for each in publishers:
                if each not in self._sources or not self._sources[each].alive:
                    self._sources[each] = _Source(each, self.identity, self.inbox, self._find)
        for source in gone:
            source.close()

    def close(self) -> None:
        """Close the connections to all publishers of the subscribed topic."""
        self.update([])


class _Source:
    """Connection to one publisher; a thread adds its messages to the topic's queue."""

    def __init__(self, publisher: str, identity: Identity, inbox: Inbox, find: Finder) -> None:
        self._publisher, self._identity, self._inbox, self._find = publisher, identity, inbox, find
        self._connection: socket.socket | None = None
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="ros1 source", daemon=True)
        self._thread.start()

    @property
    def alive(self) -> bool:
        """True until the publisher disconnects."""
        return self._thread.is_alive()

    def close(self) -> None:
        """Close the connection and end its thread."""
        self._closing = True
        if self._connection is not None:
            with suppress(OSError):
                self._connection.shutdown(socket.SHUT_RDWR)
        if self._thread is not threading.current_thread():
            self._thread.join(timeout=PATIENCE)

    def _run(self) -> None:
        with suppress(OSError, ValueError):  # a publisher that is gone, or is none
            place = self._find(self._publisher, self._identity.topic)
            with socket.create_connection(place, timeout=PATIENCE) as connection:
                self._connection = connection
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                connection.sendall(header_bytes({**self._identity.fields, "tcp_nodelay": "1"}))
                if "error" in (answer := read_header(connection)) or self._identity.mismatch(answer):
                    return
                connection.settimeout(None)  # it may be silent for as long as it likes
                while not self._closing:
                    (length,) = LENGTH.unpack(read_exactly(connection, LENGTH.size))
                    if length > LONGEST_MESSAGE:
                        return
                    self._inbox.put(read_exactly(connection, length))


def header_bytes(fields: Mapping[str, str]) -> bytes:
    """Encode a connection header."""
    rows = [f"{name}={value}".encode() for name, value in fields.items()]
    content = b"".join(LENGTH.pack(len(row)) + row for row in rows)
    return LENGTH.pack(len(content)) + content


def read_header(connection: socket.socket) -> dict[str, str]:
    """Read a connection header, whose bytes have to arrive within one time limit.

    Raises:
        ValueError: the bytes are no header. OSError: the connection broke off, or was too slow.
    """
    until = time.monotonic() + PATIENCE
    (length,) = LENGTH.unpack(read_exactly(connection, LENGTH.size, until))
    if length > LONGEST_HEADER:
        raise ValueError(f"header of {length} bytes: must be at most {LONGEST_HEADER}")
    content, fields = read_exactly(connection, length, until), dict[str, str]()
    connection.settimeout(PATIENCE)
    while content:
        if len(content) < LENGTH.size:
            raise ValueError("header: must be fields behind their lengths")
        (size,) = LENGTH.unpack(content[: LENGTH.size])
        row, content = content[LENGTH.size : LENGTH.size + size], content[LENGTH.size + size :]
        name, equals, value = row.partition(b"=")
        if len(row) < size or not equals:
            raise ValueError("header: must be fields KEY=VALUE behind their lengths")
        fields[name.decode(errors="replace")] = value.decode(errors="replace")
    return fields


def limit_wait(connection: socket.socket, until: float) -> None:
    """Set a connection's timeout to end at a given time (s) of the monotonic clock.

    Raises:
        TimeoutError: it has come.
    """
    left = until - time.monotonic()
    if left <= 0.0:
        raise TimeoutError("the connection is too slow")
    connection.settimeout(left)


def read_exactly(connection: socket.socket, count: int, until: float | None = None) -> bytes:
    """Read an exact number of bytes, before a time (s) of the monotonic clock if ``until`` is given.

    Raises:
        OSError: the connection broke off, or was too slow.
    """
    received = bytearray()
    while len(received) < count:
        if until is not None:
            limit_wait(connection, until)
        more = connection.recv(count - len(received))
        if not more:
            raise ConnectionError("the connection broke off")
        received += more
    return bytes(received)
