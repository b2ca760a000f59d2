"""Places where two shapes touch.

A sphere or capsule touches with its own balls alone, which find faces, edges and
corners of the other. Of two shapes with corners each touches the other with its own:
corners of boxes and hulls, three points of each rim of a cylinder
(:mod:`skyarm.world.contact.surface` measures how deep). What crosses beside all corners
touches along its line: a capsule or the side of a cylinder at the nearest place of its
axis, on a box or on a cylinder's end at both ends of the part above it; boxes by pairs
of edges (:mod:`skyarm.world.contact.box_edges`). Edges of hulls do not meet edges of
hulls or boxes. The place of a rim that is nearest to a rim or an edge is looked for
along an arc: 1 % of drawn poses touch late (measured).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from itertools import product

from skyarm.algebra import Mat3, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import (
    absolute,
    clip,
    divide,
    logical_and,
    logical_or,
    maximum,
    minimum,
    sqrt,
    where,
)
from skyarm.records.immutable import positional
from skyarm.world.contact.box_edges import PlacedBox, edge_touches
from skyarm.world.contact.surface import Spot, Surface

ROUND = ("sphere", "capsule")
"""Shapes that touch with balls alone, in the order in which they give them."""

HOLLOW = ("plane", "hole", "heightfield")
"""Shapes that nothing of theirs sticks out of: only others touch them with their
own."""

RIM = ((1.0, 0.0), (-0.5, 0.75**0.5), (-0.5, -(0.75**0.5)))
"""Cosines and sines of three contact positions on a cylinder's rim, starting at its
deepest one."""

_LEVEL = 1e-12
"""Fraction of a fixed direction added to that of the rim's deepest position, which is
undefined for an upright cylinder."""

SHORT = 1e-3
"""Length (m) of a line of contact below which its second end fades: both ends of a line
without length are one place."""

ROUNDS, ROUNDS_OF_RIM = 4, 7
"""Pairs of steps to the nearest place of a segment, whose height above a convex shape
is convex along it, and of a rim, of which it is not."""

ARC = 0.5
"""Tangent of a quarter of the arc (106 degrees) in which the nearest place of a rim is
looked for."""

_TINY = 1e-12
"""Least length (m) in a quotient."""

Place = tuple[Vec3, Scalar, Vec3]
"""Place of contact (m), penetration (m, negative outside), and normal from the second
shape to the first, world axes."""


@positional
class PlacedShape:
    """Shape with its pose in the world: rotation matrix of its axes and position (m) of
    its origin.
    """

    shape: Surface
    rotation: Mat3
    position: Vec3

    def skin(self, point: Vec3, radius: Scalar) -> tuple[Scalar, Vec3]:
        """Penetration (m) of a ball into the shape, and the outward normal, world
        axes.
        """
        depth, normal = self.shape.skin(
            self.rotation.apply_T(point - self.position), radius
        )
        return depth, self.rotation.apply(normal)

    @property
    def ends(self) -> tuple[Vec3, Vec3]:
        """Ends (m, world axes) of the axis of a capsule or cylinder."""
        half = self.rotation.column(2) * (0.5 * self.shape.size[1])
        return self.position - half, self.position + half

    @property
    def box(self) -> PlacedBox:
        """The same box as one whose edges may touch."""
        x, y, z = (0.5 * each for each in self.shape.size)
        return PlacedBox(self.position, self.rotation, (x, y, z))


def spots_of(a: PlacedShape, downs: Sequence[Vec3] = ()) -> tuple[Spot, ...]:
    """Balls and points with which a shape touches another.

    Args:
        a: the shape.
        downs: of a cylinder, the vector (m) from the middle of either end to the
            deepest point of its rim (:func:`down_of`).
    """
    shape = a.shape
    if shape.shape == "sphere":
        return ((a.position, shape.size[0]),)
    if shape.shape == "capsule":
        return tuple((end, shape.size[0]) for end in a.ends)
    if shape.shape == "hull":
        return tuple(
            (a.position + a.rotation.apply(each), 0) for each in shape.vertices
        )
    if shape.shape == "box":
        halves = [a.rotation.column(i) * (0.5 * shape.size[i]) for i in range(3)]
        return tuple(
            (a.position + halves[0] * x + halves[1] * y + halves[2] * z, 0)
            for x, y, z in product((-1, 1), repeat=3)
        )
    axis = a.rotation.column(2)
    half = axis * (0.5 * shape.size[1])
    rims = [(down, axis.cross(down)) for down in downs]
    return tuple(
        (a.position + half * end + down * cosine + across * sine, 0)
        for end, (down, across) in zip((-1, 1), rims, strict=True)
        for cosine, sine in RIM
    )


def down_of(a: PlacedShape, toward: Vec3) -> Vec3:
    """Vector (m) from the axis of a cylinder to its side, against a normal."""
    axis = a.rotation.column(2)
    # across the axis also by rounding, which a small tilt would enlarge
    way = axis.cross(axis.cross(toward)) + a.rotation.column(0) * _LEVEL
    return way * divide(a.shape.size[0], sqrt(way.dot(way) + _LEVEL**3))


def spot_count(shape: Surface) -> int:
    """Number of balls and points with which a shape touches others."""
    fixed = {"sphere": 1, "capsule": 2, "box": 8, "cylinder": 2 * len(RIM)}
    return fixed.get(shape.shape, len(shape.vertices))


def round_count(one: str, other: str) -> int:
    """Number of places of two shapes of which one is a sphere or a capsule."""
    counts = {"box": 2, "hull": 3, "cylinder": 4}
    if "sphere" in (one, other):
        return 1
    return counts.get(one, counts.get(other, 5))


def places(a: PlacedShape, b: PlacedShape) -> list[Place]:
    """Places at which two shapes may touch, with normals from ``b`` to ``a``."""
    if _comes_second(a.shape.shape, b.shape.shape):
        return opposite(places(b, a))
    if b.shape.shape in HOLLOW:
        return touching(a, b)
    if a.shape.shape in ROUND:
        if a.shape.shape == "capsule" and b.shape.shape == "box":
            # above a face the line has both ends of what is there, else the nearest
            # place: the capsule's ends add nothing
            return _line(a, b, a.shape.size[0], (0.0, 0.0))
        own = touching(a, b)
        if a.shape.shape == "capsule":
            # nothing is counted twice where an end touches as deep
            if b.shape.shape == "capsule":
                own += _other_ends(a, b, own)
            ends = [maximum(depth, 0.0) for _, depth, _ in own]
            low, high = (reduce(maximum, ends[i::2]) for i in range(2))
            own += _line(a, b, a.shape.size[0], (low, high))
        return own
    found = [touching(a, b), opposite(touching(b, a))]
    found += [_side(a, b, found[0]), opposite(_side(b, a, found[1]))]
    if a.shape.shape == b.shape.shape == "box":
        found.append(list(edge_touches(a.box, b.box)))
    return [each for some in found for each in some]


def _other_ends(a: PlacedShape, b: PlacedShape, ours: Sequence[Place]) -> list[Place]:
    """Places at which the ends of the second of two capsules touch the first, but where
    an end of the first touches already.
    """
    found = []
    for place, deep, normal in opposite(touching(b, a)):
        left = deep
        for other, taken, _ in ours:
            way = place - other
            near = 1.0 - sqrt(way.dot(way) + _TINY**2) * divide(1.0, b.shape.size[0])
            left = left - maximum(taken, 0.0) * maximum(near, 0.0)
        found.append((place, left, normal))
    return found


def _comes_second(a: str, b: str) -> bool:
    """True if the second shape of a pair has to be the first: the rounder one is."""
    order = [*ROUND, "box", "cylinder", "hull", *HOLLOW]
    # of two shapes with corners either may be first
    return (b in ROUND or a in HOLLOW) and order.index(b) < order.index(a)


def opposite(found: Sequence[Place]) -> list[Place]:
    """List the same places with normals to the other shape."""
    return [(place, depth, -normal) for place, depth, normal in found]


def touching(a: PlacedShape, b: PlacedShape) -> list[Place]:
    """Places at which balls and points of one shape touch the skin of another."""
    found = []
    for at, radius in spots_of(a, _downs(a, b)):
        depth, normal = b.skin(at, radius)
        found.append((at - normal * radius, depth, normal))
    return found


def _downs(a: PlacedShape, b: PlacedShape) -> tuple[Vec3, ...]:
    """Vectors (m) from the ends of a cylinder to the points of its rims that are
    nearest to another shape.
    """
    if a.shape.shape != "cylinder":
        return ()
    start, way = _axis(a, b)
    share = 0.5 if b.shape.shape in HOLLOW else _nearest_share(b.shape, start, way)
    down = down_of(a, b.rotation.apply(b.shape.skin(start + way * share, _TINY)[1]))
    if b.shape.shape in HOLLOW:
        return down, down
    rim, beside = map(b.rotation.apply_T, (down, a.rotation.column(2).cross(down)))
    ends = (start, start + way)
    return tuple(b.rotation.apply(_nearest_rim(b, e, rim, beside)) for e in ends)


def _nearest_rim(b: PlacedShape, end: Vec3, rim: Vec3, beside: Vec3) -> Vec3:
    """Vector (m) from a cylinder's end to the point of its rim nearest to another
    shape, axes of that.

    Args:
        b: the other shape.
        end: middle of the end, m.
        rim: vector (m) from there to the middle of the arc that is looked at.
        beside: vector (m) to the point of the rim that is square to it.
    """

    def path(share: Scalar) -> tuple[Vec3, Vec3]:
        half = (share + share - 1.0) * ARC
        inverse = divide(1.0, 1.0 + half * half)
        cosine, sine = (1.0 - half * half) * inverse, (half + half) * inverse
        return end + rim * cosine + beside * sine, beside * cosine - rim * sine

    return path(_nearest_on(b.shape, path, ROUNDS_OF_RIM))[0] - end


def _axis(a: PlacedShape, b: PlacedShape) -> tuple[Vec3, Vec3]:
    """Start (m) of the axis of a capsule or cylinder and the way to its end, axes of
    another shape.
    """
    start, end = (b.rotation.apply_T(each - b.position) for each in a.ends)
    return start, end - start


def _side(a: PlacedShape, b: PlacedShape, rims: Sequence[Place]) -> list[Place]:
    """Places at which the side of a cylinder crosses another shape beside its rims."""
    if a.shape.shape != "cylinder":
        return []
    half = len(rims) // 2
    depths = [maximum(depth, 0.0) for _, depth, _ in rims]
    low, high = reduce(maximum, depths[:half]), reduce(maximum, depths[half:])
    return _line(a, b, a.shape.size[0], (low, high))


def _line(
    a: PlacedShape, b: PlacedShape, radius: Scalar, taken: tuple[Scalar, Scalar]
) -> list[Place]:
    """Places at which the axis of a capsule or cylinder is nearest to another shape.

    Above a face of a box or an end of a cylinder they are both ends of the part above
    it, else one place.

    Args:
        a: capsule or cylinder.
        b: the other shape.
        radius: m.
        taken: depth (m) to which the ends at the start and at the end of the axis touch
            already.
    """
    start, way = _axis(a, b)
    length = sqrt(way.dot(way) + _TINY)
    share = _nearest_share(b.shape, start, way)
    most = maximum(*taken)
    ends: Scalars = (share,)
    flat: Scalar = False
    if b.shape.shape in ("box", "cylinder"):
        ends, flat = _above_face(b.shape, start, way, share)
    found = list[Place]()
    fading: Scalar = 0.0
    for each, given in zip(ends, taken, strict=False):
        point = start + way * each
        normal = b.shape.skin(point, _TINY)[1]
        along = normal.dot(way) * divide(1.0, length)
        width, less = radius, maximum(where(flat, given, most), fading)
        if a.shape.shape == "cylinder":
            # a slanted side reaches less far down
            width = radius * sqrt(maximum(1.0 - along * along, _TINY))
        depth, normal = b.shape.skin(point, width)
        if a.shape.shape == "cylinder":
            # no deeper in the side than from its end; beyond that the rim touches
            far = each * length - along * (width - depth)
            depth = minimum(depth, minimum(far, length - far))
        if len(ends) > 1:
            apart = (ends[-1] - ends[0]) * length
            fading = maximum(depth, 0.0) * maximum(1.0 - apart * (1.0 / SHORT), 0.0)
        place = b.position + b.rotation.apply(point - normal * width)
        found.append((place, depth - less, b.rotation.apply(normal)))
    return found


def _nearest_share(shape: Surface, start: Vec3, way: Vec3) -> Scalar:
    """Share of a segment's length at which it is nearest to a convex shape, or deepest
    in it.
    """
    if shape.shape == "sphere":
        return clip(divide(-start.dot(way), way.dot(way) + _TINY**2), 0.0, 1.0)
    return _nearest_on(shape, lambda share: (start + way * share, way), ROUNDS)


_Look = tuple[Scalar, Scalar, Scalar]
"""Share of a path, height (m) of its place above a shape, and its slope (m)."""


def _nearest_on(
    shape: Surface, path: Callable[[Scalar], tuple[Vec3, Vec3]], rounds: int
) -> Scalar:
    """Share of a path at which it is nearest to a convex shape, or deepest in it.

    Args:
        shape: the shape.
        path: place (m, axes of the shape) of a share, and derivative by it.
        rounds: number of pairs of steps.
    """

    def look(share: Scalar) -> _Look:
        place, way = path(share)
        depth, normal = shape.skin(place, _TINY)
        return share, -depth, normal.dot(way)

    low, high = look(0.0), look(1.0)
    for turn in range(2 * rounds):
        # tangents alone may creep from one side where the height is not convex
        share = 0.5 * (low[0] + high[0]) if turn % 2 else _lowest(low, high)
        new = look(share)
        falls = new[2] < 0.0
        low, high = _choose(falls, new, low), _choose(falls, high, new)
    # beside an edge or corner the square of the height is a parabola
    below, above = (height * rise for _, height, rise in (low, high))
    part = divide(-below, maximum(above - below, _TINY**2))
    outside = low[0] + (high[0] - low[0]) * clip(part, 0.0, 1.0)
    return where(minimum(low[1], high[1]) > 0.0, outside, _lowest(low, high))


def _choose(condition: Scalar, new: _Look, old: _Look) -> _Look:
    """One of two places of a path, by a condition."""
    share, height, rise = (where(condition, *e) for e in zip(new, old, strict=True))
    return share, height, rise


def _lowest(low: _Look, high: _Look) -> Scalar:
    """Share at which the tangents of the height in two places meet: the lowest place
    above flat faces.
    """
    width = high[0] - low[0]
    rise = low[1] - high[1] + high[2] * width
    part = divide(rise, maximum((high[2] - low[2]) * width, _TINY**2))
    return low[0] + width * clip(part, 0.0, 1.0)


def _above_face(
    shape: Surface, start: Vec3, way: Vec3, share: Scalar
) -> tuple[tuple[Scalar, Scalar], Scalar]:
    """Shares of a segment's length between which it is above the nearest face of a box,
    or an end of a cylinder, and True.

    Where its nearest place is above no face, twice that place and False.
    """
    nearest = start + way * share
    low: Scalar = 0.0
    high: Scalar = 1.0
    flat: Scalar = True
    # of a cylinder the round face is none
    # not strict: a cylinder has two sizes, and slabs of its own below
    slabs = [*zip(nearest, start, way, shape.size, strict=False)]
    if shape.shape == "cylinder":
        radius, length = shape.size
        slabs = [(nearest.z, start.z, way.z, length)]
        # across the round face it is within the radius
        inverse = divide(1.0, way.x * way.x + way.y * way.y + _TINY**2)
        middle = -(way.x * start.x + way.y * start.y) * inverse
        off = start + way * middle
        square = radius * radius - off.x * off.x - off.y * off.y
        half = sqrt(maximum(square, 0.0) * inverse)
        low, high = maximum(0.0, middle - half), minimum(1.0, middle + half)
        flat = absolute(share - middle) < half
    heights = [absolute(at) - 0.5 * size for at, _, _, size in slabs]
    highest = reduce(maximum, heights)
    for height, (_, at, along, size) in zip(heights, slabs, strict=True):
        # across this face the segment may be where it will
        is_face = height >= highest
        flat = logical_and(flat, logical_or(is_face, height <= 0.0))
        inverse = divide(1.0, where(absolute(along) > _TINY, along, _TINY))
        one, other = (-0.5 * size - at) * inverse, (0.5 * size - at) * inverse
        low = where(is_face, low, maximum(low, minimum(one, other)))
        high = where(is_face, high, minimum(high, maximum(one, other)))
    flat = logical_and(flat, low < high)
    return (where(flat, low, share), where(flat, high, share)), flat
