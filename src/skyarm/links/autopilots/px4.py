"""PX4 in the loop: simulator MAVLink over TCP in lockstep, set points and state over its onboard MAVLink port.

Wire facts (PX4 v1.17, its simulator MAVLink module and start script): PX4 connects to our TCP port 4560 + instance;
each HIL_SENSOR of id 0 sets its clock and is answered by one HIL_ACTUATOR_CONTROLS with the same time; before its
start script has ended it answers only some. The onboard port is UDP 14540 + instance. Axes of the wire are forward,
right, down and north, east, down; ours forward, left, up and north, west, up.
"""

from __future__ import annotations

import contextlib
import math
import socket
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from skyarm.control.controller import Controller
from skyarm.control.model import JointGains, Model
from skyarm.dynamics.actuators.rotor import push
from skyarm.dynamics.array_front import center_of_mass
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
    plain_parameters,
)
from skyarm.links.autopilots.program import Child, find_program, make_folder
from skyarm.links.geodesy import to_geodetic
from skyarm.links.transcript import Tape
from skyarm.scenario.scenario_record import Scenario, ScenarioError, first_state
from skyarm.sensing.navigation_sensors import Barometer, Gnss, Magnetometer
from skyarm.sensing.sensor import Sensor
from skyarm.vehicle.vehicle_records import Vehicle

HOME = (47.397742, 8.545594, 488.0)
"""Latitude and longitude (deg) and altitude (m) of the world's origin: PX4's usual place, near Zurich."""

INSTANCES = 10
"""PX4's start script knows ports of ten programs."""

MOST_ROTORS = 12

STALL = 0.5
"""s by the wall clock after which a step without an answer is given up: PX4 drops a sample now and then, as when it
selects another sensor, and would wait for the next one for ever."""

BOOT_STEP = 0.02
"""s by the wall clock between sensor messages until PX4 answers the first."""

OFFBOARD = 6
"""PX4's main mode for set points from outside."""

GROUND_STATION = 6
"""MAVLink's type of a ground station."""

ARM, SET_MODE = 400, 176
"""MAVLink's commands."""

POSITION_MASK = 0b100_000_000_000
"""Set points of position, velocity, acceleration and yaw; the yaw rate is ignored."""

SETTLED = 5.0
"""s of valid estimates after which PX4's local origin is known and it is asked to arm."""


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
) -> Controller:
    """Controller of a vehicle whose base PX4 flies; the options are those of :class:`PX4`."""
    autopilot = PX4(
        program=program, parameters=plain_parameters(parameters), climb=climb, patience=patience,
        preparation=preparation, transcript=transcript, replayed=replayed, instance=instance,
    )  # fmt: skip
    return controller_with(autopilot, model, joint_gains)


def vehicle_parameters(vehicle: Vehicle, gravity: float) -> dict[str, float]:
    """PX4 parameters of a vehicle: places and spins of the rotors, thrust curve, hover thrust, gains of the rates.

    Rotor places are told about the centre of mass of the vehicle with its joints at zero, since PX4 takes its origin
    for that. The gains are those of a rate loop of ``RATE_BANDWIDTH``, with the ratios of PX4's default gains.
    """
    if not 3 <= len(vehicle.rotors) <= MOST_ROTORS:
        raise ScenarioError(f"plant.vehicle: {len(vehicle.rotors)} rotors: must be 3 to {MOST_ROTORS} for PX4")
    com = centre_of_mass(vehicle)
    found: dict[str, float] = {"CA_AIRFRAME": 0, "CA_ROTOR_COUNT": len(vehicle.rotors)}
    for i, rotor in enumerate(vehicle.rotors):
        x, y, z = (float(a) - float(b) for a, b in zip(rotor.position, com, strict=True))
        # PX4's moment ratio is positive for a rotor that turns counter-clockwise seen from above
        ratio = float(rotor.moment_coefficient) * float(rotor.direction)
        found |= {f"CA_ROTOR{i}_PX": x, f"CA_ROTOR{i}_PY": -y, f"CA_ROTOR{i}_PZ": -z, f"CA_ROTOR{i}_KM": ratio}
        ax, ay, az = (float(c) for c in rotor.axis)
        found |= {f"CA_ROTOR{i}_AX": ax, f"CA_ROTOR{i}_AY": -ay, f"CA_ROTOR{i}_AZ": -az}
        found[f"PWM_MAIN_FUNC{i + 1}"] = 101 + i
    thrust = sum(highest_thrust(vehicle))
    found |= {"THR_MDL_FAC": 1.0, "MPC_THR_HOVER": float(vehicle.mass) * gravity / thrust}
    return found | rate_gains(vehicle)


