"""3x3 matrices: general (rows) and symmetric (six entries)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, SupportsIndex

from skyarm.algebra.scalars import Scalar, add, cos, mul, neg, same, sin, sub
from skyarm.algebra.vector import E_X, E_Y, E_Z, ZERO3, ArrayLike, Vec3


@dataclass(frozen=True, slots=True)
class Mat3(ArrayLike):
    """A 3 x 3 matrix, stored as three rows."""

    r0: Vec3
    r1: Vec3
    r2: Vec3

    @classmethod
    def identity(cls) -> Mat3:
        """Identity matrix of constant (int) entries."""
        return cls(E_X, E_Y, E_Z)

    @classmethod
    def columns(cls, c0: Vec3, c1: Vec3, c2: Vec3) -> Mat3:
        """Matrix from three columns."""
        return cls(
            Vec3(c0.x, c1.x, c2.x), Vec3(c0.y, c1.y, c2.y), Vec3(c0.z, c1.z, c2.z)
        )

    @classmethod
    def from_numbers(cls, rows: Sequence[Sequence[float]]) -> Mat3:
        """Matrix from plain numbers; exact 0, 1 and -1 become compile-time constants
        (ints).
        """
        r0, r1, r2 = rows
        return cls(Vec3.from_numbers(r0), Vec3.from_numbers(r1), Vec3.from_numbers(r2))

    @classmethod
    def cross(cls, v: Vec3) -> Mat3:
        """Cross-product matrix S(v), with S(v) a = v x a."""
        return cls(
            Vec3(0, neg(v.z), v.y), Vec3(v.z, 0, neg(v.x)), Vec3(neg(v.y), v.x, 0)
        )

    @property
    def rows(self) -> tuple[Vec3, Vec3, Vec3]:
        """Three rows of the matrix."""
        return self.r0, self.r1, self.r2

    @property
    def T(self) -> Mat3:
        """Transposed matrix."""
        return Mat3.columns(self.r0, self.r1, self.r2)

    def column(self, j: int) -> Vec3:
        """Column ``j`` of the matrix."""
        x, y, z = (tuple(row)[j] for row in self.rows)
        return Vec3(x, y, z)

    def __getitem__(self, index: SupportsIndex | slice) -> Any:
        """One row by index, or a tuple of rows by slice."""
        return (self.r0, self.r1, self.r2)[index]

    def __add__(self, other: Mat3) -> Mat3:
        """Sum of two matrices."""
        return Mat3(self.r0 + other.r0, self.r1 + other.r1, self.r2 + other.r2)

    def __sub__(self, other: Mat3) -> Mat3:
        """Difference of two matrices."""
        return Mat3(self.r0 - other.r0, self.r1 - other.r1, self.r2 - other.r2)

    def __neg__(self) -> Mat3:
        """Negated matrix."""
        return Mat3(-self.r0, -self.r1, -self.r2)

    def __mul__(self, scalar: Scalar) -> Mat3:
        """Product of the matrix with a scalar."""
        return Mat3(self.r0 * scalar, self.r1 * scalar, self.r2 * scalar)

    __rmul__ = __mul__

    def __matmul__(self, other: Mat3) -> Mat3:
        """Matrix product."""
        t = other.T
        return Mat3(
            *(Vec3(row.dot(t.r0), row.dot(t.r1), row.dot(t.r2)) for row in self.rows)
        )

    def apply(self, v: Vec3) -> Vec3:
        """Product of the matrix and a column vector."""
        return Vec3(self.r0.dot(v), self.r1.dot(v), self.r2.dot(v))

    def apply_T(self, v: Vec3) -> Vec3:
        """Product of the transposed matrix and a column vector."""
        return self.r0 * v.x + self.r1 * v.y + self.r2 * v.z

    def cleared_row(self, i: int) -> Mat3:
        """Matrix with row ``i`` replaced by constant zeros."""
        rows = list(self.rows)
        rows[i] = ZERO3
        return Mat3(*rows)

    def turning_axis(self) -> int | None:
        """Index of the axis x, y or z about which a rotation by a variable angle turns;
        None for other matrices.

        A rotation of structural entries only, as the identity, is none: it folds away
        by itself.
        """
        rows = [tuple(row) for row in self.rows]
        for k, (i, j) in enumerate(_OTHERS):
            # structural entries alone: a number that is 0 now may be another later
            beside = (rows[k][i], rows[k][j], rows[i][k], rows[j][k])
            still = same(rows[k][k], 1) and all(same(c, 0) for c in beside)
            if still and type(rows[i][i]) is not int:
                return k
        return None

    def rotate(self, R: Mat3) -> Mat3:
        """Rotated tensor R A R^T, cheaper for a rotation about a coordinate axis."""
        k = R.turning_axis()
        if k is None:
            return R @ self @ R.T
        i, j = _OTHERS[k]
        A, turn = [list(row) for row in self.rows], [tuple(row) for row in R.rows]
        c, s = turn[i][i], turn[j][i]
        # entry kk stays: an axis is not turned by a rotation about itself
        A[i][i], A[j][j], A[i][j], A[j][i] = _turn(
            A[i][i], A[j][j], A[i][j], A[j][i], c, s
        )
        A[k][i], A[k][j] = _turned_pair(A[k][i], A[k][j], c, s)
        A[i][k], A[j][k] = _turned_pair(A[i][k], A[j][k], c, s)
        return Mat3(*(Vec3(*row) for row in A))

    def vee_antisymmetric(self) -> Vec3:
        """Axial vector of the skew-symmetric part: vee((A - A^T) / 2)."""
        return Vec3(
            mul(0.5, sub(self.r2.y, self.r1.z)),
            mul(0.5, sub(self.r0.z, self.r2.x)),
            mul(0.5, sub(self.r1.x, self.r0.y)),
        )


@dataclass(frozen=True, slots=True)
class Sym3:
    """Symmetric 3x3 matrix."""

    xx: Scalar
    yy: Scalar
    zz: Scalar
    xy: Scalar = 0
    xz: Scalar = 0
    yz: Scalar = 0

    @classmethod
    def from_numbers(
        cls,
        xx: float,
        yy: float,
        zz: float,
        xy: float = 0.0,
        xz: float = 0.0,
        yz: float = 0.0,
    ) -> Sym3:
        """Symmetric matrix from plain numbers; exact zeros become compile-time
        constants.
        """
        return cls(
            *(0 if value == 0.0 else float(value) for value in (xx, yy, zz, xy, xz, yz))
        )

    @classmethod
    def isotropic(cls, value: Scalar) -> Sym3:
        """Identity matrix times ``value``."""
        return cls(value, value, value)

    @classmethod
    def of_matrix(cls, a: Mat3) -> Sym3:
        """Symmetric matrix from the upper triangle of a full one."""
        return cls(a.r0.x, a.r1.y, a.r2.z, a.r0.y, a.r0.z, a.r1.z)

    @classmethod
    def parallel_axis(cls, mass: Scalar, c: Vec3) -> Sym3:
        """Inertia of a point mass at ``c`` about the origin, m S(c)^T S(c)
        (parallel-axis theorem).
        """
        # the mass first: its products are shared with the first moment m c
        mx, my, mz = c * mass
        xx, yy, zz = mul(mx, c.x), mul(my, c.y), mul(mz, c.z)
        return cls(
            add(yy, zz),
            add(xx, zz),
            add(xx, yy),
            neg(mul(mx, c.y)),
            neg(mul(mx, c.z)),
            neg(mul(my, c.z)),
        )

    @property
    def entries(self) -> tuple[Scalar, Scalar, Scalar, Scalar, Scalar, Scalar]:
        """Six entries xx, yy, zz, xy, xz, yz of the symmetric matrix."""
        return self.xx, self.yy, self.zz, self.xy, self.xz, self.yz

    def full(self) -> Mat3:
        """Convert the symmetric matrix to a general 3x3 matrix."""
        return Mat3(
            Vec3(self.xx, self.xy, self.xz),
            Vec3(self.xy, self.yy, self.yz),
            Vec3(self.xz, self.yz, self.zz),
        )

    def __add__(self, other: Sym3) -> Sym3:
        """Sum of two symmetric matrices."""
        return Sym3(*map(add, self.entries, other.entries))

    def __sub__(self, other: Sym3) -> Sym3:
        """Difference of two symmetric matrices."""
        return Sym3(*map(sub, self.entries, other.entries))

    def __mul__(self, scalar: Scalar) -> Sym3:
        """Product of the matrix with a scalar."""
        return Sym3(*(mul(a, scalar) for a in self.entries))

    def apply(self, v: Vec3) -> Vec3:
        """Product of the matrix and a column vector."""
        return self.full().apply(v)

    def clear_axis(self, i: int) -> Sym3:
        """Symmetric matrix with row and column ``i`` replaced by constant zeros."""
        full = self.full().cleared_row(i)
        return Sym3.of_matrix(full.T.cleared_row(i).T)

    def rotate(self, R: Mat3) -> Sym3:
        """Rotated tensor R A R^T, cheaper for a rotation about a coordinate axis."""
        if R.turning_axis() is not None:
            return Sym3.of_matrix(self.full().rotate(R))
        a = self.full() @ R.T
        # six products in place of nine: the result is symmetric by construction
        r0, r1, r2 = R.rows
        c0, c1, c2 = map(a.column, range(3))
        return Sym3(
            r0.dot(c0), r1.dot(c1), r2.dot(c2), r0.dot(c1), r0.dot(c2), r1.dot(c2)
        )


_OTHERS = ((1, 2), (2, 0), (0, 1))
"""Pairs of coordinate axes that a rotation about axis 0, 1 or 2 turns into each
other."""


def _turn(
    first: Scalar, second: Scalar, above: Scalar, below: Scalar, c: Scalar, s: Scalar
) -> tuple[Scalar, Scalar, Scalar, Scalar]:
    """Entries xx, yy, xy, yx of a 2x2 tensor rotated by an angle of given cosine and
    sine.

    What is not symmetric and the trace stay; the rest turns by the double angle, which
    is c and s applied in turn.
    """
    change = sub(mul(c, sub(first, second)), mul(s, add(above, below)))
    along, across = mul(c, change), mul(s, change)
    return add(second, along), sub(first, along), add(above, across), add(below, across)


def _turned_pair(x: Scalar, y: Scalar, c: Scalar, s: Scalar) -> tuple[Scalar, Scalar]:
    """Planar vector rotated by an angle of given cosine and sine."""
    return sub(mul(c, x), mul(s, y)), add(mul(s, x), mul(c, y))


def orientation_error(R: Mat3, R_d: Mat3) -> Vec3:
    """Rotation error from R to R_d, axis times sine of the angle, in the axes that both
    matrices map to.

    It is half the sum of the cross products of their columns.
    """
    total = ZERO3
    for k in range(3):
        total = total + R.column(k).cross(R_d.column(k))
    return total * 0.5


def axis_rotation(axis: Vec3, angle: Scalar) -> Mat3:
    """Rotation by ``angle`` (rad) about the unit ``axis``: a a^T + cos (1 - a a^T) +
    sin S(a).

    Written so that a structural axis folds to the elementary rotation.
    Source: Rodrigues 1840; Murray, Li, Sastry 1994, eq. 2.14.
    """
    c, s = cos(angle), sin(angle)
    outer = Mat3(axis * axis.x, axis * axis.y, axis * axis.z)
    return outer + (Mat3.identity() - outer) * c + Mat3.cross(axis) * s
