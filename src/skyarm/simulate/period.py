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
from skyarm.plant.surroundings import Memories, Surroundings
from skyarm.records.leaves import Tree, blend
from skyarm.reference import Reference
from skyarm.simulate.loop_state import AgentLoop, Clock, GivenRow, InputRow, LoopState, Sample
from skyarm.simulate.stages import Readings, Stages
from skyarm.world import WindSample

Body = TypeVar("Body")
"""Type of the state of a moving body."""


class PlantSteps(Protocol[Body]):
    """Interface (typing.Protocol) of plant models within one control period, over any scalar type."""

    def specific_force(self, state: Body, command: Command, around: Surroundings) -> Vec3:
        """Accelerometer reading at the base origin, base axes, m/s^2."""
        ...

    def advance(self, state: Body, before: Command, after: Command, around: Surroundings) -> tuple[Body, Memories]:
        """State of vehicle and contacts after a control period in which a new command arrives."""
        ...


class FirstHalf(NamedTuple):
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
    stages: Stages, plant: PlantSteps[State], now: LoopState, row: InputRow[Reference], uniforms: Uniforms
) -> FirstHalf:
    """Evaluate winds, contacts, sensors and estimator at the start of a control period."""
    own, time = now.agent, row.time
    components, around = stages.surround(now.components, own.drives, own.state, time, uniforms, row.path_time)
    acting = stages.acting(own.queue)
    wind, pushes = stages.wind(around, own.state), stages.pushes(around, own.state)
    force = plant.specific_force(own.state, acting, around)
    read = stages.sense(own.sensors, own.estimate, now.ticks, own.state, force, acting, time, uniforms, pushes)
    return FirstHalf(components, around, acting, wind, stages.with_grasp(read, components))


def act(
    stages: Stages, plant: PlantSteps[State], now: LoopState, measured: FirstHalf, memory: Tree, command: Command,
    clock: Clock = (),
) -> LoopState:  # fmt: skip
    """Apply a command through delay, joint drives and plant; return the loop state after the control period."""
    own, read = now.agent, measured.read
    alive, queue, acting = stages.send(now.alive, own.queue, command)
    drives = stages.drive(own.drives, measured.acting, acting, own.state)
    around = stages.with_drives(measured.around, drives)
    state, coupled = plant.advance(own.state, measured.acting, acting, around)
    agent = AgentLoop(
        state=state, memory=memory, queue=queue, sensors=read.sensors, estimate=read.estimate, drives=drives,
        clock=clock,
    )  # fmt: skip
    components = stages.advance_coupled(measured.components, coupled)
    return LoopState(alive=alive, ticks=now.ticks + alive, agent=agent, components=components)


def make_period(stages: Stages, plant: PlantSteps[State]) -> Period:
    """Make the function that advances the closed loop by one control period.

    An episode that has ended keeps the state it ended in; only the law's memory, which nobody reads then, goes on.

    Args:
        stages: stages of the scenario.
        plant: plant model over the same scalars.
    """

    def period(before: LoopState, given: GivenRow, uniforms: Uniforms) -> tuple[LoopState, Sample]:
        own = before.agent
        row = stages.waits.lead(own.clock, before.ticks, given)
        now = replace(before, alive=stages.alive(before, row.reference))
        measured = measure(stages, plant, now, row, uniforms)
        read = measured.read
        memory, command = stages.decide(own.memory, read.measurement, stages.law_reference(row), row.path_time)
        clock = stages.waits.advance(own.clock, now.ticks, read.measurement, row, memory)
        following = act(stages, plant, now, measured, memory, command, clock)
        sample = Sample(
            alive=following.alive,
            state=own.state,
            command=command,
            measurement=read.measurement,
            readings=read.readings,
            wind=measured.wind,
            found=numbers_found(memory),
            led=stages.waits.log_values(own.clock, now.ticks),
        )
        ended = replace(before, alive=0.0, agent=replace(own, memory=memory))
        return blend(following.alive > 0.5, following, ended), sample

    return period
