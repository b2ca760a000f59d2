"""The plant's functions of all vehicles, for one vehicle in its surroundings."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.point_motion import PointMotion
from skyarm.plant.interface import Truth
from skyarm.plant.loads import STEADY
from skyarm.plant.rigid_body import Rate, accelerate, derivative
from skyarm.plant.surroundings import (
    Memories,
    Surroundings,
    Together,
    coupled_places,
    several,
)

Around = Surroundings | Together


def motion_of(world: Truth, state: State, around: Around = STEADY) -> PointMotion:
    """Motion of the vehicle in its air, with its rotors turned to the angles of its
    state.
    """
    worlds, all_around = several(world, around)
    (motion,) = all_around.motions(worlds, (state,))
    return motion


def acceleration(
    world: Truth, state: State, command: Command, around: Around = STEADY
) -> Any:
    """Proper acceleration of the base, and accelerations of the joints."""
    worlds, all_around = several(world, around)
    (found,) = accelerate(worlds, (state,), (command,), all_around)
    return found


def rate_of(
    world: Truth, state: State, command: Command, around: Around = STEADY
) -> Rate:
    """Time derivative of the vehicle's state."""
    worlds, all_around = several(world, around)
    (rate,), _ = derivative(worlds, (state,), (command,), all_around)
    return rate


def after_step(
    method: Callable[..., Any],
    world: Truth,
    state: State,
    command: Command,
    around: Around,
    dt: Any,
) -> tuple[State, Memories]:
    """State and coupled memories after a step of an integration method of the
    rigid-body plant.
    """
    worlds, all_around = several(world, around)
    (after,), memories = method(worlds, (state,), (command,), all_around, dt)
    return after, memories


def together(around: Around) -> Together:
    """Surroundings of one vehicle as those of all."""
    return around if isinstance(around, Together) else Together((around,))


def places_in(around: Around) -> tuple[int, ...]:
    """Indices of the coupled models' internal states among all numbers of the
    surroundings.
    """
    return coupled_places(together(around))
