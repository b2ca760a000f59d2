"""Closed-loop simulator of a single flight: one traced control period, evaluated in machine code or Python.

Both evaluate the same program to the same bits. Python also flies plants and laws that cannot be traced: the program
calls them with floats.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from time import perf_counter
from typing import Any, TypeAlias

import numpy as np

from skyarm.algebra.scalars import Scalar
from skyarm.algebra.scalars.philox import uniforms
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.lane_stepper import Stepper
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.lower import operations
from skyarm.compile.tracing.program import Loop, trace_loop
from skyarm.control.law_estimates import PushAlone
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.plant.interface import make_plant
from skyarm.plant.largest_step import STATED
from skyarm.records.arrays import Array
from skyarm.records.leaves import Tree, leaves, rebuild
from skyarm.reference import Reference
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensing.measurement import Measurement
from skyarm.simulate.assemble_log import LoggedSamples, Piece
from skyarm.simulate.check_endings import Ended, ending_of_command, failed_phase, find_ending
from skyarm.simulate.draws import draws_needed
from skyarm.simulate.first_state import component_places, first_loop_state, first_surroundings
from skyarm.simulate.inputs import EpisodeInputs, episode_inputs
from skyarm.simulate.loop_state import GivenRow, LoopState, Sample, carry_over, structure_of
from skyarm.simulate.period import PlantSteps, Uniforms, make_period, measure
from skyarm.simulate.plant_steps import (
    CalledPlant,
    EpisodeEndedError,
    LawCalls,
    RigidBodySteps,
    StagesInPython,
    Substeps,
    rigid_body_plant,
)
from skyarm.simulate.reference_clock import clock_of_change
from skyarm.simulate.stages import Stages
from skyarm.simulate.user_code import require_shapes

SHORT = 500_000_000
"""Number of operations up to which an episode ends sooner in code compiled without full optimisation: 150 000
periods of a quadrotor with a two-joint arm, where the compilation time saved equals the flight time lost."""

PIECE = 0.1
"""Duration (s) of flight between two checks for Ctrl-C."""

ALIVE, TICKS = 0, 1
"""Indices of ``LoopState.alive`` and ``LoopState.ticks`` among a loop state's leaves."""


ProgramKey: TypeAlias = tuple[tuple[tuple[str, object], ...], tuple[str, ...]]
"""Key of a compiled program: replaced parts and paths of the numbers; equal for programs that differ only in their
values."""

EngineRow: TypeAlias = GivenRow | tuple[GivenRow, Scalar, Command]
"""Row of inputs, with the mode and values of an external command where one is possible."""


