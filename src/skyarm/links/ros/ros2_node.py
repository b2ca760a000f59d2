"""ROS 2 node on Cyclone DDS, without an installed ROS.

A topic ``/odom`` of ROS 2 is the DDS topic ``rt/odom``, its type
``nav_msgs/msg/Odometry`` the DDS type ``nav_msgs::msg::dds_::Odometry_``
(design.ros2.org/articles/topic_and_service_names.html). The DDS types are made of the
definitions in :mod:`skyarm.log.ros.messages`; messages go in and out as the bytes of
:mod:`skyarm.log.ros.message_bytes`.
"""

from __future__ import annotations

import contextlib
import os
import socket
import sys
import time
from collections.abc import Iterable, Mapping
from typing import Any, Protocol

from skyarm.links.ros.node import RosError
from skyarm.log.ros.messages import DEFINITIONS, MessageField, fields
from skyarm.records.files import needs_extra, shown

DOMAIN = "ROS_DOMAIN_ID"
"""Environment variable with the number of the DDS domain, as in ROS 2."""

CONFIGURATION = "CYCLONEDDS_URI"
"""Environment variable with a user's Cyclone configuration, which replaces this one,
for example for other machines."""

LOOPBACK = "127.0.0.1"

MOST_WAITING = 100
"""Largest number of waiting messages for a slow receiver or for the flight; older ones
are dropped."""

MOST_DOMAIN = 232
"""Highest number of a DDS domain, whose ports end at 65535."""

LAST = 0.05
"""Time (s) for the last messages to arrive."""

ANNOUNCED = "500 ms"
"""Time between two announcements of the node, by which later programs find it without
multicast."""

LOOPBACK_ONLY = f"""<CycloneDDS><Domain>
<General><Interfaces>
<NetworkInterface address="{LOOPBACK}" multicast="false"/>
</Interfaces>
<AllowMulticast>false</AllowMulticast></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex>
<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
<Peers><Peer address="{LOOPBACK}"/></Peers>
<SPDPInterval>{ANNOUNCED}</SPDPInterval></Discovery>
</Domain></CycloneDDS>"""
"""Configuration that exchanges no messages with other machines. Without multicast a
node is announced to the ports of each index up to 32: so many nodes on this machine
find each other."""


class Ros2Node:
    """ROS 2 node based on the library cyclonedds.

    Args:
        domain: number of the DDS domain; that of ROS_DOMAIN_ID, else 0, if left out.
        definitions: definitions of its message types.

    Raises:
        RosError: cyclonedds is missing, or the domain cannot be joined.
    """

    def __init__(
        self, domain: int | None = None, definitions: Mapping[str, str] = DEFINITIONS
    ) -> None:
        try:
            import cyclonedds.core
            import cyclonedds.domain
            import cyclonedds.pub
            import cyclonedds.qos
            import cyclonedds.sub
            import cyclonedds.topic
            import cyclonedds.util
        except ImportError:
            raise RosError(
                f"cyclonedds: is missing; ROS 2 {needs_extra('ros')}"
            ) from None
        self._dds: Any = cyclonedds
        self._types = DdsTypes(definitions)
        self._number = _domain_of_environment() if domain is None else domain
        self._writers: dict[str, Any] = {}
        self._readers: dict[str, Any] = {}
        self._domain: Any = None
        self._arrivals: Any = None
        try:
            if os.environ.get(CONFIGURATION):
                self._participant = self._dds.domain.DomainParticipant(self._number)
                return
            # the library does not tell its sockets: they are those that are new then
            others = _open_sockets()
            self._domain = self._dds.domain.Domain(self._number, LOOPBACK_ONLY)
            self._participant = self._dds.domain.DomainParticipant(self._number)
            _bind_to_loopback(_open_sockets() - others)
        except RosError:
            self.close()
            raise
        except self._dds.core.DDSException as error:
            self.close()
            raise RosError(
                f"ROS 2 domain {self._number}: cannot be joined ({_words(error)})"
            ) from None

    def advertise(self, topic: str, kind: str, *, latched: bool = False) -> None:
        """Advertise a topic: reliable, queue of 100 messages; a latched one keeps its
        last for later subscribers.
        """
        policy, within = self._dds.qos.Policy, self._dds.util.duration
        # ROS 2 reads the first version of the encoding (CDR) only; a slow reader holds
        # a flight up by 1 ms at most
        qos = self._dds.qos.Qos(
            policy.Reliability.Reliable(max_blocking_time=within(milliseconds=1)),
            policy.Durability.TransientLocal if latched else policy.Durability.Volatile,
            policy.History.KeepLast(1 if latched else MOST_WAITING),
            policy.DataRepresentation(use_cdrv0_representation=True),
        )
        self._writers[topic] = self._dds.pub.DataWriter(
            self._participant, self._topic(topic, kind), qos=qos
        )

    def send(self, topic: str, data: bytes) -> None:
        """Publish a message; it is dropped if the slowest receiver has no room for
        it.
        """
        writer = self._writers[topic]
        try:
            writer.write(_message(writer.data_type, data))
        except self._dds.core.DDSException as error:
            # a full queue drops the message: the flight never waits for a receiver
            if error.code != self._dds.core.DDSException.DDS_RETCODE_TIMEOUT:
                raise RosError(
                    f"ROS 2 topic {topic}: cannot be written ({_words(error)})"
                ) from None

    def subscribe(self, topic: str, kind: str) -> None:
        """Subscribe to a topic, for reliable and best-effort publishers alike."""
        policy = self._dds.qos.Policy
        qos = self._dds.qos.Qos(
            # reliable publishers match a best-effort reader, the other way round they
            # do not
            policy.Reliability.BestEffort,
            policy.Durability.Volatile,
            policy.History.KeepLast(MOST_WAITING),
            policy.DataRepresentation(use_cdrv0_representation=True),
        )
        self._readers[topic] = self._dds.sub.DataReader(
            self._participant, self._topic(topic, kind), qos=qos
        )

    def take(self, topic: str) -> list[bytes]:
        """Messages that have arrived on a topic since the last call, oldest first."""
        samples = self._readers[topic].take(MOST_WAITING)
        # disposed instances come as samples without content
        return [each.content for each in samples if hasattr(each, "content")]

    def wait(self, seconds: float) -> None:
        """Wait a limited time (s) for a message of the topics subscribed to before the
        first call.
        """
        if self._arrivals is None:
            core = self._dds.core
            self._arrivals = core.WaitSet(self._participant)
            new = core.SampleState.NotRead | core.ViewState.Any | core.InstanceState.Any
            for reader in self._readers.values():
                self._arrivals.attach(core.ReadCondition(reader, new))
        self._arrivals.wait(max(round(1e9 * seconds), 0))

    def subscribers(self, topic: str) -> int:
        """Number of subscribers that an advertised topic has now."""
        return len(self._writers[topic].get_matched_subscriptions())

    def publishers(self, topic: str) -> int:
        """Number of publishers that a subscribed topic has now."""
        return len(self._readers[topic].get_matched_publications())

    def close(self) -> None:
        """Wait until the last messages have arrived, then leave the DDS domain; sockets
        and threads end.
        """
        if any(map(self.subscribers, self._writers)):
            time.sleep(LAST)
        # readers and writers before the participant that they live in
        self._arrivals = None
        self._writers.clear()
        self._readers.clear()
        self._participant = None
        # a domain must outlive what was made in it
        self._domain = None

    def _topic(self, name: str, kind: str) -> Any:
        return self._dds.topic.Topic(
            self._participant, f"rt{name}", self._types.of(kind)
        )


