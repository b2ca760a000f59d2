"""Machine code of a batch of flights for the time between two scheduled changes of the
scenario.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from itertools import compress
from typing import Any, NamedTuple

import numpy as np

from skyarm.algebra import Scalar, Scalars
from skyarm.algebra.scalars import where
from skyarm.compile import trace
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.array_evaluation import evaluate
from skyarm.compile.tracing.lower import live
from skyarm.compile.tracing.tracer import Node
from skyarm.log.metrics.accumulate import Total, Totals, advance_totals, first_totals
from skyarm.log.metrics.metric import ActuatorLimits, MetricGoal, MetricInstant
from skyarm.log.sensor_data import ESTIMATE, READINGS
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.immutable import immutable
from skyarm.records.leaves import leaves, rebuild
from skyarm.records.path_names import agent_of, word_of
from skyarm.reference import Reference
from skyarm.scenario.in_flight import Overrides, overrides_at, sources
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.batch_log import Logged, LoggedRows
from skyarm.simulate.check_endings import LaneEnd, both_hold, columns_below, statuses
from skyarm.simulate.first_state import component_places
from skyarm.simulate.inputs import episode_inputs, held_reference, table_of
from skyarm.simulate.lane_numbers import require_compiled, require_short_steps
from skyarm.simulate.loop_state import (
    AgentLoop,
    AgentSample,
    GivenRow,
    GivenRows,
    InputRow,
    LoopState,
    Sample,
    carry_over,
    structure_of,
)
from skyarm.simulate.period import make_period
from skyarm.simulate.program import (
    Goals,
    LoopProgram,
    PeriodRow,
    ProgramKey,
    TracedPeriod,
)
from skyarm.simulate.reference_clock import Waits, clocks_of_change, other_references
from skyarm.simulate.stages import AgentStages
from skyarm.simulate.tip_and_goal import goal_of, tip_at
from skyarm.world.component import by_array, columns_of_agent

Tallies = tuple[Totals, ...]
"""Running sums and extremes of each vehicle's metrics."""


class Feed:
    """Table of closed-loop inputs shared by all flights of a batch, one row per control
    period, with its decoder.

    Args:
        scenario: scenario of the batch. paths: its varied numbers. masks: window ->
            (steps,) which instants lie in it.

    Attributes:
        rows: (steps, numbers). example: record of one row.
    """

    def __init__(
        self, scenario: Scenario, paths: Sequence[str], masks: Mapping[str, Array]
    ) -> None:
        self._windows = tuple(masks)
        # windows that hold every instant are structure
        self._flags = tuple(name for name in masks if not masks[name].all())
        self._each = tuple(
            AgentFeed(scenario.of(name), _paths_of(paths, name))
            for name in scenario.agents
        )
        fed = PeriodRow(
            ticks=np.arange(scenario.steps),
            given=tuple(each.row for each in self._each),
            flags=tuple(masks[name] for name in self._flags),
            goals=tuple(each.goals for each in self._each),
        )
        self.example = structure_of(fed)
        self.rows = table_of(fed, scenario.steps)

    def read(
        self, varied: Scenario, fed: PeriodRow
    ) -> tuple[GivenRows, list[Goals], dict[str, Scalar]]:
        """Decode the closed-loop inputs of a period: references, desired positions,
        flags of the metrics' windows.
        """
        # a window over the whole flight has no flag; flags are numbers, 0 or 1
        inside: dict[str, Scalar] = dict.fromkeys(self._windows, True)
        inside |= {
            name: flag > 0.5 for name, flag in zip(self._flags, fed.flags, strict=True)
        }
        each = zip(self._each, varied.agents, fed.given, fed.goals, strict=True)
        read = [
            feed.read(varied.of(name), row, own, fed.ticks)
            for feed, name, row, own in each
        ]
        return tuple(row for row, _ in read), [own for _, own in read], inside


def _paths_of(paths: Sequence[str], name: str) -> list[str]:
    """Paths of one vehicle's numbers and of shared ones, as in the scenario of its
    flight.
    """
    return [word_of(path) for path in paths if agent_of(path) in ("", name)]