class EpisodeCode:
    """Traced program of one control period of a scenario, compiled to machine code unless it runs in Python.

    Args:
        scenario: scenario that flies now; it fixes the integration steps.
        vary: the scenario from the numbers of ``numbers``, which the program reads in every period; None without any.
        numbers: present values by path.
        machine_code: False evaluates the program in Python, whose numbers are constants.
        commands: a command from outside may take the law's place.
        effort: effort of the compiler; None chooses by the length of the episode.
        key: key of all programs that differ in the values of their numbers alone.

    Raises:
        NoMachineCodeError: there is no compiler; evaluate it in Python.
    """

    def __init__(
        self,
        scenario: Scenario,
        vary: Callable[[Sequence[Scalar]], Scenario] | None = None,
        numbers: Mapping[str, float] | None = None,
        *,
        machine_code: bool = True,
        commands: bool = True,
        effort: int | None = None,
        key: ProgramKey | None = None,
    ) -> None:
        require_shapes(scenario)
        self.scenario, self.commands, self.key = scenario, commands, key
        self._vary, self.numbers = vary or (lambda _: scenario), dict(numbers or {})
        self.calls: LawCalls | None = (
            None if machine_code else LawCalls(copy.deepcopy(scenario.agent.controller.memory))
        )
        self.first = first_loop_state(scenario)
        self.carry = self.first
        if machine_code:
            scenario.agent.controller.require_traceable("machine code of the loop")
        elif not scenario.agent.controller.compiled:
            self.carry = _with_memory(self.first, PushAlone.of(self.first.agent.memory))
        self._example = structure_of(self.carry)
        self.draws = draws_needed(scenario)
        self._plant: PlantSteps[State] | None = None
        if scenario.kind == "rigid_body":
            self.substeps = Substeps(rigid_body_plant(scenario, self.first))
        else:
            around = first_surroundings(scenario, self.first)
            self._plant = CalledPlant(make_plant(scenario, around), Stages(scenario), around)
        self.loop = self._trace(self._step)
        self.sample: Sample = self.loop.result[1]
        self.kernel: Kernel | None = None
        if machine_code:
            if effort is None:
                effort = 0 if scenario.steps * operations(self.loop.program.nodes) < SHORT else 2
            self.kernel = Kernel(self.loop, Lanes(1), logging=True, effort=effort)

    @cached_property
    def inputs(self) -> EpisodeInputs:
        """Times and references of the scenario that the program was traced from."""
        return episode_inputs(self.scenario)

    def _trace(self, step: Callable[..., tuple[Tree, Tree]]) -> Loop:
        row = self.inputs.row_example
        fed: EngineRow = (row, 0.0, structure_of(self.first.agent.queue[0])) if self.commands else row
        return trace_loop(step, self._example, tuple(self.numbers.values()), fed, self.draws, loops=True)

    def _begin(self, numbers: Sequence[Scalar], fed: EngineRow) -> tuple[Stages, PlantSteps[State], GivenRow]:
        """Make the computation stages, plant model and input record of one control period, for tracing."""
        scenario = self._vary(numbers)
        row, given, command = fed if isinstance(fed, tuple) else (fed, None, None)
        if self.calls is None:
            stages = Stages(scenario, command, given)
        else:
            stages = StagesInPython(scenario, self.calls, self.first.agent.queue[0], command, given)
        plant = RigidBodySteps(stages, self.substeps) if self._plant is None else self._plant
        return stages, plant, row

    def _step(
        self, now: LoopState, numbers: Sequence[Scalar], fed: EngineRow, uniforms: Uniforms
    ) -> tuple[LoopState, Sample]:
        stages, plant, row = self._begin(numbers, fed)
        return make_period(stages, plant)(now, row, uniforms)

    def _measure(
        self, now: LoopState, numbers: Sequence[Scalar], fed: EngineRow, uniforms: Uniforms
    ) -> tuple[LoopState, Measurement]:
        """Run a control period up to the measurement that the law receives; return it with the unchanged loop state."""
        stages, plant, row = self._begin(numbers, fed)
        row = stages.waits.lead(now.agent.clock, now.ticks, row)
        return now, measure(stages, plant, now, row, uniforms).read.measurement

    @cached_property
    def measurement(self) -> Loop:
        """Traced program that computes the measurement of the control law in a control period."""
        return self._trace(self._measure)

    def fits(self, key: ProgramKey, scenario: Scenario, changed: Sequence[str] | None = None) -> bool:
        """True if the compiled program can also fly another scenario, with other parameter values as its inputs.

        Args:
            key: key of that scenario.
            scenario: other scenario, with its numbers.
            changed: paths of the numbers that changed; None for any.
        """
        if self.kernel is None or key != self.key:
            return False
        if changed is not None and not any(path.startswith(("plant.", *STATED)) for path in changed):
            return True
        return self.substeps.fit(rigid_body_plant(scenario, self.first))


def _with_memory(loop: LoopState, memory: Tree) -> LoopState:
    """Closed-loop state with the internal state of the control law replaced."""
    return replace(loop, agent=replace(loop.agent, memory=memory))


class _PythonSteps:
    """Evaluation of a traced control period in Python floats instead of machine code."""

    def __init__(self, loop: Loop, carry: Array, parameters: Array, seed: int, episode: int) -> None:
        self._loop, self._step, self._keys = loop, loop.stepper(), (seed, episode)
        self.carry, self.parameters = carry, parameters
        self.command: tuple[float, ...] = ()

    def read_tables(self, rows: Array, log: Array) -> None:
        """Set the table of closed-loop inputs, one row per control period, and the table for the logged samples."""
        self._rows, self._log = rows, log

    def fly(self, begin: int, end: int, start: int = 0) -> None:
        """Evaluate control periods ``begin`` to ``end`` of the input table, or up to a termination of the flight."""
        now, numbers, count = tuple(self.carry.tolist()), tuple(self.parameters.tolist()), self._loop.carry
        steps = np.arange(start + begin, start + end)
        draws = [uniforms(*self._keys, channel, steps, many) for channel, many in self._loop.uniforms]
        drawn = np.concatenate([np.zeros((len(steps), 0)), *draws], axis=1)
        for k, row in zip(range(begin, end), drawn.tolist(), strict=True):
            try:
                outputs = self._step((*now, *numbers, *self._rows[k].tolist(), *row))
            except EpisodeEndedError as error:
                now, self.command = (0.0, *now[1:]), error.command
                break
            now, self._log[k] = outputs[:count], outputs[count:]
        self.carry[:] = now


