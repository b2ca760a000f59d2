"""Rigid-body dynamics in Euler coordinates q = [x y z | phi theta psi | joints], ZYX
angles, over any scalar.

The tree's dynamics by the map T(q) from q's time derivative to the generalised velocity
[v_W, w_B, joint rates]: M = T^T M_tree T, and Coriolis matrix by Christoffel's symbols
of M. T is the identity but for Q, w_B = Q [phi', theta', psi'], whose determinant is
cos theta: at a pitch of 90 degrees M, C and G exist, M is singular, and Q has no
inverse.

Source: Barakou, Tzafestas, Valavanis 2026, (3)-(4), (51)-(79); Diebel 2006, section 8.
"""

from __future__ import annotations

from collections.abc import Sequence

from skyarm.algebra import (
    E_X,
    E_Y,
    E_Z,
    ZERO3,
    Mat3,
    Motion,
    Scalar,
    Vec3,
    axis_rotation,
    inner_product,
)
from skyarm.algebra.scalars import add, cos, divide, mul, neg, sin, sub
from skyarm.algebra.scalars.taylor import Taylor, nth_derivative
from skyarm.dynamics.composite_body import mass_matrix as tree_mass_matrix
from skyarm.dynamics.newton_euler import inverse_dynamics
from skyarm.vehicle import Vehicle

Matrix = list[list[Scalar]]
"""Matrix as a list of rows."""


def attitude(q: Sequence[Scalar]) -> Mat3:
    """Rotation matrix R_WB = Rz(psi) Ry(theta) Rx(phi) of the Euler angles q[3:6]."""
    return (
        axis_rotation(E_Z, q[5]) @ axis_rotation(E_Y, q[4]) @ axis_rotation(E_X, q[3])
    )


def rate_matrix(phi: Scalar, theta: Scalar) -> Mat3:
    """Matrix Q from Euler angle rates to angular velocity in base axes: w_B = Q [phi',
    theta', psi'].

    Source: Barakou, Tzafestas, Valavanis 2026, (3)-(4).
    """
    sp, cp, st, ct = sin(phi), cos(phi), sin(theta), cos(theta)
    return Mat3(
        Vec3(1, 0, neg(st)), Vec3(0, cp, mul(sp, ct)), Vec3(0, neg(sp), mul(cp, ct))
    )


def rate_matrix_inverse(phi: Scalar, theta: Scalar) -> Mat3:
    """Inverse of the Euler angle rate matrix Q; its entries are infinite at a pitch of
    90 degrees.
    """
    sp, cp, st, ct = sin(phi), cos(phi), sin(theta), cos(theta)
    s_over, c_over = divide(sp, ct), divide(cp, ct)
    return Mat3(
        Vec3(1, mul(s_over, st), mul(c_over, st)),
        Vec3(0, cp, neg(sp)),
        Vec3(0, s_over, c_over),
    )


def rate_matrix_rate(phi: Scalar, theta: Scalar, rates: Vec3) -> Mat3:
    """Time derivative dQ/dt of the Euler angle rate matrix, for given Euler angle rates
    (rad/s).
    """
    sp, cp, st, ct = sin(phi), cos(phi), sin(theta), cos(theta)
    # Q does not depend on psi, which turns first and about the world's z
    by_phi = Mat3(
        ZERO3, Vec3(0, neg(sp), mul(cp, ct)), Vec3(0, neg(cp), neg(mul(sp, ct)))
    )
    by_theta = Mat3(
        Vec3(0, 0, neg(ct)), Vec3(0, 0, neg(mul(sp, st))), Vec3(0, 0, neg(mul(cp, st)))
    )
    return by_phi * rates.x + by_theta * rates.y


def mass_matrix(vehicle: Vehicle, q: Sequence[Scalar]) -> Matrix:
    """Mass matrix M(q) = T^T M_tree T, (6+n) x (6+n): kinetic energy is 1/2 qd^T M
    qd.
    """
    Q = rate_matrix(q[3], q[4])
    M = tree_mass_matrix(vehicle, attitude(q), q[6:])
    # M is symmetric: its columns, mapped, are the rows of T^T M, whose columns are
    # mapped again
    for _ in range(2):
        M = [_onto_euler_rates(Q, column) for column in zip(*M, strict=True)]
    n = range(len(M))
    # symmetric to the last bit, though two roundings of one sum may differ in it
    return [[M[min(i, j)][max(i, j)] for j in n] for i in n]


def mass_matrix_partials(vehicle: Vehicle, q: Sequence[Scalar]) -> list[Matrix]:
    """Partial derivatives dM/dq_k of the mass matrix, one per coordinate, exact to
    rounding; zero for position.
    """
    n = len(q)
    # kinetic energy does not depend on where the base is
    partials: list[Matrix] = [[[0] * n for _ in range(n)] for _ in range(3)]
    for k in range(3, n):
        # first-order Taylor arithmetic: no step size, and no error of differences
        M = mass_matrix(vehicle, (*q[:k], Taylor((q[k], 1)), *q[k + 1 :]))
        partials.append([[nth_derivative(entry, 1) for entry in row] for row in M])
    return partials


def coriolis_matrix(
    vehicle: Vehicle, q: Sequence[Scalar], qd: Sequence[Scalar]
) -> Matrix:
    """Coriolis matrix C_ij = sum_k 1/2 (dM_ij/dq_k + dM_ik/dq_j - dM_jk/dq_i) qd_k, for
    which dM/dt - 2 C is skew.

    Source: Barakou, Tzafestas, Valavanis 2026, (67)-(68).
    """
    partials = mass_matrix_partials(vehicle, q)
    n = range(len(q))
    rate = [
        [inner_product([partial[i][j] for partial in partials], qd) for j in n]
        for i in n
    ]
    # swept[j][i] = sum_k dM_ik/dq_j qd_k
    swept = [[inner_product(row, qd) for row in partial] for partial in partials]
    return [
        [mul(0.5, add(rate[i][j], sub(swept[j][i], swept[i][j]))) for j in n] for i in n
    ]


def gravity_vector(
    vehicle: Vehicle, q: Sequence[Scalar], gravity: Scalar
) -> list[Scalar]:
    """Gravity vector G(q), the gradient of the potential energy: the force that holds
    the vehicle at rest.
    """
    R = attitude(q)
    still = (0,) * vehicle.n
    # rest under gravity is an upward proper acceleration of g
    force, torques = inverse_dynamics(
        vehicle, q[6:], ZERO3, still, Motion(ZERO3, R.apply_T(E_Z * gravity)), still
    )
    return _onto_euler_rates(
        rate_matrix(q[3], q[4]), (*R.apply(force.force), *force.torque, *torques)
    )


def _onto_euler_rates(Q: Mat3, dual: Sequence[Scalar]) -> list[Scalar]:
    """Product T^T f: a generalised force or momentum converted to Euler coordinates."""
    return [*dual[:3], *Q.apply_T(Vec3(*dual[3:6])), *dual[6:]]
