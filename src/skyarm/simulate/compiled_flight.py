"""Episodes on the rigid-body plant as machine code: the closed loop traced, compiled, and stepped for many lanes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.compile import leaves, rebuild
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.repeat import operations
from skyarm.compile.tracing.stepped_loop import Loop, trace_loop
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.scalars.philox import uniforms
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.simulate.assemble_log import Samples
from skyarm.simulate.check_endings import Ended, ended_by, failed_phase, refused
from skyarm.simulate.draws import draws_needed
from skyarm.simulate.first_state import first_loop_state, first_surroundings
from skyarm.simulate.inputs import EpisodeInputs
from skyarm.simulate.loop_state import LoopState, Row, Sample, structure_of
from skyarm.simulate.own_code_trials import try_own_code
from skyarm.simulate.period import make_period
from skyarm.simulate.rigid_body_steps import RigidBodySteps
from skyarm.simulate.stages import Stages

Array = npt.NDArray[np.float64]
Progress = Callable[[int, int], None]

Keep = Callable[[int, Callable[[int, int], Samples]], None]
"""(periods flown, function that gives what some of them left), called while an episode flies."""

ALIVE = 0
"""Place of ``LoopState.alive`` among a carry's leaves."""


@dataclass(frozen=True, slots=True)
class Traced:
    """A scenario's closed loop, ready to compile.

    Attributes:
        loop: the stepped program. carry: first carry. sample: record that is logged.
    """

    loop: Loop
    carry: LoopState
    sample: Sample


def trace_scenario(scenario: Scenario, inputs: EpisodeInputs) -> Traced:
    """Trace one control period of a scenario with all its numbers as constants."""
    if scenario.changes:
        raise ScenarioError("changes: must be left out of one program; a Session makes one for each of them")
    scenario.controller.require_compiled("machine code of the loop")
    try_own_code(scenario)
    stages, carry = Stages(scenario), first_loop_state(scenario)
    around = first_surroundings(scenario, carry)
    plant = RigidBodyPlant(scenario.world, around, scenario.integrator, 1.0 / scenario.rates.physics)
    period = make_period(stages, RigidBodySteps(stages, plant.substeps))

    def step(now: LoopState, _parameters: Any, fed: Row, uniforms: Any) -> tuple[LoopState, Sample]:
        return period(now, fed, uniforms)

    loop = trace_loop(step, structure_of(carry), (), inputs.row_example, draws_needed(scenario), loops=True)
    return Traced(loop, carry, loop.result[1])


@dataclass(frozen=True, slots=True)
class Flown:
    """What one episode left.

    Attributes:
        rows: leaves of ``sample`` at each instant while it ran. carry: the last one. sample: their record.
        ended: the row of the instant at which it ended before its time, or None.
    """

    rows: Array
    carry: LoopState
    sample: Sample
    ended: Array | None


Advance = Callable[[Array, Array, int], tuple[Array, Array]]
"""(carry, rows, number of the first) -> (carry after them, what they log)."""

SHORT = 500_000_000
"""Operations up to which an episode ends sooner in code that is made in a hurry: 150 000 periods of a quadrotor with a
two-joint arm, where the time saved in making it is the time lost in flying."""

PIECE = 0.1
"""s that machine code may run at a stretch: between stretches Ctrl-C is heard."""


def fly(
    scenario: Scenario,
    inputs: EpisodeInputs,
    *,
    reference: bool = False,
    progress: Progress | None = None,
    keep: Keep | None = None,
    longest: int | None = None,
) -> Flown:
    """Fly one episode.

    Args:
        scenario: on the rigid-body plant.
        inputs: its tables.
        reference: step in Python floats in place of machine code; the numbers are the same to the last bit.
        progress: called with (periods done, periods in all) about a hundred times.
        keep: called after each stretch that the episode outlives.
        longest: control periods at a stretch; results do not depend on it.

    Raises:
        NoMachineCodeError: it cannot be made here; use ``reference``.
    """
    traced = trace_scenario(scenario, inputs)
    advance = _in_python(traced.loop, scenario) if reference else _in_machine_code(traced.loop, scenario)
    carry, log, done = _advanced(traced, advance, inputs, progress, keep, longest or scenario.steps)
    final: LoopState = rebuild(traced.carry, iter(carry.tolist()))
    ticks = round(float(final.ticks))
    return Flown(log[:ticks], final, traced.sample, log[ticks] if ticks < done else None)


