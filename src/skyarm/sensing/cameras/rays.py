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

from skyarm.algebra import Mat3, Scalar, Vec3
from skyarm.algebra.scalars import (
    absolute,
    divide,
    logical_and,
    maximum,
    minimum,
    sqrt,
    where,
)
from skyarm.records.immutable import positional

TINY = 1e-300
"""Least divisor: a ray along a face or an axis meets it far away."""

Interval = tuple[Scalar, Scalar]
"""First and last t of a ray in a convex shape."""

SIZES = 5
"""Largest number of sizes of a shape."""


def _both(*intervals: Interval) -> Interval:
    """Interval of a ray in all of several convex shapes; empty where it misses one."""
    near = reduce(maximum, [each[0] for each in intervals])
    far = reduce(minimum, [each[1] for each in intervals])
    met = near <= far
    return where(met, near, math.inf), where(met, far, -math.inf)


def _slab(p: Scalar, d: Scalar, half: Scalar) -> Interval:
    """Interval of a ray between two planes at plus and minus ``half`` (m)."""
    inverse = divide(1.0, where(absolute(d) < TINY, TINY, d))
    one, other = (-half - p) * inverse, (half - p) * inverse
    return minimum(one, other), maximum(one, other)


def _round(p: Sequence[Scalar], d: Sequence[Scalar], radius: Scalar) -> Interval:
    """Interval of a ray in a ball, or, in two dimensions, in a cylinder without an
    end.
    """
    square = maximum(sum(c * c for c in d), TINY)
    middle = -divide(sum(a * b for a, b in zip(p, d, strict=True)), square)
    off = [a + b * middle for a, b in zip(p, d, strict=True)]
    left = radius * radius - sum(c * c for c in off)
    half = sqrt(divide(maximum(left, 0.0), square))
    met = left >= 0.0
    return where(met, middle - half, math.inf), where(met, middle + half, -math.inf)


def _sphere(p: Vec3, d: Vec3, size: Sequence[Scalar]) -> Interval:
    return _round((*p,), (*d,), size[0])


def _box(p: Vec3, d: Vec3, size: Sequence[Scalar]) -> Interval:
    rows = zip(p, d, size, strict=False)
    return _both(*(_slab(a, b, 0.5 * each) for a, b, each in rows))


def _cylinder(p: Vec3, d: Vec3, size: Sequence[Scalar]) -> Interval:
    side = _round((p.x, p.y), (d.x, d.y), size[0])
    return _both(side, _slab(p.z, d.z, 0.5 * size[1]))


def _capsule(p: Vec3, d: Vec3, size: Sequence[Scalar]) -> Interval:
    half = 0.5 * size[1]
    parts = [
        _round((p.x, p.y, p.z + half), (*d,), size[0]),
        _cylinder(p, d, size),
        _round((p.x, p.y, p.z - half), (*d,), size[0]),
    ]
    near = reduce(minimum, [each[0] for each in parts])
    return near, reduce(maximum, [each[1] for each in parts])


def _plane(p: Vec3, d: Vec3, size: Sequence[Scalar]) -> Interval:
    # seen from outside alone
    met = logical_and(p.z >= 0.0, d.z < -TINY)
    return where(met, -divide(p.z, d.z), math.inf), -math.inf


def _hole(p: Vec3, d: Vec3, size: Sequence[Scalar]) -> Interval:
    """First place of a plate with a hole, from both faces, bottom, side, hole and
    chamfer.
    """
    radius, depth, chamfer, outer, length = size
    mouth = radius + chamfer
    places = [
        *_turned(p, d, outer, 0.0, -length, 0.0),
        *_turned(p, d, radius, 0.0, -depth, -chamfer),
        *_turned(p, d, mouth, 1.0, -chamfer, 0.0),
        _ring(p, d, 0.0, mouth, outer),
        _ring(p, d, -depth, 0.0, radius),
        _ring(p, d, -length, 0.0, outer),
    ]
    return reduce(minimum, places), -math.inf


