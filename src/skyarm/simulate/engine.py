"""Closed-loop simulator of a single flight: one traced control period, evaluated in
machine code or Python.

Both evaluate the same program to the same bits. Python also flies plants and laws that
cannot be traced: the program calls them with floats.
"""

from __future__ import annotations

import copy
import json
import math
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from time import perf_counter
from typing import Any

import numpy as np

from skyarm.algebra import Scalar
from skyarm.algebra.scalars.philox import uniforms
from skyarm.compile.llvm.kernel import FULL, Assembly, Kernel
from skyarm.compile.llvm.lane_stepper import Stepper
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.program import Loop
from skyarm.control.controller import Controller
from skyarm.control.law_estimates import PushAlone
from skyarm.dynamics import State
from skyarm.plant.interface import make_plant
from skyarm.plant.largest_step import STATED
from skyarm.records.arrays import Array, doubles, field_views
from skyarm.records.immutable import positional
from skyarm.records.leaves import Tree, leaves, rebuild
from skyarm.records.path_names import word_of
from skyarm.records.restore import restore
from skyarm.reference import Reference
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensing.measurement import Measurement
from skyarm.simulate.assemble_log import Piece
from skyarm.simulate.check_endings import (
    Ended,
    ending_of_command,
    failed_phase,
    find_ending,
)
from skyarm.simulate.examine import require_shapes
from skyarm.simulate.first_state import component_places, first_surroundings
from skyarm.simulate.flight_recorder import FlightRecorder
from skyarm.simulate.inputs import FlightInputs
from skyarm.simulate.loop_state import LoopState, Sample, carry_over, structure_of
from skyarm.simulate.period import PlantSteps, make_fleet_period, make_period, measure
from skyarm.simulate.pictures import FlightPictures
from skyarm.simulate.plant_steps import (
    CalledPlant,
    EpisodeEndedError,
    LawCalls,
    StagesInPython,
    rigid_body_plant,
)
from skyarm.simulate.program import (
    AS_IT_IS,
    NO_INPUTS,
    Cut,
    LoopProgram,
    PeriodRow,
    ProgramKey,
    TracedPeriod,
)
from skyarm.simulate.reference_clock import clocks_of_change
from skyarm.simulate.stages import Stages
from skyarm.simulate.stored_programs import (
    FlightProgram,
    load_program,
    note_repeat,
    program_name,
    store_program,
)

PIECE = 0.1
"""Computing time (s) between two checks for Ctrl-C, too short to be waited for."""

ALIVE, TICKS = 0, 1
"""Indices of ``LoopState.alive`` and ``LoopState.ticks`` among a loop state's
leaves."""


