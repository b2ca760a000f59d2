"""Sensors: a measurement from the state, with optional white noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics import State
from skyarm.dynamics.measurement import Measurement
from skyarm.scalars import Scalar, add, mul
from skyarm.vehicle import check


@dataclass(frozen=True, kw_only=True, slots=True)
class SensorNoise:
    """Standard deviations of white noise, one sigma at the control rate; an int 0 folds the channel away.

    Attributes:
        position: m. velocity: m/s. attitude: rad, a rotation vector in base axes. rate: rad/s.
        specific_force: m/s^2. joints: rad or m. joint_rates: per second. rotor_speeds: rad/s.
    """

    position: Scalar = 0
    velocity: Scalar = 0
    attitude: Scalar = 0
    rate: Scalar = 0
    specific_force: Scalar = 0
    joints: Scalar = 0
    joint_rates: Scalar = 0
    rotor_speeds: Scalar = 0

    def __post_init__(self) -> None:
        for field in fields(self):
            check.number(f"sensors.{field.name}", getattr(self, field.name), low=0.0)


def noise_count(joints: int, rotors: int) -> int:
    """How many standard normal numbers one measurement takes."""
    return 15 + 2 * joints + rotors


def measure(par: SensorNoise, time: Any, state: State, specific_force: Vec3, noise: Sequence[Any]) -> Measurement:
    """A measurement of a state.

    Args:
        par: deviations.
        time: s, when it is taken.
        state: the truth.
        specific_force: of the base origin, base axes, m/s^2.
        noise: :func:`noise_count` standard normal numbers; structural zeros for perfect sensors.

    Raises:
        ValueError: another number of draws.
    """
    count = noise_count(len(state.joints), len(state.rotor_speeds))
    if len(noise) != count:
        raise ValueError(f"noise has {len(noise)} numbers: must be {count}, one a channel")
    draws = iter(noise)

    def vector(sigma: Any) -> Vec3:
        return Vec3(*(mul(sigma, next(draws)) for _ in range(3)))

    def many(values: Sequence[Any], sigma: Any) -> tuple[Any, ...]:
        return tuple(add(value, mul(sigma, next(draws))) for value in values)

    position, velocity = state.position + vector(par.position), state.velocity + vector(par.velocity)
    turn = vector(par.attitude)
    tilted = state.quaternion if _structural_zero(turn) else state.quaternion * Quaternion.of_rotation_vector(turn)
    return Measurement(
        time=time,
        position=position,
        velocity=velocity,
        quaternion=tilted,
        rate=state.rate + vector(par.rate),
        specific_force=specific_force + vector(par.specific_force),
        joints=many(state.joints, par.joints),
        joint_rates=many(state.joint_rates, par.joint_rates),
        rotor_speeds=many(state.rotor_speeds, par.rotor_speeds),
    )


def _structural_zero(v: Vec3) -> bool:
    return all(type(c) is int and c == 0 for c in v)
