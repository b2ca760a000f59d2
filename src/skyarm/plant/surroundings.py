"""Inputs of a plant over one control period: air, forces, faults, drives, and contacts integrated with the state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from skyarm.algebra import ZERO3, Vec3
from skyarm.algebra.scalars import Scalar, data, logical_and
from skyarm.compile import leaves
from skyarm.dynamics.actuators.drive import TORQUE_DRIVE, Drive
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.plant.interface import Truth
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Rotor
from skyarm.world import Component, Effectiveness, WindSample, Wrench
from skyarm.world.component import moved_by


@dataclass(frozen=True, kw_only=True, slots=True)
class Surroundings:
    """Air, forces, faults and joint drives with their internal states, constant over one control period.

    Attributes:
        components: air and forces, in the order in which they add up. memories: theirs.
        time: s, of the period's beginning.
        effectiveness: what faults leave of the actuators; None for whole ones.
        drives: of the joints, in order; empty where all take torques. drive_memories: theirs.
    """

    components: tuple[Component, ...] = ()
    memories: tuple[Any, ...] = ()
    time: Scalar = 0.0
    effectiveness: Effectiveness | None = None
    drives: tuple[Drive, ...] = ()
    drive_memories: tuple[Any, ...] = ()

    def air_velocity(self, position_W: Vec3) -> Vec3:
        """Air velocity at a position, world axes, m/s."""
        total = ZERO3
        for component, memory in zip(self.components, self.memories, strict=True):
            total = total + component.velocity(memory, self.time, position_W)
        return total

    def wrenches(self, motion: PointMotion, rotor_speeds: Sequence[Scalar]) -> list[Wrench]:
        """Wrenches of all environment components on the vehicle's bodies, without rotors and body drag."""
        found: list[Wrench] = []
        for component, memory in zip(self.components, self.memories, strict=True):
            found += component.wrenches(memory, self.time, motion, rotor_speeds)
        return found

    def rotor_commands(self, rotors: Sequence[Rotor], commands: Sequence[Scalar]) -> Sequence[Scalar]:
        """Effective rotor speed commands (rad/s), limited by the supply."""
        for component, memory in zip(self.components, self.memories, strict=True):
            commands = component.rotor_commands(memory, rotors, commands)
        return commands

    @property
    def coupled(self) -> tuple[int, ...]:
        """Indices of the coupled components (contacts), whose internal states the plant integrates."""
        return tuple(i for i, component in enumerate(self.components) if component.coupled)

    def coupled_memories(self) -> tuple[Any, ...]:
        """Internal states of the coupled components (contacts)."""
        return tuple(self.memories[i] for i in self.coupled)

    def with_coupled(self, memories: Sequence[Any]) -> Surroundings:
        """The surroundings with the internal states of the coupled components (contacts) replaced."""
        places = self.coupled
        if not places:
            return self
        held = list(self.memories)
        for place, memory in zip(places, memories, strict=True):
            held[place] = memory
        return replace(self, memories=tuple(held))

    def slopes(self, motion: PointMotion, rotor_speeds: Sequence[Scalar]) -> tuple[Any, ...]:
        """Time derivatives of the coupled components' (contacts') internal states."""
        return tuple(self.components[i].slope(self.memories[i], self.time, motion, rotor_speeds) for i in self.coupled)

    def far(self, motion: PointMotion, seconds: Scalar) -> Any:
        """True if all coupled components stay inactive for ``seconds``."""
        found: Any = True
        for i in self.coupled:
            there = self.components[i].far(self.memories[i], motion, seconds)
            found = there if found is True else logical_and(found, there)
        return found

    def without_coupled(self) -> Surroundings:
        """The surroundings without the coupled components."""
        kept = [i for i, component in enumerate(self.components) if not component.coupled]
        components, memories = (tuple(each[i] for i in kept) for each in (self.components, self.memories))
        return replace(self, components=components, memories=memories)

    def alone(self, seconds: Scalar, rounds: int, gravity: Scalar) -> tuple[Any, ...]:
        """Internal states of the inactive coupled components after ``seconds``, in ``rounds`` steps."""
        return tuple(self.components[i].alone(self.memories[i], seconds, rounds, gravity) for i in self.coupled)

    def effort(self, index: int, setpoint: Scalar, position: Scalar, rate: Scalar) -> Scalar:
        """Effort of a joint's drive before limit and friction, N m or N."""
        if not self.drives:
            return TORQUE_DRIVE.effort((), setpoint, position, rate)
        return self.drives[index].effort(self.drive_memories[index], setpoint, position, rate)


