"""The full state with optional white noise: the sensor that every scenario has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Quaternion, Vec3
from skyarm.compile import leaves
from skyarm.dynamics import State
from skyarm.records.field_rules import accept_fields
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, add, data, mul
from skyarm.scalars.philox import normals
from skyarm.sensors.measurement import Measurement
from skyarm.sensors.sensor import Sensor
from skyarm.vehicle.vehicle_records import Vehicle


@dataclass(frozen=True, kw_only=True, slots=True)
class SensorNoise(Sensor):
    """Sensor noise reads the full state at the control rate and adds white noise.

    Its numbers are standard deviations, one sigma at the control rate; an int 0 folds the channel away.
    """

    position: Annotated[Scalar, Unit("m", low=0.0)] = 0
    velocity: Annotated[Scalar, Unit("m/s", low=0.0)] = 0
    attitude: Annotated[Scalar, Unit("rad", "rotation vector, base axes", low=0.0)] = 0
    rate: Annotated[Scalar, Unit("rad/s", low=0.0)] = 0
    specific_force: Annotated[Scalar, Unit("m/s^2", low=0.0)] = 0
    joints: Annotated[Scalar, Unit("rad or m", low=0.0)] = 0
    joint_rates: Annotated[Scalar, Unit("rad/s or m/s", low=0.0)] = 0
    rotor_speeds: Annotated[Scalar, Unit("rad/s", low=0.0)] = 0

    def __post_init__(self) -> None:
        accept_fields(self, "sensors")

    def uniforms(self, vehicle: Vehicle) -> int:
        """An even number, since normal numbers come in pairs; none for perfect sensors."""
        count = noise_count(vehicle.n, len(vehicle.rotors))
        return count + count % 2 if leaves(self) else 0

    def measure(
        self, memory: Any, t: Any, state: State, specific_force: Vec3, draws: Sequence[Any], dt: float
    ) -> tuple[Any, Measurement]:
        """The state and specific force with noise."""
        count = noise_count(len(state.joints), len(state.rotor_speeds))
        noise = normals(draws)[:count] if draws else [0] * count
        # where nothing pushes the reading is a structural zero
        proper = Vec3(*(data(c) for c in specific_force))
        return memory, measure(self, t, state, proper, noise)


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
        tilts=state.tilts,
    )


def _structural_zero(v: Vec3) -> bool:
    return all(type(c) is int and c == 0 for c in v)
