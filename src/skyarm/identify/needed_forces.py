"""Forces that a logged motion needed, by the model's inverse dynamics: of the base's rotors, and of the joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skyarm.dynamics.array_front import inverse_dynamics
from skyarm.log.flight_log import Log
from skyarm.vehicle.vehicle_records import Vehicle

Array = npt.NDArray[np.float64]

SHORTEST = 1.0
"""s of a flight of which anything is asked."""

UNEVEN = 0.01
"""Of a period: what instants may be off an even clock."""


@dataclass(frozen=True, slots=True)
class Needed:
    """Means over the N - 1 control periods of a log.

    Attributes:
        period: s. wrench: (N - 1, 6) force and torque at the base origin, base axes, N and N m.
        efforts: (N - 1, n) of the joints, without friction. joint_rates: (N - 1, n).
    """

    period: float
    wrench: Array
    efforts: Array
    joint_rates: Array


def control_period(log: Log) -> float:
    """Time between two instants of a log, s.

    Raises:
        ValueError: it is too short, or its instants are not evenly spaced.
    """
    steps = np.diff(log.time)
    if not len(steps) or log.time[-1] - log.time[0] < SHORTEST * (1.0 - 1e-9):
        span = log.time[-1] - log.time[0] if log.time.size else 0.0
        raise ValueError(f"time: {span:g} s are too short; at least {SHORTEST:g} s of flight are needed")
    period = float(np.median(steps))
    if not period > 0.0 or np.abs(steps - period).max() > UNEVEN * period:
        raise ValueError("time: must be evenly spaced, one row a control period")
    return period


def needed(vehicle: Vehicle, log: Log, gravity: float) -> Needed:
    """Forces by the model, from differences of the logged velocities.

    Args:
        vehicle: the model, without friction.
        log: with the rates as they were measured, or true ones.
        gravity: m/s^2.

    Raises:
        ValueError: another number of joints, or a log whose clock is not even or that holds numbers that are none.
    """
    if log.joints.shape[1] != vehicle.n:
        raise ValueError(f"joints: the log has {log.joints.shape[1]}, vehicle '{vehicle.name}' {vehicle.n}")
    period = control_period(log)
    for name in ("position", "quaternion", "velocity", "rate", "joints", "joint_rates"):
        if not np.isfinite(getattr(log, name)).all():
            raise ValueError(f"{name}: must be finite throughout the flight")
    quaternion = _middle(log.quaternion)
    length = np.linalg.norm(quaternion, axis=1, keepdims=True)
    if length.min() < 0.5:
        raise ValueError("quaternion: must be of unit length and without jumps")
    rates = np.concatenate([log.velocity, log.rate, log.joint_rates], axis=1)
    quaternion = quaternion / length
    found = inverse_dynamics(
        vehicle,
        _middle(log.position),
        quaternion,
        _middle(log.joints),
        _middle(rates),
        np.diff(rates, axis=0) / period,
        gravity=gravity,
    )
    force = to_base(quaternion, found[:, :3])
    wrench = np.concatenate([force, found[:, 3:6]], axis=1)
    return Needed(period, wrench, found[:, 6:], _middle(log.joint_rates))


def _middle(rows: Array) -> Array:
    """(N - 1, ...) between two rows."""
    return 0.5 * (rows[1:] + rows[:-1])


def to_base(quaternion: Array, vectors: Array) -> Array:
    """Vectors (N, 3) of world axes in base axes; quaternion (N, 4) wxyz, base to world."""
    w, axis = quaternion[:, :1], -quaternion[:, 1:]
    turned = 2.0 * np.cross(axis, vectors)
    found: Array = vectors + w * turned + np.cross(axis, turned)
    return found
