"""A plate with a round hole: how far a point is from its top, chamfer, wall, bottom, and from its outside.

The plate is a solid of revolution about the hole's axis z: its section is a polygon of the distance from the axis and
the height above the top, and the distance of a point is that of the nearest place of the polygon, exact everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from skyarm.algebra import Vec3
from skyarm.files import shown
from skyarm.records.coerce import RecordError, concrete
from skyarm.scalars import clip, divide, logical_and, logical_not, maximum, sqrt, where

SIZES = ("radius", "depth", "chamfer", "outer radius", "length")
"""Lengths, m: of the hole its radius, its depth below the top and the width of its chamfer of 45 degrees at the mouth;
of the plate its outer radius and its length along z."""

_SMALL = 1e-24
"""m^2 under a root: on the axis, and at a corner, a direction is zero instead of NaN."""


def require_hole(size: Sequence[Any]) -> None:
    """Refuse lengths between which no material is left; raises RecordError with one line."""
    if not concrete(*size):
        return
    radius, depth, chamfer, outer, length = size
    said = f"surface.size = {shown([float(each) for each in size])}"
    if not chamfer < depth:
        raise RecordError(f"{said}: chamfer must be below depth")
    if not radius + chamfer < outer:
        raise RecordError(f"{said}: outer radius must be above radius + chamfer")
    if not depth < length:
        raise RecordError(f"{said}: length must be above depth; the hole has a bottom")


def from_plate(size: Sequence[Any], p: Vec3) -> tuple[Any, Vec3]:
    """Height of a point above the plate (m, negative inside) and the outward normal, axes of the plate.

    Args:
        size: as ``SIZES`` says.
        p: the point, m; the origin is in the middle of the hole's mouth, z leads out of it.
    """
    radius, depth, chamfer, outer, length = size
    away = sqrt(p.x * p.x + p.y * p.y + _SMALL)
    corners = (
        (0.0, -depth), (radius, -depth), (radius, -chamfer), (radius + chamfer, 0.0), (outer, 0.0),
        (outer, -length), (0.0, -length),
    )  # fmt: skip
    outside = _outside(size, away, p.z)
    nearest: Any = None
    for (x, z), (x_next, z_next) in pairwise(corners):
        found = _to_edge(away, p.z, (x, z), (x_next - x, z_next - z))
        if nearest is None:
            nearest = found
            continue
        nearer = found[0] < nearest[0]
        nearest = tuple(where(nearer, a, b) for a, b in zip(found, nearest, strict=True))
    square, along, up, edge_along, edge_up = nearest
    distance, sign = sqrt(square), where(outside, 1.0, -1.0)
    # on the skin the way to it has no direction, the edge has
    close = square < _SMALL
    n, z = (
        where(close, edge, divide(way, distance + _SMALL) * sign) for way, edge in ((along, edge_along), (up, edge_up))
    )
    return sign * distance, Vec3(n * divide(p.x, away), n * divide(p.y, away), z)


def _outside(size: Sequence[Any], away: Any, z: Any) -> Any:
    """Whether a point of the section is outside of the material: in the hole, or beyond the plate."""
    radius, depth, chamfer, outer, length = size
    beyond = maximum(maximum(away - outer, z), -length - z) > 0.0
    hollow = logical_and(z > -depth, away < radius + maximum(z + chamfer, 0.0))
    return logical_not(logical_and(logical_not(beyond), logical_not(hollow)))


def _to_edge(away: Any, z: Any, start: tuple[Any, Any], way: tuple[Any, Any]) -> tuple[Any, ...]:
    """Squared distance from an edge of the section, the way from its nearest place, and its outward normal.

    The material is on the right of an edge, seen along it.
    """
    x, y = away - start[0], z - start[1]
    square = way[0] * way[0] + way[1] * way[1]
    t = clip((x * way[0] + y * way[1]) * (1.0 / square), 0.0, 1.0)
    along, up, scale = x - t * way[0], y - t * way[1], 1.0 / sqrt(square)
    return along * along + up * up, along, up, -way[1] * scale, way[0] * scale
