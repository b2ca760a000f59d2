"""Potential energy and gravity vector, whole and as the paper reduces it.

M(q) [g ez; 0; 0; 0] = G(q): adding g to the commanded acceleration and adding G(q) are
the same thing, for the base and for the joints. A law that does both counts gravity
twice.
Source: Barakou, Tzafestas, Valavanis 2026, (41)-(46), (71)-(79).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.algebra.scalars import add, mul, sin
from support.euler_lagrange.euler_kinematics import Attitude, arm_points
from support.euler_lagrange.mass import first_moment, weighted_jacobian
from support.euler_lagrange.parameters import PlanarArmParameters


def potential_energy(par: PlanarArmParameters, q: Sequence[Any], gravity: Any) -> Any:
    """U = g (m z + ez . R sum m_i p_i), J, zero when the common centre of mass is at
    z = 0.

    Args:
        par: masses, lengths.
        q: [x y z | phi theta psi | th1 th2], m and rad.
        gravity: m/s^2 along world -z.

    Source: Barakou, Tzafestas, Valavanis 2026, (41)-(46).
    """
    down_row = Attitude.of(q).R.r2
    return mul(
        gravity,
        add(mul(par.mass, q[2]), down_row.dot(first_moment(arm_points(par, q)))),
    )


def gravity_vector(
    par: PlanarArmParameters, q: Sequence[Any], gravity: Any
) -> list[Any]:
    """G(q) = dU/dq, 8 entries, N and N m; arguments as :func:`potential_energy`.

    The yaw entry is a structural zero: turning about the vertical lifts nothing.

    Source: Barakou, Tzafestas, Valavanis 2026, (71)-(77).
    """
    attitude, points = Attitude.of(q), arm_points(par, q)
    up_B = attitude.R.r2
    s = first_moment(points)
    by_angle = [up_B.dot(attitude.Q.column(k).cross(s)) for k in range(2)]
    by_joint = [up_B.dot(column) for column in weighted_jacobian(points)]
    return [
        0,
        0,
        *(mul(gravity, entry) for entry in (par.mass, *by_angle, 0, *by_joint)),
    ]


def reduced_joint_gravity(
    par: PlanarArmParameters, joints: Sequence[Any], gravity: Any
) -> tuple[Any, Any]:
    """Joint entries of G for a level base (R = 1), N m.

    Args:
        par: masses, lengths.
        joints: th1, th2, rad.
        gravity: m/s^2.

    Source: Barakou, Tzafestas, Valavanis 2026, (78), (79).
    """
    upper = add(mul(par.m1, par.lc1), mul(add(par.m2, par.me), par.L1))
    lower = add(mul(par.m2, par.lc2), mul(par.me, par.L2))
    second = mul(mul(gravity, lower), sin(add(joints[0], joints[1])))
    return add(mul(mul(gravity, upper), sin(joints[0])), second), second
