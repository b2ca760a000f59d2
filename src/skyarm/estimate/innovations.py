"""What a reading says of the error: for each scalar its derivative, its innovation and the variance of its noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm.algebra import Mat3, Quaternion, Vec3
from skyarm.estimate.error_covariance import ACCELEROMETER_BIAS, ATTITUDE, POSITION, PUSH, Row
from skyarm.estimate.inertial_navigation import Navigated
from skyarm.scalars import atan2, cos, divide, sin, where
from skyarm.sensors.sensor_readings import HeadingReading, PoseReading


@dataclass(frozen=True, kw_only=True, slots=True)
class ScalarInnovation:
    """One scalar of a reading: derivative by the error, reading less belief, variance of the reading's noise."""

    H: Row
    value: Any
    variance: Any


def innovations(belief: Navigated, reading: Any, position: Any, attitude: Any, heading: Any) -> list[ScalarInnovation]:
    """Those of a pose, a position or a heading; the last arguments are deviations of the readings' noise."""
    if isinstance(reading, HeadingReading):
        return [_of_heading(belief.quaternion.rotation(), reading.heading, heading * heading)]
    off = enumerate(reading.position - belief.position)
    found = [ScalarInnovation(H={POSITION + i: 1}, value=c, variance=position * position) for i, c in off]
    if isinstance(reading, PoseReading):
        turns = enumerate(turn_between(belief.quaternion, reading.quaternion))
        found += [ScalarInnovation(H={ATTITUDE + i: 1}, value=c, variance=attitude * attitude) for i, c in turns]
    return found


def turn_between(believed: Quaternion, read: Quaternion) -> tuple[Any, Any, Any]:
    """Rotation vector (rad, world axes, to second order) that turns the believed attitude into the read one."""
    turn = read * Quaternion(believed.w, -believed.x, -believed.y, -believed.z)
    factor = where(turn.w < 0.0, -2.0, 2.0)
    return turn.x * factor, turn.y * factor, turn.z * factor


def _of_heading(R: Mat3, heading: Any, variance: Any) -> ScalarInnovation:
    """Of the yaw of the base's x axis, whose innovation lies between -pi and pi.

    A small rotation e (world axes) moves the axis by e x axis: its yaw by e_z - z (x e_x + y e_y) / (x^2 + y^2).
    """
    x, y, z = R.column(0)
    level = divide(z, x * x + y * y)
    off = heading - atan2(y, x)
    H = {ATTITUDE: -(level * x), ATTITUDE + 1: -(level * y), ATTITUDE + 2: 1}
    return ScalarInnovation(H=H, value=atan2(sin(off), cos(off)), variance=variance)


def of_specific_force(belief: Navigated, measured: Vec3, modelled: Vec3, variance: Any) -> list[ScalarInnovation]:
    """Of an accelerometer beside a modelled specific force: what it reads more is push and bias.

    The push d stands in world axes: an attitude's error e turns R^T d by R^T (d x e).
    """
    R = belief.quaternion.rotation()
    off = measured - modelled - R.apply_T(belief.push) - belief.accelerometer_bias
    found = []
    for i, value in enumerate(off):
        axis = R.column(i)
        # row i of R^T S(d) is axis^T S(d) = (axis x d)^T
        turned = enumerate(axis.cross(belief.push))
        H: dict[int, Any] = {ATTITUDE + j: c for j, c in turned}
        H |= {ACCELEROMETER_BIAS + i: 1, **{PUSH + j: c for j, c in enumerate(axis)}}
        found.append(ScalarInnovation(H=H, value=value, variance=variance))
    return found