def _ring(p: Vec3, d: Vec3, z: Scalar, inner: Scalar, outer: Scalar) -> Scalar:
    """Place at which a ray meets a ring at a height z; infinity for none."""
    t = divide(z - p.z, where(absolute(d.z) < TINY, TINY, d.z))
    x, y = p.x + d.x * t, p.y + d.y * t
    square = x * x + y * y
    met = logical_and(square >= inner * inner, square <= outer * outer)
    return where(logical_and(met, t >= 0.0), t, math.inf)


def _turned(
    p: Vec3, d: Vec3, radius: Scalar, slope: float, low: Scalar, high: Scalar
) -> list[Scalar]:
    """Both places at which a ray meets a cylinder, or a cone whose radius grows with z,
    between two heights; infinity for none.
    """
    wide, growth = radius + slope * p.z, slope * d.z
    a = d.x * d.x + d.y * d.y - growth * growth
    b = p.x * d.x + p.y * d.y - wide * growth
    c = p.x * p.x + p.y * p.y - wide * wide
    root = b * b - a * c
    # no difference of numbers of one size (Numerical Recipes, section 5.6)
    q = -(b + where(b < 0.0, -1.0, 1.0) * sqrt(maximum(root, 0.0)))
    found = []
    for t in (divide(q, a), divide(c, q)):
        z = p.z + d.z * t
        on = logical_and(z >= low, z <= high)
        met = logical_and(logical_and(root >= 0.0, t >= 0.0), on)
        found.append(where(met, t, math.inf))
    return found


MEETING: dict[str, Callable[[Vec3, Vec3, Sequence[Scalar]], Interval]] = {
    "sphere": _sphere,
    "box": _box,
    "cylinder": _cylinder,
    "capsule": _capsule,
    "plane": _plane,
    "hole": _hole,
}
"""Interval of a ray in each shape but a hull, from origin, direction and sizes."""

Hit = tuple[Scalar, Scalar]
"""Distance to the nearest shape so far, and its number."""


def nearer(hit: Hit, met: Interval, number: Scalar) -> Hit:
    """Nearest of what was hit and a shape's interval; from within, its far side."""
    near, far = met
    t = where(near >= 0.0, near, far)
    closer = logical_and(t >= 0.0, t < hit[0])
    return where(closer, t, hit[0]), where(closer, number, hit[1])


@positional
class Placed:
    """Shape in optical axes as a ray meets it: rotation from these to its own axes, the
    sensor's place in them (m), sizes (m) and number.
    """

    rotation: Mat3
    eye: Vec3
    size: tuple[Scalar, ...]
    number: Scalar


@positional
class Face:
    """Face of a hull: outward normal in optical axes, height (m) of the sensor above
    it, 1 for the first face of a hull, and the hull's number at its last, else 0.
    """

    normal: Vec3
    height: Scalar
    first: Scalar
    number: Scalar


def meet_shape(shape: str) -> Callable[..., tuple[Hit, tuple[()]]]:
    """Step of a traced loop, whose rows are shapes of one kind and whose lanes are
    rays.
    """

    def step(hit: Hit, ray: Vec3, row: Placed, _: object) -> tuple[Hit, tuple[()]]:
        met = MEETING[shape](row.eye, row.rotation.apply(ray), row.size)
        return nearer(hit, met, row.number), ()

    return step


def meet_face(
    carry: tuple[Hit, Interval], ray: Vec3, row: Face, _: object
) -> tuple[tuple[Hit, Interval], tuple[()]]:
    """Step of a traced loop, whose rows are faces of hulls and whose lanes are rays."""
    hit, (near, far) = carry
    begins = row.first > 0.5
    near, far = where(begins, -math.inf, near), where(begins, math.inf, far)
    fall = row.normal.dot(ray)
    t = divide(-row.height, where(absolute(fall) < TINY, TINY, fall))
    enters = fall < 0.0
    near, far = (
        where(enters, maximum(near, t), near),
        where(enters, far, minimum(far, t)),
    )
    whole = _both((near, far))
    closer, number = nearer(hit, whole, row.number)
    ends = row.number > 0.5
    return (
        (where(ends, closer, hit[0]), where(ends, number, hit[1])),
        (near, far),
    ), ()
