"""What flies when a law is given up: level hover where that happened, the arm on its way to its stowed pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from skyarm import dynamics
from skyarm.actuation import Command, Mixer, mix
from skyarm.algebra import E_Z, ZERO3, Mat3, Motion, Vec3
from skyarm.control.blocks.geometric import (
    angular_acceleration,
    attitude_error,
    body_thrust,
    desired_attitude,
    downward_acceleration,
    rate_error,
)
from skyarm.control.controller import ControllerError
from skyarm.control.model import GeometricGains, JointGains, Model
from skyarm.files import number, shown
from skyarm.records.units import Unit
from skyarm.reference import Reference
from skyarm.scalars import Scalar, add, divide, maximum, mul, sqrt, sub
from skyarm.sensors.measurement import Measurement
from skyarm.vehicle.linkage import Joint, Link

STRAIGHT = 1e-6
"""1 + tr(R_d^T R) within 0.06 degrees of 180, where the axis is lost."""


STOW_SPEEDS = {"revolute": 1.0, "prismatic": 0.1}
"""rad/s and m/s: the arm's way to its stowed pose hardly moves the base."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Recovery:
    """Constants of the recovery law.

    Attributes:
        gains: of the base. joint_gains: of the joints, on torque.
        stow: rad or m, pose of the arm. stow_speed: rad/s or m/s, on the way there.
    """

    gains: GeometricGains
    joint_gains: JointGains
    stow: Annotated[tuple[Scalar, ...], Unit("rad or m", "pose of the arm")]
    stow_speed: Annotated[tuple[Scalar, ...], Unit("rad/s or m/s", "on the way there")]


def stowed(joint: Joint) -> float:
    """Middle of a joint's range; where a side is open zero, or the value in the range next to it."""
    low, high = float(joint.lower), float(joint.upper)
    if low > -float("inf") and high < float("inf"):
        return 0.5 * (low + high)
    return min(max(0.0, low), high)


def pose_of(stow: Any, links: tuple[Link, ...]) -> tuple[float, ...]:
    """A pose within the joints' limits."""
    listed = stow if isinstance(stow, (str, bytes)) or not hasattr(stow, "__iter__") else list(stow)
    if not isinstance(listed, list) or len(listed) != len(links):
        raise ControllerError(f"safety.stow = {shown(listed)}: must be {len(links)} numbers, one per joint")
    found = []
    for i, (value, link) in enumerate(zip(listed, links, strict=True)):
        at, low, high = f"safety.stow[{i}]", float(link.joint.lower), float(link.joint.upper)
        try:
            held = number(value, at)
        except ValueError as error:
            raise ControllerError(str(error)) from None
        if not low <= held <= high:
            raise ControllerError(f"{at} = {value!r}: must be within the joint's limits, {low:g} to {high:g}")
        found.append(held)
    return tuple(found)


def recover(recovery: Recovery, model: Model, mixer: Mixer, measurement: Measurement, reference: Reference) -> Command:
    """Geometric control of the base and PD of the joints, with the weight of the arm at the present attitude.

    The law has no memory and needs no model of motion: torque = I alpha_d + the arm's static moment about the base.

    Source: Lee, Leok, McClamroch 2010 as RotorS flies it, with the attitude error of Lee 2012; joint gravity by
    recursive Newton-Euler at rest.
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
    R_d = desired_attitude(a_d, reference.yaw, R)
    e_w = rate_error(measurement.rate, R, R_d, 0.0, "corrected")
    alpha = angular_acceleration(recovery.gains, vehicle.base.inertia, steep_error(R, R_d), e_w)
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


def steep_error(R_WB: Mat3, R_d: Mat3) -> Vec3:
    """Attitude error 2 sin(angle / 2) along the axis, which grows up to 180 degrees, where sin(angle) has vanished.

    Source: Lee 2012, "Exponential stability of an attitude tracking control system on SO(3) for large-angle rotational
    maneuvers": e_R / sqrt(1 + tr(R_d^T R)), doubled so that it is the angle where that is small.
    """
    relative = R_d.T @ R_WB
    trace = relative.r0.x + relative.r1.y + relative.r2.z
    error: Vec3 = attitude_error(R_WB, R_d) * divide(2.0, sqrt(maximum(1.0 + trace, STRAIGHT)))
    return error


def base_stiffness(recovery: Recovery, mass: Any) -> tuple[Any, Any]:
    """(1/s^2, 1/s) of the law along the vertical, for the governor."""
    return divide(recovery.gains.position.z, mass), divide(recovery.gains.velocity.z, mass)
