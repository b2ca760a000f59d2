"""Geometric tracking controller of position and attitude, as in the RotorS simulator.

Source: Lee, Leok, McClamroch 2010; Furrer et al. 2016 (RotorS),
lee_position_controller.cpp at commit cd813b7a8c37; eq. (80)-(85) of Barakou et
al. 2026. Deviations: two degenerate cases have a value, which RotorS leaves as NaN; the
attitude error does not vanish at half a turn.
"""

from __future__ import annotations

from skyarm.algebra import E_Z, Mat3, Quaternion, Scalar, Sym3, Vec3, ldl_solve
from skyarm.algebra.scalars import atan2, cos, divide, mul, neg, sin, sqrt, where
from skyarm.control.blocks.select import choose
from skyarm.control.model import GeometricGains

RATE_ERRORS = ("rotors_sim", "corrected")

SMALL_ACCELERATION = 1e-6
"""Commanded specific force (m/s^2) below which the thrust direction is undefined and
the present one is kept."""

HALF_TURN = 0.0175
"""Angle (rad), one degree, to half a turn within which an attitude error stays as long
as at its border, or longer."""

SMALL_SINE = 1e-6
"""Sine of the angle between thrust direction and heading below which the heading does
not fix the attitude."""


def downward_acceleration(
    gains: GeometricGains,
    mass: Scalar,
    gravity: Scalar,
    *,
    position_error: Vec3,
    velocity_error: Vec3,
    acceleration: Vec3,
) -> Vec3:
    """Desired acceleration a_d (m/s^2, world axes), eq. (82) of Barakou et al. 2026; it
    points down in hover.

    a_d = (Kp e_p + Kv e_v) / m - g e_3 - pdd_d
    """
    pull = gains.position.hadamard(position_error) + gains.velocity.hadamard(
        velocity_error
    )
    return pull * divide(1.0, mass) - E_Z * gravity - acceleration


def desired_attitude(a_d: Vec3, yaw: Scalar, R_WB: Mat3) -> Mat3:
    """Desired attitude R_d with body z along -a_d and body x as near the heading as
    possible.

    b3 = -a_d/|a_d|, b2 = b3 x [cos psi, sin psi, 0] normalised, R_d = [b2 x b3, b2,
    b3]. With no commanded force b3 is the present one; with b3 along the heading, b2 is
    the heading's left.
    """
    force = a_d.norm()
    b3 = _unit(-a_d, force, force < SMALL_ACCELERATION, R_WB.column(2))
    heading = Vec3(cos(yaw), sin(yaw), 0)
    left = Vec3(-heading.y, heading.x, 0.0)
    side = b3.cross(heading)
    sine = side.norm()
    b2 = _unit(side, sine, sine < SMALL_SINE, left)
    return Mat3.columns(b2.cross(b3), b2, b3)


def _unit(v: Vec3, length: Scalar, vanishes: Scalar, otherwise: Vec3) -> Vec3:
    """Unit vector v / length, or ``otherwise`` where ``vanishes``; never divides by
    zero.
    """
    direction = v * divide(1.0, where(vanishes, 1.0, length))
    return Vec3(
        *(where(vanishes, x, y) for x, y in zip(otherwise, direction, strict=True))
    )


def attitude_error(R_WB: Mat3, R_d: Mat3, near: float = HALF_TURN) -> Vec3:
    """Attitude error e_R (83), vee(1/2 (R_d^T R - R^T R_d)), kept from vanishing within
    ``near`` (rad) of half a turn.

    e_R is the axis n of Q = R_d^T R times the sine of its angle: zero also at half a
    turn, where nothing would turn back. With c the cosine of the angle, d^2 = 2 (1 + c)
    and h = ``near``, h (1 - d^2 / h^2) n is added where d < h: d is about the angle to
    half a turn, and the length becomes h to 5/4 h. Elsewhere the error is e_R to the
    bit.
    """
    Q = R_d.T @ R_WB
    sine = Q.vee_antisymmetric()
    trace = Q.r0.x + Q.r1.y + Q.r2.z
    cosine, short = 0.5 * (trace - 1.0), trace + 1.0
    close = short < near * near
    # the axis along the longest column of Q + Q^T - 2 c = 2 (1 - c) n n^T, of which e_R
    # has the side
    x, y, z = (2.0 * (entry - cosine) for entry in (Q.r0.x, Q.r1.y, Q.r2.z))
    xy, xz, yz = Q.r0.y + Q.r1.x, Q.r0.z + Q.r2.x, Q.r1.z + Q.r2.y
    wide = x > y
    longest, axis = where(wide, x, y), choose(wide, Vec3(x, xy, xz), Vec3(xy, y, yz))
    tall = z > longest
    longest, axis = where(tall, z, longest), choose(tall, Vec3(xz, yz, z), axis)
    # column k is 2 (1 - c) |n_k| long; all vanish where R is R_d
    push = divide(
        near - short * (1.0 / near),
        sqrt(where(close, longest * (2.0 - 2.0 * cosine), 1.0)),
    )
    return choose(
        close, sine + axis * where(axis.dot(sine) < 0.0, neg(push), push), sine
    )


def rate_error(w_B: Vec3, R_WB: Mat3, R_d: Mat3, yaw_rate: Scalar, form: str) -> Vec3:
    """Body rate error e_w, eq. (84), against the desired rate [0, 0, yaw rate] in the
    desired body's axes.

    "corrected" is Lee's w - R^T R_d w_d; "rotors_sim" is RotorS's own w - R_d^T R w_d,
    which differs once the yaw rate is not zero and the attitude is off.
    """
    w_d = Vec3(0, 0, yaw_rate)
    relative = R_d.T @ R_WB if form == "rotors_sim" else R_WB.T @ R_d
    return w_B - relative.apply(w_d)


def angular_acceleration(
    gains: GeometricGains, inertia: Sym3, e_R: Vec3, e_w: Vec3
) -> Vec3:
    """Angular acceleration alpha_d (rad/s^2, body axes), eq. (85): I_b^-1 (-KR e_R - Kw
    e_w).

    RotorS adds w x w, which is zero; the gyroscopic torque is left to the inverse
    dynamics.
    """
    # products of inertia couple the axes, so the torque is divided by the whole matrix
    torque = -(gains.attitude.hadamard(e_R) + gains.rate.hadamard(e_w))
    return Vec3(*ldl_solve([list(row) for row in inertia.full().rows], list(torque)))


def body_thrust(mass: Scalar, a_d: Vec3, R_WB: Mat3) -> Scalar:
    """Thrust (N) along the present body z, -m a_d . (R e_3); negative if the vehicle is
    upside down.
    """
    return mul(-mass, a_d.dot(R_WB.column(2)))


def yaw_of(quaternion: Quaternion) -> Scalar:
    """Heading (rad) of a unit quaternion, atan2(2(wz + xy), 1 - 2(y^2 + z^2)), in the
    yaw convention of RotorS.
    """
    w, x, y, z = quaternion
    return atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
