"""Prediction of the vehicle's motion under held inputs.

An input of a rotor is the rate of its speed: constant over a stage, so that the
prediction is smooth although real motors speed up faster than they slow down. The
command that makes a rotor turn so is found afterwards. Limits of joint torques are
bounds of the inputs and no part of the motion: a clip would halve its slope at the
limit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from skyarm import dynamics
from skyarm.algebra import Force, Mat3, Motion, Scalar, Scalars, Vec3, ldl_solve
from skyarm.algebra.scalars import divide, exp, maximum, minimum, where
from skyarm.control.blocks.center_of_mass import arm_reaction
from skyarm.control.blocks.prediction import Disturbance, acceleration_under
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics.actuators import rotor_force
from skyarm.dynamics.state import coordinate_acceleration
from skyarm.records.arrays import Array, float_array
from skyarm.records.immutable import immutable, positional
from skyarm.records.leaves import leaves, rebuild
from skyarm.vehicle import Rotor


@immutable
class StageInputs:
    """Inputs held over a stage: rates of the rotors' speeds (rad/s^2) and joint torques
    (N m or N).
    """

    rotor_accelerations: Scalars
    efforts: Scalars


def accelerations(
    model: Model,
    state: State,
    efforts: Scalars,
    disturbance: Disturbance,
    dry_rates: Scalars | None = None,
) -> tuple[Vec3, Vec3, Scalars]:
    """Accelerations (dv_W/dt, dw_B/dt, joints) of the model in still air under a
    disturbance.

    Dry friction of the joints is that at ``dry_rates``, of the state's own rates if
    they are left out: these make a plan as stiff as tanh is steep.
    """
    R = state.rotation
    return acceleration_under(
        model,
        R,
        state.rate,
        state.joints,
        state.joint_rates,
        _on_base(model, state, R, disturbance),
        efforts,
        disturbance.efforts,
        state.joint_rates if dry_rates is None else dry_rates,
    )


def base_accelerations(
    model: Model, state: State, joint_accelerations: Scalars, disturbance: Disturbance
) -> tuple[Vec3, Vec3]:
    """Accelerations (dv_W/dt, dw_B/dt) of the base while the joints move with given
    accelerations.
    """
    vehicle, R = model.vehicle, state.rotation
    applied = _on_base(model, state, R, disturbance)
    # what the arm alone needs of the base; the rest of the wrench accelerates it
    pushed = applied - arm_reaction(
        vehicle, state.joints, state.rate, state.joint_rates, joint_accelerations
    )
    whole = [
        row[:6]
        for row in dynamics.mass_matrix(vehicle, Mat3.identity(), state.joints)[:6]
    ]
    x = ldl_solve(whole, [*pushed.force, *pushed.torque])
    return coordinate_acceleration(R, Motion(Vec3(*x[3:]), Vec3(*x[:3])), model.gravity)


def _on_base(model: Model, state: State, R: Mat3, disturbance: Disturbance) -> Force:
    """Total wrench of rotors and disturbance about the base origin, base axes."""
    v_B = R.apply_T(state.velocity)
    applied = Force(disturbance.torque, R.apply_T(disturbance.force))
    for rotor, speed in zip(model.vehicle.rotors, state.rotor_speeds, strict=True):
        applied = applied + rotor_force(
            rotor, speed, v_B + state.rate.cross(rotor.position)
        )
    return applied


def slope_of(
    state: State,
    inputs: StageInputs,
    linear: Vec3,
    angular: Vec3,
    joint_accelerations: Scalars,
) -> State:
    """Time derivative of the vehicle state, from the state and the accelerations of
    base and joints.
    """
    return State(
        position=state.velocity,
        quaternion=state.quaternion.derivative(state.rate),
        velocity=linear,
        rate=angular,
        joints=state.joint_rates,
        joint_rates=joint_accelerations,
        rotor_speeds=inputs.rotor_accelerations,
    )


def advance(
    model: Model,
    state: State,
    inputs: StageInputs,
    disturbance: Disturbance,
    dt: Scalar,
) -> State:
    """State after ``dt`` seconds of held inputs: one step of the classical Runge-Kutta
    method.

    Source: Kutta 1901.
    """

    def slope(at: State, _later: Scalar = 0) -> State:
        return slope_of(
            at, inputs, *accelerations(model, at, inputs.efforts, disturbance)
        )

    return runge_kutta_step(state, slope(state), slope, dt)


def integrate_stage(
    model: Model,
    state: State,
    inputs: StageInputs,
    disturbance: Disturbance,
    dt: Scalar,
    dry_rates: Scalars | None = None,
) -> State:
    """State after ``dt`` seconds at constant joint accelerations, computed from the
    initial joint efforts.

    A drive follows gravity and inertia far more often than a stage is long. Torques
    held over a stage would let a light link fall and swing by several radians before
    the next one corrects it, and no plan of a fast arm converges. A plan takes dry
    friction at the reference's joint rates: of the state's own it is as stiff as tanh
    is steep.
    """
    linear, angular, joints = accelerations(
        model, state, inputs.efforts, disturbance, dry_rates
    )

    def slope(at: State, _later: Scalar) -> State:
        return slope_of(
            at, inputs, *base_accelerations(model, at, joints, disturbance), joints
        )

    return runge_kutta_step(
        state, slope_of(state, inputs, linear, angular, joints), slope, dt
    )


def runge_kutta_step(
    state: State, k1: State, slope: Callable[[State, Scalar], State], dt: Scalar
) -> State:
    """State after one step of the classical Runge-Kutta method with a given first
    slope.

    ``slope`` is a function of the state and of the time (s) since the beginning of the
    step.
    """
    half = 0.5 * dt
    k2 = slope(euler_step(state, k1, half), half)
    k3 = slope(euler_step(state, k2, half), half)
    k4 = slope(euler_step(state, k3, dt), dt)
    mean = (
        (a + 2.0 * (b + c) + d) * (1.0 / 6.0)
        for a, b, c, d in zip(*map(leaves, (k1, k2, k3, k4)), strict=True)
    )
    end = euler_step(state, rebuild(k1, mean), dt)
    # a sum of quaternions is off unit length by the step's error
    values = [*end.position, *end.quaternion.normalized(), *leaves(end)[7:]]
    return rebuild(state, values)


def euler_step(state: State, rate: State, dt: Scalar) -> State:
    """State plus ``dt`` times its time derivative, component by component."""
    return rebuild(
        state,
        [x + dt * dx for x, dx in zip(leaves(state), leaves(rate), strict=True)],
    )


@positional
class Motors:
    """Motor lags of all rotors per control period: gains for rising and falling speed,
    and speed limits (rad/s).
    """

    up: Array
    down: Array
    most: Array


def motors(rotors: Sequence[Rotor], dt: float) -> Motors:
    """Motor lags of rotors for a control period of ``dt`` seconds."""
    up, down = (
        np.array([1.0 - exp(divide(-dt, getattr(rotor, name))) for rotor in rotors])
        for name in ("time_constant_up", "time_constant_down")
    )
    return Motors(up, down, float_array(rotor.max_speed for rotor in rotors))


def command_for(lags: Motors, speed: Scalar, acceleration: Scalar, dt: Scalar) -> Any:
    """Commanded speeds (rad/s) that bring lagging rotors to speed + acceleration * dt
    after ``dt`` seconds.
    """
    change = acceleration * dt
    target = speed + divide(change, where(change > 0.0, lags.up, lags.down))
    return maximum(0.0, minimum(target, lags.most))


def speeds_under(lags: Motors, speed: Array, command: Array) -> Array:
    """Speeds (rad/s) of lagging rotors one control period after commanded speeds."""
    change = np.minimum(np.maximum(command, 0.0), lags.most) - speed
    return speed + change * np.where(change > 0.0, lags.up, lags.down)
