"""A session: an episode flown one control period at a time, by its law or by commands from outside."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from skyarm.actuation import Command
from skyarm.compile.machine_code import NoMachineCodeError
from skyarm.dynamics import State
from skyarm.files import shown
from skyarm.log.flight_log import Log
from skyarm.records import coerce
from skyarm.records.coerce import RecordError
from skyarm.records.leaves import mismatch
from skyarm.reference import Reference
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_checks import require_flight
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.sensors.measurement import Measurement
from skyarm.simulate.check_endings import Ended
from skyarm.simulate.compiled_session import CompiledSteps
from skyarm.simulate.staged_flight import StagedFlight


@dataclass(frozen=True, slots=True)
class Snapshot:
    """A session at an instant, to go back to; it may be restored more than once.

    Attributes:
        scenario: as it was flown then. tick: control periods flown. held: what the engine keeps.
        session: number of the session that it is of.
    """

    scenario: Scenario
    tick: int
    held: Any
    session: int


_NUMBERS = itertools.count()


class Session:
    """A session flies one episode period by period.

    On the rigid-body plant a law that can be traced flies in machine code, compiled when the session is made; any other
    law or plant flies stage by stage in Python. The numbers are those of :func:`skyarm.run`, to the last bit.

    Args:
        scenario: what is flown; its duration is the longest the session can get.

    Raises:
        ScenarioError: not a scenario.
    """

    def __init__(self, scenario: Scenario) -> None:
        require_flight(scenario)
        self._scenario = scenario
        self._engine: Any = _engine(scenario)
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
            numbers = _plain_numbers(command)
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
        return Snapshot(self._scenario, self.tick, self._engine.snapshot(), self._number)

    def restore(self, snapshot: Snapshot) -> None:
        """Go back, or forward again, to a snapshot of this session.

        Raises:
            ScenarioError: no snapshot, or one of another session.
        """
        if not isinstance(snapshot, Snapshot):
            raise ScenarioError(f"snapshot = {shown(snapshot)}: must be a Snapshot, which session.snapshot() gives")
        if snapshot.session != self._number:
            raise ScenarioError("snapshot: is of another session, must be of this one, whose snapshot() gives it")
        if snapshot.scenario is not self._scenario:
            self._scenario, self._engine = snapshot.scenario, _engine(snapshot.scenario)
        self._engine.restore(snapshot.held)

    def change(self, values: Mapping[str, Any]) -> None:
        """Give the scenario other numbers by path (:mod:`skyarm.scenario.numbers`), from the next period on.

        Raises:
            ScenarioError: no such number, or one that cannot be.
        """
        try:
            changed = with_numbers(self._scenario, values)
        except ValueError as error:
            raise ScenarioError(str(error)) from None
        self.replace(changed)

    def replace(self, scenario: Scenario) -> None:
        """Fly on with another scenario: other gains, wind, payload, reference or law.

        State, commands and readings on their way and every memory stay; a law of another structure begins with its
        first memory.

        Raises:
            ScenarioError: another vehicle's structure, other clocks, delays or sensors, another plant.
        """
        require_flight(scenario)
        old = self._scenario
        _require_continuous(old, scenario)
        scenario = dataclasses.replace(scenario, seed=old.seed, episode=old.episode)
        engine = _engine(scenario)
        different = mismatch(self._engine.first.sensors, engine.first.sensors, "sensors")
        if different:
            raise ScenarioError(f"{different}: must be as the session began, since readings are on their way")
        engine.take_over(self._engine)
        self._scenario, self._engine = scenario, engine

    def _require_running(self) -> None:
        if not self.running:
            raise ScenarioError("session: has ended; there is no next period")


def _plain_numbers(command: Command) -> tuple[float, ...]:
    """The numbers of a command from outside.

    Raises:
        ScenarioError: one that is none.
    """
    found = []
    for field in ("rotor_speeds", "efforts"):
        for i, value in enumerate(getattr(command, field)):
            try:
                held = coerce.number(f"command.{field}[{i}]", value)
            except RecordError as error:
                raise ScenarioError(str(error)) from None
            if type(held) is not float:
                raise ScenarioError(f"command.{field}[{i}] = {shown(value)}: must be one number")
            found.append(held)
    return tuple(found)


def _require_continuous(old: Scenario, new: Scenario) -> None:
    """What a session cannot change is as it began.

    Raises:
        ScenarioError: names it.
    """
    delays, before, after = new.delays, old.world.vehicle, new.world.vehicle
    if old.delays.longest_command is not None:
        # a varied delay of the commands stands within a queue of the same length
        began = old.delays
        delays = dataclasses.replace(delays, command=began.command, rotors=began.rotors, joints=began.joints)
    pairs: list[tuple[str, Any, Any]] = [
        *((name, getattr(old, name), getattr(new, name)) for name in ("rates", "plant", "integrator", "duration")),
        ("delays", old.delays, delays),
        ("joints", before.n, after.n),
        ("rotors", len(before.rotors), len(after.rotors)),
    ]
    for name, began, value in pairs:
        if began != value:
            raise ScenarioError(f"{name} = {shown(value)}: must be {shown(began)} as the session began")


def _engine(scenario: Scenario) -> Any:
    """Machine code where it can be made, else the stages one by one."""
    if scenario.plant == "rigid_body" and scenario.controller.compiled:
        try:
            return CompiledSteps(scenario)
        except NoMachineCodeError:
            pass
    return StagedFlight(scenario)
