"""Mass matrix of the 8x8 form, block by block.

Indices: t translation, r rotation (Euler angles), e joints (the paper's eta). Sums run
over link 1, link 2 and the end effector; S(a) b = a x b.
Source: Barakou, Tzafestas, Valavanis 2026, (51)-(66) and Appendix B.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.algebra import E_Y, ZERO3, Mat3, Sym3, Vec3
from skyarm.algebra.scalars import add, cos, mul
from support.euler_lagrange.euler_kinematics import (
    ArmPoint,
    Attitude,
    Columns,
    arm_points,
)
from support.euler_lagrange.parameters import PlanarArmParameters

Points = tuple[ArmPoint, ArmPoint, ArmPoint]
Matrix = list[list[Any]]


def mass_matrix(par: PlanarArmParameters, q: Sequence[Any]) -> Matrix:
    """M(q), 8x8, rows as lists: kinetic energy is 1/2 qd^T M qd.

    Args:
        par: masses, lengths, inertias.
        q: [x y z | phi theta psi | th1 th2], m and rad.

    Source: Barakou, Tzafestas, Valavanis 2026, (51), (52), (58).
    """
    attitude, points = Attitude.of(q), arm_points(par, q)
    return assemble(
        tt=M_tt(par),
        tr=M_tr(attitude, points),
        rr=M_rr(par, attitude, points),
        te=M_te(attitude, points),
        re=M_re(par, attitude, points),
        ee=M_ee(par, q[7]),
    )


def first_moment(points: Points) -> Vec3:
    """Sum m_i p_i, body axes, kg m."""
    total = ZERO3
    for point in points:
        total = total + point.p * point.mass
    return total


def weighted_jacobian(points: Points) -> Columns:
    """Sum m_i J_i, which is the gradient of the first moment, kg m/rad."""
    first, second = ZERO3, ZERO3
    for point in points:
        first, second = (
            first + point.J[0] * point.mass,
            second + point.J[1] * point.mass,
        )
    return first, second


def M_tt(par: PlanarArmParameters) -> Sym3:
    """(mb + m1 + m2 + me) 1.

    Source: Barakou, Tzafestas, Valavanis 2026, (53).
    """
    return Sym3.isotropic(par.mass)


def M_tr(attitude: Attitude, points: Points) -> Mat3:
    """-sum m_i S(R p_i) R Q, written as -R S(sum m_i p_i) Q.

    Source: Barakou, Tzafestas, Valavanis 2026, (54), (55).
    """
    return attitude.R @ Mat3.cross(-first_moment(points)) @ attitude.Q


def M_rr(par: PlanarArmParameters, attitude: Attitude, points: Points) -> Sym3:
    """Q^T (Ib + (I1yy + I2yy) ey ey^T + sum m_i S(p_i)^T S(p_i)) Q.

    Source: Barakou, Tzafestas, Valavanis 2026, (57).
    """
    return rotational_inertia(par, points).rotate(attitude.Q.T)


def rotational_inertia(par: PlanarArmParameters, points: Points) -> Sym3:
    """Inertia of the whole about the base origin, body axes, kg m^2."""
    total = par.Ib + Sym3(0, add(par.I1yy, par.I2yy), 0)
    for point in points:
        total = total + Sym3.parallel_axis(point.mass, point.p)
    return total


def M_te(attitude: Attitude, points: Points) -> Columns:
    """R sum m_i J_i.

    Source: Barakou, Tzafestas, Valavanis 2026, (59).
    """
    first, second = weighted_jacobian(points)
    return attitude.R.apply(first), attitude.R.apply(second)


def M_re(par: PlanarArmParameters, attitude: Attitude, points: Points) -> Columns:
    """Q^T (sum m_i S(p_i) J_i + I1yy ey [1 0] + I2yy ey [1 1]).

    Source: Barakou, Tzafestas, Valavanis 2026, (60).
    """
    first, second = joint_coupling(par, points)
    return attitude.Q.apply_T(first), attitude.Q.apply_T(second)


def joint_coupling(par: PlanarArmParameters, points: Points) -> Columns:
    """Angular momentum about the base origin per joint rate, body axes, kg m^2/rad."""
    first, second = E_Y * add(par.I1yy, par.I2yy), E_Y * par.I2yy
    for point in points:
        moment = point.p * point.mass
        first, second = (
            first + moment.cross(point.J[0]),
            second + moment.cross(point.J[1]),
        )
    return first, second


def M_ee(par: PlanarArmParameters, th2: Any) -> tuple[Any, Any, Any]:
    """Entries 11, 12, 22 of sum m_i J_i^T J_i + [[I1yy + I2yy, I2yy], [I2yy, I2yy]],
    multiplied out.

    Source: Barakou, Tzafestas, Valavanis 2026, (61)-(66).
    """
    own = add(
        add(mul(par.m2, mul(par.lc2, par.lc2)), mul(par.me, mul(par.L2, par.L2))),
        par.I2yy,
    )
    coupling = mul(elbow_coupling(par), cos(th2))
    shoulder = add(
        mul(par.m1, mul(par.lc1, par.lc1)),
        mul(add(par.m2, par.me), mul(par.L1, par.L1)),
    )
    first = add(add(add(shoulder, par.I1yy), own), add(coupling, coupling))
    return first, add(own, coupling), own


def elbow_coupling(par: PlanarArmParameters) -> Any:
    """(m2 lc2 + me L2) L1, kg m^2: the factor of cos th2 in M_ee."""
    return mul(add(mul(par.m2, par.lc2), mul(par.me, par.L2)), par.L1)


def assemble(
    *, tt: Sym3, tr: Mat3, rr: Sym3, te: Columns, re: Columns, ee: tuple[Any, Any, Any]
) -> Matrix:
    """Assemble the symmetric 8x8 matrix from its blocks: M_tt, M_tr, M_rr, columns of
    M_te, M_re, entries of M_ee.

    Source: Barakou, Tzafestas, Valavanis 2026, (51), (52), (58).
    """
    M: Matrix = [[0] * 8 for _ in range(8)]
    diagonal_t, diagonal_r = tt.full().rows, rr.full().rows
    for i in range(3):
        for j in range(3):
            M[i][j], M[3 + i][3 + j] = tuple(diagonal_t[i])[j], tuple(diagonal_r[i])[j]
            M[i][3 + j] = M[3 + j][i] = tuple(tr.rows[i])[j]
        for j in range(2):
            M[i][6 + j] = M[6 + j][i] = tuple(te[j])[i]
            M[3 + i][6 + j] = M[6 + j][3 + i] = tuple(re[j])[i]
    M[6][6], M[6][7], M[7][6], M[7][7] = ee[0], ee[1], ee[1], ee[2]
    return M
