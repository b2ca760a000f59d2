"""Surfaces, at rest or moving: plane, box, cylinder, sphere, capsule, convex hull,
plate with a hole, heightfield.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field
from functools import reduce
from typing import Annotated

import numpy as np

from skyarm.algebra import (
    E_X,
    E_Y,
    E_Z,
    ZERO3,
    Mat3,
    Scalar,
    Scalars,
    Vec3,
    axis_rotation,
)
from skyarm.algebra.scalars import (
    absolute,
    add,
    clip,
    divide,
    logical_and,
    logical_not,
    maximum,
    mul,
    neg,
    same,
    sign,
    sqrt,
    sub,
    where,
)
from skyarm.algebra.vector import select
from skyarm.compile.tracing.lower import compiled_once
from skyarm.records import coerce
from skyarm.records.arrays import Array
from skyarm.records.coerce import RecordError, absent, concrete
from skyarm.records.field_rules import accept_fields
from skyarm.records.files import errors_as, shown
from skyarm.records.immutable import derived_field, field_if_any, immutable
from skyarm.records.units import Unit, positive
from skyarm.reference.signals import Constant
from skyarm.reference.tip_motion import vector_derivatives
from skyarm.vehicle.convex_hull import Triangles, complete_shape
from skyarm.world.contact.material import Material
from skyarm.world.signal_vector import NO_SIGNALS, SignalVector

SIZES = ("radius", "depth", "chamfer", "outer radius", "length")
"""Lengths (m) of a plate with a hole: radius of the hole, its depth, width of its
chamfer of 45 degrees; outer radius of the plate, its length along z."""


SHAPES = {
    "plane": (),
    "box": ("x", "y", "z"),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
    "hole": SIZES,
    "capsule": ("radius", "length"),
    "hull": (),
    "heightfield": ("x", "y", "height", "base"),
}
"""Shape -> names of its sizes (m). The outside of a plane is along its z axis, which is
also the axis of cylinder, hole and capsule; the length of a capsule is that between the
centres of its ends. A heightfield has points 0000 in the plane of its origin, and below
it a base."""

AWAY = 1e6
"""Distance (m) of every point from a heightfield in our own equations, which do not
touch it: the plant does."""


_CENTRE = 1e-24
"""Squared length (m^2) under a root: the normal in the middle of a sphere, on an axis
or at a corner is zero instead of NaN."""


Corners = Annotated[tuple[Vec3, ...], Unit("m", "corners of a hull, its own axes")]

Spot = tuple[Vec3, Scalar]
"""Ball that may touch: middle (m, world axes) and radius (m; an int 0 of a point)."""

Face = tuple[Scalar, Vec3]
"""Height of a point above a face (m, negative inside) and the face's outward normal,
axes of the surface."""


@immutable
class Surface:
    """Contact surface: a shape such as a plane or box with its pose, motion and
    material.

    Attributes:
        name: name in messages, logs and pictures. shape: one of ``SHAPES``.
        size: lengths of a box along its axes, radius and length of a cylinder or
            capsule, radius of a sphere; none of a plane or hull; of a plate with a hole
            those of :mod:`skyarm.world.contact.surface`.
        vertices: corners of a hull, m, its axes.
        faces: triangles of the hull's skin as numbers of vertices, counter-clockwise
            seen from outside; found if left out.
        motion: displacement that is added to the position as time goes on, m, world
            axes. It must have a velocity: a step is passed without one.
        mesh: path of an STL file (m, axes of the surface) that it is drawn as; nothing
            touches that.
    """

    name: Annotated[
        str,
        Unit(
            "", "name of the surface, for messages, logs and pictures", rule=coerce.name
        ),
    ]
    shape: Annotated[
        str, Unit("", "shape of the surface", rule=coerce.word_of(SHAPES))
    ] = "plane"
    size: Annotated[
        Scalars,
        positive(
            "m",
            "lengths of the shape: edges of a box, radius and length of a cylinder,"
            " radius of a ball",
        ),
    ] = ()
    position: Annotated[
        Vec3,
        Unit(
            "m",
            "position of the middle, of a point of a plane, or of a hole's mouth, world"
            " axes",
            folds=True,
        ),
    ] = ZERO3
    angles: Annotated[
        Vec3,
        Unit(
            "rad", "roll, pitch, yaw: about x, then y, then z of the world", folds=True
        ),
    ] = ZERO3
    motion: SignalVector = NO_SIGNALS
    material: Material = field(default_factory=Material)
    mesh: str = field_if_any(default="")
    vertices: Corners = field_if_any(default=())
    heights: Annotated[
        tuple[str, ...],
        Unit(
            "",
            "rows of a heightfield along x, from the least y: four hexadecimal digits"
            " a point, from 0000 up to the height ffff",
        ),
    ] = field_if_any(default=())
    faces: Triangles = derived_field()

    def __post_init__(self) -> None:
        accept_fields(self, "surface")
        coerce.fold_zeros(self, "position", "angles")
        complete_shape("surface", self, RecordError, SHAPES)
        # a plane is drawn where the vehicle is, so that a mesh would move along with it
        if self.mesh and self.shape in ("plane", "hole"):
            raise RecordError(
                f"surface.mesh = {shown(self.mesh)}: must be left out of a {self.shape}"
            )
        if self.shape == "hole":
            require_hole(self.size)
        if (self.shape == "heightfield") != bool(self.heights):
            raise RecordError("surface.heights: must be those of a heightfield alone")
        if self.heights:
            with errors_as(RecordError, "surface.heights: "):
                heights_of(self.heights)

    @property
    def moves(self) -> bool:
        """True if the surface has a prescribed motion."""
        return any(
            type(each) is not Constant or not absent(each.value)
            for each in self.motion.signals
        )

    @property
    def rotation(self) -> Mat3:
        """Rotation matrix R_WS from the surface's axes to world axes."""
        return rotation_of(self.angles)

    @property
    def farthest(self) -> Scalar:
        """Largest distance (m) of the surface from its own origin; only for shapes of
        finite size.
        """
        if self.shape == "sphere":
            return self.size[0]
        if self.shape == "box":
            x, y, z = self.size
            return 0.5 * sqrt(x * x + y * y + z * z)
        if self.shape == "hole":
            outer, length = self.size[3:]
            return sqrt(outer * outer + length * length)
        if self.shape == "heightfield":
            x, y, *ends = self.size
            # a bound without a root: half both sides is more than half the diagonal
            return 0.5 * (x + y) + maximum(*ends)
        if self.shape == "hull":
            return sqrt(reduce(maximum, [each.dot(each) for each in self.vertices]))
        radius, length = self.size
        if self.shape == "capsule":
            return radius + 0.5 * length
        return sqrt(radius * radius + 0.25 * length * length)

    def place(self, t: Scalar) -> tuple[Vec3, Vec3]:
        """Position (m) and velocity (m/s) of the surface at time t (s), world axes."""
        if not self.moves:
            return self.position, ZERO3
        way, velocity, *_ = vector_derivatives(self.motion.signals, t)
        return self.position + way, velocity

    def _faces(self, p: Vec3) -> tuple[Face, ...]:
        """Height of a point above each relevant face of the shape, with the face's
        outward normal.
        """
        if self.shape == "plane":
            return ((p.z, E_Z),)
        if self.shape == "heightfield":
            return ((AWAY, E_Z),)
        if self.shape in ("sphere", "capsule"):
            if self.shape == "capsule":
                half = 0.5 * self.size[1]
                p = Vec3(p.x, p.y, p.z - clip(p.z, -half, half))
            away = p.smooth_norm()
            return ((away - self.size[0], p * divide(1.0, away)),)
        if self.shape == "hull":
            return self._above(p, self.vertices)
        # for a rotor's disc a hole is as if it were filled
        if self.shape in ("hole", "cylinder"):
            outer, length = self.size[-2:]
            away = sqrt(p.x * p.x + p.y * p.y + _CENTRE)
            round_about = Vec3(divide(p.x, away), divide(p.y, away), 0)
            side = (away - outer, round_about)
            return (
                side,
                _slab(p.z + 0.5 * length if self.shape == "hole" else p.z, length, E_Z),
            )
        return tuple(
            _slab(c, size, axis)
            for c, size, axis in zip(p, self.size, (E_X, E_Y, E_Z), strict=True)
        )

    def depth(self, point_W: Vec3, radius: Scalar, t: Scalar) -> Face:
        """Penetration depth of a ball (m, negative outside) and outward normal of the
        surface, world axes.

        Inside it is the nearest face that counts; of a ball that touches an edge or a
        corner from outside, the way to its middle; of a plate with a hole always the
        nearest place.

        Args:
            point_W: middle of the ball, m, world axes.
            radius: radius of the ball, m; an int of 0 is a point.
            t: s.
        """
        R = self.rotation
        depth, normal = self.skin(R.apply_T(point_W - self.place(t)[0]), radius)
        return depth, R.apply(normal)

    def skin(self, p: Vec3, radius: Scalar) -> Face:
        """Penetration depth and outward normal as :meth:`depth`, all in the axes of the
        surface.
        """
        if self.shape == "hole":
            height, normal = from_plate(self.size, p)
            return radius - height, normal
        if self.shape == "hull" and not absent(radius):
            height, normal = compiled_once(
                ("hull", self.faces), self._from_hull, (p, self.vertices)
            )
            return radius - height, normal
        faces = self._faces(p)
        height, normal = _nearest(faces)
        # a point inside counts to the nearest face, outside it has no force
        if len(faces) > 1 and not absent(radius):
            height, normal = _nearest_edge(faces, height, normal)
        return radius - height, normal

    def _from_hull(self, record: tuple[Vec3, tuple[Vec3, ...]]) -> Face:
        """Signed distance (m) of a point from a hull, and outward normal there."""
        p, corners = record
        faces = self._above(p, corners)
        height, normal = _nearest(faces)
        nearest: Face = math.inf, ZERO3
        for (above, n), face in zip(faces, self.faces, strict=True):
            over = above >= 0.0
            for i, j in ((0, 1), (1, 2), (2, 0)):
                start, way = corners[face[i]], corners[face[j]] - corners[face[i]]
                off = p - start
                # left of every edge a point is above the face itself
                over = logical_and(over, n.cross(way).dot(off) >= 0.0)
                share = clip(divide(off.dot(way), way.dot(way)), 0.0, 1.0)
                apart = off - way * share
                other = apart.dot(apart), apart
                nearest = _choose(other[0] < nearest[0], other, nearest)
            other = above * above, n * above
            nearest = _choose(logical_and(over, other[0] < nearest[0]), other, nearest)
        away = sqrt(nearest[0] + _CENTRE)
        outside = logical_and(height > 0.0, away > OUTSIDE)
        way = nearest[1] * divide(1.0, away)
        return _choose(outside, (away, way), (height, normal))

    def _above(self, p: Vec3, corners: Sequence[Vec3]) -> tuple[Face, ...]:
        """Height of a point above each face of a hull, and the face's outward
        normal.
        """
        rows = []
        for a, b, c in ([corners[i] for i in face] for face in self.faces):
            across = (b - a).cross(c - a)
            n = across * divide(1.0, sqrt(across.dot(across) + _CENTRE**2))
            rows.append(((p - a).dot(n), n))
        return tuple(rows)

    def clearance(
        self, centre_W: Vec3, axis_W: Vec3, radius: Scalar, t: Scalar
    ) -> Scalar:
        """Distance (m) between a disc, such as a rotor, and the surface; negative if
        they may touch.

        A plane between both is looked for among the faces and across the way from the
        disc's middle to the nearest point of the surface: what one of them parts, does
        not touch. Next to a corner the disc may still be some millimetres away where
        none does.

        Args:
            centre_W: middle of the disc, m, world axes.
            axis_W: unit vector across it, world axes.
            radius: radius of the disc, m; an int of 0 is a point.
            t: s.
        """
        R = self.rotation
        axis = R.apply_T(axis_W)
        faces = self._faces(R.apply_T(centre_W - self.place(t)[0]))
        planes = (
            [*faces, _nearest_edge(faces, *_nearest(faces))]
            if len(faces) > 1
            else faces
        )
        return reduce(
            maximum,
            [height - _half_width(axis, normal, radius) for height, normal in planes],
        )


