"""ROS 1 node in Python's own library, without an installed ROS: registration with the master, and the node's API.

A node and the master call each other by XML-RPC over HTTP; messages go over TCP connections between nodes
(:mod:`skyarm.links.ros.ros1_connections`). Source: wiki.ros.org/ROS/Master_API, Slave_API, Technical Overview.

rospy is not used: it lives in the system's Python of ROS (3.8 for Noetic), installs signal handlers of its own, and
waits without end for a master that is not there.
"""

from __future__ import annotations

import http.client
import io
import os
import socket
import threading
import time
import xmlrpc.client
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from socketserver import ThreadingMixIn
from typing import Any, TypeAlias
from urllib.parse import urlsplit
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

from skyarm.links.ros.node import LOOPBACK, Inbox, RosError
from skyarm.links.ros.ros1_connections import (
    MOST_CONNECTIONS,
    PATIENCE,
    Identity,
    Publication,
    Subscription,
    limit_wait,
)
from skyarm.links.sockets import Address
from skyarm.log.ros.messages import ROS1_DEFINITIONS
from skyarm.records.files import shown

MASTER = "ROS_MASTER_URI"
"""Environment variable with the address of the master, as in ROS 1."""

ADDRESSES = ("ROS_HOSTNAME", "ROS_IP")
"""Environment variables with this machine's name or address for other nodes, as in ROS 1; loopback without one."""

USUAL_MASTER = "http://127.0.0.1:11311"

WATCH = 1.0
"""Time (s) between two polls of the master."""

PROTOCOL = "TCPROS"

MOST_PORT = 65535

LONGEST_REQUEST = 1 << 16
"""Largest length (bytes) of a call of the node's API."""

SUCCESS = 1

Value: TypeAlias = "int | str | Sequence[Value]"
"""Argument or result of an XML-RPC call."""

Request = socket.socket | tuple[bytes, socket.socket]
"""Connection of a caller, as passed by socketserver."""


