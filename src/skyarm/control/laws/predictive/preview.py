"""The reference ahead of now: held samples extrapolated, or the trajectory itself where it is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skyarm.control.blocks.extrapolation import samples
from skyarm.reference import Reference, Trajectory

Array = npt.NDArray[np.float64]

JUMP = 0.02
"""m or rad between a sample and what the last one foretold, beyond which the motion is taken for a new one."""


@dataclass(frozen=True, slots=True)
class Sample:
    """A published sample as signals [x, y, z, yaw, joints ...] with three derivatives, and its age in s."""

    values: Array
    rates: Array
    accelerations: Array
    jerks: Array
    age: float


def read(reference: Reference) -> tuple[Array, Array, Array]:
    """Values, rates and accelerations of the signals."""
    values, rates, accelerations = np.array(samples(reference), dtype=float).T
    return values, rates, accelerations


def extrapolated(sample: Sample, ahead: Array) -> tuple[Array, Array, Array]:
    """Signals (T, signals) and their first two derivatives ``ahead`` (T,) s after the sample was taken."""
    t = ahead[:, None]
    values = sample.values + t * (sample.rates + t * (sample.accelerations / 2.0 + t * sample.jerks / 6.0))
    rates = sample.rates + t * (sample.accelerations + t * sample.jerks / 2.0)
    return values, rates, sample.accelerations + t * sample.jerks


def taken(reference: Reference, before: Sample | None, dt: float) -> Sample:
    """The sample that a controller holds now, after ``dt`` s; jerks follow from the accelerations of the last two.

    A sample has come when it differs; one that came where none was foretold starts with no jerk.
    """
    values, rates, accelerations = read(reference)
    still = np.zeros_like(values)
    if before is None:
        return Sample(values, rates, accelerations, still, 0.0)
    age = before.age + dt
    if all(np.array_equal(a, b) for a, b in zip((values, rates, accelerations), _parts(before), strict=True)):
        return Sample(values, rates, accelerations, before.jerks, age)
    foretold = extrapolated(before, np.array([age]))[0][0]
    expected = np.abs(values - foretold).max() < JUMP
    return Sample(
        values, rates, accelerations, (accelerations - before.accelerations) / age if expected else still, 0.0
    )


def _parts(sample: Sample) -> tuple[Array, Array, Array]:
    return sample.values, sample.rates, sample.accelerations


def known(trajectory: Trajectory, times: Array) -> tuple[Array, Array, Array]:
    """Signals and their derivatives (T, signals) of a trajectory at times, s."""
    r = trajectory.at(times)
    columns = (
        [*r.position, r.yaw, *r.joints],
        [*r.velocity, r.yaw_rate, *r.joint_rates],
        [*r.acceleration, r.yaw_acceleration, *r.joint_accelerations],
    )
    shaped = [[np.broadcast_to(np.asarray(c, dtype=float), times.shape) for c in each] for each in columns]
    values, rates, accelerations = (np.stack(each, axis=1) for each in shaped)
    return values, rates, accelerations


def goals(values: Array, rates: Array, accelerations: Array) -> Array:
    """Leaves of a :class:`skyarm.control.laws.predictive.cost.Goal` per instant."""
    return np.concatenate([values[:, :3], rates[:, :3], values[:, 3:], rates[:, 4:], accelerations[:, 4:]], axis=1)
