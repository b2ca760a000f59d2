"""Triangles of shapes, for whoever draws no solids but meshes."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from skyarm.drawing.shapes import Shape
from skyarm.files.stl_mesh import METRES, mesh_or_none

Array = npt.NDArray[np.float64]
Faces = npt.NDArray[np.int64]

AROUND = 24
"""Corners of a circle."""

BLADE = (0.12, 0.02)
"""Width and height of a rotor's blade, shares of its radius."""


def mesh_of(shape: Shape) -> tuple[Array, Faces]:
    """Vertices (V, 3) in axes of the body, m, and triangles (F, 3), seen counter-clockwise from outside.

    Args:
        shape: any of :data:`skyarm.drawing.shapes`; one with a mesh whose file is there is that.

    Raises:
        ValueError: a kind of shape that there is not.
    """
    own = own_mesh(shape)
    if own is not None:
        vertices, faces = own
    elif shape.kind in ("sphere", "ellipsoid"):
        axes = shape.size * 3 if shape.kind == "sphere" else shape.size
        vertices, faces = _revolved([(math.sin(a), -math.cos(a)) for a in np.linspace(0.0, math.pi, AROUND // 2 + 1)])
        vertices = vertices * np.array(axes)
    elif shape.kind == "cylinder":
        radius, length = shape.size
        rim = [(0.0, -0.5), (1.0, -0.5), (1.0, 0.5), (0.0, 0.5)]
        vertices, faces = _revolved([(radius * r, length * z) for r, z in rim])
    elif shape.kind == "capsule":
        radius, length = shape.size
        lower = [(math.sin(a), -math.cos(a)) for a in np.linspace(0.0, 0.5 * math.pi, 5)]
        profile = [(radius * r, radius * z - 0.5 * length) for r, z in lower]
        vertices, faces = _revolved([*profile, *((r, -z) for r, z in reversed(profile))])
    elif shape.kind == "box":
        vertices, faces = _box(np.array(shape.size))
    elif shape.kind == "hole":
        radius, depth, chamfer, outer, length = shape.size
        plate = [(0.0, -length), (outer, -length), (outer, 0.0)]
        vertices, faces = _revolved(
            [*plate, (radius + chamfer, 0.0), (radius, -chamfer), (radius, -depth), (0.0, -depth)]
        )
    elif shape.kind == "patch":
        vertices = np.array([[x, y, 0.0] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]) * [*shape.size, 0.0]
        faces = np.array([[0, 1, 2], [0, 2, 3]])
    else:
        allowed = "ellipsoid, capsule, cylinder, sphere, box, patch or hole"
        raise ValueError(f"shape.kind = {shape.kind!r}: must be {allowed}")
    return vertices @ np.array(shape.rotation).T + np.array(shape.position), faces


def own_mesh(shape: Shape) -> tuple[Array, Faces] | None:
    """Vertices (m, axes of the shape) and triangles of a shape's file; None without one that can be read."""
    if not shape.mesh:
        return None
    x, y, z = shape.size if shape.kind == "mesh" else METRES
    found = mesh_or_none(shape.mesh, (x, y, z))
    if found is None or x * y * z > 0.0:
        return found
    vertices, faces = found
    return vertices, faces[:, ::-1]  # a mirrored mesh would be seen from inside


def blade_mesh(radius: float) -> tuple[Array, Faces]:
    """A rotor's blade from end to end along x, thin along z, about its hub."""
    return _box(np.array([radius, 0.5 * BLADE[0] * radius, 0.5 * BLADE[1] * radius]))


def _box(half: Array) -> tuple[Array, Faces]:
    """A box about the origin by its half lengths (3,)."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([corner for a, b, c, d in quads for corner in ((a, b, c), (a, c, d))])


def _revolved(profile: list[tuple[float, float]]) -> tuple[Array, Faces]:
    """A profile of (radius, height), turned about z; its outside is to the right of the way along it."""
    angles = np.linspace(0.0, 2.0 * math.pi, AROUND, endpoint=False)
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(AROUND)], axis=1)
    vertices = np.concatenate([ring * [r, r, 0.0] + [0.0, 0.0, z] for r, z in profile])
    k = np.arange(AROUND)
    following = (k + 1) % AROUND
    faces = []
    for row in range(len(profile) - 1):
        low, high = row * AROUND, (row + 1) * AROUND
        faces.append(np.stack([low + k, low + following, high + following], axis=1))
        faces.append(np.stack([low + k, high + following, high + k], axis=1))
    return vertices, np.concatenate(faces)