class EpisodeCode(LoopProgram):
    """Traced program of one control period of a scenario, compiled to machine code
    unless it runs in Python.

    Args:
        scenario: scenario that flies now; it fixes the integration steps.
        vary: the scenario from the numbers of ``numbers``, which the program reads in
            every period; None without any.
        numbers: present values.
        machine_code: False evaluates the program in Python, whose numbers are
            constants.
        commands: a command from outside may take the law's place.
        effort: effort of the compiler; None chooses by the length of the episode.
        key: key of all programs that differ in the values of their numbers alone.
        window: number of control periods whose inputs and logged samples are in memory;
            all if left out.

    Raises:
        NoMachineCodeError: there is no compiler; evaluate it in Python.
    """

    def __init__(
        self,
        scenario: Scenario,
        vary: Callable[[Sequence[Scalar]], Scenario] | None = None,
        numbers: Sequence[float] = (),
        *,
        machine_code: bool = True,
        commands: bool = True,
        effort: int | None = None,
        key: ProgramKey = AS_IT_IS,
        window: int | None = None,
    ) -> None:
        require_shapes(scenario)
        super().__init__(scenario, vary, tuple(numbers), key=key)
        self.window = window or scenario.steps
        self.commands = commands
        laws = [each.controller for each in scenario.agents.values()]
        self.calls: list[LawCalls] = (
            []
            if machine_code
            # a copy: a law that is called may write to its memory, and the scenario
            # starts others
            else [LawCalls(copy.deepcopy(each.memory)) for each in laws]
        )
        self.carry = self.first
        if machine_code:
            for law in laws:
                law.require_traceable("machine code of the loop")
        else:
            pairs = zip(laws, self.first.agents, strict=True)
            self.carry = _with_memories(
                self.first, [_carried_memory(law, own.memory) for law, own in pairs]
            )
        self._shared = (
            # a shared period reads neither numbers nor commands, which differ between
            # vehicles
            machine_code and effort is None and not (commands or self.numbers)
        )
        self._called: CalledPlant | None = None
        if scenario.kind != "rigid_body":
            around = first_surroundings(scenario, self.first)
            self._called = CalledPlant(
                make_plant(scenario, around), Stages(scenario), around
            )
        self.kernel: Kernel | None = None
        if machine_code:
            # of a program with numbers the scenario that it is traced from is not the
            # one that flies
            name = "" if any(key) else program_name(scenario, commands, effort)
            program = load_program(name)
            if program is None:
                program = self._write_program(name, effort)
            elif effort is None:
                note_repeat(program, scenario)
            self.program = program
            self.loop = program.loop
            self.substeps.traced.update(program.substeps)
            self.kernel = Kernel(
                self.loop, Lanes(1), logging=True, written=program.assembly
            )
        else:
            self.loop = self._trace(self._whole)
        self.sample: Sample = self.loop.result[1]

    @cached_property
    def inputs(self) -> FlightInputs:
        """Times and references of the scenario that the program was traced from, from
        the first period on.
        """
        return FlightInputs(self.scenario, window=self.window)

    def _write_program(self, name: str, effort: int | None) -> FlightProgram:
        """Trace a control period and write it in LLVM's language; store it under its
        name.
        """
        loop = self._trace(self._whole)
        written = Assembly.of(
            loop, Lanes(1), logging=True, effort=FULL if effort is None else effort
        )
        # a short flight is over before quicker code has paid for its making
        if effort is None and not written.pays(self.scenario.steps):
            written = replace(written, effort=0)
        program = FlightProgram(
            loop, written, tuple(self.substeps.traced.items()), self._shared
        )
        store_program(name, program)
        return program

    @cached_property
    def row(self) -> PeriodRow:
        """Inputs of a control period, as an example."""
        waiting = [own.queue[0] for own in self.first.agents] if self.commands else []
        return PeriodRow(
            given=tuple(each.row_example for each in self.inputs.each),
            modes=(0.0,) * len(waiting),
            commands=tuple(map(structure_of, waiting)),
        )

    def _trace(self, cut: Cut) -> Loop:
        return self.trace(cut, self.carry, self.row)

    def stages(self, numbers: Any, row: PeriodRow = NO_INPUTS) -> Stages:
        """Computation stages of a control period; in Python a law that cannot be traced
        is called.
        """
        if not self.calls:
            return super().stages(numbers, row)
        return StagesInPython(self.vary(numbers), self.calls, row.commands, row.modes)

    def plant_steps(self, stages: Stages) -> PlantSteps[State]:
        """Plant model within a control period; one that cannot be traced is called."""
        return super().plant_steps(stages) if self._called is None else self._called

    def _whole(self, period: TracedPeriod, now: LoopState) -> tuple[LoopState, Sample]:
        fleet = (
            make_fleet_period(period.stages, self.substeps) if self._shared else None
        )
        self._shared = fleet is not None
        return (fleet or make_period(period.stages, period.plant))(
            now, period.row.given, period.uniforms
        )

    def _measurements(
        self, period: TracedPeriod, now: LoopState
    ) -> tuple[LoopState, tuple[Measurement, ...]]:
        """Run a control period up to the measurements that the laws receive; return
        them with the same loop state.
        """
        rows = period.stages.lead(now, period.row.given)
        measured = measure(period.stages, period.plant, now, rows, period.uniforms)
        seen = zip(period.stages.agents, measured.agents, now.agents, strict=True)
        return now, tuple(
            each.with_images(half.read.measurement, own) for each, half, own in seen
        )

    @cached_property
    def measurement(self) -> Loop:
        """Traced program that computes the measurements of the control laws in a
        control period.
        """
        return self._trace(self._measurements)

    def fits(
        self, key: ProgramKey, scenario: Scenario, changed: Sequence[str] | None = None
    ) -> bool:
        """True if the compiled program can also fly another scenario, with other
        parameter values as its inputs.

        Args:
            key: key of that scenario.
            scenario: other scenario, with its numbers.
            changed: paths of the numbers that changed; None for any.
        """
        if self.kernel is None or key != self.key:
            return False
        # only these numbers fix integration steps, which need a plant to be counted
        if changed is not None and not any(
            word_of(path).startswith(("plant.", *STATED)) for path in changed
        ):
            return True
        return self.serves(key, rigid_body_plant(scenario, self.first))