class _Encoded(Protocol):
    """Interface of a DDS message object that stores only its encoded bytes."""

    content: bytes


def _content(message: _Encoded, *_: object, **__: object) -> bytes:
    """Return the encoded bytes that a DDS message stores; replaces cyclonedds's
    encoder.
    """
    return message.content


def _message(
    kind: type[_Encoded], /, data: bytes, *_: object, **__: object
) -> _Encoded:
    """Make a DDS message object that stores encoded bytes; replaces cyclonedds's
    decoder.
    """
    message = kind.__new__(kind)
    message.content = bytes(data)
    return message


class DdsTypes:
    """Cache of DDS types made from ROS message definitions."""

    def __init__(self, definitions: Mapping[str, str]) -> None:
        from cyclonedds.idl import make_idl_struct, types

        self._definitions = definitions
        self._made = dict[str, Any]()
        self._make, self._types = make_idl_struct, types

    def of(self, kind: str) -> Any:
        """DDS type of a ROS message type such as nav_msgs/Odometry."""
        if kind not in self._made:
            package, _, name = kind.partition("/")
            parts = {
                field.name: self._field(field)
                for field in fields(self._definitions[kind])
            }
            made = self._make(name, f"{package}::msg::dds_::{name}_", parts)
            made.serialize, made.deserialize = _content, classmethod(_message)
            self._made[kind] = made
        return self._made[kind]

    def _field(self, field: MessageField) -> Any:
        _, kind, length = field
        one = (
            str
            if kind == "string"
            else (
                bool
                if kind == "bool"
                else getattr(self._types, kind, None) or self.of(kind)
            )
        )
        # None: a single value, 0: a list of any length
        if length is None:
            return one
        return self._types.array[one, length] if length else self._types.sequence[one]


def _domain_of_environment() -> int:
    text = os.environ.get(DOMAIN, "") or "0"
    if not text.isascii() or not text.isdigit() or int(text) > MOST_DOMAIN:
        raise RosError(
            f"{DOMAIN} = {shown(text)}: must be a whole number from 0 to {MOST_DOMAIN}"
        )
    return int(text)


def _open_sockets() -> set[int]:
    """File descriptors of this process's sockets, on Linux; elsewhere none."""
    descriptors = set[int]()
    if sys.platform == "linux":
        for name in os.listdir("/proc/self/fd"):
            # the descriptor that the folder was listed by is closed again
            with contextlib.suppress(OSError):
                if os.readlink(f"/proc/self/fd/{name}").startswith("socket:"):
                    descriptors.add(int(name))
    return descriptors


def _bind_to_loopback(descriptors: Iterable[int]) -> None:
    """Let sockets receive from the loopback device only: the library opens them for
    every interface.

    Raises:
        RosError: the system does not allow it.
    """
    for each in descriptors:
        try:
            shared = socket.socket(fileno=os.dup(each))
        except OSError:  # closed since it was listed
            continue
        with shared:
            if shared.family not in (socket.AF_INET, socket.AF_INET6):
                continue
            try:
                shared.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, b"lo\0")
            except OSError as error:
                raise RosError(
                    "ROS 2: its sockets cannot be kept to this machine"
                    f" ({error.strerror or error}); a configuration of your own in"
                    f" {CONFIGURATION} takes the place of ours"
                ) from None


def _words(error: Exception) -> str:
    return " ".join(str(getattr(error, "msg", "") or error).split())
