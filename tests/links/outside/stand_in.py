"""Stand-in for an autopilot: a thread that flies a point of unit mass by body rates and
thrust, and talks MAVLink.

It shares no code with the law's side but the framing of messages: attitude by NumPy
matrices in north, east, down.
"""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from dataclasses import dataclass, field

import numpy as np

from skyarm.links import mavlink
from skyarm.links.mavlink_messages import DEFINITIONS_BY_NUMBER, checksum

PX4_HOLD, PX4_OFFBOARD = 4 << 16 | 3 << 24, 6 << 16
GRAVITY = 9.81


def free_port() -> int:
    """UDP port of the loopback that nobody has now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def version_1(frame: bytes) -> bytes | None:
    """Frame of MAVLink 1 with the message of one of MAVLink 2; None for a number that
    it has no room for.
    """
    definition = DEFINITIONS_BY_NUMBER[int.from_bytes(frame[7:10], "little")]
    if definition.number > 255:
        return None
    payload = frame[10:-2].ljust(definition.layout.size, b"\0")
    body = bytes((len(payload), *frame[4:7], definition.number)) + payload
    return b"\xfe" + body + checksum(body + definition.check).to_bytes(2, "little")


def quaternion_of(R: np.ndarray) -> list[float]:
    """Quaternion w x y z of a rotation matrix, by its eigenvector."""
    K = np.array(
        [
            [
                R[0, 0] + R[1, 1] + R[2, 2],
                R[2, 1] - R[1, 2],
                R[0, 2] - R[2, 0],
                R[1, 0] - R[0, 1],
            ],
            [0, R[0, 0] - R[1, 1] - R[2, 2], R[1, 0] + R[0, 1], R[0, 2] + R[2, 0]],
            [0, 0, R[1, 1] - R[0, 0] - R[2, 2], R[2, 1] + R[1, 2]],
            [0, 0, 0, R[2, 2] - R[0, 0] - R[1, 1]],
        ]
    )
    values, vectors = np.linalg.eigh(K, UPLO="U")
    w, x, y, z = vectors[:, values.argmax()]
    return [float(c) for c in (w, x, y, z)]


def turned(R: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Attitude after a rotation vector in body axes, by Rodrigues' formula."""
    angle = np.linalg.norm(rotation)
    if angle < 1e-12:
        return R
    x, y, z = rotation / angle
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return R @ (np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K)


