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

from collections.abc import Iterable
from typing import Annotated

from skyarm.algebra import (
    E_Z,
    ZERO3_DATA,
    Mat3,
    Motion,
    Scalar,
    Scalars,
    Sym3,
    Vec3,
    differences,
    ldl_solve,
    sums,
)
from skyarm.algebra.scalars import clip, divide, logical_and, maximum, sqrt, tanh, where
from skyarm.control.blocks.actuators import (
    all_follow,
    joints_follow,
    limit_efforts,
    rotors_follow,
)
from skyarm.control.blocks.common import coupled_forces, no_command
from skyarm.control.blocks.geometric import attitude_error, desired_attitude, rate_error
from skyarm.control.controller import all_applied
from skyarm.control.law_maker import law_maker
from skyarm.control.model import Parameters
from skyarm.dynamics.actuators import Command, mix
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement

Triple = tuple[float, float, float]

ACCELERATION = "m/s^2, rad/s^2, rad/s^2"


@immutable
class SlidingParameters(Parameters):
    """Constants of the sliding mode law in addition to the gains.

    The defaults are chosen, as the text at hand is a summary.

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


def _sliding_modes(
    errors: Iterable[Scalar],
    rates: Iterable[Scalar],
    stiffness: Iterable[Scalar],
    damping: Iterable[Scalar],
    group: int,
    par: SlidingParameters,
) -> tuple[Scalars, Scalars, Scalars]:
    """Sliding variables of a group of coordinates, and linear and switching parts of
    their desired accelerations.
    """
    rows = zip(errors, rates, stiffness, damping, strict=True)
    modes = [sliding_mode(*row, group, par) for row in rows]
    s, linear, push = zip(*modes, strict=True) if modes else ((), (), ())
    return s, linear, push


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
    R = measurement.rotation
    s_p, up = _translation(memory, measurement, reference, par)
    s_R, alpha = _rotation(memory, measurement, reference, R, up, par)
    s_q, qdd = _arm(memory, measurement, reference, par)
    base = Motion(alpha, R.apply_T(up))
    force, torques = coupled_forces(par, measurement, base, qdd)
    speeds, squares = mix(par.mixer, force.torque, force.force.z)
    command = Command(rotor_speeds=speeds, efforts=limit_efforts(par, torques))
    # one actuator that was cut spoils every acceleration, so all adaptations stand
    # still
    unchanged = all_follow(memory.applied)
    free = logical_and(rotors_follow(par.mixer, squares), unchanged)

    def adapt(
        deltas: Iterable[Scalar],
        sliding: Iterable[Scalar],
        group: int,
        inside: Iterable[Scalar],
    ) -> Scalars:
        rate, limit = par.adaptation[group], par.limit[group]
        return tuple(
            where(fits, clip(delta + rate * s * dt, -limit, limit), delta)
            for delta, s, fits in zip(deltas, sliding, inside, strict=True)
        )

    follow = [
        logical_and(fits, unchanged)
        for fits in joints_follow(par.model.vehicle, torques)
    ]
    return (
        SlidingMemory(
            position=Vec3(*adapt(memory.position, s_p, 0, (free,) * 3)),
            attitude=Vec3(*adapt(memory.attitude, s_R, 1, (free,) * 3)),
            joints=adapt(memory.joints, s_q, 2, follow),
            sent=command,
            applied=all_applied(len(follow)),
        ),
        command,
    )


def _translation(
    memory: SlidingMemory,
    measurement: Measurement,
    reference: Reference,
    par: SlidingParameters,
) -> tuple[Scalars, Vec3]:
    """Sliding variables of the position, and desired specific force, world axes."""
    per_mass = divide(1.0, par.model.vehicle.mass)
    error = measurement.position - reference.position
    drift = measurement.velocity - reference.velocity
    kp, kd = par.gains.position * per_mass, par.gains.velocity * per_mass
    s, linear, push = _sliding_modes(error, drift, kp, kd, 0, par)
    feedback = Vec3(*linear) - Vec3(*push) - memory.position
    return s, feedback + reference.acceleration + E_Z * par.model.gravity


def _rotation(
    memory: SlidingMemory,
    measurement: Measurement,
    reference: Reference,
    R: Mat3,
    up: Vec3,
    par: SlidingParameters,
) -> tuple[Scalars, Vec3]:
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
    s, accelerations, push = _sliding_modes(error, drift, kp, kd, 1, par)
    linear = Vec3(*accelerations)
    # J^-1 diag(J) linear = linear - J^-1 (J - diag(J)) linear: without products of
    # inertia nothing is left to round
    mixed = Sym3(0, 0, 0, J.xy, J.xz, J.yz).apply(linear)
    turned = linear - Vec3(
        *ldl_solve([list(row) for row in J.full().rows], list(mixed))
    )
    return s, turned - Vec3(*push) - memory.attitude


def _arm(
    memory: SlidingMemory,
    measurement: Measurement,
    reference: Reference,
    par: SlidingParameters,
) -> tuple[Scalars, Scalars]:
    """Sliding variables of the joints, and desired joint accelerations."""
    s, linear, push = _sliding_modes(
        differences(measurement.joints, reference.joints),
        differences(measurement.joint_rates, reference.joint_rates),
        par.joint_gains.stiffness,
        par.joint_gains.damping,
        2,
        par,
    )
    wanted = sums(differences(linear, push), reference.joint_accelerations)
    return s, differences(wanted, memory.joints)


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
