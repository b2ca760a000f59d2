"""Betaflight in the loop: it flies in angle mode under radio sticks that a position
controller moves.

Wire facts (Betaflight 4.6.0, simulator target), little-endian: it takes states on UDP
9003 (18 doubles: time; angular rate; accelerometer with its sign turned round; attitude
w, x, y, z; velocity; place; pressure) and radio channels on UDP 9004 (a double and 16
unsigned shorts, microseconds); it sends motors to UDP 9001 (an unsigned short, two
bytes unused, 16 floats, microseconds) once a state. Its command line is on TCP 5761.
The ports are fixed. Axes of the wire are forward, right, down and north, east, down;
ours forward, left, up and north, west, up.

It does not wait for states: its loop runs by the wall clock, which it scales by the
time stamps of the last two states. So the flight is paced at real time or slower, and
its bits do not repeat. After half a second without a state its clock would jump: its
process is halted in a pause.
"""

from __future__ import annotations

import contextlib
import math
import socket
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import ClassVar

import numpy as np

from skyarm.links.autopilots.angle_control import AngleControl, AngleGains, MotionFilter
from skyarm.links.autopilots.autopilot import (
    FLIGHT_IMU,
    Autopilot,
    AutopilotMaker,
    BaseGoal,
    LinkError,
    Numbers,
    Patience,
    Preparation,
    SensedInstant,
)
from skyarm.links.autopilots.betaflight_process import (
    HALT,
    RADIO_PORT,
    STATE_PORT,
    ProcessGuard,
    SilentStartError,
    await_boot,
    open_port,
    program_of,
    set_up,
)
from skyarm.links.autopilots.betaflight_settings import (
    IDLE,
    MOTORS,
    RADIO,
    Sticks,
    console_lines,
    shown_numbers,
    state_message,
    vehicle_loops,
)
from skyarm.links.autopilots.program import Child, ProgramLink
from skyarm.links.sockets import Address, drain
from skyarm.links.transcript import Tape
from skyarm.records.immutable import immutable
from skyarm.records.plain import Plain
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensing.channel import Channel
from skyarm.sensing.sensor import Sensor
from skyarm.sensing.sensor_kinds import Pose
from skyarm.vehicle import Vehicle

FLIGHT_CAMERA = Pose(
    frequency=250.0, position=Channel(sigma=0.001), attitude=Channel(sigma=0.001)
)
"""Motion capture system of a laboratory: 1 mm and 1 mrad at 250 Hz."""

QUICK = 9.0
"""Bandwidth (1/s) of the angle loop below which the gains of the position loop are
reduced in proportion."""

CATCH_UP = 0.75
"""Least interval, in periods, between two states by the wall clock after a delay.
Betaflight's clock runs by the interval at which it read two states, and it may read one
late."""


@immutable
class Betaflight(Autopilot):
    """Betaflight flying a simulated vehicle: set up by its command line, with states
    and radio channels over UDP.

    Attributes:
        gains: gains of the position loop that moves the sticks, for a vehicle as quick
            as a 0.8 kg quadrotor.
    """

    # chosen: its port opens after 0.5 s, and a command is answered in 0.1 to 0.6 s on
    # a busy machine of two cores (measured)
    patience: Patience = 5.0
    preparation: Preparation = 60.0
    gains: AngleGains = AngleGains()

    name: ClassVar[str] = "betaflight"
    title: ClassVar[str] = "Betaflight"
    variable: ClassVar[str] = "SKYARM_BETAFLIGHT"
    # chosen, twice the rate of the motion capture: the tip of a shortened hover_swing
    # is off by 28.9 mm in the mean, by 29.4 mm at 250 Hz; on two busy cores 16 s of it
    # last 42 s, and 20 s at 250 Hz (measured)
    least_rate: ClassVar[int] = 500
    longest_name: ClassVar[int] = 40

    def sensors(self, vehicle: Vehicle) -> Mapping[str, Sensor]:
        """Sensors for Betaflight: inertial measurement unit at the rate of the link,
        motion capture at 250 Hz.
        """
        return {"imu": FLIGHT_IMU, "pose": FLIGHT_CAMERA}

    def connect(self, scenario: Scenario, tape: Tape) -> BetaflightLink:
        """Start Betaflight, configure it for the vehicle, and start it again."""
        return BetaflightLink(self, scenario, tape)


make_betaflight = AutopilotMaker(Betaflight)


