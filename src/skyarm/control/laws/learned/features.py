"""Inputs of the network: motion, errors, and a short history of velocities and commands in one filter each."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.actuation import Command, rotor_force
from skyarm.algebra import E_Z, ZERO3, Force, Vec3
from skyarm.records.units import Unit
from skyarm.reference import Reference
from skyarm.scalars import Scalar, add, exp, mul, sub, where
from skyarm.sensors.measurement import Measurement
from skyarm.vehicle.vehicle_records import Vehicle

HISTORY = 15.0
"""rad/s, of the filters: fast against gusts of some tenths of a second, slow against noise of 1 cm/s."""


@dataclass(frozen=True, kw_only=True, slots=True)
class History:
    """Filtered motion and commands.

    Attributes:
        started: 0 before the first measurement. commanded: 0 before the first command.
        velocity: world axes, m/s. rate: base axes, rad/s. joint_rates: rad/s or m/s.
        force, torque: that the commanded rotor speeds make in still air, base axes, N, N m. efforts: N m or N.
    """

    started: Annotated[Scalar, Unit("", "0 before the first measurement")]
    commanded: Annotated[Scalar, Unit("", "0 before the first command")]
    velocity: Annotated[Vec3, Unit("m/s", "world axes, filtered")]
    rate: Annotated[Vec3, Unit("rad/s", "base axes, filtered")]
    joint_rates: Annotated[tuple[Scalar, ...], Unit("rad/s or m/s", "filtered")]
    force: Annotated[Vec3, Unit("N", "base axes, of the commanded rotors in still air, filtered")]
    torque: Annotated[Vec3, Unit("N m", "base axes, of the commanded rotors in still air, filtered")]
    efforts: Annotated[tuple[Scalar, ...], Unit("N m or N", "commanded, filtered")]


def no_history(joints: int) -> History:
    """Before the first step."""
    zero, still = Vec3(0.0, 0.0, 0.0), (0.0,) * joints
    return History(
        started=0.0,
        commanded=0.0,
        velocity=zero,
        rate=zero,
        joint_rates=still,
        force=zero,
        torque=zero,
        efforts=still,
    )


def feature_names(joints: int) -> tuple[str, ...]:
    """Names of the features, in their order."""
    axes = ("x", "y", "z")
    arm = tuple(str(i + 1) for i in range(joints))
    groups = {
        **dict.fromkeys(("velocity_B", "up_B", "rate_B"), axes),
        **dict.fromkeys(("joint", "joint_rate"), arm),
        **dict.fromkeys(("acceleration_B", "angular_acceleration_B"), axes),
        "joint_acceleration": arm,
        **dict.fromkeys(("position_error_B", "velocity_error_B"), axes),
        **dict.fromkeys(("joint_error", "joint_rate_error"), arm),
        **dict.fromkeys(("force_B", "torque_B"), axes),
        "effort": arm,
    }
    return tuple(f"{group} {part}" for group, parts in groups.items() for part in parts)


def features(measurement: Measurement, reference: Reference, history: History) -> tuple[Any, ...]:
    """The network's inputs; accelerations are those of the filtered velocities, HISTORY (x - filtered x)."""
    m, R = measurement, measurement.quaternion.rotation()
    new = history.started < 0.5

    def rise(x: Any, filtered: Any) -> Any:
        return where(new, 0.0, HISTORY * (x - filtered))

    acceleration = Vec3(*(rise(a, b) for a, b in zip(m.velocity, history.velocity, strict=True)))
    turning = [rise(a, b) for a, b in zip(m.rate, history.rate, strict=True)]
    return (
        *R.apply_T(m.velocity),
        *R.apply_T(E_Z),
        *m.rate,
        *m.joints,
        *m.joint_rates,
        *R.apply_T(acceleration),
        *turning,
        *(rise(a, b) for a, b in zip(m.joint_rates, history.joint_rates, strict=True)),
        *R.apply_T(m.position - reference.position),
        *R.apply_T(m.velocity - reference.velocity),
        *(sub(a, b) for a, b in zip(m.joints, reference.joints, strict=True)),
        *(sub(a, b) for a, b in zip(m.joint_rates, reference.joint_rates, strict=True)),
        *history.force,
        *history.torque,
        *history.efforts,
    )


def remembered(vehicle: Vehicle, history: History, measurement: Measurement, command: Command, dt: Any) -> History:
    """History after a step: of its measurement, and of the command that was sent."""
    return with_command(vehicle, with_motion(history, measurement, dt), command, dt)


def with_motion(history: History, measurement: Measurement, dt: Any) -> History:
    """History with a measurement in it."""
    new = history.started < 0.5
    return dataclasses.replace(
        history,
        started=where(new, 1.0, history.started),
        velocity=Vec3(*_followed(new, history.velocity, measurement.velocity, dt)),
        rate=Vec3(*_followed(new, history.rate, measurement.rate, dt)),
        joint_rates=_followed(new, history.joint_rates, measurement.joint_rates, dt),
    )


def with_command(vehicle: Vehicle, history: History, command: Command, dt: Any) -> History:
    """History with the command in it that was sent after its last measurement; as it is before the first."""
    pushed = Force(ZERO3, ZERO3)
    for rotor, speed in zip(vehicle.rotors, command.rotor_speeds, strict=True):
        pushed = pushed + rotor_force(rotor, speed, ZERO3)
    begun, new = history.started > 0.5, history.commanded < 0.5

    def after(filtered: Any, values: Any) -> tuple[Any, ...]:
        return tuple(where(begun, b, a) for a, b in zip(filtered, _followed(new, filtered, values, dt), strict=True))

    return dataclasses.replace(
        history,
        commanded=where(begun, 1.0, history.commanded),
        force=Vec3(*after(history.force, pushed.force)),
        torque=Vec3(*after(history.torque, pushed.torque)),
        efforts=after(history.efforts, command.efforts),
    )


def _followed(new: Any, filtered: Any, values: Any, dt: Any) -> tuple[Any, ...]:
    """Values through the filter, which starts at the first of them."""
    share = 1.0 - exp(mul(-HISTORY, dt))
    return tuple(where(new, x, add(y, mul(share, sub(x, y)))) for y, x in zip(filtered, values, strict=True))
