"""Program of the closed loop: a control period of a scenario, cut somewhere, with some
numbers free.

Every simulator of a scenario traces one. A single flight and a batch fly the whole
period, an environment begins it with an action, the open loop ends where its feedback
would close. Numbers, first state, integration steps, random numbers and inputs are
those of the scenario and the same for all.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

from skyarm.algebra import Scalars
from skyarm.compile import Program, trace
from skyarm.compile.tracing.array_evaluation import evaluate
from skyarm.compile.tracing.program import Channels, Loop, trace_loop
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.log.metrics.metric import MetricGoal
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.largest_step import lanes_step
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Tree
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.draws import draw_plan, draws_needed, start_draws
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.loop_state import GivenRows, LoopState, structure_of
from skyarm.simulate.period import PlantSteps, Uniforms
from skyarm.simulate.plant_steps import RigidBodySteps, Substeps, rigid_body_plant
from skyarm.simulate.stages import Stages

Goals = tuple[MetricGoal, ...]
"""Desired positions of one vehicle by the held and the continuous reference; empty
where the loop evaluates it."""


@immutable
class PeriodRow:
    """Inputs of one control period, the same for all flights of a program.

    Attributes:
        ticks: scalar, number of the period where all flights fly the same one; else
            empty, and each counts its own.
        given: of each vehicle time and reference.
        modes, commands: of each vehicle the mode (as ``given`` of :class:`Stages`) and
            values of a command from outside; empty where none is possible.
        flags, goals: open metric windows, and desired positions of each vehicle; empty
            where nothing is measured.
    """

    ticks: Any = ()
    given: GivenRows = ()
    modes: Scalars = ()
    commands: tuple[Command, ...] = ()
    flags: Scalars = ()
    goals: tuple[Goals, ...] = ()


NO_INPUTS = PeriodRow()
"""Inputs of a period that reads none."""


class ProgramKey(NamedTuple):
    """Structure from which a program was traced; programs of equal keys differ in the
    values of their numbers alone.

    Attributes:
        parts: replaced parts. free: paths whose numbers are arguments.
        changed: paths that changes in flight set. swept: those of them that vary
            between flights.
    """

    parts: tuple[tuple[str, object], ...] = ()
    free: tuple[str, ...] = ()
    changed: tuple[str, ...] = ()
    swept: tuple[str, ...] = ()


AS_IT_IS = ProgramKey()
"""Key of a scenario in which no part is replaced and no number is free."""


class TracedPeriod(NamedTuple):
    """One control period under trace: stages and plant of the scenario with its
    numbers, inputs, random numbers.
    """

    stages: Stages
    plant: PlantSteps[State]
    numbers: Any
    row: PeriodRow
    uniforms: Uniforms


Cut = Callable[[TracedPeriod, Any], tuple[Tree, Tree]]
"""Part of a control period: function from a period and the state before it to the state
after it and what is logged."""


class LoopProgram:
    """Control period of a scenario, some of whose numbers are free, for tracing.

    Args:
        scenario: scenario with the present values of its numbers.
        vary: the scenario from the numbers; None without any.
        numbers: record of the present values, from which the program is traced.
        stiffest: the scenario whose joint friction, air, forces and drives fix the
            integration steps; else the same.
        key: structure of the scenario.
        loops: keep repetitions as loops, for machine code; JAX wants them written out.
    """

    def __init__(
        self,
        scenario: Scenario,
        vary: Callable[[Any], Scenario] | None = None,
        numbers: Tree = (),
        *,
        stiffest: Scenario | None = None,
        key: ProgramKey = AS_IT_IS,
        loops: bool = True,
    ) -> None:
        self.scenario = scenario
        self.numbers = numbers
        self.key = key
        self.vary = vary or (lambda _: scenario)
        self._stiffest = stiffest or scenario
        self._loops = loops

    @cached_property
    def first(self) -> LoopState:
        """Loop state before the first period, with the present values."""
        return first_loop_state(self.scenario)

    @cached_property
    def draws(self) -> Channels:
        """Channel and count of the uniform numbers that a period draws."""
        return draws_needed(self.scenario)

    @cached_property
    def plant(self) -> RigidBodyPlant:
        """Plant of the stiffest scenario."""
        # the first state is only that of the stiffest scenario if they are one
        same = self._stiffest is self.scenario
        return rigid_body_plant(self._stiffest, self.first if same else None)

    @cached_property
    def substeps(self) -> Substeps:
        """Number of integration steps in an interval (s)."""
        return Substeps(self.plant, at_rest=not self._loops)

    @cached_property
    def largest(self) -> float | None:
        """Longest integration step of the plant, s; None for any."""
        return lanes_step(self.plant.around, euler=self._stiffest.integrator == "euler")

    def stages(self, numbers: Any, row: PeriodRow = NO_INPUTS) -> Stages:
        """Computation stages of a control period with given numbers and inputs."""
        return Stages(self.vary(numbers), row.commands, row.modes)

    def plant_steps(self, stages: Stages) -> PlantSteps[State]:
        """Plant model within a control period."""
        return RigidBodySteps(stages, self.substeps)

    def trace(
        self,
        cut: Cut,
        carry: Tree,
        row: PeriodRow = NO_INPUTS,
        *,
        own_seeds: bool = False,
    ) -> Loop:
        """Trace a part of the control period.

        Args:
            cut: part of the period.
            carry: state from one period to the next, as an example.
            row: inputs of one period, as an example.
            own_seeds: every flight draws with a seed of its own.
        """

        def step(
            now: Tree, numbers: Tree, fed: PeriodRow, uniforms: Uniforms
        ) -> tuple[Tree, Tree]:
            stages = self.stages(numbers, fed)
            return cut(
                TracedPeriod(stages, self.plant_steps(stages), numbers, fed, uniforms),
                now,
            )

        return trace_loop(
            step,
            structure_of(carry),
            self.numbers,
            row,
            self.draws,
            loops=self._loops,
            own_seeds=own_seeds,
        )

    def serves(self, key: ProgramKey, plant: RigidBodyPlant) -> bool:
        """True if code of this program also flies a scenario of that structure, on its
        plant.
        """
        return key == self.key and self.substeps.fit(plant)

    @property
    def start_draws(self) -> tuple[Scalars, ...]:
        """Uniform numbers that start each environment model, as an example."""
        return tuple(
            # two of each, as a model starts from two steps of its channel
            # (draws.STARTS)
            (0.5,) * (2 * count)
            for _, count in draw_plan(self.scenario).models
        )

    @cached_property
    def _start(self) -> Program:
        def start(numbers: Any, *draws: Scalars) -> LoopState:
            return first_loop_state(self.vary(numbers), draws)

        return trace(start, self.numbers, *self.start_draws)

    def start(self, numbers: Array, seed: int, episodes: Array) -> Array:
        """Initial loop states of many flights: one row per scalar, one column per
        flight.

        Args:
            numbers: (numbers, flights).
            seed: key of the noise.
            episodes: (flights,), the other key.
        """
        columns = [*numbers]
        # lanes vary numbers, never models: the channels are those of the scenario
        for draws in start_draws(self.scenario, seed, episodes):
            columns += [*draws.T]
        return evaluate(self._start, columns, len(episodes))
