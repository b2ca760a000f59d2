"""Dead reckoning with an inertial unit: position, velocity, attitude and the biases that are believed.

Between two readings angular rate and specific force are taken as the mean of both, which also holds the noise of each
reading once in the sum.

Source: Sola 2017, equation 260; Titterton, Weston 2004, chapter 11.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

from skyarm.algebra import ZERO3, Quaternion, Vec3
from skyarm.records.units import Unit
from skyarm.scalars import atan2, cos, neg, sin, sqrt
from skyarm.sensors.sensor_readings import ImuReading


@dataclass(frozen=True, kw_only=True, slots=True)
class Navigated:
    """What the filter believes at an instant."""

    position: Annotated[Vec3, Unit("m", "base origin, world axes")]
    velocity: Annotated[Vec3, Unit("m/s", "base origin, world axes")]
    quaternion: Annotated[Quaternion, Unit("", "w x y z, base to world")]
    gyro_bias: Annotated[Vec3, Unit("rad/s", "base axes")]
    accelerometer_bias: Annotated[Vec3, Unit("m/s^2", "base axes")]
    push: Annotated[Vec3, Unit("m/s^2", "what the modelled force lacks, by mass, world axes")] = ZERO3


def navigate(
    now: Navigated, before: ImuReading, after: ImuReading, gravity: Any, dt: Any, modelled: Vec3 | None = None
) -> tuple[Navigated, Vec3]:
    """The belief at the later of two readings, and the mean specific force without bias and push, world axes.

    Args:
        now: belief at the earlier.
        before: reading at the earlier.
        after: reading at the later.
        gravity: m/s^2.
        dt: s between them.
        modelled: mean specific force between them by a model, base axes, in place of the accelerometer's.
    """
    rate = (before.rate + after.rate) * 0.5 - now.gyro_bias
    turned = (now.quaternion * Quaternion.of_small_rotation(rate, dt)).renormalized()
    old, new = now.quaternion.rotation(), turned.rotation()
    bias = now.accelerometer_bias
    pair = (before.specific_force - bias, after.specific_force - bias) if modelled is None else (modelled, modelled)
    force = (old.apply(pair[0]) + new.apply(pair[1])) * 0.5
    up = force + now.push
    acceleration = Vec3(up.x, up.y, up.z - gravity)
    following = replace(
        now,
        position=now.position + (now.velocity + acceleration * (0.5 * dt)) * dt,
        velocity=now.velocity + acceleration * dt,
        quaternion=turned,
    )
    return following, force


def corrected(now: Navigated, error: Sequence[Any]) -> Navigated:
    """The belief with the mean error of :mod:`skyarm.estimate.error_covariance` taken in."""
    p, v, turn, gyro, accelerometer, *push = (Vec3(*error[i : i + 3]) for i in range(0, len(error), 3))
    return Navigated(
        position=now.position + p,
        velocity=now.velocity + v,
        quaternion=(Quaternion.of_rotation_vector(turn) * now.quaternion).renormalized(),
        gyro_bias=now.gyro_bias + gyro,
        accelerometer_bias=now.accelerometer_bias + accelerometer,
        push=now.push + push[0] if push else now.push,
    )


def level_attitude(specific_force: Vec3, heading: Any) -> Quaternion:
    """Attitude of a base at rest: the specific force points up, the heading is given (rad)."""
    f = specific_force
    roll, pitch = 0.5 * atan2(f.y, f.z), 0.5 * atan2(neg(f.x), sqrt(f.y * f.y + f.z * f.z))
    yaw = 0.5 * heading
    level = Quaternion(cos(yaw), 0.0, 0.0, sin(yaw)) * Quaternion(cos(pitch), 0.0, sin(pitch), 0.0)
    return level * Quaternion(cos(roll), sin(roll), 0.0, 0.0)
