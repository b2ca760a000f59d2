"""The paper's laws: RotorS's controller alone, the decoupled PD baseline, the hybrid geometric computed torque.

Each is step(memory, measurement, reference, dt, *, par) -> (memory, command); these have no memory.

Source: Barakou et al. 2026.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from skyarm import dynamics
from skyarm.actuation import Command, mix
from skyarm.algebra import E_Z, ZERO3, Force, Mat3, Motion, Vec3
from skyarm.control.blocks.common import turn_towards
from skyarm.control.blocks.default_gains import fitting_gains, fitting_mixer
from skyarm.control.blocks.geometric import RATE_ERRORS, body_thrust, downward_acceleration
from skyarm.control.blocks.joint_friction import shares, with_friction
from skyarm.control.blocks.saturation import limit_efforts
from skyarm.control.controller import Controller, ControllerError, Law
from skyarm.control.model import GeometricGains, JointGains, Model, Parameters, Terms
from skyarm.files import shown
from skyarm.reference import Reference
from skyarm.scalars import add, mul
from skyarm.sensors.measurement import Measurement


def geometric_accelerations(
    par: Parameters, measurement: Measurement, reference: Reference, *, feedforward: bool
) -> tuple[Mat3, Vec3, Vec3]:
    """R_WB, a_d of (82) (points down in hover) and alpha_d of (85)."""
    R = measurement.quaternion.rotation()
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
    memory: Any, measurement: Measurement, reference: Reference, dt: Any, *, par: Parameters
) -> tuple[Any, Command]:
    """RotorS's geometric position controller alone; joints get no torque."""
    del dt
    speeds = _base_speeds(par, measurement, reference, feedforward=True)
    return memory, Command(rotor_speeds=speeds, efforts=(0.0,) * par.model.vehicle.n)


def decoupled_pd(
    memory: Any, measurement: Measurement, reference: Reference, dt: Any, *, par: Parameters
) -> tuple[Any, Command]:
    """The paper's baseline: RotorS's controller on the base, PD with reduced gravity on the joints.

    tau = Kp e + Kd ed + G(joints) at R = 1, limited to the joint's effort. Position and velocity references only.

    Source: Barakou et al. 2026, section 5 and Table A2.
    """
    del dt
    speeds = _base_speeds(par, measurement, reference, feedforward=False)
    weight = level_joint_gravity(par.model, measurement.joints)
    pull = _joint_pd(par, measurement, with_weighted_rates(par, reference))
    efforts = with_friction(par, measurement, reference, [add(a, b) for a, b in zip(pull, weight, strict=True)])
    return memory, Command(rotor_speeds=speeds, efforts=limit_efforts(par, efforts))


def hybrid_computed_torque(
    memory: Any, measurement: Measurement, reference: Reference, dt: Any, *, par: Parameters
) -> tuple[Any, Command]:
    """Geometric accelerations into the fully coupled inverse dynamics, in body coordinates (no Euler singularity).

    [-a_d; alpha_d; etadd_d] -> recursive Newton-Euler = M qdd + C qd + G of (49), (88); thrust is the force along body
    z (103), the torque goes to the rotors through the mixer, joint torques are limited.

    Source: Barakou et al. 2026, eq. (86)-(96). Gravity stands in -a_d once, for base and joints alike.
    """
    del dt
    terms = par.terms
    R, a_d, alpha = geometric_accelerations(par, measurement, reference, feedforward=terms.feedforward)
    base = Motion(alpha, R.apply_T(-a_d))
    wanted = joint_accelerations(par, measurement, with_weighted_rates(par, reference))
    force, torques = generalized_force(par, R, measurement, base, wanted)
    torques = with_friction(par, measurement, reference, torques)
    speeds, _ = mix(par.mixer, force.torque, force.force.z)
    return memory, Command(rotor_speeds=speeds, efforts=limit_efforts(par, torques))


