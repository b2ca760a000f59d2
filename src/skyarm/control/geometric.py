"""The geometric position controller as RotorS flies it.

Source: Lee, Leok, McClamroch 2010; Furrer et al. 2016 (RotorS), lee_position_controller.cpp at commit cd813b7a8c37;
eq. (80)-(85) of Barakou et al. 2026. Deviations: two guarded degenerate cases, which RotorS leaves as NaN.
"""

from __future__ import annotations

from typing import Any

from skyarm.algebra import E_Z, Mat3, Quaternion, Vec3, ldl_solve
from skyarm.control.model import GeometricGains
from skyarm.scalars import atan2, cos, divide, logical_or, mul, sin, sqrt, where

RATE_ERRORS = ("rotors", "corrected")

SMALL_ACCELERATION = 1e-6
"""m/s^2. Below this commanded specific force the thrust direction is undefined: the present one is kept."""

SMALL_SINE = 1e-6
"""Sine of the angle between thrust direction and heading below which the heading does not fix the attitude."""


def downward_acceleration(
    gains: GeometricGains, mass: Any, gravity: Any, position_error: Vec3, velocity_error: Vec3, acceleration: Vec3
) -> Vec3:
    """a_d of (82), world axes, m/s^2: it points DOWN in hover; the wanted specific force is -a_d.

    a_d = (Kp e_p + Kv e_v) / m - g e_3 - pdd_d
    """
    pull = gains.position.scaled(position_error) + gains.velocity.scaled(velocity_error)
    a_d: Vec3 = pull * divide(1.0, mass) - E_Z * gravity - acceleration
    return a_d


def desired_attitude(a_d: Vec3, yaw: Any, R_WB: Mat3) -> Mat3:
    """R_d with b3 along -a_d and b1 as near the heading as b3 allows.

    b3 = -a_d/|a_d|, b2 = b3 x [cos psi, sin psi, 0] normalised, R_d = [b2 x b3, b2, b3]. With no commanded force b3 is the
    present one; with b3 along the heading, b2 is the heading's left.
    """
    squared = a_d.dot(a_d)
    scale = divide(1.0, sqrt(squared))
    vanishes = squared < SMALL_ACCELERATION * SMALL_ACCELERATION
    b3 = _choose(vanishes, R_WB.column(2), -a_d * scale)
    heading = Vec3(cos(yaw), sin(yaw), 0)
    left = Vec3(-heading.y, heading.x, 0.0)
    side = b3.cross(heading)
    length = side.norm()
    b2 = _choose(length < SMALL_SINE, left, side * divide(1.0, length))
    return Mat3.columns(b2.cross(b3), b2, b3)


def _choose(condition: Any, a: Vec3, b: Vec3) -> Vec3:
    return Vec3(*(where(condition, x, y) for x, y in zip(a, b, strict=True)))


def attitude_error(R_WB: Mat3, R_d: Mat3) -> Vec3:
    """e_R of (83): vee(1/2 (R_d^T R - R^T R_d)); zero also at 180 degrees, an unstable equilibrium."""
    return (R_d.T @ R_WB).vee_antisymmetric()


def rate_error(w_B: Vec3, R_WB: Mat3, R_d: Mat3, yaw_rate: Any, form: str) -> Vec3:
    """e_w of (84) with w_d = [0, 0, yaw rate] in the desired body's axes.

    "corrected" is Lee's w - R^T R_d w_d; "rotors" is RotorS's own w - R_d^T R w_d, which differs once the yaw rate is not zero.
    """
    w_d = Vec3(0, 0, yaw_rate)
    relative = R_d.T @ R_WB if form == "rotors" else R_WB.T @ R_d
    return w_B - relative.apply(w_d)


def angular_acceleration(gains: GeometricGains, inertia: Any, e_R: Vec3, e_w: Vec3) -> Vec3:
    """alpha_d of (85), body axes, rad/s^2: I_b^-1 (-KR e_R - Kw e_w).

    RotorS adds w x w, which is zero; the gyroscopic torque is left to the inverse dynamics.
    """
    torque = -(gains.attitude.scaled(e_R) + gains.rate.scaled(e_w))
    return Vec3(*ldl_solve([list(row) for row in inertia.full().rows], list(torque)))


def yaw_of(quaternion: Quaternion) -> Any:
    """Heading of a quaternion, rad: atan2(2(wz + xy), 1 - 2(y^2 + z^2)), as RotorS reads a reference's."""
    w, x, y, z = quaternion
    return atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def message_quaternion(w: Any, x: Any, y: Any, z: Any) -> Quaternion:
    """A quaternion from a message as RotorS takes it: normalised; the identity if its length vanishes."""
    squared = w * w + x * x + y * y + z * z
    scale = divide(1.0, sqrt(squared))
    # Eigen's NumTraits<double>::epsilon() against the norm
    vanishes = logical_or(squared < (2.220446049250313e-16) ** 2, squared <= 0.0)
    parts = (where(vanishes, one, mul(value, scale)) for value, one in ((w, 1.0), (x, 0.0), (y, 0.0), (z, 0.0)))
    return Quaternion(*parts)
