"""Clearance: signed distances of a vehicle's bodies from obstacles and from each other,
over any scalar.

Bodies are the shapes that a vehicle states as those that touch, else segments and flat
discs, enlarged by a radius. Nearest points follow without branches. Of a first-order
Taylor series they follow from the values alone: where a point slides along its body, a
minimum does not change to first order (envelope theorem).
Source: segments, Ericson 2005, section 5.1.9; overlap with a box, separating axes of
Gottschalk et al. 1996; other convex bodies, Gilbert, Johnson, Keerthi 1988.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from itertools import combinations, product
from typing import TYPE_CHECKING

from skyarm.algebra import E_X, E_Y, E_Z, ZERO3, Mat3, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import (
    absolute,
    clip,
    divide,
    logical_and,
    maximum,
    sign,
    sqrt,
    where,
)
from skyarm.algebra.scalars.taylor import Taylor, nth_derivative
from skyarm.compile.tracing.lower import compiled_once, repeat
from skyarm.dynamics.actuators.tilting import turn_rotors
from skyarm.dynamics.kinematics import IDENTITY, Pose, link_poses
from skyarm.records.coerce import absent, concrete
from skyarm.records.immutable import positional
from skyarm.records.leaves import Record, blend, leaves, rebuild
from skyarm.vehicle import BASE, Vehicle
from skyarm.world.scene.vehicle_shapes import HULL, boom_and_disc, disc_name, rod_ends

if TYPE_CHECKING:
    from skyarm.vehicle.vehicle_records import Collision
    from skyarm.world.contact.surface import Surface

_TINY = 1e-24
"""Squared length (m^2) under a root or in a divisor: a direction without length is zero
instead of NaN."""

_PARALLEL = 1e-12
"""Squared length (m^2) of the part of a segment across an edge below which both are
parallel."""

ROUNDS = 5
"""Secant and bisection steps to the nearest point of a cylinder, between the points
where its faces change: within 0.2 mm for segments of about a metre (1500 drawn)."""


STEPS = 12
"""Steps towards the planes that part two convex bodies. Boxes, hulls and capsules need
10 at most (drawn pairs); cylinders come within 0.1 mm."""

_ASIDE = Vec3(1e-24, 2e-24, 3e-24)
"""Any direction (m), in place of one that is zero or structure."""

_FLAT = 1e-30
"""Square of twice the area (m^4) below which a triangle has no normal."""


Row = tuple[Scalar, tuple[Vec3, ...]]
"""Number by which vectors are chosen, and these."""


@positional
class Volume:
    """Convex hull of points, flat disc or cylinder, enlarged by a radius: a capsule, a
    disc with a round rim, a box.

    Attributes:
        body: link of the vehicle, or BASE. points: the ends of a segment, corners, or
            the middle of a disc or sphere, m.
        radius: enlargement, m. disc: radius of the disc, m; int 0 without one. axis:
            unit vector across it.
        half: half the length of a cylinder, m; int 0 of a flat disc.
    """

    name: str
    body: int
    points: tuple[Vec3, ...]
    radius: Scalar
    disc: Scalar = 0
    axis: Vec3 = ZERO3
    half: Scalar = 0

    def transform(self, pose: Pose) -> Volume:
        """Volume in the axes to which a pose leads."""
        return replace(
            self,
            points=tuple(map(pose.apply, self.points)),
            axis=pose.R.apply(self.axis),
        )


@positional
class Pair:
    """Volume of a vehicle and what it may meet.

    Attributes:
        volume, other: names. surface: the obstacle; None for another volume of the
            vehicle.
        rest: distance (m) of two volumes at rest, where it varies: a pair that touches
            there is infinitely far apart.
    """

    volume: str
    other: str
    surface: Surface | None = None
    rest: Scalar = 0.0


@positional
class Clearances:
    """Pairs of bodies whose distances count, and these as a function of the state;
    fewer pairs are as good.
    """

    vehicle: Vehicle
    pairs: tuple[Pair, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each pair, as "link/forearm/tip and surface 'wall'"."""
        return tuple(
            f"{pair.volume} and"
            f" {pair.other if pair.surface is None else f'surface {pair.other!r}'}"
            for pair in self.pairs
        )

    def distances(
        self,
        position: Vec3,
        rotation: Mat3,
        joints: Sequence[Scalar],
        tilts: Sequence[Scalar] = (),
        time: Scalar = 0.0,
    ) -> Scalars:
        """Signed distance (m) of each pair: minus the depth of penetration where bodies
        overlap.

        That of a disc from a box or cylinder is a lower bound, exact above a face. In a
        cylinder the depth is that of the deepest point of the segment. A plate with a
        hole counts as filled. First derivatives are exact, higher ones too but at
        cylinders and discs.

        Args:
            position: of the base, m, world axes.
            rotation: R_WB.
            joints: rad or m.
            tilts: angles of the tilting rotors, rad; none for rotors at rest.
            time: of moving surfaces, s.
        """
        poses = link_poses(self.vehicle, joints, summed=True)
        turned = turn_rotors(self.vehicle, tilts) if tilts else self.vehicle
        own = {
            each.name: each.transform(
                IDENTITY if each.body == BASE else poses[each.body]
            )
            for each in volumes(turned)
        }
        base = Pose(rotation, position)
        rows = []
        outside = {
            pair.volume: own[pair.volume].transform(base)
            for pair in self.pairs
            if pair.surface is not None
        }
        for pair in self.pairs:
            if pair.surface is not None:
                rows.append(surface_distance(outside[pair.volume], pair.surface, time))
            else:
                row = pair_distance(own[pair.volume], own[pair.other])
                # pairs that touch at rest never count: in a batch each lane decides
                rows.append(
                    row
                    if concrete(pair.rest)
                    else where(pair.rest < 0.0, math.inf, row)
                )
        return tuple(rows)


