"""One rotor: speed lag, thrust, drag torque, hub drag, rolling moment.

Source: Furrer, Burri, Achtelik, Siegwart 2016 (RotorS), gazebo_motor_model.cpp at commit cd813b7a8c37. Left out:
RotorS's delay of one physics step between a filtered speed and its force.
"""

from __future__ import annotations

from typing import Any

from skyarm.algebra import Force, Vec3
from skyarm.scalars import divide, exp, minimum, mul, where
from skyarm.vehicle.records import Rotor


def speed_after(rotor: Rotor, speed: Any, command: Any, dt: Any) -> Any:
    """Rotor speed (rad/s) after ``dt`` seconds of a held command: the asymmetric first-order lag solved exactly.

    The approach is monotonic, so the time constant (up or down) cannot change while the command is held. The command is
    limited to the rotor's highest speed.
    """
    target = minimum(command, rotor.max_speed)
    rising, falling = (exp(divide(-dt, tau)) for tau in (rotor.time_constant_up, rotor.time_constant_down))
    return target + (speed - target) * where(target > speed, rising, falling)


def rotor_force(rotor: Rotor, speed: Any, velocity: Vec3, effectiveness: Any = 1) -> Force:
    """Force of a rotor on the base: torque about and force at the base origin, base axes.

    Args:
        rotor: pose and coefficients.
        speed: rad/s, unsigned.
        velocity: of the hub against the air, base axes, m/s.
        effectiveness: share of thrust and drag torque that a fault leaves; a structural 1 folds away.

    thrust k_f W^2 along the axis; drag torque k_m thrust against the direction of rotation; hub drag -c_d |W| v_perp;
    rolling moment -c_r |W| v_perp, with v_perp the velocity in the rotor's plane.
    """
    n = rotor.axis
    thrust = mul(effectiveness, rotor.thrust_coefficient * (speed * speed))
    in_plane = n.cross(velocity).cross(n)  # v - (v.n) n, written so that a structural axis leaves two components
    force = n * thrust - in_plane * mul(rotor.drag_coefficient, speed)
    drag_torque = n * mul(mul(-rotor.direction, rotor.moment_coefficient), thrust)
    rolling = in_plane * mul(rotor.rolling_moment_coefficient, speed)
    return Force(rotor.position.cross(force) + drag_torque - rolling, force)
