"""Reference over the prediction horizon by extrapolation of samples, and the base offset under tilt.

The base shifts so that the tip is where a level base would carry it although rotors must lean to push. The arm takes
back what its joints can of the lean: those next to the base turn against it. The base takes the rest: the whole of the
tip's displacement for a lean about an axis about which no joint turns.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import partial

import numpy as np

from skyarm.algebra import ZERO3_DATA, Mat3, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import cos, sin
from skyarm.control.blocks.geometric import desired_attitude
from skyarm.control.laws.predictive.cost import given_way
from skyarm.control.laws.predictive.solver import Compiled
from skyarm.control.model import Model
from skyarm.dynamics import frame_pose
from skyarm.records.arrays import Array
from skyarm.records.immutable import immutable
from skyarm.reference import Reference
from skyarm.reference.preview import samples
from skyarm.vehicle import Vehicle

JUMP = 0.02
"""Difference (m or rad) between a reference sample and its prediction above which a new motion begins."""

KEPT = 0.2
"""Time constant (s) of the estimate of each signal's oscillation frequency."""

TINY = 1e-12
"""Sum of squared accelerations ((m/s^2)^2) below which a signal has no oscillation frequency."""

SLOW = 1e-3
"""Phase (rad) of an oscillation below which a constant jerk is exact to all digits that count."""

SETTLED = 2
"""Number of predicted samples in a row after which the change of the jerk is used."""


@immutable(kw_only=False)
class SampledReference:
    """Last reference sample [x, y, z, yaw, joints ...], its age, third derivatives, and statistics of its oscillation.

    Attributes:
        motion: (3, signals) values, rates, accelerations. jerks: (signals,). age: s.
        pull, weight: sums of -a d2a/dt2 and of a^2 of the accelerations so far, older ones forgotten; their quotient
            is the squared angular frequency of the swing that fits best, 1/s^2.
        foretold: samples in a row, this one included, that came when predicted by the last one.
        secants, gap: mean jerks since the sample before and the time since then, s.
    """

    motion: Array
    jerks: Array
    age: float
    pull: Array
    weight: Array
    foretold: int = 0
    secants: Array | None = None
    gap: float = 0.0

    @property
    def stiffness(self) -> Array:
        """Squared angular frequency of each signal's oscillation, 1/s^2; 0 if it does not oscillate."""
        return np.asarray(np.maximum(self.pull, 0.0) / np.maximum(self.weight, TINY))


def extrapolate(sample: SampledReference, ahead: Array) -> Array:
    """Signals with two derivatives (3, T, signals), extrapolated to ``ahead`` (T,) s after the sample.

    The acceleration goes on as the solution of d2a/dt2 = -k a from the sample's acceleration and jerk, k the signal's
    stiffness: a swing is predicted as a swing, and what does not swing (k = 0) at a constant jerk. A cubic alone is
    wrong by the whole amplitude after a third of a swing.
    """
    t = ahead[:, None]
    (x, v, a), j = sample.motion, sample.jerks
    # integrals of cos(w t) and sin(w t) / w, each divided by what it is at w = 0
    s1, s2, s3, c = _shares(np.sqrt(sample.stiffness) * t)
    values = x + t * (v + t * (a * s2 / 2.0 + t * (j * s3) / 6.0))
    return np.stack([values, v + t * (a * s1 + t * (j * s2) / 2.0), a * c + t * (j * s1)])


def _shares(angle: Array) -> tuple[Array, Array, Array, Array]:
    """Functions sin(x) / x, 2 (1 - cos(x)) / x^2, 6 (x - sin(x)) / x^3 and cos(x), all 1 at 0."""
    still = angle < SLOW
    x = np.where(still, 1.0, angle)
    sine, cosine = np.sin(x), np.cos(x)
    shares = (sine / x, 2.0 * (1.0 - cosine) / x**2, 6.0 * (x - sine) / x**3, cosine)
    return tuple(np.where(still, 1.0, share) for share in shares)  # type: ignore[return-value]


def update_sample(reference: Reference, before: SampledReference | None, dt: float) -> SampledReference:
    """Last reference sample and its age after ``dt`` seconds, with jerks from two successive samples' accelerations.

    A sample has come when it differs; one that came where none was predicted starts with no jerk.
    """
    motion = np.array(samples(reference), dtype=float).T
    still = np.zeros(motion.shape[1])
    first = SampledReference(motion, still, 0.0, still, still)
    if before is None:
        return first
    age = before.age + dt
    if np.array_equal(motion, before.motion):
        return dataclasses.replace(before, age=age)
    # a number that is not finite was not predicted either
    if not np.abs(motion[0] - extrapolate(before, np.array([age]))[0, 0]).max() < JUMP:
        return first
    accelerations, last = motion[2], before.motion[2]
    jerks = (accelerations - last) / age
    pull, weight, foretold = before.pull, before.weight, before.foretold + 1
    if foretold > SETTLED and before.secants is not None:
        # the second derivative of the acceleration, at the sample before
        bend = (jerks - before.secants) / (0.5 * (age + before.gap))
        decay = np.exp(-age / KEPT)
        pull = decay * pull - bend * last
        weight = decay * weight + last**2
    sample = SampledReference(motion, jerks, 0.0, pull, weight, foretold, jerks, age)
    # from the mean jerk since the last sample to that of the swing now; the same where nothing swings
    s1, _, _, c = _shares(np.sqrt(sample.stiffness) * age)
    return dataclasses.replace(sample, jerks=(accelerations * c - last) / (age * s1))


def goals(motion: Array, shift: Array) -> Array:
    """Reference array of the horizon, one row per instant with the fields of :class:`StageGoal`.

    Args:
        motion: (3, T, signals) signals with two derivatives.
        shift: (T, 3) of the base, m.
    """
    values, rates, accelerations = motion
    parts = values[:, :3], rates[:, :3], values[:, 3:], rates[:, 4:], accelerations[:, 4:], shift
    return np.concatenate(parts, axis=1)


def shift(vehicle: Vehicle, thrust: Vec3, yaw: Scalar, joints: Scalars) -> Vec3:
    """Base offset (m, world axes) that keeps the tip in place while the base tilts to a thrust direction.

    Args:
        vehicle: vehicle with a tip.
        thrust: direction in which the rotors must push, world axes.
        yaw: rad.
        joints: positions, which give the tip's place under a level base.
    """
    frame = vehicle.frame(vehicle.end_effector)
    leaning = desired_attitude(-thrust, yaw, Mat3.identity())
    up = leaning.apply_T(Vec3(0, 0, 1))
    arm = frame_pose(vehicle, frame, joints).p
    bent = frame_pose(vehicle, frame, given_way(vehicle, joints, Vec3(up.y, -up.x, 0))).p
    c, s = cos(yaw), sin(yaw)
    return Vec3(c * arm.x - s * arm.y, s * arm.x + c * arm.y, arm.z) - leaning.apply(bent)


def make_stance(model: Model, mode: str) -> Callable[[Array, Array], Array]:
    """Compiled function that gives the base offsets (:func:`shift`) for several thrusts and reference signals.

    None in mode "joints" and without a tip.
    """
    vehicle = model.vehicle
    if mode != "tool" or not vehicle.end_effector:
        return lambda _thrusts, values: np.zeros((len(values), 3))
    compiled = Compiled(partial(shift, vehicle), ZERO3_DATA, 0.0, (0.0,) * vehicle.n)
    return lambda thrusts, values: compiled(thrusts, values[:, 3:])
