"""ArduPilot in the loop: its JSON physics over UDP in lockstep, set points and state by MAVLink over TCP.

Wire facts (ArduCopter 4.7, its JSON physics): each frame it sends a packet of little-endian numbers: magic 18458 with
16 pulse widths or 29569 with 32, rate, count of frames; it then waits for one line of JSON, whose keys it finds as
substrings, whose time stamps are its clock, and without which it sends the packet again after each second. Axes of the
wire are forward, right, down and north, east, down; ours forward, left, up and north, west, up.
"""

from __future__ import annotations

import contextlib
import math
import shutil
import socket
import struct
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from skyarm.control.controller import Controller
from skyarm.control.model import JointGains, Model
from skyarm.links import mavlink
from skyarm.links.autopilots.ardupilot_frames import fitting_frame, vehicle_parameters
from skyarm.links.autopilots.autopilot import (
    FLIGHT_IMU,
    Autopilot,
    Goal,
    Instant,
    Link,
    LinkError,
    Numbers,
    controller_with,
    model_of,
    plain_parameters,
)
from skyarm.links.autopilots.program import Child, find_program, make_folder
from skyarm.links.sockets import drain
from skyarm.links.transcript import Tape
from skyarm.scenario.scenario_record import Scenario, first_state
from skyarm.sensing.sensor import Sensor
from skyarm.vehicle.vehicle_records import Vehicle

HOME = (47.397742, 8.545594, 488.0)
"""Latitude and longitude (deg) and altitude (m) of the world's origin."""

START = 1_767_225_600
"""s, Unix time at which each flight begins, as ArduPilot's satellites tell it (2026-01-01)."""

LAYOUTS = {18458: struct.Struct("<HHI16H"), 29569: struct.Struct("<HHI32H")}
"""Packet of pulse widths by its magic: magic, rate, count of frames, pulse widths in us."""

PULSES = (1000, 2000)
"""us of no and of full signal; 0 is a channel that is off."""

STRAY = 200
"""us beyond ``PULSES`` at which a pulse width is taken as nonsense."""

SURPLUS = 1e-8
"""Part by which time stamps run ahead: ArduPilot cuts each difference to whole microseconds, and so keeps ours."""

REPEATED = 0.5
"""s by the wall clock; ArduPilot repeats a packet that has no answer after a second."""

AGAIN = 2
"""Times that ArduPilot repeats a packet before its answer is taken as lost."""

GUIDED = 4
"""ArduCopter's mode for set points from outside."""

GROUND_STATION, ARDUPILOT = 6, 3
"""MAVLink's type of a ground station, and its number of ArduPilot."""

WARNING = 4
"""MAVLink's severity of a warning."""

TAKE_OFF, SET_MODE, ARM, SET_INTERVAL = 22, 176, 400, 511
"""MAVLink's commands."""

POSITION_MASK = 0b100_000_000_000
"""Set points of position, velocity, acceleration and yaw; the yaw rate is ignored."""

ESTIMATES, CONSTANT_POSITION = 0b111111, 0b10000000
"""Flags of valid attitude, velocity and position, and of an estimator that takes the position as constant."""

REPLY = 1.0
"""s after which a parameter that ArduPilot was asked for, and did not tell, is one that it does not know."""

ASK, REQUEST = 0.5, 5.0
"""s until ArduPilot is asked again: for its mode and arming, and for messages and to take off."""

ABSENCE = 3.0
"""s out of guided mode, in flight, after which the flight is over."""

SETTLED = 3.0
"""s of valid estimates after which ArduPilot's local origin is known and it is asked to arm."""


PHYSICS_LINE = (
    '\n{"timestamp":%r,"imu":{"gyro":[%.9g,%.9g,%.9g],"accel_body":[%.9g,%.9g,%.9g]},"position":[%r,%r,%r],'
    '"quaternion":[%.9g,%.9g,%.9g,%.9g],"velocity":[%.9g,%.9g,%.9g],"no_time_sync":1}\n'
)
"""Answer to a frame; ArduPilot finds a key by the first place of its letters."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ArduPilot(Autopilot):
    """ArduPilot's copter on our plant: its parameters follow from rotors and vehicle.

    It reads our inertial unit; its satellite receiver, barometer and magnetometer it makes itself, with its own errors,
    from the true position, velocity and attitude that its physics port asks for: a sensor model on the plant's side.

    Two flights of the same program are equal to the bit: the program waits for each answer, its clock is ours, and
    what it is told by MAVLink lies in its socket before the answer of the same frame.
    """

    preparation: float = 150.0

    name: ClassVar[str] = "ardupilot"
    title: ClassVar[str] = "ArduPilot"
    variable: ClassVar[str] = "SKYARM_ARDUPILOT"
    least_rate: ClassVar[int] = 800

    def sensors(self, vehicle: Vehicle) -> Mapping[str, Sensor]:
        """Inertial unit at the rate of the link."""
        return {"imu": FLIGHT_IMU}

    def connect(self, scenario: Scenario, tape: Tape) -> ArduPilotLink:
        """Start ArduPilot with the vehicle's parameters and wait for its first frame."""
        return ArduPilotLink(self, scenario, tape)


