"""Axes and rotations as published, exactly of unit length and orthogonal; what is further off is refused."""

from __future__ import annotations

import math
from typing import Any

from skyarm.algebra import Mat3, Quaternion, Vec3
from skyarm.records import coerce
from skyarm.records.coerce import TOLERANCE, concrete, refuse

ROUNDING = 1e-12
"""What rounding leaves of a length that was made 1."""


def near_unit_vector(field: str, value: Any) -> Vec3:
    """A vector; one of a length that is 1 within TOLERANCE is made exactly that long, any other is not touched."""
    held = coerce.vector(field, value)
    length = math.sqrt(sum(c * c for c in held)) if concrete(*held) else 1.0
    if not ROUNDING < abs(length - 1.0) <= TOLERANCE:
        return held
    return Vec3(*(c if type(c) is int else c / length for c in held))


def unit_vector(field: str, value: Any) -> Vec3:
    """A vector of unit length."""
    held = near_unit_vector(field, value)
    if concrete(*held) and not abs(math.sqrt(sum(c * c for c in held)) - 1.0) <= TOLERANCE:
        refuse(field, tuple(held), "must be a unit vector")
    return held


def near_rotation(field: str, value: Any) -> Mat3:
    """A matrix; one whose columns are orthonormal within ten times TOLERANCE becomes the nearest rotation.

    Source: Higham 1986, Newton-Schulz iteration for the polar factor, R (3 I - R^T R) / 2.
    """
    held = coerce.matrix(field, value)
    rows = [list(row) for row in held.rows]
    if not concrete(*(c for row in rows for c in row)) or not ROUNDING < _skew(rows) <= 10.0 * TOLERANCE:
        return held
    for _ in range(3):  # the error is squared each time: 1e-5, 1e-10, rounding
        left = [[3.0 * (i == j) - _dot(rows, i, j) for j in range(3)] for i in range(3)]
        rows = [[0.5 * sum(row[k] * left[k][j] for k in range(3)) for j in range(3)] for row in rows]
    return Mat3(*(Vec3(*row) for row in rows))


def _dot(rows: list[list[Any]], i: int, j: int) -> Any:
    """Of two columns."""
    return sum(row[i] * row[j] for row in rows)


def _skew(rows: list[list[Any]]) -> float:
    """Largest entry of R^T R - I."""
    return float(max(abs(_dot(rows, i, j) - (i == j)) for i in range(3) for j in range(3)))


def near_unit_quaternion(value: Quaternion) -> Quaternion:
    """A quaternion; one of a length that is 1 within TOLERANCE is made exactly that long."""
    length = math.sqrt(sum(c * c for c in value)) if concrete(*value) else 1.0
    return Quaternion(*(c / length for c in value)) if ROUNDING < abs(length - 1.0) <= TOLERANCE else value
