"""RotorS's controller node as its messages feed it: one function from raw message
numbers to rotor speeds.

For checks against RotorS itself. A flight uses
:func:`skyarm.control.laws.paper.rotors_sim_position`, whose measurement carries the
velocity in world axes and whose reference carries a yaw; both call the same formulas of
:mod:`skyarm.control.blocks.geometric`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from skyarm.algebra import ZERO3, Quaternion, Vec3
from skyarm.algebra.scalars import Scalar, divide, mul, sqrt, where
from skyarm.control.blocks.geometric import (
    angular_acceleration,
    attitude_error,
    body_thrust,
    desired_attitude,
    downward_acceleration,
    rate_error,
    yaw_of,
)
from skyarm.control.model import GeometricGains
from skyarm.dynamics.actuators import make_mixer, mix
from skyarm.vehicle.vehicle_records import Vehicle

GRAVITY = 9.81
"""m/s^2; RotorS, rotors_control/parameters.h, kDefaultGravity."""

IDENTITY = (1.0, 0.0, 0.0, 0.0)

SMALL_QUATERNION = 2.220446049250313e-16
"""Length of a message's quaternion below which RotorS takes the identity: Eigen's
epsilon for doubles."""


def message_quaternion(w: Any, x: Any, y: Any, z: Any) -> Quaternion:
    """Read a message's quaternion as RotorS does: normalised; the identity if its
    length is below Eigen's epsilon.
    """
    length = sqrt(w * w + x * x + y * y + z * z)
    vanishes = length < SMALL_QUATERNION
    scale = divide(1.0, where(vanishes, 1.0, length))
    parts = (
        where(vanishes, one, mul(value, scale))
        for value, one in ((w, 1.0), (x, 0.0), (y, 0.0), (z, 0.0))
    )
    return Quaternion(*parts)


@dataclass(frozen=True, kw_only=True, slots=True)
class LeeCommand:
    """What RotorS's controller computes on its way to the rotors.

    Attributes:
        acceleration: a_d of (82), world axes, m/s^2; points DOWN in hover.
        angular_acceleration: alpha_d of (85), body axes, rad/s^2.
        thrust: along the present body z, N; may be negative.
        squared_speeds: as the allocation gives them, (rad/s)^2; may be negative.
        rotor_speeds: square roots of what is positive, rad/s; no upper limit, which is
            the motor's.
    """

    acceleration: Vec3
    angular_acceleration: Vec3
    thrust: Scalar
    squared_speeds: tuple[Scalar, ...]
    rotor_speeds: tuple[Scalar, ...]


def rotors_sim_lee_command(
    vehicle: Vehicle,
    gains: GeometricGains,
    mass: Any,
    *,
    p_W: Iterable[Any],
    q_wxyz: Iterable[Any],
    v_B: Iterable[Any],
    w_B: Iterable[Any],
    p_ref_W: Iterable[Any],
    q_ref_wxyz: Iterable[Any] = IDENTITY,
    v_ref_W: Iterable[Any] = ZERO3,
    w_ref_W: Iterable[Any] = ZERO3,
    a_ref_W: Iterable[Any] = ZERO3,
    gravity: Any = GRAVITY,
    rate_form: str = "rotors_sim",
) -> LeeCommand:
    """Command of RotorS's Lee position controller for one odometry message and one
    trajectory point.

    Args:
        vehicle: its base inertia and rotors are used; RotorS's own is
            ``load_vehicle("hummingbird")``.
        gains: not normalised by mass or inertia.
        mass: kg, the controller's parameter; it need not be the vehicle's.
        p_W: position, world axes, m.
        q_wxyz: attitude, body to world, as in the message: any length, and the identity
            if it has none.
        v_B: velocity of the body origin in BODY axes, m/s, as RotorS's odometry has it.
        w_B: angular velocity, body axes, rad/s.
        p_ref_W: wanted position, world axes, m.
        q_ref_wxyz: wanted attitude as in the message, any length; only its yaw counts.
        v_ref_W: wanted velocity, world axes, m/s.
        w_ref_W: wanted angular velocity, world axes, rad/s; only its z counts, as the
            yaw rate.
        a_ref_W: wanted acceleration, world axes, m/s^2.
        gravity: m/s^2.
        rate_form: "rotors_sim" or "corrected", see
            :func:`skyarm.control.blocks.geometric.rate_error`.

    Returns:
        All stages of the command. A field a message leaves out is zero, as in RotorS.

    Source: RotorS, lee_position_controller.cpp and mav_msgs/common.h
    (quaternionFromMsg, yawFromQuaternion).
    """
    R = message_quaternion(*q_wxyz).rotation()
    yaw_rate = Vec3(*w_ref_W).z
    a_d = downward_acceleration(
        gains,
        mass,
        gravity,
        position_error=Vec3(*p_W) - Vec3(*p_ref_W),
        velocity_error=R.apply(Vec3(*v_B)) - Vec3(*v_ref_W),
        acceleration=Vec3(*a_ref_W),
    )
    R_d = desired_attitude(a_d, yaw_of(message_quaternion(*q_ref_wxyz)), R)
    alpha = angular_acceleration(
        gains,
        vehicle.base.inertia,
        attitude_error(R, R_d),
        rate_error(Vec3(*w_B), R, R_d, yaw_rate, rate_form),
    )
    thrust = body_thrust(mass, a_d, R)
    speeds, squared = mix(
        make_mixer(vehicle), vehicle.base.inertia.apply(alpha), thrust
    )
    return LeeCommand(
        acceleration=a_d,
        angular_acceleration=alpha,
        thrust=thrust,
        squared_speeds=squared,
        rotor_speeds=speeds,
    )
