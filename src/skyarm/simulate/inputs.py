"""Inputs of the closed loop at all control instants: times and references."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np

from skyarm.algebra import Scalar
from skyarm.algebra.scalars import floor
from skyarm.compile import Program, trace
from skyarm.compile.tracing.array_evaluation import evaluate
from skyarm.control.controller import preview_leads
from skyarm.records.arrays import AnyArray, Array, doubles
from skyarm.records.leaves import Tree, leaves, rebuild
from skyarm.reference import Publisher, Reference
from skyarm.reference.path_time import by_flight_time
from skyarm.reference.preview import with_preview
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.loop_state import (
    AgentLoop,
    GivenRow,
    InputRow,
    LoopState,
    PathClock,
    structure_of,
)
from skyarm.simulate.reference_clock import Waits


@dataclass(frozen=True)
class EpisodeInputs:
    """Times and references at consecutive control instants of a flight, as tables
    computed on first use.

    Attributes:
        scenario: scenario of the inputs.
        ticks: numbers of the control instants. times: s.
        held_reference: the reference as published and held, as a record of arrays.
        program: traced program from a time (s) to the reference.
    """

    scenario: Scenario
    ticks: range
    times: Array
    held_reference: Reference
    program: Program

    @property
    def reference(self) -> Reference:
        """Continuous reference at all control instants, as a Reference of arrays."""
        return _sample(self.program, self.times)

    def reference_between(self, start: int, stop: int) -> Reference:
        """Continuous reference in rows ``start`` to ``stop``, as a Reference of
        arrays.
        """
        return _sample(self.program, self.times[start:stop])

    @cached_property
    def held_leaves(self) -> Array:
        """Sampled-and-held reference as a table: one row per control instant, one
        column per scalar.
        """
        return table_of(self.held_reference, len(self.ticks))

    @cached_property
    def columns(self) -> GivenRow:
        """Closed-loop inputs at the control instants, as a record of arrays.

        Time, held reference and time-scaled one; the time alone where phases wait.
        """
        if self.waits.guards:
            return InputRow(time=self.times, reference=())
        return InputRow(
            time=self.times,
            reference=self.held_reference,
            scaled=self.scaled_reference,
            path_time=self.path_time,
        )

    @cached_property
    def rows(self) -> Array:
        """Table of closed-loop inputs, one row per control instant."""
        return table_of(self.columns, len(self.ticks))

    @cached_property
    def scaled_reference(self) -> Reference | tuple[()]:
        """Time-scaled sampled reference as a Reference of arrays; empty without time
        scaling.
        """
        path = self.scenario.agent.path_time
        if path is None:
            return ()
        instants = np.arange(self.ticks.start, self.ticks.stop)
        times = held_times(self.scenario, instants)

        def at(lead: Scalar) -> Reference:
            s = path.derivatives(times + lead)
            return by_flight_time(_sample(self.program, s[0]), s)

        return with_preview(
            at(0.0), preview_leads(self.scenario.agent.controller.par), at
        )

    @cached_property
    def path_time(self) -> Array | tuple[()]:
        """Time along the reference (s) at each control instant, (N,); empty without
        time scaling.
        """
        path = self.scenario.agent.path_time
        return () if path is None else np.asarray(path.derivatives(self.times)[0])

    @cached_property
    def row_example(self) -> GivenRow:
        """Closed-loop inputs at one control instant with zeros as numbers, from which a
        program is traced.
        """
        return structure_of(self.columns)

    @cached_property
    def waits(self) -> Waits:
        """Evaluator of the conditions (guards) that end phases of the reference, with
        the reference's clock.
        """
        return Waits(self.scenario)

    def waiting_references(
        self, columns: Iterable[Array]
    ) -> tuple[Reference, Reference, Array]:
        """Held reference, continuous reference and path time (s) of a task whose phases
        wait for conditions.

        Args:
            columns: logged values of the reference clock (``led`` of a sample), (N,)
                each.
        """
        (sampled, its_offset), (own, offset) = self.waits.instants(
            [doubles(column) for column in columns]
        )
        times = np.asarray(own)
        return self._at(np.asarray(sampled), its_offset), self._at(times, offset), times

    def _at(self, times: Array, offset: Sequence[Scalar]) -> Reference:
        return _sample(self._shifted_motion if offset else self.program, times, *offset)

    @cached_property
    def _shifted_motion(self) -> Program:
        return trace(
            lambda given: self.waits.reference(given[0], given[1:]), (0.0,) * 5
        )

    def held_now(self, clock: PathClock, ticks: Scalar) -> Reference:
        """Reference sample of a control period, at the clock of a task, which stops
        while a phase waits.
        """
        # by the program of the tables, so that it has their bits
        columns = [np.array([float(value)]) for value in self.waits.times(clock, ticks)]
        sample, _, _ = self.waiting_references(columns)
        (since, offset), _ = self.waits.instants(columns)
        leads = preview_leads(self.scenario.agent.controller.par)
        end = float(self.waits.end(clock))
        sample = with_preview(
            sample,
            leads,
            lambda lead: self._at(np.minimum(np.asarray(since) + lead, end), offset),
        )
        dense = sample.dense()
        return rebuild(
            dense,
            [float(np.asarray(leaf).reshape(-1)[0]) for leaf in leaves(dense)],
        )

    def row_at(self, tick: int, own: AgentLoop, ticks: Scalar) -> InputRow[Reference]:
        """Closed-loop inputs of the control period that begins with a given state of
        the vehicle and its control.
        """
        # after the last period the last row still holds the reference
        numbers = iter(self.rows[min(tick, self.ticks[-1]) - self.ticks[0]].tolist())
        clock = own.clock
        if clock:
            path_time = float(self.waits.path_time(clock))
            return InputRow(
                time=next(numbers),
                reference=self.held_now(clock, ticks),
                path_time=path_time,
            )
        return cast("InputRow[Reference]", rebuild(self.row_example, numbers))

    @cached_property
    def reference_example(self) -> Reference:
        """Reference at one instant with zeros as numbers, from which a program is
        traced.
        """
        return structure_of(self.held_reference)


class FlightInputs:
    """Times and references of all vehicles of a flight at consecutive control instants.

    Args:
        scenario: scenario of the flight.
        first: number of the first instant.
        window: number of instants with one less; all if left out.
        before: inputs of the same scenario at other instants, whose traced programs
            serve again.

    Attributes:
        scenario: scenario of the flight. each: inputs of each vehicle.
    """

    def __init__(
        self,
        scenario: Scenario,
        first: int = 0,
        window: int | None = None,
        before: FlightInputs | None = None,
    ) -> None:
        self.scenario = scenario
        ticks = range(
            # one more: a flight that ends in the window's last period is judged by the
            # next row
            first,
            min(first + (window or scenario.steps) + 1, scenario.steps),
        )
        self.each: tuple[EpisodeInputs, ...] = tuple(
            episode_inputs(
                scenario.of(name),
                ticks,
                None if before is None else before.each[i].program,
            )
            for i, name in enumerate(scenario.agents)
        )

    @property
    def times(self) -> Array:
        """Control instants, s."""
        return self.each[0].times

    @cached_property
    def rows(self) -> Array:
        """Table of closed-loop inputs, one row per control instant: those of each
        vehicle in turn.
        """
        first, *others = (each.rows for each in self.each)
        # the table of an only vehicle is taken as it is: hstack would copy it
        return np.hstack([first, *others]) if others else first

    def rows_at(self, tick: int, now: LoopState) -> tuple[InputRow[Reference], ...]:
        """Closed-loop inputs of all vehicles in the control period that begins with a
        given loop state.
        """
        return tuple(
            each.row_at(tick, own, now.ticks)
            for each, own in zip(self.each, now.agents, strict=True)
        )


def episode_inputs(
    scenario: Scenario, ticks: range | None = None, program: Program | None = None
) -> EpisodeInputs:
    """Compute times and references of a flight at control instants, rounded exactly as
    Python floats are.

    Args:
        scenario: scenario of one vehicle.
        ticks: numbers of the instants; all if left out.
        program: traced reference of the scenario, if there is one already.
    """
    ticks = range(scenario.steps) if ticks is None else ticks
    # k / rate, not k * period: 1500 * 0.005 is not 7.5 in binary, and a gust must start
    # on its tick
    instants = np.arange(ticks.start, ticks.stop)
    times = instants / scenario.rates.control
    held = held_times(scenario, instants)
    program = program or _motion(scenario)

    def at(lead: Scalar) -> Reference:
        return _sample(program, held + lead)

    published = with_preview(
        _sample(program, held), preview_leads(scenario.agent.controller.par), at
    )
    # no sample of a motion: the hand's command goes out in each control period
    if published.load:
        published = replace(published, load=_sample(program, times).load)
    return EpisodeInputs(scenario, ticks, times, published, program)


def held_times(scenario: Scenario, ticks: AnyArray) -> Any:
    """Times (s) of the reference samples that are held in control periods ``ticks``."""
    rates = scenario.rates
    publisher = Publisher(control_rate=rates.control, reference_rate=rates.reference)
    return publisher.held_time(ticks)


def _motion(scenario: Scenario) -> Program:
    """Traced program from a time (s) to the scenario's reference at that time."""
    reference = scenario.agent.law_reference
    return trace(lambda clock: reference.at(clock[0]), (0.0,))


