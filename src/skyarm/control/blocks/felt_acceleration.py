"""Specific force in the disturbance observer: velocity and force of the base with the help of an accelerometer.

With y the measured specific force (base axes), f that of the model under its actuators and all that it believes, and b
the accelerometer's bias, the base accelerates by r = y - b - f beside the model. The velocity goes on with what was
felt, whatever the model lacks, and the measured velocity corrects it and the bias, both poles at beta = exp(-w dt):

    v_pred = v_hat + (a + R r) dt,    e = v_measured - v_pred,
    v_hat = v_pred + (1 - beta^2) e,    b -= (1 - beta)^2 R^T e / dt,

and the acceleration of the unknown force follows r within 1 / (bandwidth of the force). A constant error of the
accelerometer, or of the attitude, which turns the weight, goes to b and is no force: below w force and velocity are
those of the measured velocity, above it the accelerometer's. Where noise of the two is white, they are equally good at
w = (noise of the specific force) / (noise of the velocity).
Sources: Brown, Hwang 2012, chapter 8 (complementary filters); Gao 2003 (both poles at one place); Smeur, Chu, de Croon
2016 (the external force from the specific force).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import E_Z, Force, Mat3, Vec3
from skyarm.control.blocks.filters import double_pole, low_pass_share
from skyarm.control.blocks.select import vector_data
from skyarm.control.controller import ControllerError
from skyarm.control.model import Model
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, divide
from skyarm.sensors.measurement import Measurement


@dataclass(frozen=True, kw_only=True, slots=True)
class AccelerometerGains:
    """Bandwidths, rad/s.

    Attributes:
        force: at which the unknown force follows the accelerometer.
        velocity: below which the measured velocity is believed more than the accelerometer.
    """

    force: Annotated[Scalar, Unit("rad/s", "at which the unknown force follows the accelerometer")]
    velocity: Annotated[Scalar, Unit("rad/s", "below which velocities are believed more than the accelerometer")]


@dataclass(frozen=True, kw_only=True, slots=True)
class Felt:
    """What an accelerometer tells of one period.

    Attributes:
        velocity: of the base origin, world axes, m/s. bias: of the accelerometer, base axes, m/s^2.
        change: acceleration by which the unknown force changes, world axes, m/s^2.
    """

    velocity: Vec3
    bias: Vec3
    change: Vec3


def feel(
    model: Model,
    gains: AccelerometerGains,
    velocity: Vec3,
    bias: Vec3,
    measurement: Measurement,
    R: Mat3,
    linear: Vec3,
    rotors: Force,
    dt: Any,
) -> Felt:
    """Velocity, bias and change of the force at the measurement's time.

    Args:
        model: belief.
        gains: bandwidths.
        velocity: one period earlier, world axes.
        bias: one period earlier, base axes.
        measurement: the new one.
        R: R_WB amid the period.
        linear: acceleration of the base origin by the model, mean of the period, world axes.
        rotors: what their wrench at the end of the period, where it was felt, is beyond that of the mean.
        dt: s.

    Raises:
        ControllerError: the measurement has no specific force.
    """
    felt = measurement.specific_force
    if all(type(c) is int for c in felt):
        raise ControllerError(
            "controller.accelerometer: must be left out, the measurement has no specific_force (m/s^2, base axes)"
        )
    modelled = R.apply_T(linear + E_Z * model.gravity) + rotors.force * divide(1.0, model.vehicle.mass)
    beside = R.apply(felt - bias - modelled)
    ahead = velocity + (linear + beside) * dt
    e = measurement.velocity - ahead
    fast, slow = double_pole(gains.velocity, dt)
    return Felt(
        velocity=ahead + e * fast,
        bias=vector_data(bias - R.apply_T(e) * divide(slow, dt)),
        change=beside * low_pass_share(gains.force, dt),
    )
