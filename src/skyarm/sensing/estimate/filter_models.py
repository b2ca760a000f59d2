"""Joint-rate filter of the encoders, and specific force by the vehicle model, for the
error-state filter.

Joint rates come from a critically damped filter of position and rate. Between readings
a joint goes on at its rate; a reading pulls position and rate towards itself by g = 1 -
b^2 and h / dt = (1 - b)^2 / dt with b = exp(-bandwidth dt): both poles at b. A constant
rate is followed without error, an acceleration a with an error of the rate of about 2
a / bandwidth. The joints have a clock of their own: the instant of the inertial unit's
last reading, and a period later at each period in which none comes. A reading of the
encoders is compared with the joints at its own instant.

The modelled specific force is what an accelerometer at the base origin would read if
the model were true.

Source: Brookner 1998, "Tracking and Kalman filtering made easy", section 1.2.6
(critically damped g-h filter).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from skyarm import dynamics
from skyarm.algebra import ZERO3, Force, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import (
    absolute,
    add,
    data,
    exp,
    logical_and,
    maximum,
    sqrt,
    where,
)
from skyarm.dynamics.actuators import joint_force, stop_force
from skyarm.dynamics.actuators.rotor import rotor_force
from skyarm.dynamics.body_drag import body_drag
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit
from skyarm.sensing.sensor import specific_force_at
from skyarm.sensing.sensor_kinds import EncoderReading
from skyarm.vehicle import Rotor, Vehicle


@immutable
class FilteredJoints:
    """Filtered joint positions and rates with the instants to which they belong.

    Attributes:
        joints, rates: positions and rates at the instant ``now``.
        read: instant of the last encoder reading that was used, s.
        heard: instant of the inertial unit's last reading, s. now: instant of
            ``joints`` and ``rates``, s.
    """

    joints: Annotated[Scalars, Unit("rad or m", "filtered joint positions")]
    rates: Annotated[Scalars, Unit("rad/s or m/s", "filtered joint rates")]
    read: Annotated[Scalar, Unit("s", "time of the last encoder reading")]
    heard: Annotated[Scalar, Unit("s", "time of the inertial unit's last reading")] = (
        0.0
    )
    now: Annotated[Scalar, Unit("s", "time of the filtered positions and rates")] = 0.0


def filter_joints(
    memory: FilteredJoints,
    reading: EncoderReading,
    started: Scalar,
    bandwidth: Scalar,
    inertial: Scalar,
    dt: Scalar,
) -> FilteredJoints:
    """Advance the filter of joint positions and rates by one period, with the latest
    encoder reading.

    Args:
        memory: one period earlier.
        reading: the last that has arrived; used once.
        started: condition; where it does not hold the reading is taken as it is, at
            rest.
        bandwidth: rad/s.
        inertial: s, instant of the inertial unit's last reading that has arrived.
        dt: period, s.
    """
    # 1e-5 s: longer than rounding of clocks, shorter than any period
    silent = logical_and(started, inertial - memory.heard < 1e-5)
    now = where(silent, memory.now + dt, inertial)
    since = reading.time - memory.read
    fresh = since > 1e-5
    # a reading that is not fresh divides by a period, and is not used
    span = where(fresh, maximum(since, 1e-5), dt)
    b = exp(-(bandwidth * span))
    g = where(fresh, 1.0 - b * b, 0.0)
    h = where(fresh, (1.0 - b) * (1.0 - b), 0.0) / span
    moved, age = now - memory.now, now - reading.time
    joints, rates = [], []
    for q, rate, read in zip(memory.joints, memory.rates, reading.joints, strict=True):
        ahead = q + rate * moved
        off = read - (ahead - rate * age)
        joints.append(where(started, ahead + g * off, read))
        rates.append(where(started, rate + h * off, 0.0))
    return FilteredJoints(
        joints=tuple(joints),
        rates=tuple(rates),
        read=reading.time + 0.0,
        heard=inertial + 0.0,
        now=now,
    )


def modelled_force(
    vehicle: Vehicle,
    velocity_B: Vec3,
    rate: Vec3,
    joints: Sequence[Scalar],
    joint_rates: Sequence[Scalar],
    speeds: tuple[Sequence[Scalar], Sequence[Scalar]],
    efforts: Sequence[Scalar],
    place: Vec3 = ZERO3,
) -> Vec3:
    """Specific force at a point of the base by the vehicle model in still air, mean
    over a period, base axes, m/s^2.

    With rotors, drag of the airframe, joints with their friction and stops; without the
    torque of rotors that spin up.

    Args:
        vehicle: nominal one, of the controller's model.
        velocity_B: m/s, base axes.
        rate: rad/s, base axes.
        joints: rad or m, at the end of the period.
        joint_rates: rad/s or m/s, at the end of the period.
        speeds: speeds of the rotors at the beginning and at the end, rad/s; thrust goes
            with the mean of their squares, that of a reversible rotor with the sign of
            each.
        efforts: efforts of the joints over the period, N m or N: setpoints of drives
            that give torques.
        place: the point, m, base axes.
    """
    mean = [
        _mean_speed(rotor, a, b)
        for rotor, a, b in zip(vehicle.rotors, *speeds, strict=True)
    ]
    # rotor by rotor: sums over alike rotors would round otherwise where their numbers
    # are parameters
    applied = Force(ZERO3, body_drag(vehicle.drag, velocity_B))
    for rotor, speed in zip(vehicle.rotors, mean, strict=True):
        applied = applied + rotor_force(
            rotor, speed, velocity_B + rate.cross(rotor.position)
        )
    torques = [
        add(joint_force(joint, effort, qd), stop_force(joint, q, qd))
        for joint, effort, q, qd in zip(
            vehicle.joints, efforts, joints, joint_rates, strict=True
        )
    ]
    base, _ = dynamics.forward_dynamics(
        vehicle, joints, rate, joint_rates, applied, torques
    )
    return Vec3(*map(data, specific_force_at(place, base, rate)))


def _mean_speed(rotor: Rotor, begin: Scalar, end: Scalar) -> Scalar:
    """Speed (rad/s) of the mean thrust between two speeds of a rotor; a reversible one
    pushes backwards below 0.
    """
    if not rotor.reversible:
        return sqrt(0.5 * (begin * begin + end * end))
    square = 0.5 * (begin * absolute(begin) + end * absolute(end))
    return where(square < 0.0, -1.0, 1.0) * sqrt(absolute(square))
