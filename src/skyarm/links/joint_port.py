"""Ports to the joints of an arm: joint angles in, setpoints out, over a socket, a servo
bus, or the user's own code.

The datagrams between two processes of ours are little endian: ``SKJ1``, a byte of kind,
a byte n of joints, two bytes of zeros, time (double), then n setpoints for a command,
or n positions and n rates for a state.
"""

from __future__ import annotations

import math
import struct
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from typing import Annotated

from skyarm.links.sockets import LOOPBACK, Address, drain, open_datagrams
from skyarm.records.files import shown
from skyarm.records.immutable import positional
from skyarm.records.plain import Plain
from skyarm.records.units import Unit

MAGIC = b"SKJ1"

HELLO, COMMAND, STATE, RELEASE = range(4)
"""Kinds of datagrams: a request for states, setpoints, joint states, and the return of
the arm."""

HEADER = struct.Struct("<4sBBHd")

MOST_AGES = 10_000
"""Number of command ages that are stored, the newest, so that a long flight does not
fill the memory; chosen."""

FRESH = 0.2
"""Wall-clock time (s) of silence after which the arm's owner takes the joints back from
a commander; chosen: twenty setpoints at 100 Hz."""


class JointPortError(ValueError):
    """Error if a joint port cannot be opened or does not fit the vehicle."""


@positional
class JointReading:
    """Joint angles and rates at a time of the arm's own clock."""

    time: Annotated[float, Unit("s", "time of the reading, the arm's own clock")]
    joints: Annotated[
        tuple[float, ...],
        Unit("rad or m", "measured joint positions, in the vehicle's order"),
    ]
    joint_rates: Annotated[
        tuple[float, ...],
        Unit("rad/s or m/s", "measured joint rates, in the vehicle's order"),
    ]


class JointLink(ABC):
    """Base class of joint ports: newest reading of the joints, and setpoints for them.

    A link of one's own is a subclass; ``skyarm fly --joints FILE.py:make`` calls
    ``make(vehicle)`` for it.

    Attributes:
        problem: cause for which no readings come; empty where it is not known.
    """

    problem: str = ""

    @abstractmethod
    def read(self) -> JointReading | None:
        """Newest joint reading that arrived since the last call, or None; does not
        wait.
        """

    @abstractmethod
    def send(self, setpoints: Sequence[float], at: float) -> None:
        """Send one setpoint for each joint, in the order of the vehicle's joints.

        Args:
            setpoints: N m, N, or what the joint's drive takes.
            at: s, autopilot's time of the estimate that they answer.
        """

    @abstractmethod
    def release(self) -> None:
        """Return the joints to the arm's own controller, which holds their positions;
        no setpoints follow.
        """

    @abstractmethod
    def close(self) -> None:
        """Close the joint port; a second call has no effect."""


class NoJoints(JointLink):
    """Connection to joints for a vehicle without joints, which sends and receives
    nothing.
    """

    def read(self) -> JointReading:
        """Reading of zero joints, with the present time."""
        return JointReading(time.monotonic(), (), ())

    def send(self, setpoints: Sequence[float], at: float) -> None:
        """Do nothing, as there are no joints to command."""

    def release(self) -> None:
        """Do nothing, as there are no joints to release."""

    def close(self) -> None:
        """Do nothing, as there is nothing to close."""


def pack(kind: int, count: int, at: float, values: Sequence[float] = ()) -> bytes:
    """Encode a datagram of the joint port: its kind, number of joints, time (s) and
    values.
    """
    return HEADER.pack(MAGIC, kind, count, 0, at) + struct.pack(
        f"<{len(values)}d", *values
    )


def unpack(data: bytes, count: int) -> tuple[int, float, tuple[float, ...]] | None:
    """Decode a datagram of the joint port for ``count`` joints: kind, time (s) and
    values; None for other bytes.
    """
    if len(data) < HEADER.size:
        return None
    magic, kind, joints, zeros, at = HEADER.unpack_from(data)
    numbers = {HELLO: 0, COMMAND: count, STATE: 2 * count, RELEASE: 0}.get(kind)
    if (
        magic != MAGIC
        or joints != count
        or zeros
        or numbers is None
        or len(data) != HEADER.size + 8 * numbers
    ):
        return None
    values = struct.unpack_from(f"<{numbers}d", data, HEADER.size)
    return (kind, at, values) if all(map(math.isfinite, (at, *values))) else None


