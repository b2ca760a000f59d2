"""Laws of Barakou et al. 2026: RotorS's controller, decoupled PD baseline, hybrid
geometric computed torque.

Each is step(memory, measurement, reference, dt, *, par) -> (memory, command); these
have no memory.

Source: Barakou et al. 2026.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from skyarm import dynamics
from skyarm.algebra import (
    E_Z,
    ZERO3,
    Force,
    Mat3,
    Motion,
    Quaternion,
    Scalar,
    Scalars,
    Vec3,
    sums,
)
from skyarm.algebra.quaternion import euler_angles
from skyarm.algebra.scalars import add, cos, mul
from skyarm.control.blocks.actuators import limit_efforts
from skyarm.control.blocks.common import joint_pd, make_command, turn_towards
from skyarm.control.blocks.geometric import body_thrust, downward_acceleration
from skyarm.control.controller import Memory
from skyarm.control.law_maker import law_maker
from skyarm.control.model import Model, Parameters
from skyarm.dynamics.actuators import Command, mix
from skyarm.dynamics.actuators.drive import friction
from skyarm.dynamics.euler_coordinates import (
    rate_matrix,
    rate_matrix_inverse,
    rate_matrix_rate,
)
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement


def geometric_accelerations(
    par: Parameters,
    measurement: Measurement,
    reference: Reference,
    *,
    feedforward: bool,
) -> tuple[Mat3, Vec3, Vec3]:
    """Attitude R_WB, desired acceleration a_d of eq. (82), and angular acceleration
    alpha_d of eq. (85).
    """
    R = measurement.rotation
    vehicle = par.model.vehicle
    a_d = downward_acceleration(
        par.gains,
        vehicle.mass,
        par.model.gravity,
        position_error=measurement.position - reference.position,
        velocity_error=measurement.velocity - reference.velocity,
        acceleration=reference.acceleration if feedforward else ZERO3,
    )
    return R, a_d, turn_towards(par, measurement, reference, R, -a_d)


def rotors_sim_position(
    memory: Memory,
    measurement: Measurement,
    reference: Reference,
    dt: Scalar,
    *,
    par: Parameters,
) -> tuple[Memory, Command]:
    """RotorS's geometric position controller for the base, with zero joint torques."""
    del dt
    # RotorS's code feeds the reference's acceleration forward and knows no arm, whose
    # joints hang free
    speeds = _base_speeds(par, measurement, reference, feedforward=True)
    return memory, Command(rotor_speeds=speeds, efforts=par.model.vehicle.zeros)


def decoupled_pd(
    memory: Memory,
    measurement: Measurement,
    reference: Reference,
    dt: Scalar,
    *,
    par: Parameters,
) -> tuple[Memory, Command]:
    """Baseline of Barakou et al. 2026: RotorS's controller for the base, joint PD with
    simplified gravity.

    tau = Kp e + Kd ed + G(joints) at R = 1, limited to the joint's effort. Position and
    velocity references only.

    Source: Barakou et al. 2026, section 5 and Table A2.
    """
    del dt
    # the paper's baseline reads positions and velocities alone
    speeds = _base_speeds(par, measurement, reference, feedforward=False)
    weight = level_joint_gravity(par.model, measurement.joints)
    pull = joint_pd(par.joint_gains, measurement, with_weighted_rates(par, reference))
    efforts = with_friction(par, measurement, reference, sums(pull, weight))
    return memory, Command(rotor_speeds=speeds, efforts=limit_efforts(par, efforts))


