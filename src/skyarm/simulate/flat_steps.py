"""A plant of flat numbers within a control period, for plants that cannot be traced."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from skyarm.actuation import Command
from skyarm.plant.coupled_memory import places_in
from skyarm.plant.interface import Plant
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.simulate.command_line import switches
from skyarm.simulate.flat_function import Flat, replaced_at
from skyarm.simulate.stages import Stages


class FlatSteps:
    """A plant of flat numbers within a period.

    Args:
        plant: of numbers. stages: of the episode. around: what it is told of one period, as an example.

    Raises:
        ScenarioError: the plant is someone's own and leaves out the coupled memories.
    """

    def __init__(self, plant: Plant, stages: Stages, around: Any) -> None:
        self._plant, self._period, self._late = plant, stages.period, stages.late
        self._kind, vehicle = stages.scenario.plant, stages.scenario.world.vehicle
        self._rotors, self._joints = len(vehicle.rotors), vehicle.n
        self._end = 13 + 2 * vehicle.n + len(vehicle.rotors) + len(vehicle.tilts)
        self._apart = None if stages.apart is None else tuple(late for _, late in stages.apart)
        self.specific_force = plant.specific_force
        self._impact, self._coupled = impact_of(plant, stages), places_in(around)

    def advance(self, state: Flat, before: Flat, after: Flat, around: Flat) -> tuple[Flat, Flat]:
        """State and coupled memories after the period."""
        if self._impact is not None:
            state = self._impact(state, around)
        if self._apart is not None:
            return self._one_after_the_other(state, before, after, around)
        if self._late:
            state, around = self._next(state, before, around, self._late)
        return self._last(state, after, around, self._period - self._late)

    def _one_after_the_other(self, state: Flat, before: Flat, after: Flat, around: Flat) -> tuple[Flat, Flat]:
        """State after a period in which rotors and joints hear of the command at different times."""
        n, end, left = self._rotors, self._rotors + self._joints, self._period
        old, new = (Command(rotor_speeds=u[:n], efforts=u[n:end], tilts=u[end:]) for u in (before, after))
        for seconds, command in switches(old, new, *self._apart or ()):
            if seconds > 0.0:
                acting: Any = (*command.rotor_speeds, *command.efforts, *command.tilts)
                state, around = self._next(state, acting, around, seconds)
            left = left - seconds
        return self._last(state, after, around, left)

    def _next(self, state: Flat, command: Flat, around: Flat, seconds: float) -> tuple[Flat, Flat]:
        """State and surroundings after some of the period."""
        state, coupled = self._last(state, command, around, seconds)
        return state, replaced_at(self._coupled, around, coupled)

    def _last(self, state: Flat, command: Flat, around: Flat, seconds: float) -> tuple[Flat, Flat]:
        """State and coupled memories."""
        if not self._coupled:
            return self._plant.advance(state, command, around, seconds), ()
        found = self._plant.advance(state, command, around, seconds)
        if len(found) != self._end + len(self._coupled):
            raise ScenarioError(f"plant.kind = {self._kind!r}: does not know [world]; it has no coupled memories")
        return found[: self._end], found[self._end :]


def impact_of(plant: Any, stages: Stages) -> Callable[[Flat, Flat], Flat] | None:
    """What a plant does with grasps and joints that get stuck; None where the scenario has none.

    Raises:
        ScenarioError: the plant is someone's own and does not know of them.
    """
    scenario = stages.scenario
    stuck = any(fault.stuck for fault in scenario.faults)
    rigid = any(payload.rigid for payload in scenario.payloads)
    if not rigid and not stuck:
        return None
    found: Callable[[Flat, Flat], Flat] | None = getattr(plant, "after_impact", None)
    if found is None:
        what = "rigid payloads" if rigid else "environment.faults with stuck"
        raise ScenarioError(f"plant.kind = {scenario.plant!r}: does not know {what}; it has no after_impact")
    return found
