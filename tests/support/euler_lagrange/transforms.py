"""Between body axes and Euler rates: torques, angular accelerations, angles of a
rotation.

At pitch +-90 degrees Q is singular and its inverse gives inf or NaN;
:func:`singularity_measure` tells a boundary.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.algebra import Mat3, Vec3
from skyarm.algebra.scalars import cos, divide, mul, neg, sin
from support.euler_lagrange.euler_kinematics import rate_matrix_partials


def singularity_measure(theta: Any) -> Any:
    """cos(theta), the determinant of Q: zero where the Euler angles lose a
    direction.
    """
    return cos(theta)


def rate_matrix_inverse(phi: Any, theta: Any) -> Mat3:
    """Q^-1 of [phi', theta', psi'] = Q^-1 w_B.

    Source: Barakou, Tzafestas, Valavanis 2026, (3), inverted.
    """
    sp, cp, st, ct = sin(phi), cos(phi), sin(theta), cos(theta)
    s_over, c_over = divide(sp, ct), divide(cp, ct)
    return Mat3(
        Vec3(1, mul(s_over, st), mul(c_over, st)),
        Vec3(0, cp, neg(sp)),
        Vec3(0, s_over, c_over),
    )


def rate_matrix_rate(angles: Sequence[Any], angle_rates: Sequence[Any]) -> Mat3:
    """dQ/dt, from angles (rad) and their rates (rad/s)."""
    by_phi, by_theta, _ = rate_matrix_partials(angles[0], angles[1])
    rate: Mat3 = by_phi * angle_rates[0] + by_theta * angle_rates[1]
    return rate


def body_torque(angles: Sequence[Any], euler_torque: Vec3) -> Vec3:
    """Torque in body axes, N m, of the generalized torque dual to the Euler rates: Q^-T
    tau_Phi.

    Source: Barakou, Tzafestas, Valavanis 2026, (94).
    """
    return rate_matrix_inverse(angles[0], angles[1]).apply_T(euler_torque)


def euler_acceleration(
    angles: Sequence[Any], angle_rates: Sequence[Any], angular_B: Vec3
) -> Vec3:
    """Second derivative of the Euler angles, rad/s^2, of a body angular acceleration:
    Q^-1 (alpha - Qdot Phidot).

    Source: Barakou, Tzafestas, Valavanis 2026, (95).
    """
    turning = rate_matrix_rate(angles, angle_rates).apply(Vec3(*angle_rates))
    return rate_matrix_inverse(angles[0], angles[1]).apply(angular_B - turning)


def euler_rates(angles: Sequence[Any], rate_B: Vec3) -> Vec3:
    """Euler rates, rad/s, of the body rate: Q^-1 w_B.

    Source: Barakou, Tzafestas, Valavanis 2026, (3), inverted.
    """
    return rate_matrix_inverse(angles[0], angles[1]).apply(rate_B)
