"""Regression models for lag identification: forces from the logged motion and from lagged commands.

Needed forces follow from the model's inverse dynamics; those that lagged commands give, from the rotors' geometry.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skyarm.algebra import ZERO3
from skyarm.algebra.frames import to_base
from skyarm.dynamics.actuators.rotor import push, rotor_forces
from skyarm.dynamics.array_front import inverse_dynamics
from skyarm.flight_data.series import middle
from skyarm.log.flight_log import Log
from skyarm.records.arrays import Array
from skyarm.records.immutable import immutable
from skyarm.studies.identify.logged_commands import time_constants
from skyarm.vehicle.vehicle_records import Rotor, Vehicle

SHORTEST = 1.0
"""s of a flight of which anything is asked."""

UNEVEN = 0.01
"""Of a period: what instants may be off an even clock."""


@immutable(kw_only=False)
class Needed:
    """Inverse dynamics of a flight log: mean wrench and joint efforts over each of its N - 1 control periods.

    Attributes:
        period: s. wrench: (N - 1, 6) force and torque at the base origin, base axes, N and N m.
        efforts: (N - 1, n) of the joints, without friction. joint_rates: (N - 1, n).
    """

    period: float
    wrench: Array
    efforts: Array
    joint_rates: Array


def control_period(log: Log) -> float:
    """Control period of a flight log, s; an error if its times are not evenly spaced.

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


def require_finite(log: Log, *names: str) -> None:
    """Raise an error in one line if an array of a log holds what is no finite number."""
    for name in names:
        if not np.isfinite(log[name]).all():
            raise ValueError(f"{name}: must be finite throughout the flight")


def model_forces(vehicle: Vehicle, log: Log, gravity: float) -> Needed:
    """Wrench and joint efforts by inverse dynamics, from finite differences of the logged velocities.

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
    require_finite(log, "position", "quaternion", "velocity", "rate", "joints", "joint_rates")
    quaternion = middle(log.quaternion)
    length = np.linalg.norm(quaternion, axis=1, keepdims=True)
    if length.min() < 0.5:
        raise ValueError("quaternion: must be of unit length and without jumps")
    rates = np.concatenate([log.velocity, log.rate, log.joint_rates], axis=1)
    quaternion = quaternion / length
    found = inverse_dynamics(
        vehicle,
        middle(log.position),
        quaternion,
        middle(log.joints),
        middle(rates),
        np.diff(rates, axis=0) / period,
        gravity=gravity,
    )
    force = to_base(quaternion, found[:, :3])
    wrench = np.concatenate([force, found[:, 3:6]], axis=1)
    return Needed(period, wrench, found[:, 6:], middle(log.joint_rates))


USUAL = 0.02
"""s: unit of the time constants of rotors that are believed to have none."""


def believed_lags(rotors: Sequence[Rotor]) -> tuple[Array, Array]:
    """Nominal time constants of each rotor, rising and falling, s; defaults for rotors modelled without lag."""
    pairs = time_constants(rotors)
    pairs = np.where(pairs > 0.0, pairs, USUAL)
    return pairs[:, 0], pairs[:, 1]


def pushes_of(rotors: Sequence[Rotor], squares: Array) -> Array:
    """Rotor thrusts over thrust coefficient, (rad/s)^2, from mean squared speeds (..., rotors)."""
    columns = [squares[..., i] if r.table is None else push(r, np.sqrt(squares[..., i])) for i, r in enumerate(rotors)]
    return np.stack(columns, axis=-1)


def wrench_of_pushes(rotors: Sequence[Rotor]) -> Array:
    """Allocation matrix (6, rotors): force and torque at the base origin, base axes, per (rad/s)^2 of each rotor."""
    found = []
    for i in range(len(rotors)):
        force = rotor_forces(rotors, [float(k == i) for k in range(len(rotors))], ZERO3, ZERO3)
        found.append([float(each) for each in (*force.force, *force.torque)])
    return np.array(found).T
