"""MAVLink connection of a control law to an autopilot: state in, body rates, thrust and
modes out.

Source: mavlink.io, services "Offboard", "Command" and "Time synchronization".
"""

from __future__ import annotations

import errno
import math
import select
import socket
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from urllib.parse import urlsplit

from skyarm.algebra import Quaternion, Vec3
from skyarm.algebra.frames import to_our_attitude, to_our_axes
from skyarm.links import mavlink
from skyarm.links.mavlink_vehicle import MODES, ONBOARD_COMPUTER, MavlinkVehicle
from skyarm.links.outside.estimates import COMPONENT, Estimates
from skyarm.links.outside.outside_law import SetPoint
from skyarm.links.outside.rate_commands import RateCommand
from skyarm.links.outside.state_frames import AutopilotState
from skyarm.links.sockets import Address, drain, open_datagrams
from skyarm.records.files import shown
from skyarm.records.immutable import positional

NO_ATTITUDE = 128
"""Type mask of a set point without attitude: rates and thrust count."""

STREAMS: Mapping[str, float] = {
    "ODOMETRY": 1.0,
    "ATTITUDE_QUATERNION": 1.0,
    "LOCAL_POSITION_NED": 1.0,
    "HIGHRES_IMU": 1.0,
    "EXTENDED_SYS_STATE": 0.02,
    "HEARTBEAT": 0.05,
}
"""Message -> its rate as a fraction of the rate of states."""

LANDED = 1
"""Value of EXTENDED_SYS_STATE on the ground."""

BODY_FRAMES = (12,)
"""Frames of a velocity that turn with the base: body forward, right, down."""


MOST_TIMES = 10_000
"""Number of round-trip times that are stored."""


class OffboardError(ValueError):
    """Error if a link cannot be opened, or if its autopilot takes no external set
    points.
    """


QUIET = 0.1
"""Time (s) after which a missing message is replaced by another one with the same
content."""

OLD = 0.1
"""Longest time (s) by which a position is extrapolated to the time of an attitude,
chosen: at 4 m/s^2 of unseen acceleration that errs by 2 cm."""


@positional
class PositionEstimate:
    """Estimated position (m) and velocity (m/s), north, west, up, at a time (s) of the
    autopilot's clock.
    """

    time: float
    position: Vec3
    velocity: Vec3


def parse_link(url: str) -> tuple[str, str, int]:
    """Scheme, host and port of a link address such as ``mavlink://127.0.0.1:14540``.

    Raises:
        OffboardError: another form.
    """
    # of a port that is no number: refused below in our words
    with suppress(ValueError):
        parts = urlsplit(url)
        whole = not (parts.path or parts.query or parts.fragment or parts.username)
        if (
            parts.scheme in ("mavlink", "mavlink-out")
            and parts.hostname
            and parts.port
            and whole
        ):
            return parts.scheme, parts.hostname, parts.port
    raise OffboardError(
        f"--link = {shown(url)}: must be mavlink://HOST:PORT, which waits there for the"
        " autopilot, mavlink-out://HOST:PORT, which calls it, or dds://DOMAIN"
    )


def _open_socket(url: str, patience: float) -> tuple[socket.socket, Address | None]:
    """Open a link's socket and return it with its peer's address; a taken port is
    retried for ``patience`` s.

    Raises:
        OffboardError: the link cannot be opened.
    """
    kind, host, port = parse_link(url)
    calls = kind == "mavlink-out"
    until = time.monotonic() + patience
    while True:
        try:
            # of a call nobody else is heard, and one to this machine stays in it
            made = open_datagrams((host, port), calls=calls)
            return made, made.getpeername() if calls else None
        except OSError as error:
            if error.errno == errno.EADDRINUSE and time.monotonic() < until:
                # the port may be that of a flight that is about to end
                time.sleep(0.2)
                continue
            raise OffboardError(
                f"--link = {shown(url)}: {error.strerror or error}"
            ) from None


