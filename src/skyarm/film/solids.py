"""Solids of a film: the shapes of each vehicle and of its desired pose, their places at every frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skyarm.drawing.hole_parts import without_holes
from skyarm.drawing.moving_poses import moving_poses
from skyarm.drawing.shapes import Shape
from skyarm.drawing.tilted_rotors import rotor_turns, turned_shape
from skyarm.drawing.vehicle_shapes import payload_shape, vehicle_shapes
from skyarm.film.filmed_flight import Color, FilmedFlight

Array = npt.NDArray[np.float64]
RGBA = tuple[float, float, float, float]

GHOST_OPACITY, ROTOR_OPACITY = 0.16, 0.45
GHOST: Color = (0.15, 0.2, 0.3)
DARK: Color = (0.16, 0.17, 0.2)
TIP: Color = (0.85, 0.12, 0.16)
POINT: Color = (0.95, 0.75, 0.1)
SURFACE: RGBA = (0.66, 0.64, 0.6, 1.0)
OBJECT: RGBA = (0.62, 0.46, 0.3, 1.0)
WHITE: Color = (1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True)
class Solid:
    """One shape that moves.

    Attributes:
        shape: kind and size.
        rgba: from 0 to 1.
        position: (F, 3) of its centre in the world, m. rotation: (F, 3, 3), its axes to the world's.
    """

    shape: Shape
    rgba: RGBA
    position: Array
    rotation: Array


def vehicle_solids(flight: FilmedFlight) -> list[Solid]:
    """The vehicle in its colour, the payloads that it takes and leaves, the surfaces that it may touch."""
    own = _solids(flight, flight.position, flight.quaternion, flight.joints, ghost=False)
    shown = without_holes(flight.surfaces)
    world = [Solid(each.shape, world_color(each.shape.role), each.position, each.rotation) for each in shown]
    return [*own, *load_solids(flight), *world]


def world_color(role: str) -> RGBA:
    """Colour of a part of the world: a surface, or an object that moves."""
    return OBJECT if role == "object" else SURFACE


def load_solids(flight: FilmedFlight) -> Iterator[Solid]:
    """Payloads where they are held, and where they lie before and after."""
    if not flight.loads:
        return
    poses = moving_poses(flight.vehicle, flight.position, flight.quaternion, flight.joints)
    for load in flight.loads:
        shape = payload_shape(flight.vehicle, load.mass, load.frame, load.com)
        R, p = poses[shape.body]
        centre = (p + R @ np.array(shape.position))[load.held_at]
        color = role_color(shape.role, flight.color, ghost=False)
        yield Solid(shape, color, centre, (R @ np.array(shape.rotation))[load.held_at])


def ghost_solids(flight: FilmedFlight) -> list[Solid]:
    """The desired pose, see-through: a level base on its reference, joints on theirs."""
    desired = flight.desired_position, flight.desired_quaternion, flight.desired_joints
    return _solids(flight, *desired, ghost=True)


def role_color(role: str, color: Color, *, ghost: bool) -> RGBA:
    """Colour of a shape by what it stands for; ``color`` is the flight's."""
    if ghost:
        return (*GHOST, GHOST_OPACITY)
    if role == "rotor":
        return (*_mix(color, WHITE, 0.45), ROTOR_OPACITY)
    own = {
        "hull": color,
        "link": _mix(color, WHITE, 0.25),
        "tip": TIP,
        "point": POINT,
        "payload": _mix(color, DARK, 0.5),
    }
    return (*own.get(role, DARK), 1.0)


def _solids(flight: FilmedFlight, position: Array, quaternion: Array, joints: Array, *, ghost: bool) -> list[Solid]:
    poses = moving_poses(flight.vehicle, position, quaternion, joints)
    # nothing is wanted of the servos: the desired pose has them at rest
    turns = {} if ghost else rotor_turns(flight.vehicle, flight.tilts)
    found = []
    for shape in (*vehicle_shapes(flight.vehicle), *(() if ghost else flight.points)):
        R, p = poses[shape.body]
        centre = p + R @ np.array(shape.position)
        color = role_color(shape.role, flight.color, ghost=ghost)
        found.append(Solid(shape, color, centre, R @ turned_shape(shape, turns)))
    return found


def _mix(a: Color, b: Color, share: float) -> Color:
    """Colour between two, ``share`` of the second."""
    red, green, blue = ((1.0 - share) * one + share * other for one, other in zip(a, b, strict=True))
    return (red, green, blue)
