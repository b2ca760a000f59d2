"""Closed loop of a batch: initial states, integration steps and statuses of flights with different parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from skyarm.algebra import Scalar, Scalars
from skyarm.algebra.scalars import floor
from skyarm.compile import trace
from skyarm.compile.tracing.array_evaluation import evaluate
from skyarm.compile.tracing.program import Loop, trace_loop
from skyarm.control.controller import preview_leads
from skyarm.plant.largest_step import lanes_step
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.leaves import Tree
from skyarm.records.path_names import word_of
from skyarm.reference import Reference
from skyarm.reference.preview import with_preview
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.check_endings import LaneEnd, statuses
from skyarm.simulate.draws import draw_plan, draws_needed, start_draws
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.inputs import table_of
from skyarm.simulate.loop_state import AgentLoop, InputRow, LoopState, structure_of
from skyarm.simulate.plant_steps import Substeps, rigid_body_plant
from skyarm.simulate.reference_clock import Waits

Vary = Callable[[Sequence[Scalar]], Scenario]
"""Function from the numbers of a lane to its scenario."""


class LaneLoop:
    """Closed loop of a scenario whose parameters differ between the SIMD lanes of a batch.

    Args:
        scenario: scenario with nominal parameters. vary: maker of a lane's scenario from parameters. base: nominal
            values of these.
        stiffest: the scenario whose joint friction, air, forces and drives fix the integration steps.

    Attributes:
        first: loop state before the first period, as an example. substeps: integration steps of an interval.
        plant: of the stiffest scenario. largest: longest integration step of that plant, s.
    """

    def __init__(self, scenario: Scenario, vary: Vary, base: Sequence[float], stiffest: Scenario) -> None:
        self.scenario, self.vary, self.base = scenario, vary, tuple(base)
        self.first: LoopState = first_loop_state(scenario)
        self.plant = rigid_body_plant(stiffest, self.first if stiffest is scenario else None)
        self.substeps = Substeps(self.plant)
        self.largest = lanes_step(self.plant.around, euler=stiffest.integrator == "euler")
        counts = [2 * count for _, count in draw_plan(scenario).models]
        self._start = trace(self._starting, self.base, *((0.5,) * count for count in counts))

    def _starting(self, numbers: Sequence[Scalar], *draws: Scalars) -> LoopState:
        return first_loop_state(self.vary(numbers), draws)

    def start(self, numbers: Array, seed: int, episodes: Array) -> Array:
        """Initial loop states of all flights of a batch: one row per scalar, one column per flight.

        Args:
            numbers: (numbers, lanes).
            seed: key of the noise.
            episodes: (lanes,), the other key.
        """
        columns = [*numbers]
        for draws in start_draws(self.scenario, seed, episodes):
            columns += [*draws.T]
        return evaluate(self._start, columns, len(episodes))

    def program(self, step: Callable[..., tuple[Tree, Tree]], carry: Tree, parameters: Tree, fed: Tree = ()) -> Loop:
        """Trace one control period of a batch into a program for machine code, from placeholder arguments."""
        draws = draws_needed(self.scenario)
        return trace_loop(step, structure_of(carry), parameters, fed, draws, loops=True)


def held_row(scenario: Scenario, ticks: Scalar) -> InputRow[Reference]:
    """Time and held reference after a number of control periods, for a reference whose task phases do not wait."""
    time = ticks / float(scenario.rates.control)
    return InputRow(time=time, reference=held_reference(scenario, ticks).dense())


def held_reference(scenario: Scenario, ticks: Scalar) -> Reference:
    """Reference sample that a flight holds in control period number ``ticks``."""
    rate, ratio = float(scenario.rates.control), float(scenario.rates.control // scenario.rates.reference)
    time = floor((ticks + 0.5) / ratio) * ratio / rate
    leads, motion = preview_leads(scenario.agent.controller.par), scenario.agent.law_reference
    reference = with_preview(motion.at(time), leads, lambda lead: motion.at(time + lead))
    if reference.load:  # the hand's command is that of each control period
        reference = replace(reference, load=scenario.agent.reference.at(ticks / rate).load)
    return reference


def lane_statuses(scenario: Scenario, values: Mapping[str, Array], now: LoopState, ticks: Array, ended: Array) -> Array:
    """Termination status of each flight of a batch, from its final loop state.

    Args:
        scenario: scenario of the lanes.
        values: path -> (lanes,) numbers that differ.
        now: last state of the loop, its scalars (lanes,).
        ticks: control periods flown.
        ended: True where the lane stopped before its time.
    """
    motion = {path: column for path, column in values.items() if word_of(path).startswith("reference.")}
    with np.errstate(all="ignore"):
        varied = with_numbers(scenario, motion)
        ends = [_lane_end(varied.of(name), own, ticks) for name, own in zip(varied.agents, now.agents, strict=True)]
    return statuses(scenario, values, ends, ended)


def _lane_end(varied: Scenario, own: AgentLoop, ticks: Array) -> LaneEnd:
    """End of one vehicle in each flight of a batch, from the scenario of its flight with the lanes' numbers."""
    if own.clock:
        reference = Waits(varied).held_reference(own.clock, ticks)
    else:
        reference = held_reference(varied, np.minimum(ticks, varied.steps - 1))
    failed = np.asarray(own.clock.failed) > 0.5 if own.clock else None
    return LaneEnd(own.state, table_of(reference.dense().position, len(ticks)), failed)
