"""Triangle meshes from STL files, binary or text."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from skyarm.records.arrays import Array, IntArray
from skyarm.records.files import unreadable
from skyarm.records.files.paths import PathLike

MOST = 200_000
"""Largest number of triangles of a mesh that films and browsers still draw at their
frame rate."""

LARGEST = 100e6
"""Largest size (bytes) of a mesh file; as text, ``MOST`` triangles take less."""

FARTHEST = 1e3
"""Largest distance (m) of a vertex from the middle of the body; a larger one is
probably in another unit."""

THINNEST = 1e-7
"""Smallest standard deviation (m) of the vertices along any axis; renderers refuse
flatter meshes."""

VERTEX, CORNER = (
    re.compile(rb"(?<!\S)vertex(?!\S)"),
    re.compile(rb"(?<!\S)vertex" + 3 * rb"\s++(\S{1,64}+)(?!\S)"),
)
"""Patterns of an STL text file: the word before a vertex, and that word with the
vertex's coordinates."""

HEADER, RECORD = (
    84,
    np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]),
)
"""Layout of a binary STL file: length of its head in bytes, and type of one
triangle."""


Scale = tuple[float, float, float]

METRES: Scale = (1.0, 1.0, 1.0)
"""Length (m) of one unit of a mesh file, along each axis."""


def read_corners(path: PathLike, scale: Sequence[float] = METRES) -> Array:
    """Read the triangle corners (m) of an STL file, shape (F, 3, 3).

    Args:
        path: path of the file.
        scale: m of one of its numbers along its axes.

    Raises:
        ValueError: without the file's name: it is not there, no STL, or beyond measure.
    """
    content = mesh_content(path)
    written = _binary(content) if _is_binary(content) else _text(content)
    if not 1 <= len(written) <= MOST:
        raise ValueError(f"has {len(written)} triangles, must have from 1 to {MOST}")
    with np.errstate(over="ignore", invalid="ignore"):  # refused below
        corners: Array = written * np.array(scale)
    largest = require_near(corners)
    points = corners.reshape(-1, 3)
    # relative to the largest, since rounding of float32 grows with the distance; the
    # singular values of points that lie alike grow with the root of their number
    thinnest = max(1e-6 * largest, THINNEST) * math.sqrt(len(points))
    if np.linalg.matrix_rank(points - points.mean(axis=0), tol=thinnest) < 3:
        raise ValueError("has all of its vertices in one plane: must have a volume")
    return corners


def mesh_content(path: PathLike) -> bytes:
    """Content of a mesh file.

    Raises:
        ValueError: without the file's name: it is not there, or too large.
    """
    where = Path(path)
    if reason := unreadable(where):
        raise ValueError(reason)
    try:
        if (size := where.stat().st_size) > LARGEST:
            raise ValueError(
                f"has {size / 1e6:.0f} MB, must have at most {LARGEST / 1e6:.0f} MB"
            )
        return where.read_bytes()
    except OSError as error:
        raise ValueError(error.strerror or str(error)) from None


def require_near(corners: Array) -> float:
    """Largest coordinate (m) of a mesh.

    Raises:
        ValueError: it is beyond ``FARTHEST``, or no number.
    """
    largest = float(np.abs(corners).max())
    if not largest <= FARTHEST:  # NaN, too
        raise ValueError(
            f"has a vertex at {largest:g}: must be in metres, within {FARTHEST:g} m of"
            " the origin"
        )
    return largest


def read_stl(path: PathLike, scale: Scale = METRES) -> tuple[Array, IntArray]:
    """Read an STL file: unique vertices (V, 3) in metres, and triangles as indices (F,
    3).
    """
    vertices, places = np.unique(
        read_corners(path, scale).reshape(-1, 3), axis=0, return_inverse=True
    )
    return vertices, places.reshape(-1, 3)


# 16 is chosen: a miss costs 90 ms of 20 000 triangles (measured)
@functools.lru_cache(maxsize=16)
def mesh_or_none(path: str, scale: Scale = METRES) -> tuple[Array, IntArray] | None:
    """Read an STL mesh for a drawing; None if its file is missing, as for a log from
    another machine.
    """
    try:
        return read_stl(path, scale)
    except ValueError:
        return None


def _is_binary(content: bytes) -> bool:
    """True for a binary STL file, recognized by its length: its header may begin with
    "solid", as text does.
    """
    # a binary file states its count, which must fit its length
    if len(content) < HEADER:
        return False
    count = int.from_bytes(content[HEADER - 4 : HEADER], "little")
    return len(content) == HEADER + count * RECORD.itemsize


def _binary(content: bytes) -> Array:
    """Triangle corners (F, 3, 3) of a binary STL file."""
    return np.frombuffer(content, RECORD, offset=HEADER)["corners"].astype(float)


def _text(content: bytes) -> Array:
    """Triangle corners (F, 3, 3) of a text STL file, from its ``vertex x y z``
    lines.
    """
    allowed = "must be an STL file, binary or text"
    if not content.lstrip().startswith(b"solid") or b"endsolid" not in content:
        raise ValueError(allowed)
    # counted first: the numbers take more memory than their text
    count = sum(1 for _ in VERTEX.finditer(content))
    if count > 3 * MOST:
        raise ValueError(f"has {count // 3} triangles, must have from 1 to {MOST}")
    try:
        corners = np.array(
            [
                [float(each) for each in match.groups()]
                for match in CORNER.finditer(content)
            ]
        )
        # a line that begins as a vertex, without three numbers, is damage
        if len(corners) != count:
            raise ValueError
        return corners.reshape(-1, 3, 3)
    except ValueError:
        raise ValueError(allowed) from None
