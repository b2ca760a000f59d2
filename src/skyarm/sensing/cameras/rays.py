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

from skyarm.algebra import Mat3, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import (
    absolute,
    divide,
    logical_and,
    maximum,
    minimum,
    sqrt,
    where,
)
from skyarm.compile.tracing.lower import repeat
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

Hit = tuple[Scalar, Scalar]
"""Depth of the nearest shape so far, and its number."""


@positional
class ShapeRow:
    """Shape, or face of a hull along z, as rays meet it.

    Attributes:
        rotation, eye: axes of the sensor and its place (m) in those of the shape.
        size: sizes (m); of a face first 1 if it is the first of its hull.
        number: of the shape, from 1 on; of a face 0 but for the last of its hull.
    """

    rotation: Mat3
    eye: Vec3
    size: Scalars
    number: Scalar


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
    met = logical_and(p.z >= 0.0, d.z < -TINY)
    return where(met, -divide(p.z, d.z), math.inf), -math.inf


def _hole(p: Vec3, d: Vec3, size: Scalars) -> Interval:
    """First place of a plate with a hole, by steps of the distance from it (Hart 1996,
    Sphere tracing).
    """
    pace = divide(1.0, sqrt(d.dot(d)))
    reach = sqrt(p.dot(p)) + size[3] + size[4]

    def step(record: tuple[Scalar, Scalar]) -> tuple[Scalar, Scalar]:
        t = record[0]
        away = absolute(from_plate(size, p + d * t)[0])
        on = logical_and(away > CLOSE, t < reach * pace)
        return t + away * pace, where(on, 1.0, 0.0)

    t, _ = repeat(STEPS, step, (0.0 * pace, 1.0), until=1)
    return where(t < reach * pace, t, math.inf), -math.inf


MEETING: dict[str, Callable[[Vec3, Vec3, Scalars], Interval]] = {
    "sphere": _sphere,
    "box": _box,
    "cylinder": _cylinder,
    "capsule": _capsule,
    "plane": _plane,
    "hole": _hole,
}
"""Interval of a ray in each shape but a hull, from origin, direction and sizes."""


def _nearer(hit: Hit, met: Interval, number: Scalar) -> Hit:
    """Nearest of what was hit and of a shape's interval; from within, its far side."""
    near, far = met
    t = where(near >= 0.0, near, far)
    closer = logical_and(t >= 0.0, t < hit[0])
    return where(closer, t, hit[0]), where(closer, number, hit[1])


def meet_shape(shape: str) -> Callable[..., tuple[Hit, tuple[()]]]:
    """Step of a traced loop, whose rows are shapes of one kind and whose lanes are
    rays.
    """

    def step(hit: Hit, ray: Vec3, row: ShapeRow, _: object) -> tuple[Hit, tuple[()]]:
        met = MEETING[shape](row.eye, row.rotation.apply(ray), row.size)
        return _nearer(hit, met, row.number), ()

    return step


def meet_face(
    carry: tuple[Hit, Interval], ray: Vec3, row: ShapeRow, _: object
) -> tuple[tuple[Hit, Interval], tuple[()]]:
    """Step of a traced loop, whose rows are faces of hulls and whose lanes are rays."""
    hit, (near, far) = carry
    begins = row.size[0] > 0.5
    near, far = where(begins, -math.inf, near), where(begins, math.inf, far)
    fall = row.rotation.r2.dot(ray)
    t = -divide(row.eye.z, where(absolute(fall) < TINY, TINY, fall))
    near = where(fall < 0.0, maximum(near, t), near)
    far = where(fall < 0.0, far, minimum(far, t))
    whole = where(near <= far, near, math.inf), where(near <= far, far, -math.inf)
    ends = row.number > 0.5
    both = zip(_nearer(hit, whole, row.number), hit, strict=True)
    depth, number = (where(ends, new, old) for new, old in both)
    return ((depth, number), (near, far)), ()
