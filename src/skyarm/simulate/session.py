"""Interactive simulation of a flight, period by period, under the control law or the
user's commands.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from skyarm.dynamics.actuators import Command
from skyarm.log.flight_log import Log
from skyarm.records.files import errors_as, shown
from skyarm.records.files.user_code import first_not_finite
from skyarm.records.immutable import positional
from skyarm.records.leaves import mismatch
from skyarm.records.path_names import word_of
from skyarm.records.registry.registrations import function_of_option
from skyarm.scenario.in_flight import require_changes
from skyarm.scenario.scenario_checks import require_flight
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.simulate.assemble_log import join_pieces
from skyarm.simulate.check_endings import running_status
from skyarm.simulate.command_delay import numbers_of_command, rotor_numbers
from skyarm.simulate.course import Course
from skyarm.simulate.engine import Engine, EngineState
from skyarm.simulate.examine import has_own
from skyarm.simulate.flight_instant import FlightInstant
from skyarm.simulate.flight_programs import FlightPrograms
from skyarm.simulate.lane_numbers import require_paths
from skyarm.simulate.reference_clock import other_references


@positional
class Snapshot:
    """State of an interactive simulation at an instant, for going back to it any number
    of times.

    Attributes:
        course: scenario and changes as they were then. tick: control periods flown.
        engine: simulator that flew then. held: its state at that instant.
        session: number of the snapshot's session.
    """

    course: Course
    tick: int
    engine: Engine
    held: EngineState
    session: int


_NUMBERS = itertools.count()


class Session(FlightInstant):
    """Interactive simulation of one flight, period by period.

    On the rigid-body plant a law that can be traced flies in machine code, compiled
    when the session is made; any other law or plant flies stage by stage in Python. The
    numbers are those of :func:`skyarm.run`, to the last bit.

    Changes of the scenario (:attr:`skyarm.Scenario.changes`) take hold in their control
    periods, and those made by hand are kept beside them: :attr:`plan` is the scenario
    that flies the session again.

    Args:
        scenario: scenario that is flown; its duration is the longest the session can
            get.
        paths: numbers that :meth:`change` will give other values often: machine code
            reads them in every period from the start. Others become such numbers, by
            code that is made anew, when they are changed first.
        machine_code: False to fly stage by stage in Python whatever the law and the
            plant: slower, the same numbers.

    Raises:
        ScenarioError: not a scenario, or one with changes that cannot be made.
    """

    returns = True
    """True if :meth:`snapshot` and :meth:`restore` work; an external program that flies
    along cannot go back."""

    _window: int | None = None
    """Number of control periods in memory; None for all."""

    _commands = True
    """True if :meth:`step` accepts commands; without them the program is shorter."""

    def __new__(cls, scenario: Scenario, *_: Any, **__: Any) -> Session:
        """Create a session; an external autopilot in place of a control law has a
        session class of its own.
        """
        require_flight(scenario)
        autopilot = scenario.autopilot
        kind: type[Session] = (
            cls
            if autopilot is None or cls is not Session
            else function_of_option("fly AUTOPILOT")
        )
        return super().__new__(kind)

    def __init__(
        self,
        scenario: Scenario,
        paths: Sequence[str] = (),
        *,
        machine_code: bool = True,
    ) -> None:
        require_changes(scenario)
        paths = require_paths(scenario, paths)
        self._course = Course.of(scenario)
        self._taken = self._course.command_ranges
        self._programs = FlightPrograms(
            paths,
            machine_code=machine_code,
            commands=self._commands,
            window=self._window,
        )
        self._engine = self._programs.engine(self._course)
        self._number = next(_NUMBERS)
        self._apply_due_changes()

    @property
    def scenario(self) -> Scenario:
        """Scenario in force now, with the changes still scheduled."""
        return self._course.now

    @property
    def slow(self) -> str:
        """Reason for flying in Python where machine code was requested; else empty."""
        return self._programs.slow

    @property
    def plan(self) -> Scenario:
        """Scenario whose :func:`skyarm.run` reproduces this session to the bit: the
        initial one with all changes.

        Commands from outside are no part of a scenario.
        """
        return self._course.plan

    def step(
        self,
        command: Command | Mapping[str, Command] | None = None,
        *,
        rotors: Sequence[float] | Mapping[str, Sequence[float]] | None = None,
    ) -> bool:
        """Simulate one control period; a command, or rotor speeds (rad/s) alone, may
        take the place of the law's.

        Args:
            command: command in place of the law's; the law is not evaluated then, and
                its memory stays. Of several vehicles by name; those without one fly
                under their laws.
            rotors: rotor speeds (rad/s) in place of the law's, which still moves the
                joints; not beside ``command``. Of several vehicles by name.

        Returns:
            True if the episode continues.

        Raises:
            ScenarioError: a command with another number of rotors or joints, with a
                rotor speed out of its range, or of a vehicle that is not there.
        """
        if rotors is not None:
            numbers = self._of_each(
                "rotors",
                rotors,
                lambda each, taken: rotor_numbers(each, command, taken),
            )
            going = self._engine.step(numbers, rotors_only=True)
        else:
            going = self._engine.step(
                ()
                if command is None
                else self._of_each("command", command, numbers_of_command)
            )
        return self._goes_on(going)

    def _of_each(
        self, field: str, given: object, numbers: Callable[..., tuple[float, ...]]
    ) -> list[tuple[float, ...]]:
        """Numbers of the commands that are given to the vehicles, in order; empty for
        one under its law.
        """
        if len(self._taken) == 1:
            # an only vehicle's command needs no table with its name
            (taken,) = self._taken.values()
            return [numbers(given, taken)]
        if not isinstance(given, Mapping) or not given.keys() <= self._taken.keys():
            raise ScenarioError(
                f"{field} = {shown(given)}: must be a table by agent, of"
                f" {', '.join(self._taken)}"
            )
        found = list[tuple[float, ...]]()
        for name, taken in self._taken.items():
            with errors_as(ScenarioError, f"{name}: "):
                found.append(numbers(given[name], taken) if name in given else ())
        return found

    def run(self) -> Log:
        """Simulate to the end of the flight and return the log of the whole session."""
        while self.fly(self._course.now.steps):
            pass
        return self.log

    def fly(self, stop: int) -> bool:
        """Simulate several control periods under the law, at most up to period
        ``stop``; False once the flight is over.

        A stretch takes about a tenth of a second, and ends where the scenario changes.
        """
        if stop <= self.tick:
            return self.running
        if self._course.coming:
            stop = min(
                stop, self._course.coming[0].tick(self._course.begun.rates.control)
            )
        return self._goes_on(self._engine.fly(stop))

    def _goes_on(self, going: bool) -> bool:
        """Apply due changes to a flight that goes on, or name the cause of its end."""
        if self._course.coming and going:
            self._apply_due_changes()
        return going or self._name_cause()

    def _name_cause(self) -> bool:
        """Add the line of user code that produced the first infinite or NaN value to
        the cause of a termination.

        Returns False, as a flight does that is over.
        """
        engine = self._engine
        ended = engine.ended
        if (
            not ended
            or engine.commanded
            or not self.returns
            or not has_own(self.scenario)
        ):
            return False
        # a law that is called may act on things outside: it is not called again
        if self.scenario.is_compiled and ended.cause.endswith("is not finite"):
            # flown anew, as the state of the last sound period is not kept
            again = type(self)(self.plan, machine_code=self._programs.machine_code)
            before = again._engine
            again.returns = False
            now = before.now
            # a number may be on its way for some periods, as in a sensor's delay
            while again.tick < self.tick and again.step() and not again._engine.has_nan:
                before = again._engine
                now = again.now
            if line := first_not_finite(lambda: before.evaluate(before.evaluate(now))):
                engine.ended = replace(ended, cause=f"{ended.cause}; first in {line}")
        return False

    @property
    def log(self) -> Log:
        """Log of the flight so far; its scenario is :attr:`plan`."""
        engine = self._engine
        piece = engine.piece
        if self.running:  # it goes on to write where it has logged
            piece = replace(
                piece,
                flown=engine.recorder.samples(engine.begun, engine.tick, kept=True),
            )
        pieces = (*self._course.flown, piece)
        log = join_pieces(
            self.plan,
            pieces,
            engine.ended or running_status(self._course.now, engine.tick),
        )
        if engine.from_outside < engine.tick:
            # a team's log has the mark in each vehicle's, which may be saved alone
            for each in (log, *getattr(log, "agents", {}).values()):
                each.info["commanded"] = True
        return log

    def snapshot(self) -> Snapshot:
        """Copy of the session's current state, from which :meth:`restore` continues."""
        return Snapshot(
            self._course, self.tick, self._engine, self._engine.snapshot(), self._number
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Restore the session from one of its snapshots, earlier or later.

        Raises:
            ScenarioError: no snapshot, or one of another session.
        """
        if not isinstance(snapshot, Snapshot):
            raise ScenarioError(
                f"snapshot = {shown(snapshot)}: must be a Snapshot, which"
                " session.snapshot() gives"
            )
        if snapshot.session != self._number:
            raise ScenarioError(
                "snapshot: is of another session, must be of this one, whose snapshot()"
                " gives it"
            )
        self._course, self._engine = snapshot.course, snapshot.engine
        self._engine.restore(snapshot.held)
        self._taken = self._course.command_ranges

    def change(self, values: Mapping[str, Any]) -> None:
        """Change parameters or models, given by path such as plant.gravity, from the
        next period on.

        Args:
            values: path -> a number (:mod:`skyarm.scenario.numbers`), or what a file
                has in the place of a whole part (:mod:`skyarm.scenario.in_flight`):
                ``{"controller.law": "indi"}``. They take the place of the numbers with
                which the session began, and do not add up: a load is one on top of what
                the vehicle carried.

        Raises:
            ScenarioError: no such number, one that cannot be, one with which a change
                to come could not be made, or a session that has ended; nothing is
                changed then.
        """
        self._require_running()
        self._continue_with(
            self._course.with_values(self.tick, values, self._engine.piece)
        )

    def close(self) -> None:
        """Shut down programs that belong to the session, such as an autopilot; a
        control law's session has none.
        """

    def _apply_due_changes(self) -> None:
        """Apply the changes that are scheduled for the next control period."""
        if self._course.due(self.tick):
            self._continue_with(
                self._course.with_due_changes(self.tick, self._engine.piece)
            )

    def _continue_with(self, course: Course) -> None:
        """Continue the flight under a changed scenario, in a new simulator if the
        compiled program does not fit.
        """
        new, old = dict(course.overrides.numbers), dict(self._course.overrides.numbers)
        changed = [path for path in {**new, **old} if new.get(path) != old.get(path)]
        # noise that is turned up from none draws other numbers
        steady = not any(word_of(path).startswith("sensors.") for path in changed)
        numbers = dict(self._programs.read(course).numbers)
        if not (
            steady
            and self._engine.give(
                course.now, numbers, changed, self._programs.key(course)
            )
        ):
            engine = self._programs.engine(course)
            before, after = (
                [own.sensors for own in each.first.agents]
                for each in (self._engine, engine)
            )
            different = mismatch(tuple(before), tuple(after), "sensors")
            if different:
                raise ScenarioError(
                    f"{different}: must be as the session began, since readings are on"
                    " their way"
                )
            anew = other_references(
                course.now, course.overrides, self._course.overrides
            )
            engine.take_over(self._engine, anew=anew)
            self._engine = engine
        # last: whatever was refused above leaves the session as it was
        self._course = course
        self._taken = course.command_ranges


def open_session(
    scenario: Scenario,
    paths: Sequence[str] = (),
    *,
    machine_code: bool = True,
    make: Callable[..., Session] = Session,
    preparing: Callable[[float, float], object] | None = None,
) -> Session:
    """Open a session of a scenario: under its control law, or under its autopilot once
    that has taken off.

    Args:
        scenario: scenario that is flown.
        paths: argument of :class:`Session`.
        machine_code: argument of :class:`Session`.
        make: class of the session of a law.
        preparing: function called in an autopilot's take-off with its simulated seconds
            and the most that it may last.

    Raises:
        ScenarioError: as :class:`Session`; an autopilot without a program, or a vehicle
            that it cannot fly.
    """
    # checked by the session itself, before it is made
    autopilot = scenario.autopilot if isinstance(scenario, Scenario) else None
    if autopilot is None:
        return make(scenario, paths, machine_code=machine_code)
    piloted: Callable[..., Session] = function_of_option("fly AUTOPILOT")
    return piloted(scenario, paths, machine_code=machine_code, progress=preparing)
