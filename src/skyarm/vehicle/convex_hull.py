"""Convex hull of points: its faces, or a hull of few of its corners."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from skyarm.records.arrays import Array, IntArray
from skyarm.records.coerce import concrete
from skyarm.records.files import shown
from skyarm.records.files.stl_mesh import require_near

FLAT = 1e-6
"""Height above a face, per size of the hull, up to which a point counts as on the face:
above the rounding of float32 in mesh files."""


Triangles = tuple[tuple[int, int, int], ...]
"""Corners of each triangle of a hull, as numbers of vertices."""

COLLISION_SIZES: Mapping[str, tuple[str, ...]] = {
    "sphere": ("radius",),
    "capsule": ("radius", "length"),
    "box": ("x", "y", "z"),
    "cylinder": ("radius", "length"),
    "hull": (),
}
"""Shape of a convex body -> names of its sizes (m). Capsule and cylinder lie along z;
the length of a capsule is that between the centres of its ends."""


def complete_shape(
    where: str,
    record: Any,
    error: type[ValueError],
    sizes: Mapping[str, tuple[str, ...]] = COLLISION_SIZES,
) -> None:
    """Refuse sizes and corners that do not fit a shape, and find the faces of a hull.

    Faces are triangles, counter-clockwise seen from outside.

    Args:
        where: name of the record in messages.
        record: its ``shape``, ``size`` (m), ``vertices`` (m) and ``faces``; vertices
            inside the hull are in no face.
        error: class of what is raised.
        sizes: shapes that may be, and names of their sizes.

    Raises:
        ValueError: of the class ``error``: one line with field, value and what is
            allowed.
    """
    shape = record.shape
    names = sizes[shape]
    corners = record.vertices
    without = f"must be left out of a {shape}"
    if len(record.size) != len(names):
        count = "one number" if len(names) == 1 else f"{len(names)} numbers"
        allowed = f"must be {count}, {', '.join(names)}" if names else without
        raise error(f"{where}.size = {shown(list(record.size))}: {allowed}")
    if (shape == "hull") != bool(corners):
        missing = "is missing; a hull has four or more"
        raise error(f"{where}.vertices: {without if corners else missing}")
    # symbolic corners keep the faces of the numbers that they stand for
    if not corners or not all(concrete(*each) for each in corners):
        return
    try:
        faces = convex_hull(np.array(corners, float), len(corners))[1]
    except ValueError:
        raise error(
            f"{where}.vertices = {len(corners)} points: must be four or more that are"
            " not in one plane"
        ) from None
    # the order in which the faces were found says nothing of the shape
    rows = sorted((i, j, k) for i, j, k in faces.tolist())
    object.__setattr__(record, "faces", tuple(rows))


def convex_hull(points: Array, most: float) -> tuple[IntArray, IntArray, float]:
    """Convex hull of points: corners, triangles, and the largest height (m) above them.

    Corners (K,) and triangles (F, 3) are indices of points, these counter-clockwise
    seen from outside. The height is that of the points that are left out: each corner
    that is added is the point farthest outside, so a hull of few corners lies within
    the whole one, and near it.
    Source: Barber, Dobkin, Huhdanpaa 1996, The quickhull algorithm.

    Args:
        points: shape (N, 3), m.
        most: largest number of corners, at least 4.

    Raises:
        ValueError: the points are in one plane, or beyond measure.
    """
    require_near(points)
    # the first four: farthest from the middle, then from that point, line and plane
    far = np.linalg.norm(points - points.mean(axis=0), axis=1)
    corners = [int(np.argmax(far))]
    rest = points - points[corners[0]]
    size = 0.0
    for _ in range(3):
        far = np.linalg.norm(rest, axis=1)
        corners.append(int(np.argmax(far)))
        way = rest[corners[-1]]
        height = float(far.max())
        size = max(size, height)
        if height <= FLAT * size:
            raise ValueError("has all of its vertices in one plane: must have a volume")
        rest = rest - np.outer(rest @ way, way) / height**2
    # the four faces are counter-clockwise for corners of positive volume only
    if np.linalg.det(points[corners[1:]] - points[corners[0]]) < 0.0:
        corners[:2] = corners[1::-1]
    faces = np.array(corners)[[[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]]
    outside = np.arange(len(points))
    while True:
        first, second, third = points[faces.T]
        normals = np.cross(second - first, third - first)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        heights = points[outside] @ normals.T - (first * normals).sum(axis=1)
        tops = heights.max(axis=1)
        highest = np.argmax(tops)
        if tops[highest] <= FLAT * size or len(corners) >= most:
            return np.array(sorted(corners)), faces, float(tops[highest])
        corners.append(apex := int(outside[highest]))
        seen = heights[highest] > FLAT * size
        edges = {
            (i, j)
            for face in faces[seen].tolist()
            for i, j in zip(face, face[1:] + face[:1], strict=True)
        }
        # an edge between two faces that the new corner sees is inside the new hull
        # sorted, as a set has no order: equal points have equal faces in equal order
        cone = [(i, j, apex) for i, j in sorted(edges) if (j, i) not in edges]
        faces = np.concatenate([faces[~seen], cone])
        # a hull only grows, so points inside it need no further look
        outside = outside[tops > FLAT * size]
