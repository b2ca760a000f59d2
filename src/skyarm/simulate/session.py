"""A session: an episode flown one control period at a time, by its law or by commands from outside."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from typing import Any

from skyarm.actuation import Command
from skyarm.compile.machine_code import NoMachineCodeError
from skyarm.dynamics import State
from skyarm.files import shown
from skyarm.log.flight_log import Log
from skyarm.records.leaves import mismatch
from skyarm.reference import Reference
from skyarm.scenario.in_flight import NONE, Overrides, require_changes, require_continuous
from skyarm.scenario.numbers import require_apart
from skyarm.scenario.scenario_checks import require_flight
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.sensors.measurement import Measurement
from skyarm.simulate.assemble_log import joined
from skyarm.simulate.check_endings import Ended, going_on
from skyarm.simulate.clock_of_change import is_other_reference
from skyarm.simulate.command_from_outside import numbers_of_command
from skyarm.simulate.compiled_session import CompiledSteps
from skyarm.simulate.course import Course, Flying, Snapshot
from skyarm.simulate.lane_arguments import require_paths
from skyarm.simulate.lane_rules import require_latencies
from skyarm.simulate.loop_state import LoopState
from skyarm.simulate.session_code import SessionCode
from skyarm.simulate.staged_flight import StagedFlight

_NUMBERS = itertools.count()


class Session:
    """A session flies one episode period by period.

    On the rigid-body plant a law that can be traced flies in machine code, compiled when the session is made; any other
    law or plant flies stage by stage in Python. The numbers are those of :func:`skyarm.run`, to the last bit.

    Changes of the scenario (:attr:`skyarm.Scenario.changes`) take hold in their control periods, and those made by hand
    are kept beside them: :attr:`plan` is the scenario that flies the session again.

    Args:
        scenario: what is flown; its duration is the longest the session can get.
        paths: numbers that :meth:`change` will give other values often: machine code reads them in every period from
            the start. Others become such numbers, by code that is made anew, when they are changed first.
        machine_code: False flies stage by stage in Python whatever the law and the plant: slower, the same numbers.

    Raises:
        ScenarioError: not a scenario, or one with changes that cannot be made.

    Attributes:
        slow: why it flies in Python where machine code was wanted; else empty.
    """

    def __init__(self, scenario: Scenario, paths: Sequence[str] = (), *, machine_code: bool = True) -> None:
        require_flight(scenario)
        require_changes(scenario)
        self._paths = require_paths(paths)
        require_apart(scenario, self._paths)
        require_latencies(scenario, self._paths)
        self._course = Course.of(scenario)
        self._scenario = scenario
        self._compiles, self.slow = machine_code, ""
        self._begun, self._codes = scenario, list[SessionCode]()
        self._waits = bool(scenario.changes)
        self._engine: Any = self._make_engine(self._course)
        self._number = next(_NUMBERS)
        # the engine's own step is the session's, which a call between them would slow down by a tenth
        self._n = scenario.world.vehicle.n
        self._rotors = len(scenario.world.vehicle.rotors)
        self._tilts = len(scenario.world.vehicle.tilts)
        if self._waits:
            self._let_change()

    @property
    def scenario(self) -> Scenario:
        """What holds now, with the changes to come; :meth:`change` and :meth:`replace` make it another."""
        return self._scenario

    @property
    def plan(self) -> Scenario:
        """The scenario that :func:`skyarm.run` flies to the bits of this session: as it began, with all its changes.

        Commands from outside are no part of a scenario; one that was replaced as a whole says the last.
        """
        return self._course.plan

    @property
    def tick(self) -> int:
        """Control periods flown."""
        tick: int = self._engine.tick
        return tick

    @property
    def time(self) -> float:
        """Time of the period that comes next, s."""
        return self.tick / self._scenario.rates.control

    @property
    def ended(self) -> Ended | None:
        """Why the episode has ended before its time, or None."""
        ended: Ended | None = self._engine.ended
        return ended

    @property
    def running(self) -> bool:
        """Whether another period can be flown."""
        return self.ended is None and self.tick < self._scenario.steps

    @property
    def state(self) -> State:
        """The plant's state now: the truth, which no law sees."""
        state: State = self._engine.state()
        return state

    @property
    def now(self) -> LoopState:
        """What the next period begins with: state, commands and readings on their way, every memory."""
        now: LoopState = self._engine.now
        return now

    @property
    def measurement(self) -> Measurement:
        """What the law is told in the period that comes next."""
        self._require_running()
        measurement: Measurement = self._engine.measurement()
        return measurement

    @property
    def reference(self) -> Reference:
        """The held reference of the period that comes next."""
        self._require_running()
        reference: Reference = self._engine.reference()
        return reference

    def step(self, command: Command | None = None) -> bool:
        """Fly one control period.

        Args:
            command: in place of the law's; the law is not asked then, and its memory stays.

        Returns:
            whether the episode goes on.

        Raises:
            ScenarioError: a command with another number of rotors or joints.
        """
        if command is None:
            going: bool = self._engine.step()
            if self._waits and going:
                self._let_change()
            return going
        numbers = numbers_of_command(command, self._rotors, self._n, self._tilts)
        going = self._engine.step(numbers)
        if self._waits and going:
            self._let_change()
        return going

    def run(self) -> Log:
        """Fly to the end; the log of everything since the session began."""
        while self._waits and self.step():
            pass
        step = self._engine.step
        while step():
            pass
        return self.log

    @property
    def log(self) -> Log:
        """What was flown so far, each period with the references that held in it; its scenario is :attr:`plan`."""
        engine = self._engine
        pieces = (*self._course.flown, engine.piece)
        return joined(self.plan, pieces, engine.ended or going_on(self._scenario, engine.tick))

    def snapshot(self) -> Snapshot:
        """The session now."""
        return Snapshot(self._course, self.tick, Flying(self._engine, self._engine.snapshot()), self._number)

    def restore(self, snapshot: Snapshot) -> None:
        """Go back, or forward again, to a snapshot of this session.

        Raises:
            ScenarioError: no snapshot, or one of another session.
        """
        if not isinstance(snapshot, Snapshot):
            raise ScenarioError(f"snapshot = {shown(snapshot)}: must be a Snapshot, which session.snapshot() gives")
        if snapshot.session != self._number:
            raise ScenarioError("snapshot: is of another session, must be of this one, whose snapshot() gives it")
        course, self._engine = snapshot.course, snapshot.flying.engine
        self._course, self._scenario, self._waits = course, course.now, bool(course.coming)
        self._engine.restore(snapshot.flying.held)

    def change(self, values: Mapping[str, Any]) -> None:
        """Give the scenario other numbers or parts by path, from the next period on, as ``[[changes]]`` of a file do.

        Args:
            values: path -> a number (:mod:`skyarm.scenario.numbers`), or what a file has in the place of a whole part
                (:mod:`skyarm.scenario.in_flight`): ``{"controller.law": "indi"}``. They take the place of the numbers
                with which the session began, and do not add up: a payload is one on top of what the vehicle carried.

        Raises:
            ScenarioError: no such number, one that cannot be, one with which a change to come could not be made, or a
                session that has ended; nothing is changed then.
        """
        self._require_running()
        self._go_on(self._course.with_values(self.tick, values, self._engine.piece))

    def replace(self, scenario: Scenario) -> None:
        """Fly on with another scenario: other gains, wind, payload, reference or law.

        State, commands and readings on their way and every memory stay; a law of another structure begins with its
        first memory.

        Raises:
            ScenarioError: another vehicle's structure, other clocks, delays or sensors, another plant; or a session
                that has ended.
        """
        self._require_running()
        require_flight(scenario)
        require_changes(scenario)
        old = self._scenario
        require_continuous(old, scenario)
        scenario = dataclasses.replace(scenario, seed=old.seed, episode=old.episode)
        self._go_on(self._course.replaced(self.tick, scenario, self._engine.piece))

    def _make_engine(self, course: Course) -> CompiledSteps | StagedFlight:
        """Machine code where it can be made, else the stages one by one."""
        scenario = course.now
        if self._compiles and scenario.plant == "rigid_body" and scenario.controller.compiled:
            if course.begun is not self._begun:
                self._begun, self._codes = course.begun, []
            # code that flies on after a change is made in a hurry: the vehicle is in the air
            effort = 2 if course.overrides is NONE and not (self._waits or self._paths) else 0
            try:
                return CompiledSteps(course.begun, scenario, self._read(course), self._codes, effort)
            except NoMachineCodeError as error:
                self.slow = str(error)
        return StagedFlight(scenario)

    def _let_change(self) -> None:
        """Let the changes take hold that the next period begins with."""
        if self._course.due(self.tick):
            self._go_on(self._course.then(self.tick, self._engine.piece))

    def _read(self, course: Course) -> Overrides:
        """The numbers that machine code reads in every period."""
        return course.overrides.data(course.begun, self._paths)

    def _go_on(self, course: Course) -> None:
        """Fly on along another course."""
        new, old = dict(course.overrides.numbers), dict(self._course.overrides.numbers)
        changed = [path for path in {**new, **old} if new.get(path) != old.get(path)]
        # noise that is turned up from none draws other numbers
        steady = course.begun is self._course.begun and not any(path.startswith("sensors.") for path in changed)
        if not (steady and self._engine.give(course.now, self._read(course), changed)):
            engine = self._make_engine(course)
            different = mismatch(self._engine.first.sensors, engine.first.sensors, "sensors")
            if different:
                raise ScenarioError(f"{different}: must be as the session began, since readings are on their way")
            before = self._course
            anew = is_other_reference(course.begun, course.overrides, before.begun, before.overrides)
            engine.take_over(self._engine, anew=anew)
            self._engine = engine
        self._course, self._scenario, self._waits = course, course.now, bool(course.coming)

    def _require_running(self) -> None:
        if not self.running:
            raise ScenarioError("session: has ended; there is no next period")
