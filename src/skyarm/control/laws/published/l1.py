"""The state predictor and the adaptation of :mod:`skyarm.control.laws.published.l1`.

A prediction is made one period later than it is published, at the instant that it is for: only then is it known what
was sent in between.

L1 adaptive augmentation of the coupled geometric law: state predictor, piecewise-constant adaptation, low-pass.

With z = [v (world), w (body), joint rates] and one Hurwitz rate -a per group:

    zhat+ = zhat + dt (zdd(z, u) + sigma - a ztilde),   ztilde = zhat - z
    sigma = -Phi^-1 mu = -(-a) e / (e - 1) ztilde,      e = exp(-a dt)
    [F, T, tau] = M(q) sigma,   u = u_b - C(s) [F . b_z, T, tau]

zdd is the model's forward dynamics with the command that was sent, as the actuators can give it (limits included, which
keeps the estimate from winding up); u_b is the geometric law through the coupled inverse dynamics. C(s) is a
first-order low-pass on the thrust and two in series on the torques. The force across body z is unmatched: the published
law leaves it; with ``lateral`` its low-pass goes into the wanted acceleration, which is no part of the publication.

Of a constant disturbance the adaptation finds the share e, one period's decay: 1 - e of it stays, as published.

Deviations: the baseline knows the arm; the predictor is the coupled model with joint rates as further states; the
compensation is cut at a limit.

Source: Wu, Cheng, Zhao, Gahlawat, Ackerman, Lakshmanan, Yang, Yu, Hovakimyan, L1Quad, IEEE Trans. Control Systems
Technology 33, 2025 (arXiv 2302.07208), section III; parameter values start from the authors' Crazyflie firmware.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm import dynamics
from skyarm.actuation import Command
from skyarm.algebra import ZERO3, Force, Mat3, Motion, Quaternion, Vec3
from skyarm.control.blocks.common import (
    inverse_mass,
    make_command,
    make_parameters,
    no_command,
    rotor_thrust,
    turn_towards,
    wanted_specific_force,
)
from skyarm.control.blocks.filters import low_pass
from skyarm.control.controller import Controller
from skyarm.control.laws.paper import joint_accelerations
from skyarm.control.model import GeometricGains, JointGains, Model, Parameters
from skyarm.control.options import flag, positive, three
from skyarm.dynamics.state import coordinate_acceleration
from skyarm.records.units import Unit
from skyarm.reference import Reference
from skyarm.scalars import Scalar, clip, divide, exp, minimum, where
from skyarm.sensors.measurement import Measurement


@dataclass(frozen=True, kw_only=True, slots=True)
class Velocities:
    """The predictor's three groups: of the base (world axes), of its turning (base axes), of the joints.

    Velocities in m/s, rad/s, rad/s or m/s; what disturbs them in m/s^2, rad/s^2, rad/s^2 or m/s^2.
    """

    linear: Annotated[Vec3, Unit("m/s", "of a disturbance m/s^2, world axes")]
    rate: Annotated[Vec3, Unit("rad/s", "of a disturbance rad/s^2, base axes")]
    joints: Annotated[tuple[Scalar, ...], Unit("rad/s or m/s", "of a disturbance rad/s^2 or m/s^2")]


@dataclass(frozen=True, kw_only=True, slots=True)
class Past:
    """Initial values of a prediction, a period ago.

    Attributes:
        quaternion, joints: attitude and joint positions (rad or m), measured. measured: velocities.
        error: of the prediction then. sigma: what disturbed, as accelerations.
    """

    quaternion: Annotated[Quaternion, Unit("", "w x y z, measured one period ago")]
    joints: Annotated[tuple[Scalar, ...], Unit("rad or m", "measured one period ago")]
    measured: Velocities
    error: Velocities
    sigma: Velocities


def nowhere(joints: int) -> Past:
    """Before the first measurement."""
    still, arm = Vec3(0.0, 0.0, 0.0), (0.0,) * joints
    none = Velocities(linear=still, rate=still, joints=arm)
    return Past(quaternion=Quaternion(1.0, 0.0, 0.0, 0.0), joints=arm, measured=none, error=none, sigma=none)


def past_of(measurement: Measurement, error: Velocities, sigma: Velocities) -> Past:
    """Initial values of the next prediction."""
    measured = Velocities(linear=measurement.velocity, rate=measurement.rate, joints=measurement.joint_rates)
    return Past(
        quaternion=measurement.quaternion, joints=measurement.joints, measured=measured, error=error, sigma=sigma
    )


def adaptation(error: Any, rate: Any, dt: Any) -> Any:
    """Piecewise-constant estimate -Phi^-1 mu of one channel from its prediction error, for the predictor rate -a.

    The error that sigma makes in one period from ztilde = 0 is e^(a dt) times itself: the next sigma cancels it.
    """
    e = exp(-(rate * dt))
    return error * divide(rate * e, e - 1.0)


def estimates(error: Velocities, rates: tuple[Any, Any, Any], dt: Any) -> Velocities:
    """Sigma of the three groups, for the predictor rates a (1/s)."""
    linear, angular, joints = rates
    return Velocities(
        linear=Vec3(*(adaptation(e, linear, dt) for e in error.linear)),
        rate=Vec3(*(adaptation(e, angular, dt) for e in error.rate)),
        joints=tuple(adaptation(e, joints, dt) for e in error.joints),
    )


def prediction_error(
    model: Model,
    rates: tuple[Any, Any, Any],
    started: Any,
    past: Past,
    sent: Command,
    measurement: Measurement,
    dt: Any,
) -> Velocities:
    """Ztilde = zhat - z; zero at the first call."""
    expected = predict_velocities(model, rates, past, sent, dt)

    def off(foreseen: Any, measured: Any) -> Any:
        return where(started > 0.5, foreseen - measured, 0.0)

    return Velocities(
        linear=Vec3(*(off(p, m) for p, m in zip(expected.linear, measurement.velocity, strict=True))),
        rate=Vec3(*(off(p, m) for p, m in zip(expected.rate, measurement.rate, strict=True))),
        joints=tuple(off(p, m) for p, m in zip(expected.joints, measurement.joint_rates, strict=True)),
    )


def predict_velocities(model: Model, rates: tuple[Any, Any, Any], past: Past, sent: Command, dt: Any) -> Velocities:
    """Zhat one period after its past, by Euler's step as the authors take it."""
    vehicle, was = model.vehicle, past.measured
    speeds = [minimum(speed, rotor.max_speed) for speed, rotor in zip(sent.rotor_speeds, vehicle.rotors, strict=True)]
    applied = Force(*rotor_thrust(vehicle, speeds))
    proper, qdd = dynamics.forward_dynamics(vehicle, past.joints, was.rate, was.joints, applied, sent.efforts)
    linear, angular = coordinate_acceleration(past.quaternion.rotation(), proper, model.gravity)
    slow, fast, arm = rates

    def ahead(measured: Any, off: Any, acceleration: Any, disturbance: Any, rate: Any) -> Any:
        return measured + off + dt * (acceleration + disturbance - rate * off)

    def group(measured: Any, off: Any, acceleration: Any, disturbance: Any, rate: Any) -> list[Any]:
        return [ahead(*each, rate) for each in zip(measured, off, acceleration, disturbance, strict=True)]

    return Velocities(
        linear=Vec3(*group(was.linear, past.error.linear, linear, past.sigma.linear, slow)),
        rate=Vec3(*group(was.rate, past.error.rate, angular, past.sigma.rate, fast)),
        joints=tuple(group(was.joints, past.error.joints, qdd, past.sigma.joints, arm)),
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class L1Parameters(Parameters):
    """Constants in addition to the gains.

    Attributes:
        predictor: a of velocity, rate, joint rates, 1/s.
        thrust_filter, torque_filter, second_filter, joint_filter, lateral_filter: bandwidths of C(s), rad/s; torques go
            through ``torque_filter`` and ``second_filter``, joint efforts through ``joint_filter`` and
            ``second_filter``.
        force_limit: largest compensated force, N. torque_limit: largest torque, N m.
        lateral: compensate the unmatched force through the attitude.
    """

    predictor: Annotated[tuple[Scalar, Scalar, Scalar], Unit("1/s", "of velocity, body rate, joint rates")]
    thrust_filter: Annotated[Scalar, Unit("rad/s")]
    torque_filter: Annotated[Scalar, Unit("rad/s")]
    second_filter: Annotated[Scalar, Unit("rad/s", "of torques and efforts")]
    joint_filter: Annotated[Scalar, Unit("rad/s")]
    lateral_filter: Annotated[Scalar, Unit("rad/s")]
    force_limit: Annotated[Scalar, Unit("N", "largest compensated force")]
    torque_limit: Annotated[Scalar, Unit("N m", "largest compensated torque")]
    lateral: bool = False


@dataclass(frozen=True, kw_only=True, slots=True)
class L1Memory:
    """Memory of the law.

    Attributes:
        started: 0 before the first measurement.
        past: what the prediction of the present instant begins from. sent: the command in between.
        force: low-pass of the estimated force, world axes, N. thrust: along body z, N.
        torque, torque_twice: after one and two filters, N m. efforts, efforts_twice: of the joints.
    """

    started: Annotated[Scalar, Unit("", "0 before the first measurement, then 1")]
    past: Past
    sent: Command
    force: Annotated[Vec3, Unit("N", "filtered estimate, world axes")]
    thrust: Annotated[Scalar, Unit("N", "filtered estimate along body z")]
    torque: Annotated[Vec3, Unit("N m", "filtered once, base axes")]
    torque_twice: Annotated[Vec3, Unit("N m", "filtered twice, base axes")]
    efforts: Annotated[tuple[Scalar, ...], Unit("N m or N", "filtered once")]
    efforts_twice: Annotated[tuple[Scalar, ...], Unit("N m or N", "filtered twice")]


def l1_adaptive(
    memory: L1Memory, measurement: Measurement, reference: Reference, dt: Any, *, par: L1Parameters
) -> tuple[L1Memory, Command]:
    """Geometric law through the coupled inverse dynamics, less the filtered estimate of what else acts."""
    vehicle, R = par.model.vehicle, measurement.quaternion.rotation()
    error = prediction_error(par.model, par.predictor, memory.started, memory.past, memory.sent, measurement, dt)
    sigma = estimates(error, par.predictor, dt)
    force, efforts = dynamics.inverse_dynamics(
        vehicle,
        measurement.joints,
        ZERO3,
        (0,) * vehicle.n,
        Motion(sigma.rate, R.apply_T(sigma.linear)),
        sigma.joints,
    )
    filtered = _filtered(memory, R, force, efforts, dt, par)
    command = _command(filtered, measurement, reference, R, par)
    return dataclasses.replace(filtered, past=past_of(measurement, error, sigma), sent=command), command


def _filtered(memory: L1Memory, R: Mat3, force: Force, efforts: Any, dt: Any, par: L1Parameters) -> L1Memory:
    """The memory with the low-pass filters moved on, each held within its limit.

    The limit comes after the filter: noise cut on one side only would leave a bias.
    """
    links = par.model.vehicle.links

    def passed(old: Vec3, new: Vec3, bandwidth: Any, limit: Any) -> Vec3:
        moved = (low_pass(a, b, bandwidth, dt) for a, b in zip(old, new, strict=True))
        return Vec3(*(clip(c, -limit, limit) for c in moved))

    def passed_on(old: Any, new: Any, bandwidth: Any) -> tuple[Any, ...]:
        moved = (low_pass(a, b, bandwidth, dt) for a, b in zip(old, new, strict=True))
        limits = [link.joint.effort_limit for link in links]
        return tuple(clip(c, -limit, limit) for c, limit in zip(moved, limits, strict=True))

    torque = passed(memory.torque, force.torque, par.torque_filter, par.torque_limit)
    once = passed_on(memory.efforts, efforts, par.joint_filter)
    thrust = low_pass(memory.thrust, force.force.z, par.thrust_filter, dt)
    return L1Memory(
        started=1.0,
        past=memory.past,
        sent=memory.sent,
        force=passed(memory.force, R.apply(force.force), par.lateral_filter, par.force_limit),
        thrust=clip(thrust, -par.force_limit, par.force_limit),
        torque=torque,
        torque_twice=passed(memory.torque_twice, torque, par.second_filter, par.torque_limit),
        efforts=once,
        efforts_twice=passed_on(memory.efforts_twice, once, par.second_filter),
    )


def _command(filtered: L1Memory, measurement: Measurement, reference: Reference, R: Mat3, par: L1Parameters) -> Command:
    """u_b + u_ad."""
    vehicle = par.model.vehicle
    wanted = up = wanted_specific_force(par, measurement, reference)
    b3 = R.column(2)
    if par.lateral:
        # only the attitude leans against it: the base accelerates as wanted, and so the arm must be told
        up = wanted - (filtered.force - b3 * filtered.force.dot(b3)) * inverse_mass(vehicle)
    force, efforts = dynamics.inverse_dynamics(
        vehicle,
        measurement.joints,
        measurement.rate,
        measurement.joint_rates,
        Motion(turn_towards(par, measurement, reference, R, up), R.apply_T(wanted)),
        joint_accelerations(par, measurement, reference),
    )
    held = [a - b for a, b in zip(efforts, filtered.efforts_twice, strict=True)]
    return make_command(par, force.torque - filtered.torque_twice, force.force.z - filtered.thrust, held)[0]


def make_l1(
    model: Model,
    *,
    gains: GeometricGains | None = None,
    joint_gains: JointGains | None = None,
    mixer_policy: str = "clip",
    predictor: tuple[float, float, float] = (5.0, 10.0, 10.0),
    thrust_filter: float = 5.0,
    torque_filter: float = 10.0,
    second_filter: float = 20.0,
    joint_filter: float = 10.0,
    lateral_filter: float = 2.0,
    lateral: bool = False,
) -> Controller:
    """The law for any arm.

    Args:
        model: what it believes.
        gains: of the geometric baseline, as the paper's.
        joint_gains: on acceleration, 1/s^2 and 1/s.
        mixer_policy: see :class:`skyarm.actuation.Mixer`.
        predictor: rates of velocity, body rate and joint rates, 1/s.
        thrust_filter: rad/s, as the following; see :class:`L1Parameters`.
        torque_filter: rad/s.
        second_filter: rad/s.
        joint_filter: rad/s.
        lateral_filter: rad/s.
        lateral: compensate the unmatched force through the attitude.
    """
    vehicle = model.vehicle
    weight = vehicle.mass * model.gravity
    reach = max(float(rotor.position.norm()) for rotor in vehicle.rotors)
    par = make_parameters(
        L1Parameters,
        model,
        gains=gains,
        joint_gains=joint_gains,
        mixer_policy=mixer_policy,
        predictor=three("predictor", predictor),
        thrust_filter=positive("thrust_filter", thrust_filter),
        torque_filter=positive("torque_filter", torque_filter),
        second_filter=positive("second_filter", second_filter),
        joint_filter=positive("joint_filter", joint_filter),
        lateral_filter=positive("lateral_filter", lateral_filter),
        # half of the weight, and that on one side of the rotors: more cannot be compensated and flown at once
        force_limit=0.5 * weight,
        torque_limit=0.25 * weight * reach,
        lateral=flag("lateral", lateral),
    )
    still, arm = Vec3(0.0, 0.0, 0.0), (0.0,) * vehicle.n
    memory = L1Memory(
        started=0.0,
        past=nowhere(vehicle.n),
        sent=no_command(vehicle),
        force=still,
        thrust=0.0,
        torque=still,
        torque_twice=still,
        efforts=arm,
        efforts_twice=arm,
    )
    return Controller(name="l1_adaptive", law=l1_adaptive, par=par, memory=memory)
