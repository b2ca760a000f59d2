"""Memories that go on with the plant: bristles of a contact, a clock, the motion of what is pushed.

They are numbers beside the state, integrated by the same steps; without a coupled component there are none, and
nothing here is an operation.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.compile import leaves
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.environment.component import moved_by
from skyarm.plant.interface import Truth
from skyarm.plant.surroundings import Around, Surroundings

Memories = tuple[Any, ...]
"""Of the coupled components, in their order."""


def memories_of(around: Around) -> Memories:
    """Memories of the coupled components; () without any."""
    return around.coupled_memories() if isinstance(around, Surroundings) else ()


def with_memories(around: Around, memories: Memories) -> Around:
    """The surroundings with these memories."""
    return around.with_coupled(memories) if isinstance(around, Surroundings) else around


def slopes_of(world: Truth, state: State, rotor_speeds: Sequence[Any], around: Around) -> Memories:
    """Rates of the memories at a state, 1/s."""
    if not isinstance(around, Surroundings) or not around.coupled:
        return ()
    motion = PointMotion(world.vehicle, state, around.air_velocity, gravity=world.gravity)
    return around.slopes(motion, rotor_speeds)


def moved(memories: Memories, slopes: Memories, dt: Any) -> Memories:
    """Memories + dt * slopes."""
    found: Memories = moved_by(memories, slopes, dt)
    return found


def before_euler_step(world: Truth, state: State, rotor_speeds: Sequence[Any], around: Around, dt: Any) -> Around:
    """The surroundings with which a semi-implicit Euler step (s) takes its forces."""
    if not isinstance(around, Surroundings) or not around.coupled:
        return around
    return bent(around, slopes_of(world, state, rotor_speeds, around), dt)


def bent(around: Surroundings, slopes: Memories, dt: Any) -> Surroundings:
    """The surroundings after what velocities bend has gone on for a time (s) by its slopes."""
    going = zip(around.coupled, around.coupled_memories(), slopes, strict=True)
    return around.with_coupled([around.components[i].before_euler_step(held, rate, dt) for i, held, rate in going])


def after_euler_step(around: Around, slopes: Memories, dt: Any) -> Memories:
    """Memories of the surroundings after a semi-implicit Euler step (s)."""
    if not isinstance(around, Surroundings):
        return ()
    going = zip(around.coupled, around.coupled_memories(), slopes, strict=True)
    return tuple(around.components[i].euler_step(memory, slope, dt) for i, memory, slope in going)


def drifted(around: Surroundings, dt: Any) -> Surroundings:
    """The surroundings after a time (s) in which coupled components are not pushed."""
    going = zip(around.coupled, around.coupled_memories(), strict=True)
    return around.with_coupled([around.components[i].drift(held, dt) for i, held in going])


def pushed(around: Surroundings, motion: PointMotion, rotor_speeds: Sequence[Any], dt: Any) -> Surroundings:
    """The surroundings after the forces of a time (s) on coupled components."""
    going = zip(around.coupled, around.coupled_memories(), strict=True)
    return around.with_coupled(
        [around.components[i].push(held, around.time, motion, rotor_speeds, dt) for i, held in going]
    )


def places_in(around: Around) -> tuple[int, ...]:
    """Places of these memories' numbers among the leaves of the surroundings."""
    if not isinstance(around, Surroundings) or not around.coupled:
        return ()
    first = len(leaves(around.components))
    return tuple(first + place for place in places_among(around.memories, around.coupled))


def places_among(memories: Memories, coupled: Sequence[int]) -> tuple[int, ...]:
    """Places of the numbers of some memories among the leaves of all."""
    found, first = list[int](), 0
    for i, memory in enumerate(memories):
        count = len(leaves(memory))
        if i in coupled:
            found += range(first, first + count)
        first += count
    return tuple(found)
