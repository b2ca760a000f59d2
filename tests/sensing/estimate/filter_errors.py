"""Errors of the error-state filter over many flights: against the truth of its own
instant, by its own covariance.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

import skyarm
from support.engines import BatchSession


@dataclass(frozen=True)
class Errors:
    """Of all flights at one instant: errors (15, lanes), covariances (lanes, 15, 15),
    whether each still flies.
    """

    time: float
    errors: np.ndarray
    covariances: np.ndarray
    flying: np.ndarray

    @property
    def nees(self) -> np.ndarray:
        """Normalised estimation error squared of each flight that flies: chi-square
        with 15 degrees of freedom.
        """
        e = self.errors.T[self.flying]
        return np.einsum(
            "li,li->l",
            e,
            np.linalg.solve(self.covariances[self.flying], e[..., None])[..., 0],
        )


def errors_of(
    scenario: skyarm.Scenario, lanes: int, seed: int, every: float
) -> Iterator[Errors]:
    """Fly and compare, at each so many seconds; the first sensor is the inertial
    unit.
    """
    lag, rate = scenario.estimator.delay_periods, scenario.rates.control
    with BatchSession(scenario, lanes, seed=seed, law=True, autoreset=False) as flights:
        past: list[Any] = []
        for k in range(scenario.steps):
            past = [*past, _truth(flights.state)][-lag - 1 :]
            flights.step()
            if k and k % round(rate * every) == 0:
                now = flights.now
                yield _compared(k / rate, now, past[0])


def _truth(state: Any) -> tuple[np.ndarray, ...]:
    return tuple(
        np.array([*part]) for part in (state.position, state.velocity, state.quaternion)
    )


def _compared(time: float, now: Any, truth: tuple[np.ndarray, ...]) -> Errors:
    memory, inertial = now.agent.estimate, now.agent.sensors[1].memory
    belief = memory.belief
    position, velocity, attitude = truth
    gyro, accelerometer = (np.array(drift) for drift in inertial.drifts)
    parts = [
        position - np.array([*belief.position]),
        velocity - np.array([*belief.velocity]),
        _turn(attitude, np.array([*belief.quaternion])),
        gyro - np.array([*belief.gyro_bias]),
        accelerometer - np.array([*belief.accelerometer_bias]),
    ]
    size = len(memory.covariance)
    P = np.zeros((position.shape[1], size, size))
    for i, row in enumerate(memory.covariance):
        for j, value in enumerate(row):
            P[:, i, j] = P[:, j, i] = value
    return Errors(
        time, np.concatenate(parts), P[:, :15, :15], np.array(now.alive) > 0.5
    )


def _turn(truth: np.ndarray, believed: np.ndarray) -> np.ndarray:
    """Rotation vector (world axes) from the believed attitude to the true one,
    small.
    """
    w, x, y, z = truth
    a, b, c, d = believed[0], -believed[1], -believed[2], -believed[3]
    scalar = w * a - x * b - y * c - z * d
    vector = np.array(
        [
            w * b + x * a + y * d - z * c,
            w * c - x * d + y * a + z * b,
            w * d + x * c - y * b + z * a,
        ]
    )
    return 2.0 * np.sign(scalar) * vector
