"""Inputs of a plant over one control period: wind, forces, contacts, faults and joint drives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from skyarm.algebra import ZERO3, Vec3
from skyarm.algebra.scalars import Scalar, logical_and, maximum
from skyarm.dynamics.actuators.drive import TORQUE_DRIVE, Drive
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.plant.interface import Truth
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Tree, leaves
from skyarm.vehicle.vehicle_records import Rotor
from skyarm.world import Component, Effectiveness, Wrench

AnyComponent = Component[Any]
"""Environment model with an internal state of any type."""

Memories = tuple[Tree, ...]
"""Internal states of environment models or of joint drives, in order, each of its model's type."""


@immutable
class Surroundings:
    """Environment models, actuator faults and joint drives with their internal states, for one control period.

    Attributes:
        components: air and forces, in the order in which they add up. memories: internal states of the components.
        time: beginning of the period, s.
        effectiveness: share of the actuators that faults leave; None for whole ones.
        drives: drives of the joints, in order; empty where all take torques.
        drive_memories: internal states of the drives.
    """

    components: tuple[AnyComponent, ...] = ()
    memories: Memories = ()
    time: Scalar = 0.0
    effectiveness: Effectiveness | None = None
    drives: tuple[Drive, ...] = ()
    drive_memories: Memories = ()

    def air_velocity(self, position_W: Vec3) -> Vec3:
        """Air velocity (m/s, world axes) at a position: sum of all wind models."""
        total = ZERO3
        for component, memory in zip(self.components, self.memories, strict=True):
            total = total + component.velocity(memory, self.time, position_W)
        return total

    def wrenches(self, motion: PointMotion, rotor_speeds: Sequence[Scalar]) -> list[Wrench]:
        """Forces and torques of all environment models on the vehicle's bodies."""
        wrenches: list[Wrench] = []
        for component, memory in zip(self.components, self.memories, strict=True):
            wrenches += component.wrenches(memory, self.time, motion, rotor_speeds)
        return wrenches

    def rotor_commands(self, rotors: Sequence[Rotor], commands: Sequence[Scalar]) -> Sequence[Scalar]:
        """Rotor speed commands (rad/s) limited by the battery."""
        for component, memory in zip(self.components, self.memories, strict=True):
            commands = component.rotor_commands(memory, rotors, commands)
        return commands

    @property
    def coupled(self) -> tuple[int, ...]:
        """Indices of the contact models, whose internal states are integrated with the vehicle's."""
        return tuple(i for i, component in enumerate(self.components) if component.coupled)

    def coupled_memories(self) -> Memories:
        """Internal states of the contact models."""
        return tuple(self.memories[i] for i in self.coupled)

    def with_coupled(self, memories: Sequence[Tree]) -> Surroundings:
        """Copy of the plant inputs with other internal states of the contact models."""
        places = self.coupled
        if not places:
            return self
        every = list(self.memories)
        for place, memory in zip(places, memories, strict=True):
            every[place] = memory
        return replace(self, memories=tuple(every))

    def slopes(self, motion: PointMotion, rotor_speeds: Sequence[Scalar]) -> Memories:
        """Time derivatives of the contact models' internal states."""
        return tuple(self.components[i].slope(self.memories[i], self.time, motion, rotor_speeds) for i in self.coupled)

    def far(self, motion: PointMotion, seconds: Scalar) -> Scalar:
        """True if no contact can occur within ``seconds``."""
        far: Scalar = True
        for i in self.coupled:
            there = self.components[i].far(self.memories[i], motion, seconds)
            far = there if far is True else logical_and(far, there)
        return far

    def hurry(self, motion: PointMotion, seconds: Scalar) -> tuple[Memories, Scalar]:
        """Internal states of the contact models, and number of integration substeps for the next ``seconds``."""
        pairs = [self.components[i].hurry(self.memories[i], motion, seconds) for i in self.coupled]
        finer: Scalar = 1.0
        for _, steps in pairs:
            finer = maximum(finer, steps)
        return tuple(memory for memory, _ in pairs), finer

    def without_coupled(self) -> Surroundings:
        """Copy of the plant inputs without the contact models."""
        alone = [i for i, component in enumerate(self.components) if not component.coupled]
        components, memories = tuple(self.components[i] for i in alone), tuple(self.memories[i] for i in alone)
        return replace(self, components=components, memories=memories)

    def alone(self, seconds: Scalar, rounds: int, gravity: Scalar) -> Memories:
        """Internal states of the contact models after ``seconds`` without contact."""
        return tuple(self.components[i].alone(self.memories[i], seconds, rounds, gravity) for i in self.coupled)

    def effort(self, index: int, setpoint: Scalar, position: Scalar, rate: Scalar) -> Scalar:
        """Effort (N m or N) of a joint's drive before its limit and joint friction."""
        if not self.drives:
            return TORQUE_DRIVE.effort((), setpoint, position, rate)
        return self.drives[index].effort(self.drive_memories[index], setpoint, position, rate)