def generalized_force(
    par: Parameters, R: Mat3, measurement: Measurement, base: Motion, qdd: tuple[Any, ...]
) -> tuple[Force, tuple[Any, ...]]:
    """Inverse dynamics of the model at the measured state, less the terms an ablation takes away."""
    vehicle, terms = par.model.vehicle, par.terms
    q = measurement.joints
    rate, rates = measurement.rate, measurement.joint_rates
    if not terms.coriolis:
        rate, rates = ZERO3, (0,) * vehicle.n
    weight = R.apply_T(E_Z * par.model.gravity)
    if not terms.full_gravity:
        base = Motion(base.angular, base.linear - weight)
    force, torques = dynamics.inverse_dynamics(vehicle, q, rate, rates, base, qdd)
    if not terms.coupling:
        alone = Motion(ZERO3, weight if terms.full_gravity else ZERO3)
        force, _ = dynamics.inverse_dynamics(vehicle, q, rate, rates, base, (0,) * vehicle.n)
        _, torques = dynamics.inverse_dynamics(vehicle, q, rate, rates, alone, qdd)
    if not terms.full_gravity:
        force = force + Force(ZERO3, weight * vehicle.mass)
        level = level_joint_gravity(par.model, q)
        torques = tuple(add(a, b) for a, b in zip(torques, level, strict=True))
    return force, torques


def level_joint_gravity(model: Model, joints: tuple[Any, ...]) -> tuple[Any, ...]:
    """Joint torques that carry the arm's weight with a level base: the reduced gravity of (78)-(79), for any arm."""
    still = (0,) * model.vehicle.n
    level = Motion(ZERO3, E_Z * model.gravity)
    return dynamics.inverse_dynamics(model.vehicle, joints, ZERO3, still, level, still)[1]


def joint_accelerations(par: Parameters, measurement: Measurement, reference: Reference) -> tuple[Any, ...]:
    """etadd_d of (92): PD on acceleration, and the reference's acceleration if it is fed forward."""
    pd = _joint_pd(par, measurement, reference)
    if not par.terms.feedforward:
        return pd
    return tuple(add(a, b) for a, b in zip(pd, reference.joint_accelerations, strict=True))


def with_weighted_rates(par: Parameters, reference: Reference) -> Reference:
    """The reference with its joint rates as much as the law lets them count: set-point weights of the derivative."""
    if not par.rate_weights:
        return reference
    rates = tuple(mul(weight, qd_d) for weight, qd_d in zip(par.rate_weights, reference.joint_rates, strict=True))
    return dataclasses.replace(reference, joint_rates=rates)


def _joint_pd(par: Parameters, measurement: Measurement, reference: Reference) -> tuple[Any, ...]:
    """kp (q_d - q) + kd (qd_d - qd) per joint.

    The difference of angles is not wrapped: encoders count turns, and a joint wound once past its reference is brought
    back the way it came, so that cables unwind. Wrapping is the reference's choice, not the law's.
    """
    gains = par.joint_gains
    return tuple(
        add(mul(kp, q_d - q), mul(kd, qd_d - qd))
        for kp, kd, q_d, q, qd_d, qd in zip(
            gains.stiffness,
            gains.damping,
            reference.joints,
            measurement.joints,
            reference.joint_rates,
            measurement.joint_rates,
            strict=True,
        )
    )


def _base_speeds(
    par: Parameters, measurement: Measurement, reference: Reference, *, feedforward: bool
) -> tuple[Any, ...]:
    """Rotor speeds of RotorS's controller: torque I_b alpha_d, thrust -m a_d . (R e_3)."""
    R, a_d, alpha = geometric_accelerations(par, measurement, reference, feedforward=feedforward)
    vehicle = par.model.vehicle
    speeds, _ = mix(par.mixer, vehicle.base.inertia.apply(alpha), body_thrust(vehicle.mass, a_d, R))
    return speeds


