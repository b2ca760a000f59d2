"""Failure detection for a control law, and the recovery law that takes over.

The recovery hovers level where the law was given up, the arm on its way to its stowed
pose.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

from skyarm import dynamics
from skyarm.algebra import E_Z, ZERO3, Mat3, Motion, Scalar, Scalars, Vec3, sums
from skyarm.algebra.scalars import (
    absolute,
    cos,
    divide,
    logical_and,
    logical_or,
    maximum,
    sqrt,
    where,
)
from skyarm.control.blocks.common import joint_pd
from skyarm.control.blocks.geometric import (
    HALF_TURN,
    angular_acceleration,
    attitude_error,
    body_thrust,
    desired_attitude,
    downward_acceleration,
    rate_error,
)
from skyarm.control.controller import ControllerError
from skyarm.control.model import GeometricGains, JointGains, Model
from skyarm.control.safety.limits import Limits
from skyarm.dynamics.actuators import Command, Mixer, mix
from skyarm.records.files import errors_as, number, shown
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Tree, leaves
from skyarm.records.units import Unit
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement
from skyarm.vehicle import Link

CALM_TILT, CALM_RATE, CALM_SPEED = math.radians(15.0), 1.0, 0.5
"""Limits of calm flight: tilt (rad), body and joint rates (rad/s; m/s for prismatic
joints) and speed (m/s); chosen, far inside those at which a law is given up."""


@immutable
class Confidence:
    """State of the failure detection that decides between a law and the recovery.

    Attributes:
        given_up: 1 while the recovery flies.
        outside: s, for how long the vehicle has been tilted or turning beyond
            ``trusted_*``.
        calm: s, for how long the recovery has flown calmly.
    """

    given_up: Annotated[Scalar, Unit("", "1 while the recovery law flies")]
    outside: Annotated[Scalar, Unit("s", "time beyond the trusted limits so far")]
    calm: Annotated[Scalar, Unit("s", "time of calm flight in the recovery so far")]


def finite(record: Tree) -> Scalar:
    """True if every number of a nested dataclass is finite."""
    fine: Scalar = True
    for value in leaves(record):
        fine = logical_and(fine, absolute(value) < float("inf"))
    return fine


def not_finite(record: Tree) -> Scalar:
    """True if any number of a nested dataclass is infinite or NaN."""
    return where(finite(record), False, True)


def update_confidence(
    limits: Limits,
    confidence: Confidence,
    measurement: Measurement,
    joints: Sequence[Scalar],
    failed: Scalar,
    dt: Scalar,
) -> Confidence:
    """State of the failure detection after one measurement.

    A law is given up when it failed (a command or a memory that is not finite, an
    attitude where it is not defined), at once when the vehicle is beyond ``lost_*``,
    and after ``patience`` s beyond ``trusted_*``: a large attitude error for too long,
    whatever attitude the law commanded, since a bounded reference requests no such
    tilt; a joint far from its reference ``joints`` (rad or m, bounded) for too long,
    whose drive may be dead.
    """
    w, v = measurement.rate, measurement.velocity
    turning, speed = w.dot(w), v.dot(v)
    upright = measurement.rotation.r2.z
    beyond = logical_or(
        upright < cos(limits.trusted_tilt),
        turning > limits.trusted_rate * limits.trusted_rate,
    )
    for q, desired, most in zip(
        measurement.joints, joints, limits.trusted_joint_error, strict=True
    ):
        beyond = logical_or(beyond, absolute(q - desired) > most)
    outside = where(beyond, confidence.outside + dt, 0.0)
    lost = logical_or(
        turning > limits.lost_rate * limits.lost_rate,
        speed > limits.lost_speed * limits.lost_speed,
    )
    for rate, most in zip(
        measurement.joint_rates, limits.lost_joint_speed, strict=True
    ):
        lost = logical_or(lost, absolute(rate) > most)
    failing = logical_or(failed, logical_or(lost, outside > limits.patience))
    sound = where(failing, False, True)
    calm_now = logical_and(
        upright > math.cos(CALM_TILT), turning < CALM_RATE * CALM_RATE
    )
    calm_now = logical_and(calm_now, speed < CALM_SPEED * CALM_SPEED)
    for rate in measurement.joint_rates:
        calm_now = logical_and(calm_now, absolute(rate) < CALM_RATE)
    calm = where(
        logical_and(confidence.given_up > 0.5, calm_now), confidence.calm + dt, 0.0
    )
    back = logical_and(calm > limits.calm, sound)
    flying = logical_or(confidence.given_up < 0.5, back)
    return Confidence(
        given_up=where(logical_and(flying, sound), 0.0, 1.0),
        outside=outside,
        calm=where(back, 0.0, calm),
    )


STRAIGHT = HALF_TURN * HALF_TURN
"""Value of 1 + tr(R_d^T R), the squared angle to half a turn, below which the attitude
error is kept from vanishing."""


@immutable
class Recovery:
    """Constants of the recovery law.

    Attributes:
        gains: gains of the base. joint_gains: gains of the joints, on torque.
        stow: stowed pose of the arm, rad or m. stow_speed: speed on the way there,
            rad/s or m/s.
    """

    gains: GeometricGains
    joint_gains: JointGains
    stow: Annotated[
        Scalars, Unit("rad or m", "stowed joint positions of the arm in the recovery")
    ]
    stow_speed: Annotated[
        Scalars,
        Unit(
            "rad/s or m/s",
            "joint speed on the way to the stowed pose",
            effect="lower values disturb the base less",
        ),
    ]


def pose_of(stow: object, links: tuple[Link, ...]) -> tuple[float, ...]:
    """Stowed arm pose from a user's option: one number per joint, within the joint
    limits.
    """
    listed = (
        stow
        if isinstance(stow, (str, bytes)) or not hasattr(stow, "__iter__")
        else list(stow)
    )
    if not isinstance(listed, list) or len(listed) != len(links):
        raise ControllerError(
            f"safety.stow = {shown(listed)}: must be {len(links)} numbers, one per"
            " joint"
        )
    pose = []
    for i, (value, link) in enumerate(zip(listed, links, strict=True)):
        at, (low, high) = f"safety.stow[{i}]", link.joint.ends
        with errors_as(ControllerError):
            position = number(value, at)
        if not low <= position <= high:
            raise ControllerError(
                f"{at} = {value!r}: must be within the joint's limits, {low:g} to"
                f" {high:g}"
            )
        pose.append(position)
    return tuple(pose)


def recover(
    recovery: Recovery,
    model: Model,
    mixer: Mixer,
    measurement: Measurement,
    reference: Reference,
) -> Command:
    """Recovery command: geometric control of the base, joint PD with gravity
    compensation.

    The law has no memory and needs no model of motion: torque = I alpha_d + the arm's
    static moment about the base.

    Source: Lee, Leok, McClamroch 2010 as RotorS flies it, with the attitude error of
    Lee 2012; joint gravity by recursive Newton-Euler at rest.
    """
    R = measurement.rotation
    vehicle = model.vehicle
    # no accelerations are fed forward: the recovery holds a place, at rest
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
    alpha = angular_acceleration(
        recovery.gains, vehicle.base.inertia, steep_error(R, R_d), e_w
    )
    still = (0,) * vehicle.n
    resting = Motion(ZERO3, R.apply_T(E_Z * model.gravity))
    weight, efforts = dynamics.inverse_dynamics(
        vehicle, measurement.joints, ZERO3, still, resting, still
    )
    speeds, _ = mix(
        mixer,
        vehicle.base.inertia.apply(alpha) + weight.torque,
        body_thrust(vehicle.mass, a_d, R),
    )
    pull = joint_pd(recovery.joint_gains, measurement, reference)
    return Command(rotor_speeds=speeds, efforts=sums(pull, efforts))


def steep_error(R_WB: Mat3, R_d: Mat3) -> Vec3:
    """Attitude error 2 sin(angle / 2) along the rotation axis, within one degree of 180
    degrees up to 5/4 of that.

    Source: Lee 2012, "Exponential stability of an attitude tracking control system on
    SO(3) for large-angle rotational maneuvers": e_R / sqrt(1 + tr(R_d^T R)), doubled so
    that it is the angle where that is small.
    """
    relative = R_d.T @ R_WB
    trace = relative.r0.x + relative.r1.y + relative.r2.z
    return attitude_error(R_WB, R_d) * divide(2.0, sqrt(maximum(1.0 + trace, STRAIGHT)))
