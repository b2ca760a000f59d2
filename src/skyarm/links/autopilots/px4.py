"""PX4 in the loop: simulator MAVLink over TCP in lockstep, set points and state over its onboard MAVLink port.

Wire facts (PX4 v1.17, its simulator MAVLink module and start script): PX4 connects to our TCP port 4560 + instance;
each HIL_SENSOR of id 0 sets its clock and is answered by one HIL_ACTUATOR_CONTROLS with the same time; before its
start script has ended it answers only some. The onboard port is UDP 14540 + instance, and PX4's number as a MAVLink
system is 1 + instance.
"""

from __future__ import annotations

import contextlib
import math
import socket
import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from skyarm.control.controller import Controller
from skyarm.control.model import JointGains, Model
from skyarm.links import mavlink
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
from skyarm.links.autopilots.px4_parameters import sensor_parameters, vehicle_parameters
from skyarm.links.autopilots.px4_ports import JOINT_PORT, ONBOARD_PORT, Ports, open_ports
from skyarm.links.autopilots.px4_sensors import SensorMessages
from skyarm.links.sockets import drain
from skyarm.links.transcript import Tape
from skyarm.scenario.scenario_record import Scenario, ScenarioError, first_state
from skyarm.sensing.navigation_sensors import Barometer, Gnss, Magnetometer
from skyarm.sensing.sensor import Sensor
from skyarm.vehicle.vehicle_records import Vehicle

STALL = 1.0
"""s by the wall clock after which a step without an answer is given up: PX4 may drop a sample, as when it selects
another sensor, and would wait for the next one for ever."""

BOOT_STEP = 0.02
"""s by the wall clock between sensor messages until PX4 answers the first."""

OFFBOARD = 6
"""PX4's main mode for set points from outside."""

AUTO, HOLD = 4, 3
"""PX4's main mode of flights by itself, and its sub-mode that holds the place."""

OUTSIDE_PARAMETERS = {"IMU_INTEG_RATE": 250, "COM_OBL_RC_ACT": 5, "COM_RCL_EXCEPT": 7, "MC_YAW_TQ_CUTOFF": 0}
"""PX4 holds its place where set points from outside are missing; it needs no remote control; its yaw torque is not
filtered, since a law's yaw control oscillates behind its usual filter of 2 Hz."""

OFFBOARD_LOSS = 0.15
"""s without set points from outside after which PX4 holds its place; its own 1 s is long for a body rate. During the
take-off, faster than real time, it stays at that."""

REAL = 9
"""MAVLink's type of a parameter that is a 32-bit float."""

GROUND_STATION = 6
"""MAVLink's type of a ground station."""

PX4_AUTOPILOT = 12
"""MAVLink's number of PX4 among autopilots."""

CRITICAL = 5
"""MAVLink's system status of an autopilot in failsafe, and its severity of a notice."""

ARM, SET_MODE = 400, 176
"""MAVLink's commands."""

ARMED, LOCKSTEP = 128, 1
"""Bits of a message's mode, and of its flags."""

POSITION_MASK = 0b100_000_000_000
"""Set points of position, velocity, acceleration and yaw; the yaw rate is ignored."""

ESTIMATED = 0b111
"""Flags of the estimator: attitude, horizontal and vertical velocity."""

SETTLED = 5
"""s of valid estimates after which PX4's local origin is known and it is asked to arm."""

ABSENCE = 3.0
"""s out of offboard mode, in flight, after which the flight is over."""

BABBLE = 4096
"""Bytes that are no MAVLink after which the other side is taken for another program."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PX4(Autopilot):
    """PX4 on our plant: rotors and vehicle by its parameters, sensors over its simulator port.

    Attributes:
        instance: number of the program, which sets its ports; -1 for the first whose ports are free.
    """

    instance: int = -1

    name: ClassVar[str] = "px4"
    title: ClassVar[str] = "PX4"
    variable: ClassVar[str] = "SKYARM_PX4"
    least_rate: ClassVar[int] = 250

    def sensors(self, vehicle: Vehicle) -> Mapping[str, Sensor]:
        """Inertial unit at the rate of the link, magnetometer and barometer at 50 Hz, satellite navigation at 10 Hz."""
        return {"imu": FLIGHT_IMU, "magnetometer": Magnetometer(), "barometer": Barometer(), "gnss": Gnss()}

    @property
    def outside_ports(self) -> tuple[int, int]:
        """UDP ports for a program outside: PX4's onboard port and that of the joints; of the first instance for any."""
        instance = max(self.instance, 0)
        return ONBOARD_PORT + instance, JOINT_PORT + instance

    def connect(self, scenario: Scenario, tape: Tape) -> PX4Link:
        """Start PX4 with the vehicle's parameters and wait for its connection."""
        return PX4Link(self, scenario, tape)