RATE_BANDWIDTH = 18.0
"""rad/s of the rate loop about roll and pitch; a third of a rotor's own bandwidth is the most that is taken."""

YAW_BANDWIDTH = 6.0


def rate_gains(vehicle: Vehicle) -> dict[str, float]:
    """Gains of PX4's rate loop: P = bandwidth J / torque of a full signal, I and D in PX4's default ratios."""
    slowest = max(float(rotor.time_constant_up) for rotor in vehicle.rotors)
    fast = min(RATE_BANDWIDTH, 0.33 / max(slowest, 1e-3))
    J = vehicle.base.inertia
    found: dict[str, float] = {}
    names = ("ROLL", "PITCH", "YAW")
    rows = zip(
        names, (J.xx, J.yy, J.zz), torque_of_signal(vehicle), (fast, fast, min(YAW_BANDWIDTH, fast)), strict=True
    )
    for name, inertia, torque, bandwidth in rows:
        gain = bandwidth * float(inertia) / torque
        integral, slope = (1.33, 0.02) if name != "YAW" else (0.5, 0.0)
        found |= {f"MC_{name}RATE_P": gain, f"MC_{name}RATE_I": integral * gain, f"MC_{name}RATE_D": slope * gain}
        found[f"MC_{name}RATE_MAX"] = 220.0 if name != "YAW" else 200.0
    return found


def highest_thrust(vehicle: Vehicle) -> list[float]:
    """Thrust of each rotor at its highest speed, N."""
    return [float(rotor.thrust_coefficient * push(rotor, rotor.max_speed)) for rotor in vehicle.rotors]


def centre_of_mass(vehicle: Vehicle) -> np.ndarray[Any, Any]:
    """Centre of mass of a vehicle with its joints at zero, base axes, m."""
    return center_of_mass(vehicle, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0,) * vehicle.n)


def torque_of_signal(vehicle: Vehicle) -> tuple[float, float, float]:
    """Torque (N m) about x, y and z of a full torque set point, as PX4 shares it among the rotors.

    PX4 mixes by the pseudo-inverse of the rotors' effectiveness, each column scaled: roll and pitch alike so that the
    signals' root mean square over the rotors that take part is 1/sqrt(2) of the larger, yaw by its largest signal.
    Source: PX4 v1.17, control allocation, scale of the mixer's columns.
    """
    com, full = centre_of_mass(vehicle), highest_thrust(vehicle)
    rows = []
    for rotor in vehicle.rotors:
        axis = np.array([float(c) for c in rotor.axis])
        arm = np.array([float(c) for c in rotor.position]) - com
        torque = np.cross(arm, axis) - float(rotor.direction) * float(rotor.moment_coefficient) * axis
        rows.append((*torque, axis[2]))
    shape = np.array(rows).T  # torque and thrust of unit thrusts
    mix = np.linalg.pinv(shape)[:, :3]
    scale = []
    for column in mix.T[:2]:
        used = np.count_nonzero(np.abs(column) > 1e-3)
        scale.append(math.sqrt(float(column @ column) / (used / 2.0)))
    mix[:, :2] /= max(scale)
    mix[:, 2] /= np.abs(mix[:, 2]).max()
    full_torque = (shape[:3] * np.array(full)) @ mix
    return float(full_torque[0, 0]), float(full_torque[1, 1]), float(full_torque[2, 2])


def sensor_parameters(scenario: Scenario) -> dict[str, float]:
    """PX4 parameters of the sensors: delays and noise that its estimator assumes; the field points north."""
    sensors: dict[str, Any] = {each.name: each.sensor for each in scenario.sensors}
    gnss, magnetometer, barometer = (sensors[name] for name in ("gnss", "magnetometer", "barometer"))
    return {
        "EKF2_GPS_DELAY": 1e3 * gnss.latency,
        "EKF2_MAG_DELAY": 1e3 * magnetometer.latency,
        "EKF2_BARO_DELAY": 1e3 * barometer.latency,
        "EKF2_GPS_P_NOISE": max(float(gnss.position.sigma), 0.01),
        "EKF2_GPS_V_NOISE": max(float(gnss.velocity.sigma), 0.01),
        "EKF2_DECL_TYPE": 0,
        "EKF2_MAG_DECL": 0,
    }


