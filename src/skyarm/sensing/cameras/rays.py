"""Rays against the shapes of contact, over any scalar: one formula for each shape.

A ray ``p + t d`` meets a convex shape in an interval of t; without a meeting the
interval is empty, from infinity to minus infinity. Balls and cylinders are met about
the place of the ray that is nearest to their middle, which keeps the digits of far
shapes (Haines, Guenther, Akenine-Moeller 2019, Precision improvements for ray/sphere
intersection); slabs are those of Kay, Kajiya 1986, Ray tracing complex scenes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any

from skyarm.algebra import Mat3, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import (
    absolute,
    divide,
    logical_and,
    logical_or,
    maximum,
    minimum,
    sqrt,
    where,
)
from skyarm.compile.tracing.lower import compiled_once, compute_where, repeat
from skyarm.records.immutable import positional
from skyarm.world.contact.surface import from_plate

TINY = 1e-300
"""Least divisor: a ray along a face or an axis meets it far away."""

STEPS, CLOSE = 2000, 1e-10
"""Most steps of a ray to a plate with a hole, and distance (m) at which it has met
it."""

SIZES = 5
"""Largest number of sizes of a shape."""

Interval = tuple[Scalar, Scalar]
"""First and last t of a ray in a convex shape."""


@positional
class ShapeRow:
    """Shape, or face of a hull along z, as rays meet it.

    Attributes:
        rotation, eye: axes of the sensor and its place (m) in those of the shape.
        middle, left: middle of a ball about the shape, optical axes (m), and its
            distance squared less its radius squared (m^2); negative from within.
        size: sizes (m). kind: index among the kinds of the program.
        first: 1 for a shape and the first face of a hull.
        number: of the shape, from 1 on; of a face 0 but for the last of its hull.
    """

    rotation: Mat3
    eye: Vec3
    middle: Vec3
    left: Scalar
    size: Scalars
    kind: Scalar
    first: Scalar
    number: Scalar


Sight = tuple[Scalar, Scalar, Scalar, Scalar]
"""Depth of the nearest shape so far, its number, and the interval of a ray in the faces
so far of a hull."""


def _both(one: Interval, other: Interval) -> Interval:
    """Interval of a ray in two convex shapes at once."""
    near, far = maximum(one[0], other[0]), minimum(one[1], other[1])
    met = near <= far
    return where(met, near, math.inf), where(met, far, -math.inf)


def _slab(p: Scalar, d: Scalar, half: Scalar) -> Interval:
    """Interval of a ray between two planes at plus and minus ``half`` (m)."""
    inverse = divide(1.0, where(absolute(d) < TINY, TINY, d))
    one, other = (-half - p) * inverse, (half - p) * inverse
    return minimum(one, other), maximum(one, other)


def _round(p: Sequence[Scalar], d: Sequence[Scalar], radius: Scalar) -> Interval:
    """Interval of a ray in a ball, or, of two components, in a cylinder without an
    end.
    """
    square = maximum(sum(c * c for c in d), TINY)
    middle = -divide(sum(a * b for a, b in zip(p, d, strict=True)), square)
    off = [a + b * middle for a, b in zip(p, d, strict=True)]
    left = radius * radius - sum(c * c for c in off)
    half = sqrt(divide(maximum(left, 0.0), square))
    met = left >= 0.0
    return where(met, middle - half, math.inf), where(met, middle + half, -math.inf)


def _sphere(p: Vec3, d: Vec3, size: Scalars) -> Interval:
    return _round((*p,), (*d,), size[0])


def _box(p: Vec3, d: Vec3, size: Scalars) -> Interval:
    halves = [0.5 * each for each in size[:3]]
    return reduce(_both, map(_slab, p, d, halves))


def _cylinder(p: Vec3, d: Vec3, size: Scalars) -> Interval:
    side = _round((p.x, p.y), (d.x, d.y), size[0])
    return _both(side, _slab(p.z, d.z, 0.5 * size[1]))


def _capsule(p: Vec3, d: Vec3, size: Scalars) -> Interval:
    half = 0.5 * size[1]
    ends = [_round((p.x, p.y, p.z + z), (*d,), size[0]) for z in (half, -half)]
    nears, fars = zip(_cylinder(p, d, size), *ends, strict=True)
    return reduce(minimum, nears), reduce(maximum, fars)


def _plane(p: Vec3, d: Vec3, size: Scalars) -> Interval:
    # it has no other side
    return where(d.z < -TINY, -divide(p.z, d.z), math.inf), math.inf


def _hole(p: Vec3, d: Vec3, size: Scalars) -> Interval:
    """First place of a plate with a hole, by steps of the distance from it (Hart 1996,
    Sphere tracing).
    """
    pace = divide(1.0, d.norm())
    reach = p.norm() + size[3] + size[4]

    def step(record: tuple[Scalar, Scalar]) -> tuple[Scalar, Scalar]:
        t = record[0]
        away = absolute(from_plate(size, p + d * t)[0])
        on = logical_and(away > CLOSE, t < reach * pace)
        return t + away * pace, where(on, 1.0, 0.0)

    # 0 times the pace: a number of its kind, an array of lanes too
    start: tuple[Scalar, Scalar] = (0.0 * pace, 1.0)
    t, _ = repeat(STEPS, step, start, until=1)
    # the first place is never behind the eye, so the far side is not asked for
    return where(t < reach * pace, t, math.inf), math.inf


def _face(p: Vec3, d: Vec3, size: Scalars) -> Interval:
    """Interval of a ray below a face of a hull."""
    t = -divide(p.z, where(absolute(d.z) < TINY, TINY, d.z))
    falls = d.z < 0.0
    return where(falls, t, -math.inf), where(falls, math.inf, t)


MEETING: dict[str, Callable[[Vec3, Vec3, Scalars], Interval]] = {
    "sphere": _sphere,
    "box": _box,
    "cylinder": _cylinder,
    "capsule": _capsule,
    "plane": _plane,
    "hole": _hole,
    "hull": _face,
}
"""Interval of a ray in each shape, from origin, direction and sizes."""


def meet(kinds: Sequence[str]) -> Callable[..., tuple[Sight, tuple[()]]]:
    """Step of a traced loop whose lanes are rays and whose rows are shapes of some
    kinds.

    Rays that pass by a ball about the shape are left out at once.
    """

    def nearer(record: tuple[Sight, Vec3, ShapeRow]) -> Sight:
        return _nearer(*record, kinds)

    def step(sight: Sight, ray: Vec3, row: ShapeRow, _: object) -> Any:
        along = row.middle.dot(ray)
        ahead = logical_and(along >= 0.0, along * along >= row.left * ray.dot(ray))
        return compute_where(
            logical_or(row.left <= 0.0, ahead),
            lambda both: compiled_once(("rays", kinds), nearer, (*both, row)),
            (sight, ray),
            sight,
        ), ()

    return step


def _nearer(sight: Sight, ray: Vec3, row: ShapeRow, kinds: Sequence[str]) -> Sight:
    """Nearest of what was met before and a shape; from within it, its far side."""
    depth, number, near, far = sight
    way = row.eye, row.rotation.apply(ray), row.size
    met: Interval = (0.0, 0.0)
    for i, kind in enumerate(kinds):

        def meeting(way: tuple[Vec3, Vec3, Scalars], kind: str = kind) -> Interval:
            return compiled_once(("ray", kind), lambda w: MEETING[kind](*w), way)

        met = compute_where(absolute(row.kind - i) < 0.5, meeting, way, met)
    # faces of a hull follow each other: the first begins a new interval
    begins = row.first > 0.5
    near = maximum(met[0], where(begins, -math.inf, near))
    far = minimum(met[1], where(begins, math.inf, far))
    t = where(near >= 0.0, near, far)
    closer = logical_and(
        logical_and(near <= far, row.number > 0.5), logical_and(t >= 0.0, t < depth)
    )
    return where(closer, t, depth), where(closer, row.number, number), near, far