class Ros1Node:
    """ROS 1 node in pure Python: advertises topics and subscribes to them.

    Args:
        master: address of the master; that of ROS_MASTER_URI, else of this machine, if left out.
        host: name or address of this machine that other nodes connect to; that of ROS_HOSTNAME or ROS_IP, else
            loopback, if left out.

    Attributes:
        problem: reason for which the node has lost its master; empty while it has not.
        end_reason: reason for which ROS has ended the node (rosnode kill); empty while it has not.
        master: address of the master.

    Raises:
        RosError: there is no master, or no socket can be opened.
    """

    packed = True
    definitions: Mapping[str, str] = ROS1_DEFINITIONS

    def __init__(self, master: str | None = None, host: str | None = None) -> None:
        self.master = _address(master or os.environ.get(MASTER, "") or USUAL_MASTER)
        self._host = host or next((os.environ[name] for name in ADDRESSES if os.environ.get(name)), LOOPBACK)
        self.name = f"/skyarm_{os.getpid()}"
        self._publications: dict[str, Publication] = {}
        self._subscriptions: dict[str, Subscription] = {}
        self.problem = self.end_reason = ""
        self._closing = threading.Event()
        self._welcomes = threading.BoundedSemaphore(MOST_CONNECTIONS)
        self._ask("getPid")  # before any socket is open
        with ExitStack() as opened:
            try:
                self._listener = opened.enter_context(socket.create_server((self._host, 0)))
                self._api = opened.enter_context(_ApiServer(self._host))
            except OSError as error:
                words = error.strerror or error
                raise RosError(f"ROS 1 node: no socket can be opened at {shown(self._host)} ({words})") from None
            opened.pop_all()
        self._api.register_instance(_Api(self))
        self.address = f"http://{self._host}:{self._api.server_address[1]}/"
        self._threads = [
            threading.Thread(target=function, name=f"ros1 {name}", daemon=True)
            for name, function in (("api", self._serve), ("accept", self._accept), ("watch", self._watch))
        ]
        for thread in self._threads:
            thread.start()

    def advertise(self, topic: str, kind: str, *, latched: bool = False) -> None:
        """Advertise a topic.

        Raises:
            RosError: the master does not answer, or refuses.
        """
        self._publications[topic] = Publication(Identity(self.name, topic, kind), latched=latched)
        self._ask("registerPublisher", topic, kind, self.address)

    def send(self, topic: str, data: bytes) -> None:
        """Publish a message; it is dropped for a receiver that is too slow."""
        self._publications[topic].send(data)

    def subscribe(self, topic: str, kind: str) -> None:
        """Subscribe to a topic.

        Raises:
            RosError: the master does not answer, or refuses.
        """
        self._subscriptions[topic] = Subscription(Identity(self.name, topic, kind), Inbox(), self._find)
        publishers = self._ask("registerSubscriber", topic, kind, self.address)
        self._subscriptions[topic].update([str(each) for each in publishers])

    def take(self, topic: str) -> list[bytes]:
        """Messages that have arrived on a topic since the last call, oldest first."""
        return self._subscriptions[topic].inbox.take()

    def subscribers(self, topic: str) -> int:
        """Number of subscribers that an advertised topic has now."""
        return self._publications[topic].count

    def close(self) -> None:
        """Unregister at the master, close all sockets and end all threads."""
        if self._closing.is_set():
            return
        self._closing.set()
        with suppress(RosError):
            for topic in self._publications if not self.problem else ():
                self._ask("unregisterPublisher", topic, self.address)
            for topic in self._subscriptions if not self.problem else ():
                self._ask("unregisterSubscriber", topic, self.address)
        self._api.shutdown()
        self._api.server_close()
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)  # wakes the thread that accepts
        self._listener.close()
        ends: list[Publication | Subscription] = [*self._publications.values(), *self._subscriptions.values()]
        for each in ends:
            each.close()
        for thread in self._threads:
            thread.join(timeout=PATIENCE)

    def update(self, topic: str, publishers: list[str]) -> None:
        """Connect to the publishers of a topic that the master lists."""
        subscription = self._subscriptions.get(topic)
        if subscription is not None and not self._closing.is_set():
            subscription.update(publishers)

    def connection_of(self, topic: str) -> list[str | int]:
        """Protocol, host and port at which the node publishes a topic; empty for any other topic."""
        return [PROTOCOL, self._host, self._listener.getsockname()[1]] if topic in self._publications else []

    def publications(self) -> list[list[str]]:
        """List topic and type of every publication."""
        return [[each.identity.topic, each.identity.kind] for each in self._publications.values()]

    def subscriptions(self) -> list[list[str]]:
        """List topic and type of every subscription."""
        return [[each.identity.topic, each.identity.kind] for each in self._subscriptions.values()]

    def _find(self, publisher: str, topic: str) -> tuple[str, int]:
        """Host and port at which another node publishes a topic."""
        answer = call(publisher, "requestTopic", self.name, topic, [[PROTOCOL]])
        match answer:
            case [str(protocol), str(host), int(port)] if protocol == PROTOCOL and 0 < port <= MOST_PORT:
                return host, port
        raise RosError(f"ROS 1 node {publisher}: offers {shown(answer)}, must be {PROTOCOL}, host and port")

    def _ask(self, method: str, *words: str) -> Any:
        return call(self.master, method, self.name, *words)

    def _serve(self) -> None:
        self._api.serve_forever(poll_interval=0.05)

    def _accept(self) -> None:
        """Hand every new connection of a subscriber to the publication of its topic."""
        while not self._closing.is_set():
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return
            if not self._welcomes.acquire(blocking=False):
                connection.close()
                continue
            thread = threading.Thread(target=self._welcome, args=(connection,), name="ros1 welcome", daemon=True)
            thread.start()

    def _welcome(self, connection: socket.socket) -> None:
        try:
            Publication.welcome(connection, self._publications)
        finally:
            self._welcomes.release()
        if self._closing.is_set():
            for each in self._publications.values():
                each.close()

    def _watch(self) -> None:
        """Poll the ROS master once a second; it counts as lost after two failures."""
        silent = 0
        while not self._closing.wait(WATCH):
            try:
                self._ask("getPid")
                silent = 0
            except RosError as error:
                silent += 1
                if silent == 2:
                    self.problem = str(error)
                    return


class _Api:
    """Node API that the master and other nodes call; each method returns status, message and value."""

    def __init__(self, node: Ros1Node) -> None:
        self._node = node

    def _dispatch(self, method: str, words: tuple[Value, ...]) -> list[Value]:
        methods: Mapping[str, Callable[..., Value]] = {
            "requestTopic": self._request_topic,
            "publisherUpdate": self._publisher_update,
            "shutdown": self._end,
            "getPid": lambda *_: os.getpid(),
            "getMasterUri": lambda *_: self._node.master,
            "getPublications": lambda *_: self._node.publications(),
            "getSubscriptions": lambda *_: self._node.subscriptions(),
            "getBusStats": lambda *_: [[], [], []],
            "getBusInfo": lambda *_: [],
            "paramUpdate": lambda *_: 0,
        }
        try:
            return [SUCCESS, "", methods[method](*words)]
        except KeyError:
            return [-1, f"no method {method}", 0]
        except (TypeError, ValueError) as error:
            return [-1, str(error), 0]

    def _request_topic(self, _caller: str, topic: str, protocols: list[list[str]]) -> list[str | int]:
        connection = self._node.connection_of(topic)
        if not connection or not any(each and each[0] == PROTOCOL for each in protocols):
            raise ValueError(f"{topic}: is not published here by {PROTOCOL}")
        return connection

    def _publisher_update(self, _caller: str, topic: str, publishers: list[str]) -> int:
        self._node.update(topic, [str(each) for each in publishers])
        return 0

    def _end(self, _caller: str, reason: str = "") -> int:
        self._node.end_reason = f"ended by ROS ({' '.join(str(reason).split()) or 'shutdown'})"
        return 0