def make_px4(
    model: Model,
    *,
    program: str = "",
    parameters: Any = None,
    joint_gains: JointGains | None = None,
    climb: float = 0.5,
    patience: float = 20.0,
    preparation: float = 120.0,
    transcript: str = "",
    replayed: str = "",
    instance: int = -1,
    outside: bool = False,
) -> Controller:
    """Controller of a vehicle whose base PX4 flies; the options are those of :class:`PX4`."""
    autopilot = PX4(
        program=program, parameters=plain_parameters(parameters), climb=climb, patience=patience,
        preparation=preparation, transcript=transcript, replayed=replayed, instance=instance,
        outside=outside,
    )  # fmt: skip
    return controller_with(autopilot, model, joint_gains)


def find_etc(program: Path) -> Path:
    """Folder ``etc`` of PX4's start scripts: beside the program, or beside the folder that it is in.

    Raises:
        ScenarioError: there is none.
    """
    for file in (program, program.resolve()):
        for place in (file.parent / "etc", file.parent.parent / "etc"):
            if place.is_dir():
                return place
    raise ScenarioError(
        f"controller.program = {str(program)!r}: must have PX4's folder 'etc' beside it, or beside its folder"
    )


class PX4Link(Link):
    """Connection to a running PX4: its process, the simulator's TCP stream, and the onboard MAVLink port.

    Args:
        record: options.
        scenario: with the sensors and the control rate of the link.
        tape: records the exchange, or plays one back in place of the program.

    Raises:
        ScenarioError: no program, or a vehicle that PX4 cannot fly.
        LinkError: PX4 does not start or does not connect.
    """

    def __init__(self, record: PX4, scenario: Scenario, tape: Tape) -> None:
        self._record, self._tape = record, tape
        self._child: Child | None = None
        self._tcp: socket.socket | None = None
        self._udp: socket.socket | None = None
        self._partner = ("", 0)
        vehicle = scenario.plant.vehicle
        self._rotors, self._signals = len(vehicle.rotors), (0.0,) * len(vehicle.rotors)
        self._rate = scenario.rates.control
        self._goal_every = max(1, self._rate // 50)
        self._stand = float(first_state(scenario).position.z) - record.climb
        self._sensors = SensorMessages()
        self._simulator, self._onboard = mavlink.Parser(), mavlink.Parser(datagrams=True)
        self._sequence = self._onboard_sequence = 0
        self._steps = self._answered = self._missed = self._away = self._failsafes = 0
        self._silence, self._out_of_mode = 0.0, 0.0
        self._system, self._mode, self._said = 0, 0, ""
        self._armed = self._ready = False
        # PX4's local place and ours, north west up: their mean difference is where its origin lies
        self._place: tuple[float, float, float] | None = None
        self._differences: list[tuple[float, ...]] = []
        self._offset: tuple[float, ...] | None = None
        self._given = tuple(name for name, _ in record.parameters)
        model = model_of(scenario)
        needed = vehicle_parameters(model.vehicle, float(model.gravity)) | sensor_parameters(scenario)
        needed |= OUTSIDE_PARAMETERS if record.outside else {}
        self._leaves = self._failing = False
        self._sub_mode = 0
        self._listener: socket.socket | None = None
        if not tape.plays:
            self._start(needed | dict(record.parameters))

    def _start(self, parameters: Mapping[str, float]) -> None:
        """Open the ports, start the program, and accept its connection."""
        record = self._record
        program = find_program(record, "px4")
        etc = find_etc(program)
        ports = open_ports(max(record.instance, 0) if record.outside else record.instance)
        self._udp, self._partner = ports.onboard, ports.partner
        try:
            environment = {f"PX4_PARAM_{name}": f"{value:.9g}" for name, value in parameters.items()}
            environment["PX4_SIM_MODEL"] = "none_iris"
            folder = make_folder(record)
            command = [str(program), "-d", "-i", str(ports.instance), "-w", str(folder), str(etc)]
            self._child = Child(command, folder, environment, without="PX4_")
            self._tcp = self._accept(ports)
            self._tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        except BaseException:
            self.close()
            raise
        finally:
            if record.outside and self._tcp is not None:
                self._listener = ports.listener  # keeps the instance, whose onboard port is to be free
            else:
                ports.listener.close()

    def release(self) -> None:
        """Ask PX4 to hold its place; once it does, its onboard port is free for a program outside."""
        self._leaves = True

    def _accept(self, ports: Ports) -> socket.socket:
        """Wait for PX4's connection."""
        ports.listener.settimeout(0.1)
        until = time.monotonic() + self._record.patience
        while True:
            with contextlib.suppress(TimeoutError):
                return ports.listener.accept()[0]
            if self._child is None or not self._child.running:
                raise LinkError(f"PX4 ended while it started{self._ending}")
            if time.monotonic() > until:
                port = 4560 + ports.instance
                raise LinkError(
                    f"PX4 has not connected to port {port} within {self._record.patience:g} s{self._ending}"
                )

    @property
    def facts(self) -> dict[str, Any]:
        """Sensor messages and those that were answered, departures from offboard mode, failsafes, PX4's last words."""
        return {
            "steps": self._steps,
            "answered": self._answered,
            "lockstep_missed": self._missed,
            "left_offboard": self._away,
            "failsafes": self._failsafes,
            "said": self._said,
            "bad_frames": self._simulator.bad + self._onboard.bad,
        }

    def exchange(self, now: Instant, goal: Goal) -> Numbers:
        """Send the readings of an instant and the set point; wait for the signals with the same time."""
        stamp = round(now.time * 1e6) + 1
        self._steps += 1
        self._send("HIL_SENSOR", time_usec=stamp, **self._sensors.inertial(now.readings))
        satellite = self._sensors.satellite(now.readings)
        if satellite is not None:
            self._send("HIL_GPS", time_usec=stamp, **satellite)
        if self._answered and not self.released:
            self._talk(now.time, goal)
        self._await(stamp)
        return self._signals

    def _send(self, name: str, **fields: float) -> None:
        """Send a message over the simulator's stream."""
        try:
            frame = mavlink.pack(name, sequence=self._sequence & 255, system=1, component=200, **fields)
        except mavlink.MavlinkError as error:
            raise LinkError(f"a reading cannot be sent to PX4: {error}") from None
        self._sequence += 1
        self._tape.send("simulator", frame, self._write)

    def _write(self, data: bytes) -> None:
        assert self._tcp is not None
        try:
            self._tcp.settimeout(self._record.patience)
            self._tcp.sendall(data)
        except TimeoutError:
            raise LinkError(f"PX4 has read nothing for {self._record.patience:g} s{self._ending}") from None
        except OSError as error:
            raise LinkError(f"PX4 closed the connection{self._ending}") from error

    @property
    def _ending(self) -> str:
        words = self._child.last_words if self._child is not None else ""
        return f" ({words})" if words else ""

    def _await(self, stamp: int) -> None:
        """Wait for the answer to a sensor message; during PX4's start for a moment only."""
        pause = STALL if self._answered else BOOT_STEP
        until, heard = time.monotonic() + pause, False
        while True:
            data = self._tape.receive("simulator", partial(self._read, until, heard))
            if not data:
                self._missed += self._answered > 0
                self._silence += pause
                if self._silence > self._record.patience:
                    raise LinkError(f"PX4 has not answered for {self._record.patience:g} s{self._ending}")
                return
            heard = True
            for message in self._simulator.feed(data):
                if message.name == "HIL_ACTUATOR_CONTROLS" and self._take_controls(message, stamp):
                    return
            if self._simulator.skipped > BABBLE:
                raise LinkError(f"PX4's simulator port: {self._simulator.skipped} bytes that are no MAVLink")

    def _take_controls(self, message: mavlink.Message, stamp: int) -> bool:
        """Take over the rotor signals of an answer; True for the answer to the sensor message of this time."""
        controls, answered = message["controls"][: self._rotors], message["time_usec"]
        if not message["flags"] & LOCKSTEP:
            raise LinkError("PX4 does not run in lockstep: it must be built with its lockstep scheduler")
        if answered > stamp:
            raise LinkError(f"PX4 answered with the time {answered} us before it was sent: must be {stamp} us")
        if not all(-1e-3 <= each <= 1.001 for each in controls):
            raise LinkError(f"PX4 sent controls that are not from 0 to 1: {[round(each, 4) for each in controls]}")
        self._signals = tuple(min(max(each, 0.0), 1.0) for each in controls)
        self._armed = bool(message["mode"] & ARMED)
        if self.released and not self._armed:
            raise LinkError("PX4 disarmed in flight")
        if answered != stamp:
            return False
        if not self._answered:
            self._require_parameters()
        self._answered += 1
        self._silence = 0.0
        return True

    def _require_parameters(self) -> None:
        """Refuse parameters of the user that PX4 does not have, once it has read them."""
        if self._child is None:
            return
        words = self._child.output
        for name in self._given:
            if f"Parameter {name} not found" in words:
                raise LinkError(f"controller.parameters.{name}: PX4 has no such parameter")

    def _read(self, until: float, heard: bool) -> bytes:
        """Bytes of the simulator's stream; empty after the time is up, even if others than the answer go on coming."""
        assert self._tcp is not None
        if heard and time.monotonic() > until:
            return b""
        try:
            self._tcp.settimeout(max(until - time.monotonic(), 1e-4))
            data = self._tcp.recv(65536)
        except TimeoutError:
            return b""
        except OSError as error:
            raise LinkError(f"PX4 closed the connection{self._ending}") from error
        if not data:
            raise LinkError(f"PX4 closed the connection{self._ending}")
        return data

    def _talk(self, t: float, goal: Goal) -> None:
        """Read PX4's state, ask for what is next (offboard mode, arming), and send set points at 50 Hz."""
        data = self._tape.receive("onboard", self._datagrams)
        for message in self._onboard.feed(data) if data else ():
            self._hear(message)
        if self._system and self._steps % (10 * self._goal_every) == 0:
            self._tell("HEARTBEAT", type=GROUND_STATION, autopilot=8, system_status=4, mavlink_version=3)
        if self._offset is None:
            self._find_origin()
            return
        if self._steps % self._goal_every == 0:
            self._send_goal(t, goal)
        if self._leaves:
            self._leave()
        elif self.following:
            self._watch()
        if self._steps % self._rate == 0 and not self.released:
            self._request()

    def _watch(self) -> None:
        """End a flight in which PX4 has disarmed, or has left offboard mode and does not come back."""
        if not self._armed:
            raise LinkError(f"PX4 disarmed in flight{self._words}")
        if self._mode == OFFBOARD:
            self._out_of_mode = 0.0
            return
        self._away += self._out_of_mode == 0.0
        self._out_of_mode += 1.0 / self._rate
        if self._out_of_mode > ABSENCE:
            raise LinkError(f"PX4 left offboard mode for its mode {self._mode}{self._words}")

    @property
    def _words(self) -> str:
        return f": {self._said}" if self._said else ""

    def _request(self) -> None:
        """Ask for offboard mode at one second and for arming at the next, until PX4 has both.

        The seconds are simulated, and the state that PX4 reports once a second of its own is not waited for: so flights
        begin alike.
        """
        if self._steps % (2 * self._rate):
            if not self._armed:
                self._command(ARM, 1)
        elif self._leaves:
            self._tell(
                "PARAM_SET", target_system=self._system, target_component=1, param_id="COM_OF_LOSS_T",
                param_value=OFFBOARD_LOSS, param_type=REAL,
            )  # fmt: skip
            self._command(SET_MODE, 1, AUTO, HOLD)
        elif not (self._armed and self._mode == OFFBOARD):
            self._command(SET_MODE, 1, OFFBOARD)

    def _leave(self) -> None:
        """Free the onboard port once PX4 holds its place."""
        if (self._mode, self._sub_mode) == (AUTO, HOLD) and self._udp is not None:
            self._udp.close()
            self.released = True

    def _find_origin(self) -> None:
        """Find where PX4's local origin lies, by the mean difference of its position and the readings, at rest.

        It is found at a whole second, so that flights begin alike.
        """
        if self._place is None or not self._ready or self._armed:
            self._differences.clear()
            return
        self._differences.append(tuple(a - b for a, b in zip(self._place, self._sensors.fix, strict=True)))
        if len(self._differences) >= SETTLED * self._rate and self._steps % self._rate == 0:
            last = self._differences[-2 * self._rate :]
            self._offset = tuple(sum(column) / len(last) for column in zip(*last, strict=True))

    def _send_goal(self, t: float, goal: Goal) -> None:
        """Send a set point of position, velocity, acceleration and yaw in PX4's local frame."""
        assert self._offset is not None
        x, y, z = (a + b for a, b in zip(goal.position, self._offset, strict=True))
        vx, vy, vz = goal.velocity
        ax, ay, az = goal.acceleration
        self._tell(
            "SET_POSITION_TARGET_LOCAL_NED", time_boot_ms=round(t * 1e3), target_system=self._system,
            target_component=1, coordinate_frame=1, type_mask=POSITION_MASK, x=x, y=-y, z=-z, vx=vx, vy=-vy, vz=-vz,
            afx=ax, afy=-ay, afz=-az, yaw=-goal.yaw,
        )  # fmt: skip

    def _datagrams(self) -> bytes:
        """Bytes that have arrived from PX4 at the onboard port; those of another sender are left out."""
        assert self._udp is not None
        with contextlib.suppress(ConnectionError):
            return b"".join(data for data, sender in drain(self._udp) if sender == self._partner)
        return b""

    def _tell(self, name: str, **fields: Any) -> None:
        """Send a message over the onboard port."""
        try:
            frame = mavlink.pack(name, sequence=self._onboard_sequence & 255, system=255, component=190, **fields)
        except mavlink.MavlinkError as error:
            raise LinkError(f"a set point cannot be sent to PX4: {error}") from None
        self._onboard_sequence += 1
        self._tape.send("onboard", frame, self._write_datagram)

    def _write_datagram(self, data: bytes) -> None:
        assert self._udp is not None
        with contextlib.suppress(OSError):
            self._udp.sendto(data, self._partner)

    def _command(self, number: int, *values: float) -> None:
        """Send COMMAND_LONG."""
        params = {f"param{i + 1}": float(value) for i, value in enumerate(values)}
        self._tell("COMMAND_LONG", target_system=self._system, target_component=1, command=number, **params)

    def _hear(self, message: mavlink.Message) -> None:
        """Take note of PX4's number, mode, place, words and whether its estimates are valid."""
        name = message.name
        if name == "HEARTBEAT" and message["autopilot"] == PX4_AUTOPILOT and self._system in (0, message.system):
            self._system = message.system
            self._mode, self._sub_mode = (message["custom_mode"] >> 16) & 255, message["custom_mode"] >> 24
            failing = self.following and message["system_status"] == CRITICAL
            self._failsafes += failing and not self._failing
            self._failing = failing
        elif message.system != self._system:
            return
        elif name == "LOCAL_POSITION_NED":
            place = (message["x"], -message["y"], -message["z"])
            if all(map(math.isfinite, place)):
                self._place = place
                self._follow(place)
        elif name == "STATUSTEXT" and message["severity"] <= CRITICAL:
            self._said = message["text"]
        elif name == "ESTIMATOR_STATUS":
            self._ready = message["flags"] & ESTIMATED == ESTIMATED

    def _follow(self, place: Numbers) -> None:
        """Note that the vehicle is in the air under our set points, once it is halfway up."""
        if self._offset is not None and self._armed and self._mode == OFFBOARD and not self.following:
            rise = place[2] - self._offset[2] - self._stand
            if rise > 0.5 * self._record.climb:
                self.following, self._said = True, ""

    def close(self) -> None:
        """Close the ports, and end the program."""
        for each in (self._tcp, self._udp, self._listener):
            if each is not None:
                each.close()
        if self._child is not None:
            self._child.close()
