"""Reference over the prediction horizon by extrapolation of samples, and the base
offset under tilt.

The base shifts so that the tip is where a level base would carry it although rotors
must lean to push. The arm takes back what its joints can of the lean: those next to the
base turn against it. The base takes the rest: the whole of the tip's displacement for a
lean about an axis about which no joint turns.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import field, replace
from functools import partial

import numpy as np

from skyarm.algebra import E_Z, ZERO3_DATA, Mat3, Scalar, Scalars, Vec3
from skyarm.algebra.frames import unit_rows
from skyarm.control.blocks.geometric import desired_attitude
from skyarm.control.laws.predictive.cost import given_way
from skyarm.control.laws.predictive.solver import Compiled
from skyarm.control.model import Model
from skyarm.dynamics import frame_pose
from skyarm.records.arrays import Array, IntArray, doubles
from skyarm.records.immutable import positional
from skyarm.reference import Reference
from skyarm.reference.preview import samples, samples_ahead
from skyarm.vehicle import Vehicle

JUMP = 0.02
"""Difference (m or rad) between a reference sample and its prediction above which a new
motion begins; chosen."""

KEPT = 0.2
"""Time constant (s) of the estimate of each signal's oscillation frequency; chosen, a
fifth of a swing at 1 Hz."""

TINY = 1e-12
"""Sum of squared accelerations ((m/s^2)^2) below which a signal has no oscillation
frequency."""

SLOW = 1e-3
"""Phase (rad) of an oscillation below which a constant jerk is exact to all digits that
count."""

SETTLED = 2
"""Number of predicted samples in a row after which the change of the jerk is used."""


@positional
class SampledReference:
    """Last reference sample [x, y, z, yaw, joints ...], its age, third derivatives, and
    statistics of its oscillation.

    With it go the samples of a preview, if there is one.

    Attributes:
        motion: (3, signals) values, rates, accelerations. jerks: (signals,). age: s.
        pull, weight: sums of -a d2a/dt2 and of a^2 of the accelerations so far, older
            ones forgotten; their quotient is the squared angular frequency of the swing
            that fits best, 1/s^2.
        predicted: samples in a row, this one included, that came when predicted by the
            last one.
        secants, gap: mean jerks since the sample before and the time since then, s.
        coming: (3, T, signals) this sample and those of the preview. turning: (2, T,
            4 + rotors) planned quaternion and rotor speeds with their derivatives. Both
            empty without a preview.
    """

    motion: Array
    jerks: Array
    age: float
    pull: Array
    weight: Array
    predicted: int = 0
    secants: Array | None = None
    gap: float = 0.0
    coming: Array = field(default_factory=partial(np.zeros, (3, 0, 0)))
    turning: Array = field(default_factory=partial(np.zeros, (2, 0, 0)))

    @property
    def stiffness(self) -> Array:
        """Squared angular frequency of each signal's oscillation, 1/s^2; 0 if it does
        not oscillate.
        """
        return np.maximum(self.pull, 0.0) / np.maximum(self.weight, TINY)


def extrapolate(sample: SampledReference, ahead: Array) -> Array:
    """Signals with two derivatives (3, T, signals), extrapolated to ``ahead`` (T,) s
    after the sample.

    The acceleration goes on as the solution of d2a/dt2 = -k a from the sample's
    acceleration and jerk, k the signal's stiffness: a swing is predicted as a swing,
    and what does not swing (k = 0) at a constant jerk. A cubic alone is wrong by the
    whole amplitude after a third of a swing.
    """
    t = ahead[:, None]
    (x, v, a), j = sample.motion, sample.jerks
    # integrals of cos(w t) and sin(w t) / w, each divided by what it is at w = 0
    s1, s2, s3, c = _shares(np.sqrt(sample.stiffness) * t)
    values = x + t * (v + t * (a * s2 / 2.0 + t * (j * s3) / 6.0))
    return np.stack(
        [values, v + t * (a * s1 + t * (j * s2) / 2.0), a * c + t * (j * s1)]
    )


def _shares(angle: Array) -> tuple[Array, Array, Array, Array]:
    """Functions sin(x) / x, 2 (1 - cos(x)) / x^2, 6 (x - sin(x)) / x^3 and cos(x), all
    1 at 0.
    """
    still = angle < SLOW
    # no division by a phase near zero, where all shares are 1
    x = np.where(still, 1.0, angle)
    sine, cosine = np.sin(x), np.cos(x)
    shares = (sine / x, 2.0 * (1.0 - cosine) / x**2, 6.0 * (x - sine) / x**3, cosine)
    return tuple(np.where(still, 1.0, share) for share in shares)  # type: ignore[return-value]


def update_sample(
    reference: Reference, before: SampledReference | None, dt: float
) -> SampledReference:
    """Last reference sample and its age after ``dt`` seconds, with jerks from two
    successive samples' accelerations.

    A sample has come when it differs; one that came where none was predicted starts
    with no jerk.
    """
    motion = doubles(samples(reference)).T
    still = np.zeros(motion.shape[1])
    first = SampledReference(motion, still, 0.0, still, still)
    if reference.ahead:
        rows = [samples(reference), *samples_ahead(reference)]
        coming = doubles(rows).transpose(2, 0, 1)
        turning = (
            doubles(reference.turning).reshape(len(rows), 2, -1).transpose(1, 0, 2)
        )
        first = replace(first, coming=coming, turning=turning)
    if before is None:
        return first
    age = before.age + dt
    # a motion that begins later is seen in the preview alone
    if np.array_equal(motion, before.motion) and np.array_equal(
        first.coming, before.coming
    ):
        return replace(before, age=age)
    # a number that is not finite was not predicted either
    if not np.abs(motion[0] - extrapolate(before, np.array([age]))[0, 0]).max() < JUMP:
        return first
    accelerations, last = motion[2], before.motion[2]
    jerks = (accelerations - last) / age
    pull, weight, predicted = before.pull, before.weight, before.predicted + 1
    if predicted > SETTLED and before.secants is not None:
        # the second derivative of the acceleration, at the sample before
        bend = (jerks - before.secants) / (0.5 * (age + before.gap))
        decay = np.exp(-age / KEPT)
        # least squares of bend = -k last, older samples forgotten
        pull = decay * pull - bend * last
        weight = decay * weight + last**2
    sample = SampledReference(
        motion,
        jerks,
        0.0,
        pull,
        weight,
        predicted,
        jerks,
        age,
        first.coming,
        first.turning,
    )
    # from the mean jerk since the last sample to that of the swing now; the same where
    # nothing swings
    s1, _, _, c = _shares(np.sqrt(sample.stiffness) * age)
    return replace(sample, jerks=(accelerations * c - last) / (age * s1))


def planned_motion(
    sample: SampledReference, leads: Array, ahead: Array
) -> tuple[Array, Array]:
    """Signals with two derivatives (3, T, signals) and goals of the planned state (T,
    7 + rotors).

    Args:
        sample: with the preview of a plan.
        leads: times of its samples after the held one, s.
        ahead: (T,) times after the held sample, s.

    Between two samples a polynomial of degree 5 meets values and derivatives of both;
    that of quaternion and rotor speeds is of degree 3. After the last sample, values
    and rates stay those of that sample, and accelerations between two such times are
    zero.
    """
    knots = np.append(0.0, leads)
    at = np.clip(ahead, 0.0, knots[-1])
    k = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(leads) - 1)
    motion = _spline_at(sample.coming, knots, k, at)
    turning = _spline_at(sample.turning, knots, k, at)
    q = unit_rows(turning[0, :, :4])
    w, a, b, c = q.T
    # 2 conj(q) dq/dt is the body's rate
    left = 2.0 * np.stack([[-a, w, c, -b], [-b, -c, w, a], [-c, b, -a, w]]).transpose(
        2, 0, 1
    )
    rate = np.einsum("tij,tj->ti", left, turning[1, :, :4])
    # what a stage holds constant is the mean of what the plan does in it
    dt = np.maximum(np.diff(ahead), 1e-9)[:, None]
    spins = np.diff(turning[0, :, 4:], axis=0) / dt
    motion[2, :-1] = np.diff(motion[1], axis=0) / dt
    return motion, np.hstack([q, rate, np.vstack([spins, spins[-1:]])])


def _spline_at(samples: Array, knots: Array, k: IntArray, at: Array) -> Array:
    """Hermite interpolation (derivatives, T, signals) of samples (derivatives, knots,
    signals) at times in intervals k.

    Source: Hermite 1878 (the polynomial that meets values and derivatives at both
    ends).
    """
    orders = range(len(samples))
    h = (knots[k + 1] - knots[k])[:, None]
    s = (at - knots[k])[:, None] / h
    # derivatives in units of the interval, so that one matrix serves intervals of any
    # length
    ends = np.stack([samples[d, side] * h**d for side in (k, k + 1) for d in orders])
    c = np.tensordot(HERMITE[len(samples)], ends, 1)
    powers = [
        [math.perm(i, d) * s ** max(i - d, 0) for i in range(len(c))] for d in orders
    ]
    return np.stack(
        [
            sum(map(np.multiply, c, row), np.zeros_like(c[0])) / h**d
            for d, row in zip(orders, powers, strict=True)
        ]
    )


def _hermite(orders: int) -> Array:
    """Matrix (2 n, 2 n) from values and derivatives at 0, then at 1, to the
    coefficients of their polynomial.
    """
    rows = [(at, d) for at in (0.0, 1.0) for d in range(orders)]
    # d-th derivative of t^i; perm is 0 where there is none, whatever the power
    powers = [
        [math.perm(i, d) * at ** max(i - d, 0) for i in range(2 * orders)]
        for at, d in rows
    ]
    return doubles(np.linalg.inv(powers))


HERMITE = {orders: _hermite(orders) for orders in (2, 3)}
"""Hermite matrices of interpolation by values and one, or two, derivatives."""


def goals(motion: Array, shift: Array) -> Array:
    """Reference array of the horizon, one row per instant with the fields of
    :class:`StageGoal`.

    Args:
        motion: (3, T, signals) signals with two derivatives.
        shift: (T, 3) of the base, m.
    """
    values, rates, accelerations = motion
    # a stage's goal has the heading, and no rates of it
    parts = (
        values[:, :3],
        rates[:, :3],
        values[:, 3:],
        rates[:, 4:],
        accelerations[:, 4:],
        shift,
    )
    return np.concatenate(parts, axis=1)


def shift(vehicle: Vehicle, thrust: Vec3, yaw: Scalar, joints: Scalars) -> Vec3:
    """Base offset (m, world axes) that keeps the tip in place while the base tilts to a
    thrust direction.

    Args:
        vehicle: vehicle with a tip.
        thrust: direction in which the rotors must push, world axes.
        yaw: rad.
        joints: positions, which give the tip's place under a level base.
    """
    frame = vehicle.frame()
    leaning = desired_attitude(-thrust, yaw, Mat3.identity())
    up = leaning.apply_T(E_Z)
    arm = frame_pose(vehicle, frame, joints).p
    # (up.y, -up.x, 0) is up x e_z, the axis of the lean times its sine
    bent = frame_pose(
        vehicle, frame, given_way(vehicle, joints, Vec3(up.y, -up.x, 0))
    ).p
    return arm.about_z(yaw) - leaning.apply(bent)


def make_stance(model: Model, mode: str) -> Callable[[Array, Array], Array]:
    """Compiled function that gives the base offsets (:func:`shift`) for several thrusts
    and reference signals.

    None in mode "joints" and without a tip.
    """
    vehicle = model.vehicle
    if mode != "tool" or not vehicle.end_effector:
        return lambda _thrusts, values: np.zeros((len(values), 3))
    compiled = Compiled(partial(shift, vehicle), ZERO3_DATA, 0.0, vehicle.zeros)
    # behind the place: heading and joints
    return lambda thrusts, values: compiled(thrusts, values[:, 3:])
