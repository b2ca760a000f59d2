"""Shapes, solids and meshes for pictures, without mass or forces."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from itertools import chain, product
from typing import TYPE_CHECKING

import numpy as np

from skyarm.algebra import Scalar
from skyarm.records.arrays import Array, IntArray
from skyarm.records.files.stl_mesh import METRES, mesh_or_none
from skyarm.records.immutable import positional
from skyarm.vehicle.convex_hull import Triangles, convex_hull
from skyarm.vehicle.description import UPRIGHT, Matrix, Vector, turn_onto

if TYPE_CHECKING:
    from skyarm.vehicle.vehicle_records import Collision, Frame
    from skyarm.world.contact.surface import Surface

RGBA = tuple[float, float, float, float]
"""Red, green, blue, opacity, from 0 to 1."""

KINDS = (
    "ellipsoid",
    "capsule",
    "cylinder",
    "sphere",
    "box",
    "patch",
    "hole",
    "hull",
    "mesh",
)

ROLES = (
    "hull",
    "boom",
    "rotor",
    "link",
    "joint",
    "tip",
    "payload",
    "point",
    "surface",
    "object",
)
"""Roles of drawn shapes, by which their colour is chosen."""


Mesh = tuple[Array, IntArray]
"""Vertices (V, 3), m, and triangles (F, 3) of a surface."""


@positional
class Shape:
    """Geometric shape to draw, fixed to a body of the vehicle or to the world.

    Attributes:
        name: unique name among the shapes of a vehicle.
        role: one of ROLES.
        kind: "ellipsoid" (three half axes), "capsule" or "cylinder" (radius, length
            between the centres of its ends, along z), "sphere" (radius), "box" (three
            half lengths), "patch" of a plane (two half lengths; its outside is along
            z), "hole" (a plate with one, about z: radius, depth, chamfer, outer radius,
            length; the origin is in the middle of the mouth), "hull" (x, y, z of all
            corners), "mesh" (its scale along its axes).
        body: link of the vehicle, BASE for the airframe; of a surface of the world it
            says nothing.
        size: m, by kind.
        position: centre, m, axes of the body.
        rotation: rows of R_BS, axes of the shape to those of the body.
        mesh: path of an STL file in its place, axes of the shape, for who draws meshes;
            empty for none.
        faces: triangles of a hull, as numbers of corners.
    """

    name: str
    role: str
    kind: str
    body: int
    size: tuple[float, ...]
    position: Vector = (0.0, 0.0, 0.0)
    rotation: Matrix = UPRIGHT
    mesh: str = ""
    faces: Triangles = ()


SURFACE: RGBA = (0.66, 0.64, 0.6, 1.0)
OBJECT: RGBA = (0.62, 0.46, 0.3, 1.0)


@positional
class Solid:
    """Shape placed in the world at N instants.

    Attributes:
        shape: kind and size.
        position: (N, 3) of its origin in the world, m. rotation: (N, 3, 3), its axes to
            the world's.
        rgba: colour; None for that of its role.
        fixed: whether it never moves, by structure.
    """

    shape: Shape
    position: Array
    rotation: Array
    rgba: RGBA | None = None
    fixed: bool = False

    @property
    def moves(self) -> bool:
        """True if the solid's pose changes between the instants."""
        return bool(
            np.ptp(self.position, axis=0).any() or np.ptp(self.rotation, axis=0).any()
        )


def solid_shape(each: Collision | Surface, name: str, role: str, body: int) -> Shape:
    """Drawn shape of a solid, in its own axes; a plane has no size."""
    lengths = each.size or chain.from_iterable(each.vertices)
    scale = 0.5 if each.shape == "box" else 1.0
    size = tuple(scale * float(length) for length in lengths)
    return Shape(name, role, each.shape, body, size, faces=each.faces)


def in_place(shape: Shape, at: Frame | Surface) -> Shape:
    """Shape at the pose of a frame, or of a surface that rests."""
    a, b, c = map(floats, at.rotation.rows)
    return replace(shape, position=floats(at.position), rotation=(a, b, c))


def in_own_axes(shape: Shape) -> Shape:
    """Shape at the origin of its own axes, which a solid or a scene node places."""
    return replace(shape, position=(0.0, 0.0, 0.0), rotation=UPRIGHT)


