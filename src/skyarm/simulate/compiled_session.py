"""A session's engine in machine code: one lane, one control period a call."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.actuation import Command
from skyarm.compile import leaves, rebuild
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.llvm.quick_function import Quick
from skyarm.compile.llvm.stepper import Stepper
from skyarm.compile.tracing.stepped_loop import trace_loop
from skyarm.dynamics import State
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.reference import Reference
from skyarm.scalars.philox import uniforms
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensors.measurement import Measurement
from skyarm.simulate.assemble_log import Piece
from skyarm.simulate.check_endings import Ended
from skyarm.simulate.compiled_flight import Flown, ending, samples
from skyarm.simulate.first_state import component_groups, first_loop_state, first_surroundings
from skyarm.simulate.inputs import EpisodeInputs, episode_inputs
from skyarm.simulate.loop_state import LoopState, Row, Sample, blend, carried, structure_of
from skyarm.simulate.own_code_trials import try_own_code
from skyarm.simulate.period import make_period
from skyarm.simulate.stages import RigidBodySteps, Stages

Array = npt.NDArray[np.float64]


class CommandedStages(Stages):
    """Stages whose law is passed over where a command is given.

    Attributes:
        given: 1 where there is one. command: it.
    """

    given: Any = 0.0
    command: Any = None

    def decide(self, memory: Any, measurement: Measurement, reference: Reference) -> tuple[Any, Command]:
        """The law, or the command that is given; the law's memory stays then."""
        following, wanted = super().decide(memory, measurement, reference)
        own = self.given < 0.5
        return blend(own, following, memory), blend(own, wanted, self.command)


class CompiledSteps:
    """A scenario on the rigid-body plant, period by period.

    Raises:
        NoMachineCodeError: fly the stages one by one.

    Attributes:
        first: the loop before its first period.
        tick: control periods flown. ended: why the episode has ended before its time, or None.
        begun: number of the first period that this engine flies.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        try_own_code(scenario)
        self._inputs: EpisodeInputs = episode_inputs(scenario)
        self.first: LoopState = first_loop_state(scenario)
        self._stages = stages = CommandedStages(scenario)
        around = first_surroundings(scenario, self.first)
        plant = RigidBodyPlant(scenario.world, around, scenario.integrator, 1.0 / scenario.rates.physics)
        period = make_period(stages, RigidBodySteps(stages, plant.substeps))
        row = Row(time=0.0, reference=self._inputs.reference_example)
        command = structure_of(self.first.queue[0])

        def step(now: LoopState, _parameters: Any, fed: Any, drawn: Any) -> tuple[LoopState, Sample]:
            instant, stages.given, stages.command = fed
            return period(now, instant, drawn)

        fed = (row, 0.0, command)
        loop = trace_loop(step, structure_of(self.first), (), fed, stages.draws.needed, loops=True)
        kernel = Kernel(loop, Lanes(1), logging=True)
        self._sample: Sample = loop.result[1]
        start = np.array(leaves(self.first), dtype=float)
        self._stepper = Stepper(kernel, start, seed=scenario.seed, episode=scenario.episode)
        self._rows = self._inputs.rows(0, scenario.steps)
        self._width, self._steps = self._rows.shape[1], scenario.steps
        self._log = np.empty((scenario.steps, loop.logged))
        self._peek: Quick | None = None
        self.tick = self.begun = 0
        self.ended: Ended | None = None
        self._last: Array | None = None

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
        return Piece(self.scenario, self._inputs, self.begun, samples(self._flown()))

    def state(self) -> State:
        """The plant's state now."""
        return self.now.state

    def reference(self) -> Reference:
        """The held reference of the next period."""
        held: Reference = rebuild(self._inputs.reference_example, iter(self._rows[self.tick, 1:].tolist()))
        return held

    def measurement(self) -> Measurement:
        """What the law is told in the next period."""
        stages = self._stages
        needed = stages.draws.needed
        if self._peek is None:
            plant = RigidBodySteps(stages, lambda _: 1)

            def told(now: LoopState, row: Row, drawn: Any) -> Measurement:
                _, around = stages.surround(now.components, now.drives, now.state, row.time, drawn)
                before = stages.acting(now.queue)
                force = plant.specific_force(now.state, before, around)
                read = stages.sense(now.sensors, now.estimate, now.ticks, now.state, force, before, row.time, drawn)
                return read.measurement

            row = Row(time=0.0, reference=self._inputs.reference_example)
            self._peek = Quick(told, structure_of(self.first), row, (0.5,) * sum(count for _, count in needed))
        keys = (self.scenario.seed, self.scenario.episode)
        drawn = [float(u) for channel, n in needed for u in uniforms(*keys, channel, self.tick, n)]
        self._peek.inputs[:] = [*self._stepper.carry, *self._rows[self.tick], *drawn]
        self._peek.step()
        told_now: Measurement = self._peek.shaped()
        return told_now

    def snapshot(self) -> Any:
        """What :meth:`restore` takes."""
        flown = self._log[self.begun : self.tick].copy()
        return self.begun, self.tick, self.ended, self._stepper.carry.copy(), flown, self._last

    def restore(self, held: Any) -> None:
        """Go to a snapshot."""
        self.begun, self.tick, self.ended, carry, log, self._last = held
        self._stepper.carry[:], self._log[self.begun : self.tick] = carry, log

    @property
    def now(self) -> LoopState:
        """The loop's state before the next period."""
        found: LoopState = rebuild(self.first, iter(self._stepper.carry.tolist()))
        return found

    def take_over(self, other: Any) -> None:
        """Go on where another engine stands."""
        self.begun = self.tick = other.tick
        self.ended = other.ended
        self._stepper.carry[:] = leaves(carried(self.first, other.now, component_groups(self.scenario, other.scenario)))