EngineState: TypeAlias = tuple[Scenario, EpisodeInputs, Array, int, int, Ended | None, tuple[Array, Array, Array, Any]]
"""State of an engine: scenario, its inputs and their rows, start of the piece, tick, end; loop state, parameters,
log, memory of a law."""


class Engine:
    """Closed-loop simulator of one flight, which advances one or many control periods per call.

    Args:
        code: its program. scenario: scenario that is flown now; that of the program if left out.
        numbers: values of the program's parameters, by path; its own if left out.

    Attributes:
        first: the loop before its first period. tick: control periods flown.
        ended: why the episode has ended before its time, or None. begun: number of the first period under the scenario.
        commanded: True if a command from outside has taken the law's place.
    """

    def __init__(
        self, code: EpisodeCode, scenario: Scenario | None = None, numbers: Mapping[str, float] | None = None
    ) -> None:
        self.scenario = scenario or code.scenario
        self.code, self.first, self._steps = code, code.first, self.scenario.steps
        self._inputs = code.inputs
        parameters = np.array([*(code.numbers if numbers is None else numbers).values()], dtype=float)
        self._stepper = self._make_stepper(code.loop, np.array(leaves(code.carry), dtype=float), parameters)
        self._before = self._stepper.carry.copy()
        self._rows = self._input_rows()
        self._width = self._rows.shape[1] - (1 + len(leaves(self.first.agent.queue[0])))  # of a row but for the command
        self._write_to(np.empty((self._steps, code.loop.logged)))  # takes memory as it is written
        self.tick = self.begun = 0
        self.ended: Ended | None = None
        self._stretch, self.commanded = 1, False

    def _make_stepper(
        self, loop: Loop, carry: Array, parameters: Array, *, peek: bool = False
    ) -> Stepper | _PythonSteps:
        """Make the evaluator of a traced program: machine code if the flight is compiled, else Python."""
        seed, episode = self.scenario.seed, self.scenario.episode
        if self.code.kernel is None:
            return _PythonSteps(loop, carry, parameters, seed, episode)
        kernel = Kernel(loop, Lanes(1), logging=True) if peek else self.code.kernel
        return Stepper(kernel, carry, parameters, seed=seed, episode=episode)

    def _input_rows(self) -> Array:
        """Table of inputs of all control periods: time, reference, then room for a command from the user."""
        rows = self.inputs.rows
        if not self.code.commands:
            return rows
        return np.hstack([rows, np.zeros((len(rows), 1 + len(leaves(self.first.agent.queue[0]))))])

    @property
    def inputs(self) -> EpisodeInputs:
        """Times and references of all control periods under the scenario in force."""
        if self._inputs.scenario is not self.scenario:
            self._inputs = episode_inputs(self.scenario)
        return self._inputs

    def step(self, command: Sequence[float] | None = None, *, rotors_only: bool = False) -> bool:
        """Fly one control period; False once the episode has ended or reached its duration.

        Args:
            command: command in place of the law's, whose memory stays.
            rotors_only: True for its rotor speeds alone; the law moves the joints, and its memory goes on.
        """
        k = self.tick
        if k >= self._steps or self.ended is not None:
            return False
        if command is not None:
            self._rows[k, self._width :] = (2.0 if rotors_only else 1.0, *command)
            self.commanded = True
        elif self.commanded:
            self._rows[k, self._width] = 0.0
        return self._fly(k + 1)

    def fly(self, stop: int) -> bool:
        """Fly for about 0.1 s of computing time, at most up to period ``stop``; False once the episode is over."""
        if self.tick >= self._steps or self.ended is not None:
            return False
        stop = min(stop, self.tick + self._stretch, self._steps)
        begun, before = perf_counter(), self.tick
        if self.commanded:
            self._rows[before:stop, self._width] = 0.0
        going = self._fly(stop)
        size, seconds = self.tick - before, max(perf_counter() - begun, 1e-6)
        self._stretch = max(1, int(size * min(8.0, PIECE / seconds)))
        return going

    def _write_to(self, log: Array) -> None:
        """Replace the table that logged samples are written to."""
        self._log = log
        self._stepper.read_tables(self._rows, log)

    def _fly(self, stop: int) -> bool:
        """Simulate up to control period ``stop``; False once the flight is over."""
        carry = self._stepper.carry
        self._before[:] = carry
        self._stepper.fly(self.tick, stop)
        over = carry[ALIVE] < 0.5
        end = round(carry[TICKS]) if over else stop
        if over and self.code.kernel is not None:
            # machine code moves the law's memory on to the end of the stretch, whose length the clock on the wall sets
            carry[:] = self._before
            self._stepper.fly(self.tick, end)
            carry[ALIVE], carry[TICKS] = 0.0, end
        self.tick = end
        if over or stop >= self._steps:
            self.ended = self._reason(lost=over)
            return False
        return True

    def _reason(self, *, lost: bool) -> Ended | None:
        """Status, cause and time of the flight's early termination; None after its full duration."""
        scenario, now, time = self.scenario, self.now, self.tick / self.scenario.rates.control
        goal = self.inputs.row_at(self.tick, now).reference.position
        ending = find_ending(scenario, time, leaves(now.agent.state), [float(c) for c in goal])
        ending = ending or failed_phase(scenario, time, now.agent.clock)
        if ending is not None or not lost:
            return ending
        command = getattr(self._stepper, "command", ())
        if not command:
            sample: Sample = rebuild(self.code.sample, iter(self._log[self.tick].tolist()))
            command = leaves(sample.command)
        ending = ending_of_command(scenario, time, command)
        if ending is None:
            raise RuntimeError(f"at {time} s: an episode has ended in which no ending finds anything wrong")
        return ending

    @property
    def piece(self) -> Piece:
        """Logged samples of all control periods since the last change of the scenario."""
        return Piece(self.scenario, self.inputs, self.begun, self.samples(self.begun, self.tick))

    def samples(self, start: int, stop: int) -> LoggedSamples:
        """Logged samples of control periods ``start`` to ``stop`` as array views."""
        rows, sample = self._log[start:stop], self.code.sample
        columns: Sample = rebuild(sample, iter(rows.T))
        end = rows.shape[1] - len(columns.led)
        estimates, led = rows[:, end - len(columns.found) : end], rows[:, end:]
        states, commands = self.states_and_commands(start, stop)
        return LoggedSamples(states, commands, columns.measurement, columns.readings, columns.wind, estimates, led)

    @cached_property
    def reading_columns(self) -> dict[str, slice]:
        """Columns of each sensor's reading in a row of the log, by the sensor's name."""
        sample, places = self.code.sample, dict[str, slice]()
        begin = self._marks[2] + len(leaves(sample.measurement))
        for name, reading in sample.readings:
            places[name] = slice(begin, begin := begin + len(leaves(reading)))
        return places

    @cached_property
    def joint_columns(self) -> slice:
        """Columns of the measured joint positions and rates in a row of the log."""
        measured = self.code.sample.measurement
        before = (measured.time, measured.position, measured.quaternion, measured.velocity, measured.rate,
                  measured.specific_force)  # fmt: skip
        begin = self._marks[2] + len(leaves(before))
        return slice(begin, begin + len(measured.joints) + len(measured.joint_rates))

    def row(self, tick: int) -> Array:
        """Logged row of a control period that has been flown: alive, state, command, measurement, readings."""
        row: Array = self._log[tick]
        return row

    def states_and_commands(self, start: int, stop: int) -> tuple[Array, Array]:
        """Logged states and commands of control periods ``start`` to ``stop`` as array views, one row per period."""
        first, command, measured = self._marks
        return self._log[start:stop, first:command], self._log[start:stop, command:measured]

    @cached_property
    def _marks(self) -> tuple[int, ...]:
        """Columns of a logged sample at which its state begins, its command begins and its command ends."""
        sample = self.code.sample
        return tuple(np.cumsum([len(leaves(part)) for part in (sample.alive, sample.state, sample.command)]).tolist())

    @property
    def now(self) -> LoopState:
        """State of plant, law, sensors and estimator before the next control period."""
        state = rebuild(self.code.carry, iter(self._stepper.carry.tolist()))
        return state if self._memory is None else _with_memory(state, self._memory)

    @property
    def _memory(self) -> Any:
        """Internal state of a control law run as plain Python, which may be any object; None for a traced law."""
        calls = self.code.calls
        return None if calls is None or self.scenario.agent.controller.compiled else calls.memory

    @property
    def has_nan(self) -> bool:
        """True if a number of the loop's state is NaN."""
        return bool(np.isnan(self._stepper.carry).any())

    def evaluate(self, now: LoopState) -> LoopState:
        """Evaluate one control period in Python floats from a given closed-loop state; return the next state.

        Plants that cannot be traced are replaced by the rigid body. The floats are NumPy's, which divide by 0.
        """
        scenario, ticks = self.scenario, np.array([int(float(now.ticks))])
        stages = Stages(scenario)
        plant = RigidBodySteps(stages, Substeps(rigid_body_plant(scenario, self.first)))
        row = self.inputs.row_at(ticks[0], now)
        if scenario.agent.controller.compiled:  # the memory of another law may hold anything
            now = rebuild(now, iter(np.array(leaves(now), dtype=float)))
            row = rebuild(row, iter(np.array(leaves(row), dtype=float)))
        draws = [uniforms(scenario.seed, scenario.episode, each, ticks, count)[0] for each, count in self.code.draws]
        with np.errstate(all="ignore"):
            return make_period(stages, plant)(now, row, tuple(np.concatenate([[], *draws])))[0]

    def state(self) -> State:
        """Current true state of the vehicle."""
        return rebuild(self.first.agent.state, iter(self._stepper.carry[2:].tolist()))

    def reference(self) -> Reference:
        """Reference sample that is held in the next control period."""
        return self.inputs.row_at(self.tick, self.now).reference

    @cached_property
    def _peek(self) -> tuple[Stepper | _PythonSteps, Array, Measurement]:
        loop = self.code.measurement
        stepper = self._make_stepper(loop, np.zeros(loop.carry), np.zeros(loop.parameters), peek=True)
        return stepper, np.empty((1, loop.logged)), loop.result[1]

    def measurement(self) -> Measurement:
        """Measurement that the control law receives in the next period."""
        stepper, output, example = self._peek
        stepper.carry[:], stepper.parameters[:] = self._stepper.carry, self._stepper.parameters
        stepper.read_tables(self._rows[self.tick : self.tick + 1], output)
        stepper.fly(0, 1, start=self.tick)
        return rebuild(example, iter(output[0].tolist()))

    def snapshot(self) -> EngineState:
        """Copy of the simulator's state, from which :meth:`restore` continues."""
        stepper = self._stepper
        numbers = stepper.carry.copy(), stepper.parameters.copy(), self._log, copy.deepcopy(self._memory)
        return self.scenario, self._inputs, self._rows, self.begun, self.tick, self.ended, numbers

    def restore(self, state: EngineState) -> None:
        """Return to the simulator state of a snapshot."""
        self.scenario, self._inputs, self._rows, self.begun, self.tick, self.ended, numbers = state
        self._stepper.carry[:], self._stepper.parameters[:], log, memory = numbers
        own = np.empty_like(log)
        own[: self.tick] = log[: self.tick]
        self._write_to(own)
        if self.code.calls is not None:
            self.code.calls.memory = copy.deepcopy(memory)

    def give(self, scenario: Scenario, numbers: Mapping[str, float], changed: Sequence[str], key: ProgramKey) -> bool:
        """Change parameter values from the next control period on; False, unchanged, if that needs recompilation.

        Args:
            scenario: scenario from now on.
            numbers: values of the program's parameters, by path.
            changed: paths of the numbers that are other than before.
            key: key of the program that the scenario needs.
        """
        if not self.code.fits(key, scenario, changed):
            return False
        self.scenario, self.begun = scenario, self.tick
        self._stepper.parameters[:] = [*numbers.values()]
        if any(path.startswith("reference.") for path in changed):
            self._rows = self._input_rows()
            self._stepper.read_tables(self._rows, self._log)
        return True

    def take_over(self, other: Engine, *, anew: bool) -> None:
        """Continue a flight from the state of another simulator; ``anew``: the reference has been replaced."""
        now = other.now
        clock = clock_of_change(self.scenario, self.first, now, anew=anew)
        places = component_places(self.scenario), component_places(other.scenario)
        carried = carry_over(self.first, now, places, clock)
        if self.code.calls is not None and not self.scenario.agent.controller.compiled:
            same = self.scenario.agent.controller.law is other.scenario.agent.controller.law
            # the memory of a law that is called is its own: it may hold anything
            self.code.calls.memory = copy.deepcopy(now.agent.memory if same else carried.agent.memory)
            carried = _with_memory(carried, PushAlone.of(self.code.calls.memory))
        self._stepper.carry[:] = leaves(carried)
        self.begun, self.tick, self.ended = other.tick, other.tick, other.ended
        self.commanded = other.commanded