def clearances(
    vehicle: Vehicle, obstacles: Iterable[Surface] = (), touching: Collection[int] = ()
) -> Clearances:
    """Pairs of a vehicle's volumes with obstacles, and with each other.

    Pairs of one body, and those that touch with all joints at zero or at the nearest
    limit, are left out.

    Args:
        vehicle: any vehicle.
        obstacles: surfaces.
        touching: bodies (BASE or index of a link) whose rods may touch obstacles, since
            they bear contact points.
    """
    every = volumes(vehicle)
    free = [
        each.name
        for each in every
        if not (each.body in touching and each.name.startswith(("base/", "link/")))
    ]
    pairs = [
        Pair(name, surface.name, surface)
        for surface in obstacles
        # a heightfield touches on MuJoCo's plant alone, and has no distance here
        if surface.shape != "heightfield"
        for name in free
    ]
    inner = []
    for i, b in enumerate(every):
        inner += [Pair(b.name, a.name) for a in every[:i] if a.body != b.body]
    rest = [clip(0.0, joint.lower, joint.upper) for joint in vehicle.joints]
    apart = Clearances(vehicle, tuple(inner)).distances(ZERO3, Mat3.identity(), rest)
    measured = zip(inner, apart, strict=True)
    pairs += [
        replace(pair, rest=gap)
        for pair, gap in measured
        if not (concrete(gap) and gap < 0.0)
    ]
    return Clearances(vehicle, tuple(pairs))


def volumes(vehicle: Vehicle) -> list[Volume]:
    """Volumes of a vehicle at rest, each in the axes of its body.

    They are the shapes that touch and the rotors' discs; of a vehicle that states no
    shapes those that draw it.
    """
    reach, discs = boom_and_disc(vehicle)
    wide, flat = HULL
    made = [Volume("hull", BASE, (ZERO3,), flat * reach, (wide - flat) * reach, E_Z)]
    for rotor in vehicle.rotors:
        hub = rotor.position
        # as thick as they are drawn
        rim = 0.01 * reach
        made.append(Volume(f"boom/{rotor.name}", BASE, (ZERO3, hub), 0.03 * reach))
        made.append(
            Volume(disc_name(rotor.name), BASE, (hub,), rim, discs - rim, rotor.axis)
        )
    names = ["base", *(f"link/{link.name}" for link in vehicle.moving)]
    if vehicle.collisions:
        # every second one is a disc
        made = made[2::2]
    for body, name in enumerate(() if vehicle.collisions else names, BASE):
        made += [
            # as thick as they are drawn
            Volume(f"{name}/{to}", body, (ZERO3, end), 0.04 * reach)
            for to, end in rod_ends(vehicle, body)
        ]
    return made + [
        replace(
            solid_of(each, Pose(each.rotation, each.position)),
            name=f"{names[each.link - BASE]}/{each.name}",
            body=each.link,
        )
        for each in vehicle.shapes
    ]


