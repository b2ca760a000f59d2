"""Parallel projection of shapes onto a drawing: views, outlines of convex solids,
arcs.
"""

from __future__ import annotations

import math

import numpy as np

from skyarm.records.arrays import Array
from skyarm.records.immutable import positional
from skyarm.world.scene.shapes import Shape, mesh_of

AROUND = 48
"""Number of points of a drawn circle."""

DIRECTIONS = 720
"""Number of directions in which the outline of a solid is computed."""


@positional
class Projection:
    """Parallel projection of world points onto a drawing plane, given by its right and
    up directions.

    Attributes:
        right, up: unit vectors (3,) in the world that point so on paper; their cross
            product points to the observer.
    """

    right: tuple[float, float, float]
    up: tuple[float, float, float]

    @property
    def toward(self) -> Array:
        """Unit vector from the drawing plane to the observer."""
        return np.asarray(np.cross(self.right, self.up))

    def flat(self, points: Array) -> Array:
        """Project points (..., 3) onto the drawing plane (..., 2), m."""
        return np.asarray(points @ np.array([self.right, self.up]).T)


def axonometric(azimuth: float, elevation: float) -> Projection:
    """Make a parallel projection from azimuth (rad, from x towards y) and elevation
    (rad, above the horizon).
    """
    ca = math.cos(azimuth)
    sa = math.sin(azimuth)
    ce = math.cos(elevation)
    se = math.sin(elevation)
    return Projection((-sa, ca, 0.0), (-se * ca, -se * sa, ce))


SIDE = Projection((1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
"""Side view from the right: x to the right, z up, y into the paper."""

TOP = Projection((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
"""Top view: x to the right, y up, z towards the observer."""


def outline(shape: Shape, rotation: Array, position: Array, view: Projection) -> Array:
    """Projected outline (K, 2) of a convex solid at a pose of its body,
    counter-clockwise.
    """
    return hull(view.flat(mesh_of(shape, AROUND)[0] @ rotation.T + position))


def hull(points: Array) -> Array:
    """Approximate convex hull of points (N, 2): the farthest point in each of many
    directions.
    """
    angles = np.linspace(0.0, 2.0 * math.pi, DIRECTIONS, endpoint=False)
    farthest = np.argmax(points @ np.array([np.cos(angles), np.sin(angles)]), axis=0)
    # successive directions with one farthest point are one corner
    return np.asarray(points[farthest[np.append(True, np.diff(farthest) != 0)]])


def arc(centre: Array, axis: Array, start: Array, angle: float) -> Array:
    """Points (N, 3) of an arc about an axis through ``centre``, from ``start`` by a
    right-hand angle.

    Args:
        centre: (3,), m.
        axis: unit vector (3,).
        start: (3,) perpendicular to the axis, m.
        angle: rad.
    """
    turned = np.linspace(0.0, angle, AROUND)[:, None]
    return centre + np.cos(turned) * start + np.sin(turned) * np.cross(axis, start)


def perpendicular(axis: Array) -> Array:
    """Unit vector perpendicular to an axis, as close as possible to world z, or to
    x.
    """
    # x for an axis near z, of which too little of z would be left across it
    guide = (
        np.array([0.0, 0.0, 1.0]) if abs(axis[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    )
    across = guide - (guide @ axis) * axis
    return np.asarray(across / np.linalg.norm(across))
