"""Flight under an autopilot: take-off from a stand, hand-over at the scenario's start,
then step by step.
"""

from __future__ import annotations

import contextlib
import math
import time
import weakref
from collections.abc import Callable, Sequence
from dataclasses import replace

from skyarm.algebra import ZERO3_DATA, Vec3
from skyarm.control.blocks.geometric import yaw_of
from skyarm.control.controller import autopilot_of
from skyarm.dynamics.actuators import Command
from skyarm.links.autopilots.autopilot import (
    Autopilot,
    BaseGoal,
    LinkError,
    SensedInstant,
    SimulatorLink,
    inertial_unit,
    require_rotors,
)
from skyarm.links.joint_port import JointPortError, JointServer
from skyarm.links.transcript import Tape, TranscriptError
from skyarm.log.flight_log import Log
from skyarm.log.metrics.windows import Windows
from skyarm.records.files import errors_as
from skyarm.reference import Reference, Trajectory, hover
from skyarm.scenario.in_flight import stretches
from skyarm.scenario.scenario_checks import check_scenario
from skyarm.scenario.scenario_record import (
    Environment,
    NamedSensor,
    Rates,
    Scenario,
    ScenarioError,
    first_state,
)
from skyarm.sensing.sensor_kinds import mount_rotation
from skyarm.simulate.check_endings import Ended
from skyarm.simulate.course import Course
from skyarm.simulate.session import Session, Snapshot
from skyarm.world.launch_stand import LaunchStand

ENDED = "autopilot"
"""Status of a flight that ended because its autopilot failed."""

LATE = 0.02
"""Lag (s) behind the wall clock that a real-time flight makes up for; beyond, its clock
is reset. Chosen: on two busy cores a sleep of 2 ms lasts up to 5 ms longer (measured),
which is made up for."""

NEAR = 0.15
"""Distance (m) from the start within which the flight is handed over, after ``STEADY``;
a smaller one is within an autopilot's own noise in hover."""

SLOW = 0.15
"""Largest speed (m/s) at hand-over; chosen."""

STEADY = 2.0
"""Time (s) within the limits of distance and speed before the flight begins; chosen,
beyond a mere passage through them."""


def planned_scenario(scenario: Scenario) -> Scenario:
    """Adapt the control rate and the sensors of a scenario to its autopilot.

    A flight for a program outside hovers at the start, whatever the scenario's
    reference. The control rate is that of the sensor messages: the least that is fast
    enough, a divisor of the physics' rate and a multiple of the reference's and of the
    sensors' rates. A scenario that has all that is returned unchanged.

    Raises:
        ScenarioError: no such rate, a task in contact, or a plant whose rotors the
            autopilot's signals do not fit.
    """
    autopilot: Autopilot = autopilot_of(scenario.agent.controller)
    require_free_flight(scenario)
    require_rotors(
        scenario.agent.vehicle, scenario.agent.model.vehicle, autopilot.title
    )
    if autopilot.outside:
        _ = autopilot.outside_ports  # refuses an autopilot without any
        if autopilot.transcript or autopilot.replayed:
            given = "transcript" if autopilot.transcript else "replayed"
            raise ScenarioError(
                f"controller.{given}: must be left out where a program outside commands"
            )
        hovers = hover_at_start(scenario)
        scenario = scenario.with_agent(
            replace(scenario.agent, reference=hovers, tracking_start=0, path_time=None)
        )
    there = {each.name for each in scenario.agent.sensors}
    needed = autopilot.sensors(scenario.agent.vehicle)
    added = tuple(
        NamedSensor(name=name, sensor=each)
        for name, each in needed.items()
        if name not in there
    )
    for each in scenario.agent.sensors:
        if each.name in needed and type(each.sensor) is not type(needed[each.name]):
            kind = type(needed[each.name]).__name__
            raise ScenarioError(
                f"sensors.{each.name}: must be a {kind} for {autopilot.title}"
            )
    rates, sensors = scenario.rates, (*scenario.agent.sensors, *added)
    slow = [
        rates.reference,
        *(round(each.sensor.frequency) for each in sensors if each.sensor.frequency),
    ]
    # every rate must fit a whole number of times into the control rate
    common = math.lcm(*slow)
    least = max(
        autopilot.least_rate, rates.control if not rates.control % common else 0
    )
    control = common * math.ceil(least / common)
    physics = control * max(1, math.ceil(rates.physics / control))
    planned = Rates(physics=physics, control=control, reference=rates.reference)
    if not added and planned == rates:
        return scenario
    equipped = scenario.with_agent(replace(scenario.agent, sensors=sensors))
    return replace(equipped, rates=planned)