def solid_of(each: Collision | Surface, pose: Pose) -> Volume:
    """Volume of a bounded shape in the axes to which a pose leads."""
    size, at, axis = each.size, pose.p, pose.R.column(2)
    if each.shape in ("box", "hull"):
        ends = each.vertices or product(*((-0.5 * edge, 0.5 * edge) for edge in size))
        return Volume("", BASE, tuple(pose.apply(Vec3(*end)) for end in ends), 0)
    half = 0.5 * size[-1]
    if each.shape == "capsule":
        return Volume("", BASE, (at - axis * half, at + axis * half), size[0])
    if each.shape == "sphere":
        return Volume("", BASE, (at,), size[0])
    # the origin of a hole is in its mouth
    middle = at if each.shape == "cylinder" else at - axis * half
    return Volume("", BASE, (middle,), 0, size[-2], axis, half)


def pair_distance(a: Volume, b: Volume) -> Scalar:
    """Signed distance (m) of two volumes in one frame.

    If one is a box or hull or both are discs it is exact where they are apart, of discs
    within 0.3 mm. Where they overlap it is minus the least thickness that was found of
    what they share, never less than the depth.
    """
    if len(a.points + b.points) > 4 or not (absent(a.disc) or absent(b.disc)):
        # pairs with other names and radii share the code
        pair = tuple(replace(each, name="", body=BASE, radius=0) for each in (a, b))
        n, *ways = compiled_once("directions", _directions, _values(pair))
        gap, square = _vector_between(a, b, n).dot(n), _from_origin(a, b, ways)[0]
        return where(gap > 0.0, sqrt(square + _TINY), gap) - (a.radius + b.radius)
    # the formula below takes the disc second
    if not absent(a.disc):
        return pair_distance(b, a)
    way = a.points[-1] - a.points[0]
    other = b.points[-1] - b.points[0]
    middle = b.points[0]
    # as values: where the nearest points lie changes nothing to first order
    start, along = _values(a.points[0] - middle), _values(way)
    if absent(b.disc):
        s, t = _nearest_shares(start, along, _values(other))
        apart = (a.points[0] + way * s) - (middle + other * t)
        return apart.smooth_norm() - (a.radius + b.radius)
    record = start, along, _values(b.axis), b.disc, b.half
    s = (
        0
        if len(a.points) == 1
        else compiled_once("nearest to cylinder", _nearest_to_cylinder, record)
    )
    return _above_cylinder(a.points[0] + way * s - middle, b) - (a.radius + b.radius)


def surface_distance(each: Volume, surface: Surface, time: Scalar) -> Scalar:
    """Signed distance (m) of a volume in world axes from a surface."""
    R = surface.rotation
    at = surface.place(time)[0]
    first, last = each.points[0], each.points[-1]
    thick = len(each.points) > 2 or not absent(each.half)
    if thick and surface.shape == "plane":
        up = R.column(2)
        gap: Scalar = (_farthest(each, -up) - at).dot(up)
        return gap
    disc = not absent(each.disc)
    bounds = ("plane", "box", "cylinder", "hole") if disc else ("plane", "box")
    if thick or surface.shape not in bounds:
        return pair_distance(each, solid_of(surface, Pose(R, at)))
    if disc:
        return surface.clearance(first, each.axis, each.disc, time) - each.radius
    start, way = R.apply_T(first - at), R.apply_T(last - first)
    if surface.shape == "plane":
        # the lower end, since a plane is nearest to an end of a segment
        return (start + way * where(_values(way).z > 0.0, 0.0, 1.0)).z - each.radius
    return (
        _from_box(tuple(0.5 * edge for edge in surface.size), start, way) - each.radius
    )


def _values(record: Record) -> Record:
    """Values of first-order series; other scalars are returned unchanged."""
    return rebuild(
        record,
        (
            nth_derivative(c, 0) if type(c) is Taylor and len(c.c) == 2 else c
            for c in leaves(record)
        ),
    )


def _share(part: Scalar, whole: Scalar) -> Scalar:
    """Ratio of two numbers, limited to 0 ... 1; the second is not negative."""
    return clip(divide(part, whole + _TINY), 0.0, 1.0)


def _nearest_shares(apart: Vec3, d: Vec3, e: Vec3) -> tuple[Scalar, Scalar]:
    """Shares of the lengths of segments ``d`` and ``e`` at their nearest points;
    ``apart`` from e's start to d's.
    """
    a, b, c, f, g = d.dot(d), d.dot(e), e.dot(e), d.dot(apart), e.dot(apart)
    # of parallel segments any share will do: the other two steps mend it
    s = _share(b * g - c * f, a * c - b * b)
    t = _share(b * s + g, c)
    return _share(b * t - f, a), t


