"""Joint rates from encoders: a critically damped filter of position and rate for each joint.

Between readings a joint goes on at its rate; a reading pulls position and rate towards itself by
g = 1 - b^2 and h / dt = (1 - b)^2 / dt with b = exp(-bandwidth dt): both poles at b. A constant rate is followed
without error, an acceleration a with an error of the rate of about 2 a / bandwidth.

The joints have a clock of their own: the instant of the inertial unit's last reading, and a period later at each period
in which none comes. A reading of the encoders is compared with the joints as they were at its own instant, whatever
the inertial unit does.

Source: Brookner 1998, "Tracking and Kalman filtering made easy", section 1.2.6 (critically damped g-h filter).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.records.units import Unit
from skyarm.scalars import Scalar, exp, logical_and, maximum, where
from skyarm.sensors.sensor_readings import EncoderReading


@dataclass(frozen=True, kw_only=True, slots=True)
class FilteredJoints:
    """Joints as the filter believes them, with their instant.

    Attributes:
        joints, rates: at the instant ``now``.
        read: of the last reading of the encoders that was used.
        heard: of the inertial unit's last reading. now: the joints' own clock.
    """

    joints: Annotated[tuple[Scalar, ...], Unit("rad or m", "filtered")]
    rates: Annotated[tuple[Scalar, ...], Unit("rad/s or m/s", "filtered")]
    read: Annotated[Scalar, Unit("s", "instant of the last reading")]
    heard: Annotated[Scalar, Unit("s", "instant of the inertial unit's last reading")] = 0.0
    now: Annotated[Scalar, Unit("s", "instant of joints and rates")] = 0.0


def filter_joints(
    memory: FilteredJoints, reading: EncoderReading, started: Any, bandwidth: Any, inertial: Any, dt: Any
) -> FilteredJoints:
    """The joints one period later.

    Args:
        memory: one period earlier.
        reading: the last that has arrived; used once.
        started: condition; where it does not hold the reading is taken as it is, at rest.
        bandwidth: rad/s.
        inertial: s, instant of the inertial unit's last reading that has arrived.
        dt: period, s.
    """
    silent = logical_and(started, inertial - memory.heard < 1e-5)
    now = where(silent, memory.now + dt, inertial)
    since = reading.time - memory.read
    fresh = since > 1e-5
    # a reading that is not fresh divides by a period, and is not used
    span = where(fresh, maximum(since, 1e-5), dt)
    b = exp(-(bandwidth * span))
    g, h = where(fresh, 1.0 - b * b, 0.0), where(fresh, (1.0 - b) * (1.0 - b), 0.0) / span
    moved, age = now - memory.now, now - reading.time
    joints, rates = [], []
    for q, rate, read in zip(memory.joints, memory.rates, reading.joints, strict=True):
        ahead = q + rate * moved
        off = read - (ahead - rate * age)
        joints.append(where(started, ahead + g * off, read))
        rates.append(where(started, rate + h * off, 0.0))
    return FilteredJoints(
        joints=tuple(joints), rates=tuple(rates), read=reading.time + 0.0, heard=inertial + 0.0, now=now
    )
