"""Regression models for lag identification: forces from the logged motion and from lagged commands.

Needed forces follow from the model's inverse dynamics. Rotors and joint drives make means over control periods of
logged commands, for many delays and lags at once. A log is cut into stretches that are followed side by side, each from
some time before its begin: of a rotor's past, exp(-t / time constant) is left. The time that a log takes grows with a
stretch's length, not with its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import ZERO3
from skyarm.dynamics.actuators.rotor import push, rotor_forces
from skyarm.dynamics.array_front import inverse_dynamics
from skyarm.log.flight_log import Log
from skyarm.vehicle.vehicle_records import Rotor, Vehicle

Array = npt.NDArray[np.float64]

SHORTEST = 1.0
"""s of a flight of which anything is asked."""

UNEVEN = 0.01
"""Of a period: what instants may be off an even clock."""


@dataclass(frozen=True, slots=True)
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
    """Means of consecutive rows of a time series: (N, ...) to (N - 1, ...)."""
    return 0.5 * (rows[1:] + rows[:-1])


def to_base(quaternion: Array, vectors: Array) -> Array:
    """Rotate vectors (N, 3) from world axes to base axes; quaternion (N, 4) wxyz, base to world."""
    w, axis = quaternion[:, :1], -quaternion[:, 1:]
    turned = 2.0 * np.cross(axis, vectors)
    found: Array = vectors + w * turned + np.cross(axis, turned)
    return found


STRETCH = 0.25
"""s, of a stretch."""

FORGOTTEN = 5.0
"""Time constants that are followed before a stretch: of what was before, 0.7 % is left."""

USUAL = 0.02
"""s: unit of the time constants of rotors that are believed to have none."""


@dataclass(frozen=True, slots=True)
class Followed:
    """Logged commands cut into overlapping time blocks, to simulate actuator lag in parallel.

    Attributes:
        commands: (steps + 2, stretches, columns) commands of the periods of each stretch, shifted by nothing.
        before: periods of a stretch that are not counted. periods: of the log. longest: periods of delay that fit.
    """

    commands: Array
    before: int
    periods: int
    longest: int

    @classmethod
    def of(cls, commands: Array, period: float, longest: float, slowest: float) -> Followed:
        """Cut logged commands (N, actuators), one per control period, into overlapping time blocks.

        Args:
            commands: as sent; the first one is assumed to hold before the log begins.
            period: control period, s.
            longest: longest delay to be evaluated, s.
            slowest: largest time constant to be evaluated, s.
        """
        periods = len(commands) - 1
        late, before = int(longest / period) + 2, round(FORGOTTEN * slowest / period)
        size = max(1, min(round(STRETCH / period), periods))
        starts = np.arange(0, periods, size)
        places = starts[None, :] - before - late + np.arange(late + before + size)[:, None]
        return cls(commands[np.clip(places, 0, periods)], before, periods, late)

    def in_periods(self, means: Array) -> Array:
        """Join means over time blocks (steps, candidates, blocks, actuators) into a series over the whole log."""
        kept = means[self.before :]
        joined = kept.transpose(1, 2, 0, 3).reshape(kept.shape[1], -1, kept.shape[3])
        return joined[:, : self.periods]

    def means(self, period: float, delay: Array, up: Array, down: Array, *, squared: bool) -> Array:
        """Mean actuator response per control period to the commands after dead time and first-order lag.

        The approach to a held command is monotonic: one time constant holds for it, and its mean is exact.

        Args:
            period: control period, s.
            delay: (candidates,) s of dead time, from 0 to the longest.
            up: (candidates, columns) time constants, s, toward a larger value.
            down: the same toward a smaller one.
            squared: the mean of the square, as of a rotor's speed.

        Returns:
            (candidates, periods, columns).
        """
        whole = np.floor(delay / period + 1e-9).astype(int)
        late = np.maximum(delay - whole * period, 0.0)[:, None, None]
        spans = late, period - late
        ups, downs = up[:, None, :], down[:, None, :]
        decays = [[np.exp(-span / np.maximum(tau, 1e-6)) for tau in (ups, downs)] for span in spans]
        value = self.commands[self.longest - 1 - whole]  # (candidates, stretches, columns)
        steps, even = len(self.commands) - self.longest, up is down
        found = np.empty((steps, *value.shape))
        for k in range(steps):
            total: Any = 0.0
            for back, span, (rising, falling) in zip((1, 0), spans, decays, strict=True):
                target = self.commands[self.longest + k - whole - back]
                off = value - target
                tau, decay = ups, rising
                if not even:
                    above = off > 0.0
                    tau, decay = np.where(above, downs, ups), np.where(above, falling, rising)
                away = off * tau * (1.0 - decay)
                if squared:
                    total = total + target * (target * span + 2.0 * away) + 0.5 * off * away * (1.0 + decay)
                else:
                    total = total + target * span + away
                value = target + off * decay
            found[k] = total / period
        return self.in_periods(found)


def believed_lags(rotors: Sequence[Rotor]) -> tuple[Array, Array]:
    """Nominal time constants of each rotor, rising and falling, s; defaults for rotors modelled without lag."""
    pairs = np.array([[float(r.time_constant_up), float(r.time_constant_down)] for r in rotors])
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
