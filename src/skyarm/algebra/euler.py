"""ZYX Euler angles of a rotation."""

from __future__ import annotations

from typing import Any

from skyarm.algebra.matrix import Mat3
from skyarm.scalars import atan2, neg, sqrt


def euler_angles(R_WB: Mat3) -> tuple[Any, Any, Any]:
    """phi, theta, psi with R = Rz(psi) Ry(theta) Rx(phi); theta in [-pi/2, pi/2].

    The pitch comes from atan2, not asin, which loses half the digits near 90 degrees.

    Source: Diebel 2006, section 8.
    """
    r0, r1, r2 = R_WB.rows
    level = sqrt(r0.x * r0.x + r1.x * r1.x)
    return atan2(r2.y, r2.z), atan2(neg(r2.x), level), atan2(r1.x, r0.x)