@dataclass
class StandIn:
    """PX4 that hovers in hold mode, obeys set points in offboard mode, and fails as it
    is told.

    Attributes:
        port: of the law's side. hover: thrust of hover. bandwidth: of the rate loop,
            rad/s.
        silent_at, leaves_at, disarms_at, nan_at, back_at: s after it entered offboard
            mode at which it falls silent, changes to hold, disarms, sends NaN, or sets
            its clock back by 100 s, or on by 1000 s.
        mute: it does not say whether a mode was entered, nor beats in offboard mode.
        numbers: values of parameters, in place of its own.
        forceless_at: s after it entered offboard mode from which it sends no
            accelerometer; -inf for never.
        old: it sends MAVLink 1, "first" until it hears MAVLink 2, or "always".
        refuses: set points are never taken. armed, landed: as it says. odometry: else
            attitude and position apart.
        secrets: parameters that it does not send. offboard: another program commands
            it.
        place, heading: where it hovers, north east down, rad.
    """

    port: int
    hover: float = 0.4
    bandwidth: float = 18.0
    silent_at: float = np.inf
    leaves_at: float = np.inf
    disarms_at: float = np.inf
    nan_at: float = np.inf
    back_at: float = np.inf
    ahead_at: float = np.inf
    forceless_at: float = np.inf
    old: str = ""
    refuses: bool = False
    mute: bool = False
    numbers: dict[str, float] = field(default_factory=dict)
    armed: bool = True
    landed: bool = False
    odometry: bool = True
    attitudes: bool = False
    autopilot: int = 12
    place: tuple[float, float, float] = (3.0, -2.0, -5.0)
    heading: float = 0.7
    offboard: bool = False
    secrets: tuple[str, ...] = ()
    seen: list[str] = field(default_factory=list)
    setpoints: list[float] = field(default_factory=list)
    path: list[np.ndarray] = field(default_factory=list)
    modes: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)

    def __enter__(self) -> StandIn:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.setblocking(False)
        self.p, self.v = np.array(self.place, dtype=float), np.zeros(3)
        c, s = np.cos(self.heading), np.sin(self.heading)
        self.R, self.w = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]), np.zeros(3)
        self.rates, self.thrust = np.zeros(3), self.hover
        self._sequence, self._stop, self._since = 0, threading.Event(), np.inf
        self._parser = mavlink.Parser(datagrams=True)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(2.0)
        self._socket.close()

    def _send(self, name: str, **fields: object) -> None:
        frame = mavlink.pack(
            name, sequence=self._sequence, system=7, component=1, **fields
        )
        self._sequence += 1
        if self.old and (frame := version_1(frame)) is None:
            return
        with contextlib.suppress(OSError):
            self._socket.sendto(frame, ("127.0.0.1", self.port))

    def _run(self) -> None:
        begun, steps, dt = time.monotonic(), 0, 0.004
        while not self._stop.is_set():
            steps += 1
            late = begun + steps * dt - time.monotonic()
            if late > 0:
                time.sleep(late)
            now = 500.0 + steps * dt
            self._read(now)
            self._integrate(dt)
            since = now - self._since if self.offboard else -1.0
            if since < self.silent_at:
                shift = 1000.0 * (since >= self.ahead_at) - 100.0 * (
                    since >= self.back_at
                )
                self._report(steps, now + shift, since)
            if since >= self.leaves_at:
                self.offboard, self._since = False, np.inf
                self.modes.append("left")

    def _integrate(self, dt: float) -> None:
        """Move on by a step: in hold mode it stays where it is."""
        if not self.offboard:
            self.v[:], self.w[:] = 0.0, 0.0
            return
        self.w += self.bandwidth * (self.rates - self.w) * dt
        self.R = turned(self.R, self.w * dt)
        force = -GRAVITY * self.thrust / self.hover
        self.v += (self.R[:, 2] * force + np.array([0, 0, GRAVITY])) * dt
        self.p += self.v * dt
        self.path.append(self.p.copy())

    def _report(self, steps: int, now: float, since: float) -> None:
        x, y, z = (float(c) for c in self.p)
        vx, vy, vz = (float(c) for c in self.v)
        p, q, r = (float(c) for c in self.w)
        x = np.nan if since >= self.nan_at else x
        attitude = quaternion_of(self.R)
        if self.odometry:
            self._send(
                "ODOMETRY",
                time_usec=round(now * 1e6),
                frame_id=1,
                child_frame_id=1,
                x=x,
                y=y,
                z=z,
                q=attitude,
                vx=vx,
                vy=vy,
                vz=vz,
                rollspeed=p,
                pitchspeed=q,
                yawspeed=r,
            )
        elif steps % 5 == 0:
            self._send(
                "LOCAL_POSITION_NED",
                time_boot_ms=round(now * 1e3),
                x=x,
                y=y,
                z=z,
                vx=vx,
                vy=vy,
                vz=vz,
            )
        if self.attitudes or not self.odometry:
            names = dict(zip(("q1", "q2", "q3", "q4"), attitude, strict=True))
            self._send(
                "ATTITUDE_QUATERNION",
                time_boot_ms=round(now * 1e3),
                rollspeed=p,
                pitchspeed=q,
                yawspeed=r,
                **names,
            )
        if since < self.forceless_at:
            share = self.thrust / self.hover if self.offboard else 1.0
            self._send("HIGHRES_IMU", zacc=-GRAVITY * share)
        if steps % 25 == 0 and not (self.mute and self.offboard):
            armed = self.armed and since < self.disarms_at
            mode = PX4_OFFBOARD if self.offboard else PX4_HOLD
            self._send(
                "HEARTBEAT",
                type=2,
                autopilot=self.autopilot,
                base_mode=128 * armed,
                custom_mode=mode,
            )
            self._send("EXTENDED_SYS_STATE", landed_state=1 if self.landed else 2)

    def _read(self, now: float) -> None:
        with contextlib.suppress(BlockingIOError, ConnectionError):
            while True:
                for message in self._parser.feed(self._socket.recv(65536)):
                    self._hear(message, now)

    def _hear(self, m: mavlink.Message, now: float) -> None:
        self.seen.append(m.name)
        self.old = "" if self.old == "first" else self.old
        if m.name == "SET_ATTITUDE_TARGET":
            self.rates = np.array(
                [m["body_roll_rate"], m["body_pitch_rate"], m["body_yaw_rate"]]
            )
            self.thrust = m["thrust"]
            self.setpoints.append(now)
        elif m.name == "TIMESYNC" and not m["tc1"]:
            self._send("TIMESYNC", tc1=round(now * 1e9), ts1=m["ts1"])
        elif m.name == "PARAM_REQUEST_READ":
            values = {"K": 1.0, "P": 0.15, "I": 0.2, "D": 0.003, "M": 0.3}
            value = (
                self.hover
                if "HOVER" in m["param_id"]
                else values.get(m["param_id"][-1], 0.0)
            )
            value = self.numbers.get(m["param_id"], value)
            if m["param_id"] not in self.secrets:
                self._send(
                    "PARAM_VALUE",
                    param_id=m["param_id"],
                    param_value=value,
                    param_type=9,
                )
        elif m.name == "COMMAND_LONG" and m["command"] == 176:
            wants = m["param2"] == 6
            self.asked.append("offboard" if wants else "hold")
            taken = not (wants and self.refuses)
            if taken and wants != self.offboard:
                self.offboard, self._since = wants, now if wants else np.inf
                self.modes.append("offboard" if wants else "hold")
            if self.mute:
                return
            who = {"target_system": m.system, "target_component": m.component}
            self._send("COMMAND_ACK", command=176, result=0 if taken else 1, **who)
