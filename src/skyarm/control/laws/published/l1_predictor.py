"""The state predictor and the adaptation of :mod:`skyarm.control.laws.published.l1`.

A prediction is made one period later than it is published, at the instant that it is for: only then is it known what
was sent in between.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from skyarm import dynamics
from skyarm.actuation import Command
from skyarm.algebra import Force, Quaternion, Vec3
from skyarm.control.blocks.common import rotor_thrust
from skyarm.control.model import Model
from skyarm.dynamics.state import coordinate_acceleration
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, divide, exp, minimum, where
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
    """What one prediction begins from, a period ago.

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
    """What the next prediction begins from."""
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
