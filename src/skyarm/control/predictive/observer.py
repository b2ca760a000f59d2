"""Estimates of velocity and disturbance for a predictive controller: a second-order extended state observer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm.actuation import Command, speed_after
from skyarm.algebra import Vec3
from skyarm.control.model import Model
from skyarm.control.predictive.motion import Disturbance, Inputs, advance
from skyarm.dynamics import State, mass_matrix
from skyarm.dynamics.measurement import Measurement
from skyarm.scalars import Scalar, divide, exp, mul


@dataclass(frozen=True, kw_only=True, slots=True)
class Estimate:
    """What is believed at the instant of the last measurement: state, and what the model leaves out."""

    state: State
    disturbance: Disturbance


@dataclass(frozen=True, kw_only=True, slots=True)
class Bandwidths:
    """How fast the observer follows, rad/s: linear, angular and joint motion."""

    linear: Scalar
    angular: Scalar
    joints: Scalar


def predict(model: Model, estimate: Estimate, command: Command, dt: Any) -> State:
    """State ``dt`` seconds later under a held command, whose rotors lag."""
    state = estimate.state
    after = [
        speed_after(rotor, speed, wanted, dt)
        for rotor, speed, wanted in zip(model.vehicle.rotors, state.rotor_speeds, command.rotor_speeds, strict=True)
    ]
    rates = tuple(divide(end - start, dt) for end, start in zip(after, state.rotor_speeds, strict=True))
    return advance(model, state, Inputs(rotor_accelerations=rates, efforts=command.efforts), estimate.disturbance, dt)


def observe(
    model: Model, bandwidths: Bandwidths, before: Estimate, command: Command, measurement: Measurement, dt: Any
) -> Estimate:
    """Estimate at a measurement from the one a period earlier and the command that acted in between.

    Velocities v_hat are predicted; with e = v - v_hat, b = exp(-w dt): v_hat += (1 - b^2) e and d_hat += M (1 - b)^2
    e / dt, which places both poles of each axis at b. Pose and joints are the measured ones.

    Source: Gao 2003 (bandwidth parameterisation); discrete poles as placed here are our own.
    """
    foreseen, n = predict(model, before, command, dt), model.vehicle.n
    R = measurement.quaternion.rotation()
    measured = (*measurement.velocity, *measurement.rate, *measurement.joint_rates)
    expected = (*foreseen.velocity, *foreseen.rate, *foreseen.joint_rates)
    speeds = (*(bandwidths.linear,) * 3, *(bandwidths.angular,) * 3, *(bandwidths.joints,) * n)
    left = [exp(mul(-w, dt)) for w in speeds]
    e = [a - b for a, b in zip(measured, expected, strict=True)]
    v = [x + (1.0 - b * b) * error for x, b, error in zip(expected, left, e, strict=True)]
    push = [divide((1.0 - b) * (1.0 - b) * error, dt) for b, error in zip(left, e, strict=True)]
    M = mass_matrix(model.vehicle, R, measurement.joints)
    d = before.disturbance
    known = (*d.force_W, *d.torque_B, *d.efforts)
    force = [x + sum(mul(m, a) for m, a in zip(row, push, strict=True)) for x, row in zip(known, M, strict=True)]
    state = State(
        position=measurement.position,
        quaternion=measurement.quaternion,
        velocity=Vec3(*v[:3]),
        rate=Vec3(*v[3:6]),
        joints=measurement.joints,
        joint_rates=tuple(v[6:]),
        rotor_speeds=foreseen.rotor_speeds,
    )
    return Estimate(
        state=state,
        disturbance=Disturbance(force_W=Vec3(*force[:3]), torque_B=Vec3(*force[3:6]), efforts=tuple(force[6:])),
    )