PAPER_LAWS: Mapping[str, Law] = {
    "rotors_sim_position": rotors_sim_position,
    "decoupled_pd": decoupled_pd,
    "hybrid_computed_torque": hybrid_computed_torque,
}


def make_rotors_sim_position(
    model: Model,
    *,
    gains: GeometricGains | None = None,
    joint_gains: JointGains | None = None,
    mixer_policy: str = "clip",
    rate_error: str = "rotors_sim",
) -> Controller:
    """RotorS's position controller; the arguments are those of :func:`make_hybrid_computed_torque`."""
    return _controller("rotors_sim_position", model, gains, joint_gains, mixer_policy, rate_error)


def make_decoupled_pd(
    model: Model,
    *,
    gains: GeometricGains | None = None,
    joint_gains: JointGains | None = None,
    mixer_policy: str = "clip",
    rate_error: str = "rotors_sim",
    friction_compensation: Sequence[float] | None = None,
    rate_weights: Sequence[float] | None = None,
) -> Controller:
    """The paper's baseline; the arguments are those of :func:`make_hybrid_computed_torque`, joint gains on torque."""
    of_joints = _of_joints(model, friction_compensation, rate_weights)
    return _controller("decoupled_pd", model, gains, joint_gains, mixer_policy, rate_error, **of_joints)


def make_hybrid_computed_torque(
    model: Model,
    *,
    gains: GeometricGains | None = None,
    joint_gains: JointGains | None = None,
    mixer_policy: str = "clip",
    rate_error: str = "rotors_sim",
    terms: Terms | None = None,
    friction_compensation: Sequence[float] | None = None,
    rate_weights: Sequence[float] | None = None,
) -> Controller:
    """The paper's law.

    Args:
        model: of the controller.
        gains: of the base; RotorS's Hummingbird's scaled to the model if left out.
        joint_gains: of the joints; :func:`default_joint_gains` if left out.
        mixer_policy: see :class:`skyarm.actuation.Mixer`.
        rate_error: see :func:`skyarm.control.blocks.geometric.rate_error`.
        terms: ablation of the computed torque; without ``full_gravity`` it is the paper's text to the letter.
        friction_compensation: for each joint, the share of its model's friction that its torque compensates, behind
            the inertia matrix; none if left out.
        rate_weights: for each joint, weight of its desired rate in the difference of rates; 1 if left out.

    Raises:
        ControllerError: unknown rate error, or gains or shares that do not fit the joints.
        AllocationError: the model's rotors do not span torque and thrust.
    """
    if terms is not None and not isinstance(terms, Terms):
        raise ControllerError(f"controller.terms = {shown(terms)}: must be Terms")
    name, of_joints = "hybrid_computed_torque", _of_joints(model, friction_compensation, rate_weights)
    return _controller(name, model, gains, joint_gains, mixer_policy, rate_error, terms=terms or Terms(), **of_joints)


def _of_joints(model: Model, friction: Sequence[float] | None, weights: Sequence[float] | None) -> dict[str, Any]:
    given = {"friction_compensation": friction, "rate_weights": weights}
    return {option: shares(option, value, model.vehicle.n) for option, value in given.items()}


def _controller(
    name: str,
    model: Model,
    gains: GeometricGains | None,
    joint_gains: JointGains | None,
    mixer_policy: str,
    rate_error: str,
    **more: Any,
) -> Controller:
    if rate_error not in RATE_ERRORS:
        raise ControllerError(f"controller.rate_error = {shown(rate_error)}: must be one of {', '.join(RATE_ERRORS)}")
    gains, joint_gains = fitting_gains(name, model, gains, joint_gains)
    mixer = fitting_mixer(model, mixer_policy)
    par = Parameters(model=model, gains=gains, joint_gains=joint_gains, mixer=mixer, rate_error=rate_error, **more)
    return Controller(name=name, law=PAPER_LAWS[name], par=par)