def heights_of(rows: Sequence[str]) -> Array:
    """Heights of a heightfield (rows, columns), from 0 to 1, of rows of digits.

    Raises:
        ValueError: one line: rows that are no grid of four digits a point.
    """
    try:
        # big-endian: digits in the order in which they are read
        lines = [np.frombuffer(bytes.fromhex(row), ">u2") for row in rows]
        grid = np.array(lines) / float(HIGHEST)
    except ValueError:
        # no grid: refused below, in one message for all
        grid = np.zeros(0)
    if grid.ndim != 2 or min(grid.shape) < 2:
        raise ValueError(
            "must be two or more rows of equally many points, two or more of four"
            " hexadecimal digits each"
        )
    return grid


def rows_of(heights: Array) -> tuple[str, ...]:
    """Rows of digits of heights (rows, columns), from 0 to 1."""
    numbers = np.rint(heights * HIGHEST).astype(">u2")
    return tuple(row.tobytes().hex() for row in numbers)


HIGHEST = 0xFFFF
"""Largest number of four digits."""

OUTSIDE = 1e-9
"""Distance (m) from a hull up to which the normal of its nearest face is taken: that of
the way to it has lost its digits."""


def rotation_of(angles: Vec3) -> Mat3:
    """Rotation matrix of roll, pitch and yaw (rad) about fixed x, y and z axes, in this
    order.
    """
    R = Mat3.identity()
    for axis, angle in zip((E_X, E_Y, E_Z), angles, strict=True):
        if not absent(angle):
            R = axis_rotation(axis, angle) @ R
    return R


