"""When a law is given up, and when it gets the vehicle back."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from skyarm.compile import leaves
from skyarm.control.safety.limits import Limits
from skyarm.dynamics.measurement import Measurement
from skyarm.scalars import Scalar, absolute, cos, logical_and, logical_or, where

CALM_TILT, CALM_RATE, CALM_SPEED = math.radians(15.0), 1.0, 0.5
"""rad, rad/s (of base and joints, m/s of a prismatic one) and m/s of calm flight."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Doubt:
    """What is thought of a law.

    Attributes:
        given_up: 1 while the recovery flies.
        outside: s, for how long the vehicle has been tilted or turning beyond trust.
        calm: s, for how long the recovery has flown calmly.
    """

    given_up: Scalar
    outside: Scalar
    calm: Scalar


def finite(record: Any) -> Any:
    """True where every number of a record is finite."""
    fine: Any = True
    for value in leaves(record):
        fine = logical_and(fine, absolute(value) < float("inf"))
    return fine


def not_finite(record: Any) -> Any:
    """True where any number of a record is infinite or NaN."""
    return where(finite(record), False, True)


def doubted(limits: Limits, doubt: Doubt, measurement: Measurement, joints: Any, failed: Any, dt: Any) -> Doubt:
    """The doubt after one measurement.

    A law is given up when it failed (a command or a memory that is not finite, an attitude where it is not defined), at
    once when the vehicle is beyond ``lost_*``, and after ``patience`` s beyond ``trusted_*``: a large attitude error
    for too long, whatever attitude the law wanted, since the governor asks for no such tilt; a joint far from its
    reference ``joints`` (rad or m, governed) for too long, whose drive may be dead.
    """
    w, v = measurement.rate, measurement.velocity
    turning, speed = w.dot(w), v.dot(v)
    upright = measurement.quaternion.rotation().r2.z
    beyond = logical_or(upright < cos(limits.trusted_tilt), turning > limits.trusted_rate * limits.trusted_rate)
    for q, wanted, most in zip(measurement.joints, joints, limits.trusted_joint_error, strict=True):
        beyond = logical_or(beyond, absolute(q - wanted) > most)
    outside = where(beyond, doubt.outside + dt, 0.0)
    lost = logical_or(turning > limits.lost_rate * limits.lost_rate, speed > limits.lost_speed * limits.lost_speed)
    for rate, most in zip(measurement.joint_rates, limits.lost_joint_speed, strict=True):
        lost = logical_or(lost, absolute(rate) > most)
    doubtful = logical_or(failed, logical_or(lost, outside > limits.patience))

    calm_now = logical_and(upright > math.cos(CALM_TILT), turning < CALM_RATE * CALM_RATE)
    calm_now = logical_and(calm_now, speed < CALM_SPEED * CALM_SPEED)
    for rate in measurement.joint_rates:
        calm_now = logical_and(calm_now, absolute(rate) < CALM_RATE)
    calm = where(logical_and(doubt.given_up > 0.5, calm_now), doubt.calm + dt, 0.0)
    back = logical_and(calm > limits.calm, where(doubtful, False, True))
    flying = logical_or(doubt.given_up < 0.5, back)
    return Doubt(
        given_up=where(logical_and(flying, where(doubtful, False, True)), 0.0, 1.0),
        outside=outside,
        calm=where(back, 0.0, calm),
    )
