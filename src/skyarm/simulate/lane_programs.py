"""What a batch of lanes flies, as programs: one control period, the first state, the check of the endings."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from skyarm.compile import trace
from skyarm.compile.tracing.stepped_loop import trace_loop
from skyarm.dynamics import State
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.largest_step import lanes_step
from skyarm.scalars import floor
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.draws import draw_plan, draws_needed
from skyarm.simulate.first_state import first_loop_state, first_surroundings
from skyarm.simulate.loop_state import LoopState, Row, structure_of
from skyarm.simulate.period import make_period
from skyarm.simulate.plant_steps import RigidBodySteps
from skyarm.simulate.stages import Stages


class LanePrograms:
    """Programs of a scenario whose numbers at some paths differ from lane to lane.

    Args:
        scenario: on the rigid-body plant. paths: of those numbers.
        stiffest: the scenario whose joint friction, air, forces and drives fix the integration steps.
        law: fly the scenario's law in place of actions.

    Attributes:
        base: the scenario's own numbers at the paths. first: its first loop state, as an example.
        largest_step: the longest integration step that ``stiffest`` bears, s.
        start: (numbers, draws of each component) -> the first loop state.
        check: (numbers, ticks, state, clock) -> 1 where no ending has come, else 0.
    """

    def __init__(self, scenario: Scenario, paths: Sequence[str], stiffest: Scenario, *, law: bool) -> None:
        self._scenario, self._paths, self._law = scenario, paths, law
        self._ratio = scenario.rates.control // scenario.rates.reference
        self.base = tuple(number_at(scenario, path) for path in paths)
        self.first: LoopState = first_loop_state(scenario)
        around = first_surroundings(stiffest, self.first if stiffest is scenario else first_loop_state(stiffest))
        self._plant = RigidBodyPlant(stiffest.world, around, scenario.integrator, 1.0 / scenario.rates.physics)
        self.largest_step = lanes_step(around, euler=scenario.integrator == "euler")
        counts = [2 * count for _, count in draw_plan(scenario).components]
        self.start = trace(self._starting, self.base, *((0.5,) * count for count in counts))
        found = structure_of(self.first.state), structure_of(self.first.clock)
        self.check = trace(self._sound, self.base, 0.0, *found)

    def period(self) -> Any:
        """One control period as a loop, whose parameters are the numbers at the paths and the actions."""

        def step(now: LoopState, values: Any, _fed: Any, drawn: Any) -> tuple[LoopState, tuple[()]]:
            numbers, command = values
            varied = self._varied(numbers)
            stages = Stages(varied, None if self._law else command)
            row = self._row(stages.scenario, now.ticks)
            following, _ = make_period(stages, RigidBodySteps(stages, self._plant.substeps))(now, row, drawn)
            return following, ()

        values = (self.base, structure_of(self.first.queue[0]))
        return trace_loop(step, structure_of(self.first), values, (), draws_needed(self._scenario), loops=True)

    def _varied(self, numbers: Sequence[Any]) -> Scenario:
        return with_numbers(self._scenario, dict(zip(self._paths, numbers, strict=True)))

    def _row(self, scenario: Scenario, ticks: Any) -> Row:
        """A lane's own time and held reference; the loop has that of a task whose phases wait."""
        rate = float(self._scenario.rates.control)
        if scenario.trajectory.guards:
            return Row(time=ticks / rate, reference=())
        held = floor((ticks + 0.5) / float(self._ratio)) * float(self._ratio)
        return Row(time=ticks / rate, reference=scenario.trajectory.at(held / rate).dense())

    def _starting(self, numbers: tuple[Any, ...], *draws: tuple[Any, ...]) -> LoopState:
        return first_loop_state(self._varied(numbers), draws)

    def _sound(self, numbers: tuple[Any, ...], ticks: Any, state: State, clock: Any) -> Any:
        """1 where no ending has come, else 0."""
        stages = Stages(self._varied(numbers))
        now = dataclasses.replace(self.first, ticks=ticks, state=state, clock=clock)
        return stages.alive(now, stages.led(now, self._row(stages.scenario, ticks)).reference)
