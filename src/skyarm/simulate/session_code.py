"""Machine code of a session's control period; numbers that change in flight are its parameters."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.llvm.quick_function import Quick
from skyarm.compile.tracing.stepped_loop import trace_loop
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.largest_step import STATED
from skyarm.scenario.in_flight import Overrides
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensors.measurement import Measurement
from skyarm.simulate.commanded_stages import CommandedStages
from skyarm.simulate.first_state import first_surroundings
from skyarm.simulate.loop_state import LoopState, Row, Sample, structure_of
from skyarm.simulate.period import make_period
from skyarm.simulate.rigid_body_steps import RigidBodySteps
from skyarm.simulate.stages import Stages


class SessionCode:
    """The control period of a scenario in machine code, with the numbers of some overrides as parameters.

    Args:
        begun: the scenario as it began. overrides: what holds in the place of its own.
        scenario: both together.
        first: its first loop state. row: what one of its instants is fed; both as examples.
        effort: of the compiler.

    Raises:
        NoMachineCodeError: fly the stages one by one.

    Attributes:
        sample: record that is logged. draws: (channel, count) of the random numbers of a period.
    """

    def __init__(
        self, begun: Scenario, overrides: Overrides, scenario: Scenario, first: LoopState, row: Row,
        effort: int = 2,
    ) -> None:  # fmt: skip
        self._shape, self._parts = overrides.parts_of(begun), overrides.parts
        self._paths = tuple(path for path, _ in overrides.numbers)
        self._example = structure_of(first)
        self._row = row
        self._numbers = tuple(value for _, value in overrides.numbers)
        self._asked: dict[float, int] = {}
        self.draws = Stages(scenario).draws.needed
        plant = plant_of(scenario, first)

        def substeps(seconds: float) -> int:
            self._asked[seconds] = plant.substeps(seconds)
            return self._asked[seconds]

        def step(now: LoopState, values: Any, fed: Any, drawn: Any) -> tuple[LoopState, Sample]:
            stages = CommandedStages(self._varied(values))
            instant, stages.given, stages.command = fed
            return make_period(stages, RigidBodySteps(stages, substeps))(now, instant, drawn)

        fed = (self._row, 0.0, structure_of(first.queue[0]))
        loop = trace_loop(step, self._example, self._numbers, fed, self.draws, loops=True)
        self.kernel = Kernel(loop, Lanes(1), logging=True, effort=effort)
        self.sample: Sample = loop.result[1]

    def fits(
        self, overrides: Overrides, scenario: Scenario, first: LoopState, changed: Sequence[str] | None = None
    ) -> bool:
        """Whether it flies other overrides too, of the same scenario as it began: only their values may differ.

        Args:
            overrides: in question.
            scenario: with them.
            first: a loop state of it, as an example.
            changed: paths whose numbers are other than those that it flies; None for any.
        """
        if overrides.parts != self._parts or tuple(path for path, _ in overrides.numbers) != self._paths:
            return False
        if changed is not None and not any(path.startswith(("plant.", *STATED)) for path in changed):
            return True
        plant = plant_of(scenario, first)
        return all(plant.substeps(seconds) == count for seconds, count in self._asked.items())

    def _varied(self, values: Sequence[Any]) -> Scenario:
        return with_numbers(self._shape, dict(zip(self._paths, values, strict=True)))

    @cached_property
    def measurement(self) -> Quick:
        """What the law is told, from a loop state, the overrides' numbers, a row and random numbers."""

        def told(now: LoopState, values: Any, row: Row, drawn: Any) -> Measurement:
            stages = Stages(self._varied(values))
            plant = RigidBodySteps(stages, lambda _: 1)
            row = stages.led(now, row)
            _, around = stages.surround(now.components, now.drives, now.state, row.time, drawn, row.path_time)
            before = stages.acting(now.queue)
            force = plant.specific_force(now.state, before, around)
            pushes = stages.pushes(around, now.state)
            read = stages.sense(now.sensors, now.estimate, now.ticks, now.state, force, before, row.time, drawn, pushes)
            return read.measurement

        return Quick(told, self._example, self._numbers, self._row, (0.5,) * sum(count for _, count in self.draws))


def plant_of(scenario: Scenario, first: LoopState) -> RigidBodyPlant:
    """The plant of a scenario, which says how often it is stepped."""
    around = first_surroundings(scenario, first)
    return RigidBodyPlant(scenario.world, around, scenario.integrator, 1.0 / scenario.rates.physics)