def _least(
    slope: Callable[[Scalar], Scalar], breaks: Sequence[Scalar], rounds: int = 0
) -> Scalar:
    """Share of a segment at which a convex function is least; exact if its slope is
    linear between ``breaks``.
    """
    lo: Scalar = 0.0
    hi: Scalar = 1.0
    below, above = slope(lo), slope(hi)

    def narrow(t: Scalar) -> None:
        nonlocal lo, hi, below, above
        rise = slope(t)
        left, right = logical_and(rise <= 0.0, t > lo), logical_and(rise > 0.0, t < hi)
        lo, below = where(left, t, lo), where(left, rise, below)
        hi, above = where(right, t, hi), where(right, rise, above)

    def secant() -> Scalar:
        return clip(
            lo - divide(below * (hi - lo), maximum(above - below, _TINY)), lo, hi
        )

    for t in breaks:
        narrow(clip(t, 0.0, 1.0))
    # bisection after each secant: a secant alone may creep from one side
    for _ in range(rounds):
        narrow(secant())
        narrow(0.5 * (lo + hi))
    return secant()


def _crossings(start: Scalar, way: Scalar, half: Scalar) -> list[Scalar]:
    """Shares of a length at which a coordinate is at either end of -half ... half."""
    # parallel to a face it is far off; clipped, it is an end of the length
    inverse = divide(1.0, where(absolute(way) > 1e-12, way, 1e-12))
    return [(half - start) * inverse, (-half - start) * inverse]


def _outside_box(p: Vec3, half: Sequence[Scalar]) -> Vec3:
    """Vector (m) from the nearest point of a box in its middle to a point; zero
    inside.
    """
    return Vec3(*(c - clip(c, -h, h) for c, h in zip(p, half, strict=True)))


def _from_box(half: Scalars, start: Vec3, way: Vec3) -> Scalar:
    """Signed distance (m) of a segment from a box in its middle."""
    # from values alone: where the nearest point lies changes nothing to first order
    record = _values(start), _values(way), half
    free, share, normal, inside = compiled_once(
        "nearest to box", _nearest_to_box, record
    )
    point = start + way * share
    apart = _outside_box(point, half)
    return where(free > 0.0, apart.smooth_norm(), normal.dot(point) - inside)


def _nearest_to_box(
    record: tuple[Vec3, Vec3, Scalars],
) -> tuple[Scalar, Scalar, Vec3, Scalar]:
    """Squared distance of a segment from a box, share of its length there; normal of
    the shortest way out, and its end.

    Where the segment is inside, the share is that of the deepest point along that
    normal.
    """
    a, d, half = record
    breaks = [
        t for s, w, h in zip(a, d, half, strict=True) for t in _crossings(s, w, h)
    ]
    share = _least(lambda t: _outside_box(a + d * t, half).dot(d), breaks)
    apart = _outside_box(a + d * share, half)
    square = apart.dot(apart)
    free = where(square > _TINY, square, 0.0)
    # ways out: along the normal of a face, or across an edge and the segment
    # height, share, end of the way, normal
    best: Scalars = (-math.inf, *(0.0,) * 5)
    for face, along in zip((E_X, E_Y, E_Z), d, strict=True):
        across = d - face * along
        length = across.dot(across)
        edge = face.cross(d) * divide(1.0, sqrt(length + _TINY))
        for axis, usable in ((face, True), (edge, length > _PARALLEL)):
            n = axis * where(axis.dot(a + d * 0.5) < 0.0, -1.0, 1.0)
            corner = Vec3(
                *(where(c > 0.0, h, -h) for c, h in zip(n, half, strict=True))
            )
            t = (
                where(n.dot(d) > 0.0, 0.0, 1.0)
                if axis is face
                else _share((corner - a).dot(across), length)
            )
            height = n.dot(a + d * t) - n.dot(corner)
            better = logical_and(usable, height > best[0])
            way = (height, t, n.dot(corner), *n)
            best = tuple(where(better, x, y) for x, y in zip(way, best, strict=True))
    return free, where(free > 0.0, share, best[1]), Vec3(*best[3:]), best[2]


def _first(rows: Iterable[Row]) -> Row:
    """Row with the least number; of equal ones the earliest."""
    best, *others = rows
    for row in others:
        best = blend(row[0] < best[0], row, best)
    return best


def _farthest(each: Volume, n: Vec3) -> Vec3:
    """Farthest point (m) of a volume without its radius along a unit vector."""
    points = (point + _ASIDE for point in each.points)
    _, (end,) = _first((-point.dot(n), (point,)) for point in points)
    if absent(each.disc):
        return end
    along: Scalar = each.axis.dot(n)
    across = n - each.axis * along
    rim = across * divide(each.disc, across.smooth_norm())
    return end + rim + each.axis * (sign(along) * each.half)


