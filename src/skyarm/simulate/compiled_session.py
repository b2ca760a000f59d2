"""A session's engine in machine code: one lane, one control period a call."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.compile import leaves, rebuild
from skyarm.compile.llvm.stepper import Stepper
from skyarm.dynamics import State
from skyarm.reference import Reference
from skyarm.scalars.philox import uniforms
from skyarm.scenario.in_flight import NONE, Overrides
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensors.measurement import Measurement
from skyarm.simulate.assemble_log import Piece
from skyarm.simulate.check_endings import Ended
from skyarm.simulate.clock_of_change import clock_of_change
from skyarm.simulate.clock_records import PathClock
from skyarm.simulate.compiled_flight import Flown, ending, samples
from skyarm.simulate.first_state import component_groups, first_loop_state
from skyarm.simulate.inputs import EpisodeInputs, episode_inputs
from skyarm.simulate.loop_state import LoopState, carried
from skyarm.simulate.own_code_trials import try_own_code
from skyarm.simulate.session_code import SessionCode

Array = npt.NDArray[np.float64]


class CompiledSteps:
    """A scenario on the rigid-body plant, period by period.

    Args:
        begun: the scenario as it began.
        now: as it is.
        overrides: what holds in the place of its own numbers.
        codes: of engines of the same scenario, one of which may do; what is made here joins them.
        effort: of the compiler.

    Raises:
        NoMachineCodeError: fly the stages one by one.

    Attributes:
        first: the loop before its first period.
        tick: control periods flown. ended: why the episode has ended before its time, or None.
        begun: number of the first period that this engine flies.
    """

    def __init__(
        self,
        begun: Scenario,
        now: Scenario | None = None,
        overrides: Overrides = NONE,
        codes: list[SessionCode] | None = None,
        effort: int = 2,
    ) -> None:
        self.scenario = scenario = begun if now is None else now
        try_own_code(scenario)
        self._inputs: EpisodeInputs = episode_inputs(scenario)
        self.first: LoopState = first_loop_state(scenario)
        made = codes if codes is not None else []
        code = next((code for code in made if code.fits(overrides, scenario, self.first)), None)
        if code is None:
            code = SessionCode(begun, overrides, scenario, self.first, self._inputs.row_example, effort)
            made.append(code)
        self._code, self._sample = code, code.sample
        start = np.array(leaves(self.first), dtype=float)
        numbers = np.array([value for _, value in overrides.numbers], dtype=float)
        self._stepper = Stepper(code.kernel, start, numbers, seed=scenario.seed, episode=scenario.episode)
        self._rows = self._inputs.rows(0, scenario.steps)
        self._width, self._steps = self._rows.shape[1], scenario.steps
        self._log = np.empty((scenario.steps, code.kernel.loop.logged))
        self.tick = self.begun = 0
        self.ended: Ended | None = None
        self._last: Array | None = None

    def give(self, scenario: Scenario, overrides: Overrides, changed: Sequence[str]) -> bool:
        """Fly on with other numbers, from the next period on, if the same code can.

        Args:
            scenario: as it is now.
            overrides: what holds in it.
            changed: paths of the numbers that are other than before.

        Returns:
            False where it cannot, and nothing has happened.
        """
        if not self._code.fits(overrides, scenario, self.first, changed):
            return False
        if any(path.startswith("reference.") for path in changed):
            self._inputs = episode_inputs(scenario)
            self._rows = self._inputs.rows(0, scenario.steps)
        self.scenario, self.begun = scenario, self.tick
        self._stepper.parameters[:] = [value for _, value in overrides.numbers]
        return True

    def step(self, command: Sequence[float] | None = None) -> bool:
        """Fly one control period; False once the episode has ended or flown its time."""
        k, stepper = self.tick, self._stepper
        if k >= self._steps or self.ended is not None:
            return False
        row, width = stepper.row, self._width
        row[:width] = self._rows[k]
        if command is not None:
            row[width] = 1.0
            row[width + 1 :] = command
        stepper.clock[0] = k
        stepper.step()
        if command is not None:
            row[width] = 0.0
        if stepper.carry[0] < 0.5:
            self._last = stepper.output.copy()
            self.ended = ending(self.scenario, self._inputs, self._flown(), self.tick)
            return False
        self._log[k] = stepper.output
        self.tick = k + 1
        if self.tick < self._steps:
            return True
        self.ended = ending(self.scenario, self._inputs, self._flown(), self.tick)
        return False

    def _flown(self) -> Flown:
        return Flown(self._log[self.begun : self.tick], self.now, self._sample, self._last)

    @property
    def piece(self) -> Piece:
        """What this engine flew so far."""
        flown = dataclasses.replace(self._flown(), rows=self._log[self.begun : self.tick].copy())
        return Piece(self.scenario, self._inputs, self.begun, samples(flown))

    def state(self) -> State:
        """The plant's state now."""
        return self.now.state

    def reference(self) -> Reference:
        """The held reference of the next period."""
        if isinstance(self.first.clock, PathClock):
            return self._inputs.held_now(self.now)
        held: Reference = rebuild(self._inputs.reference_example, iter(self._rows[self.tick, 1:].tolist()))
        return held

    def measurement(self) -> Measurement:
        """What the law is told in the next period."""
        peek, needed = self._code.measurement, self._code.draws
        keys = (self.scenario.seed, self.scenario.episode)
        drawn = [float(u) for channel, n in needed for u in uniforms(*keys, channel, self.tick, n)]
        peek.inputs[:] = [*self._stepper.carry, *self._stepper.parameters, *self._rows[self.tick], *drawn]
        peek.step()
        told: Measurement = peek.shaped()
        return told

    def snapshot(self) -> Any:
        """What :meth:`restore` takes."""
        stepper, flown = self._stepper, self._log[self.begun : self.tick].copy()
        numbers = stepper.carry.copy(), stepper.parameters.copy(), flown
        return self.scenario, self._inputs, self._rows, self.begun, self.tick, self.ended, self._last, numbers

    def restore(self, held: Any) -> None:
        """Go to a snapshot."""
        self.scenario, self._inputs, self._rows, self.begun, self.tick, self.ended, self._last, numbers = held
        self._stepper.carry[:], self._stepper.parameters[:], self._log[self.begun : self.tick] = numbers

    @property
    def now(self) -> LoopState:
        """The loop's state before the next period."""
        found: LoopState = rebuild(self.first, iter(self._stepper.carry.tolist()))
        return found

    def take_over(self, other: Any, *, anew: bool) -> None:
        """Go on where another engine stands; ``anew``: with another reference."""
        self.begun = self.tick = other.tick
        self.ended = other.ended
        now, groups = other.now, component_groups(self.scenario, other.scenario)
        clock = clock_of_change(self.scenario, self.first, now, anew=anew)
        self._stepper.carry[:] = leaves(carried(self.first, now, groups, clock))
