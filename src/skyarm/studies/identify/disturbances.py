"""Disturbance model: accelerations that the commands do not explain, estimated from a flight's past and predicted.

Of each axis the sum of measured less predicted accelerations is a velocity that a constant, a first-order
Gauss-Markov process and white noise drive, measured with white noise. A Kalman filter over the past gives the three
states at any instant; ahead the constant stays and the process decays. Its four noises and its time constant are those
of the largest likelihood of the innovations (R. E. Kalman 1960; L. Ljung, System Identification, 1999, 4.3 and 7.3).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from skyarm.algebra import Quaternion, Vec3
from skyarm.algebra.frames import to_base
from skyarm.flight_data.quantities import GRAVITY
from skyarm.flight_data.series import continuous, middle, unit_rows
from skyarm.records.arrays import Array, IntArray, Mask
from skyarm.records.immutable import immutable
from skyarm.studies.identify.autoregression import without_line
from skyarm.studies.identify.identified_parts import Surroundings
from skyarm.studies.identify.motion_model import Memo, Stretch, base_acceleration
from skyarm.studies.identify.sampled_series import vectors_of
from skyarm.studies.identify.window_fit import scipy_parts
from skyarm.vehicle.vehicle_records import Vehicle

if TYPE_CHECKING:
    from skyarm.studies.identify.open_loop import Poses


UNKNOWN = 1e3
"""Times the deviation of its process, of a disturbance before anything is measured."""

LONGEST = 1e3
"""s, longest time constant of the process."""

SETTLED = 1.0
"""s, of a stretch before the filter's innovations count."""


RANGE, MOST, FIRST = (-7.0, 7.0), 240, (0.1, 1.0)
"""Logarithms of noises over the size of what is measured, most evaluations of the likelihood in a search, and s, time
constants that searches begin with.
"""


@immutable
class AxisNoise:
    """Noises of one axis, in units of its velocity and seconds.

    Attributes:
        measured: standard deviation of the measured velocity.
        white: of the velocity's random walk in one second.
        process: of the Gauss-Markov acceleration. time_constant: of it, s.
        walk: of the constant acceleration's random walk in one second.
    """

    measured: float
    white: float
    process: float
    time_constant: float
    walk: float

    def matrices(self, h: float) -> tuple[Array, Array, float]:
        """Transition over a period (s), its noise's covariance, and the variance of a measurement."""
        decay = math.exp(-h / self.time_constant)
        step = np.array([[1.0, h, h], [0.0, decay, 0.0], [0.0, 0.0, 1.0]])
        noise = np.diag([self.white**2 * h, self.process**2 * (1.0 - decay**2), self.walk**2 * h])
        return step, noise, self.measured**2


@immutable(kw_only=False)
class DisturbanceModel:
    """Noises of the base's linear and angular velocity along its axes: x, y, z of either."""

    axes: tuple[AxisNoise, ...]

    def estimate(self, sums: Array, used: Mask, h: float) -> tuple[Array, Array]:
        """Kalman filter over a stretch.

        Args:
            sums: (N + 1, axes) sums of measured less predicted accelerations.
            used: (N,) periods that count; a constant changes freely over others.
            h: s, of a period.

        Returns:
            Errors of the measured velocities (N + 1, axes) and the disturbances (N + 1, axes, 2): process, constant.
        """
        parts = [each.matrices(h) for each in self.axes]
        step, noise, measured = (np.stack([row[i] for row in parts]) for i in range(3))
        state = np.zeros((len(parts), 3))
        loose = np.stack([np.diag([0.0, a.process**2, (UNKNOWN * max(a.process, 1e-9)) ** 2]) for a in self.axes])
        loose[:, 0, 0] = 4.0 * measured
        spread, found = loose.copy(), np.empty((len(sums), len(parts), 3))
        state[:, 0] = sums[0]
        for k, row in enumerate(sums):
            if k:
                state = np.einsum("aij,aj->ai", step, state)
                spread = step @ spread @ step.transpose(0, 2, 1) + noise
                if not used[k - 1]:
                    spread, state[:, 0] = spread + loose, row
            gain = spread[:, :, 0] / (spread[:, 0, 0] + measured + 1e-300)[:, None]
            state = state + gain * (row - state[:, 0])[:, None]
            spread = spread - gain[:, :, None] * spread[:, :1, :]
            found[k] = state
        return sums - found[:, :, 0], found[:, :, 1:]

    def ahead(self, disturbance: Array, h: float, periods: int) -> Array:
        """Mean acceleration (K, axes) over a period that begins some periods (s) after estimates (K, axes, 2)."""
        times = np.array([each.time_constant for each in self.axes])
        share = np.exp(-periods * h / times) * times / h * -np.expm1(-h / times)
        found: Array = disturbance[:, :, 0] * share + disturbance[:, :, 1]
        return found