def slopes_of(world: Truth, state: State, around: Surroundings) -> Memories:
    """Time derivatives of the contact models' internal states for a vehicle state."""
    if not around.coupled:
        return ()
    motion = PointMotion(world.vehicle, state, around.air_velocity, gravity=world.gravity)
    return around.slopes(motion, state.rotor_speeds)


def before_euler_step(world: Truth, state: State, around: Surroundings, dt: Scalar) -> Surroundings:
    """Plant inputs from which a semi-implicit Euler step evaluates forces: friction bristles are advanced."""
    if not around.coupled:
        return around
    return bend_coupled(around, slopes_of(world, state, around), dt)


def bend_coupled(around: Surroundings, slopes: Memories, dt: Scalar) -> Surroundings:
    """Copy of the plant inputs with the contact friction bristles advanced by ``dt`` (s)."""
    going = zip(around.coupled, around.coupled_memories(), slopes, strict=True)
    return around.with_coupled([around.components[i].before_euler_step(memory, rate, dt) for i, memory, rate in going])


def after_euler_step(around: Surroundings, slopes: Memories, dt: Scalar) -> Memories:
    """Internal states of the contact models after a semi-implicit Euler step of ``dt`` (s)."""
    going = zip(around.coupled, around.coupled_memories(), slopes, strict=True)
    return tuple(around.components[i].euler_step(memory, slope, dt) for i, memory, slope in going)


def drift_coupled(around: Surroundings, dt: Scalar) -> Surroundings:
    """Copy of the plant inputs with movable bodies advanced by ``dt`` (s) at constant velocities."""
    going = zip(around.coupled, around.coupled_memories(), strict=True)
    return around.with_coupled([around.components[i].drift(memory, dt) for i, memory in going])


def push_coupled(around: Surroundings, felt: Surroundings, motion: PointMotion, dt: Scalar) -> Surroundings:
    """Copy of the plant inputs with movable bodies accelerated for ``dt`` (s) by forces at the states in ``felt``."""
    speeds = motion.state.rotor_speeds
    going = zip(around.coupled, around.coupled_memories(), felt.coupled_memories(), strict=True)
    return around.with_coupled(
        [around.components[i].push(memory, around.time, motion, speeds, dt, now) for i, memory, now in going]
    )


def places_in(around: Surroundings) -> tuple[int, ...]:
    """Indices of the contact states among all numbers of the plant inputs."""
    first = len(leaves(around.components))
    return tuple(first + place for place in places_among(around.memories, around.coupled))


def places_among(memories: Memories, coupled: Sequence[int]) -> tuple[int, ...]:
    """Indices of the contact states among the internal states of all environment models."""
    places, first = list[int](), 0
    for i, memory in enumerate(memories):
        count = len(leaves(memory))
        if i in coupled:
            places += range(first, first + count)
        first += count
    return tuple(places)
