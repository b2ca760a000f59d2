"""Spatial vectors and inertias of rigid-body dynamics, about one point in the axes of
one frame.

Accelerations here are *classical* (the second derivative of position), not
Featherstone's spatial accelerations; they move between points by the same law, with the
velocity products kept in a separate term by the recursions.
Source: Featherstone 2008, chapters 2, 5-7.
"""

from __future__ import annotations

from dataclasses import dataclass

from skyarm.algebra.matrix import Mat3, Sym3
from skyarm.algebra.scalars import Scalar, add, mul, neg, sub, total
from skyarm.algebra.vector import Vec3


@dataclass(frozen=True, slots=True)
class Motion:
    """Spatial motion vector: angular and linear acceleration (or joint direction) at
    the origin of a frame.
    """

    angular: Vec3
    linear: Vec3

    def __add__(self, other: Motion) -> Motion:
        """Sum of two spatial motions."""
        return Motion(self.angular + other.angular, self.linear + other.linear)

    def __mul__(self, scalar: Scalar) -> Motion:
        """Product of the spatial motion with a scalar."""
        return Motion(self.angular * scalar, self.linear * scalar)

    def dot(self, force: Force) -> Scalar:
        """Power of a spatial force along this spatial motion."""
        return add(self.angular.dot(force.torque), self.linear.dot(force.force))

    def into_child(self, R_PC: Mat3, p_PC: Vec3) -> Motion:
        """Spatial motion in the axes and at the origin of the child link."""
        return Motion(
            R_PC.apply_T(self.angular),
            R_PC.apply_T(self.linear + self.angular.cross(p_PC)),
        )


@dataclass(frozen=True, slots=True)
class Force:
    """Spatial force vector: torque about a frame's origin, and force."""

    torque: Vec3
    force: Vec3

    def __add__(self, other: Force) -> Force:
        """Sum of two spatial forces."""
        return Force(self.torque + other.torque, self.force + other.force)

    def __sub__(self, other: Force) -> Force:
        """Difference of two spatial forces."""
        return Force(self.torque - other.torque, self.force - other.force)

    def __mul__(self, scalar: Scalar) -> Force:
        """Product of the spatial force with a scalar."""
        return Force(self.torque * scalar, self.force * scalar)

    def at_origin(self, p: Vec3) -> Force:
        """Equivalent force about the origin of a force that acts at the point ``p``."""
        return Force(self.torque + p.cross(self.force), self.force)

    def into_parent(self, R_PC: Mat3, p_PC: Vec3) -> Force:
        """Spatial force in the axes and about the origin of the parent link."""
        force = R_PC.apply(self.force)
        return Force(R_PC.apply(self.torque) + p_PC.cross(force), force)


def centripetal(w: Vec3, r: Vec3) -> Vec3:
    """Centripetal acceleration w x (w x r)."""
    # products of rates, which all bodies of one frame share, before those with lengths
    p, q, s = w
    pq, qs, ps = mul(p, q), mul(q, s), mul(p, s)
    pp, qq, ss = mul(p, p), mul(q, q), mul(s, s)
    return Vec3(
        total((mul(pq, r.y), mul(ps, r.z), neg(mul(add(qq, ss), r.x)))),
        total((mul(qs, r.z), mul(pq, r.x), neg(mul(add(pp, ss), r.y)))),
        total((mul(ps, r.x), mul(qs, r.y), neg(mul(add(pp, qq), r.z)))),
    )


