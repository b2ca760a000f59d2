"""From thrust and accelerations to rotor and joint commands: inverse dynamics of an underactuated base."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm import dynamics
from skyarm.actuation import Command, mix
from skyarm.algebra import E_Z, ZERO3, Vec3
from skyarm.algebra import Motion as Acceleration
from skyarm.control.exact.lag import command_for
from skyarm.control.exact.memory import data
from skyarm.control.exact.motion import Disturbance, lagged
from skyarm.control.exact.parameters import ExactParameters
from skyarm.control.exact.wishes import Wish
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.scalars import absolute, add, clip, divide, logical_and, maximum, mul, sqrt, sub, where


def needed(model: Model, state: State, wish: Wish, unknown: Disturbance) -> tuple[Vec3, tuple[Any, ...]]:
    """Body torque (N m, base axes) and joint torques that give the wished accelerations with the wished thrust.

    Force balance gives the base's linear acceleration: inverse dynamics is affine in it with slope m. Then the torques
    follow; what the disturbance already does is left out, friction at the present rate is added.
    """
    vehicle, R = model.vehicle, state.quaternion.rotation()
    q, w, qd = state.joints, state.rate, state.joint_rates
    without, _ = dynamics.inverse_dynamics(vehicle, q, w, qd, Acceleration(wish.alpha, ZERO3), wish.joints)
    push = E_Z * wish.thrust + R.apply_T(unknown.force)
    linear = (push - without.force) * divide(1.0, vehicle.mass)
    force, efforts = dynamics.inverse_dynamics(vehicle, q, w, qd, Acceleration(wish.alpha, linear), wish.joints)
    return force.torque - unknown.torque, tuple(
        add(sub(effort, extra), mul(link.joint.damping, rate))
        for effort, extra, link, rate in zip(efforts, unknown.efforts, vehicle.links, qd, strict=True)
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class Done:
    """What was sent.

    Attributes:
        command: to the actuators.
        free: 1 for the base and each joint whose actuators are not at their limit, else 0.
        trim: of the squared rotor speeds, one period later, (rad/s)^2.
    """

    command: Command
    free: tuple[Any, ...]
    trim: tuple[Any, ...]


def actuate(
    par: ExactParameters, model: Model, state: State, wish: Wish, unknown: Disturbance, trim: tuple[Any, ...], dt: Any
) -> Done:
    """The command for a wish.

    Motors that slow down later than they speed up lose thrust under noise, so that the mean of what they do (their
    model knows it) misses the mean of what was wanted: the trim integrates that difference.
    """
    torque, efforts = needed(model, state, wish, unknown)
    wanted, squares = mix(par.mixer, torque, wish.thrust)
    inside: Any = wish.thrust > 0.0
    for square, highest in zip(squares, par.mixer.highest, strict=True):
        inside = logical_and(inside, logical_and(square > 0.0, square < highest))
    targets = [sqrt(maximum(w * w + t, 0.0)) for w, t in zip(wanted, trim, strict=True)]
    speeds = tuple(
        command_for(rotor, speed, target, dt, par.lag_inversion)
        for rotor, speed, target in zip(model.vehicle.rotors, state.rotor_speeds, targets, strict=True)
    )
    limits = [link.joint.effort_limit for link in model.vehicle.links]
    held = tuple(clip(data(effort), -limit, limit) for effort, limit in zip(efforts, limits, strict=True))
    command = Command(rotor_speeds=speeds, efforts=held)
    reached = lagged(model, state.rotor_speeds, command, dt)
    step = where(inside, par.trim_rate * dt, 0.0)
    return Done(
        command=command,
        free=(
            where(inside, 1.0, 0.0),
            *(where(absolute(e) < limit, 1.0, 0.0) for e, limit in zip(efforts, limits, strict=True)),
        ),
        trim=tuple(t + step * (w * w - r * r) for t, w, r in zip(trim, wanted, reached, strict=True)),
    )
