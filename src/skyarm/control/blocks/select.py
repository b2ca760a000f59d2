"""Selection between two vectors or tuples by a condition, which may be a symbolic
value.
"""

from __future__ import annotations

from collections.abc import Iterable

from skyarm.algebra import Scalar, Scalars, Vec3
from skyarm.algebra.scalars import data, where


def choose(condition: Scalar, a: Vec3, b: Vec3) -> Vec3:
    """Vector ``a`` where the condition holds, else ``b``."""
    return Vec3(*choose_each(condition, a, b))


def choose_each(condition: Scalar, a: Iterable[Scalar], b: Iterable[Scalar]) -> Scalars:
    """Select, entry by entry, ``a`` where the condition holds, else ``b``."""
    return tuple(where(condition, data(x), data(y)) for x, y in zip(a, b, strict=True))
