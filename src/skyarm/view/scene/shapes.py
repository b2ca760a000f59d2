"""A shape is one solid to draw, fixed to a body of a vehicle or of the world. It has no mass and touches nothing."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

Vector = tuple[float, float, float]

RGBA = tuple[float, float, float, float]
"""Red, green, blue, opacity, from 0 to 1."""

Matrix = tuple[Vector, Vector, Vector]

UPRIGHT: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

ROLES = ("hull", "boom", "rotor", "link", "joint", "tip", "payload", "point", "surface", "object")
"""What a shape stands for; who draws it chooses a colour by it."""


@dataclass(frozen=True, slots=True)
class Shape:
    """A solid in the frame of its body.

    Attributes:
        name: unique among the shapes of a vehicle.
        role: one of ROLES.
        kind: "ellipsoid" (three half axes), "capsule" or "cylinder" (radius, length between the centres of its ends,
            along z), "sphere" (radius), "box" (three half lengths), "patch" of a plane (two half lengths; its outside
            is along z), "hole" (a plate with one, about z: radius, depth, chamfer, outer radius, length; the origin is
            in the middle of the mouth), "mesh" (its scale along its axes).
        body: link of the vehicle, BASE for the airframe; of a surface of the world it says nothing.
        size: m, by kind.
        position: centre, m, axes of the body.
        rotation: rows of R_BS, axes of the shape to those of the body.
        mesh: path of an STL file in its place, axes of the shape, for who draws meshes; empty for none.
    """

    name: str
    role: str
    kind: str
    body: int
    size: tuple[float, ...]
    position: Vector = (0.0, 0.0, 0.0)
    rotation: Matrix = UPRIGHT
    mesh: str = ""


SURFACE: RGBA = (0.66, 0.64, 0.6, 1.0)
OBJECT: RGBA = (0.62, 0.46, 0.3, 1.0)


@dataclass(frozen=True, slots=True)
class Solid:
    """A shape in the world at N instants.

    Attributes:
        shape: kind and size.
        position: (N, 3) of its origin in the world, m. rotation: (N, 3, 3), its axes to the world's.
        rgba: colour.
    """

    shape: Shape
    position: Array
    rotation: Array
    rgba: RGBA = SURFACE

    @property
    def moves(self) -> bool:
        """Whether it is elsewhere at any later instant."""
        return bool(np.ptp(self.position, axis=0).any() or np.ptp(self.rotation, axis=0).any())


def between(name: str, role: str, kind: str, body: int, radius: float, start: Vector, end: Vector) -> Shape:
    """A capsule or cylinder from one point of a body to another."""
    along = floats(b - a for a, b in zip(start, end, strict=True))
    centre = floats(0.5 * (a + b) for a, b in zip(start, end, strict=True))
    return Shape(name, role, kind, body, (radius, math.hypot(*along)), centre, turn_onto(along))


def turn_onto(axis: Vector) -> Matrix:
    """Rotation, as rows, that turns z onto an axis of any length by the shortest way; about x where it is -z."""
    length = math.hypot(*axis)
    if length == 0.0:
        return UPRIGHT
    x, y, z = (component / length for component in axis)
    across = x * x + y * y
    if z < 0.0 and across == 0.0:
        return ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0))
    # 1 / (1 + z), which loses its digits next to the lower pole
    k = 1.0 / (1.0 + z) if z > 0.0 else (1.0 - z) / across
    return ((1.0 - k * x * x, -k * x * y, x), (-k * x * y, 1.0 - k * y * y, y), (-x, -y, z))


def floats(values: Iterable[Any]) -> Vector:
    """Three concrete numbers as floats."""
    x, y, z = values
    return (float(x), float(y), float(z))