def _half_width(axis: Vec3, normal: Vec3, radius: Scalar) -> Scalar:
    """Half the extent (m) of a disc along a unit vector."""
    if absent(radius):
        return 0
    along = axis.dot(normal)
    return radius * sqrt(maximum(1.0 - along * along, 0.0) + _CENTRE)


def _nearest(faces: tuple[Face, ...]) -> Face:
    """Nearest face of a convex body to a point: height of the point above it, and
    outward normal.
    """
    height, normal = faces[0]
    for above, axis in faces[1:]:
        height, normal = _choose(above > height, (above, axis), (height, normal))
    return height, normal


def _slab(c: Scalar, size: Scalar, axis: Vec3) -> Face:
    """Nearer of two opposite parallel faces to a point: height of the point above it,
    and outward normal.
    """
    # the nearer of two opposite faces is on the side of the point
    return absolute(c) - 0.5 * size, axis * sign(c)


def _choose(condition: Scalar, new: Face, old: Face) -> Face:
    """One of two faces, by a condition."""
    return where(condition, new[0], old[0]), select(condition, new[1], old[1])


def _nearest_edge(faces: tuple[Face, ...], height: Scalar, normal: Vec3) -> Face:
    """Distance (m) and direction from the nearest face, edge or corner of a convex body
    to a point.
    """
    outside = [maximum(above, 0.0) for above, _ in faces]
    away = sqrt(sum(each * each for each in outside) + _CENTRE)
    way = ZERO3
    for each, (_, axis) in zip(outside, faces, strict=True):
        way = way + axis * divide(each, away)
    return _choose(height > 0.0, (away, way), (height, normal))