def _sample(program: Program, times: Array, *others: Scalar) -> Reference:
    """Evaluate a traced reference program at an array of times (s), given the program's
    further inputs, if any.
    """
    reference: Reference = program.record(
        list(evaluate(program, [times, *others], len(times)))
    )
    return reference


def held_row(scenario: Scenario, ticks: Scalar) -> InputRow[Reference]:
    """Time and held reference after a number of control periods, for a reference whose
    task phases do not wait.
    """
    time = ticks / float(scenario.rates.control)
    return InputRow(time=time, reference=held_reference(scenario, ticks).dense())


def held_reference(scenario: Scenario, ticks: Scalar) -> Reference:
    """Reference sample that a flight holds in control period number ``ticks``."""
    rate = float(scenario.rates.control)
    ratio = float(scenario.rates.control // scenario.rates.reference)
    # half a tick, so that rounding of the quotient never finds the sample before
    time = floor((ticks + 0.5) / ratio) * ratio / rate
    leads = preview_leads(scenario.agent.controller.par)
    motion = scenario.agent.law_reference
    reference = with_preview(
        motion.at(time), leads, lambda lead: motion.at(time + lead)
    )
    if reference.load:  # the hand's command is that of each control period
        reference = replace(
            reference, load=scenario.agent.reference.at(ticks / rate).load
        )
    return reference


def table_of(record: Tree, count: int) -> Array:
    """Table of a dataclass of arrays: one row per control instant, one column per
    scalar field.
    """
    columns = [np.broadcast_to(doubles(leaf), (count,)) for leaf in leaves(record)]
    return np.stack(columns, axis=1) if columns else np.zeros((count, 0))
