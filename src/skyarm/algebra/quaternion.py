"""Unit quaternions (w, x, y, z), body to world."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.algebra.matrix import Mat3
from skyarm.algebra.vector import Vec3
from skyarm.scalars import Scalar, cos, divide, sin, sqrt, where

SINC = (1.0, -1 / 6, 1 / 120, -1 / 5040, 1 / 362880, -1 / 39916800, 1 / 6227020800)
"""Taylor series of sin(y) / y in y^2."""

VERSINE = (1 / 2, -1 / 24, 1 / 720, -1 / 40320, 1 / 3628800, -1 / 479001600, 1 / 87178291200)
"""Taylor series of (1 - cos y) / y^2 in y^2."""


@dataclass(frozen=True, slots=True)
class Quaternion:
    """Hamilton quaternion w + xi + yj + zk; q and -q are one attitude."""

    w: Scalar
    x: Scalar
    y: Scalar
    z: Scalar

    @classmethod
    def of(cls, values: Sequence[Any]) -> Quaternion:
        """From any sequence w, x, y, z."""
        w, x, y, z = values
        return cls(w, x, y, z)

    @classmethod
    def of_rotation_vector(cls, v: Vec3) -> Quaternion:
        """Quaternion of the rotation by |v| rad about v, smooth at zero."""
        angle_squared = v.dot(v)
        angle = sqrt(angle_squared)
        small = angle_squared < 1e-8
        # sin(a/2)/a and cos(a/2) by series below 1e-4 rad, where the quotient loses digits; next terms are below 1e-19
        factor = where(small, 0.5 - angle_squared / 48.0, divide(sin(0.5 * angle), angle))
        return cls(cos(0.5 * angle), factor * v.x, factor * v.y, factor * v.z)

    @classmethod
    def of_small_rotation(cls, v: Vec3) -> Quaternion:
        """:meth:`of_rotation_vector` for |v| up to 10 rad, as an integration step makes, in half the operations.

        Series of sin(y) / y and sin(y/2)^2 with y = |v| / 16 (next terms below 1e-17 at 10 rad), doubled three times:
        no square root, no division, no branch.
        """
        z = v.dot(v) * (1.0 / 256.0)
        sinc: Any = SINC[-1]
        for c in reversed(SINC[:-1]):
            sinc = sinc * z + c
        versine: Any = VERSINE[-1]
        for c in reversed(VERSINE[:-1]):
            versine = versine * z + c
        versine = versine * z
        for _ in range(3):
            # 1 - cos 2y = 2 (sin y)^2 and sin 2y = 2 sin y cos y, with sin y = y sinc
            sinc, versine, z = sinc * (1.0 - versine), 2.0 * (sinc * sinc) * z, 4.0 * z
        factor = 0.5 * sinc
        return cls(1.0 - versine, factor * v.x, factor * v.y, factor * v.z)

    def __iter__(self) -> Iterator[Any]:
        """w, x, y, z."""
        return iter((self.w, self.x, self.y, self.z))

    def __mul__(self, other: Quaternion) -> Quaternion:
        """Hamilton product: first ``other``, then ``self``."""
        a, b = self, other
        return Quaternion(
            a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
            a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
            a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
            a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
        )

    def plus(self, other: Quaternion, factor: Any) -> Quaternion:
        """Return self + factor * other, not normalised (Runge-Kutta stages)."""
        a, b = self, other
        return Quaternion(a.w + factor * b.w, a.x + factor * b.x, a.y + factor * b.y, a.z + factor * b.z)

    def renormalized(self) -> Quaternion:
        """Return the unit quaternion along one that is of unit length but for rounding: one Newton step."""
        length_squared = self.w * self.w + self.x * self.x + self.y * self.y + self.z * self.z
        scale = 1.5 - 0.5 * length_squared
        return Quaternion(self.w * scale, self.x * scale, self.y * scale, self.z * scale)

    def normalized(self) -> Quaternion:
        """Return the unit quaternion along self; NaN for zero."""
        scale = divide(1.0, sqrt(self.w * self.w + self.x * self.x + self.y * self.y + self.z * self.z))
        return Quaternion(self.w * scale, self.x * scale, self.y * scale, self.z * scale)

    def rotation(self) -> Mat3:
        """R_WB of a unit quaternion."""
        w, x, y, z = self
        x2, y2, z2 = x + x, y + y, z + z
        wx, wy, wz = w * x2, w * y2, w * z2
        xx, xy, xz, yy, yz, zz = x * x2, x * y2, x * z2, y * y2, y * z2, z * z2
        return Mat3(
            Vec3(1.0 - (yy + zz), xy - wz, xz + wy),
            Vec3(xy + wz, 1.0 - (xx + zz), yz - wx),
            Vec3(xz - wy, yz + wx, 1.0 - (xx + yy)),
        )

    def derivative(self, w_B: Vec3) -> Quaternion:
        """Return qdot = 1/2 q o (0, w_B)."""
        w, x, y, z = self
        p, q, r = w_B
        return Quaternion(
            -0.5 * (x * p + y * q + z * r),
            0.5 * (w * p + y * r - z * q),
            0.5 * (w * q + z * p - x * r),
            0.5 * (w * r + x * q - y * p),
        )
