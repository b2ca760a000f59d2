"""What flies when a law is given up: level hover where that happened, the arm on its way to its stowed pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm import dynamics
from skyarm.actuation import Command, Mixer, mix
from skyarm.algebra import E_Z, ZERO3, Motion
from skyarm.control.geometric import attitude_loop, body_thrust, downward_acceleration
from skyarm.control.model import GeometricGains, JointGains, Model
from skyarm.dynamics.measurement import Measurement
from skyarm.reference import Reference
from skyarm.scalars import Scalar, add, divide, mul, sub
from skyarm.vehicle.records import Joint


@dataclass(frozen=True, kw_only=True, slots=True)
class Recovery:
    """Constants of the recovery law.

    Attributes:
        gains: of the base. joint_gains: of the joints, on torque.
        stow: rad or m, pose of the arm. stow_speed: rad/s or m/s, on the way there.
    """

    gains: GeometricGains
    joint_gains: JointGains
    stow: tuple[Scalar, ...]
    stow_speed: tuple[Scalar, ...]


def stowed(joint: Joint) -> float:
    """Middle of a joint's range; where a side is open zero, or the value in the range next to it."""
    low, high = float(joint.lower), float(joint.upper)
    if low > -float("inf") and high < float("inf"):
        return 0.5 * (low + high)
    return min(max(0.0, low), high)


def recover(recovery: Recovery, model: Model, mixer: Mixer, measurement: Measurement, reference: Reference) -> Command:
    """Geometric control of the base and PD of the joints, with the weight of the arm at the present attitude.

    The law has no memory and needs no model of motion: torque = I alpha_d + the arm's static moment about the base.

    Source: Lee, Leok, McClamroch 2010 as RotorS flies it; joint gravity by recursive Newton-Euler at rest.
    """
    R = measurement.quaternion.rotation()
    vehicle = model.vehicle
    a_d = downward_acceleration(
        recovery.gains,
        vehicle.mass,
        model.gravity,
        position_error=measurement.position - reference.position,
        velocity_error=measurement.velocity - reference.velocity,
        acceleration=ZERO3,
    )
    alpha = attitude_loop(
        recovery.gains,
        vehicle.base.inertia,
        a_d=a_d,
        yaw=reference.yaw,
        yaw_rate=0.0,
        R_WB=R,
        w_B=measurement.rate,
        rate_form="corrected",
    )
    still = (0,) * vehicle.n
    resting = Motion(ZERO3, R.apply_T(E_Z * model.gravity))
    weight, held = dynamics.inverse_dynamics(vehicle, measurement.joints, ZERO3, still, resting, still)
    speeds, _ = mix(mixer, vehicle.base.inertia.apply(alpha) + weight.torque, body_thrust(vehicle.mass, a_d, R))
    efforts = (
        add(add(mul(kp, sub(wanted, q)), mul(kd, sub(wanted_rate, rate))), gravity)
        for kp, kd, wanted, q, wanted_rate, rate, gravity in zip(
            recovery.joint_gains.stiffness,
            recovery.joint_gains.damping,
            reference.joints,
            measurement.joints,
            reference.joint_rates,
            measurement.joint_rates,
            held,
            strict=True,
        )
    )
    return Command(rotor_speeds=speeds, efforts=tuple(efforts))


def base_stiffness(recovery: Recovery, mass: Any) -> tuple[Any, Any]:
    """(1/s^2, 1/s) of the law along the vertical, for the governor."""
    return divide(recovery.gains.position.z, mass), divide(recovery.gains.velocity.z, mass)
