"""Dead reckoning with an inertial unit: position, velocity, attitude and the biases that are believed.

Between two readings angular rate and specific force are taken as the mean of both, which also holds the noise of each
reading once in the sum.

Source: Sola 2017, equation 260; Titterton, Weston 2004, chapter 11.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Quaternion, Vec3
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, add, mul
from skyarm.sensors.sensor_readings import ImuReading


@dataclass(frozen=True, kw_only=True, slots=True)
class Navigated:
    """What the filter believes at an instant."""

    position: Annotated[Vec3, Unit("m", "base origin, world axes")]
    velocity: Annotated[Vec3, Unit("m/s", "base origin, world axes")]
    quaternion: Annotated[Quaternion, Unit("", "w x y z, base to world")]
    gyro_bias: Annotated[Vec3, Unit("rad/s", "base axes")]
    accelerometer_bias: Annotated[Vec3, Unit("m/s^2", "base axes")]


def navigate(now: Navigated, before: ImuReading, after: ImuReading, gravity: Any, dt: Any) -> tuple[Navigated, Vec3]:
    """The belief at the later of two readings, and the mean specific force without bias, world axes.

    Args:
        now: belief at the earlier. before, after: readings. gravity: m/s^2. dt: s between them.
    """
    rate = (before.rate + after.rate) * 0.5 - now.gyro_bias
    turned = (now.quaternion * Quaternion.of_small_rotation(rate, dt)).renormalized()
    old, new = now.quaternion.rotation(), turned.rotation()
    bias = now.accelerometer_bias
    force = (old.apply(before.specific_force - bias) + new.apply(after.specific_force - bias)) * 0.5
    acceleration = Vec3(force.x, force.y, force.z - gravity)
    following = Navigated(
        position=now.position + (now.velocity + acceleration * (0.5 * dt)) * dt,
        velocity=now.velocity + acceleration * dt,
        quaternion=turned,
        gyro_bias=now.gyro_bias,
        accelerometer_bias=bias,
    )
    return following, force


def corrected(now: Navigated, error: Any) -> Navigated:
    """The belief with the mean error of :mod:`skyarm.estimate.error_covariance` taken in."""
    p, v, turn, gyro, accelerometer = (Vec3(*error[i : i + 3]) for i in range(0, 15, 3))
    return Navigated(
        position=now.position + p,
        velocity=now.velocity + v,
        quaternion=(Quaternion.of_rotation_vector(turn) * now.quaternion).renormalized(),
        gyro_bias=now.gyro_bias + gyro,
        accelerometer_bias=now.accelerometer_bias + accelerometer,
    )


def level_attitude(specific_force: Vec3, heading: Any) -> Quaternion:
    """Attitude of a base at rest: the specific force points up, the heading is given (rad)."""
    from skyarm.scalars import atan2, cos, neg, sin, sqrt

    f = specific_force
    roll, pitch = atan2(f.y, f.z), atan2(neg(f.x), sqrt(add(mul(f.y, f.y), mul(f.z, f.z))))
    turns = [Quaternion(cos(0.5 * a), 0.0, 0.0, 0.0) for a in (heading, pitch, roll)]
    q = [Quaternion(turns[0].w, 0.0, 0.0, sin(0.5 * heading)), Quaternion(turns[1].w, 0.0, sin(0.5 * pitch), 0.0)]
    return q[0] * q[1] * Quaternion(turns[2].w, sin(0.5 * roll), 0.0, 0.0)