SHORTEST = 1e-6
"""Shortest length (m) of a hole; a smaller number is probably in another unit."""


def require_hole(size: Sequence[Scalar]) -> None:
    """Refuse dimensions of a hole that leave no material around it."""
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


def from_plate(size: Sequence[Scalar], p: Vec3) -> Face:
    """Signed distance (m) of a point from a plate with a hole, and the outward normal
    at the nearest point.

    Args:
        size: lengths as listed in ``SIZES``.
        p: the point, m; the origin is in the middle of the hole's mouth, z leads out of
            it.
    """
    radius, depth, chamfer, outer, length = size
    away = sqrt(p.x * p.x + p.y * p.y + _CENTRE)
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
    nearest = _to_edge(away, p.z, *edges[0])
    for start, way in edges[1:]:
        other = _to_edge(away, p.z, start, way)
        nearer = other[0] < nearest[0]
        nearest = tuple(
            a if same(a, b) else where(nearer, a, b)
            for a, b in zip(other, nearest, strict=True)
        )
    square, along, up, edge_along, edge_up = nearest
    distance = sqrt(square)
    sign = where(outside, 1.0, -1.0)
    # on the skin the way to it has no direction, the edge has
    close = square < _CENTRE
    n, z = (
        where(close, edge, divide(way, distance + _CENTRE) * sign)
        for way, edge in ((along, edge_along), (up, edge_up))
    )
    return sign * distance, Vec3(n * divide(p.x, away), n * divide(p.y, away), z)


def _outside(size: Sequence[Scalar], away: Scalar, z: Scalar) -> Scalar:
    """True if a point of the plate's cross-section is outside the material."""
    radius, depth, chamfer, outer, length = size
    beyond = maximum(maximum(away - outer, z), -length - z) > 0.0
    hollow = logical_and(z > -depth, away < radius + maximum(z + chamfer, 0.0))
    return logical_not(logical_and(logical_not(beyond), logical_not(hollow)))


def _to_edge(
    away: Scalar, z: Scalar, start: tuple[Scalar, Scalar], way: tuple[Scalar, Scalar]
) -> Scalars:
    """Squared distance and offset of a point from an edge of a plate's cross-section,
    and outward normal of the edge.

    The material is on the right of an edge, seen along it.
    """
    x, y = sub(away, start[0]), sub(z, start[1])
    square = add(mul(way[0], way[0]), mul(way[1], way[1]))
    t = clip(add(mul(x, way[0]), mul(y, way[1])) * (1.0 / square), 0.0, 1.0)
    along = sub(x, mul(t, way[0]))
    up = sub(y, mul(t, way[1]))
    scale = 1.0 / sqrt(square)
    return (
        along * along + up * up,
        along,
        up,
        mul(neg(way[1]), scale),
        mul(way[0], scale),
    )
