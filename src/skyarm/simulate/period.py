"""Sequence of computations in one control period of the closed loop, shared by all simulators."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple, Protocol, TypeVar

from skyarm.algebra import Vec3
from skyarm.algebra.scalars import Scalar
from skyarm.control.law_estimates import numbers_found
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.plant.loads import wind_at
from skyarm.plant.surroundings import Memories, Surroundings
from skyarm.records.leaves import Tree, blend
from skyarm.reference import Reference
from skyarm.simulate.loop_state import Clock, GivenRow, LoopState, Row, Sample
from skyarm.simulate.stages import Readings, Stages
from skyarm.world import WindSample

Body = TypeVar("Body")
"""State of what a plant moves."""


class PlantSteps(Protocol[Body]):
    """Protocol of a plant model within one control period, over any scalar type."""

    def specific_force(self, state: Body, command: Command, around: Surroundings) -> Vec3:
        """Accelerometer reading at the base origin, base axes, m/s^2."""
        ...

    def advance(self, state: Body, before: Command, after: Command, around: Surroundings) -> tuple[Body, Memories]:
        """State of vehicle and contacts after a control period in which a new command arrives."""
        ...


class Measured(NamedTuple):
    """Results of the first half of a control period: wind and contacts, sensor readings, law's measurement.

    Attributes:
        components: memories of air and forces. around: surroundings of the period.
        acting: the command that acts before this period's arrives. wind: surroundings as the log has them.
        read: sensors, estimator, readings for the log and the law's measurement.
    """

    components: Memories
    around: Surroundings
    acting: Command
    wind: WindSample
    read: Readings


Uniforms = tuple[Scalar, ...]
"""Random numbers of a period, uniform in (0, 1)."""

Period = Callable[[LoopState, GivenRow, Uniforms], tuple[LoopState, Sample]]


def measure(
    stages: Stages, plant: PlantSteps[State], now: LoopState, row: Row[Reference], uniforms: Uniforms
) -> Measured:
    """Evaluate winds, contacts, sensors and estimator at the start of a control period."""
    components, around = stages.surround(now.components, now.drives, now.state, row.time, uniforms, row.path_time)
    acting = stages.acting(now.queue)
    wind, pushes = wind_at(around, stages.scenario.plant, now.state), stages.pushes(around, now.state)
    force = plant.specific_force(now.state, acting, around)
    read = stages.sense(now.sensors, now.estimate, now.ticks, now.state, force, acting, row.time, uniforms, pushes)
    return Measured(components, around, acting, wind, stages.with_grasp(read, components))


def act(
    stages: Stages,
    plant: PlantSteps[State],
    now: LoopState,
    measured: Measured,
    memory: Tree,
    command: Command,
    clock: Clock = (),
) -> LoopState:
    """Apply a command through delay, joint drives and plant; return the loop state after the control period."""
    alive, queue, acting = stages.send(now.alive, now.queue, command)
    drives = stages.drive(now.drives, measured.acting, acting, now.state)
    around = stages.with_drives(measured.around, drives)
    state, coupled = plant.advance(now.state, measured.acting, acting, around)
    return LoopState(
        alive=alive,
        ticks=now.ticks + alive,
        state=state,
        memory=memory,
        queue=queue,
        sensors=measured.read.sensors,
        estimate=measured.read.estimate,
        components=stages.advance_coupled(measured.components, coupled),
        drives=drives,
        clock=clock,
    )


def make_period(stages: Stages, plant: PlantSteps[State]) -> Period:
    """Make the function that advances the closed loop by one control period.

    An episode that has ended keeps the state it ended in; only the law's memory, which nobody reads then, goes on.

    Args:
        stages: :class:`skyarm.simulate.stages.Stages`.
        plant: over the same scalars.
    """

    def period(before: LoopState, given: GivenRow, uniforms: Uniforms) -> tuple[LoopState, Sample]:
        row = stages.waits.lead(before.clock, before.ticks, given)
        now = replace(before, alive=stages.alive(before, row.reference))
        measured = measure(stages, plant, now, row, uniforms)
        read = measured.read
        memory, command = stages.decide(now.memory, read.measurement, stages.law_reference(row), row.path_time)
        clock = stages.waits.advance(now.clock, now.ticks, read.measurement, row, memory)
        following = act(stages, plant, now, measured, memory, command, clock)
        sample = Sample(
            alive=following.alive,
            state=now.state,
            command=command,
            measurement=read.measurement,
            readings=read.readings,
            wind=measured.wind,
            found=numbers_found(memory),
            led=stages.waits.log_values(now.clock, now.ticks),
        )
        ended = replace(before, alive=0.0, memory=memory)
        return blend(following.alive > 0.5, following, ended), sample

    return period
