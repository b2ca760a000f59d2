"""What the vehicle's sensors say: a record apart from the state."""

from __future__ import annotations

from dataclasses import dataclass

from skyarm.algebra import Quaternion, Vec3
from skyarm.scalars import Scalar


@dataclass(frozen=True, kw_only=True, slots=True)
class Measurement:
    """One reading of every sensor.

    Attributes:
        time: when it was taken, s (older than now if the measurement is delayed).
        position, quaternion, velocity: pose of the base and world velocity of its origin (motion capture,
            GNSS, odometry).
        rate: gyroscope, base axes, rad/s.
        specific_force: accelerometer at the base origin, base axes, m/s^2 (+g along z in hover).
        joints, joint_rates: encoders, rad or m, and per second.
        rotor_speeds: rad/s.
    """

    time: Scalar
    position: Vec3
    quaternion: Quaternion
    velocity: Vec3
    rate: Vec3
    specific_force: Vec3
    joints: tuple[Scalar, ...] = ()
    joint_rates: tuple[Scalar, ...] = ()
    rotor_speeds: tuple[Scalar, ...] = ()
