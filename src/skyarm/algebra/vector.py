"""Vector of three scalars."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, SupportsIndex

import numpy as np
import numpy.typing as npt

from skyarm.algebra.scalars import (
    Scalar,
    Scalars,
    add,
    cos,
    mul,
    neg,
    same,
    sin,
    sqrt,
    structural,
    sub,
    total,
    where,
)


class ArrayLike:
    """Base of vectors and matrices, which convert to NumPy arrays."""

    __slots__ = ()
    __array_ufunc__: ClassVar[None] = None

    def __getitem__(self, index: SupportsIndex | slice) -> Any:
        """One component by index, or a tuple of components by slice."""
        raise NotImplementedError(f"{type(self).__name__} must define __getitem__()")

    def __len__(self) -> int:
        return len(self[:])

    def __array__(
        self, dtype: npt.DTypeLike | None = None, copy: bool | None = None
    ) -> npt.NDArray[np.generic]:
        """Convert to a NumPy array; the axes of array components come last.

        Raises:
            TypeError: a number that has no value, as a traced one.
            ValueError: ``copy=False``, which cannot be had.
        """
        name = type(self).__name__
        # NumPy's protocol: a copy that is not wanted must be refused, not made
        if copy is False:
            raise ValueError(
                f"{name}: its numbers lie apart, an array of them is a copy"
            )
        rows = [each[:] if isinstance(each, ArrayLike) else (each,) for each in self[:]]
        for number in (number for row in rows for number in row):
            if not isinstance(number, (int, float)) and not hasattr(
                number, "__array__"
            ):
                what = f"{name} of {type(number).__name__}"
                raise TypeError(
                    f"{what}: has no values yet, so that no array can be made of it"
                )
        # a vector has one number a row, a matrix three
        numbers = rows if len(rows[0]) > 1 else [row[0] for row in rows]
        return np.array(numbers, dtype=float if dtype is None else dtype)


@dataclass(frozen=True, slots=True)
class Vec3(ArrayLike):
    """Vector of three scalars; a component that is an int, such as an exact 0, is a
    constant of compiled code.
    """

    x: Scalar
    y: Scalar
    z: Scalar

    @classmethod
    def from_numbers(cls, values: Sequence[float]) -> Vec3:
        """Vector from plain numbers; exact 0, 1 and -1 become compile-time constants
        (ints).
        """
        x, y, z = values
        return cls(structural(x), structural(y), structural(z))

    def __iter__(self) -> Iterator[Any]:
        """Iterate over the components x, y, z."""
        return iter((self.x, self.y, self.z))

    def __getitem__(self, index: SupportsIndex | slice) -> Any:
        """One component by index, or a tuple of components by slice."""
        return (self.x, self.y, self.z)[index]

    def __add__(self, other: Vec3) -> Vec3:
        """Sum of two vectors."""
        return Vec3(add(self.x, other.x), add(self.y, other.y), add(self.z, other.z))

    def __sub__(self, other: Vec3) -> Vec3:
        """Difference of two vectors."""
        return Vec3(sub(self.x, other.x), sub(self.y, other.y), sub(self.z, other.z))

    def __neg__(self) -> Vec3:
        """Negated vector."""
        return Vec3(neg(self.x), neg(self.y), neg(self.z))

    def __mul__(self, scalar: Scalar) -> Vec3:
        """Product of the vector with a scalar."""
        return Vec3(mul(self.x, scalar), mul(self.y, scalar), mul(self.z, scalar))

    __rmul__ = __mul__

    def hadamard(self, other: Vec3) -> Vec3:
        """Component-wise product of two vectors, as with diagonal gains."""
        return Vec3(mul(self.x, other.x), mul(self.y, other.y), mul(self.z, other.z))

    def dot(self, other: Vec3) -> Any:
        """Inner product of two vectors."""
        return add(
            add(mul(self.x, other.x), mul(self.y, other.y)), mul(self.z, other.z)
        )

    def cross(self, other: Vec3) -> Vec3:
        """Cross product of two vectors, self x other."""
        return Vec3(
            sub(mul(self.y, other.z), mul(self.z, other.y)),
            sub(mul(self.z, other.x), mul(self.x, other.z)),
            sub(mul(self.x, other.y), mul(self.y, other.x)),
        )

    def about_z(self, angle: Scalar) -> Vec3:
        """Vector turned about the z axis by an angle (rad)."""
        c, s = cos(angle), sin(angle)
        return Vec3(c * self.x - s * self.y, s * self.x + c * self.y, self.z)

    def coordinate_axis(self) -> int | None:
        """Index of the coordinate axis along a constant vector, of either sign; None
        for other vectors.
        """
        marks = [type(c) is int and abs(c) for c in self]
        zeros = sum(same(c, 0) for c in self)
        return marks.index(1) if zeros == 2 and 1 in marks else None

    def norm(self) -> Scalar:
        """Euclidean length of the vector."""
        return sqrt(self.dot(self))

    def smooth_norm(self) -> Scalar:
        """Euclidean length whose derivative at zero is 0 instead of NaN.

        What is added to the square changes no bit of a length above 2e-4.
        """
        return sqrt(self.dot(self) + 1e-24)


ZERO3 = Vec3(0, 0, 0)
ZERO3_DATA = Vec3(0.0, 0.0, 0.0)
"""Zero vector of floats, which a traced program stores; the int zeros of ``ZERO3`` fold
away as constants."""

E_X = Vec3(1, 0, 0)
E_Y = Vec3(0, 1, 0)
E_Z = Vec3(0, 0, 1)


def select(condition: Scalar, a: Vec3, b: Vec3) -> Vec3:
    """Vector ``a`` where a condition holds, else ``b``.

    Equal constants, as zeros along an axis, stay structure.
    """
    pairs = zip(a, b, strict=True)
    return Vec3(*(x if same(x, y) else where(condition, x, y) for x, y in pairs))


def inner_product(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalar:
    """Inner product of two sequences of scalars; terms with a constant (int) zero are
    omitted.
    """
    return total(mul(x, y) for x, y in zip(a, b, strict=True))


def sums(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalars:
    """Sums of two sequences of scalars, element by element."""
    return tuple(add(x, y) for x, y in zip(a, b, strict=True))


def differences(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalars:
    """Differences a - b of two sequences of scalars, element by element."""
    return tuple(sub(x, y) for x, y in zip(a, b, strict=True))