class _Request(io.RawIOBase):
    """Byte stream of a request that must arrive within one time limit."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection, self._until = connection, time.monotonic() + PATIENCE

    def readable(self) -> bool:
        """True, as required of a readable stream."""
        return True

    def readinto(self, buffer: Any) -> int:
        """Read the bytes that have arrived; raise TimeoutError after the time limit."""
        limit_wait(self._connection, self._until)
        return self._connection.recv_into(buffer)


class _Handler(SimpleXMLRPCRequestHandler):
    """Request handler that answers at any path, and drops a client that is slow or sends too much."""

    rpc_paths = ()
    timeout = PATIENCE

    def setup(self) -> None:
        """Read the HTTP request within one time limit."""
        super().setup()
        self.rfile.close()
        self.rfile = io.BufferedReader(_Request(self.connection))

    def do_POST(self) -> None:
        """Answer a POST request, or refuse one that is too long."""
        length = self.headers.get("Content-Length", "")
        if not (length.isascii() and length.isdigit() and len(length) < 9 and int(length) <= LONGEST_REQUEST):
            self.send_error(413)
            return
        super().do_POST()

    def log_message(self, *_: object) -> None:
        """Print nothing about invalid requests."""


class _ApiServer(ThreadingMixIn, SimpleXMLRPCServer):
    """XML-RPC server of a node, with a limited number of threads, silent about clients that disconnect."""

    daemon_threads, block_on_close = True, False

    request_queue_size = MOST_CONNECTIONS

    _send_traceback_header = False

    def __init__(self, host: str) -> None:
        self._places = threading.BoundedSemaphore(MOST_CONNECTIONS)
        super().__init__((host, 0), requestHandler=_Handler, logRequests=False, allow_none=True)

    def process_request(self, request: Request, client_address: Address) -> None:
        """Answer a client in its own thread, or drop it if there are too many."""
        if self._places.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Request, client_address: Address) -> None:
        """Answer a client, then free its place among the server's limited threads."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._places.release()

    def handle_error(self, *_: object) -> None:
        """Ignore a client that disconnects or sends no XML."""


class _Transport(xmlrpc.client.Transport):
    """HTTP connection to the master or a node, with a time limit, that leaves no socket open."""

    _answer: http.client.HTTPResponse | None = None

    def make_connection(self, host: tuple[str, dict[str, str]] | str) -> http.client.HTTPConnection:
        """Open a connection with a time limit."""
        connection = super().make_connection(host)
        connection.timeout = PATIENCE
        connection.response_class = self._begin_answer  # type: ignore[assignment]
        return connection

    def _begin_answer(
        self, connection: socket.socket, debuglevel: int = 0, method: str | None = None, url: str | None = None
    ) -> http.client.HTTPResponse:
        self._answer = http.client.HTTPResponse(connection, debuglevel, method, url)
        return self._answer

    def close(self) -> None:
        """Close the HTTP connection and an incompletely read answer."""
        if self._answer is not None:
            self._answer.close()
        super().close()


def call(address: str, method: str, *words: Value) -> Any:
    """Call an XML-RPC method of the master or of a node; return its value.

    Raises:
        RosError: it does not answer, or refuses; one line with its address.
    """
    try:
        with xmlrpc.client.ServerProxy(address, transport=_Transport()) as proxy:
            answer = getattr(proxy, method)(*words)
        status, message, value = answer
    except OSError as error:
        reason = " ".join((error.strerror or str(error) or type(error).__name__).split())
        raise RosError(f"ROS 1 at {address}: does not answer ({reason}); is roscore running?") from None
    except Exception as error:  # whatever a port of another program answers
        raise RosError(f"ROS 1 at {address}: answers as no master or node does ({type(error).__name__})") from None
    if status != SUCCESS:
        raise RosError(f"ROS 1 at {address}: refuses {method} ({message})")
    return value


def _address(text: str) -> str:
    """Check the address of a ROS master.

    Raises:
        RosError: no address of the form http://HOST:PORT.
    """
    try:
        parts = urlsplit(text)
        good = parts.scheme == "http" and bool(parts.hostname) and parts.port is not None
    except ValueError:
        good = False
    if not good:
        raise RosError(f"{MASTER} = {shown(text)}: must be http://HOST:PORT")
    return text
