"""PX4 in the loop: lockstep simulator MAVLink over TCP; set points and state over its
onboard MAVLink port.

Wire facts (PX4 v1.17, its simulator MAVLink module and start script): PX4 connects to
our TCP port 4560 + instance; each HIL_SENSOR of id 0 sets its clock and is answered by
one HIL_ACTUATOR_CONTROLS with the same time; before its start script has ended it
answers only some. The onboard port is UDP 14540 + instance, and PX4's number as a
MAVLink system is 1 + instance.
"""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import ClassVar

from skyarm.links import mavlink
from skyarm.links.autopilots.autopilot import (
    FLIGHT_IMU,
    Autopilot,
    AutopilotMaker,
    BaseGoal,
    LinkError,
    Numbers,
    SensedInstant,
)
from skyarm.links.autopilots.guided_vehicle import GuidedVehicle
from skyarm.links.autopilots.program import ProgramLink, find_program
from skyarm.links.autopilots.px4_parameters import sensor_parameters, vehicle_parameters
from skyarm.links.autopilots.px4_ports import JOINT_PORT, ONBOARD_PORT, open_ports
from skyarm.links.autopilots.px4_sensors import SensorMessages
from skyarm.links.mavlink_vehicle import ARM, ARMED, CRITICAL, PX4_NUMBER
from skyarm.links.sockets import drain
from skyarm.links.transcript import Tape
from skyarm.records.immutable import immutable
from skyarm.records.plain import Plain
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.sensing.navigation_sensors import Barometer, Gnss, Magnetometer
from skyarm.sensing.sensor import Sensor
from skyarm.vehicle import Vehicle

STALL = 1.0
"""Wall-clock time (s) without an answer after which a step is abandoned; PX4 may drop a
sample and would wait for ever."""

HALT, HASTE, STEADY = 0.1, 0.75, 10
"""Time (s) without an answer in real time after which the motors count as commanded
externally, as PX4 then answers new commands only; fraction of a period to wait then;
number of answers in a row after which PX4 commands them again. Chosen: below 1 the
flight can catch up with real time."""

BOOT_STEP = 0.02
"""Wall-clock time (s) between sensor messages until PX4 answers the first, after 10 to
18 of them (measured)."""

OUTSIDE_PARAMETERS = {
    "IMU_INTEG_RATE": 250,
    "COM_OBL_RC_ACT": 5,
    "COM_RCL_EXCEPT": 7,
    "MC_YAW_TQ_CUTOFF": 0,
}
"""Parameters for an external law: PX4 holds its position without set points and needs
no remote control; its yaw torque is not filtered, since yaw control oscillates behind
its usual filter of 2 Hz."""

OFFBOARD_LOSS = 0.15
"""Time (s) without external set points after which PX4 holds its position; its default
of 1 s is long for a body rate. It stays at that during the take-off, which is faster
than real time."""

LOCKSTEP = 1
"""Bit of a message's flags for lockstep."""

ESTIMATED = 0b111
"""Estimator flags: attitude, horizontal and vertical velocity."""

REPLIES = 10.0
"""Time (s) within which a requested parameter must arrive from PX4."""

SETTLED = 5
"""Time (s) of valid estimates after which PX4's local origin is known and arming is
requested."""

LINKS = "px4-rc.mavlink"
"""Script for MAVLink links that PX4's start script runs, the first of that name in
``PATH``. PX4's own opens four UDP ports to every interface and obeys any sender; this
one opens the onboard port only."""

BABBLE = 4096
"""Number of bytes that are not MAVLink after which the peer counts as another
program; chosen: 14 of MAVLink's longest frames."""


@immutable
class PX4(Autopilot):
    """PX4 flying a simulated vehicle: parameters from rotors and vehicle, sensors over
    its simulator port.

    Attributes:
        instance: number of the program, which sets its ports; -1 for the first whose
            ports are free.
    """

    instance: int = -1

    name: ClassVar[str] = "px4"
    title: ClassVar[str] = "PX4"
    variable: ClassVar[str] = "SKYARM_PX4"
    # measured: its estimator, arming and hover work at this rate
    least_rate: ClassVar[int] = 250

    def sensors(self, vehicle: Vehicle) -> Mapping[str, Sensor]:
        """Sensors for PX4: inertial unit at the link's rate, magnetometer and barometer
        at 50 Hz, GNSS at 10 Hz.
        """
        return {
            "imu": FLIGHT_IMU,
            "magnetometer": Magnetometer(),
            "barometer": Barometer(),
            "gnss": Gnss(),
        }

    @property
    def outside_ports(self) -> tuple[int, int]:
        """UDP ports for an external program: PX4's onboard port and the joint port (by
        default, instance 0's).
        """
        instance = max(self.instance, 0)
        return ONBOARD_PORT + instance, JOINT_PORT + instance

    def connect(self, scenario: Scenario, tape: Tape) -> PX4Link:
        """Start PX4 with the vehicle's parameters and wait for its connection."""
        return PX4Link(self, scenario, tape)


