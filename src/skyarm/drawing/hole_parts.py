"""A plate with a hole as boxes and a cylinder, for whoever draws no meshes: films, and files for viewers of ROS."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from skyarm.drawing.shapes import Shape
from skyarm.drawing.world_shapes import WorldShape

SIDES = 16
"""Corners of the hole."""

LOWER = 2e-5
"""m by which each box lies below the one before: faces at one height would be lit twice where they overlap."""


def without_holes(solids: Iterable[WorldShape]) -> list[WorldShape]:
    """The same solids with parts in place of each plate with a hole; its chamfer is left out."""
    found = []
    for solid in solids:
        if solid.shape.kind != "hole":
            found.append(solid)
            continue
        for part in hole_parts(solid.shape):
            place = solid.position + solid.rotation @ np.array(part.position)
            upright = replace(part, position=(0.0, 0.0, 0.0), rotation=solid.shape.rotation)
            found.append(WorldShape(upright, place, solid.rotation @ np.array(part.rotation)))
    return found


def hole_parts(shape: Shape) -> list[Shape]:
    """Boxes round about the hole, whose inner faces are its sides, and the bottom, in axes of the plate."""
    radius, depth, _, outer, length = shape.size
    bottom = Shape(
        f"{shape.name}/bottom", shape.role, "cylinder", shape.body, (outer, length - depth),
        (0.0, 0.0, -0.5 * (length + depth)),
    )  # fmt: skip
    halves = 0.5 * (outer - radius), outer * math.tan(math.pi / SIDES), 0.5 * depth
    found, middle = [bottom], 0.5 * (outer + radius)
    for i in range(SIDES):
        c, s = math.cos(2.0 * math.pi * i / SIDES), math.sin(2.0 * math.pi * i / SIDES)
        turn = ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))
        place = (middle * c, middle * s, -0.5 * depth - LOWER * i)
        found.append(Shape(f"{shape.name}/side{i + 1}", shape.role, "box", shape.body, halves, place, turn))
    return found