def hybrid_computed_torque(
    memory: Memory,
    measurement: Measurement,
    reference: Reference,
    dt: Scalar,
    *,
    par: Parameters,
) -> tuple[Memory, Command]:
    """Hybrid geometric computed torque: geometric accelerations through the coupled
    inverse dynamics, body axes.

    [-a_d; alpha_d; etadd_d] -> recursive Newton-Euler = M qdd + C qd + G of (49), (88);
    thrust is the force along body z (103), the torque goes to the rotors through the
    mixer, joint torques are limited. The option ``euler`` is the paper's own form, on
    [p, Phi, eta].

    Source: Barakou et al. 2026, eq. (86)-(96). Gravity stands in -a_d once, for base
    and joints alike.
    """
    del dt
    terms = par.terms
    R, a_d, alpha = geometric_accelerations(
        par, measurement, reference, feedforward=terms.feedforward
    )
    base = Motion(alpha, R.apply_T(-a_d))
    qdd = joint_accelerations(par, measurement, with_weighted_rates(par, reference))
    if par.euler:
        force, torques = force_by_euler_rates(par, R, measurement, base, qdd)
    else:
        force, torques = generalized_force(par, R, measurement, base, qdd)
    torques = with_friction(par, measurement, reference, torques)
    return memory, make_command(par, force.torque, force.force.z, torques)


def generalized_force(
    par: Parameters, R: Mat3, measurement: Measurement, base: Motion, qdd: Scalars
) -> tuple[Force, Scalars]:
    """Inverse dynamics at the measured state, without the terms that an ablation
    disables.
    """
    vehicle, terms = par.model.vehicle, par.terms
    q = measurement.joints
    rate, rates = measurement.rate, measurement.joint_rates
    # the body form has no matrix C to leave out: at zero rates its products vanish
    if not terms.coriolis:
        rate, rates = ZERO3, (0,) * vehicle.n
    weight = R.apply_T(E_Z * par.model.gravity)
    if not terms.full_gravity:
        base = Motion(base.angular, base.linear - weight)
    force, torques = dynamics.inverse_dynamics(vehicle, q, rate, rates, base, qdd)
    if not terms.coupling:
        # without the coupling blocks base and arm are solved apart, each as if the
        # other stood still; the weight stays with both
        alone = Motion(ZERO3, weight if terms.full_gravity else ZERO3)
        force, _ = dynamics.inverse_dynamics(
            vehicle, q, rate, rates, base, (0,) * vehicle.n
        )
        _, torques = dynamics.inverse_dynamics(vehicle, q, rate, rates, alone, qdd)
    if not terms.full_gravity:
        force = force + Force(ZERO3, weight * vehicle.mass)
        level = level_joint_gravity(par.model, q)
        torques = sums(torques, level)
    return force, torques


def force_by_euler_rates(
    par: Parameters, R: Mat3, measurement: Measurement, base: Motion, qdd: Scalars
) -> tuple[Force, Scalars]:
    """Inverse dynamics M qdd + C qd in coordinates with Euler angles, as force on the
    base and joint torques.

    alpha_d passes (95), Phidd = Q^-1 (alpha_d - Qdot Phid); the dynamics is the tree's,
    by w = Q Phid, so that an ablation without C leaves Qdot Phid out; torque on Phi is
    tau_Phi = Q^T tau, and (94) gives tau = Q^-T tau_Phi.

    Source: Barakou et al. 2026, eq. (88), (94), (95).
    """
    phi, theta, _ = euler_angles(R)
    Q, inverse = rate_matrix(phi, theta), rate_matrix_inverse(phi, theta)
    rates = inverse.apply(measurement.rate)
    turning = rate_matrix_rate(phi, theta, rates).apply(rates)
    # Q Q^-1 is 1 but for rounding and at its pole: the way of the paper
    alpha = Q.apply(inverse.apply(base.angular - turning))
    if par.terms.coriolis:
        alpha = alpha + turning
    force, torques = generalized_force(
        par, R, measurement, Motion(alpha, base.linear), qdd
    )
    return Force(inverse.apply_T(Q.apply_T(force.torque)), force.force), torques


SINGULAR = 1e-6
"""Squared cosine of the pitch below which the Euler rates count as singular: within
0.06 degrees, where they are a thousand times the body's; chosen."""

