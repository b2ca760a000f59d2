"""Attitude and arm kinematics of the paper: ZYX Euler angles, points of the planar arm,
Jacobians, second partials.

Configuration q = [x y z | phi theta psi | th1 th2]. World z up, body x forward, y left,
z up. th1 = th2 = 0 hangs straight down; positive angles swing the tip towards -x.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.algebra import E_X, E_Y, E_Z, ZERO3, Mat3, Vec3, axis_rotation
from skyarm.algebra.scalars import Scalar, add, cos, mul, neg, sin
from support.euler_lagrange.parameters import PlanarArmParameters

Columns = tuple[Vec3, Vec3]
"""A 3x2 block by its columns: one per joint."""


def rotation(phi: Any, theta: Any, psi: Any) -> Mat3:
    """R = Rz(psi) Ry(theta) Rx(phi), body to world.

    Source: Barakou, Tzafestas, Valavanis 2026, section 2.1.
    """
    return axis_rotation(E_Z, psi) @ axis_rotation(E_Y, theta) @ axis_rotation(E_X, phi)


def rate_matrix(phi: Any, theta: Any) -> Mat3:
    """Q of w_B = Q [phi', theta', psi'].

    Source: Barakou, Tzafestas, Valavanis 2026, (3)-(4).
    """
    sp, cp, st, ct = sin(phi), cos(phi), sin(theta), cos(theta)
    return Mat3(
        Vec3(1, 0, neg(st)), Vec3(0, cp, mul(sp, ct)), Vec3(0, neg(sp), mul(cp, ct))
    )


def rate_matrix_partials(phi: Any, theta: Any) -> tuple[Mat3, Mat3, Mat3]:
    """dQ/dphi, dQ/dtheta, dQ/dpsi (zero).

    Source: Barakou, Tzafestas, Valavanis 2026, (A16), (A17), transposed.
    """
    sp, cp, st, ct = sin(phi), cos(phi), sin(theta), cos(theta)
    by_phi = Mat3(
        ZERO3, Vec3(0, neg(sp), mul(cp, ct)), Vec3(0, neg(cp), neg(mul(sp, ct)))
    )
    by_theta = Mat3(
        Vec3(0, 0, neg(ct)), Vec3(0, 0, neg(mul(sp, st))), Vec3(0, 0, neg(mul(cp, st)))
    )
    return by_phi, by_theta, Mat3(ZERO3, ZERO3, ZERO3)


@dataclass(frozen=True, slots=True)
class Attitude:
    """R, Q and the partials of Q by (phi, theta, psi)."""

    R: Mat3
    Q: Mat3
    dQ: tuple[Mat3, Mat3, Mat3]

    @classmethod
    def of(cls, q: Sequence[Any]) -> Attitude:
        """Kinematics of the angles q[3:6], rad."""
        phi, theta, psi = q[3:6]
        return cls(
            rotation(phi, theta, psi),
            rate_matrix(phi, theta),
            rate_matrix_partials(phi, theta),
        )

    def turning(self, k: int) -> Mat3:
        """R^T dR/dPhi_k = S(Q e_k), because R' = R S(Q Phi')."""
        return Mat3.cross(self.Q.column(k))


@dataclass(frozen=True, slots=True)
class ArmPoint:
    """A mass of the arm, in body axes.

    Attributes:
        mass: kg.
        p: position, m.
        J: dp/dth1 and dp/dth2, m/rad.
        dJ: dJ[j] holds the columns of dJ/dth_j; dJ[0][1] = dJ[1][0], because J is a
            gradient.
    """

    mass: Scalar
    p: Vec3
    J: Columns
    dJ: tuple[Columns, Columns]


def link1(par: PlanarArmParameters, joints: Sequence[Any]) -> ArmPoint:
    """Centre of mass of link 1.

    Source: Barakou, Tzafestas, Valavanis 2026, (5), (13), (14).
    """
    return _point(par.m1, par.lc1, 0, joints)


def link2(par: PlanarArmParameters, joints: Sequence[Any]) -> ArmPoint:
    """Centre of mass of link 2.

    Source: Barakou, Tzafestas, Valavanis 2026, (9), (15), (16).
    """
    return _point(par.m2, par.L1, par.lc2, joints)


def end_effector(par: PlanarArmParameters, joints: Sequence[Any]) -> ArmPoint:
    """Point mass at the tip.

    Source: Barakou, Tzafestas, Valavanis 2026, (10), (17), (18).
    """
    return _point(par.me, par.L1, par.L2, joints)


def arm_points(
    par: PlanarArmParameters, q: Sequence[Any]
) -> tuple[ArmPoint, ArmPoint, ArmPoint]:
    """Give the three masses over which every sum of the paper runs, at the joint angles
    q[6:8], rad.
    """
    joints = q[6:8]
    return link1(par, joints), link2(par, joints), end_effector(par, joints)


def _point(mass: Any, along1: Any, along2: Any, joints: Sequence[Any]) -> ArmPoint:
    """Place a mass at p = along1 e(th1) + along2 e(th1 + th2) with e(a) = [-sin a, 0,
    -cos a], for which e'' = -e.
    """
    a, b = joints[0], add(joints[0], joints[1])
    upper, lower = _direction(a) * along1, _direction(b) * along2
    upper_turned, lower_turned = (
        _direction_partial(a) * along1,
        _direction_partial(b) * along2,
    )
    p, bent = upper + lower, -lower
    return ArmPoint(
        mass, p, (upper_turned + lower_turned, lower_turned), ((-p, bent), (bent, bent))
    )


def _direction(angle: Any) -> Vec3:
    return Vec3(neg(sin(angle)), 0, neg(cos(angle)))


def _direction_partial(angle: Any) -> Vec3:
    return Vec3(neg(cos(angle)), 0, sin(angle))
