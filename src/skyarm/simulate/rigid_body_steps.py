"""The rigid-body plant within a control period: integration steps under the commands that act one after the other."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from skyarm.actuation import Command
from skyarm.algebra import Vec3
from skyarm.compile.tracing.repeat import repeat, repeat_while
from skyarm.dynamics import State
from skyarm.dynamics.point_motion import PointMotion
from skyarm.plant.compiled import Steps
from skyarm.plant.coupled_memory import memories_of, with_memories
from skyarm.plant.impact import after_impact
from skyarm.plant.integrators import VERLET
from skyarm.plant.rigid_body import COUPLED_STEP, Moved, accelerate, far_step
from skyarm.plant.surroundings import Surroundings
from skyarm.records.leaves import blend
from skyarm.scalars import where
from skyarm.simulate.command_line import switches
from skyarm.simulate.stages import Stages


class RigidBodySteps:
    """The rigid-body plant within a period.

    Args:
        stages: of the episode. substeps: integration steps that an interval is cut into.
    """

    def __init__(self, stages: Stages, substeps: Callable[[float], int]) -> None:
        self._scenario, self._period, self._late = stages.scenario, stages.period, stages.late
        self._substeps, self._apart = substeps, stages.apart

    def specific_force(self, state: State, command: Command, around: Surroundings) -> Vec3:
        """Proper acceleration of the base origin, base axes, m/s^2."""
        force, _ = accelerate(
            self._scenario.world, state, state.rotor_speeds, command.efforts, around, command.rotor_speeds
        )
        return force.linear

    def advance(self, state: State, before: Command, after: Command, around: Surroundings) -> Moved:
        """State and coupled memories after the period: under the command before for the late part, then the other."""
        now = after_impact(self._scenario.world.vehicle, state, around), memories_of(around)
        if self._apart is not None:
            return self._one_after_the_other(now, before, after, around)
        late = self._late
        if type(late) is not float:
            now = blend(late > 0.0, self._held(now, before, around, late), now)
        elif late:
            now = self._held(now, before, around, late)
        return self._held(now, after, around, self._period - late)

    def _one_after_the_other(self, now: Moved, before: Command, after: Command, around: Surroundings) -> Moved:
        """The same of a period in which rotors and joints hear of the command at different times."""
        left: Any = self._period
        for seconds, command in switches(before, after, *(late for _, late in self._apart or ())):
            if type(seconds) is not float:
                now = blend(seconds > 0.0, self._held(now, command, around, seconds), now)
            elif seconds > 0.0:
                now = self._held(now, command, around, seconds)
            left = left - seconds
        return self._held(now, after, around, left)

    def _held(self, now: Moved, command: Command, around: Surroundings, seconds: Any) -> Moved:
        count = self._substeps(seconds if type(seconds) is float else self._period)
        name, world = self._scenario.integrator, self._scenario.world
        near = VERLET if isinstance(count, Steps) and count.verlet else name

        def stepped(both: Moved) -> Moved:
            return COUPLED_STEP[near](world, both[0], command, with_memories(around, both[1]), seconds / count)

        far: Any = False
        if isinstance(count, Steps):
            motion = PointMotion(world.vehicle, now[0])
            far = around.with_coupled(now[1]).far(motion, seconds)
        if not isinstance(count, Steps) or far is False:
            return repeat(count, stepped, now)

        def apart(both: Moved) -> Moved:
            return far_step(name, world, both, command, around, seconds / count.far, count.rounds)

        now = repeat_while(count, where(far, 0.0, float(count)), stepped, now)
        return repeat_while(count.far, where(far, float(count.far), 0.0), apart, now)
