"""ArduPilot in the loop: its JSON physics over UDP in lockstep, set points and state by
MAVLink over TCP.

Wire facts (ArduCopter 4.7, its JSON physics): each frame it sends a packet of
little-endian numbers: magic 18458 with 16 pulse widths or 29569 with 32, rate, count of
frames; it then waits for one line of JSON, whose keys it finds as substrings, whose
time stamps are its clock, and without which it sends the packet again after each
second. Axes of the wire are forward, right, down and north, east, down; ours forward,
left, up and north, west, up.
"""

from __future__ import annotations

import contextlib
import math
import socket
import struct
import time
from collections.abc import Mapping
from typing import ClassVar

from skyarm.algebra.frames import to_our_attitude, to_our_axes
from skyarm.control.blocks.geometric import yaw_of
from skyarm.links import mavlink
from skyarm.links.autopilots.ardupilot_frames import (
    fitting_frame,
    rate_bandwidths,
    vehicle_parameters,
)
from skyarm.links.autopilots.autopilot import (
    FLIGHT_IMU,
    Autopilot,
    AutopilotMaker,
    BaseGoal,
    LinkError,
    Numbers,
    Preparation,
    SensedInstant,
    place_parameters,
)
from skyarm.links.autopilots.guided_vehicle import GuidedVehicle
from skyarm.links.autopilots.program import ProgramLink, find_program
from skyarm.links.autopilots.px4_ports import JOINT_PORT, ONBOARD_PORT
from skyarm.links.mavlink_vehicle import ARDUPILOT_NUMBER, ARM, TAKE_OFF
from skyarm.links.sockets import Address, drain, open_datagrams
from skyarm.links.transcript import Tape
from skyarm.records.immutable import immutable
from skyarm.records.plain import Plain
from skyarm.scenario.scenario_record import Scenario, first_state
from skyarm.sensing.sensor import Sensor
from skyarm.vehicle import Vehicle

HOME = (47.397742, 8.545594, 488.0)
"""Latitude and longitude (deg) and altitude (m) of the world's origin: the same place
as under PX4."""

START = 1_767_225_600
"""Unix time (s) at which each flight begins, as ArduPilot's satellites report it
(2026-01-01)."""

LAYOUTS = {18458: struct.Struct("<HHI16H"), 29569: struct.Struct("<HHI32H")}
"""Layout of a packet of pulse widths by its magic number: magic, rate, count of frames,
pulse widths (us)."""

PULSES = (1000, 2000)
"""Pulse widths (us) of zero and of full signal; 0 is a channel that is off."""

STRAY = 200
"""Distance (us) beyond ``PULSES`` from which a pulse width is invalid."""

SURPLUS = 1e-8
"""Relative lead of the time stamps; ArduPilot truncates each difference to whole
microseconds and then keeps our clock."""

REPEATED = 0.5
"""Wall-clock time (s) of silence before an answer is repeated; ArduPilot repeats an
unanswered packet after a second."""

AGAIN = 2
"""Number of repetitions of a packet by ArduPilot after which its answer counts as
lost."""

ESTIMATES, CONSTANT_POSITION = 0b111111, 0b10000000
"""Flags of valid attitude, velocity and position, and of an estimator that assumes a
constant position."""

REPLY = 3.0
"""Time (s) of silence after which a requested parameter counts as unknown to
ArduPilot."""

ASK, REQUEST = 0.5, 5.0
"""Time (s) until a request to ArduPilot is repeated: for mode and arming, and for
messages and take-off."""

SETTLED = 3.0
"""Time (s) of valid estimates after which ArduPilot's local origin is known and arming
is requested."""