def make_ardupilot(
    model: Model,
    *,
    program: str = "",
    parameters: Any = None,
    joint_gains: JointGains | None = None,
    climb: float = 0.5,
    patience: float = 20.0,
    preparation: float = 150.0,
    transcript: str = "",
    replayed: str = "",
) -> Controller:
    """Controller of a vehicle whose base ArduPilot flies; the options are those of :class:`ArduPilot`."""
    autopilot = ArduPilot(
        program=program, parameters=plain_parameters(parameters), climb=climb, patience=patience,
        preparation=preparation, transcript=transcript, replayed=replayed,
    )  # fmt: skip
    return controller_with(autopilot, model, joint_gains)


def physics_line(time: float, imu: Numbers, state: Numbers) -> bytes:
    """Line of JSON that answers a frame: time, inertial unit and true state in ArduPilot's axes.

    Args:
        time: s, of ArduPilot's clock.
        imu: time, rate (rad/s) and specific force (m/s^2) in base axes.
        state: position, quaternion and velocity, then what is not used, in the order of :class:`skyarm.dynamics.State`.
    """
    _, p, q, r, fx, fy, fz = imu
    x, y, z, qw, qx, qy, qz, vx, vy, vz = state[:10]
    numbers = (time, p, -q, -r, fx, -fy, -fz, x, -y, -z, qw, qx, -qy, -qz, vx, -vy, -vz)
    return (PHYSICS_LINE % numbers).encode("ascii")