class AgentFeed:
    """Inputs of one vehicle in all control periods, with their decoder.

    Args:
        scenario: scenario of its flight. paths: its varied numbers.

    Attributes:
        row: inputs of the loop in all periods, as a record of arrays.
        goals: desired positions as arrays.
    """

    def __init__(self, scenario: Scenario, paths: Sequence[str]) -> None:
        self._scenario = scenario
        inputs = episode_inputs(scenario)
        self.row: GivenRow = InputRow(time=inputs.times, reference=())
        self.goals: Goals = ()
        # a reference that waits, or that differs between flights, is computed within
        # each flight; any other one is a table of all of them
        if not (
            scenario.agent.reference.guards
            or any(path.startswith("reference.") for path in paths)
        ):
            self.row = inputs.columns
            self.goals = tuple(
                self._goal_table(record)
                for record in (inputs.held_reference, inputs.reference)
            )

    def _goal_table(self, reference: Reference) -> MetricGoal:
        """Desired positions of base, joints and tip at every control instant, from a
        reference given as arrays.
        """
        vehicle = self._scenario.agent.vehicle
        dense = reference.dense()
        program = trace(lambda one: goal_of(vehicle, one), structure_of(dense))
        goal: MetricGoal = program.record(
            list(evaluate(program, leaves(dense), self._scenario.steps))
        )
        return goal

    def read(
        self, varied: Scenario, row: GivenRow, goals: Goals, ticks: Scalar
    ) -> tuple[GivenRow, Goals]:
        """Decode the vehicle's inputs of a period: its reference, and its desired
        positions for the metrics.

        Without goals where phases wait for guards: the loop itself evaluates its
        reference.
        """
        if self._scenario.agent.reference.guards or (
            goals and not self._arm_varies(varied)
        ):
            return row, goals
        reference = row.reference or held_reference(varied, ticks)
        if not goals:
            # evaluated in the loop, as each lane has a motion of its own
            row = InputRow(time=row.time, reference=reference)
        both = reference, varied.agent.reference.at(row.time)
        return row, tuple(goal_of(varied.agent.vehicle, each.dense()) for each in both)

    def _arm_varies(self, varied: Scenario) -> bool:
        """True if parameters that vary between flights change the arm's geometry and so
        the desired tip position.
        """
        still = self._scenario.agent.reference.at(0.0).dense()
        nodes = [
            c for c in goal_of(varied.agent.vehicle, still).tool if isinstance(c, Node)
        ]
        # constants fold: an input that is left is a varied number of the arm
        return any(node.op == "input" for node in live(nodes))


def _instant(
    stages: AgentStages,
    own: AgentLoop,
    ticks: Scalar,
    row: InputRow[Reference],
    sample: AgentSample,
    goals: Goals,
) -> MetricInstant:
    """Collect the quantities of one control instant from which the metrics of one
    vehicle are computed.
    """
    vehicle = stages.scenario.agent.vehicle
    waits = stages.waits
    command, state = sample.command, sample.state
    if not goals:
        free = waits.reference(*waits.instants(waits.log_values(own.clock, ticks))[1])
        goals = goal_of(vehicle, row.reference.dense()), goal_of(vehicle, free.dense())
    # the first command has none before it, and counts as no change
    first = ticks < 0.5
    push, parts = _contact_inputs(stages.scenario, row, sample)
    pairs = zip(command.rotor_speeds, own.queue[-1].rotor_speeds, strict=True)
    return MetricInstant(
        state=state,
        tool=tip_at(vehicle, state.position, state.quaternion, state.joints),
        command=command,
        before=tuple(where(first, new, old) for new, old in pairs),
        held=goals[0],
        continuous=goals[1],
        lag=row.time - _path_time(row),
        phase=waits.phase(_path_time(row)),
        time=row.time,
        limits=ActuatorLimits.of(vehicle, stages.scenario.agent.commands_setpoints),
        push=push,
        parts=parts,
    )


def _path_time(row: InputRow[Reference]) -> Scalar:
    """Time along the reference (s), equal to the flight time unless the reference is
    time-scaled.
    """
    return row.time if isinstance(row.path_time, tuple) else row.path_time


def _contact_inputs(
    scenario: Scenario, row: InputRow[Reference], sample: AgentSample
) -> tuple[Scalars, tuple[tuple[str, Scalars], ...]]:
    """Inputs of the contact metrics: the desired contact force, and logged values of
    winds, forces and contacts.
    """
    numbers = by_array(scenario.components, sample.wind.numbers)
    own = columns_of_agent(scenario.components, next(iter(scenario.agents)))
    constants = [
        each
        for component in scenario.components
        for each in component.constants.items()
    ]
    push = scenario.agent.reference.push
    return (
        () if push is None or not numbers else push.at(_path_time(row)),
        (
            *(
                (name, tuple(compress(each, own[name])))
                for name, each in numbers.items()
            ),
            *constants,
        ),
    )


