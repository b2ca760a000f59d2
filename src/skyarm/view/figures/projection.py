"""Parallel projections of a vehicle's shapes onto paper: views, and outlines of convex solids."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skyarm.world.scene.shapes import Shape, mesh_of

Array = npt.NDArray[np.float64]

AROUND = 48
"""Points of a circle."""


@dataclass(frozen=True, slots=True)
class View:
    """A parallel projection.

    Attributes:
        name: in words. right, up: unit vectors (3,) in the world that point so on paper; their cross product points to
            the observer.
    """

    name: str
    right: tuple[float, float, float]
    up: tuple[float, float, float]

    @property
    def toward(self) -> Array:
        """Unit vector to the observer."""
        return np.asarray(np.cross(self.right, self.up))

    def flat(self, points: Array) -> Array:
        """Points (..., 3) on paper (..., 2), m."""
        return np.asarray(points @ np.array([self.right, self.up]).T)


def axonometric(azimuth: float, elevation: float) -> View:
    """A view from a direction: azimuth from x towards y, elevation above the horizon, rad."""
    ca, sa, ce, se = math.cos(azimuth), math.sin(azimuth), math.cos(elevation), math.sin(elevation)
    return View("axonometric", (-sa, ca, 0.0), (-se * ca, -se * sa, ce))


SIDE = View("side", (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
"""From the right: x to the right, z up, y into the paper."""

TOP = View("top", (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
"""From above: x to the right, y up, z to the observer."""


def surface(shape: Shape) -> Array:
    """Points of a solid's surface (N, 3) in the frame of its body, dense enough that their hull is its outline."""
    return mesh_of(shape, AROUND)[0]


def hull(points: Array) -> Array:
    """Corners (K, 2) of the convex hull of points (N, 2), counter-clockwise.

    Source: Andrew 1979, Another efficient algorithm for convex hulls in two dimensions.
    """
    ordered = [tuple(each) for each in np.unique(points, axis=0).tolist()]
    if len(ordered) < 3:
        return np.array(ordered)
    sides = [_chain(ordered), _chain(ordered[::-1])]
    return np.array(sides[0][:-1] + sides[1][:-1])


def _chain(ordered: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
    """Corners of one side of the hull, from the first point to the last."""
    kept: list[tuple[float, ...]] = []
    for point in ordered:
        while len(kept) >= 2 and _turn(kept[-2], kept[-1], point) <= 0.0:
            kept.pop()
        kept.append(point)
    return kept


def _turn(a: tuple[float, ...], b: tuple[float, ...], c: tuple[float, ...]) -> float:
    """Positive where the way from a over b to c turns left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def arc(centre: Array, axis: Array, start: Array, angle: float, points: int = 48) -> Array:
    """Points (N, 3) of an arc about an axis: from centre + start by an angle, positive by the right-hand rule.

    Args:
        centre: (3,), m.
        axis: unit vector (3,).
        start: (3,) across the axis, m.
        angle: rad.
        points: how many.
    """
    turned = np.linspace(0.0, angle, points)[:, None]
    return np.asarray(centre + np.cos(turned) * start + np.sin(turned) * np.cross(axis, start))


def across(axis: Array) -> Array:
    """A unit vector across an axis, as near to world z as there is, or to x."""
    guide = np.array([0.0, 0.0, 1.0]) if abs(axis[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    found = guide - (guide @ axis) * axis
    return np.asarray(found / np.linalg.norm(found))