def _vector_between(a: Volume, b: Volume, n: Vec3) -> Vec3:
    """Vector (m) from the last point of a volume along a unit vector to the first one
    of another.
    """
    return _farthest(b, -n) - _farthest(a, n)


def _directions(pair: tuple[Volume, ...]) -> tuple[Vec3, ...]:
    """Unit normal of the planes that part two volumes, and three directions whose
    outermost points surround the nearest ones.

    Differences of their points fill a convex body. A triangle in it comes closer to the
    origin with the body's farthest point in that direction as a new corner.
    """
    a, b = pair

    def step(state: tuple[Row, Row]) -> tuple[Row, Row]:
        (_, (n, *ways)), best = state
        n = n * divide(1.0, n.norm())
        # of overlapping volumes the nearer skin is behind
        gap, behind = (_vector_between(a, b, way).dot(way) for way in (n, -n))
        rows = [_from_origin(a, b, (n, *edge)) for edge in combinations(ways, 2)]
        return _first(rows), _first([best, (-gap, (n,)), (-behind, (-n,))])

    worst: Row = math.inf, (_ASIDE,)
    start = _from_origin(a, b, (_ASIDE,) * 3), worst
    (_, (_, *ways)), (_, best) = repeat(STEPS, step, start)
    return *best, *ways


def _from_origin(a: Volume, b: Volume, ways: Sequence[Vec3]) -> Row:
    """Squared distance of a triangle from the origin, direction of its nearest point,
    and directions of its corners.

    A corner is the vector from one volume to another between their outermost points
    along one of ``ways``.
    """
    p, q, r = (_vector_between(a, b, way) for way in ways)
    normal = (q - p).cross(r - p)
    square = normal.dot(normal)
    foot = normal * divide(p.dot(normal), square + _FLAT)
    inside = square > _FLAT
    rows: list[Row] = []
    for start, end in ((p, q), (q, r), (r, p)):
        way = end - start
        point = start + way * _share(-start.dot(way), way.dot(way))
        rows.append((point.dot(point), (point,)))
        inside = logical_and(inside, start.cross(end).dot(normal) > 0.0)
    rows.append((where(inside, foot.dot(foot), math.inf), (foot,)))
    apart, (nearest,) = _first(rows)
    # at the origin the normal is left, or any direction of a triangle without area
    return apart, (nearest + normal * 1e-12 + _ASIDE, *ways)


def _above_cylinder(point: Vec3, disc: Volume) -> Scalar:
    """Signed distance (m) of a point from a cylinder or flat disc, from whose middle it
    is given.
    """
    along = disc.axis.dot(point)
    across = point - disc.axis * along
    side = across.smooth_norm() - disc.disc
    end = absolute(along) - disc.half
    out, up, height = maximum(side, 0.0), maximum(end, 0.0), maximum(side, end)
    outside = sqrt(out * out + up * up + _TINY)
    # a flat disc has no inside
    return outside if absent(disc.half) else where(height > 0.0, outside, height)


def _nearest_to_cylinder(record: tuple[Vec3, Vec3, Vec3, Scalar, Scalar]) -> Scalar:
    """Share of a segment's length at which it is nearest to a cylinder in its middle,
    or deepest inside.
    """
    start, way, axis, radius, half = record
    along, climb = axis.dot(start), axis.dot(way)
    across, drift = start - axis * along, way - axis * climb
    a, b, c = drift.dot(drift), across.dot(drift), across.dot(across)

    def slope(t: Scalar) -> Scalar:
        away = sqrt(maximum(c + t * (2.0 * b + a * t), 0.0) + _TINY)
        turn = b + a * t
        z = along + climb * t
        side = away - radius
        end = absolute(z) - half
        rise: Scalar = (
            divide(maximum(side, 0.0), away) * turn + (z - clip(z, -half, half)) * climb
        )
        if absent(half):
            return rise
        # inside the nearest face counts, of which the sign alone is used
        inward = where(side > end, divide(turn, away), sign(z) * climb)
        return where(maximum(side, end) > 0.0, rise, inward)

    root = sqrt(maximum(b * b - a * (c - radius * radius), 0.0) + _TINY)
    # a ring without height has one crossing with its plane, not two
    breaks = [
        *_crossings(along, climb, half)[absent(half) :],
        *(divide(each - b, a + _TINY) for each in (root, -root)),
    ]
    return _least(slope, breaks, ROUNDS)
