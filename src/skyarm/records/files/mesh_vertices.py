"""Vertices of meshes from STL and OBJ files."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from skyarm.records.arrays import Array
from skyarm.records.files.paths import PathLike
from skyarm.records.files.stl_mesh import (
    MOST,
    mesh_content,
    read_corners,
)

MESHES = (".stl", ".obj")
"""Suffixes of mesh files whose vertices are read."""

VERTEX = re.compile(rb"^\s*v\s+(\S{1,64})\s+(\S{1,64})\s+(\S{1,64})", re.MULTILINE)
"""Line of an OBJ file with a vertex; weight and colour may follow."""


def read_vertices(path: PathLike, scale: Sequence[float]) -> Array:
    """Read the vertices (m) of an STL or OBJ file, shape (N, 3), in its order.

    Args:
        path: path of the file.
        scale: m of one of its numbers along its axes.

    Raises:
        ValueError: without the file's name: of another kind, not there, or beyond
            measure.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in MESHES:
        raise ValueError(f"must end in {' or '.join(MESHES)}; a mesh tool converts it")
    if suffix == ".stl":
        return read_corners(path, scale).reshape(-1, 3)
    found = VERTEX.findall(mesh_content(path))
    if not 1 <= len(found) <= MOST:
        raise ValueError(f"has {len(found)} vertices, must have from 1 to {MOST}")
    try:
        vertices: Array = np.array(found).astype(float) * scale
        return vertices
    except ValueError:
        raise ValueError("must have three numbers in each line v x y z") from None