def pressure_altitude(pressure: float) -> float:
    """Altitude above mean sea level of a pressure in the standard atmosphere's troposphere, m (ICAO Doc 7488)."""
    return float(44330.77 * (1.0 - (pressure / 1013.25) ** 0.1902632))


def open_ports(instance: int) -> tuple[socket.socket, socket.socket, int]:
    """Listening simulator port, bound onboard port, and the instance that they are of; -1 takes the first free one.

    Raises:
        LinkError: the ports are taken.
    """
    if not -1 <= instance < INSTANCES:
        raise ScenarioError(f"controller.instance = {instance}: must be from 0 to {INSTANCES - 1}, or -1 for any")
    reason = ""
    for number in range(INSTANCES) if instance < 0 else (instance,):
        tcp, udp = socket.socket(), socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            tcp.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            tcp.bind(("127.0.0.1", 4560 + number))
            tcp.listen(1)
            udp.bind(("127.0.0.1", 14540 + number))
            udp.setblocking(False)
            return tcp, udp, number
        except OSError as error:
            reason = error.strerror or str(error)
            tcp.close()
            udp.close()
    wanted = "4560 to 4569" if instance < 0 else str(4560 + instance)
    raise LinkError(f"TCP ports {wanted} and the UDP ports 9980 above them must be free for PX4: {reason}")


