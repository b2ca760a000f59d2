"""A session: an episode flown one control period at a time, by its law or by commands from outside."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skyarm.actuation import Command
from skyarm.dynamics import State
from skyarm.files import shown
from skyarm.log.flight_log import Log
from skyarm.records.leaves import mismatch
from skyarm.reference import Reference
from skyarm.scenario.numbers import require_apart, with_numbers
from skyarm.scenario.scenario_checks import require_flight
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.sensors.measurement import Measurement
from skyarm.simulate.check_endings import Ended
from skyarm.simulate.lane_arguments import require_paths, require_values, require_within_queue
from skyarm.simulate.loop_state import LoopState
from skyarm.simulate.session_engine import make_engine, plain_numbers, require_continuous, with_data


@dataclass(frozen=True, slots=True)
class Snapshot:
    """A session at an instant, to go back to; it may be restored more than once.

    Attributes:
        scenario: as it was flown then. tick: control periods flown.
        engine: what flew it. held: what the engine keeps.
        session: number of the session that it is of.
        origin, numbers: scenario before its numbers were changed, and by what.
    """

    scenario: Scenario
    tick: int
    engine: Any
    held: Any
    session: int
    origin: Scenario
    numbers: Mapping[str, Any]


_NUMBERS = itertools.count()


class Session:
    """A session flies one episode period by period.

    On the rigid-body plant a law that can be traced flies in machine code, compiled when the session is made; any other
    law or plant flies stage by stage in Python. The numbers are those of :func:`skyarm.run`, to the last bit.

    Args:
        scenario: what is flown; its duration is the longest the session can get.
        paths: numbers that :meth:`change` will give other values often. Machine code reads them in every period
            instead of holding them as constants, so that a change of these compiles nothing; the bits are the same.

    Raises:
        ScenarioError: not a scenario, or a path that leads to no number of it.
    """

    def __init__(self, scenario: Scenario, paths: Sequence[str] = ()) -> None:
        require_flight(scenario)
        self._paths = require_paths(paths)
        require_apart(scenario, self._paths)
        self._scenario = self._origin = with_data(scenario, self._paths)
        self._numbers: dict[str, Any] = {}
        self._engine: Any = make_engine(self._origin, self._paths, {})
        self._number = next(_NUMBERS)
        # the engine's own step is the session's, which a call between them would slow down by a tenth
        self._n = scenario.world.vehicle.n
        self._rotors = len(scenario.world.vehicle.rotors)

    @property
    def scenario(self) -> Scenario:
        """What is flown. :meth:`change` gives it other numbers, :meth:`replace` other parts."""
        return self._scenario

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
            return going
        if not isinstance(command, Command):
            raise ScenarioError(f"command = {shown(command)}: must be a Command")
        if len(command.rotor_speeds) != self._rotors or len(command.efforts) != self._n:
            raise ScenarioError(
                f"command: {len(command.rotor_speeds)} rotor speeds and {len(command.efforts)} efforts: must be "
                f"{self._rotors} and {self._n}"
            )
        numbers = (*command.rotor_speeds, *command.efforts)
        if not all(type(number) is float for number in numbers):
            numbers = plain_numbers(command)
        going = self._engine.step(numbers)
        return going

    def run(self) -> Log:
        """Fly to the end; the log of everything since the session began."""
        step = self._engine.step
        while step():
            pass
        return self.log

    @property
    def log(self) -> Log:
        """What was flown so far; a session whose scenario was changed says the last one."""
        log: Log = self._engine.log()
        return log

    def snapshot(self) -> Snapshot:
        """The session now."""
        return Snapshot(
            self._scenario, self.tick, self._engine, self._engine.snapshot(), self._number, self._origin, self._numbers
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Go back, or forward again, to a snapshot of this session.

        Raises:
            ScenarioError: no snapshot, or one of another session.
        """
        if not isinstance(snapshot, Snapshot):
            raise ScenarioError(f"snapshot = {shown(snapshot)}: must be a Snapshot, which session.snapshot() gives")
        if snapshot.session != self._number:
            raise ScenarioError("snapshot: is of another session, must be of this one, whose snapshot() gives it")
        self._engine = snapshot.engine
        self._engine.restore(snapshot.held)
        self._scenario, self._origin, self._numbers = snapshot.scenario, snapshot.origin, dict(snapshot.numbers)

    def change(self, values: Mapping[str, Any]) -> None:
        """Give the scenario other numbers by path (:mod:`skyarm.scenario.numbers`), from the next period on.

        A payload's mass is what the vehicle carries beyond what it began with, however often it is changed.

        Raises:
            ScenarioError: no such number, or one that cannot be.
        """
        numbers = {**self._numbers, **require_values(values)}
        scenario, engine = with_numbers(self._origin, numbers), self._engine
        if set(values) <= set(engine.paths) and engine.bears(scenario):
            require_within_queue(self._origin, {path: np.array([float(value)]) for path, value in values.items()})
            engine.give(scenario, values)
            self._scenario = scenario
        else:
            self._fly_on(self._origin, numbers)
        self._numbers = numbers

    def replace(self, scenario: Scenario) -> None:
        """Fly on with another scenario: other gains, wind, payload, reference or law.

        State, commands and readings on their way and every memory stay; a law of another structure begins with its
        first memory.

        Raises:
            ScenarioError: another vehicle's structure, other clocks, delays or sensors, another plant.
        """
        require_flight(scenario)
        scenario = dataclasses.replace(scenario, seed=self._scenario.seed, episode=self._scenario.episode)
        self._fly_on(scenario, {})
        self._origin, self._numbers = scenario, {}

    def _fly_on(self, origin: Scenario, numbers: Mapping[str, Any]) -> None:
        """Fly on with another engine."""
        scenario = with_numbers(origin, numbers)
        require_continuous(self._scenario, scenario)
        engine = make_engine(origin, self._paths, numbers)
        different = mismatch(self._engine.first.sensors, engine.first.sensors, "sensors")
        if different:
            raise ScenarioError(f"{different}: must be as the session began, since readings are on their way")
        engine.take_over(self._engine)
        self._scenario, self._engine = scenario, engine

    def _require_running(self) -> None:
        if not self.running:
            raise ScenarioError("session: has ended; there is no next period")