def keep_apart() -> None:
    """Store the program of the scenario on standard input at full effort, each vehicle
    with its own code.
    """
    scenario = restore(json.load(sys.stdin))
    program = EpisodeCode(scenario, commands=False, effort=FULL).program
    # should the cache lose its machine code, a command makes it again in the least time
    program = replace(program, assembly=replace(program.assembly, effort=0))
    store_program(program_name(scenario, False, None), program)


def _with_memories(loop: LoopState, memories: Sequence[Tree]) -> LoopState:
    """Closed-loop state with the internal states of the control laws replaced."""
    agents = zip(loop.agents, memories, strict=True)
    return replace(
        loop, agents=tuple(replace(own, memory=memory) for own, memory in agents)
    )


def _carried_memory(law: Controller, memory: Tree) -> Tree:
    """Internal state of a law in the loop: of one that is called, which may be any
    object, what it observes alone.
    """
    return memory if law.compiled else PushAlone.of(memory)


class _PythonSteps:
    """Evaluation of a traced control period in Python floats instead of machine
    code.
    """

    def __init__(
        self, loop: Loop, carry: Array, parameters: Array, seed: int, episode: int
    ) -> None:
        self._loop = loop
        self._step = loop.stepper()
        self._keys = (seed, episode)
        self.carry = carry
        self.parameters = parameters
        self.command: tuple[str, tuple[float, ...]] = ("", ())

    def read_tables(self, rows: Array, log: Array) -> None:
        """Set the table of closed-loop inputs, one row per control period, and the
        table for the logged samples.
        """
        self._rows = rows
        self._log = log

    def fly(self, begin: int, end: int, start: int = 0) -> None:
        """Evaluate control periods ``begin`` to ``end`` of the input table, or up to a
        termination of the flight.
        """
        now, numbers, count = (
            tuple(self.carry.tolist()),
            tuple(self.parameters.tolist()),
            self._loop.carry,
        )
        steps = np.arange(start + begin, start + end)
        draws = [
            uniforms(*self._keys, channel, steps, many)
            for channel, many in self._loop.uniforms
        ]
        # the empty first array serves a flight that draws nothing
        drawn = np.concatenate([np.zeros((len(steps), 0)), *draws], axis=1)
        for k, row in zip(range(begin, end), drawn.tolist(), strict=True):
            try:
                outputs = self._step((*now, *numbers, *self._rows[k].tolist(), *row))
            except EpisodeEndedError as error:
                # alive is the first number of the carry
                now, self.command = (0.0, *now[1:]), (error.agent, error.command)
                break
            now, self._log[k] = outputs[:count], outputs[count:]
        self.carry[:] = now


@positional
class EngineState:
    """State of an engine between two control periods.

    Attributes:
        kept: attributes of :class:`Engine` by name, those of ``KEPT``.
        carry, parameters: loop state and parameters of the program. table: log so far.
        memories: internal states of laws that are called.
        pictures: those taken (:class:`skyarm.simulate.pictures.ArrivingPictures`).
    """

    kept: Mapping[str, Any]
    carry: Array
    parameters: Array
    table: Array
    memories: list[Any]
    pictures: dict[str, Array]


KEPT = (
    "scenario",
    "_inputs",
    "_rows",
    "_modes",
    "_outside",
    "begun",
    "tick",
    "ended",
    "from_outside",
)
"""Attributes of an engine that a snapshot keeps as they are."""


