"""A session's engine in machine code: one lane, one control period a call."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.compile import leaves, rebuild
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.llvm.quick_function import Quick
from skyarm.compile.llvm.stepper import Stepper
from skyarm.compile.tracing.stepped_loop import trace_loop
from skyarm.dynamics import State
from skyarm.log.flight_log import Log
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.reference import Publisher, Reference
from skyarm.scalars.philox import uniforms
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensors.measurement import Measurement
from skyarm.simulate.assemble_log import assemble
from skyarm.simulate.check_endings import Ended, going_on
from skyarm.simulate.commanded_stages import CommandedStages
from skyarm.simulate.compiled_flight import Flown, ending, samples
from skyarm.simulate.draws import draws_needed
from skyarm.simulate.first_state import first_loop_state, first_surroundings
from skyarm.simulate.inputs import EpisodeInputs, episode_inputs
from skyarm.simulate.loop_state import LoopState, Row, Sample, carried, structure_of
from skyarm.simulate.own_code_trials import try_own_code
from skyarm.simulate.period import make_period
from skyarm.simulate.stages import RigidBodySteps, Stages

Array = npt.NDArray[np.float64]


class CompiledSteps:
    """A scenario on the rigid-body plant, period by period.

    Args:
        scenario: of the episode.
        paths: numbers that are read anew in every period (:mod:`skyarm.scenario.numbers`), which :meth:`give` writes;
            all others are constants of the code.
        stiffest: the scenario with the numbers that it flies with, which fix the integration steps.

    Raises:
        NoMachineCodeError: fly the stages one by one.

    Attributes:
        first: the loop before its first period.
        tick: control periods flown. ended: why the episode has ended before its time, or None.
    """

    def __init__(self, scenario: Scenario, paths: Sequence[str] = (), stiffest: Scenario | None = None) -> None:
        self.scenario = self._built = scenario
        self.paths = tuple(paths)
        try_own_code(scenario)
        self.first: LoopState = first_loop_state(scenario)
        self._own_motion = any(path.startswith("reference.") for path in paths)
        needed = draws_needed(scenario)
        stiff = stiffest or scenario
        around = first_surroundings(stiff, self.first)
        plant = RigidBodyPlant(stiff.world, around, scenario.integrator, 1.0 / scenario.rates.physics)
        self._substeps = plant.substeps
        command = structure_of(self.first.queue[0])

        def step(now: LoopState, numbers: Any, fed: Any, drawn: Any) -> tuple[LoopState, Sample]:
            instant, given, commanded = fed
            varied = self._varied(numbers)
            stages = CommandedStages(varied)
            stages.given, stages.command = given, commanded
            period = make_period(stages, RigidBodySteps(stages, plant.substeps))
            return period(now, self._row(varied, instant), drawn)

        numbers = tuple(number_at(scenario, path) for path in self.paths)
        fed = (self._instant, 0.0, command)
        loop = trace_loop(step, structure_of(self.first), numbers, fed, needed, loops=True)
        # numbers that a hand moves are waited for: code that is made in a hurry gives the same bits
        kernel = Kernel(loop, Lanes(1), logging=True, effort=0 if self.paths else 2)
        self._sample: Sample = loop.result[1]
        start = np.array(leaves(self.first), dtype=float)
        keys = {"seed": scenario.seed, "episode": scenario.episode}
        self._stepper = Stepper(kernel, start, np.array(numbers, dtype=float), **keys)
        self._rows = self._clock() if self._own_motion else self._inputs.rows(0, scenario.steps)
        self._width, self._steps = self._rows.shape[1], scenario.steps
        self._log = np.empty((scenario.steps, loop.logged))
        self._peek: Quick | None = None
        self.tick = 0
        self.ended: Ended | None = None
        self._last: Array | None = None

    @cached_property
    def _inputs(self) -> EpisodeInputs:
        return episode_inputs(self.scenario)

    @property
    def _instant(self) -> Any:
        """What a period is fed of its clock: a row, or two times where the code makes the reference itself."""
        return (0.0, 0.0) if self._own_motion else Row(time=0.0, reference=self._inputs.reference_example)

    def _clock(self) -> Array:
        """(steps, 2) time, and time of the held reference, s."""
        ticks, rates = np.arange(self.scenario.steps), self.scenario.rates
        publisher = Publisher(control_rate=rates.control, reference_rate=rates.reference)
        return np.stack([ticks / rates.control, publisher.held_time(ticks)], axis=1)

    def _varied(self, numbers: Sequence[Any]) -> Scenario:
        """The scenario of the code with numbers of its paths."""
        return with_numbers(self._built, dict(zip(self.paths, numbers, strict=True))) if numbers else self._built

    def _row(self, varied: Scenario, instant: Any) -> Row:
        """What the stages are fed of the clock."""
        if not self._own_motion:
            row: Row = instant
            return row
        time, held = instant
        return Row(time=time, reference=varied.trajectory.at(held))

    def give(self, scenario: Scenario, values: Mapping[str, float]) -> None:
        """Fly on with other numbers, from the next period on.

        Args:
            scenario: with these numbers.
            values: some of the paths, beyond what the code's scenario has.
        """
        self.scenario = scenario
        for path, value in values.items():
            self._stepper.parameters[self.paths.index(path)] = value
        if self._own_motion:
            self.__dict__.pop("_inputs", None)  # tables of the reference, made where they are asked for

    def bears(self, scenario: Scenario) -> bool:
        """Whether a scenario with other numbers is integrated in the steps that the code was made with."""
        around = first_surroundings(scenario, self.first)
        plant = RigidBodyPlant(scenario.world, around, scenario.integrator, 1.0 / scenario.rates.physics)
        period = 1.0 / scenario.rates.control
        return plant.substeps(period) == self._substeps(period)

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
            self.ended = ending(self.scenario, self._inputs, self._flown())
            return False
        self._log[k] = stepper.output
        self.tick = k + 1
        if self.tick < self._steps:
            return True
        self.ended = ending(self.scenario, self._inputs, self._flown())
        return False

    def _flown(self) -> Flown:
        return Flown(self._log[: self.tick], self.now, self._sample, self._last)

    def log(self) -> Log:
        """What was flown so far."""
        return assemble(
            self.scenario, self._inputs, samples(self._flown()), self.ended or going_on(self.scenario, self.tick)
        )

    def state(self) -> State:
        """The plant's state now; it follows ``alive`` and ``ticks`` among the leaves."""
        state: State = rebuild(self.first.state, iter(self._stepper.carry[2:].tolist()))
        return state

    def reference(self) -> Reference:
        """The held reference of the next period."""
        row = self._rows[self.tick].tolist()
        if self._own_motion:
            return self.scenario.trajectory.at(row[1]).dense()
        held: Reference = rebuild(self._inputs.reference_example, iter(row[1:]))
        return held

    def measurement(self) -> Measurement:
        """What the law is told in the next period."""
        needed = draws_needed(self._built)
        parameters = self._stepper.parameters.tolist()
        if self._peek is None:
            own = self._own_motion

            def told(now: LoopState, numbers: Any, instant: Any, drawn: Any) -> Measurement:
                time, stages = instant[0] if own else instant.time, Stages(self._varied(numbers))
                plant = RigidBodySteps(stages, lambda _: 1)
                _, around = stages.surround(now.components, now.drives, now.state, time, drawn)
                before = stages.acting(now.queue)
                force = plant.specific_force(now.state, before, around)
                read = stages.sense(now.sensors, now.estimate, now.ticks, now.state, force, before, time, drawn)
                return read.measurement

            example = structure_of(self.first), tuple(parameters), self._instant
            self._peek = Quick(told, *example, (0.5,) * sum(count for _, count in needed))
        keys = (self.scenario.seed, self.scenario.episode)
        drawn = [float(u) for channel, n in needed for u in uniforms(*keys, channel, self.tick, n)]
        self._peek.inputs[:] = [*self._stepper.carry, *parameters, *self._rows[self.tick], *drawn]
        self._peek.step()
        told_now: Measurement = self._peek.shaped()
        return told_now

    def snapshot(self) -> Any:
        """What :meth:`restore` takes: it holds on to the log, whose rows before this period no step writes again."""
        stepper = self._stepper
        return self.tick, self.ended, stepper.carry.copy(), stepper.parameters.copy(), self._log, self._last

    def restore(self, held: Any) -> None:
        """Go to a snapshot."""
        self.tick, self.ended, carry, parameters, log, self._last = held
        self._stepper.carry[:], self._stepper.parameters[:] = carry, parameters
        # what is flown from here on must not be written over what other snapshots hold
        self._log = np.empty_like(log)
        self._log[: self.tick] = log[: self.tick]

    @property
    def now(self) -> LoopState:
        """The loop's state before the next period."""
        found: LoopState = rebuild(self.first, iter(self._stepper.carry.tolist()))
        return found

    @property
    def rows(self) -> Array:
        """What was logged: a row a period, the leaves of :class:`Sample` but for ``alive``."""
        return self._log[: self.tick, 1:]

    def take_over(self, other: Any) -> None:
        """Go on where another engine stands."""
        self.tick, self.ended = other.tick, other.ended
        self._stepper.carry[:] = leaves(carried(self.first, other.now))
        self._log[: self.tick, 0], self._log[: self.tick, 1:] = 1.0, other.rows