class UdpJoints(JointLink):
    """Port to the joints of a simulator or another process, by datagrams.

    Args:
        host, port: address of the arm's owner, such as a simulator's
            :class:`JointServer`.
        count: joints of the vehicle.
    """

    def __init__(self, host: str, port: int, count: int) -> None:
        self._count = count
        try:
            self._socket = open_datagrams((host, port), calls=True)
        except OSError as error:
            raise JointPortError(
                f"--joints = {shown(f'udp://{host}:{port}')}: {error.strerror or error}"
            ) from None
        self._asked = -math.inf

    def read(self) -> JointReading | None:
        """Newest joint reading that arrived since the last call; if there is none,
        readings are requested.
        """
        newest = None
        for data, _ in drain(self._socket):
            message = unpack(data, self._count)
            if message is not None and message[0] == STATE:
                newest = message
        if newest is None:
            # requests may be lost: they are repeated, at most 20 times a second
            if time.monotonic() - self._asked > 0.05:
                self._asked = time.monotonic()
                self._tell(HELLO)
            return None
        _, at, values = newest
        return JointReading(at, values[: self._count], values[self._count :])

    def send(self, setpoints: Sequence[float], at: float) -> None:
        """Send setpoints for the joints without waiting for a confirmation."""
        self._tell(COMMAND, setpoints, at)

    def release(self) -> None:
        """Return control of the joints to the process that owns the arm."""
        self._tell(RELEASE)

    def close(self) -> None:
        """Close the socket of the joint port."""
        self._socket.close()

    def _tell(self, kind: int, values: Sequence[float] = (), at: float = 0.0) -> None:
        with suppress(OSError):
            self._socket.send(pack(kind, self._count, at, values))


class JointServer:
    """Server of a joint port: sends joint states to one external commander, and
    receives its setpoints.

    A commander that is silent for ``FRESH`` seconds, or releases the arm, loses the
    joints; the next one may follow.

    Args:
        port: UDP port to bind; 0 takes a free one.
        count: joints of the vehicle.
        host: address to bind.
    """

    def __init__(self, port: int, count: int, host: str = LOOPBACK) -> None:
        self._count, self._heard = count, -math.inf
        self._partner: Address | None = None
        self._setpoints: tuple[float, ...] | None = None
        self._commands = self._refused = 0
        self._ages: deque[float] = deque(maxlen=MOST_AGES)
        try:
            self._socket = open_datagrams((host, port))
        except OSError as error:
            raise JointPortError(
                f"UDP port {port} of the joints: must be free:"
                f" {error.strerror or error}"
            ) from None

    @property
    def port(self) -> int:
        """Number of the UDP port to which the server is bound."""
        return int(self._socket.getsockname()[1])

    @property
    def facts(self) -> dict[str, Plain]:
        """Counts of received commands, and ages (s) of the joint states to which the
        setpoints answer.
        """
        ages = sorted(self._ages)
        facts: dict[str, Plain] = {"commands": self._commands, "refused": self._refused}
        if ages:
            facts |= {
                "age_p50_s": ages[len(ages) // 2],
                "age_p99_s": ages[int(0.99 * (len(ages) - 1))],
            }
        return facts

    def exchange(
        self, at: float, joints: Sequence[float], joint_rates: Sequence[float]
    ) -> tuple[float, ...] | None:
        """Send joint states at a time (s) to the commander; return its setpoints, or
        None without recent ones.
        """
        with suppress(ConnectionError):
            for data, sender in drain(self._socket):
                self._take(data, sender, at)
        if self._partner is None:
            return None
        if time.monotonic() - self._heard > FRESH:
            self._partner, self._setpoints = None, None
            return None
        # a commander that cannot be reached falls silent, which is noticed above
        with suppress(OSError):
            self._socket.sendto(
                pack(STATE, self._count, at, (*joints, *joint_rates)), self._partner
            )
        return self._setpoints

    def _take(self, data: bytes, sender: Address | None, now: float) -> None:
        message = unpack(data, self._count)
        stranger = (
            self._partner not in (None, sender)
            and time.monotonic() - self._heard <= FRESH
        )
        # a state is what this side sends, so it is no message of a commander
        if message is None or message[0] == STATE or stranger:
            self._refused += 1
            return
        if sender != self._partner:
            self._setpoints = None
        self._partner, self._heard = sender, time.monotonic()
        kind, at, values = message
        if kind == COMMAND:
            self._setpoints = values
            self._commands += 1
            self._ages.append(now - at)
        elif kind == RELEASE:
            self._partner, self._setpoints = None, None

    def close(self) -> None:
        """Close the server's socket, which frees its UDP port."""
        self._socket.close()
