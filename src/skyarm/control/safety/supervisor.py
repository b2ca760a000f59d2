"""Supervisor of a law: when the recovery takes over, and when the law flies again."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.compile import leaves
from skyarm.control.safety.limits import Limits
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, absolute, cos, logical_and, logical_or, where
from skyarm.sensors.measurement import Measurement

CALM_TILT, CALM_RATE, CALM_SPEED = math.radians(15.0), 1.0, 0.5
"""rad, rad/s (of base and joints, m/s of a prismatic one) and m/s of calm flight."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Confidence:
    """Confidence in a law.

    Attributes:
        given_up: 1 while the recovery flies.
        outside: s, for how long the vehicle has been tilted or turning beyond ``trusted_*``.
        calm: s, for how long the recovery has flown calmly.
    """

    given_up: Annotated[Scalar, Unit("", "1 while the recovery flies")]
    outside: Annotated[Scalar, Unit("s", "beyond the trusted limits so far")]
    calm: Annotated[Scalar, Unit("s", "of calm flight in the recovery so far")]


def finite(record: Any) -> Any:
    """True where every number of a record is finite."""
    fine: Any = True
    for value in leaves(record):
        fine = logical_and(fine, absolute(value) < float("inf"))
    return fine


def not_finite(record: Any) -> Any:
    """True where any number of a record is infinite or NaN."""
    return where(finite(record), False, True)


def update_confidence(
    limits: Limits, confidence: Confidence, measurement: Measurement, joints: Any, failed: Any, dt: Any
) -> Confidence:
    """Return the confidence after one measurement.

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
    outside = where(beyond, confidence.outside + dt, 0.0)
    lost = logical_or(turning > limits.lost_rate * limits.lost_rate, speed > limits.lost_speed * limits.lost_speed)
    for rate, most in zip(measurement.joint_rates, limits.lost_joint_speed, strict=True):
        lost = logical_or(lost, absolute(rate) > most)
    failing = logical_or(failed, logical_or(lost, outside > limits.patience))

    calm_now = logical_and(upright > math.cos(CALM_TILT), turning < CALM_RATE * CALM_RATE)
    calm_now = logical_and(calm_now, speed < CALM_SPEED * CALM_SPEED)
    for rate in measurement.joint_rates:
        calm_now = logical_and(calm_now, absolute(rate) < CALM_RATE)
    calm = where(logical_and(confidence.given_up > 0.5, calm_now), confidence.calm + dt, 0.0)
    back = logical_and(calm > limits.calm, where(failing, False, True))
    flying = logical_or(confidence.given_up < 0.5, back)
    return Confidence(
        given_up=where(logical_and(flying, where(failing, False, True)), 0.0, 1.0),
        outside=outside,
        calm=where(back, 0.0, calm),
    )