PHYSICS_LINE = (
    '\n{"timestamp":%r,"imu":{"gyro":[%.9g,%.9g,%.9g],"accel_body":[%.9g,%.9g,%.9g]},"position":[%r,%r,%r],'
    '"quaternion":[%.9g,%.9g,%.9g,%.9g],"velocity":[%.9g,%.9g,%.9g],"no_time_sync":1}\n'
)
"""Answer to a frame; ArduPilot finds a key by the first occurrence of its letters, and
reads ``no_time_sync`` as a whole number: ``true`` would count as 0."""


OUTSIDE_PARAMETERS = {
    "GUID_OPTIONS": 8,
    "GUID_TIMEOUT": 0.2,
    "SERIAL1_PROTOCOL": 2,
    "ATC_RAT_YAW_FLTE": 0,
    "ATC_ACCEL_R_MAX": 0,
    "ATC_ACCEL_P_MAX": 0,
    "ATC_ACCEL_Y_MAX": 0,
    "ATC_ANGLE_BOOST": 0,
}
"""Parameters for an external law: a set point's thrust is a thrust; level after so many
s without set points; MAVLink 2; no filters of yaw and no slewing of rates, behind which
a law's control oscillates; no division of the thrust by the cosine of the tilt
(AC_AttitudeControl_Multi, get_throttle_boosted), which a law's thrust contains."""


@immutable
class ArduPilot(Autopilot):
    """ArduPilot flying a simulated vehicle: its parameters are computed from the rotors
    and the vehicle.

    It reads our inertial unit; its satellite receiver, barometer and magnetometer it
    makes itself, with its own errors, from the true position, velocity and attitude
    that its physics port asks for: a sensor model on the plant's side.

    Two flights of the same program are equal to the bit: the program waits for each
    answer, its clock is ours, and what it is told by MAVLink lies in its socket before
    the answer of the same frame.
    """

    preparation: Preparation = 150.0

    name: ClassVar[str] = "ardupilot"
    title: ClassVar[str] = "ArduPilot"
    variable: ClassVar[str] = "SKYARM_ARDUPILOT"
    # it does not arm while its gyroscope is read at less than 1.8 times the rate of its
    # loop of 400 Hz
    least_rate: ClassVar[int] = 800

    def sensors(self, vehicle: Vehicle) -> Mapping[str, Sensor]:
        """Inertial measurement unit that ArduPilot reads, sampled at the rate of its
        simulator link.
        """
        return {"imu": FLIGHT_IMU}

    @property
    def outside_ports(self) -> tuple[int, int]:
        """UDP ports for an external program: ArduPilot's second MAVLink stream, and the
        joint port.
        """
        return ONBOARD_PORT, JOINT_PORT

    def outside_options(self, vehicle: Vehicle) -> str:
        """Command-line option with the bandwidth of the rate loop, which ArduPilot's
        parameters do not state.
        """
        return " --rate-bandwidth " + ",".join(
            f"{each:.3g}" for each in rate_bandwidths(vehicle)
        )

    def connect(self, scenario: Scenario, tape: Tape) -> ArduPilotLink:
        """Start ArduPilot with the vehicle's parameters and wait for its first
        frame.
        """
        return ArduPilotLink(self, scenario, tape)


make_ardupilot = AutopilotMaker(ArduPilot)


def physics_line(time: float, imu: Numbers, state: Numbers) -> bytes:
    """JSON line that answers ArduPilot's physics frame: time, inertial readings and
    true state in ArduPilot's axes.

    Args:
        time: s, of ArduPilot's clock.
        imu: time, rate (rad/s) and specific force (m/s^2) in base axes.
        state: position, quaternion and velocity, then what is not used, in the order of
            :class:`skyarm.dynamics.State`.
    """
    w, x, y, z = state[3:7]
    numbers = (
        time,
        *to_our_axes(*imu[1:4]),
        *to_our_axes(*imu[4:7]),
        *to_our_axes(*state[0:3]),
        *to_our_attitude(w, x, y, z),
        *to_our_axes(*state[7:10]),
    )
    return (PHYSICS_LINE % numbers).encode("ascii")


