"""The plant within a control period: the rigid-body plant is traced, any other is called with flat numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from skyarm.actuation import Command
from skyarm.algebra import Vec3
from skyarm.dynamics import State
from skyarm.plant.compiled import RigidBodyPlant, hold
from skyarm.plant.impact import after_impact
from skyarm.plant.rigid_body import Moved, accelerate
from skyarm.plant.surroundings import Surroundings, memories_of
from skyarm.records.leaves import blend
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.command_line import switches
from skyarm.simulate.first_state import first_loop_state, first_surroundings
from skyarm.simulate.loop_state import LoopState
from skyarm.simulate.stages import Stages

Flat = tuple[float, ...]


def rigid_body_plant(scenario: Scenario, first: LoopState | None = None) -> RigidBodyPlant:
    """The rigid-body plant of a scenario, which chooses the number of its integration steps.

    Args:
        scenario: with concrete numbers.
        first: its first loop state, where that is there already.
    """
    around = first_surroundings(scenario, first or first_loop_state(scenario))
    return RigidBodyPlant(scenario.plant, around, scenario.integrator, 1.0 / scenario.rates.physics)


class Substeps:
    """Integration steps of an interval (s), and a record of those that a program was traced with."""

    def __init__(self, plant: RigidBodyPlant) -> None:
        self._plant, self._traced = plant, dict[float, int]()

    def __call__(self, seconds: float) -> int:
        """The number of steps."""
        self._traced[seconds] = self._plant.substeps(seconds)
        return self._traced[seconds]

    def fit(self, plant: RigidBodyPlant) -> bool:
        """Whether another plant takes the same steps in the traced intervals."""
        return all(plant.substeps(seconds) == count for seconds, count in self._traced.items())


class RigidBodySteps:
    """The rigid-body plant within a period.

    Args:
        stages: of the episode. substeps: number of integration steps of an interval.
    """

    def __init__(self, stages: Stages, substeps: Callable[[float], int]) -> None:
        self._scenario, self._period, self._late = stages.scenario, stages.period, stages.late
        self._substeps, self._apart = substeps, stages.apart

    def specific_force(self, state: State, command: Command, around: Surroundings) -> Vec3:
        """Proper acceleration of the base origin, base axes, m/s^2."""
        force, _ = accelerate(
            self._scenario.plant, state, state.rotor_speeds, command.efforts, around, command.rotor_speeds
        )
        return force.linear

    def advance(self, state: State, before: Command, after: Command, around: Surroundings) -> Moved:
        """State and coupled memories after the period: under the command before for the late part, then the other."""
        now = after_impact(self._scenario.plant.vehicle, state, around), memories_of(around)
        late = self._late
        parts = [(late, before)] if self._apart is None else switches(before, after, *(rest for _, rest in self._apart))
        left: Any = self._period
        for seconds, command in parts:
            if type(seconds) is not float:
                now = blend(seconds > 0.0, self._hold(now, command, around, seconds), now)
            elif seconds > 0.0:
                now = self._hold(now, command, around, seconds)
            left = left - seconds
        return self._hold(now, after, around, left)

    def _hold(self, now: Moved, command: Command, around: Surroundings, seconds: Any) -> Moved:
        """State and memories after an interval of one command."""
        count = self._substeps(seconds if type(seconds) is float else self._period)
        return hold(self._scenario.plant, self._scenario.integrator, count, now, command, around, seconds)
