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

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import E_Z, Mat3, Vec3
from skyarm.control.blocks.filters import double_pole, low_pass_share
from skyarm.control.blocks.select import choose, vector_data
from skyarm.control.controller import ControllerError
from skyarm.control.model import Model
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, divide, mul, where
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
    """What a period tells of the base's translation.

    Attributes:
        velocity: of the base origin, world axes, m/s. bias: of the accelerometer, base axes, m/s^2; empty without one.
        change: acceleration by which the unknown force changes, world axes, m/s^2.
        learns: 1 where that change is taken, 0 where the force is held.
    """

    velocity: Vec3
    bias: Any
    change: Vec3
    learns: Any


def feel(
    model: Model,
    gains: AccelerometerGains,
    velocity: Vec3,
    seen: Felt,
    measurement: Measurement,
    R: Mat3,
    linear: Vec3,
    rotors: Vec3,
    joints: Sequence[Any],
    dt: Any,
) -> Felt:
    """What the period tells with the accelerometer.

    A joint at its limit shakes the base by what the model lacks, because the disturbance of that joint is held: the
    measured velocity alone says the force then. Rotors at their limit hold nothing up: what they give is in the model.

    Args:
        model: belief.
        gains: bandwidths.
        velocity: one period earlier, world axes.
        seen: what the measured velocity alone tells, with the bias of one period earlier.
        measurement: the new one.
        R: R_WB amid the period.
        linear: acceleration of the base origin by the model, mean of the period, world axes.
        rotors: what their thrust at the end of the period, where it was felt, is beyond ``linear``'s; N, base axes.
            What their torque is beyond it is left out: by way of the offset of the common centre of mass it accelerates
            the base origin too, for a part of a period.
        joints: 1 for each that is not at its limit, else 0.
        dt: s.

    Raises:
        ControllerError: the measurement has no specific force.
    """
    felt = measurement.specific_force
    if all(type(c) is int and c == 0 for c in felt):
        raise ControllerError(
            "controller.accelerometer: must be left out, the measurement has no specific_force (m/s^2, base axes)"
        )
    modelled = R.apply_T(linear + E_Z * model.gravity) + rotors * divide(1.0, model.vehicle.mass)
    beside = R.apply(felt - seen.bias - modelled)
    ahead = velocity + (linear + beside) * dt
    e = measurement.velocity - ahead
    fast, slow = double_pole(gains.velocity, dt)
    moving: Any = 1.0
    for each in joints:
        moving = mul(moving, each)
    return Felt(
        velocity=ahead + e * fast,
        bias=vector_data(seen.bias - R.apply_T(e) * divide(slow, dt)),
        change=choose(moving > 0.5, beside * low_pass_share(gains.force, dt), seen.change),
        learns=where(moving > 0.5, 1.0, seen.learns),
    )