class ArduPilotLink(ProgramLink):
    """Connection to a running ArduPilot: its process, the physics' datagrams, and a
    MAVLink stream.
    """

    def __init__(self, record: ArduPilot, scenario: Scenario, tape: Tape) -> None:
        super().__init__(record, scenario, tape)
        model, rate = scenario.agent.model, scenario.rates.control
        self._motors = fitting_frame(model.vehicle)[1]
        # MAVLink is exchanged at 50 Hz, the rate of the requested position messages
        self._period, self._goal_every = 1.0 / rate, max(1, rate // 50)
        self._repeated = 0
        self._frame, self._arrived = -1, 0.0
        self._line = b""
        self._vehicle = GuidedVehicle(
            ARDUPILOT_NUMBER, self._carry, record.parameters, system=1
        )
        self._ready, self._leaves, self._next = False, False, 0.0
        start = first_state(scenario)
        self._planned = (float(start.position.x), float(start.position.y), self._stand)
        # yaw is positive to the left here, a heading to the right
        heading = -math.degrees(yaw_of(start.quaternion))
        parameters = vehicle_parameters(model.vehicle, float(model.gravity))
        # a type of log of 0 is none: ArduPilot writes no log of its own
        parameters |= {
            "SIM_RATE_HZ": rate,
            "LOG_BACKEND_TYPE": 0,
            **place_parameters(scenario, "INS_POS1_"),
        }
        # the user's own parameters come last, so that they prevail
        parameters |= (OUTSIDE_PARAMETERS if record.outside else {}) | dict(
            record.parameters
        )
        self._udp: socket.socket | None = None
        self._peer: Address | None = None
        with self._starting():
            if not tape.plays:
                self._start(parameters, heading % 360.0, rate)
            self._await()

    def _start(
        self, parameters: Mapping[str, float], heading: float, rate: int
    ) -> None:
        """Open free ports, start ArduPilot on them, and accept its connection."""
        program = find_program(self._record, "arducopter")
        self._udp = self._held.enter_context(open_datagrams())
        with socket.create_server(("127.0.0.1", 0)) as listener:
            folder = self._make_folder()
            defaults = folder / "vehicle.parm"
            defaults.write_text(
                "".join(f"{name} {value:.9g}\n" for name, value in parameters.items()),
                encoding="ascii",
            )
            place = ",".join(f"{each:.9g}" for each in (*HOME, heading))
            command = [
                str(program),
                "--model",
                "JSON:127.0.0.1",
                "--home",
                place,
                "--defaults",
                str(defaults),
                "--rate",
                str(rate),
                "--start-time",
                str(START),
                "--sim-address",
                "127.0.0.1",
                "--sim-port-out",
                str(self._udp.getsockname()[1]),
                "--rc-in-port",
                str(_free_port()),
                "--serial0",
                f"tcpclient:127.0.0.1:{listener.getsockname()[1]}",
                # else it opens TCP ports 5762 and 5763, too
                "--serial1",
                (
                    f"udpclient:127.0.0.1:{ONBOARD_PORT}"
                    if self._record.outside
                    else "none:1"
                ),
                "--serial2",
                "none:2",
            ]
            self._launch(command, folder)
            self._tcp = self._accept(listener)

    def release(self) -> None:
        """Request ArduPilot's hold mode; set points then come from an external
        program.
        """
        self._leaves = True

    @property
    def facts(self) -> dict[str, Plain]:
        """Counts of the exchange with ArduPilot (steps, answered and repeated frames)
        and its last message.
        """
        return {
            "steps": self._steps,
            "answered": self._frame,
            "repeated": self._repeated,
            "left_guided": self._vehicle.away,
            "said": self._vehicle.said,
            "bad_frames": self._vehicle.parser.bad,
        }

    def exchange(self, now: SensedInstant, goal: BaseGoal) -> Numbers:
        """Answer the physics frame for which ArduPilot waits, and wait for the rotor
        signals of its next frame.
        """
        self._steps += 1
        if self._steps % self._goal_every == 0:
            self._talk(now, goal)
        # the answer moves the clock by one period: its stamp is that of the next
        # instant, a whole number of microseconds
        stamp = round((now.time + self._period) * 1e6) * 1e-6
        self._line = physics_line(
            stamp * (1.0 + SURPLUS), now.readings["imu"], now.state
        )
        self._tape.send("physics", self._line, self._answer)
        self._await()
        return self._signals

    def _answer(self, line: bytes) -> None:
        """Send the JSON answer to a physics frame, after discarding repeated copies of
        that frame.
        """
        assert self._udp is not None
        if time.monotonic() - self._arrived > REPEATED:
            # a program that is gone is noticed where the answer is sent
            with contextlib.suppress(ConnectionError):
                self._repeated += len(drain(self._udp))
        self._send_line(line)

    def _send_line(self, line: bytes) -> None:
        assert self._udp is not None
        try:
            self._udp.send(line)
        except OSError as error:
            raise self._port_error(error) from None

    def _await(self) -> None:
        """Wait for ArduPilot's next packet and convert its pulse widths to rotor
        signals.

        Raises:
            LinkError: silence, or a packet that is not the next one.
        """
        packet = self._tape.receive("physics", self._next_packet)
        pulses = self._decode(packet)
        signals = []
        for place in self._motors:
            pulse = pulses[place]
            # a pulse of 0 is a channel that is off and no error
            if pulse and not PULSES[0] - STRAY <= pulse <= PULSES[1] + STRAY:
                raise LinkError(
                    f"ArduPilot sent motor {place + 1} a pulse of {pulse} us: must be"
                    f" {PULSES[0]} to {PULSES[1]}"
                )
            signals.append(
                min(max((pulse - PULSES[0]) / (PULSES[1] - PULSES[0]), 0.0), 1.0)
            )
        self._signals = signals

    def _decode(self, packet: bytes) -> tuple[int, ...]:
        """Decode the motor pulse widths in ArduPilot's packet, which must have the next
        frame number.
        """
        layout = _layout(packet)
        if layout is None:
            raise LinkError(
                f"ArduPilot's physics port got {len(packet)} bytes that are no packet"
                " of pulse widths"
            )
        _, _, count, *pulses = layout.unpack(packet)
        # frames count up by one: any other number means a lost frame or a new start,
        # and the flight would go on with another clock
        if count != self._frame + 1:
            what = "started again" if count <= self._frame else "skipped frames"
            raise LinkError(
                f"ArduPilot {what}: frame {count} came in place of frame"
                f" {self._frame + 1}"
            )
        self._frame = count
        return tuple(pulses)

    def _next_packet(self) -> bytes:
        """Wait for a packet with a new frame number; resend the last answer if
        ArduPilot keeps repeating its frame.
        """
        assert self._udp is not None
        # short, chosen: a program that has ended is noticed soon
        self._udp.settimeout(0.2)
        until, repeats = time.monotonic() + self._record.patience, 0
        while True:
            try:
                # more than either layout has, 40 and 72 bytes: a longer one shows
                packet, sender = self._udp.recvfrom(2048)
            except TimeoutError:
                packet = b""
            except OSError as error:
                raise self._port_error(error) from None
            if packet and self._peer is None:
                if _layout(packet) is None:
                    packet = b""  # of another program: nobody is known yet
                else:
                    # connected, the socket takes datagrams of this sender only
                    self._peer = sender
                    self._udp.connect(sender)
            # bytes 4 to 8 hold the count of frames
            if packet and (
                self._frame < 0 or packet[4:8] != self._frame.to_bytes(4, "little")
            ):
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
                raise LinkError(
                    f"ArduPilot has not answered for {self._record.patience:g}"
                    f" s{self._ending}"
                )

    def _talk(self, now: SensedInstant, goal: BaseGoal) -> None:
        """Exchange MAVLink with ArduPilot: read its state, send the set point, request
        the next take-off step.
        """
        vehicle, t = self._vehicle, now.time
        for message in vehicle.parser.feed(self._tape.receive("mavlink", self._stream)):
            self._hear(message)
        # once a second, as set points go out at 50 Hz
        if self._steps % (50 * self._goal_every) == 0:
            vehicle.beat()
        if vehicle.origin is None:
            self._find_origin()
        if self.released:
            if not vehicle.armed:
                raise LinkError("ArduPilot disarmed in flight")
        elif self._leaves:
            self.released = vehicle.holds
        elif self.following:
            vehicle.send_goal(t, goal)
            vehicle.require_obedience(vehicle.armed, self._goal_every * self._period)
        if t >= self._next and vehicle.modes is not None:
            self._next = t + ASK
            self._ask(t)

    def _ask(self, t: float) -> None:
        """Request the next step of ArduPilot's take-off: messages, guided mode,
        parameters, arming, climb.
        """
        vehicle = self._vehicle
        if vehicle.place is None:
            self._next = t + REQUEST
            # rates (Hz) are chosen
            vehicle.request_streams({"LOCAL_POSITION_NED": 50, "EKF_STATUS_REPORT": 10})
        elif self._leaves:
            if not self.released:
                vehicle.request_hold()
        elif vehicle.origin is None:
            return
        elif not vehicle.obeys:
            vehicle.request_outside()
        elif not vehicle.has_parameters(t, REPLY):
            return
        elif not vehicle.armed:
            vehicle.command(ARM, 1)
        elif not self.following:
            self._next = t + REQUEST
            vehicle.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, self._record.climb)

    def _stream(self) -> bytes:
        """Bytes that have arrived over ArduPilot's MAVLink stream; empty if there are
        none.
        """
        assert self._tcp is not None
        try:
            pieces = [data for data, _ in drain(self._tcp)]
        except OSError as error:
            raise self._port_error(error) from None
        if pieces and not pieces[-1]:
            raise self._closing_error()
        return b"".join(pieces)

    def _find_origin(self) -> None:
        """Estimate the origin of ArduPilot's local frame from its mean position on the
        launch stand.
        """
        count = self._vehicle.compare_place(
            self._planned, self._ready and not self._vehicle.armed
        )
        if count * self._goal_every * self._period >= SETTLED:
            # the later half alone, as the estimate settles before it
            self._vehicle.find_origin(count - count // 2)
            self._next = 0.0

    def _carry(self, frame: bytes) -> None:
        """Send a MAVLink frame to ArduPilot."""
        self._tape.send("mavlink", frame, self._write)

    def _hear(self, message: mavlink.Message) -> None:
        """Store ArduPilot's mode, arming state, estimates, position and texts from a
        MAVLink message.
        """
        vehicle = self._vehicle
        if not vehicle.hear(message):
            return
        if message.name == "EKF_STATUS_REPORT":
            flags = message["flags"]
            self._ready = (
                flags & ESTIMATES == ESTIMATES and not flags & CONSTANT_POSITION
            )
        elif (
            # half of the climb, chosen: a vehicle that high has taken off
            vehicle.armed
            and not self.following
            and vehicle.rise(self._stand) > 0.5 * self._record.climb
        ):
            self.following, self._next = True, 0.0


def _layout(packet: bytes) -> struct.Struct | None:
    """Binary layout (``struct``) of ArduPilot's packet of motor pulse widths; None for
    any other bytes.
    """
    layout = LAYOUTS.get(int.from_bytes(packet[:2], "little"))
    return layout if layout is not None and len(packet) == layout.size else None


def _free_port() -> int:
    """Free UDP port for ArduPilot's radio control input, which it opens even without a
    radio.
    """
    with open_datagrams() as probe:
        return int(probe.getsockname()[1])