def shape_between(
    name: str,
    role: str,
    kind: str,
    body: int,
    radius: float,
    start: Vector,
    end: Vector,
) -> Shape:
    """Capsule or cylinder between two points of a body."""
    along = floats(b - a for a, b in zip(start, end, strict=True))
    centre = floats(0.5 * (a + b) for a, b in zip(start, end, strict=True))
    return Shape(
        name, role, kind, body, (radius, math.hypot(*along)), centre, turn_onto(along)
    )


def floats(values: Iterable[Scalar]) -> Vector:
    """Convert three numbers to floats."""
    x, y, z = values
    return (float(x), float(y), float(z))


AROUND = 24
"""Number of corners of a drawn circle."""


def mesh_of(shape: Shape, around: int = AROUND) -> Mesh:
    """Triangle mesh of a shape: vertices (V, 3) in m and triangles (F, 3) with outward
    normals.

    Args:
        shape: any of :data:`skyarm.world.scene.shapes`; one with a mesh whose file is
            there is that.
        around: corners of a circle.

    Raises:
        ValueError: a kind of shape that there is not.
    """
    own = own_mesh(shape)
    size = shape.size
    # a quarter of a circle, from the lower pole to the equator
    arc = [
        (math.sin(a), -math.cos(a))
        for a in np.linspace(0.0, 0.5 * math.pi, around // 4 + 1)
    ]
    if own is not None:
        vertices, faces = own
    elif shape.kind in ("sphere", "ellipsoid"):
        vertices, faces = _revolve(
            [*arc, *((r, -z) for r, z in reversed(arc[:-1]))], around
        )
        vertices = vertices * np.array(size * 3 if shape.kind == "sphere" else size)
    elif shape.kind in ("cylinder", "capsule"):
        radius, length = size
        lower = [(radius * r, radius * z - 0.5 * length) for r, z in arc]
        if shape.kind == "cylinder":
            lower = [(0.0, -0.5 * length), (radius, -0.5 * length)]
        vertices, faces = _revolve(
            [*lower, *((r, -z) for r, z in reversed(lower))], around
        )
    elif shape.kind == "box":
        vertices, faces = _box(np.array(size))
    elif shape.kind == "hole":
        radius, depth, chamfer, outer, length = size
        plate = [
            (0.0, -length),
            (outer, -length),
            (outer, 0.0),
            (radius + chamfer, 0.0),
            (radius, -chamfer),
            (radius, -depth),
            (0.0, -depth),
        ]
        vertices, faces = _revolve(plate, around)
    elif shape.kind == "patch":
        vertices = np.array(
            [[x, y, 0.0] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        ) * [*size, 0.0]
        faces = np.array([[0, 1, 2], [0, 2, 3]])
    else:
        allowed = "ellipsoid, capsule, cylinder, sphere, box, patch, hole or hull"
        raise ValueError(f"shape.kind = {shape.kind!r}: must be {allowed}")
    return vertices @ np.array(shape.rotation).T + np.array(shape.position), faces


def own_mesh(shape: Shape) -> Mesh | None:
    """Vertices (m) and triangles of a hull, or of a shape's STL file; None without a
    readable file.
    """
    if shape.faces and not shape.mesh:
        return np.reshape(shape.size, (-1, 3)), np.array(shape.faces)
    if not shape.mesh:
        return None
    x, y, z = shape.size if shape.kind == "mesh" else METRES
    mesh = mesh_or_none(shape.mesh, (x, y, z))
    if mesh is None or x * y * z > 0.0:
        return mesh
    vertices, faces = mesh
    # a mirrored mesh would be seen from inside
    return vertices, faces[:, ::-1]


def _box(half: Array) -> Mesh:
    """Mesh of a box about the origin with half lengths (3,)."""
    corners = np.array([*product((-1, 1), repeat=3)]) * half
    return corners, convex_hull(corners, len(corners))[1]


def _revolve(profile: list[tuple[float, float]], around: int) -> Mesh:
    """Mesh of a surface of revolution: a profile of (radius, height) about z, outside
    on its right.
    """
    angles = np.linspace(0.0, 2.0 * math.pi, around, endpoint=False)
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(around)], axis=1)
    vertices = np.concatenate([ring * [r, r, 0.0] + [0.0, 0.0, z] for r, z in profile])
    k = np.arange(around)
    following = (k + 1) % around
    faces = []
    for low in range(0, (len(profile) - 1) * around, around):
        high = low + around
        faces.append(np.stack([low + k, low + following, high + following], axis=1))
        faces.append(np.stack([low + k, high + following, high + k], axis=1))
    return vertices, np.concatenate(faces)