make_px4 = AutopilotMaker(PX4)


def find_etc(program: Path) -> Path:
    """Find PX4's folder ``etc`` of start scripts, next to the program or next to the
    program's folder.

    Raises:
        ScenarioError: there is none.
    """
    # of a link in another folder the program itself has it beside it
    for file in (program, program.resolve()):
        for place in (file.parent / "etc", file.parent.parent / "etc"):
            if place.is_dir():
                return place
    raise ScenarioError(
        f"controller.program = {str(program)!r}: must have PX4's folder 'etc' beside"
        " it, or beside its folder"
    )


class PX4Link(ProgramLink):
    """Connection to a running PX4: its process, the simulator's TCP stream, and the
    onboard MAVLink port.

    Raises:
        ScenarioError: no program, or a vehicle that PX4 cannot fly.
        LinkError: PX4 does not start or does not connect.
    """

    _record: PX4

    def __init__(self, record: PX4, scenario: Scenario, tape: Tape) -> None:
        super().__init__(record, scenario, tape)
        self._udp: socket.socket | None = None
        self._partner = ("", 0)
        self._rate = scenario.rates.control
        # set points go out at 50 Hz
        self._goal_every = max(1, self._rate // 50)
        self._sensors = SensorMessages()
        self._simulator, self._sequence = mavlink.Parser(), 0
        self._vehicle = GuidedVehicle(
            PX4_NUMBER, self._carry, record.parameters, datagrams=True
        )
        self._row = self._answered = self._missed = self._failsafes = 0
        self._silence = 0.0
        self._armed = self._ready = self._leaves = self._failing = False
        # the nominal one, as of a real vehicle: the simulated plant may differ from it
        model = scenario.agent.model
        needed = vehicle_parameters(
            model.vehicle, float(model.gravity)
        ) | sensor_parameters(scenario)
        needed |= OUTSIDE_PARAMETERS if record.outside else {}
        if not tape.plays:
            self._start(needed | dict(record.parameters))

    def _start(self, parameters: Mapping[str, float]) -> None:
        """Open PX4's ports, start its program, and accept its connection."""
        record = self._record
        program = find_program(record, "px4")
        etc = find_etc(program)
        # PX4 is instance 0 unless it was told another, and a program that runs already
        # cannot be given any free one (-1)
        ports = open_ports(
            max(record.instance, 0) if record.outside else record.instance
        )
        self._udp = self._held.enter_context(ports.onboard)
        self._partner = ports.partner
        self._held.enter_context(ports.listener)
        with self._starting():
            environment = {
                f"PX4_PARAM_{name}": f"{value:.9g}"
                for name, value in parameters.items()
            }
            # a model that starts no simulator: PX4 waits for the one at our port
            environment["PX4_SIM_MODEL"] = "none_iris"
            folder = self._make_folder()
            ours, theirs = ports.onboard.getsockname()[1], ports.partner[1]
            # -r: bytes per second, as PX4's own scripts allow an onboard link
            (folder / LINKS).write_text(
                f"mavlink start -u {theirs} -o {ours} -m onboard -r 4000000\n", "ascii"
            )
            environment["PATH"] = os.pathsep.join(
                (os.environ.get("PATH", os.defpath), str(folder))
            )
            command = [
                str(program),
                # no shell; then number of the instance, and working folder
                "-d",
                "-i",
                str(ports.instance),
                "-w",
                str(folder),
                str(etc),
            ]
            # a variable of the user's shell must not change the parameters
            self._launch(command, folder, environment, without="PX4_")
            self._tcp = self._accept(ports.listener)
            # else it keeps the instance, whose onboard port is to be free
            if not record.outside:
                ports.listener.close()

    def release(self) -> None:
        """Request PX4's hold mode, after which its onboard port is free for an external
        program.
        """
        self._leaves = True

    @property
    def facts(self) -> dict[str, Plain]:
        """Counts of the exchange with PX4 (sent, answered, missed, failsafes) and its
        last message.
        """
        return {
            "steps": self._steps,
            "answered": self._answered,
            "lockstep_missed": self._missed,
            "left_offboard": self._vehicle.away,
            "failsafes": self._failsafes,
            "said": self._vehicle.said,
            "bad_frames": self._simulator.bad + self._vehicle.parser.bad,
        }

    def exchange(self, now: SensedInstant, goal: BaseGoal) -> Numbers:
        """Send the sensor readings and the set point of an instant; wait for the rotor
        signals of the same time.
        """
        # of time 0, too, above 0, which is no time in PX4
        stamp = round(now.time * 1e6) + 1
        self._steps += 1
        self._send(
            "HIL_SENSOR", time_usec=stamp, **self._sensors.inertial(now.readings)
        )
        satellite = self._sensors.satellite(now.readings)
        if satellite is not None:
            self._send("HIL_GPS", time_usec=stamp, **satellite)
        if self._answered and not self.released:
            self._talk(now.time, goal)
        self._await(stamp)
        return self._signals

    def _send(self, name: str, **fields: float) -> None:
        """Send a MAVLink message over the simulator's TCP stream."""
        try:
            # component 200 is an inertial unit in MAVLink
            frame = mavlink.pack(
                name, sequence=self._sequence, system=1, component=200, **fields
            )
        except mavlink.MavlinkError as error:
            raise LinkError(f"a reading cannot be sent to PX4: {error}") from None
        self._sequence += 1
        self._tape.send("simulator", frame, self._write)

    def _await(self, stamp: int) -> None:
        """Wait for the answer to a sensor message; only briefly while PX4 starts or
        under external motor commands.
        """
        pause = STALL if self._answered else BOOT_STEP
        if self.released and self._record.outside:
            pause = HALT if self._row >= STEADY else HASTE / self._rate
        until, heard = time.monotonic() + pause, False
        while True:
            data = self._tape.receive("simulator", partial(self._read, until, heard))
            if not data:
                # a shorter pause is one in which PX4 need not answer
                self._missed += self._answered > 0 and pause >= HALT
                self._row = 0
                self._silence += pause
                if self._silence > self._record.patience:
                    raise LinkError(
                        f"PX4 has not answered for {self._record.patience:g}"
                        f" s{self._ending}"
                    )
                return
            heard = True
            for message in self._simulator.feed(data):
                if message.name == "HIL_ACTUATOR_CONTROLS" and self._take_controls(
                    message, stamp
                ):
                    return
            if self._simulator.skipped > BABBLE:
                raise LinkError(
                    f"PX4's simulator port: {self._simulator.skipped} bytes that are no"
                    " MAVLink"
                )

    def _take_controls(self, message: mavlink.Message, stamp: int) -> bool:
        """Store the rotor signals of an answer; True if it answers the sensor message
        of the given time.
        """
        controls, answered = message["controls"][: self._rotors], message["time_usec"]
        if not message["flags"] & LOCKSTEP:
            raise LinkError(
                "PX4 does not run in lockstep: it must be built with its lockstep"
                " scheduler"
            )
        if answered > stamp:
            raise LinkError(
                f"PX4 answered with the time {answered} us before it was sent: must be"
                f" {stamp} us"
            )
        # controls may lie outside by rounding, and then count as 0 or 1
        if not all(-1e-3 <= each <= 1.001 for each in controls):
            raise LinkError(
                "PX4 sent controls that are not from 0 to 1:"
                f" {[round(each, 4) for each in controls]}"
            )
        self._signals = tuple(min(max(each, 0.0), 1.0) for each in controls)
        self._armed = bool(message["mode"] & ARMED)
        if self.released and not self._armed:
            raise LinkError("PX4 disarmed in flight")
        # an answer to an earlier message is no answer to this one: the wait goes on
        if answered != stamp:
            return False
        if not self._answered:
            self._require_parameters()
        self._answered += 1
        self._row += 1
        self._silence = 0.0
        return True

    def _require_parameters(self) -> None:
        """Raise an error for user parameters that PX4 does not have, once it has read
        them.
        """
        if self._child is None:
            return
        printed = self._child.output
        for name, value in self._record.parameters:
            if f"Parameter {name} not found" in printed:
                raise LinkError(
                    f"controller.parameters.{name} = {value:g}: must be a parameter"
                    " that PX4 knows"
                )

    def _read(self, until: float, heard: bool) -> bytes:
        """Bytes received from PX4 over the simulator's TCP connection; empty once the
        time limit has passed.
        """
        assert self._tcp is not None
        if heard and time.monotonic() > until:
            return b""
        try:
            # a timeout of 0 would not wait at all, and one below it is refused
            self._tcp.settimeout(max(until - time.monotonic(), 1e-4))
            data = self._tcp.recv(65536)
        except TimeoutError:
            return b""
        except OSError:
            raise self._closing_error() from None
        if not data:
            raise self._closing_error()
        return data

    def _talk(self, t: float, goal: BaseGoal) -> None:
        """Exchange MAVLink with PX4: read its state, request offboard mode and arming,
        and send set points at 50 Hz.
        """
        data, vehicle = self._tape.receive("onboard", self._datagrams), self._vehicle
        for message in vehicle.parser.feed(data) if data else ():
            self._hear(message)
        # five times a second, chosen
        if vehicle.system and self._steps % (10 * self._goal_every) == 0:
            vehicle.beat()
        if not (vehicle.system and vehicle.has_parameters(t, REPLIES)):
            return
        if vehicle.origin is None:
            self._find_origin()
            return
        if self._steps % self._goal_every == 0:
            vehicle.send_goal(t, goal)
        if self._leaves:
            self._leave()
        elif self.following:
            vehicle.require_obedience(self._armed, 1.0 / self._rate)
        if self._steps % self._rate == 0 and not self.released:
            self._request()

    def _request(self) -> None:
        """Request offboard mode and arming in alternate seconds until PX4 has accepted
        both.

        The seconds are simulated, and the state that PX4 reports once a second of its
        own is not waited for: so flights begin alike.
        """
        vehicle = self._vehicle
        if self._steps % (2 * self._rate):
            if not self._armed:
                vehicle.command(ARM, 1)
        elif self._leaves:
            vehicle.set_parameter("COM_OF_LOSS_T", OFFBOARD_LOSS)
            vehicle.request_hold()
        elif not (self._armed and vehicle.obeys):
            vehicle.request_outside()

    def _leave(self) -> None:
        """Free the onboard port once PX4 is in hold mode."""
        if self._vehicle.holds and self._udp is not None:
            self._udp.close()
            self.released = True

    def _find_origin(self) -> None:
        """Estimate the origin of PX4's local frame at rest, from the mean difference of
        its position and the readings.

        It is found at a whole second, so that flights begin alike.
        """
        count = self._vehicle.compare_place(
            self._sensors.fix, self._ready and not self._armed
        )
        # once a second, from the last two seconds; both chosen
        if count >= SETTLED * self._rate and self._steps % self._rate == 0:
            self._vehicle.find_origin(2 * self._rate)

    def _datagrams(self) -> bytes:
        """Bytes that have arrived from PX4 at the onboard port; other senders are
        ignored.
        """
        assert self._udp is not None
        # one of ours found nobody: whether PX4 lives shows at the simulator's port
        with suppress(ConnectionError):
            return b"".join(
                data for data, sender in drain(self._udp) if sender == self._partner
            )
        return b""

    def _carry(self, frame: bytes) -> None:
        """Send a MAVLink frame to PX4 over its onboard port."""
        self._tape.send("onboard", frame, self._write_datagram)

    def _write_datagram(self, data: bytes) -> None:
        assert self._udp is not None
        # a datagram that is lost is sent again with the next period
        with suppress(OSError):
            self._udp.sendto(data, self._partner)

    def _hear(self, message: mavlink.Message) -> None:
        """Store PX4's state from a MAVLink message: mode, position, texts, and validity
        of its estimates.
        """
        vehicle = self._vehicle
        if not vehicle.hear(message):
            return
        if message.name == "HEARTBEAT":
            failing = self.following and vehicle.status == CRITICAL
            self._failsafes += failing and not self._failing
            self._failing = failing
        elif message.name == "ESTIMATOR_STATUS":
            self._ready = message["flags"] & ESTIMATED == ESTIMATED
        elif message.name == "LOCAL_POSITION_NED":
            high = (
                self._armed
                and vehicle.obeys
                and vehicle.rise(self._stand) > 0.5 * self._record.climb
            )
            if high and not self.following:
                # texts of the take-off would be taken for the cause of a later loss
                self.following, vehicle.said = True, ""