def unexplained_sums(vehicle: Vehicle, about: Surroundings, stretch: Stretch, poses: Poses, gravity: float) -> Array:
    """Sums (N + 1, 6) of measured less predicted accelerations of the base, linear and angular, base axes."""
    q, h = unit_rows(middle(continuous(poses.quaternion))), stretch.period
    speed = to_base(q, middle(poses.known_velocity))
    place = np.arange(stretch.size)
    rate = Vec3(*middle(stretch.rate).T)
    linear, angular = base_acceleration(vehicle, about, stretch, place, rate, Vec3(*speed.T), Memo())
    foretold = vectors_of((*linear, *angular), stretch.size)
    change = np.diff(poses.known_velocity, axis=0) + np.array([0.0, 0.0, gravity * h])
    steps = np.concatenate([to_base(q, change), np.diff(stretch.rate, axis=0)], axis=1) - foretold * h
    return np.concatenate([np.zeros((1, 6)), np.cumsum(steps, axis=0)])


def fit_disturbances(
    vehicle: Vehicle,
    about: Surroundings,
    flights: Sequence[tuple[Stretch, Poses]],
    gravity: float = GRAVITY,
) -> DisturbanceModel:
    """Noises of the largest likelihood, from flights that a vehicle was identified from.

    Args:
        vehicle: rigid bodies and rotors.
        about: delays and offsets.
        flights: stretches with the poses measured at their instants.
        gravity: m/s^2.
    """
    h = flights[0][0].period
    sums = [unexplained_sums(vehicle, about, stretch, poses, gravity) for stretch, poses in flights]
    return DisturbanceModel(tuple(_largest_likelihood([each[:, i] for each in sums], h) for i in range(6)))


def _largest_likelihood(series: Sequence[Array], h: float) -> AxisNoise:
    """Noises of one axis under which its series are likeliest."""
    scipy_parts()
    from scipy.optimize import minimize
    from scipy.signal import lfilter

    straight = [without_line(each, np.ones(len(each))) for each in series]
    burnt = max(1, round(SETTLED / h))
    straight = [each for each in straight if len(each) > 2 * burnt] or straight
    burnt = min(burnt, min(len(each) for each in straight) // 2)
    scale = float(np.sqrt(np.mean(np.concatenate([np.diff(each) for each in straight]) ** 2))) + 1e-12

    def noise_of(x: Array) -> AxisNoise:
        return AxisNoise(
            measured=scale * math.exp(x[0]),
            white=scale / math.sqrt(h) * math.exp(x[1]),
            process=scale / h * math.exp(x[2]),
            time_constant=min(max(math.exp(x[3]), h), LONGEST),
            walk=scale / h * math.exp(x[4]),
        )

    def unlikeliness(x: Array) -> float:
        step, noise, measured = noise_of(np.clip(x, *RANGE)).matrices(h)
        spread = steady_spread(step, noise, measured)
        variance = float(spread[0, 0] + measured)
        closed = step - (step @ spread[:, :1] / variance) @ np.array([[1.0, 0.0, 0.0]])
        numerator, denominator = characteristic(step), characteristic(closed)
        left = [lfilter(numerator, denominator, each)[burnt:] for each in straight]
        count = sum(len(each) for each in left)
        return 0.5 * count * math.log(variance) + 0.5 * sum(float(each @ each) for each in left) / variance

    def search(begin: Array, most: int) -> Any:
        options = {"maxfev": most, "xatol": 0.05, "fatol": 1.0, "adaptive": True}
        return minimize(unlikeliness, begin, method="Nelder-Mead", options=options)

    begins = [search(np.array([-1.0, -1.0, -1.0, math.log(seconds), -3.0]), MOST // 2) for seconds in FIRST]
    best = search(min(begins, key=lambda found: float(found.fun)).x, MOST)
    return noise_of(np.clip(best.x, *RANGE))


def characteristic(matrix: Array) -> list[float]:
    """Coefficients of the characteristic polynomial of a matrix (3, 3), the highest power first."""
    (a, b, c), (d, e, f), (g, h, i) = matrix.tolist()
    minors = a * e - b * d + a * i - c * g + e * i - f * h
    return [1.0, -(a + e + i), minors, -(a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g))]


def steady_spread(step: Array, noise: Array, measured: float) -> Array:
    """Steady covariance (3, 3) of a state before its first entry is measured, by doubling (Anderson 1978)."""
    a, g, h = step.T.copy(), np.diag([1.0 / measured, 0.0, 0.0]), noise
    for _ in range(30):
        between = np.linalg.inv(np.eye(3) + g @ h)
        grown = a.T @ h @ between @ a
        g, a, h = g + a @ between @ g @ a.T, a @ between @ a, h + 0.5 * (grown + grown.T)
        if np.abs(grown).max() <= 1e-9 * np.abs(h).max():
            break
    return h


def begin_at(
    model: DisturbanceModel, sums: Array, stretch: Stretch, poses: Poses, rows: IntArray
) -> tuple[Array, Array, Array]:
    """World velocity (K, 3), base rate (K, 3) and disturbances (K, 6, 2) at instants, from measurements until then."""
    errors, disturbance = model.estimate(sums, stretch.used, stretch.period)
    R = Quaternion(*poses.quaternion[rows].T).rotation()
    off = vectors_of(R.apply(Vec3(*errors[rows, :3].T)), len(rows))
    return poses.known_velocity[rows] - off, stretch.rate[rows] - errors[rows, 3:], disturbance[rows]