@dataclass(frozen=True, slots=True)
class SpatialInertia:
    """Spatial inertia: mass, first moment m c and rotational inertia about the frame's
    origin.
    """

    mass: Scalar
    moment: Vec3
    inertia: Sym3

    @classmethod
    def of_body(cls, mass: Scalar, com: Vec3, inertia_com: Sym3) -> SpatialInertia:
        """Spatial inertia from mass, centre of mass and the rotational inertia about
        that centre.
        """
        return cls(mass, com * mass, inertia_com + Sym3.parallel_axis(mass, com))

    def __add__(self, other: SpatialInertia) -> SpatialInertia:
        """Spatial inertia of two bodies joined rigidly."""
        return SpatialInertia(
            add(self.mass, other.mass),
            self.moment + other.moment,
            self.inertia + other.inertia,
        )

    def apply(self, a: Motion) -> Force:
        """Spatial force that accelerates a body at rest by the spatial acceleration
        ``a``.
        """
        return Force(
            self.inertia.apply(a.angular) + self.moment.cross(a.linear),
            a.linear * self.mass + a.angular.cross(self.moment),
        )

    def velocity_force(self, w: Vec3) -> Force:
        """Gyroscopic and centrifugal force of a body that turns with ``w`` about an
        unaccelerated origin.

        w x (I w) in products of rates and differences of moments, which bodies with a
        common axis share.
        """
        J = self.inertia
        p, q, r = w
        pq, qr, pr = mul(p, q), mul(q, r), mul(p, r)
        pp, qq, rr = mul(p, p), mul(q, q), mul(r, r)
        torque = Vec3(
            total(
                (
                    mul(sub(J.zz, J.yy), qr),
                    mul(J.yz, sub(qq, rr)),
                    mul(J.xz, pq),
                    neg(mul(J.xy, pr)),
                )
            ),
            total(
                (
                    mul(sub(J.xx, J.zz), pr),
                    mul(J.xz, sub(rr, pp)),
                    mul(J.xy, qr),
                    neg(mul(J.yz, pq)),
                )
            ),
            total(
                (
                    mul(sub(J.yy, J.xx), pq),
                    mul(J.xy, sub(pp, qq)),
                    mul(J.yz, pr),
                    neg(mul(J.xz, qr)),
                )
            ),
        )
        return Force(torque, centripetal(w, self.moment))

    def rotate(self, R: Mat3) -> SpatialInertia:
        """Spatial inertia of the body rotated by R about the origin."""
        return SpatialInertia(self.mass, R.apply(self.moment), self.inertia.rotate(R))

    def into_parent(self, R_PC: Mat3, p_PC: Vec3) -> SpatialInertia:
        """Spatial inertia in the axes and about the origin of the parent link.

        I' = R I R^T + S(h)^T S(p) + S(p)^T S(h) + m S(p)^T S(p) with h = R m c, which
        needs no division by the mass.
        """
        h = R_PC.apply(self.moment)
        shifted = h + p_PC * self.mass
        return SpatialInertia(
            self.mass,
            shifted,
            self.inertia.rotate(R_PC) + _steiner(h, p_PC) + _steiner(p_PC, shifted),
        )

    def as_articulated(self) -> ArticulatedInertia:
        """Articulated inertia of this single rigid body."""
        return ArticulatedInertia(
            self.inertia, Mat3.cross(self.moment), Sym3.isotropic(self.mass)
        )


def _steiner(a: Vec3, b: Vec3) -> Sym3:
    """Symmetric matrix from the upper triangle of S(a)^T S(b), with cross-product
    matrices S.
    """
    m = Mat3.cross(a).T @ Mat3.cross(b)
    return Sym3.of_matrix(m)


@dataclass(frozen=True, slots=True)
class ArticulatedInertia:
    """Articulated inertia [[J, H], [H^T, M]], which maps (angular, linear) acceleration
    to (torque, force).
    """

    J: Sym3
    H: Mat3
    M: Sym3

    def __add__(self, other: ArticulatedInertia) -> ArticulatedInertia:
        """Sum of two articulated inertias."""
        return ArticulatedInertia(self.J + other.J, self.H + other.H, self.M + other.M)

    def apply(self, a: Motion) -> Force:
        """Spatial force that gives the spatial acceleration ``a`` while the outer
        joints move freely.
        """
        return Force(
            self.J.apply(a.angular) + self.H.apply(a.linear),
            self.H.apply_T(a.angular) + self.M.apply(a.linear),
        )

    def without(
        self, S: Motion, U: Force, inverse_d: Scalar, *, free: bool = True
    ) -> ArticulatedInertia:
        """Articulated inertia without the free direction of a joint, self - U U^T / d.

        A joint is free if its drive has none. Then nothing is left along S: where S is
        a coordinate axis, its row and column are exact zeros and become structure.
        """
        n, f = U.torque, U.force
        ni, fi = n * inverse_d, f * inverse_d
        J, H = (
            self.J - _outer_symmetric(n, ni),
            self.H - Mat3(f * ni.x, f * ni.y, f * ni.z),
        )
        M = self.M - _outer_symmetric(f, fi)
        if not free:
            return ArticulatedInertia(J, H, M)
        # an axis at an angle clears no single row, so that nothing becomes structure
        turning, sliding = S.angular.coordinate_axis(), S.linear.coordinate_axis()
        if turning is not None:
            return ArticulatedInertia(J.clear_axis(turning), H.cleared_row(turning), M)
        if sliding is not None:
            return ArticulatedInertia(
                J, H.T.cleared_row(sliding).T, M.clear_axis(sliding)
            )
        return ArticulatedInertia(J, H, M)

    def into_parent(self, R_PC: Mat3, p_PC: Vec3) -> ArticulatedInertia:
        """Articulated inertia in the axes and about the origin of the parent link."""
        J, M = self.J.rotate(R_PC), self.M.rotate(R_PC)
        H = self.H.rotate(R_PC)
        S = Mat3.cross(p_PC)
        H_shifted = H + S @ M.full()
        # J' = J - H S - (H S)^T - S M S, with H' = H + S M: J' = J + S H'^T ... written
        # to use H' once
        J_shifted = J.full() - H @ S + S @ H_shifted.T
        return ArticulatedInertia(Sym3.of_matrix(J_shifted), H_shifted, M)


def _outer_symmetric(a: Vec3, b: Vec3) -> Sym3:
    """Outer product a b^T of parallel vectors, which is symmetric."""
    # rounding makes the halves differ: the upper one is taken for both
    m = Mat3(b * a.x, b * a.y, b * a.z)
    return Sym3.of_matrix(m)
