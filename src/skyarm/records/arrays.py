"""Types of arrays, and stacking of scalars and arrays into one array."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, SupportsFloat

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Scalar
from skyarm.records.leaves import leaves, parts

Array = npt.NDArray[np.float64]
"""Array of doubles; the shape stands in the docstring that names it."""

Complex = npt.NDArray[np.complex128]
"""Array of complex numbers."""

IntArray = npt.NDArray[np.int_]
"""Array of integers."""

Mask = npt.NDArray[np.bool_]
"""Array of booleans."""

Pixels = npt.NDArray[np.uint8]
"""Picture (rows, columns, channels), 0 to 255."""

AnyArray = npt.NDArray[Any]
"""Array of doubles, integers or booleans."""


Columns = dict[str, Array]
"""Values of many flights: path of a number, or name of a column -> (flights,)."""


def doubles(values: object) -> Array:
    """Array of doubles of the given numbers; one that is an array of doubles already
    stays the same object.
    """
    return np.asarray(values, dtype=float)


def norm(vector: Array) -> float:
    """Euclidean length of a vector (n,)."""
    return float(np.linalg.norm(vector))


def lengths(rows: Array) -> Array:
    """Euclidean lengths (K) of vectors (K, n)."""
    return np.asarray(np.linalg.norm(rows, axis=1))


def float_array(values: Iterable[SupportsFloat]) -> Array:
    """Array (n,) of scalars that are plain numbers."""
    return np.array([*map(float, values)])


def stack_values(count: int, values: Iterable[Scalar | Array]) -> Array:
    """Stack scalars and arrays of length ``count`` into one array (values, count)."""
    # scalars are broadcast, so that a constant stacks with lanes
    rows = [np.broadcast_to(np.asarray(value, dtype=float), count) for value in values]
    return np.stack(rows) if rows else np.zeros((0, count))


def field_views(record: object, rows: AnyArray) -> tuple[dict[str, Any], int]:
    """Views of the rows of an array that hold each field of a record of scalars, by
    field name, and the total number of rows.
    """
    views = {}
    first = 0
    for name, value in parts(record).items():
        last = first + len(leaves(value))
        views[name] = rows[first:last]
        first = last
    return views, first