OF_CHANGES = "changes."
"""Prefix of the paths of values that scheduled changes set."""


@immutable
class LegOptions:
    """Settings common to all intervals between the scheduled changes of a batch of
    flights.

    Attributes:
        paths: varied numbers. lanes: vector shape; None for the processor's own, equal
            to Python to the bit. stiffest: scenario that fixes the integration steps;
            None for the batch's own.
        wanted: totals that are counted, of each vehicle. masks: window -> (steps,)
            which instants lie in it.
        every: keep each so many periods' state, command and reference; 0 keeps none.
        changing: whether there are several legs. effort: effort of the compiler.
    """

    paths: tuple[str, ...]
    lanes: Lanes | None = None
    stiffest: Scenario | None = None
    wanted: Sequence[Sequence[Total]] = ()
    masks: Mapping[str, Array] = field(default_factory=dict)
    every: int = 0
    changing: bool = False
    effort: int = 0


class LegCode(NamedTuple):
    """Compiled code of a batch between two scheduled changes, and the program from
    which it was made.
    """

    kernel: Kernel
    logged: tuple[Logged, ...]
    program: LoopProgram


class Leg:
    """Simulation of all flights of a batch in the interval between two scheduled
    changes of the scenario.

    Numbers that changes set are parameters of the code, as varied ones are: legs that
    differ in these values alone share it. A number that a change sets wins over the
    lanes' own.

    Args:
        begun: initial scenario with its scheduled changes.
        overrides: values and parts in force in this leg.
        periods: control periods that it flies.
        options: settings of the batch.
        before: legs before it.

    Attributes:
        scenario: as it is in this leg. first: loop state and totals, as an example.
        code: machine code; None in a leg of no periods.
    """

    def __init__(
        self,
        begun: Scenario,
        overrides: Overrides,
        periods: range,
        options: LegOptions,
        before: Sequence[Leg] = (),
    ) -> None:
        self.periods = periods
        self._options = options
        self._begun = begun
        self._overrides = overrides
        self._shape = overrides.parts_of(begun)
        self.scenario = overrides.of(begun)
        require_compiled(self.scenario)
        fixed = {
            path
            for path in options.paths
            if overrides.hides(path) or overrides.holds(self._shape, path)
        }
        self._free = tuple(
            path
            for path in options.paths
            if path not in fixed and not path.startswith(OF_CHANGES)
        )
        self._set: dict[str, float] = dict(overrides.data(begun).numbers)
        named = {
            path: f"{OF_CHANGES}{i}.value"
            for path, i in sources(begun, periods.start).items()
        }
        self._swept = {
            path: named[path] for path in self._set if named.get(path) in options.paths
        }
        self.base = tuple(number_at(begun, path) for path in options.paths)
        stiff = self.scenario
        if options.stiffest is not None:
            own = (
                # its own changes, if it has some, may be stiffer than those of the
                # flight
                overrides_at(options.stiffest, periods.start)
                if options.stiffest.changes
                else overrides
            )
            stiff = own.of(options.stiffest)
        key = ProgramKey(
            overrides.parts, self._free, tuple(self._set), tuple(self._swept)
        )
        numbers = (*self.base, *self._set.values())
        self._program = LoopProgram(
            self.scenario, self._lane_scenario, numbers, stiffest=stiff, key=key
        )
        self.first = (self._program.first, tuple(map(first_totals, options.wanted)))
        used = dict.fromkeys(window for each in options.wanted for _, window, _ in each)
        masks = {name: options.masks[name] for name in used}
        self._feed = Feed(self.scenario, (*self._free, *self._swept), masks)
        self.rows: Array = self._feed.rows[periods.start : periods.stop]
        # most changes set numbers alone: a leg then flies the code of an earlier one
        made = (leg.code for leg in before if leg.code is not None)
        self.code: LegCode | None = next(
            (code for code in made if code.program.serves(key, self._program.plant)),
            None,
        )
        if self.code is None and periods:
            self.code = self._compile()

    def _lane_scenario(self, values: Sequence[Scalar]) -> Scenario:
        """Scenario of one flight of the batch: its own parameter values, overridden by
        scheduled changes.
        """
        named = dict(zip((*self._options.paths, *self._set), values, strict=True))
        # the first values are those of the paths
        own = {
            path: value
            for path, value in zip(self._options.paths, values, strict=False)
            if path in self._free
        }
        return with_numbers(
            self._shape, own | {path: named[path] for path in self._set}
        )

    def _compile(self) -> LegCode:
        options = self._options

        def cut(
            period: TracedPeriod, both: tuple[LoopState, Tallies]
        ) -> tuple[tuple[LoopState, Tallies], tuple[Logged, ...]]:
            stages, (before, tallies) = period.stages, both
            # the number of the period is that of the row, one for all lanes; those that
            # ended keep their own
            loop = replace(before, ticks=period.row.ticks)
            given, goals, inside = self._feed.read(stages.scenario, period.row)
            rows = stages.lead(loop, given)
            following, flown = make_period(stages, period.plant)(
                loop, rows, period.uniforms
            )
            following = replace(following, ticks=before.ticks + flown.alive)
            alive = flown.alive > 0.5
            each = zip(
                stages.agents, loop.agents, rows, flown.agents, goals, strict=True
            )
            instants = [
                _instant(agent, own, loop.ticks, row, sample, goal)
                for agent, own, row, sample, goal in each
            ]
            counted = {
                name: both_hold(alive, within) for name, within in inside.items()
            }
            # a leg may count nothing
            rows_of_totals = zip(tallies, options.wanted, instants, strict=False)
            tallies = tuple(
                advance_totals(sums, totals, now, counted)
                for sums, totals, now in rows_of_totals
            )
            log = (
                self._log_entries(stages.scenario, rows, flown) if options.every else ()
            )
            return (following, tallies), log

        loop = self._program.trace(cut, self.first, self._feed.example)
        # a program of its own for what depends on time alone takes 20 ms to compile:
        # motions that vary earn it back
        ahead = any("reference." in path for path in options.paths)
        kernel = Kernel(
            loop,
            options.lanes,
            logging=options.every > 0,
            effort=options.effort,
            ahead=ahead,
        )
        return LegCode(kernel, loop.result[1], self._program)

    def _log_entries(
        self, varied: Scenario, rows: Sequence[InputRow[Reference]], flown: Sample
    ) -> tuple[Logged, ...]:
        """Quantities of each vehicle at a control instant that the log of the batch
        contains.
        """
        logged = []
        for agent, row, sample in zip(
            varied.agents.values(), rows, flown.agents, strict=True
        ):
            reference = (
                row.reference.dense() if self._options.changing else row.reference
            )
            # a law's samples to come are no motion of this instant, and laws before and
            # after a change take others
            reference = replace(reference, ahead=())
            received = tuple(
                (f"{READINGS}.{name}", reading) for name, reading in sample.readings
            )
            received += ((ESTIMATE, sample.measurement),) if agent.has_estimator else ()
            logged.append(
                Logged(
                    alive=flown.alive,
                    state=sample.state,
                    command=sample.command,
                    reference=reference,
                    received=received,
                )
            )
        return tuple(logged)

    def numbers_by_path(self, columns: Sequence[Array]) -> dict[str, Array]:
        """Parameter values of a batch between two scheduled changes, by parameter path,
        one array entry per flight.
        """
        given = dict(zip(self._options.paths, columns, strict=True))
        own = {path: given[path] for path in self._free}
        return own | {path: given[source] for path, source in self._swept.items()}

    def parameters(self, columns: Sequence[Array], lanes: int) -> Array:
        """Inputs of the compiled program that are constant in flight, shape
        (parameters, flights).
        """
        given = dict(zip(self._options.paths, columns, strict=True))
        values = self._set | self._masses_of_models(given)
        rows = [
            given[self._swept[p]] if p in self._swept else np.full(lanes, v)
            for p, v in values.items()
        ]
        every = [*columns, *rows]
        return np.stack(every) if every else np.zeros((0, lanes))

    def _masses_of_models(self, given: Mapping[str, Array]) -> dict[str, Any]:
        """Payload masses of laws' models in this leg, as far as they follow from masses
        that vary, (lanes,) each.
        """
        # models follow payloads (believed): a varied mass is one of the law's model,
        # too
        loads = {
            path: column
            for path, column in columns_below(given, ("payloads.",)).items()
            if path.endswith(".mass")
        }
        if not loads:
            return {}
        numbers = dict(
            overrides_at(with_numbers(self._begun, loads), self.periods.start).numbers
        )
        # limits that a safety layer measured anew follow from no mass
        return {path: numbers.get(path, value) for path, value in self._set.items()}

    def begin(
        self,
        parameters: Array,
        seed: int,
        episodes: Array,
        last: tuple[Leg, Array] | None,
    ) -> Array:
        """Initial loop states and metric sums, one column per flight; carried over from
        a previous interval, if any.
        """
        fresh = self._program.start(parameters, seed, episodes)
        if last is None:
            totals = np.array(leaves(self.first[1]))[:, None]
            return np.vstack([fresh, np.repeat(totals, len(episodes), axis=1)])
        leg, carry = last
        loop, totals_now = rebuild(leg.first, carry)
        begun = rebuild(self.first[0], fresh)
        anew = other_references(self.scenario, self._overrides, leg._overrides)
        clocks = clocks_of_change(self.scenario, begun, loop, anew=anew)
        now = carry_over(
            begun,
            loop,
            (component_places(self.scenario), component_places(leg.scenario)),
            clocks,
        )
        return table_of((now, totals_now), len(episodes)).T

    def fly(
        self, carry: Array, parameters: Array, seed: int, episodes: Array, threads: int
    ) -> tuple[Array, list[LoggedRows]]:
        """Simulate the interval for all flights; return final loop states with metric
        sums, and the logged samples.
        """
        if self.code is None:
            return carry, []
        kernel = self.code.kernel
        logged = self.code.logged
        every = max(1, self._options.every)
        limit = np.finfo(kernel.dtype).max
        log: list[LoggedRows] = []
        # samples are kept at multiples of ``every`` from the beginning of the flight
        aligned = min(-(-self.periods.start // every) * every, self.periods.stop)
        for start, stop in (
            (self.periods.start, aligned),
            (aligned, self.periods.stop),
        ):
            if start < stop:
                rows = self.rows[start - self.periods.start : stop - self.periods.start]
                # extremes start at 1e300, whose cast to 32 bits would overflow with a
                # warning
                bounded = np.clip(carry, -limit, limit)
                carry, samples = kernel.run(
                    bounded,
                    parameters,
                    rows,
                    seed=seed,
                    episodes=episodes,
                    start=start,
                    threads=threads,
                    every=every,
                )
                log += [(logged, samples)] if logged and start % every == 0 else []
        return carry, log

    def statuses(
        self, columns: Sequence[Array], now: LoopState, ticks: Array, ended: Array
    ) -> Array:
        """Termination status of each flight of the batch at the end of this interval,
        from its loop state.
        """
        return lane_statuses(
            self.scenario, self.numbers_by_path(columns), now, ticks, ended
        )

    def require(self, columns: Sequence[Array]) -> None:
        """Refuse parameter values for which the compiled integration steps are too
        long.

        Raises:
            ScenarioError: one line.
        """
        require_short_steps(
            self.scenario, self.numbers_by_path(columns), self._program.largest
        )


def lane_statuses(
    scenario: Scenario,
    values: Mapping[str, Array],
    now: LoopState,
    ticks: Array,
    ended: Array,
) -> Array:
    """Termination status of each flight of a batch, from its final loop state.

    Args:
        scenario: scenario of the lanes.
        values: path -> (lanes,) numbers that differ.
        now: last state of the loop, its scalars (lanes,).
        ticks: control periods flown.
        ended: True where the lane stopped before its time.
    """
    motion = columns_below(values, ("reference.",))
    # lanes that diverged hold infinities, which are no reason for a warning
    with np.errstate(all="ignore"):
        varied = with_numbers(scenario, motion)
        ends = [
            _lane_end(varied.of(name), own, ticks)
            for name, own in zip(varied.agents, now.agents, strict=True)
        ]
    return statuses(scenario, values, ends, ended)


def _lane_end(varied: Scenario, own: AgentLoop, ticks: Array) -> LaneEnd:
    """End of one vehicle in each flight of a batch, from the scenario of its flight
    with the lanes' numbers.
    """
    if own.clock:
        reference = Waits(varied).held_reference(own.clock, ticks)
    else:
        # after the last period its sample is still held
        reference = held_reference(varied, np.minimum(ticks, varied.steps - 1))
    failed = np.asarray(own.clock.failed) > 0.5 if own.clock else None
    return LaneEnd(own.state, table_of(reference.dense().position, len(ticks)), failed)