def require_free_flight(scenario: Scenario) -> None:
    """Raise an error if a flight needs contact control, or if its start lies too close
    to a surface for the hand-over.

    Raises:
        ScenarioError: a reference that presses, or a start closer to a surface than the
            hand-over is exact.
    """
    autopilot: Autopilot = autopilot_of(scenario.agent.controller)
    # a program outside replaces the reference, whose pushes then do not count
    for stretch in () if autopilot.outside else stretches(scenario):
        require_no_push(stretch.overrides.of(scenario), autopilot.title)
    for contact in scenario.worlds:
        from skyarm.world.contact.initial_world import initial_clearance

        distance, what, surface = initial_clearance(
            contact, scenario.agent.vehicle, first_state(scenario)
        )
        if distance < NEAR:
            raise ScenarioError(
                f"initial: {what} starts {distance:.3g} m from surface"
                f" {surface!r}: must be at least {NEAR:g} m away, {autopilot.title}"
                " takes off and hands over within that"
            )


def require_no_push(scenario: Scenario, title: str) -> None:
    """Raise an error if a reference requests a contact force.

    Raises:
        ScenarioError: it does.
    """
    if scenario.agent.reference.push is not None:
        raise ScenarioError(
            f"reference: must have no push and no phase in contact for {title}, which"
            " controls no contact force: it needs a law"
        )


def hover_at_start(scenario: Scenario) -> Trajectory:
    """Reference that holds the initial pose of the base and the initial joint
    positions.
    """
    start = first_state(scenario)
    x, y, z = map(float, start.position)
    return hover(
        (x, y, z),
        yaw=float(yaw_of(start.quaternion)),
        joints=tuple(map(float, start.joints)),
    )


def take_off_scenario(scenario: Scenario) -> Scenario:
    """Scenario of the take-off: calm air, a launch stand below the start, and hover at
    the start as reference.
    """
    autopilot: Autopilot = autopilot_of(scenario.agent.controller)
    start, vehicle = first_state(scenario), scenario.agent.vehicle
    yaw = float(yaw_of(start.quaternion))
    x, y, z = map(float, start.position)
    half = 0.5 * yaw
    inertia = vehicle.base.inertia
    stand = LaunchStand(
        place=Vec3(x, y, z - autopilot.climb),
        yaw=yaw,
        mass=float(vehicle.mass),
        inertia=float(min(inertia.xx, inertia.yy, inertia.zz)),
        gravity=float(scenario.agent.plant.gravity),
    )
    resting = replace(
        start,
        # loaded: an accelerometer reads weight from the first instant
        position=stand.rest,
        quaternion=type(start.quaternion)(math.cos(half), 0.0, 0.0, math.sin(half)),
        velocity=ZERO3_DATA,
        rate=ZERO3_DATA,
        joint_rates=vehicle.zeros,
        rotor_speeds=(0.0,) * len(vehicle.rotors),
    )
    # the take-off has its own scenario: wind, faults, payloads and changes belong to
    # the flight and would act at the wrong time
    agent = replace(
        scenario.agent,
        reference=hover_at_start(scenario),
        initial=resting,
        tracking_start=0,
        path_time=None,
        faults=(),
        payloads=(),
    )
    return replace(
        scenario.with_agent(agent),
        duration=autopilot.preparation,
        environment=Environment(forces=(stand,), ground=False),
        endings=(),
        changes=(),
        windows=Windows(),
    )


def goal_of(reference: Reference) -> BaseGoal:
    """Set point of the base from a reference."""
    return BaseGoal(
        position=tuple(map(float, reference.position)),
        velocity=tuple(map(float, reference.velocity)),
        acceleration=tuple(map(float, reference.acceleration)),
        yaw=float(reference.yaw),
    )