class ArduPilotLink(Link):
    """Connection to a running ArduPilot: its process, the physics' datagrams, and a MAVLink stream."""

    def __init__(self, record: ArduPilot, scenario: Scenario, tape: Tape) -> None:
        self._record, self._tape = record, tape
        model, rate = model_of(scenario), scenario.rates.control
        self._motors = fitting_frame(model.vehicle)[1]
        self._period, self._goal_every = 1.0 / rate, max(1, rate // 50)
        self._steps = self._sequence = self._repeated = self._away = 0
        self._frame, self._arrived = -1, 0.0
        self._line = b""
        self._signals: Numbers = (0.0,) * len(self._motors)
        self._parser = mavlink.Parser()
        self._said, self._armed, self._ready, self._mode, self._heard = "", False, False, -1, False
        self._next = 0.0
        self._unread, self._read_asked = dict(record.parameters), -1.0
        self._place: tuple[float, float, float] | None = None
        self._differences: list[tuple[float, ...]] = []
        self._offset: tuple[float, ...] | None = None
        start = first_state(scenario)
        self._stand = float(start.position.z) - record.climb
        self._planned = (float(start.position.x), float(start.position.y), self._stand)
        self._out_of_mode = 0.0
        heading = -math.degrees(2.0 * math.atan2(float(start.quaternion.z), float(start.quaternion.w)))
        parameters = vehicle_parameters(model.vehicle, float(model.gravity))
        parameters |= {"SIM_RATE_HZ": rate, "LOG_BACKEND_TYPE": 0} | dict(record.parameters)
        self._child: Child | None = None
        self._folder: Path | None = None
        self._udp: socket.socket | None = None
        self._tcp: socket.socket | None = None
        self._peer: Any = None
        if not tape.plays:
            self._start(parameters, heading % 360.0, rate)
        try:
            self._await()
        except BaseException:
            self.close()
            raise

    def _start(self, parameters: Mapping[str, float], heading: float, rate: int) -> None:
        """Open ports that are free, start the program on them, and accept its connection."""
        record = self._record
        program = find_program(record, "arducopter")
        self._udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        listener = socket.socket()
        try:
            self._udp.bind(("127.0.0.1", 0))
            self._udp.settimeout(0.2)
            listener.bind(("127.0.0.1", 0))
            listener.listen(1)
            self._folder = folder = make_folder(record)
            defaults = folder / "vehicle.parm"
            defaults.write_text(
                "".join(f"{name} {value:.9g}\n" for name, value in parameters.items()), encoding="ascii"
            )
            place = ",".join(f"{each:.9g}" for each in (*HOME, heading))
            command = [
                str(program), "--model", "JSON:127.0.0.1", "--home", place, "--defaults", str(defaults),
                "--rate", str(rate), "--start-time", str(START), "--sim-address", "127.0.0.1",
                "--sim-port-out", str(self._udp.getsockname()[1]), "--rc-in-port", str(_free_port()),
                "--serial0", f"tcpclient:127.0.0.1:{listener.getsockname()[1]}", "--serial1", "none:1",
                "--serial2", "none:2",
            ]  # fmt: skip
            self._child = Child(command, folder)
            listener.settimeout(0.2)
            until = time.monotonic() + record.patience
            while self._tcp is None:
                with contextlib.suppress(TimeoutError):
                    self._tcp = listener.accept()[0]
                if self._tcp is None and not self._child.running:
                    raise LinkError(f"ArduPilot ended while it started: {self._child.last_words}")
                if self._tcp is None and time.monotonic() > until:
                    raise LinkError(f"ArduPilot does not connect for MAVLink{self._ending}")
            self._tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._tcp.setblocking(False)
        except OSError as error:
            self.close()
            raise LinkError(f"ArduPilot cannot be started: {error.strerror or error}") from None
        except BaseException:
            self.close()
            raise
        finally:
            listener.close()

    @property
    def facts(self) -> dict[str, Any]:
        """Frames that were answered, those that were repeated, and the last warning."""
        return {
            "steps": self._steps,
            "answered": self._frame,
            "repeated": self._repeated,
            "left_guided": self._away,
            "said": self._said,
            "bad_frames": self._parser.bad,
        }

    @property
    def _ending(self) -> str:
        words = self._child.last_words if self._child is not None else ""
        return f" ({words})" if words else ""

    def exchange(self, now: Instant, goal: Goal) -> Numbers:
        """Answer the frame that ArduPilot waits in, and wait for the signals of its next one."""
        self._steps += 1
        if self._steps % self._goal_every == 0:
            self._talk(now, goal)
        stamp = round((now.time + self._period) * 1e6) * 1e-6
        self._line = physics_line(stamp * (1.0 + SURPLUS), now.readings["imu"], now.state)
        self._tape.send("physics", self._line, self._answer)
        self._await()
        return self._signals

    def _answer(self, line: bytes) -> None:
        """Send a line, after removing copies of the packet that it answers, which a pause of ours has called for."""
        assert self._udp is not None
        if time.monotonic() - self._arrived > REPEATED:
            self._udp.setblocking(False)
            with contextlib.suppress(ConnectionError):
                self._repeated += len(drain(self._udp))
            self._udp.settimeout(0.2)
        self._send_line(line)

    def _send_line(self, line: bytes) -> None:
        assert self._udp is not None
        try:
            self._udp.send(line)
        except OSError as error:
            raise LinkError(f"ArduPilot is gone: {error.strerror or error}{self._ending}") from None

    def _await(self) -> None:
        """Wait for the next frame's packet and take its signals.

        Raises:
            LinkError: silence, or a packet that is not the next one.
        """
        packet = self._tape.receive("physics", self._next_packet)
        pulses = self._decode(packet)
        signals = []
        for place in self._motors:
            pulse = pulses[place]
            if pulse and not PULSES[0] - STRAY <= pulse <= PULSES[1] + STRAY:
                raise LinkError(
                    f"ArduPilot sent motor {place + 1} a pulse of {pulse} us: must be {PULSES[0]} to {PULSES[1]}"
                )
            signals.append(min(max((pulse - PULSES[0]) / (PULSES[1] - PULSES[0]), 0.0), 1.0))
        self._signals = signals

    def _decode(self, packet: bytes) -> tuple[int, ...]:
        """Pulse widths of the next frame's packet."""
        layout = _layout(packet)
        if layout is None:
            raise LinkError(f"ArduPilot's physics port got {len(packet)} bytes that are no packet of pulse widths")
        _, _, count, *pulses = layout.unpack(packet)
        if count != self._frame + 1:
            what = "started again" if count <= self._frame else "skipped frames"
            raise LinkError(f"ArduPilot {what}: frame {count} came in place of frame {self._frame + 1}")
        self._frame = count
        return tuple(pulses)

    def _next_packet(self) -> bytes:
        """Packet of another frame than the last; the line is sent again where the last one keeps being repeated."""
        assert self._udp is not None
        until, repeats = time.monotonic() + self._record.patience, 0
        while True:
            try:
                packet, sender = self._udp.recvfrom(2048)
            except TimeoutError:
                packet = b""
            except OSError as error:
                raise LinkError(f"ArduPilot is gone: {error.strerror or error}{self._ending}") from None
            if packet and self._peer is None:
                if _layout(packet) is None:
                    packet = b""  # of another program: nobody is known yet
                else:
                    self._peer = sender
                    self._udp.connect(sender)
            if packet and (self._frame < 0 or packet[4:8] != self._frame.to_bytes(4, "little")):
                self._arrived = time.monotonic()
                return packet
            if packet:
                self._repeated += 1
                repeats += 1
                if repeats % AGAIN == 0:
                    self._send_line(self._line)
            elif self._child is not None and not self._child.running:
                raise LinkError(f"ArduPilot ended{self._ending}")
            if time.monotonic() > until:
                raise LinkError(f"ArduPilot has not answered for {self._record.patience:g} s{self._ending}")

    def _talk(self, now: Instant, goal: Goal) -> None:
        """Read ArduPilot's state, send the set point, and ask for what is next."""
        for message in self._parser.feed(self._tape.receive("mavlink", self._stream)):
            if message.system == 1 and message.component == 1:
                self._hear(message)
        t = now.time
        if self._steps % (50 * self._goal_every) == 0:
            self._tell("HEARTBEAT", type=GROUND_STATION, autopilot=8, system_status=4, mavlink_version=3)
        if self._offset is None:
            self._find_origin()
        if self.following:
            self._send_goal(t, goal)
            if not self._armed:
                raise LinkError(f"ArduPilot disarmed in flight: {self._said}")
            self._watch()
        if t >= self._next and self._heard:
            self._next = t + ASK
            self._ask(t)

    def _watch(self) -> None:
        """End a flight in which ArduPilot has left guided mode and does not come back."""
        if self._mode == GUIDED:
            self._out_of_mode = 0.0
            return
        self._away += self._out_of_mode == 0.0
        self._out_of_mode += self._goal_every * self._period
        if self._out_of_mode > ABSENCE:
            said = f": {self._said}" if self._said else ""
            raise LinkError(f"ArduPilot left guided mode for its mode {self._mode}{said}")

    def _ask(self, t: float) -> None:
        """Ask for what is next: messages, guided mode, stated parameters, arming, take-off."""
        if self._place is None:
            self._next = t + REQUEST
            for number, rate in ((32, 50), (193, 10)):  # LOCAL_POSITION_NED, EKF_STATUS_REPORT
                self._command(SET_INTERVAL, number, 1e6 / rate)
        elif self._offset is None:
            return
        elif self._mode != GUIDED:
            self._command(SET_MODE, 1, GUIDED)
        elif self._unread:
            self._read_parameters(t)
        elif not self._armed:
            self._command(ARM, 1)
        elif not self.following:
            self._next = t + REQUEST
            self._command(TAKE_OFF, 0, 0, 0, 0, 0, 0, self._record.climb)

    def _stream(self) -> bytes:
        """Bytes of the MAVLink stream that have arrived; empty if none."""
        assert self._tcp is not None
        try:
            found = [data for data, _ in drain(self._tcp)]
        except OSError as error:
            raise LinkError(f"ArduPilot is gone: {error.strerror or error}{self._ending}") from None
        if found and not found[-1]:
            raise LinkError(f"ArduPilot closed its MAVLink connection{self._ending}")
        return b"".join(found)

    def _find_origin(self) -> None:
        """Find where ArduPilot's local origin lies: the mean difference of its position and the stand's."""
        if self._place is None or not self._ready or self._armed:
            self._differences.clear()
            return
        self._differences.append(tuple(a - b for a, b in zip(self._place, self._planned, strict=True)))
        if len(self._differences) * self._goal_every * self._period >= SETTLED:
            half = self._differences[len(self._differences) // 2 :]
            self._offset = tuple(sum(column) / len(half) for column in zip(*half, strict=True))
            self._next = 0.0

    def _send_goal(self, t: float, goal: Goal) -> None:
        """Send a set point of position, velocity, acceleration and yaw in ArduPilot's local frame."""
        assert self._offset is not None
        x, y, z = (a + b for a, b in zip(goal.position, self._offset, strict=True))
        vx, vy, vz = goal.velocity
        ax, ay, az = goal.acceleration
        self._tell(
            "SET_POSITION_TARGET_LOCAL_NED", time_boot_ms=round(t * 1e3), target_system=1, target_component=1,
            coordinate_frame=1, type_mask=POSITION_MASK, x=x, y=-y, z=-z, vx=vx, vy=-vy, vz=-vz, afx=ax, afy=-ay,
            afz=-az, yaw=-goal.yaw,
        )  # fmt: skip

    def _command(self, number: int, *values: float) -> None:
        """Send COMMAND_LONG."""
        params = {f"param{i + 1}": float(value) for i, value in enumerate(values)}
        self._tell("COMMAND_LONG", target_system=1, target_component=1, command=number, **params)

    def _tell(self, name: str, **fields: Any) -> None:
        """Send a message over the MAVLink stream."""
        try:
            frame = mavlink.pack(name, sequence=self._sequence & 255, system=255, component=190, **fields)
        except mavlink.MavlinkError as error:
            raise LinkError(f"a set point cannot be sent to ArduPilot: {error}") from None
        self._sequence += 1
        self._tape.send("mavlink", frame, self._write)

    def _write(self, data: bytes) -> None:
        assert self._tcp is not None
        try:
            self._tcp.settimeout(self._record.patience)
            self._tcp.sendall(data)
            self._tcp.setblocking(False)
        except TimeoutError:
            raise LinkError(f"ArduPilot has read nothing for {self._record.patience:g} s{self._ending}") from None
        except OSError as error:
            raise LinkError(f"ArduPilot is gone: {error.strerror or error}{self._ending}") from None

    def _hear(self, message: mavlink.Message) -> None:
        """Take note of ArduPilot's mode, arming, estimates, place and words."""
        if message.name == "HEARTBEAT" and message["autopilot"] == ARDUPILOT:
            self._heard, self._mode, self._armed = True, message["custom_mode"], bool(message["base_mode"] & 128)
        elif message.name == "LOCAL_POSITION_NED":
            self._place = (message["x"], -message["y"], -message["z"])
            if self._offset is not None and self._armed and not self.following:
                rise = self._place[2] - self._offset[2] - self._stand
                self.following = rise > 0.5 * self._record.climb
                self._next = 0.0 if self.following else self._next
        elif message.name == "STATUSTEXT" and message["severity"] <= WARNING:
            self._said = message["text"]
        elif message.name == "PARAM_VALUE":
            self._compare(message["param_id"], message["param_value"])
        elif message.name == "EKF_STATUS_REPORT":
            flags = message["flags"]
            self._ready = flags & ESTIMATES == ESTIMATES and not flags & CONSTANT_POSITION

    def _read_parameters(self, t: float) -> None:
        """Ask once for the stated parameters; refuse one that ArduPilot, which skips it in silence, does not tell."""
        if self._read_asked < 0.0:
            self._read_asked = t
            for name in self._unread:
                self._tell("PARAM_REQUEST_READ", target_system=1, target_component=1, param_index=-1, param_id=name)
        elif t - self._read_asked > REPLY:
            raise LinkError(
                f"controller.parameters.{next(iter(self._unread))}: must be a parameter that ArduPilot knows"
            )

    def _compare(self, name: str, value: float) -> None:
        """Compare a received parameter with the stated one."""
        stated = self._unread.pop(name, None)
        if stated is not None and not math.isclose(value, stated, rel_tol=1e-5, abs_tol=1e-6):
            raise LinkError(f"controller.parameters.{name} = {stated:g}: is {value:g} in ArduPilot")

    def close(self) -> None:
        """Close the ports, and end the program; a second call does nothing."""
        for each in (self._tcp, self._udp):
            if each is not None:
                each.close()
        if self._child is not None:
            self._child.close()
        elif self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)


def _layout(packet: bytes) -> struct.Struct | None:
    """Layout of a packet of pulse widths; None for bytes that are none."""
    layout = LAYOUTS.get(int.from_bytes(packet[:2], "little"))
    return layout if layout is not None and len(packet) == layout.size else None


def _free_port() -> int:
    """Free UDP port, for the radio control's port, which ArduPilot opens although no radio is there."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
