"""Adaptive sliding mode through the coupled dynamics, in the manner of Kim, Choi, Kim
2013.

For position, attitude and joints the sliding variable is s = edot + Lambda e, and the
wanted acceleration

    (.)dd* = (.)dd_d - Lambda edot - K s - eta tanh(s / boundary) - delta,
    deltadot = gamma s,  |delta| <= limit

goes through the whole inverse dynamics. Position gives the thrust vector, the attitude
error is geometric. Lambda, K come from the gains kp, kd of a PD law with the same
linear part: K + Lambda = kd, K Lambda = kp, real if kd^2 >= 4 kp, else Lambda = K =
kd / 2. delta stands still while an actuator is at its limit, and while others change
any command.

Assumed (the text at hand is Barakou et al. 2026's summary): sliding variables per
coordinate; tanh in a boundary layer for the sign; the adaptation of a lumped
disturbance acceleration with projection onto a box; body coordinates in place of Euler
angles.

Source: Kim, Choi, Kim, IROS 2013; Slotine, Li 1991, chapter 7.
"""

from __future__ import annotations

from typing import Annotated

from skyarm import dynamics
from skyarm.algebra import (
    E_Z,
    ZERO3_DATA,
    Mat3,
    Motion,
    Scalar,
    Scalars,
    Sym3,
    Vec3,
    ldl_solve,
)
from skyarm.algebra.scalars import clip, divide, logical_and, maximum, sqrt, tanh, where
from skyarm.control.blocks.actuators import all_follow, joints_follow, rotors_follow
from skyarm.control.blocks.common import make_command, no_command
from skyarm.control.blocks.geometric import attitude_error, desired_attitude, rate_error
from skyarm.control.controller import all_applied
from skyarm.control.law_maker import law_maker
from skyarm.control.model import Parameters
from skyarm.dynamics.actuators import Command
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement

Triple = tuple[float, float, float]

ACCELERATION = "m/s^2, rad/s^2, rad/s^2"


@immutable
class SlidingParameters(Parameters):
    """Constants of the sliding mode law in addition to the gains.

    Attributes:
        switching: eta of position (m/s^2), attitude (rad/s^2) and joints (rad/s^2).
        boundary: width of the boundary layer of s, m/s, rad/s, rad/s.
        adaptation: gamma, 1/s^2, of position, attitude, joints.
        limit: largest magnitude of delta, m/s^2, rad/s^2, rad/s^2.
    """

    switching: Annotated[
        Triple,
        nonnegative(
            ACCELERATION,
            "switching gain of position, attitude and joints",
            effect="higher values reject larger disturbances and chatter more",
        ),
    ] = (0.5, 2.0, 2.0)
    boundary: Annotated[
        Triple,
        positive(
            "m/s, rad/s, rad/s",
            "width of the boundary layer of position, attitude and joints",
            effect="wider layers chatter less and track less exactly",
        ),
    ] = (0.1, 0.5, 0.5)
    adaptation: Annotated[
        Triple,
        nonnegative(
            "1/s^2",
            "adaptation rate of position, attitude and joints",
            effect=(
                "higher values find disturbances faster and oscillate more with delay"
            ),
        ),
    ] = (2.0, 20.0, 50.0)
    limit: Annotated[
        Triple, positive(ACCELERATION, "largest adapted acceleration", bound=True)
    ] = (
        5.0,
        40.0,
        60.0,
    )


@immutable
class SlidingMemory:
    """Internal state of the sliding mode law: adapted disturbance accelerations and
    last command.

    Attributes:
        position, attitude, joints: adapted disturbance accelerations, world axes, base
            axes, of the joints.
        sent: the last command. applied: 1 for the rotors and each joint for which it
            was applied unchanged.
    """

    position: Annotated[Vec3, Unit("m/s^2", "adapted linear acceleration, world axes")]
    attitude: Annotated[
        Vec3, Unit("rad/s^2", "adapted angular acceleration, base axes")
    ]
    joints: Annotated[Scalars, Unit("rad/s^2 or m/s^2", "adapted joint accelerations")]
    sent: Command
    applied: Annotated[
        Scalars,
        Unit("", "1 for rotors and joints whose last command was applied unchanged"),
    ]


def sliding_rates(stiffness: Scalar, damping: Scalar) -> tuple[Scalar, Scalar]:
    """Sliding slope Lambda and gain K from PD gains, with K + Lambda = kd and K
    Lambda = kp (kd / 2 if complex).
    """
    spread = sqrt(maximum(damping * damping - 4.0 * stiffness, 0.0))
    return 0.5 * (damping - spread), 0.5 * (damping + spread)


def sliding_mode(
    error: Scalar,
    rate: Scalar,
    kp: Scalar,
    kd: Scalar,
    group: int,
    par: SlidingParameters,
) -> tuple[Scalar, Scalar, Scalar]:
    """Sliding variable of one coordinate, and linear and switching part of its desired
    acceleration.
    """
    # group: 0 of the position, 1 of the attitude, 2 of the joints
    slope, gain = sliding_rates(kp, kd)
    s = rate + slope * error
    push = par.switching[group] * tanh(divide(s, par.boundary[group]))
    return s, -(slope * rate) - gain * s, push


