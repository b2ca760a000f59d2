"""The motion that a predictive controller foresees: its belief of the vehicle, moved by held inputs.

An input of a rotor is the rate of its speed: constant over a stage, so that the prediction is smooth although real
motors speed up faster than they slow down. The command that makes a rotor turn so is found afterwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skyarm import dynamics
from skyarm.actuation import rotor_force
from skyarm.algebra import Force, Vec3
from skyarm.compile import leaves, rebuild
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics.state import coordinate_acceleration
from skyarm.scalars import Scalar, add, divide, exp, maximum, minimum, mul, sub, where
from skyarm.vehicle.records import Rotor


@dataclass(frozen=True, kw_only=True, slots=True)
class Inputs:
    """What is held over a stage: rates of the rotors' speeds (rad/s^2) and joint torques (N m or N)."""

    rotor_accelerations: tuple[Scalar, ...]
    efforts: tuple[Scalar, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class Disturbance:
    """What the belief leaves out.

    Attributes:
        force_W: at the base origin, world axes, N.
        torque_B: about the base origin, base axes, N m.
        efforts: joint torques, N m or N.
    """

    force_W: Vec3
    torque_B: Vec3
    efforts: tuple[Scalar, ...]


def accelerations(
    model: Model, state: State, efforts: tuple[Any, ...], disturbance: Disturbance
) -> tuple[Vec3, Vec3, tuple[Any, ...]]:
    """Accelerations (dv_W/dt, dw_B/dt, joints) of the belief in still air under a disturbance."""
    vehicle, R = model.vehicle, state.quaternion.rotation()
    v_B = R.apply_T(state.velocity)
    applied = Force(disturbance.torque_B, R.apply_T(disturbance.force_W))
    for rotor, speed in zip(vehicle.rotors, state.rotor_speeds, strict=True):
        applied = applied + rotor_force(rotor, speed, v_B + state.rate.cross(rotor.position))
    torques = tuple(
        add(sub(effort, mul(link.joint.damping, rate)), unknown)
        for link, effort, rate, unknown in zip(
            vehicle.links, efforts, state.joint_rates, disturbance.efforts, strict=True
        )
    )
    base, joints = dynamics.forward_dynamics(vehicle, state.joints, state.rate, state.joint_rates, applied, torques)
    linear, angular = coordinate_acceleration(R, base, model.gravity)
    return linear, angular, joints


def derivative(model: Model, state: State, inputs: Inputs, disturbance: Disturbance) -> State:
    """Time derivative of the state, part by part."""
    linear, angular, joints = accelerations(model, state, inputs.efforts, disturbance)
    return State(
        position=state.velocity,
        quaternion=state.quaternion.derivative(state.rate),
        velocity=linear,
        rate=angular,
        joints=state.joint_rates,
        joint_rates=joints,
        rotor_speeds=inputs.rotor_accelerations,
    )


def advance(model: Model, state: State, inputs: Inputs, disturbance: Disturbance, dt: Any) -> State:
    """State after ``dt`` seconds of held inputs: one step of the classical Runge-Kutta method.

    Source: Kutta 1901.
    """

    def slope(at: State) -> State:
        return derivative(model, at, inputs, disturbance)

    k1 = slope(state)
    k2 = slope(moved(state, k1, 0.5 * dt))
    k3 = slope(moved(state, k2, 0.5 * dt))
    k4 = slope(moved(state, k3, dt))
    mean = (
        (a + 2.0 * (b + c) + d) * (1.0 / 6.0) for a, b, c, d in zip(*(leaves(k) for k in (k1, k2, k3, k4)), strict=True)
    )
    end = moved(state, rebuild(k1, mean), dt)
    values = [*end.position, *end.quaternion.normalized(), *leaves(end)[7:]]
    return rebuild(state, iter(values))


def moved(state: State, rate: State, dt: Any) -> State:
    """Return state + dt * rate, number by number."""
    return rebuild(state, iter([x + dt * dx for x, dx in zip(leaves(state), leaves(rate), strict=True)]))


@dataclass(frozen=True, slots=True)
class Motors:
    """Rotors as commands see them, an array each: shares of a change made in a period upward and downward, rad/s."""

    up: Any
    down: Any
    most: Any


def motors(rotors: Sequence[Rotor], dt: float) -> Motors:
    """The motors of rotors at a control period of ``dt`` s."""
    up, down = (
        np.array([1.0 - exp(divide(-dt, getattr(rotor, name))) for rotor in rotors])
        for name in ("time_constant_up", "time_constant_down")
    )
    return Motors(up, down, np.array([float(rotor.max_speed) for rotor in rotors]))


def command_for(lags: Motors, speed: Any, acceleration: Any, dt: Any) -> Any:
    """Commanded speeds (rad/s) that bring lagging rotors to speed + acceleration * dt after ``dt`` seconds."""
    change = acceleration * dt
    wanted = speed + divide(change, where(change > 0.0, lags.up, lags.down))
    return maximum(0.0, minimum(wanted, lags.most))