class PilotedSession(Session):
    """Session in which an autopilot's program flies the base: it reads the sensors and
    commands the rotors.

    Making one starts the program, lets the vehicle take off from a stand and hands it
    over at the scenario's start: time 0 is the hand-over, and the flight begins with
    the state that the vehicle has then. An autopilot that does not get that far leaves
    its take-off as the session's flight, ended with the cause.

    In each control period the readings go to the autopilot, whose answer the rotors get
    in the next period; the arm follows its reference by a joint law
    (:func:`skyarm.links.autopilots.autopilot.move_arm`).

    Of an autopilot that a program outside commands (``outside``) the flight is in real
    time from hand-over on: the autopilot holds the start, and set points of base and
    arm come over its own port and the joints' port.

    Args:
        scenario: scenario with the controller of an autopilot.
        paths: paths as of :class:`skyarm.Session`.
        machine_code: choice as of :class:`skyarm.Session`.
        progress: called with simulated seconds of the take-off and the longest it may
            last; equal at the hand-over.

    Raises:
        ScenarioError: a vehicle that the autopilot cannot fly, or no program.
    """

    returns = False

    def __init__(
        self,
        scenario: Scenario,
        paths: Sequence[str] = (),
        *,
        machine_code: bool = True,
        progress: Callable[[float, float], object] | None = None,
    ) -> None:
        planned = planned_scenario(scenario)
        take_off = take_off_scenario(planned)
        # their clocks and sensors are others than the scenario's
        for each in (planned, take_off):
            check_scenario(each)
        self._autopilot: Autopilot = autopilot_of(planned.agent.controller)
        self._tape = Tape(
            self._autopilot.transcript, self._autopilot.replayed, self._autopilot.name
        )
        self._seconds, self._prepared = 0.0, 0.0
        self._link: SimulatorLink | None = None
        self._joint_port: JointServer | None = None
        self._joint_server: JointServer | None = None  # the port from the hand-over on
        self._wall, self._late = 0.0, 0
        self._state: list[float] = []  # true, at the last exchange
        stopped = (0.0,) * len(planned.agent.vehicle.rotors)
        self._signals: Sequence[float] = stopped
        # measured, the last period's: a program outside gets what an encoder reads
        self._arm: list[float] = []
        super().__init__(take_off, machine_code=machine_code)
        self._begin_flight()
        try:
            self._open_joint_port()
            self._connect(planned)
            if self._take_off(progress):
                state = self.state
                super().__init__(
                    planned.with_initial(state), paths, machine_code=machine_code
                )
                self._begin_flight()
                self._joint_server, self._wall = self._joint_port, time.monotonic()
                if progress is not None:
                    progress(self._prepared, self._prepared)
        except BaseException:
            self.close()
            raise

    def _connect(self, planned: Scenario) -> None:
        """Start the autopilot's program; if that fails the flight ends before its first
        control period.
        """
        try:
            self._link = self._autopilot.connect(planned, self._tape)
        except LinkError as error:
            self._end(str(error))
            return
        self._closer = weakref.finalize(self, _close, self._link, self._tape)

    def _open_joint_port(self) -> None:
        """Open the joint port for an external program.

        Raises:
            ScenarioError: it is taken.
        """
        autopilot = self._autopilot
        if not autopilot.outside:
            return
        with errors_as(ScenarioError, of=JointPortError):
            self._joint_port = JointServer(
                autopilot.outside_ports[1], self.scenario.agent.vehicle.n
            )

    def _keep_pace(self) -> None:
        """Wait until the wall clock reaches the flight time; lost time is not caught
        up.
        """
        ahead = self._wall + self.time - time.monotonic()
        if ahead > 0.0:
            time.sleep(ahead)
        # caught up, the program outside would get its states faster than in real time
        elif ahead < -LATE:
            self._wall -= ahead
            self._late += 1

    def _begin_flight(self) -> None:
        """Prepare set point, clock and inertial axes when a flight begins."""
        # drivers turn what they read into base axes; the place is a parameter of the
        # autopilot
        self._axes = mount_rotation(inertial_unit(self.scenario).turned_by)
        self._every = self.scenario.rates.control // self.scenario.rates.reference
        self._period = self.scenario.rates.period
        self._goal = goal_of(self.reference)

    def _take_off(self, progress: Callable[[float, float], object] | None) -> bool:
        """Fly from the launch stand to the start; False if the flight ended before the
        hand-over.

        The hand-over is at a whole second, so that flights whose autopilot is not quite
        repeatable begin alike.
        """
        goal = self._goal.position
        steady, rate = 0, self.scenario.rates.control
        while self.step():
            if progress is not None and self.tick % rate == 0:
                progress(self.time, self._autopilot.preparation)
            state = self._state
            # position and velocity, in the order of State
            near = math.dist(state[:3], goal) < NEAR and math.hypot(*state[7:10]) < SLOW
            steady = (
                steady + 1
                if near and self._link is not None and self._link.following
                else 0
            )
            if steady < STEADY * rate or self.tick % rate or self._link is None:
                continue
            if not self._autopilot.outside or self._link.released:
                self._prepared = self.time
                return True
            self._link.release()
        if self.ended is None:
            self._end(
                f"{self._autopilot.title} does not hover at the start after"
                f" {self.time:g} s{self._words()}"
            )
        return False

    def _words(self) -> str:
        """Last message of the autopilot, as the end of an error text; empty if there is
        none.
        """
        said = "" if self._link is None else str(self._link.facts.get("said", ""))
        return f": {said}" if said else ""

    def _end(self, cause: str) -> None:
        """End the flight with a cause and close the autopilot; the log so far is
        kept.
        """
        self._engine.ended = Ended(ENDED, " ".join(cause.split()), self.time)
        self.close()

    def step(self, command: object = None, *, rotors: object = None) -> bool:
        """Simulate one control period, send its sensor readings to the autopilot, and
        receive the next rotor signals.

        Raises:
            ScenarioError: a command: the autopilot commands.
        """
        if command is not None or rotors is not None:
            raise ScenarioError(
                f"command: must be left out, {self._autopilot.title} commands the"
                " rotors"
            )
        if not self.running or self._link is None:
            return False
        rotors = self.scenario.agent.vehicle.rotors
        speeds = [
            signal * float(rotor.max_speed)
            for signal, rotor in zip(self._signals, rotors, strict=True)
        ]
        going = (
            super().step(rotors=speeds)
            if self._joint_server is None
            else self._step_with_port(speeds)
        )
        if not going:
            self.close()
            return False
        recorder, tick = self._engine.recorder, self.tick
        row = recorder.row(tick - 1).tolist()
        if self._joint_server is not None:
            self._arm = row[recorder.joint_columns]
        if tick % self._every == 0:
            self._goal = goal_of(self.reference)
        self._seconds = self._prepared + (tick - 1) * self._period
        self._tape.time = self._seconds
        # a row begins with a flag, then position, attitude, velocity and rate
        self._state = row[1:14]
        readings = {
            name: row[where] for name, where in recorder.reading_columns.items()
        }
        for reading in readings.values():
            reading[0] += self._prepared  # the clock of the link goes on at hand-over
        if self._axes is not None:
            time, *read = readings["imu"]
            readings["imu"] = [
                time,
                *self._axes.apply(Vec3(*read[:3])),
                *self._axes.apply(Vec3(*read[3:])),
            ]
        try:
            self._signals = self._link.exchange(
                SensedInstant(self._seconds, readings, self._state), self._goal
            )
            within = [each for each in self._signals if 0.0 <= each <= 1.0]
            if not len(within) == len(self._signals) == len(rotors):
                raise LinkError(
                    f"{self._autopilot.title} sent rotor signals: must be {len(rotors)}"
                    " from 0 to 1"
                )
        except (LinkError, TranscriptError) as error:
            self._end(str(error))
            return False
        return True

    def _step_with_port(self, speeds: list[float]) -> bool:
        """Simulate one control period in real time; joint set points of an external
        program replace the joint law's.
        """
        assert self._joint_server is not None
        self._keep_pace()
        arm, half = self._arm, len(self._arm) // 2
        setpoints = self._joint_server.exchange(
            self._prepared + self.time, arm[:half], arm[half:]
        )
        if setpoints is None:
            return super().step(rotors=speeds)
        return super().step(Command(rotor_speeds=tuple(speeds), efforts=setpoints))

    def fly(self, stop: int) -> bool:
        """Simulate for about a tenth of a second of wall time, at most up to control
        period ``stop``.
        """
        # some periods of a slow machine last longer: the caller must get its turn
        until, going = time.perf_counter() + 0.1, self.running
        while going and self.tick < stop:
            going = self.step()
            if time.perf_counter() > until:
                break
        return going

    def _continue_with(self, course: Course) -> None:
        """Continue under a changed scenario; raise an error if its reference requests a
        contact force.
        """
        require_no_push(course.now, self._autopilot.title)
        super()._continue_with(course)

    @property
    def log(self) -> Log:
        """Log of the flight so far, with name and counts of the autopilot's link."""
        log = super().log
        facts = {} if self._link is None else self._link.facts
        said = {"name": self._autopilot.name, "prepared_s": self._prepared, **facts}
        if self._joint_server is not None:
            said |= {"joints": self._joint_server.facts, "set_back": self._late}
        return replace(log, info={**log.info, "autopilot": said})

    def snapshot(self) -> Snapshot:
        """Raise an error, since the state of an autopilot's program cannot be
        copied.
        """
        raise ScenarioError(
            f"snapshot: must not be taken while {self._autopilot.title} flies: it"
            " cannot go back"
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Raise an error, since an autopilot's program cannot go back in time."""
        raise ScenarioError(
            f"snapshot: must not be restored while {self._autopilot.title} flies: it"
            " cannot go back"
        )

    def close(self) -> None:
        """End the autopilot's program; a second call does nothing."""
        if self._joint_port is not None:
            self._joint_port.close()
        try:
            if self._link is None:
                self._tape.close()
            else:
                self._closer()
        except TranscriptError as error:  # what was flown is kept
            self._engine.ended = self.ended or Ended(ENDED, str(error), self.time)


def _close(link: SimulatorLink, tape: Tape) -> None:
    with contextlib.suppress(OSError):
        link.close()
    tape.close()