class Engine:
    """Closed-loop simulator of one flight, which advances one or many control periods
    per call.

    Args:
        code: its program. scenario: scenario that is flown now; that of the program if
            left out.
        numbers: values of the program's parameters, by path; its own if left out.

    Attributes:
        first: the loop before its first period. tick: control periods flown.
        ended: why the episode has ended before its time, or None. begun: number of the
            first period under the scenario.
        commanded: True if a command from outside has taken the law's place.
            from_outside: number of the first period of such a command; infinite without
            one.
    """

    def __init__(
        self,
        code: EpisodeCode,
        scenario: Scenario | None = None,
        numbers: Mapping[str, float] | None = None,
    ) -> None:
        self.scenario = scenario or code.scenario
        self.code = code
        self.first = code.first
        self._steps = self.scenario.steps
        self._inputs = code.inputs
        parameters = doubles(code.numbers if numbers is None else [*numbers.values()])
        self._stepper = self._make_stepper(
            code.loop, np.array(leaves(code.carry), dtype=float), parameters
        )
        # one array for good: a copy in each stretch would be garbage
        self._before = self._stepper.carry.copy()
        self._first = 0  # period of the inputs' first row
        self.recorder = FlightRecorder(code.sample, len(self.inputs.rows))
        self._read_inputs()
        self.tick = self.begun = 0
        self.ended: Ended | None = None
        self._stretch = 1
        self._pictures = FlightPictures(self.scenario, code.carry)
        self.commanded = False
        self.from_outside = math.inf

    def _make_stepper(
        self, loop: Loop, carry: Array, parameters: Array, *, peek: bool = False
    ) -> Stepper | _PythonSteps:
        """Make the evaluator of a traced program: machine code if the flight is
        compiled, else Python.
        """
        seed = self.scenario.seed
        episode = self.scenario.episode
        if self.code.kernel is None:
            return _PythonSteps(loop, carry, parameters, seed, episode)
        # a peek has a program of its own; its code is made at the first one
        kernel = Kernel(loop, Lanes(1), logging=True) if peek else self.code.kernel
        return Stepper(kernel, carry, parameters, seed=seed, episode=episode)

    def _read_inputs(self) -> None:
        """Make the table of inputs that the steps read: time, reference, then room for
        commands from the user.
        """
        self._rows = self.inputs.rows
        row = self.code.row
        if self.code.commands:
            nothing = np.zeros(
                (len(self._rows), len(leaves((row.modes, row.commands))))
            )
            self._rows = np.hstack([self._rows, nothing])
        columns, _ = field_views(row, self._rows.T)
        # (vehicles, periods), and of each vehicle (numbers, periods)
        self._modes = columns["modes"]
        own, _ = field_views(row.commands, columns["commands"])
        self._outside = [*own.values()]
        self._stepper.read_tables(self._rows, self.recorder.table)

    @property
    def inputs(self) -> FlightInputs:
        """Times and references of the control periods in memory under the scenario in
        force.
        """
        if self._inputs.scenario is not self.scenario:
            self._inputs = FlightInputs(self.scenario, self._first, self.code.window)
        return self._inputs

    @property
    def full(self) -> bool:
        """True once the next period overwrites the logged samples, which are still to
        be stored.
        """
        return self.tick >= self._first + self.code.window

    def _move_window(self) -> None:
        """Let the tables of inputs and of logged samples begin at the next period."""
        self._first = self.tick
        self._inputs = FlightInputs(
            self.scenario, self._first, self.code.window, self.inputs
        )
        self.recorder.first = self._first
        self._read_inputs()

    def step(
        self, commands: Sequence[Sequence[float]] = (), *, rotors_only: bool = False
    ) -> bool:
        """Fly one control period; False once the episode has ended or reached its
        duration.

        Args:
            commands: of each vehicle the command in place of its law's, whose memory
                stays; empty for the law's own.
            rotors_only: True for their rotor speeds alone; the laws move the joints,
                and their memories go on.
        """
        k = self.tick
        if k >= self._steps or self.ended is not None:
            return False
        if commands:
            mode = 2.0 if rotors_only else 1.0
            self._modes[:, k] = [mode if each else 0.0 for each in commands]
            for each, numbers in zip(commands, self._outside, strict=True):
                if each:
                    numbers[:, k] = each
            # restore leaves it: rows behind may still hold modes, which have to be
            # zeroed
            self.commanded = True
            self.from_outside = min(self.from_outside, k)
        elif self.commanded:
            self._modes[:, k] = 0.0
        return self._fly(k + 1)

    def fly(self, stop: int) -> bool:
        """Fly for about 0.1 s of computing time, at most up to period ``stop``; False
        once the episode is over.
        """
        if self.tick >= self._steps or self.ended is not None:
            return False
        if self.full:
            self._move_window()
        stop = min(
            stop,
            self.tick + self._stretch,
            self._first + self.code.window,
            self._steps,
            self._pictures.next(self.tick),
        )
        begun = perf_counter()
        before = self.tick
        if self.commanded:
            self._modes[:, before:stop] = 0.0
        going = self._fly(stop)
        size = self.tick - before
        # at least 1 us: a clock may not have moved, and is divided by
        seconds = max(perf_counter() - begun, 1e-6)
        # eightfold at most, as the time of a few periods is a poor measure
        self._stretch = max(1, int(size * min(8.0, PIECE / seconds)))
        return going

    def _fly(self, stop: int) -> bool:
        """Simulate up to control period ``stop``; False once the flight is over."""
        carry = self._stepper.carry
        first = self._first
        self._look()
        self._before[:] = carry
        self._stepper.fly(self.tick - first, stop - first, first)
        over = carry[ALIVE] < 0.5
        end = round(carry[TICKS]) if over else stop
        if over and self.code.kernel is not None:
            # machine code moves the law's memory on to the end of the stretch, whose
            # length the clock on the wall sets
            carry[:] = self._before
            self._stepper.fly(self.tick - first, end - first, first)
            # the period in which it ends is not flown again: nothing cleared its flag
            carry[ALIVE], carry[TICKS] = 0.0, end
        self.tick = end
        if over or stop >= self._steps:
            self.ended = self._reason(lost=over)
            return False
        return True

    def _look(self) -> None:
        """Take the pictures of this instant that a law or an ending sees."""
        self._pictures.write(self.scenario, self.tick, self._stepper.carry)

    def _reason(self, *, lost: bool) -> Ended | None:
        """Status, cause and time of the flight's early termination; None after its full
        duration.
        """
        scenario = self.scenario
        now = self.now
        time = self.tick / self.scenario.rates.control
        for i, name in enumerate(scenario.agents):
            one = scenario.of(name)
            own = now.agents[i]
            goal = (
                self.inputs.each[i].row_at(self.tick, own, now.ticks).reference.position
            )
            # the state first, as in the loop: a command that is not finite may follow
            # from it
            ending = find_ending(one, time, leaves(own.state), [*goal], own.images)
            ending = ending or failed_phase(one, time, own.clock)
            if ending is not None:
                return self._with_name(name, ending)
        if not lost:
            return None
        named, command = getattr(self._stepper, "command", ("", ()))
        commands = {named: command}
        if not command:
            sample = rebuild(self.code.sample, self.recorder.row(self.tick).tolist())
            commands = {
                name: leaves(own.command)
                for name, own in zip(scenario.agents, sample.agents, strict=True)
            }
        for name, command in commands.items():
            ending = ending_of_command(scenario.of(name), time, command)
            if ending is not None:
                return self._with_name(name, ending)
        # the loop and these functions share their conditions: to get here is a fault of
        # ours
        raise RuntimeError(
            f"at {time} s: an episode has ended in which no ending finds anything wrong"
        )

    def _with_name(self, name: str, ending: Ended) -> Ended:
        """Early termination with the name of the vehicle in its cause if there are
        several.
        """
        several = self.scenario.is_team
        return replace(ending, cause=f"{name}: {ending.cause}") if several else ending

    @property
    def piece(self) -> Piece:
        """Logged samples of all control periods since the last change of the
        scenario.
        """
        return Piece(
            self.scenario,
            self.inputs,
            self.begun,
            self.recorder.samples(self.begun, self.tick),
        )

    @property
    def now(self) -> LoopState:
        """State of plant, law, sensors and estimator before the next control period."""
        state = rebuild(self.code.carry, self._stepper.carry.tolist())
        if not self.code.calls:
            return state
        laws = zip(self._laws, self.code.calls, state.agents, strict=True)
        return _with_memories(
            state,
            [own.memory if law.compiled else calls.memory for law, calls, own in laws],
        )

    @property
    def _laws(self) -> list[Controller]:
        """Control laws of the vehicles."""
        return [each.controller for each in self.scenario.agents.values()]

    @property
    def has_nan(self) -> bool:
        """True if a number of the loop's state is NaN, apart from lost pixels."""
        carry = self._stepper.carry
        return bool(np.isnan(np.delete(carry, self._pictures.pixels)).any())

    def evaluate(self, now: LoopState) -> LoopState:
        """Evaluate one control period in Python floats from a given closed-loop state;
        return the next state.

        Plants that cannot be traced are replaced by the rigid body. The floats are
        NumPy's, which divide by 0.
        """
        scenario = self.scenario
        ticks = np.array([int(float(now.ticks))])
        program = LoopProgram(scenario)
        stages = program.stages(())
        rows = self.inputs.rows_at(ticks[0], now)
        # the memory of another law may hold anything
        if all(law.compiled for law in self._laws):
            now = rebuild(now, np.array(leaves(now), dtype=float))
            rows = rebuild(rows, np.array(leaves(rows), dtype=float))
        draws = [
            uniforms(scenario.seed, scenario.episode, each, ticks, count)[0]
            for each, count in program.draws
        ]
        # the empty first list below serves a flight that draws nothing
        with np.errstate(all="ignore"):
            return make_period(stages, program.plant_steps(stages))(
                now, rows, tuple(np.concatenate([[], *draws]))
            )[0]

    def state(self) -> State:
        """Current true state of the only vehicle."""
        return rebuild(self.first.agent.state, self._stepper.carry[2:].tolist())

    def reference(self) -> Reference:
        """Reference sample of the only vehicle that is held in the next control
        period.
        """
        (row,) = self.inputs.rows_at(self.tick, self.now)
        return row.reference

    @cached_property
    def _peek(self) -> tuple[Stepper | _PythonSteps, Array, tuple[Measurement, ...]]:
        loop = self.code.measurement
        stepper = self._make_stepper(
            loop, np.zeros(loop.carry), np.zeros(loop.parameters), peek=True
        )
        return stepper, np.empty((1, loop.logged)), loop.result[1]

    def measurements(self) -> tuple[Measurement, ...]:
        """Measurement that each control law receives in the next period."""
        self._look()
        stepper, output, example = self._peek
        stepper.carry[:] = self._stepper.carry
        stepper.parameters[:] = self._stepper.parameters
        stepper.read_tables(self._rows[self.tick : self.tick + 1], output)
        stepper.fly(0, 1, start=self.tick)
        return rebuild(example, output[0].tolist())

    def snapshot(self) -> EngineState:
        """Copy of the simulator's state, from which :meth:`restore` continues."""
        return EngineState(
            kept={name: getattr(self, name) for name in KEPT},
            carry=self._stepper.carry.copy(),
            parameters=self._stepper.parameters.copy(),
            # not copied, being large: what it has up to here is not written again
            table=self.recorder.table,
            memories=copy.deepcopy([each.memory for each in self.code.calls]),
            pictures=copy.deepcopy(self._pictures.taken),
        )

    def restore(self, state: EngineState) -> None:
        """Return to the simulator state of a snapshot."""
        for name, value in state.kept.items():
            setattr(self, name, value)
        self._stepper.carry[:] = state.carry
        self._stepper.parameters[:] = state.parameters
        self._pictures.taken = copy.deepcopy(state.pictures)
        # of the snapshot's table the flight may have overwritten what follows: it goes
        # on in one of its own
        self.recorder.table = np.empty_like(state.table)
        self.recorder.table[: self.tick] = state.table[: self.tick]
        self._stepper.read_tables(self._rows, self.recorder.table)
        # copied again: what a law does with its memory must not reach the snapshot
        memories = copy.deepcopy(state.memories)
        for calls, memory in zip(self.code.calls, memories, strict=True):
            calls.memory = memory

    def give(
        self,
        scenario: Scenario,
        numbers: Mapping[str, float],
        changed: Sequence[str],
        key: ProgramKey,
    ) -> bool:
        """Change parameter values from the next control period on; False, unchanged, if
        that needs recompilation.

        Args:
            scenario: scenario from now on.
            numbers: values of the program's parameters, by path.
            changed: paths of the numbers that are other than before.
            key: key of the program that the scenario needs.
        """
        if not self.code.fits(key, scenario, changed):
            return False
        self.scenario = scenario
        self.begun = self.tick
        self._stepper.parameters[:] = [*numbers.values()]
        # rows hold the reference; other numbers are parameters
        if any(word_of(path).startswith("reference.") for path in changed):
            self._read_inputs()
        return True

    def take_over(self, other: Engine, *, anew: Collection[str]) -> None:
        """Continue a flight from the state of another simulator; ``anew``: vehicles
        with another reference.
        """
        now = other.now
        clocks = clocks_of_change(self.scenario, self.first, now, anew=anew)
        places = component_places(self.scenario), component_places(other.scenario)
        carried = carry_over(self.first, now, places, clocks)
        memories = list[Tree]()
        for i, (law, before) in enumerate(zip(self._laws, other._laws, strict=True)):
            kept = carried.agents[i].memory
            if self.code.calls and not law.compiled:
                # the memory of a law that is called is its own: it may hold anything
                kept = copy.deepcopy(
                    now.agents[i].memory if law.law is before.law else kept
                )
                self.code.calls[i].memory = kept
            memories.append(_carried_memory(law, kept) if self.code.calls else kept)
        self._stepper.carry[:] = leaves(_with_memories(carried, memories))
        taken = self._pictures.taken
        for name, earlier in other._pictures.taken.items():
            # pictures on their way stay, but for a camera of another size or latency
            if name in taken and taken[name].shape == earlier.shape:
                taken[name] = earlier
        self.begun = other.tick
        self.tick = other.tick
        self.ended = other.ended
        self.commanded = other.commanded
        self.from_outside = other.from_outside
