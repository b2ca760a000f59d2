"""What the vehicle's sensors say: a record apart from the state."""

from __future__ import annotations

from dataclasses import dataclass

from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics.state import State
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


def blank_measurement(joints: int, rotors: int) -> Measurement:
    """A reading of a vehicle that rests at the origin, level, at time 0: an example whose numbers are all data."""
    zero, still = Vec3(0.0, 0.0, 0.0), (0.0,) * joints
    return Measurement(
        time=0.0,
        position=zero,
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=zero,
        rate=zero,
        specific_force=zero,
        joints=still,
        joint_rates=still,
        rotor_speeds=(0.0,) * rotors,
    )


def measurement_of(state: State, specific_force: Vec3) -> Measurement:
    """A reading of a state by sensors without errors, at time 0; specific force in m/s^2, base axes."""
    return Measurement(
        time=0.0,
        position=state.position,
        quaternion=state.quaternion,
        velocity=state.velocity,
        rate=state.rate,
        specific_force=specific_force,
        joints=state.joints,
        joint_rates=state.joint_rates,
        rotor_speeds=state.rotor_speeds,
    )
