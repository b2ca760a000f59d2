"""Estimates of velocity and disturbance for a predictive controller: a second-order extended state observer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.actuation import Command, limited_effort
from skyarm.algebra import Vec3
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.blocks.filters import double_pole
from skyarm.control.blocks.prediction import motor_speeds
from skyarm.control.laws.predictive.motion_plan import Inputs, advance
from skyarm.control.model import Model
from skyarm.dynamics import State, mass_matrix
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, divide, mul
from skyarm.sensors.measurement import Measurement


@dataclass(frozen=True, kw_only=True, slots=True)
class Estimate:
    """What is believed at the instant of the last measurement: state, and what the model leaves out."""

    state: State
    disturbance: Disturbance


@dataclass(frozen=True, kw_only=True, slots=True)
class Bandwidths:
    """How fast the observer follows, rad/s: linear, angular and joint motion."""

    linear: Annotated[Scalar, Unit("rad/s")]
    angular: Annotated[Scalar, Unit("rad/s")]
    joints: Annotated[Scalar, Unit("rad/s")]


def predict(model: Model, estimate: Estimate, command: Command, dt: Any) -> State:
    """State ``dt`` seconds later under a held command, whose rotors lag."""
    state = estimate.state
    after = motor_speeds(model, state.rotor_speeds, command, dt)
    rates = tuple(divide(end - start, dt) for end, start in zip(after, state.rotor_speeds, strict=True))
    given = zip(model.vehicle.links, command.efforts, strict=True)
    efforts = tuple(limited_effort(link.joint, effort) for link, effort in given)
    return advance(model, state, Inputs(rotor_accelerations=rates, efforts=efforts), estimate.disturbance, dt)


def observe(
    model: Model, bandwidths: Bandwidths, before: Estimate, command: Command, measurement: Measurement, dt: Any
) -> Estimate:
    """Estimate at a measurement from the one a period earlier and the command that acted in between.

    The correction is that of :mod:`skyarm.control.blocks.disturbance_observer`, of velocities foreseen over a whole
    period. Pose and joints are the measured ones.

    Source: Gao 2003 (bandwidth parameterisation); discrete poles as placed here are our own.
    """
    foreseen, n = predict(model, before, command, dt), model.vehicle.n
    R = measurement.quaternion.rotation()
    measured = (*measurement.velocity, *measurement.rate, *measurement.joint_rates)
    expected = (*foreseen.velocity, *foreseen.rate, *foreseen.joint_rates)
    speeds = (*(bandwidths.linear,) * 3, *(bandwidths.angular,) * 3, *(bandwidths.joints,) * n)
    shares = [double_pole(w, dt) for w in speeds]
    e = [a - b for a, b in zip(measured, expected, strict=True)]
    v = [x + L1 * error for x, (L1, _), error in zip(expected, shares, e, strict=True)]
    push = [divide(L2 * error, dt) for (_, L2), error in zip(shares, e, strict=True)]
    M = mass_matrix(model.vehicle, R, measurement.joints)
    d = before.disturbance
    known = (*d.force, *d.torque, *d.efforts)
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
        disturbance=Disturbance(force=Vec3(*force[:3]), torque=Vec3(*force[3:6]), efforts=tuple(force[6:])),
    )
