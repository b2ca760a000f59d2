"""Programs of a flight that changes: one for each set of replaced parts and free
numbers, in machine code or Python.
"""

from __future__ import annotations

from collections.abc import Sequence

from skyarm.algebra import Scalar
from skyarm.compile.machine_code import NoMachineCodeError
from skyarm.scenario.in_flight import NONE, Overrides
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.course import Course
from skyarm.simulate.engine import Engine, EpisodeCode
from skyarm.simulate.program import ProgramKey


class FlightPrograms:
    """Programs that fly one scenario and all its changes; a program serves every
    scenario that it fits.

    Args:
        paths: numbers that every program reads anew in each period.
        machine_code: False for programs in Python alone.
        commands: a command from outside may take the law's place.
        window: number of control periods in memory; None for all.

    Attributes:
        codes: programs in machine code, in the order in which they were made.
        slow: reason for flying in Python where machine code was requested; else empty.
    """

    def __init__(
        self,
        paths: Sequence[str],
        *,
        machine_code: bool,
        commands: bool,
        window: int | None,
    ) -> None:
        self.machine_code = machine_code
        self._paths = paths
        self._commands = commands
        self._window = window
        self.codes = list[EpisodeCode]()
        self.slow = ""

    def engine(self, course: Course) -> Engine:
        """Make the simulator of the scenario in force: machine code if available, else
        Python.
        """
        scenario = course.now
        # the other plants are Python: they are called from it
        if self.machine_code and scenario.kind == "rigid_body" and scenario.is_compiled:
            try:
                return self._compile(course, scenario)
            except NoMachineCodeError as error:
                # the flight goes on in Python, with a warning of this text
                self.slow = str(error)
        return Engine(
            EpisodeCode(
                scenario,
                machine_code=False,
                commands=self._commands,
                window=self._window,
            )
        )

    def _compile(self, course: Course, scenario: Scenario) -> Engine:
        """Make the simulator in machine code; reuses an earlier program that fits the
        scenario.
        """
        read = self.read(course)
        key = self.key(course)
        numbers = dict(read.numbers)
        shape = read.parts_of(course.begun)
        # going back and forth between two scenarios compiles each once
        code = next((code for code in self.codes if code.fits(key, scenario)), None)
        if code is None:
            # code that flies on after a change is made in a hurry: the vehicle is in
            # the air
            quick = course.overrides is not NONE or course.coming or self._paths
            # a session's length is open: full effort; that of run() is weighed
            # (Assembly.pays)
            effort = 0 if quick else 2 if self._commands else None

            def vary(values: Sequence[Scalar]) -> Scenario:
                return with_numbers(shape, dict(zip(key.free, values, strict=True)))

            now = tuple(numbers.values())
            code = EpisodeCode(
                scenario,
                vary,
                now,
                commands=self._commands,
                effort=effort,
                key=key,
                window=self._window,
            )
            self.codes.append(code)
        return Engine(code, scenario, numbers)

    def read(self, course: Course) -> Overrides:
        """Parameter values that are inputs of the machine code, so that they can change
        without recompilation.
        """
        return course.overrides.data(course.begun, self._paths)

    def key(self, course: Course) -> ProgramKey:
        """Identifier of a compiled program; equal for scenarios that differ in
        parameter values only.
        """
        read = self.read(course)
        return ProgramKey(read.parts, tuple(path for path, _ in read.numbers))