class OffboardLink(Estimates, MavlinkVehicle):
    """MAVLink connection over UDP to one autopilot.

    Args:
        url: ``mavlink://HOST:PORT`` binds the port of this machine, and answers the
            first autopilot that sends there; ``mavlink-out://HOST:PORT`` sends to an
            autopilot's port.
        patience: s to wait for a port that another program has, such as a simulator
            until it hands over.

    Attributes:
        round_trips: s, of time synchronisation, the newest.
    """

    accelerometer = (
        "raise the rate of its telemetry port, or set there the interval of HIGHRES_IMU"
    )

    def __init__(self, url: str, patience: float = 0.0) -> None:
        Estimates.__init__(self)
        MavlinkVehicle.__init__(
            self,
            MODES,
            self._carry,
            # the autopilot's own number: it takes orders of its own system
            sender=(0, COMPONENT),
            role=ONBOARD_COMPUTER,
            datagrams=True,
        )
        self._socket, self._partner = _open_socket(url, patience)
        self._lost_before = 0
        self._calls = self._partner is not None
        self.round_trips: deque[float] = deque(maxlen=MOST_TIMES)
        self._place: PositionEstimate | None = None
        self._odometry = self._attitude = -math.inf

    @property
    def lost(self) -> int:
        """Number of frames lost since the newest request for the mode of external set
        points.
        """
        return self.parser.lost_by_sender.get((self.system, 1), 0) - self._lost_before

    @property
    def has_autopilot(self) -> bool:
        """True once an autopilot of a supported kind has sent its heartbeat."""
        return self.modes is not None

    @property
    def hint(self) -> str:
        """Parameters to set if all frames of the autopilot were MAVLink 1; else
        empty.
        """
        if not self.parser.version_1 or self.parser.version_2:
            return ""
        return (
            "only MAVLink 1 came: set MAV_PROTO_VER = 2 of PX4, or SERIALn_PROTOCOL = 2"
            " of ArduPilot"
        )

    def wait(self, seconds: float) -> None:
        """Wait for datagrams, at most a given time (s), and read all that have
        arrived.
        """
        select.select([self._socket], [], [], max(seconds, 0.0))
        # nobody at the other side yet: silence is noticed by its duration
        with suppress(ConnectionError):
            for data, sender in drain(self._socket):
                connected = self.modes is not None
                # a datagram of a stranger must not be taken for the autopilot once it
                # is known
                if connected and sender != self._partner:
                    continue
                for message in self.parser.feed(data):
                    if (
                        self.hear(message)
                        and (reader := _READERS.get(message.name)) is not None
                    ):
                        reader(self, message)
                if not connected and self.modes is not None:
                    self._partner = sender

    def beat(self) -> None:
        """Send a heartbeat of an onboard computer, and a time synchronisation."""
        super().beat()
        if self.system:
            self.tell("TIMESYNC", tc1=0, ts1=time.monotonic_ns())

    def request_estimates(self, rate: float) -> None:
        """Request state estimates at a rate (Hz); twice that if possible, since senders
        round their intervals up.
        """
        assert self.modes is not None
        most = min(2.0 * rate, self.modes.fastest)
        self.request_streams({name: most * share for name, share in STREAMS.items()})

    def request_outside(self) -> None:
        """Request the mode that takes external set points; ``accepted`` is True once
        the autopilot agrees.
        """
        self._await_answer()
        # lost before the take-over does not matter to the law
        self._lost_before += self.lost
        super().request_outside()

    def send(self, command: SetPoint) -> None:
        """Send the autopilot a set point of body rates and thrust."""
        assert isinstance(command, RateCommand)
        p, q, r = to_our_axes(*command.rates)
        self.tell_autopilot(
            "SET_ATTITUDE_TARGET",
            # 32 bits of milliseconds, which overflow after 50 days
            time_boot_ms=round(time.monotonic() * 1e3) & 0xFFFFFFFF,
            type_mask=NO_ATTITUDE,
            q=(1.0, 0.0, 0.0, 0.0),
            body_roll_rate=p,
            body_pitch_rate=q,
            body_yaw_rate=r,
            thrust=float(command.thrust),
        )

    def close(self) -> None:
        """Close the UDP socket of the connection."""
        self._socket.close()

    def _carry(self, frame: bytes) -> None:
        if self._partner is None:
            return
        # no socket error ends a flight: silence is noticed by its duration
        with suppress(OSError):
            _ = (
                self._socket.send(frame)
                if self._calls
                else self._socket.sendto(frame, self._partner)
            )

    def _hear_odometry(self, m: mavlink.Message) -> None:
        """Store an odometry message; its attitude counts only while no attitude
        messages arrive.
        """
        quaternion = to_our_attitude(*m["q"])
        velocity = to_our_axes(m["vx"], m["vy"], m["vz"])
        if m["child_frame_id"] in BODY_FRAMES:
            velocity = quaternion.rotation().apply(velocity)
        place = PositionEstimate(
            1e-6 * m["time_usec"], to_our_axes(m["x"], m["y"], m["z"]), velocity
        )
        self._place, self._odometry = place, time.monotonic()
        if time.monotonic() - self._attitude > QUIET:
            self._take_state(
                place,
                place.time,
                quaternion,
                to_our_axes(m["rollspeed"], m["pitchspeed"], m["yawspeed"]),
            )

    def _hear_position(self, m: mavlink.Message) -> None:
        """Store position and velocity of an autopilot that sends no odometry."""
        if time.monotonic() - self._odometry > QUIET:
            velocity = to_our_axes(m["vx"], m["vy"], m["vz"])
            self._place = PositionEstimate(
                1e-3 * m["time_boot_ms"], to_our_axes(m["x"], m["y"], m["z"]), velocity
            )

    def _hear_attitude(self, m: mavlink.Message) -> None:
        """Store attitude and body rate with the newest position, extrapolated to their
        time.
        """
        self._attitude = time.monotonic()
        if self._place is None:
            return
        quaternion = to_our_attitude(m["q1"], m["q2"], m["q3"], m["q4"])
        rate = to_our_axes(m["rollspeed"], m["pitchspeed"], m["yawspeed"])
        self._take_state(self._place, 1e-3 * m["time_boot_ms"], quaternion, rate)

    def _take_state(
        self, place: PositionEstimate, at: float, quaternion: Quaternion, rate: Vec3
    ) -> None:
        """Store a state whose position, extrapolated to the time of its attitude, is at
        most ``OLD`` s old.
        """
        ahead = at - place.time
        state = AutopilotState(
            time=at,
            position=place.position + place.velocity * ahead,
            quaternion=quaternion,
            velocity=place.velocity,
            rate=rate,
            specific_force=self._force,
        )
        if abs(ahead) <= OLD:
            self._keep(state)

    def _hear_inertial(self, m: mavlink.Message) -> None:
        self._keep_force(to_our_axes(m["xacc"], m["yacc"], m["zacc"]))

    def _hear_extended(self, m: mavlink.Message) -> None:
        self.landed = m["landed_state"] == LANDED

    def _hear_answer(self, m: mavlink.Message) -> None:
        to = m["target_system"], m["target_component"]
        self._take_answer(m["command"], m["result"], to, (self.system, COMPONENT))

    def _hear_time(self, m: mavlink.Message) -> None:
        if m["tc1"] and m["ts1"]:
            passed = time.monotonic() - 1e-9 * m["ts1"]
            # a round trip of a second or more is an answer to another program's request
            if 0.0 <= passed < 1.0:
                self.round_trips.append(passed)


_READERS: Mapping[str, Callable[[OffboardLink, mavlink.Message], None]] = {
    "ODOMETRY": OffboardLink._hear_odometry,
    "ATTITUDE_QUATERNION": OffboardLink._hear_attitude,
    "LOCAL_POSITION_NED": OffboardLink._hear_position,
    "HIGHRES_IMU": OffboardLink._hear_inertial,
    "EXTENDED_SYS_STATE": OffboardLink._hear_extended,
    "COMMAND_ACK": OffboardLink._hear_answer,
    "TIMESYNC": OffboardLink._hear_time,
}
"""Message -> function that reads it."""