SINGULAR_PITCH = (
    "pitch near 90 degrees: Euler angles are singular; use hybrid_computed_torque (body"
    " coordinates)"
)


def euler_margin(quaternion: Quaternion) -> Scalar:
    """Squared cosine of the pitch minus its least value: distance of an attitude to the
    singularity of Euler rates.
    """
    # the Euler rates have the cosine of the pitch as a divisor
    cosine = cos(euler_angles(quaternion.rotation())[1])
    return cosine * cosine - SINGULAR


def level_joint_gravity(model: Model, joints: Scalars) -> Scalars:
    """Joint torques that hold the arm against gravity under a level base, eq.
    (78)-(79).
    """
    still = (0,) * model.vehicle.n
    level = Motion(ZERO3, E_Z * model.gravity)
    return dynamics.inverse_dynamics(model.vehicle, joints, ZERO3, still, level, still)[
        1
    ]


def joint_accelerations(
    par: Parameters, measurement: Measurement, reference: Reference
) -> Scalars:
    """Desired joint accelerations, eq. (92): PD plus, if fed forward, the reference's
    acceleration.
    """
    pd = joint_pd(par.joint_gains, measurement, reference)
    if not par.terms.feedforward:
        return pd
    return sums(pd, reference.joint_accelerations)


def with_friction(
    par: Parameters,
    measurement: Measurement,
    reference: Reference,
    efforts: Sequence[Scalar],
) -> Scalars:
    """Joint torques with a fraction of the modelled friction compensated.

    Viscous friction is taken at the measured rate, Coulomb's at the reference's, which
    does not chatter. It belongs behind the inertia matrix: a joint's own friction moves
    nothing else.
    """
    if not par.friction_compensation:
        return tuple(efforts)
    rows = zip(
        efforts,
        par.friction_compensation,
        par.model.vehicle.links,
        measurement.joint_rates,
        reference.joint_rates,
        strict=True,
    )
    return tuple(
        add(effort, mul(share, friction(link.joint, rate, desired)))
        for effort, share, link, rate, desired in rows
    )


def with_weighted_rates(par: Parameters, reference: Reference) -> Reference:
    """Reference with weighted joint rates (set-point weighting of the derivative
    action).
    """
    if not par.rate_weights:
        return reference
    rates = tuple(
        mul(weight, qd_d)
        for weight, qd_d in zip(par.rate_weights, reference.joint_rates, strict=True)
    )
    return replace(reference, joint_rates=rates)


def _base_speeds(
    par: Parameters,
    measurement: Measurement,
    reference: Reference,
    *,
    feedforward: bool,
) -> Scalars:
    """Rotor speeds of RotorS's controller, for torque I_b alpha_d and thrust -m a_d .
    (R e_3).
    """
    R, a_d, alpha = geometric_accelerations(
        par, measurement, reference, feedforward=feedforward
    )
    vehicle = par.model.vehicle
    speeds, _ = mix(
        par.mixer, vehicle.base.inertia.apply(alpha), body_thrust(vehicle.mass, a_d, R)
    )
    return speeds


make_rotors_sim_position = law_maker(
    "rotors_sim_position", rotors_sim_position, shared=("rate_error",)
)
"""Maker of RotorS's position controller."""

OF_JOINTS = ("friction_compensation", "rate_weights")

make_decoupled_pd = law_maker(
    "decoupled_pd", decoupled_pd, shared=("rate_error", *OF_JOINTS), torque_gains=True
)
"""Maker of the decoupled PD baseline of Barakou et al. 2026."""

make_hybrid_computed_torque = law_maker(
    "hybrid_computed_torque",
    hybrid_computed_torque,
    shared=("rate_error", "terms", "euler", *OF_JOINTS),
    bounds=lambda par: (
        {"margin": euler_margin, "limit": SINGULAR_PITCH} if par.euler else {}
    ),
)
"""Maker of the hybrid geometric computed torque law of Barakou et al. 2026."""