def wind_at(around: Surroundings, world: Truth, state: State) -> WindSample:
    """Force on the base and air velocity at its origin, as recorded in logs."""
    motion = PointMotion(world.vehicle, state, around.air_velocity, gravity=world.gravity)
    force = ZERO3
    for component, memory in zip(around.components, around.memories, strict=True):
        if component.coupled:
            continue  # has columns of its own
        for wrench in component.wrenches(memory, around.time, motion, state.rotor_speeds):
            if wrench.body == BASE:
                force = force + wrench.force_W
    air = around.air_velocity(state.position)
    pairs = zip(around.components, around.memories, strict=True)
    own = tuple(data(c) for each, memory in pairs if each.columns for c in each.logged(memory, motion))
    return WindSample(Vec3(*(data(c) for c in force)), ZERO3, Vec3(*(data(c) for c in air)), numbers=own)


Memories = tuple[Any, ...]
"""Of the coupled components, in their order."""


def slopes_of(world: Truth, state: State, around: Surroundings) -> Memories:
    """Time derivatives of the coupled components' (contacts') internal states at a vehicle state."""
    if not around.coupled:
        return ()
    motion = PointMotion(world.vehicle, state, around.air_velocity, gravity=world.gravity)
    return around.slopes(motion, state.rotor_speeds)


def advance_memories(memories: Memories, slopes: Memories, dt: Scalar) -> Memories:
    """Internal states of coupled components (contacts) plus dt * slopes."""
    found: Memories = moved_by(memories, slopes, dt)
    return found


def before_euler_step(world: Truth, state: State, around: Surroundings, dt: Scalar) -> Surroundings:
    """Surroundings for evaluating the forces of an Euler step of ``dt`` (s): friction bristles are advanced."""
    if not around.coupled:
        return around
    return bend_coupled(around, slopes_of(world, state, around), dt)


def bend_coupled(around: Surroundings, slopes: Memories, dt: Scalar) -> Surroundings:
    """The surroundings with the deflections of contact friction bristles advanced by ``dt`` (s)."""
    going = zip(around.coupled, around.coupled_memories(), slopes, strict=True)
    return around.with_coupled([around.components[i].before_euler_step(held, rate, dt) for i, held, rate in going])


def after_euler_step(around: Surroundings, slopes: Memories, dt: Scalar) -> Memories:
    """Internal states of the coupled components after a semi-implicit Euler step of ``dt`` (s)."""
    going = zip(around.coupled, around.coupled_memories(), slopes, strict=True)
    return tuple(around.components[i].euler_step(memory, slope, dt) for i, memory, slope in going)


def drift_coupled(around: Surroundings, dt: Scalar) -> Surroundings:
    """The surroundings after ``dt`` (s) of force-free motion of the coupled components."""
    going = zip(around.coupled, around.coupled_memories(), strict=True)
    return around.with_coupled([around.components[i].drift(held, dt) for i, held in going])


def push_coupled(around: Surroundings, motion: PointMotion, rotor_speeds: Sequence[Scalar], dt: Scalar) -> Surroundings:
    """The surroundings after an impulse: forces act on the coupled components for ``dt`` (s)."""
    going = zip(around.coupled, around.coupled_memories(), strict=True)
    return around.with_coupled(
        [around.components[i].push(held, around.time, motion, rotor_speeds, dt) for i, held in going]
    )


def places_in(around: Surroundings) -> tuple[int, ...]:
    """Indices of the coupled components' internal states among all scalars of the surroundings."""
    first = len(leaves(around.components))
    return tuple(first + place for place in places_among(around.memories, around.coupled))


def places_among(memories: Memories, coupled: Sequence[int]) -> tuple[int, ...]:
    """Indices of the coupled components' internal states among all scalars of all internal states."""
    found, first = list[int](), 0
    for i, memory in enumerate(memories):
        count = len(leaves(memory))
        if i in coupled:
            found += range(first, first + count)
        first += count
    return tuple(found)