class PX4Link(Link):
    """Connection to a running PX4: its process, the simulator's TCP stream, and the onboard MAVLink port."""

    def __init__(self, record: PX4, scenario: Scenario, tape: Tape) -> None:
        self._record, self._tape = record, tape
        self._rotors = len(scenario.plant.vehicle.rotors)
        self._answered = self._missed = self._silent = self._sequence = self._ground_sequence = 0
        self._period = 1.0 / scenario.rates.control
        self._goal_every = max(1, scenario.rates.control // 50)
        self._signals: Numbers = (0.0,) * self._rotors
        self._simulator, self._ground = mavlink.Parser(), mavlink.Parser()
        self._said, self._armed, self._ready, self._mode = "", False, False, 0
        self._steps, self._asked, self._away = 0, -1.0, 0
        # PX4's local place and ours, north west up: their mean difference is where its origin lies
        self._place: tuple[float, float, float] | None = None
        self._fix = (0.0, 0.0, 0.0)
        self._differences: list[tuple[float, ...]] = []
        self._offset: tuple[float, ...] | None = None
        start = first_state(scenario)
        self._stand = float(start.position.z) - record.climb
        self._child: Child | None = None
        self._tcp: socket.socket | None = None
        self._udp: socket.socket | None = None
        self._partner = ("127.0.0.1", 14580)
        self._last = {"magnetometer": -1.0, "barometer": -1.0, "gnss": -1.0}
        gravity = float(scenario.plant.gravity)
        needed = vehicle_parameters(scenario.plant.vehicle, gravity) | sensor_parameters(scenario)
        if not tape.plays:
            self._start(needed | dict(record.parameters))

    def _start(self, parameters: Mapping[str, float]) -> None:
        """Open the ports, start the program, and accept its connection."""
        record = self._record
        program = find_program(record, "px4")
        etc = next((place for place in (program.parent / "etc", program.parent.parent / "etc") if place.is_dir()), None)
        if etc is None:
            raise ScenarioError(f"controller.program = {str(program)!r}: must have PX4's folder 'etc' beside it")
        listener, self._udp, instance = open_ports(record.instance)
        self._partner = ("127.0.0.1", 14580 + instance)
        try:
            folder = make_folder(record)
            environment = {f"PX4_PARAM_{name}": f"{value:.9g}" for name, value in parameters.items()}
            environment["PX4_SIM_MODEL"] = "none_iris"
            command = [str(program), "-d", "-i", str(instance), "-w", str(folder), str(etc)]
            self._child = Child(command, folder, environment)
            listener.settimeout(0.2)
            until = time.monotonic() + record.patience
            while self._tcp is None:
                with contextlib.suppress(TimeoutError):
                    self._tcp = listener.accept()[0]
                if self._tcp is None and not self._child.running:
                    raise LinkError(f"PX4 ended while it started: {self._child.last_words}")
                if self._tcp is None and time.monotonic() > until:
                    raise LinkError(f"PX4 does not connect to port {4560 + instance}: {self._child.last_words}")
            self._tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        except BaseException:
            self.close()
            raise
        finally:
            listener.close()

    @property
    def facts(self) -> dict[str, Any]:
        """Counts of sensor messages and answers, and text of the last status message of PX4."""
        return {
            "steps": self._steps,
            "answered": self._answered,
            "lockstep_missed": self._missed,
            "left_offboard": self._away,
            "said": self._said,
            "bad_frames": self._simulator.bad + self._ground.bad,
        }

    def exchange(self, now: Instant, goal: Goal) -> Numbers:
        """Send the readings of an instant and the set point; wait for the signals with the same time."""
        stamp = round(now.time * 1e6) + 1
        self._steps += 1
        self._send_sensors(stamp, now.readings)
        self._talk(now, goal)
        self._await(stamp)
        return self._signals

    def _send(self, name: str, **fields: Any) -> None:
        frame = mavlink.pack(name, sequence=self._sequence & 255, system=1, component=200, **fields)
        self._sequence += 1
        self._tape.send("simulator", frame, self._write)

    def _write(self, data: bytes) -> None:
        assert self._tcp is not None
        try:
            self._tcp.sendall(data)
        except OSError as error:
            raise LinkError(f"PX4 is gone: {error.strerror or error}{self._ending}") from None

    @property
    def _ending(self) -> str:
        words = self._child.last_words if self._child is not None else ""
        return f" ({words})" if words else ""

    def _send_sensors(self, stamp: int, readings: Mapping[str, Numbers]) -> None:
        """Send HIL_SENSOR with what is new, and HIL_GPS with a new reading."""
        _, p, q, r, fx, fy, fz = readings["imu"]
        updated = 0b111111
        fields: dict[str, float] = {
            "xgyro": p, "ygyro": -q, "zgyro": -r, "xacc": fx, "yacc": -fy, "zacc": -fz, "temperature": 20.0,
        }  # fmt: skip
        read, mx, my, mz = readings["magnetometer"]
        if read > self._last["magnetometer"]:
            self._last["magnetometer"] = read
            updated |= 0b111000000
            fields |= {"xmag": mx, "ymag": -my, "zmag": -mz}
        read, pressure, temperature = readings["barometer"]
        if read > self._last["barometer"]:
            self._last["barometer"] = read
            updated |= 0b1101000000000
            altitude = pressure_altitude(pressure)
            fields |= {"abs_pressure": pressure, "pressure_alt": altitude, "temperature": temperature}
        self._send("HIL_SENSOR", time_usec=stamp, fields_updated=updated, id=0, **fields)
        read, x, y, z, vx, vy, vz = readings["gnss"]
        if read > self._last["gnss"]:
            self._last["gnss"], self._fix = read, (x, y, z)
            latitude, longitude, altitude = to_geodetic(x, -y, z, HOME)
            speed, course = math.hypot(vx, vy), math.degrees(math.atan2(-vy, vx)) % 360.0
            self._send(
                "HIL_GPS", time_usec=stamp, fix_type=3, lat=round(latitude * 1e7), lon=round(longitude * 1e7),
                alt=round(altitude * 1e3), eph=2, epv=3, vel=round(speed * 100), vn=round(vx * 100),
                ve=round(-vy * 100), vd=round(-vz * 100), cog=round(course * 100) % 36000, satellites_visible=14,
            )  # fmt: skip

    def _await(self, stamp: int) -> None:
        """Wait for the answer to a sensor message; during PX4's start for a moment only."""
        until = time.monotonic() + (STALL if self._answered else BOOT_STEP)
        while True:
            data = self._tape.receive("simulator", lambda: self._read(until))
            if not data:
                self._missed += self._answered > 0
                self._silent += 1
                if self._silent * (STALL if self._answered else BOOT_STEP) > self._record.patience:
                    raise LinkError(f"PX4 has not answered for {self._record.patience:g} s{self._ending}")
                return
            for message in self._simulator.feed(data):
                if message.name != "HIL_ACTUATOR_CONTROLS":
                    continue
                controls = message["controls"]
                if not all(math.isfinite(each) for each in controls[: self._rotors]):
                    raise LinkError(f"PX4 sent controls that are not numbers: {list(controls[: self._rotors])}")
                self._signals = tuple(min(max(each, 0.0), 1.0) for each in controls[: self._rotors])
                if message["time_usec"] == stamp:
                    self._answered += 1
                    self._silent = 0
                    return

    def _read(self, until: float) -> bytes:
        """Bytes of the simulator's stream; empty after the time is up."""
        assert self._tcp is not None
        self._tcp.settimeout(max(until - time.monotonic(), 1e-4))
        try:
            data = self._tcp.recv(65536)
        except TimeoutError:
            return b""
        except OSError as error:
            raise LinkError(f"PX4 is gone: {error.strerror or error}{self._ending}") from None
        if not data:
            raise LinkError(f"PX4 closed the connection{self._ending}")
        return data

    def _talk(self, now: Instant, goal: Goal) -> None:
        """Read PX4's state, ask for what is next (offboard mode, arming), and send set points at 50 Hz."""
        if self._answered == 0:
            return
        data = self._tape.receive("onboard", self._datagrams)
        for message in self._ground.feed(data) if data else ():
            self._hear(message.name, message)
        t = now.time
        if self._steps % (10 * self._goal_every) == 0:
            self._tell("HEARTBEAT", type=GROUND_STATION, autopilot=8, system_status=4, mavlink_version=3)
        if self._offset is None:
            self._find_origin()
            return
        if self._steps % self._goal_every == 0:
            self._send_goal(t, goal)
        if self.following and not self._armed:
            raise LinkError(f"PX4 disarmed in flight: {self._said}")
        if t - self._asked < 0.5:
            return
        if self._mode != OFFBOARD:
            self._away += self.following
            self._asked = t
            self._command(SET_MODE, 1, OFFBOARD)
        elif not self._armed:
            self._asked = t
            self._command(ARM, 1)

    def _find_origin(self) -> None:
        """Find where PX4's local origin lies, by the mean difference of its position and the readings, at rest."""
        if self._place is None or not self._ready or self._armed:
            self._differences.clear()
            return
        self._differences.append(tuple(a - b for a, b in zip(self._place, self._fix, strict=True)))
        if len(self._differences) * self._period >= SETTLED:
            half = self._differences[len(self._differences) // 2 :]
            self._offset = tuple(sum(column) / len(half) for column in zip(*half, strict=True))

    def _send_goal(self, t: float, goal: Goal) -> None:
        """Send a set point of position, velocity, acceleration and yaw in PX4's local frame."""
        assert self._offset is not None
        x, y, z = (a + b for a, b in zip(goal.position, self._offset, strict=True))
        vx, vy, vz = goal.velocity
        ax, ay, az = goal.acceleration
        self._tell(
            "SET_POSITION_TARGET_LOCAL_NED", time_boot_ms=round(t * 1e3), target_system=1, target_component=1,
            coordinate_frame=1, type_mask=POSITION_MASK, x=x, y=-y, z=-z, vx=vx, vy=-vy, vz=-vz, afx=ax, afy=-ay,
            afz=-az, yaw=-goal.yaw,
        )  # fmt: skip

    def _datagrams(self) -> bytes:
        assert self._udp is not None
        found = []
        with contextlib.suppress(BlockingIOError, ConnectionError):
            while True:
                found.append(self._udp.recv(65536))
        return b"".join(found)

    def _tell(self, name: str, **fields: Any) -> None:
        """Send a message over the onboard port."""
        frame = mavlink.pack(name, sequence=self._ground_sequence & 255, system=255, component=190, **fields)
        self._ground_sequence += 1
        self._tape.send("onboard", frame, self._write_datagram)

    def _write_datagram(self, data: bytes) -> None:
        assert self._udp is not None
        with contextlib.suppress(OSError):
            self._udp.sendto(data, self._partner)

    def _command(self, number: int, *values: float) -> None:
        """Send COMMAND_LONG."""
        params = {f"param{i + 1}": float(value) for i, value in enumerate(values)}
        self._tell("COMMAND_LONG", target_system=1, target_component=1, command=number, **params)

    def _hear(self, name: str, message: Any) -> None:
        """Update mode, arming, position and status text from a message of PX4."""
        if name == "HEARTBEAT" and message["autopilot"] == 12:
            self._mode = (message["custom_mode"] >> 16) & 255
            self._armed = bool(message["base_mode"] & 128)
        elif name == "LOCAL_POSITION_NED":
            self._place = (message["x"], -message["y"], -message["z"])
            if self._offset is not None and self._armed and self._mode == OFFBOARD and not self.following:
                rise = self._place[2] - self._offset[2] - self._stand
                self.following = rise > 0.5 * self._record.climb
        elif name == "STATUSTEXT" and message["severity"] <= 5:
            self._said = message["text"]
        elif name == "ESTIMATOR_STATUS":
            self._ready = message["flags"] & 0b111 == 0b111

    def close(self) -> None:
        """Close the ports, and end the program."""
        for each in (self._tcp, self._udp):
            if each is not None:
                each.close()
        if self._child is not None:
            self._child.close()