def kim_sliding_mode(
    memory: SlidingMemory,
    measurement: Measurement,
    reference: Reference,
    dt: Scalar,
    *,
    par: SlidingParameters,
) -> tuple[SlidingMemory, Command]:
    """Adaptive sliding mode: sliding accelerations through the coupled inverse
    dynamics.
    """
    vehicle, R = par.model.vehicle, measurement.rotation
    s_p, up = _translation(memory, measurement, reference, par)
    s_R, alpha = _rotation(memory, measurement, reference, R, up, par)
    s_q, qdd = _arm(memory, measurement, reference, par)
    base = Motion(alpha, R.apply_T(up))
    force, torques = dynamics.inverse_dynamics(
        vehicle,
        measurement.joints,
        measurement.rate,
        measurement.joint_rates,
        base,
        qdd,
    )
    command, squares = make_command(par, force.torque, force.force.z, torques)
    # one actuator that was cut spoils every acceleration, so all adaptations stand
    # still
    unchanged = all_follow(memory.applied)
    free = logical_and(rotors_follow(par.mixer, squares), unchanged)

    def adapt(delta: Scalar, s: Scalar, group: int, inside: Scalar) -> Scalar:
        moved = clip(
            delta + par.adaptation[group] * s * dt, -par.limit[group], par.limit[group]
        )
        return where(inside, moved, delta)

    follow = [logical_and(fits, unchanged) for fits in joints_follow(vehicle, torques)]
    return (
        SlidingMemory(
            position=Vec3(
                *(
                    adapt(d, s, 0, free)
                    for d, s in zip(memory.position, s_p, strict=True)
                )
            ),
            attitude=Vec3(
                *(
                    adapt(d, s, 1, free)
                    for d, s in zip(memory.attitude, s_R, strict=True)
                )
            ),
            joints=tuple(
                adapt(d, s, 2, ok)
                for d, s, ok in zip(memory.joints, s_q, follow, strict=True)
            ),
            sent=command,
            applied=all_applied(vehicle.n),
        ),
        command,
    )


def _translation(
    memory: SlidingMemory,
    measurement: Measurement,
    reference: Reference,
    par: SlidingParameters,
) -> tuple[list[Scalar], Vec3]:
    """Sliding variables of the position, and desired specific force, world axes."""
    per_mass = divide(1.0, par.model.vehicle.mass)
    error = measurement.position - reference.position
    drift = measurement.velocity - reference.velocity
    kp, kd = par.gains.position * per_mass, par.gains.velocity * per_mass
    pairs = [
        sliding_mode(e, ed, stiffness, damping, 0, par)
        for e, ed, stiffness, damping in zip(error, drift, kp, kd, strict=True)
    ]
    feedback = Vec3(*(a - push for _, a, push in pairs)) - memory.position
    return [
        s for s, _, _ in pairs
    ], feedback + reference.acceleration + E_Z * par.model.gravity


def _rotation(
    memory: SlidingMemory,
    measurement: Measurement,
    reference: Reference,
    R: Mat3,
    up: Vec3,
    par: SlidingParameters,
) -> tuple[list[Scalar], Vec3]:
    """Sliding variables of the attitude, and desired angular acceleration, base axes.

    Per axis the rates are those of its moment of inertia alone; the linear part is then
    turned as the PD law's torque would: with products of inertia, J alpha = diag(J)
    linear.
    """
    J = par.model.vehicle.base.inertia
    own = [list(row) for row in Sym3(J.xx, J.yy, J.zz).full().rows]
    R_d = desired_attitude(-up, reference.yaw, R)
    error = attitude_error(R, R_d)
    drift = rate_error(measurement.rate, R, R_d, reference.yaw_rate, par.rate_error)
    kp = ldl_solve(own, list(par.gains.attitude))
    kd = ldl_solve(own, list(par.gains.rate))
    pairs = [
        sliding_mode(e, ed, stiffness, damping, 1, par)
        for e, ed, stiffness, damping in zip(error, drift, kp, kd, strict=True)
    ]
    linear = Vec3(*(a for _, a, _ in pairs))
    # J^-1 diag(J) linear = linear - J^-1 (J - diag(J)) linear: without products of
    # inertia nothing is left to round
    mixed = Sym3(0, 0, 0, J.xy, J.xz, J.yz).apply(linear)
    turned = linear - Vec3(
        *ldl_solve([list(row) for row in J.full().rows], list(mixed))
    )
    return [s for s, _, _ in pairs], turned - Vec3(
        *(push for _, _, push in pairs)
    ) - memory.attitude


def _arm(
    memory: SlidingMemory,
    measurement: Measurement,
    reference: Reference,
    par: SlidingParameters,
) -> tuple[list[Scalar], Scalars]:
    """Sliding variables of the joints, and desired joint accelerations."""
    sliding, accelerations = [], []
    for i in range(par.model.vehicle.n):
        error = measurement.joints[i] - reference.joints[i]
        drift = measurement.joint_rates[i] - reference.joint_rates[i]
        s, a, push = sliding_mode(
            error,
            drift,
            par.joint_gains.stiffness[i],
            par.joint_gains.damping[i],
            2,
            par,
        )
        sliding.append(s)
        accelerations.append(
            a - push + reference.joint_accelerations[i] - memory.joints[i]
        )
    return sliding, tuple(accelerations)


def first_memory(par: SlidingParameters) -> SlidingMemory:
    """Initial internal state of the adaptive sliding mode law: adaptation at zero."""
    vehicle = par.model.vehicle
    return SlidingMemory(
        position=ZERO3_DATA,
        attitude=ZERO3_DATA,
        joints=vehicle.zeros,
        sent=no_command(vehicle),
        applied=all_applied(vehicle.n),
    )


make_kim = law_maker(
    "kim2013", kim_sliding_mode, SlidingParameters, memory=first_memory
)
"""Maker of the adaptive sliding mode law after Kim et al. 2013, for any arm. Gains of
the PD law with the same linear part."""
