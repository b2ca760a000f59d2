"""dM/dq, analytically, for every block and all five angles.

M does not depend on the position. Attitude partials use dR/dPhi_k = R S(Q e_k);
dQ/dpsi = 0.
Source: Barakou, Tzafestas, Valavanis 2026, Appendix C, completed for M_tr and M_rr,
with two corrections: (A9) is printed with a zero first column, although d2p/dth1 dth2
does not vanish, and (A18), (A19) leave out S(dp_i/dth_j) J_i.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.algebra import ZERO3, Mat3, Sym3, Vec3
from skyarm.algebra.scalars import add, mul, neg, sin
from support.euler_lagrange.euler_kinematics import Attitude, Columns, arm_points
from support.euler_lagrange.mass import (
    Matrix,
    Points,
    assemble,
    elbow_coupling,
    first_moment,
    joint_coupling,
    rotational_inertia,
    weighted_jacobian,
)
from support.euler_lagrange.parameters import PlanarArmParameters

ANGLES = range(3, 8)
"""Coordinates on which M depends: phi, theta, psi, th1, th2."""


def mass_matrix_partials(par: PlanarArmParameters, q: Sequence[Any]) -> list[Matrix]:
    """dM/dq_k for k = 0..7, each 8x8; those by x, y, z are structural zeros."""
    attitude, points = Attitude.of(q), arm_points(par, q)
    still: list[Matrix] = [[[0] * 8 for _ in range(8)] for _ in range(3)]
    by_attitude = [by_angle(par, attitude, points, k) for k in range(3)]
    return [
        *still,
        *by_attitude,
        *(by_joint(par, attitude, points, q[7], j) for j in range(2)),
    ]


def by_angle(
    par: PlanarArmParameters, attitude: Attitude, points: Points, k: int
) -> Matrix:
    """dM/dphi, dM/dtheta or dM/dpsi (k = 0, 1, 2)."""
    return assemble(
        tt=Sym3(0, 0, 0),
        tr=dM_tr_by_angle(attitude, points, k),
        rr=dM_rr_by_angle(par, attitude, points, k),
        te=dM_te_by_angle(attitude, points, k),
        re=dM_re_by_angle(par, attitude, points, k),
        ee=(0, 0, 0),
    )


def by_joint(
    par: PlanarArmParameters, attitude: Attitude, points: Points, th2: Any, j: int
) -> Matrix:
    """dM/dth1 or dM/dth2 (j = 0, 1)."""
    return assemble(
        tt=Sym3(0, 0, 0),
        tr=dM_tr_by_joint(attitude, points, j),
        rr=dM_rr_by_joint(attitude, points, j),
        te=dM_te_by_joint(attitude, points, j),
        re=dM_re_by_joint(attitude, points, j),
        ee=dM_ee_by_joint(par, th2, j),
    )


def dM_tr_by_angle(attitude: Attitude, points: Points, k: int) -> Mat3:
    """-R (S(Q e_k) S(s) Q + S(s) dQ/dPhi_k) with s = sum m_i p_i."""
    S = Mat3.cross(-first_moment(points))
    return attitude.R @ (attitude.turning(k) @ S @ attitude.Q + S @ attitude.dQ[k])


def dM_tr_by_joint(attitude: Attitude, points: Points, j: int) -> Mat3:
    """-R S(ds/dth_j) Q."""
    return attitude.R @ Mat3.cross(-weighted_jacobian(points)[j]) @ attitude.Q


def dM_rr_by_angle(
    par: PlanarArmParameters, attitude: Attitude, points: Points, k: int
) -> Sym3:
    """dQ^T I Q + Q^T I dQ."""
    half = attitude.dQ[k].T @ (rotational_inertia(par, points).full() @ attitude.Q)
    return Sym3.of_matrix(half + half.T)


def dM_rr_by_joint(attitude: Attitude, points: Points, j: int) -> Sym3:
    """Q^T (dI/dth_j) Q."""
    turned = Sym3(0, 0, 0)
    for point in points:
        half = Mat3.cross(point.J[j] * point.mass).T @ Mat3.cross(point.p)
        turned = turned + Sym3.of_matrix(half + half.T)
    return turned.rotate(attitude.Q.T)


def dM_te_by_angle(attitude: Attitude, points: Points, k: int) -> Columns:
    """(dR/dPhi_k) sum m_i J_i.

    Source: Barakou, Tzafestas, Valavanis 2026, (A5)-(A7).
    """
    spin = attitude.Q.column(k)
    first, second = weighted_jacobian(points)
    return attitude.R.apply(spin.cross(first)), attitude.R.apply(spin.cross(second))


def dM_te_by_joint(attitude: Attitude, points: Points, j: int) -> Columns:
    """R sum m_i dJ_i/dth_j.

    Source: Barakou, Tzafestas, Valavanis 2026, (A8)-(A13); the first column of (A9) is
    [c12, 0, c32], not zero.
    """
    first, second = ZERO3, ZERO3
    for point in points:
        first, second = (
            first + point.dJ[j][0] * point.mass,
            second + point.dJ[j][1] * point.mass,
        )
    return attitude.R.apply(first), attitude.R.apply(second)


def dM_re_by_angle(
    par: PlanarArmParameters, attitude: Attitude, points: Points, k: int
) -> Columns:
    """(dQ^T/dPhi_k) H with H the bracket of (60), link inertias included.

    Source: Barakou, Tzafestas, Valavanis 2026, (A14), (A15), which leave out the I_yy
    terms.
    """
    first, second = joint_coupling(par, points)
    return attitude.dQ[k].apply_T(first), attitude.dQ[k].apply_T(second)


def dM_re_by_joint(attitude: Attitude, points: Points, j: int) -> Columns:
    """Q^T sum m_i (S(dp_i/dth_j) J_i + S(p_i) dJ_i/dth_j).

    Source: Barakou, Tzafestas, Valavanis 2026, (A18), (A19), with the first product
    added.
    """
    columns: list[Vec3] = []
    for c in range(2):
        total = ZERO3
        for point in points:
            # the product of a column with itself vanishes: leaving it out keeps the
            # zero structural
            swept = ZERO3 if c == j else point.J[j].cross(point.J[c])
            total = total + (swept + point.p.cross(point.dJ[j][c])) * point.mass
        columns.append(attitude.Q.apply_T(total))
    return columns[0], columns[1]


def dM_ee_by_joint(par: PlanarArmParameters, th2: Any, j: int) -> tuple[Any, Any, Any]:
    """Entries 11, 12, 22: zero by th1; by th2 only the cosines turn.

    Source: Barakou, Tzafestas, Valavanis 2026, (A1)-(A3).
    """
    if j == 0:
        return 0, 0, 0
    slope = neg(mul(elbow_coupling(par), sin(th2)))
    return add(slope, slope), slope, 0