START_TIME = 8.0
"""Wall-clock time within which a silent program is restarted, as a fraction of the
patience."""

WARM, WARM_STEP, WARM_WAIT = 0.4, 0.002, 0.02
"""Times (s) of the states before the flight: their duration, their interval, and the
wall-clock wait for each answer."""

LEVEL = (1500, 1500, 1000, 1500)
"""Stick positions at rest."""

ON, OFF = 2000, 1000
"""Switch positions on and off."""

POWER_ON = 6.0
"""Time (s) until arming is requested; Betaflight calibrates its gyroscope and does not
arm before 5 s."""

ANSWER = 0.4
"""Longest wall-clock wait (s) for an answer, while simulated time stands still. On a
busy machine the program may need longer than a period; if it then reads two states at
once, its clock jumps, as it does after half a second without a state."""

RECENT, FAR_APART = 500, 0.1
"""Number of states that are examined when Betaflight disarms, and interval (s) between
two that is reported as the likely cause; it is in failsafe after some tenths of a
second without radio."""

RISE = 0.4
"""Climb speed (m/s) of the take-off."""


class BetaflightLink(ProgramLink):
    """Connection to a running Betaflight: process, sockets, position controller and
    real-time pacing.
    """

    def __init__(self, record: Betaflight, scenario: Scenario, tape: Tape) -> None:
        super().__init__(record, scenario, tape)
        model = scenario.agent.model
        vehicle, gravity = model.vehicle, float(model.gravity)
        self._period = scenario.rates.period
        self._sticks = Sticks(vehicle, gravity)
        # the position loop stays slower than the angle loop inside it (angle_p_gain is
        # in tenths of 1/s)
        slow = min(
            1.0, 0.1 * vehicle_loops(vehicle, gravity)[1]["angle_p_gain"] / QUICK
        )
        self._control = AngleControl(record.gains.slow_down(slow), gravity)
        self._filter = MotionFilter(gravity)
        self._seen = -1.0
        self._armed = False
        self._armed_at = 0.0
        self._asked = POWER_ON
        self._answered = self._bad = 0
        self._silent_since, self._sent, self._heard, self._begun = 0.0, 0.0, 0.0, 0.0
        self._late: list[float] = []
        self._apart: deque[float] = deque(maxlen=RECENT)
        self._waits: list[float] = []
        self._guard: ProcessGuard | None = None
        self._motors: socket.socket | None = None
        self._peer: Address | None = None
        self._out: socket.socket | None = None
        if not tape.plays:
            self._start(console_lines(vehicle, gravity, dict(record.parameters)))

    def _start(self, lines: Sequence[str]) -> None:
        """Bind the motor port, configure Betaflight by its command line, and start it
        again.
        """
        program = program_of(self._record)
        self._motors = self._held.enter_context(open_port())
        with self._starting():
            self._out = self._held.enter_context(
                socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            )
            folder = self._make_folder()
            command = [str(program), "127.0.0.1"]
            until = time.monotonic() + START_TIME * self._record.patience
            self._repeat(partial(self._set_up, command, folder, lines), until)
            child = self._repeat(partial(self._boot, command, folder), until)
            self._guard = ProcessGuard(child.pid)
            self._held.callback(self._guard.close)

    def _repeat(self, start: Callable[[], Child], until: float) -> Child:
        """Start Betaflight repeatedly until it answers; raise an error after a given
        time (s, monotonic clock).

        Raises:
            LinkError: it never answers, or ends.
        """
        count = 1
        while True:
            try:
                return start()
            except SilentStartError as error:
                if time.monotonic() > until:
                    raise LinkError(
                        f"{error}, in {count} start{'s' * (count > 1)}"
                    ) from None
            count += 1
            if self._child is not None:
                self._child.end()

    def _set_up(
        self, command: Sequence[str], folder: Path, lines: Sequence[str]
    ) -> Child:
        """Start Betaflight, write the settings by its command line and save them, which
        ends the process.
        """
        (folder / "eeprom.bin").unlink(missing_ok=True)  # of a start that was given up
        child = self._launch(command, folder)
        set_up(child, lines, self._record.patience)
        child.end()
        return child

    def _boot(self, command: Sequence[str], folder: Path) -> Child:
        """Start Betaflight and return its process once its motor messages answer the
        sent states.
        """
        child = self._launch(command, folder)
        await_boot(child, self._record.patience)
        if self._warm_up():
            return child
        if child.running:
            raise SilentStartError(f"Betaflight has sent no motors{self._ending}")
        raise LinkError(
            f"Betaflight ended while it started{child.ending('Betaflight')}"
        )

    def _warm_up(self) -> bool:
        """Send Betaflight states of rest for ``WARM`` s, in real time or slower; True
        if it answers the last ones.

        Betaflight's clock stands still for the first state's answer, and now and then
        does not start again. Each state waits for the answer to the one before: of
        states that queue up on a busy machine the clock leaps.
        """
        # at rest an accelerometer reads 1 g upwards
        level = ((0.0,) * 6 + (9.8,), (0.0,) * 4 + (1.0, 0.0, 0.0, 0.0), (0.0,) * 3)
        answered, count, sent = 0, round(WARM / WARM_STEP), 0.0
        self._peer = None
        for k in range(count):
            time.sleep(max(sent + WARM_STEP - time.monotonic(), 0.0))
            sent = time.monotonic()
            # of 16 channels four are sticks and twelve are switches
            self._send(RADIO.pack(k * WARM_STEP, *LEVEL, *(OFF,) * 12), RADIO_PORT)
            self._send(state_message(k * WARM_STEP, *level), STATE_PORT)
            # in the first half its clock may still stand: only the second half counts
            answered += (2 * k > count) * bool(self._await_motors(sent + WARM_WAIT))
        # at least half of the second half
        return answered > 0.25 * count

    @property
    def facts(self) -> dict[str, Plain]:
        """Counts of the states sent to Betaflight and of its answers, and their delays
        (ms) by the wall clock.
        """
        late, waits = (
            np.percentile(np.array(each or [0.0]) * 1e3, (50, 99))
            for each in (self._late, self._waits)
        )
        return {
            "steps": self._steps,
            "answered": self._answered,
            "bad_frames": self._bad,
            "late_ms_p50": float(late[0]),
            "late_ms_p99": float(late[1]),
            "answer_ms_p50": float(waits[0]),
            "answer_ms_p99": float(waits[1]),
            "halts": 0 if self._guard is None else self._guard.halts,
        }

    def exchange(self, now: SensedInstant, goal: BaseGoal) -> Numbers:
        """Send sensor readings and radio sticks when they are due, and wait for the
        motor message that answers.
        """
        imu, pose = now.readings["imu"], now.readings["pose"]
        quaternion = tuple(pose[4:8])
        self._filter.predict(quaternion, imu[4:7], self._period)
        if pose[0] > self._seen:
            self._filter.correct(
                pose[1:4],
                # the first position sets the filter, whatever the interval before it
                max(pose[0] - self._seen, self._period) if self._seen >= 0.0 else 1.0,
            )
            self._seen = pose[0]
        channels = self._channels(now.time, quaternion, goal)
        velocity = self._filter.velocity
        self._pace()
        self._steps += 1
        self._tape.send(
            "radio",
            RADIO.pack(now.time, *channels),
            partial(self._send, port=RADIO_PORT),
        )
        self._tape.send(
            "state",
            # stamps go on after the warm-up, since a clock that stepped back would leap
            state_message(now.time + WARM, imu, pose, velocity),
            partial(self._send, port=STATE_PORT),
        )
        answer = self._tape.receive("motors", self._read)
        if answer:
            self._take(answer)
        return self._signals

    def _channels(
        self, t: float, quaternion: Numbers, goal: BaseGoal
    ) -> tuple[int, ...]:
        """Radio channels at a time (s): at rest, arming, taking off, or tracking the
        set point.
        """
        rise = self._filter.position[2] - self._stand
        if not self._armed:
            arming = t >= self._asked
            # refused: the switch must go back before it is asked again
            if t > self._asked + 0.5:
                self._asked = t + 0.5
            return (*LEVEL, ON if arming else OFF, ON, *(OFF,) * 10)
        if not self.following:
            height = min(self._stand + RISE * (t - self._armed_at), goal.position[2])
            climbing = RISE if height < goal.position[2] else 0.0
            place, velocity = (*goal.position[:2], height), (0.0, 0.0, climbing)
            self.following = rise > 0.5 * self._record.climb
            goal = BaseGoal(place, velocity, (0.0, 0.0, 0.0), goal.yaw)
        attitude = self._control.command(
            self._filter.position,
            self._filter.velocity,
            quaternion,
            goal,
            self._period,
            # on the stand the integral would wind up
            flying=rise > 0.02,
        )
        return (*self._sticks.channels(attitude), ON, ON, *(OFF,) * 10)

    def _take(self, answer: bytes) -> None:
        """Read rotor signals and arming state from a motor message of Betaflight."""
        count, *motors = MOTORS.unpack(answer)
        motors = motors[: self._rotors]
        if count != self._rotors or not all(map(math.isfinite, motors)):
            raise LinkError(
                f"Betaflight sent {count} motors, {shown_numbers(motors)}: must be"
                f" {self._rotors} numbers"
            )
        self._answered += 1
        # pulse widths of 1000 to 2000 us
        self._signals = tuple(
            min(max((each - 1000.0) * 1e-3, 0.0), 1.0) for each in motors
        )
        # motors report no arming: an armed motor turns at least at idle
        armed = min(self._signals) > 0.5 * IDLE
        if armed and not self._armed:
            self._armed_at = self._tape.time
        if self.following and not armed:
            apart = max(self._apart, default=0.0)
            busy = f": states were up to {apart:.2g} s apart, the machine is too busy"
            raise LinkError(
                "Betaflight disarmed in"
                f" flight{busy if apart > FAR_APART else self._ending}"
            )
        self._armed = armed

    def _pace(self) -> None:
        """Sleep until the next state is due in real time; after a delay the flight
        catches up only slowly.
        """
        if self._tape.plays:
            return
        now = time.monotonic()
        if self._guard is not None and self._guard.wake(ANSWER + HALT):
            # time goes on where it was halted
            self._sent, self._begun = 0.0, now - self._steps * self._period
            self._silent_since = now
        if self._begun == 0.0:
            self._begun = now - self._steps * self._period
        due = self._begun + self._steps * self._period
        # later than the last exchange by most of a period, however late: two states
        # read at once would make the program's clock leap
        at = max(due, max(self._sent, self._heard) + CATCH_UP * self._period)
        if at > now:
            time.sleep(at - now)
        before, self._sent = self._sent, time.monotonic()
        self._apart.append(self._sent - before if before else 0.0)
        self._late.append(self._sent - due)

    def _send(self, data: bytes, port: int) -> None:
        assert self._out is not None
        try:
            self._out.sendto(data, ("127.0.0.1", port))
        except OSError as error:
            raise self._port_error(error) from None

    def _read(self) -> bytes:
        """Newest motor message from Betaflight; empty if none arrives in time."""
        message, now = self._await_motors(self._sent + ANSWER), time.monotonic()
        self._heard = now
        if self._guard is not None:
            self._guard.wake()
        if message:
            self._waits.append(now - self._sent)
            self._silent_since = now
        else:
            self._check_alive(now)
        return message

    def _await_motors(self, until: float) -> bytes:
        """Newest motor message from Betaflight; empty if none arrives before a time (s,
        monotonic clock).
        """
        assert self._motors is not None
        message, left = b"", 1.0
        while not message and left > 0.0:
            left = until - time.monotonic()
            # nothing yet, or a state of ours that found nobody: the time limit decides
            with contextlib.suppress(TimeoutError, BlockingIOError, ConnectionError):
                # a timeout of 0 would not wait at all, and one below it is refused
                self._motors.settimeout(max(left, 1e-4))
                first = self._motors.recvfrom(2048)
                message = (self._motors_of([first, *drain(self._motors)]) or [b""])[-1]
        return message

    def _motors_of(
        self, datagrams: Sequence[tuple[bytes, Address | None]]
    ) -> list[bytes]:
        """Motor messages among received datagrams; only those of Betaflight, the first
        sender, count.
        """
        messages = []
        for data, sender in datagrams:
            if len(data) != MOTORS.size or self._peer not in (None, sender):
                self._bad += 1
                continue
            self._peer = sender
            messages.append(data)
        return messages

    def _check_alive(self, now: float) -> None:
        """Raise an error if Betaflight's process has ended, or has been silent for too
        long.
        """
        if self._child is not None and not self._child.running:
            raise LinkError(f"Betaflight has ended{self._ending}")
        self._silent_since = self._silent_since or now
        if now - self._silent_since > self._record.patience:
            other = f" but {self._bad} other datagrams" if self._bad else ""
            raise LinkError(
                f"Betaflight has sent no motors for {self._record.patience:g}"
                f" s{other}{self._ending}"
            )
