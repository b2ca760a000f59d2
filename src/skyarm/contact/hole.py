"""A plate with a round hole: how far a point is from its top, chamfer, wall, bottom, and from its outside.

The plate is a solid of revolution about the hole's axis z: its section is a polygon of the distance from the axis and
the height above the top, and the distance of a point is that of the nearest place of the polygon, exact everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.algebra import Vec3
from skyarm.files import shown
from skyarm.records.coerce import RecordError, concrete
from skyarm.scalars import add, clip, divide, logical_and, logical_not, maximum, mul, neg, same, sqrt, sub, where

SIZES = ("radius", "depth", "chamfer", "outer radius", "length")
"""Lengths, m: of the hole its radius, its depth below the top and the width of its chamfer of 45 degrees at the mouth;
of the plate its outer radius and its length along z."""

SHORTEST = 1e-6
"""m, of any of them: a slip of units, and squares of less vanish."""

_SMALL = 1e-24
"""m^2 under a root: on the axis, and at a corner, a direction is zero instead of NaN."""


def require_hole(size: Sequence[Any]) -> None:
    """Refuse lengths between which no material is left; raises RecordError with one line."""
    if not concrete(*size):
        return
    radius, depth, chamfer, outer, length = size
    said = f"surface.size = {shown([float(each) for each in size])}"
    if min(size) < SHORTEST:
        raise RecordError(f"{said}: must be {SHORTEST:g} m each, or more")
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
    # start and way of each edge; a zero of structure folds away
    edges = (
        ((0, neg(depth)), (radius, 0)),
        ((radius, neg(depth)), (0, depth - chamfer)),
        ((radius, neg(chamfer)), (chamfer, chamfer)),
        ((radius + chamfer, 0), (outer - radius - chamfer, 0)),
        ((outer, 0), (0, neg(length))),
        ((outer, neg(length)), (neg(outer), 0)),
    )
    outside = _outside(size, away, p.z)
    nearest: Any = None
    for start, way in edges:
        found = _to_edge(away, p.z, start, way)
        if nearest is None:
            nearest = found
            continue
        nearer = found[0] < nearest[0]
        nearest = tuple(a if same(a, b) else where(nearer, a, b) for a, b in zip(found, nearest, strict=True))
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
    x, y = sub(away, start[0]), sub(z, start[1])
    square = add(mul(way[0], way[0]), mul(way[1], way[1]))
    t = clip(add(mul(x, way[0]), mul(y, way[1])) * (1.0 / square), 0.0, 1.0)
    along, up, scale = sub(x, mul(t, way[0])), sub(y, mul(t, way[1])), 1.0 / sqrt(square)
    return along * along + up * up, along, up, mul(neg(way[1]), scale), mul(way[0], scale)