def _advanced(
    traced: Traced,
    advance: Advance,
    inputs: EpisodeInputs,
    progress: Progress | None,
    keep: Keep | None,
    longest: int,
) -> tuple[Array, Array, int]:
    """Carry, log and how many periods were stepped, piece by piece until the end of the episode."""
    total = inputs.scenario.steps
    every = max(1, total // 100)
    carry = np.array(leaves(traced.carry), dtype=float)
    log = np.empty((total, traced.loop.logged))
    done, size, due = 0, 1, 0

    def left(start: int, stop: int) -> Samples:
        return samples(Flown(log[start:stop], traced.carry, traced.sample, None))

    while done < total and carry[ALIVE] > 0.5:
        if progress is not None and done >= due:
            progress(done, total)
            due = (done // every + 1) * every
        size = max(1, min(size, longest, total - done, due - done if progress else total))
        stop, begun = done + size, perf_counter()
        carry, log[done:stop] = advance(carry, inputs.rows(done, stop), done)
        seconds = max(perf_counter() - begun, 1e-6)
        done, size = stop, int(size * min(8.0, PIECE / seconds))
        if keep is not None and carry[ALIVE] > 0.5:
            keep(done, left)
    if progress is not None:
        progress(total, total)
    return carry, log, done


def _in_machine_code(loop: Loop, scenario: Scenario) -> Advance:
    """Steps of a compiled program."""
    short = scenario.steps * operations(loop.program.nodes) < SHORT
    kernel = Kernel(loop, Lanes(1), logging=True, effort=0 if short else 2)
    seed, episodes = scenario.seed, np.array([scenario.episode])

    def advance(carry: Array, rows: Array, first: int) -> tuple[Array, Array]:
        after, logged = kernel.run(carry[:, None], np.zeros((0, 1)), rows, start=first, seed=seed, episodes=episodes)
        return after[:, 0], logged[:, :, 0]

    return advance


def _in_python(loop: Loop, scenario: Scenario) -> Advance:
    """The same steps in Python floats."""
    step = loop.stepper()

    def advance(carry: Array, rows: Array, first: int) -> tuple[Array, Array]:
        ticks = np.arange(first, first + len(rows))
        draws = [uniforms(scenario.seed, scenario.episode, channel, ticks, count) for channel, count in loop.uniforms]
        numbers: Sequence[Any] = np.concatenate(draws, axis=1).tolist() if draws else [()] * len(rows)
        now, log = tuple(carry.tolist()), []
        for row, drawn in zip(rows.tolist(), numbers, strict=True):
            result = step((*now, *row, *drawn))
            now = result[: loop.carry]
            log.append(result[loop.carry :])
        return np.array(now), np.array(log)

    return advance


def samples(flown: Flown) -> Samples:
    """An episode's rows as the tables of a log: views, no copies."""
    columns: Sample = rebuild(flown.sample, iter(flown.rows.T))
    marks = np.cumsum([len(leaves(part)) for part in (flown.sample.alive, columns.state, columns.command)])
    first, command, measured = marks.tolist()
    rows = flown.rows
    end = rows.shape[1] - len(columns.led)
    found, led = rows[:, end - len(columns.found) : end], rows[:, end:]
    states, commands = rows[:, first:command], rows[:, command:measured]
    return Samples(states, commands, columns.measurement, columns.readings, columns.wind, found, led)


def ending(scenario: Scenario, inputs: EpisodeInputs, flown: Flown, tick: int) -> Ended | None:
    """Why the episode stopped after so many periods, in words."""
    goal = inputs.held_position(tick, flown.carry)
    time = tick / scenario.rates.control
    found = ended_by(scenario, time, leaves(flown.carry.state), goal)
    found = found or failed_phase(scenario, time, flown.carry.clock)
    if flown.ended is None or found is not None:
        return found
    sample: Sample = rebuild(flown.sample, iter(flown.ended.tolist()))
    found = refused(scenario, time, leaves(sample.command))
    if found is None:
        raise RuntimeError(f"at {time} s: machine code ended a flight in which no ending finds anything wrong")
    return found
