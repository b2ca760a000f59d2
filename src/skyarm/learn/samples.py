"""Samples for the network: what it sees in flights, and the generalized force that the model leaves out of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.actuation import Command, rotor_force
from skyarm.algebra import ZERO3, Force, Quaternion, Vec3
from skyarm.compare.suite import NOISE
from skyarm.control.laws.learned.features import HISTORY, features, no_history, remembered
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics import array_front as arrays
from skyarm.log.flight_log import Log
from skyarm.reference import Reference
from skyarm.sensors.noise import measure, noise_count

Array = npt.NDArray[np.float64]

PERIOD = 0.005
"""s, of the control."""


def residuals(model: Model, log: Log) -> Array:
    """What the model leaves out of a flight (N - 1, 6 + n): force and torque in base axes, joint torques."""
    vehicle = model.vehicle
    velocity = np.hstack([log.velocity, log.rate, log.joint_rates])
    acceleration = np.diff(velocity, axis=0) / PERIOD
    needed = arrays.inverse_dynamics(
        vehicle,
        log.position[:-1],
        log.quaternion[:-1],
        log.joints[:-1],
        velocity[:-1],
        acceleration,
        gravity=float(model.gravity),
    )
    speeds = 0.5 * (log.rotor_speeds[:-1] + log.rotor_speeds[1:])
    pushed = Force(ZERO3, ZERO3)
    for rotor, speed in zip(vehicle.rotors, speeds.T, strict=True):
        pushed = pushed + rotor_force(rotor, speed, ZERO3)
    force = Quaternion(*log.quaternion[:-1].T).rotation().apply_T(Vec3(*needed[:, :3].T)) - pushed.force
    torque = Vec3(*needed[:, 3:6].T) - pushed.torque
    still = np.zeros(len(speeds))
    base = [still + np.asarray(c) for c in (*force, *torque)]
    return np.column_stack([*base, needed[:, 6:] - log.efforts[:-1]])


def samples(model: Model, logs: Sequence[Log], noisy: Sequence[bool], rng: np.random.Generator) -> tuple[Array, Array]:
    """What the network sees and what it shall tell, of flights of one length.

    Args:
        model: the belief.
        logs: flights.
        noisy: which of them are seen through the bench's noise, drawn anew.
        rng: gives the noise.

    Returns:
        inputs (flights, N - 1, features) and outputs (flights, N - 1, 6 + n); outputs pass the filter that the inputs'
        history passes.
    """
    vehicle, count = model.vehicle, len(logs[0].time) - 1
    draws = noise_count(vehicle.n, len(vehicle.rotors))
    switch = np.array(noisy, dtype=float)
    truth = np.stack([residuals(model, log) for log in logs])
    history: Any = no_history(vehicle.n)
    inputs, outputs, filtered = [], [], truth[:, 0]
    for k in range(count):
        noise = switch * rng.normal(size=(draws, len(logs)))
        m = measure(NOISE, float(logs[0].time[k]), _state(logs, k), ZERO3, list(noise))
        held = Reference(
            position=Vec3(*_column(logs, "position_held", k)),
            velocity=Vec3(*_column(logs, "velocity_held", k)),
            joints=tuple(_column(logs, "joints_held", k)),
            joint_rates=tuple(_column(logs, "joint_rates_held", k)),
        )
        inputs.append(np.stack([np.broadcast_to(x, (len(logs),)) for x in features(m, held, history)], axis=1))
        filtered = filtered + (1.0 - math.exp(-HISTORY * PERIOD)) * (truth[:, k] - filtered)
        outputs.append(filtered)
        efforts = tuple(_column(logs, "efforts", k))
        command = Command(rotor_speeds=tuple(_column(logs, "rotor_commands", k)), efforts=efforts)
        history = remembered(vehicle, history, m, command, PERIOD)
    return np.stack(inputs, axis=1), np.stack(outputs, axis=1)


def _column(logs: Sequence[Log], name: str, k: int) -> Array:
    """A quantity of all flights at an instant: (components, flights)."""
    return np.stack([getattr(log, name)[k] for log in logs], axis=1)


def _state(logs: Sequence[Log], k: int) -> State:
    """The true states of all flights at an instant."""
    return State(
        position=Vec3(*_column(logs, "position", k)),
        quaternion=Quaternion(*_column(logs, "quaternion", k)),
        velocity=Vec3(*_column(logs, "velocity", k)),
        rate=Vec3(*_column(logs, "rate", k)),
        joints=tuple(_column(logs, "joints", k)),
        joint_rates=tuple(_column(logs, "joint_rates", k)),
        rotor_speeds=tuple(_column(logs, "rotor_speeds", k)),
    )
