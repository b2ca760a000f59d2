"""Unit quaternions (w, x, y, z), body to world, and ZYX Euler angles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, SupportsIndex

from skyarm.algebra.matrix import Mat3
from skyarm.algebra.scalars import (
    Scalar,
    Scalars,
    atan2,
    cos,
    divide,
    neg,
    sin,
    sqrt,
    where,
)
from skyarm.algebra.vector import ArrayLike, Vec3

SINC = (1.0, -1 / 6, 1 / 120, -1 / 5040, 1 / 362880, -1 / 39916800)
"""Taylor series of sin(y) / y in y^2."""

COSINE = (1.0, -1 / 2, 1 / 24, -1 / 720, 1 / 40320, -1 / 3628800, 1 / 479001600)
"""Taylor series of cos y in y^2."""


@dataclass(frozen=True, slots=True)
class Quaternion(ArrayLike):
    """Hamilton quaternion w + xi + yj + zk; q and -q are the same attitude."""

    w: Scalar
    x: Scalar
    y: Scalar
    z: Scalar

    @classmethod
    def of_rotation_vector(cls, v: Vec3) -> Quaternion:
        """Quaternion of the rotation by |v| rad about v, smooth at zero."""
        angle_squared = v.dot(v)
        small = angle_squared < 1e-8
        # the root never sees zero, where its derivative is infinite and would turn the
        # gradient into NaN
        angle = sqrt(where(small, 1.0, angle_squared))
        # sin(a/2)/a and cos(a/2) by series below 1e-4 rad, where the quotient loses
        # digits; next terms are below 1e-18
        factor = where(small, 0.5 - angle_squared / 48.0, sin(0.5 * angle) / angle)
        w = where(small, 1.0 - angle_squared / 8.0, cos(0.5 * angle))
        return cls(w, factor * v.x, factor * v.y, factor * v.z)

    @classmethod
    def of_small_rotation(cls, rate: Vec3, seconds: Scalar = 1.0) -> Quaternion:
        """Quaternion of the rotation ``rate * seconds`` in an integration step, by
        short series.

        Series of sine and cosine of a quarter of the angle, doubled once: no square
        root, no division, no branch. Off by 1e-17 at 1 rad, 1e-11 at 3 rad and 2e-5 at
        10 rad a step.
        """
        square = rate.dot(rate)
        # square of a quarter of the angle
        z = square * (seconds * seconds * 0.0625)
        # of the quarter, times the length of half the vector's factor
        sine = SINC[-1] * (0.5 * seconds)
        for c in reversed(SINC[:-1]):
            sine = sine * z + c * (0.5 * seconds)
        cosine: Scalar = COSINE[-1]
        for c in reversed(COSINE[:-1]):
            cosine = cosine * z + c
        # sin 2y = 2 sin y cos y and cos 2y = 1 - 2 (sin y)^2
        factor = sine * cosine
        return cls(
            1.0 - (sine * sine) * (0.5 * square),
            factor * rate.x,
            factor * rate.y,
            factor * rate.z,
        )

    def __iter__(self) -> Iterator[Any]:
        """Iterate over the components w, x, y, z."""
        return iter((self.w, self.x, self.y, self.z))

    def __getitem__(self, index: SupportsIndex | slice) -> Any:
        """One component by index, or a tuple of components by slice."""
        return (self.w, self.x, self.y, self.z)[index]

    def __mul__(self, other: Quaternion) -> Quaternion:
        """Product of two quaternions, the rotation ``other`` followed by ``self``."""
        a, b = self, other
        return Quaternion(
            a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
            a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
            a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
            a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
        )

    def conjugate(self) -> Quaternion:
        """Conjugate w - xi - yj - zk: of a unit quaternion the inverse rotation."""
        return Quaternion(self.w, -self.x, -self.y, -self.z)

    def plus(self, other: Quaternion, factor: Scalar) -> Quaternion:
        """Sum ``self`` + ``factor`` * ``other``, not normalised, for Runge-Kutta
        stages.
        """
        a, b = self, other
        return Quaternion(
            a.w + factor * b.w,
            a.x + factor * b.x,
            a.y + factor * b.y,
            a.z + factor * b.z,
        )

    def renormalized(self) -> Quaternion:
        """Quaternion of nearly unit length, brought closer to it by one Newton step."""
        return self._scale(1.5 - 0.5 * self._square())

    def normalized(self) -> Quaternion:
        """Quaternion divided by its length; NaN for zero."""
        return self._scale(divide(1.0, self.norm()))

    def norm(self) -> Scalar:
        """Length of the quaternion."""
        return sqrt(self._square())

    def _square(self) -> Scalar:
        """Squared length of the quaternion."""
        return self.w * self.w + self.x * self.x + self.y * self.y + self.z * self.z

    def _scale(self, scale: Scalar) -> Quaternion:
        """Product of the quaternion with a scalar."""
        return Quaternion(
            self.w * scale, self.x * scale, self.y * scale, self.z * scale
        )

    def rotation(self) -> Mat3:
        """Rotation matrix R_WB of a unit quaternion."""
        w, x, y, z = self
        # doubled once for all entries, and exactly: each is a sum of products times 2
        x2, y2, z2 = x + x, y + y, z + z
        wx, wy, wz = w * x2, w * y2, w * z2
        xx, xy, xz, yy, yz, zz = x * x2, x * y2, x * z2, y * y2, y * z2, z * z2
        return Mat3(
            Vec3(1.0 - (yy + zz), xy - wz, xz + wy),
            Vec3(xy + wz, 1.0 - (xx + zz), yz - wx),
            Vec3(xz - wy, yz + wx, 1.0 - (xx + yy)),
        )

    def derivative(self, w_B: Vec3) -> Quaternion:
        """Time derivative 1/2 q o (0, w_B) of the attitude for a body rate ``w_B``."""
        w, x, y, z = self
        p, q, r = w_B
        return Quaternion(
            -0.5 * (x * p + y * q + z * r),
            0.5 * (w * p + y * r - z * q),
            0.5 * (w * q + z * p - x * r),
            0.5 * (w * r + x * q - y * p),
        )


def euler_rotation(sines: Scalars, cosines: Scalars) -> Mat3:
    """Rotation Rz(psi) Ry(theta) Rx(phi) from sines and cosines of phi, theta, psi: the
    inverse of euler_angles.
    """
    return Mat3(*(euler_row(sines, cosines, axis) for axis in range(3)))


def euler_row(sines: Scalars, cosines: Scalars, axis: int) -> Vec3:
    """Row of :func:`euler_rotation`, 0 to 2."""
    (sr, sp, sy), (cr, cp, cy) = sines, cosines
    if axis == 0:
        return Vec3(cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr)
    if axis == 1:
        return Vec3(sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr)
    return Vec3(-sp, cp * sr, cp * cr)


def euler_angles(R_WB: Mat3) -> tuple[Any, Any, Any]:
    """Euler angles (phi, theta, psi) with R = Rz(psi) Ry(theta) Rx(phi); theta in
    [-pi/2, pi/2].

    The pitch comes from atan2, not asin, which loses half the digits near 90 degrees.

    Source: Diebel 2006, section 8.
    """
    r0, r1, r2 = R_WB.rows
    # |cos theta|: it vanishes at 90 degrees, where atan2 still gives the pitch
    level = sqrt(r0.x * r0.x + r1.x * r1.x)
    return atan2(r2.y, r2.z), atan2(neg(r2.x), level), atan2(r1.x, r0.x)
