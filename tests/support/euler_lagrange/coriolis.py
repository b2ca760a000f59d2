"""Coriolis and centrifugal matrix: Christoffel symbols of M, analytic and by
differences as published.

Source: Barakou, Tzafestas, Valavanis 2026, (67)-(70) and Appendix C.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.algebra import inner_product
from skyarm.algebra.scalars import add, divide, mul, neg, sin, sqrt, sub, where
from support.euler_lagrange.mass import Matrix, elbow_coupling, mass_matrix
from support.euler_lagrange.mass_derivative import ANGLES, mass_matrix_partials
from support.euler_lagrange.parameters import PlanarArmParameters

STEP = 6e-6
"""Cube root of the rounding unit: truncation and rounding of a central difference meet
(Press et al. 2007, 5.7)."""


def coriolis_matrix(
    par: PlanarArmParameters, q: Sequence[Any], qd: Sequence[Any]
) -> Matrix:
    """C(q, qd), 8x8, from the analytic partials of M.

    Args:
        par: masses, lengths, inertias.
        q: [x y z | phi theta psi | th1 th2], m and rad.
        qd: its derivative, m/s and rad/s.

    Source: Barakou, Tzafestas, Valavanis 2026, (67), (68).
    """
    return christoffel(mass_matrix_partials(par, q), qd)


def coriolis_central_differences(
    par: PlanarArmParameters, q: Sequence[Any], qd: Sequence[Any], *, step: Any = STEP
) -> Matrix:
    """C(q, qd) from central differences of M, as the paper computes it, whose step is
    not published.

    At the default step the error is near 1e-11, with 1e-3 rad near 1e-8: small, but not
    rounding.

    Args:
        par: masses, lengths, inertias.
        q: [x y z | phi theta psi | th1 th2], m and rad.
        qd: its derivative, m/s and rad/s.
        step: rad, of each angle.

    Source: Barakou, Tzafestas, Valavanis 2026, (67), (68) and Appendix C, last
    paragraph.
    """
    partials: list[Matrix] = [[[0] * 8 for _ in range(8)] for _ in range(3)]
    for k in ANGLES:
        ahead, behind = (
            mass_matrix(par, [*q[:k], q[k] + h, *q[k + 1 :]]) for h in (step, -step)
        )
        partials.append(_difference(ahead, behind, step))
    return christoffel(partials, qd)


def christoffel(partials: Sequence[Matrix], qd: Sequence[Any]) -> Matrix:
    """C_ij = sum_k 1/2 (dM_ij/dq_k + dM_ik/dq_j - dM_jk/dq_i) qd_k.

    Source: Barakou, Tzafestas, Valavanis 2026, (67), (68).
    """
    n = len(qd)
    rate = [
        [inner_product([partial[i][j] for partial in partials], qd) for j in range(n)]
        for i in range(n)
    ]
    # swept[j][i] = sum_k dM_ik/dq_j qd_k
    swept = [[inner_product(row, qd) for row in partial] for partial in partials]
    return [
        [mul(0.5, add(rate[i][j], sub(swept[j][i], swept[i][j]))) for j in range(n)]
        for i in range(n)
    ]


def coriolis_force(
    par: PlanarArmParameters, q: Sequence[Any], qd: Sequence[Any]
) -> list[Any]:
    """C(q, qd) qd, 8 entries, without the matrix: Mdot qd - 1/2 d(qd^T M qd)/dq.

    Source: Barakou, Tzafestas, Valavanis 2026, (67), (68), contracted with qd.
    """
    swept = [
        [inner_product(row, qd) for row in partial]
        for partial in mass_matrix_partials(par, q)
    ]
    along = [inner_product([column[i] for column in swept], qd) for i in range(len(qd))]
    return [
        sub(along[i], mul(0.5, inner_product(swept[i], qd))) for i in range(len(qd))
    ]


def C_ee(par: PlanarArmParameters, th2: Any, joint_rates: Sequence[Any]) -> Matrix:
    """Give the manipulator's own block, 2x2, with h = (m2 lc2 + me L2) L1 sin th2.

    It is the joint block of C only while the base does not pitch: the whole block has
    th1d + w_y in place of th1d, with w_y the body rate about the joint axes.

    Source: Barakou, Tzafestas, Valavanis 2026, (A4).
    """
    h = mul(elbow_coupling(par), sin(th2))
    first, second = joint_rates
    return [[neg(mul(h, second)), neg(mul(h, add(first, second)))], [mul(h, first), 0]]


def mass_rate(
    par: PlanarArmParameters, q: Sequence[Any], qd: Sequence[Any], *, step: Any = STEP
) -> Matrix:
    """dM/dt by a central difference along the motion, in which no partial of M takes
    part.

    Args:
        par: masses, lengths, inertias.
        q: [x y z | phi theta psi | th1 th2], m and rad.
        qd: its derivative, m/s and rad/s.
        step: s.
    """
    ahead, behind = (
        mass_matrix(par, [x + h * v for x, v in zip(q, qd, strict=True)])
        for h in (step, -step)
    )
    return _difference(ahead, behind, step)


def skew_residual(rate: Matrix, C: Matrix) -> Any:
    """|N + N^T| / |dM/dt| (Frobenius) of N = dM/dt - 2 C: zero if N is skew; zero at
    rest.

    Args:
        rate: dM/dt from another source than C, such as :func:`mass_rate`; from the same
            partials it is zero for any.
        C: Coriolis matrix of the same state.

    Source: Barakou, Tzafestas, Valavanis 2026, Appendix C; they log it below 5e-4 and
    leave the norm open.
    """
    n = range(len(C))
    N = [[sub(rate[i][j], mul(2.0, C[i][j])) for j in n] for i in n]
    symmetric = _norm([add(N[i][j], N[j][i]) for i in n for j in n])
    scale = _norm([rate[i][j] for i in n for j in n])
    return where(scale > 0.0, divide(symmetric, scale), 0.0 * scale)


def _difference(ahead: Matrix, behind: Matrix, step: Any) -> Matrix:
    return [
        [
            0 if type(a) is int else divide(a - b, 2.0 * step)
            for a, b in zip(row, other, strict=True)
        ]
        for row, other in zip(ahead, behind, strict=True)
    ]


def _norm(values: Sequence[Any]) -> Any:
    return sqrt(inner_product(values, values))
