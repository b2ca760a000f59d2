"""Prediction of a flight from its commands alone, over horizons of parts of a second to seconds.

From a measured state on, the base moves as the vehicle's model says, by the commands that were flown; nothing that was
measured later enters, but the motion of the joints, which is given, and the next sample where states lie between two.
Many begins are followed side by side. The errors are shown beside those of *holding*: the velocity and the rate of the
begin go on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from skyarm.algebra import Quaternion, Vec3
from skyarm.flight_data.quantities import GRAVITY
from skyarm.records.arrays import Array, IntArray
from skyarm.records.immutable import immutable
from skyarm.studies.identify.disturbances import SETTLED, DisturbanceModel, begin_at, unexplained_sums
from skyarm.studies.identify.identified_parts import Surroundings
from skyarm.studies.identify.logged_commands import time_constants
from skyarm.studies.identify.motion_model import Memo, Stretch, base_acceleration
from skyarm.studies.identify.sampled_series import vectors_of
from skyarm.studies.identify.window_fit import scipy_parts
from skyarm.vehicle.vehicle_records import Vehicle

Errors: TypeAlias = tuple[Array, Array, Array, Array]
"""Distances (K,) of positions, velocities, attitudes and rates."""

HORIZONS = (0.01, 0.1, 0.5, 1.0)
"""s, of the reported errors."""

APART = 0.1
"""s from begin to begin."""


@immutable(eq=False)
class Poses:
    """Measured pose and velocity at the instants of a stretch.

    Attributes:
        position: (N + 1, 3) m, world axes. quaternion: (N + 1, 4) w x y z, base to world.
        velocity: (N + 1, 3) m/s, world axes.
        known_velocity: (N + 1, 3) m/s, from what is measured until each instant, which predictions begin with.
    """

    position: Array
    quaternion: Array
    velocity: Array
    known_velocity: Array


@immutable
class HorizonErrors:
    """Root mean square errors of a prediction over one horizon.

    Attributes:
        horizon: s. begins: number of predictions.
        position: m. velocity: m/s. attitude: rad, angle of the rotation between both. rate: rad/s.
    """

    horizon: float
    begins: int
    position: float
    velocity: float
    attitude: float
    rate: float


@immutable(kw_only=False, eq=False)
class BaseStates:
    """States of the base in several predictions at one instant, each (K, ...): as of :class:`Poses`, base rates."""

    position: Array
    quaternion: Array
    velocity: Array
    rate: Array


def predict_ahead(
    vehicle: Vehicle,
    about: Surroundings,
    stretch: Stretch,
    poses: Poses,
    begins: Sequence[int],
    periods: int,
    gravity: float = GRAVITY,
    disturbances: DisturbanceModel | None = None,
) -> list[BaseStates]:
    """BaseStates of the base from measured states on, for a number of periods.

    Args:
        vehicle: rigid bodies and rotors.
        about: delays and offsets.
        stretch: commands, joints and rates.
        poses: measured, at the stretch's instants.
        begins: (K,) numbers of the instants that predictions begin at.
        periods: of the horizon; each begin must have as many after it.
        gravity: m/s^2.
        disturbances: model of what the commands do not explain, estimated from the stretch until each begin.

    Returns:
        States after 0, 1, ... periods.
    """
    now, pushed = _begin(vehicle, about, stretch, poses, np.asarray(begins, dtype=int), gravity, disturbances)
    memo, found = Memo(), [now]
    for k in range(periods):
        beside = np.zeros((len(begins), 6)) if disturbances is None else disturbances.ahead(pushed, stretch.period, k)
        found.append(_next(vehicle, about, stretch, np.asarray(begins) + k, found[-1], beside, memo, gravity))
    return found


def _begin(
    vehicle: Vehicle,
    about: Surroundings,
    stretch: Stretch,
    poses: Poses,
    rows: IntArray,
    gravity: float,
    disturbances: DisturbanceModel | None,
) -> tuple[BaseStates, Array]:
    """States and disturbances (K, 6, 2) at some instants, from what is measured until then."""
    now = BaseStates(poses.position[rows], poses.quaternion[rows], poses.known_velocity[rows], stretch.rate[rows])
    if disturbances is None or not len(rows):
        return now, np.zeros((len(rows), 6, 2))
    sums = unexplained_sums(vehicle, about, stretch, poses, gravity)
    velocity, rate, pushed = begin_at(disturbances, sums, stretch, poses, rows)
    return replace(now, velocity=velocity, rate=rate), pushed


def _next(
    vehicle: Vehicle,
    about: Surroundings,
    stretch: Stretch,
    place: IntArray,
    now: BaseStates,
    beside: Array,
    memo: Memo,
    gravity: float,
) -> BaseStates:
    """States at the ends of periods from those at their begins, by the midpoint rule.

    Args:
        vehicle: rigid bodies and rotors.
        about: delays and offsets.
        stretch: commands and joints.
        place: (K,) numbers of the periods.
        now: at their begins.
        beside: (K, 6) accelerations that the commands do not explain, linear and angular, base axes.
        memo: of this stretch.
        gravity: m/s^2.
    """

    def slopes(at: BaseStates) -> tuple[Array, Array]:
        R = Quaternion(*at.quaternion.T).rotation()
        speed = R.apply_T(Vec3(*at.velocity.T))
        linear, angular = base_acceleration(vehicle, about, stretch, place, Vec3(*at.rate.T), speed, memo)
        force = R.apply(linear + Vec3(*beside[:, :3].T))
        world = vectors_of(force, len(place))
        world[:, 2] -= gravity
        return world, vectors_of(angular, len(place)) + beside[:, 3:]

    middle = _advance(now, *slopes(now), 0.5 * stretch.period)
    return _advance(now, *slopes(middle), stretch.period, middle)


def _advance(
    now: BaseStates, acceleration: Array, turning: Array, seconds: float, middle: BaseStates | None = None
) -> BaseStates:
    """State after some time, at the velocities of the middle if they are known."""
    velocity, rate = (now.velocity, now.rate) if middle is None else (middle.velocity, middle.rate)
    turn = Quaternion.of_rotation_vector(Vec3(*(rate.T * seconds)))
    turned = Quaternion(*now.quaternion.T) * turn
    return BaseStates(
        now.position + velocity * seconds,
        vectors_of(turned.normalized(), len(rate)),
        now.velocity + acceleration * seconds,
        now.rate + turning * seconds,
    )


def hold(stretch: Stretch, poses: Poses, begins: Sequence[int] | IntArray, seconds: float) -> BaseStates:
    """BaseStates of the base whose velocity and rate stay as they are."""
    rows = np.asarray(begins, dtype=int)
    now = BaseStates(poses.position[rows], poses.quaternion[rows], poses.known_velocity[rows], stretch.rate[rows])
    return _advance(now, np.zeros((len(rows), 3)), np.zeros((len(rows), 3)), seconds)


def errors_of(motion: BaseStates, stretch: Stretch, poses: Poses, rows: Sequence[int] | IntArray) -> Errors:
    """Distances (K,) of states from those measured at some instants: position, velocity, attitude (rad), rate."""
    place = np.asarray(rows, dtype=int)
    position, velocity, rate = (
        np.linalg.norm(a - b[place], axis=1)
        for a, b in (
            (motion.position, poses.position),
            (motion.velocity, poses.velocity),
            (motion.rate, stretch.rate),
        )
    )
    same = np.abs((motion.quaternion * poses.quaternion[place]).sum(axis=1))
    return position, velocity, 2.0 * np.arccos(np.minimum(same, 1.0)), rate


FORGOTTEN = 8.0
"""Time constants after a stretch's begin until its rotors' speeds follow from the commands in it."""


def begins_of(stretch: Stretch, periods: int, vehicle: Vehicle, about: Surroundings, after: float = 0.0) -> list[int]:
    """Instants that predictions over some periods begin at: rotor speeds are known there, and every period counts."""
    lag = float(time_constants(vehicle.rotors).max(initial=0.0))
    first = math.ceil(max(after, about.delay + FORGOTTEN * lag) / stretch.period)
    step = max(1, round(APART / stretch.period))
    return [k for k in range(first, stretch.size - periods + 1, step) if stretch.used[k : k + periods].all()]


def mean_errors(pieces: Sequence[Errors], horizon: float) -> HorizonErrors:
    """Root mean squares over the predictions of several stretches."""
    columns = [np.concatenate(each) for each in zip(*pieces, strict=True)] if pieces else [np.zeros(0)] * 4
    squares = [math.sqrt(float((each**2).mean())) if each.size else math.nan for each in columns]
    return HorizonErrors(
        horizon=horizon,
        begins=len(columns[0]),
        position=squares[0],
        velocity=squares[1],
        attitude=squares[2],
        rate=squares[3],
    )


def predict_flights(
    vehicle: Vehicle,
    about: Surroundings,
    flights: Sequence[tuple[Stretch, Poses]],
    horizons: Sequence[float] = HORIZONS,
    gravity: float = GRAVITY,
    disturbances: DisturbanceModel | None = None,
    weights: Sequence[Weights] | None = None,
    after: float = 0.0,
) -> list[tuple[HorizonErrors, HorizonErrors]]:
    """Errors of a vehicle's model and of holding over several horizons (s), on flights that no fit has seen.

    Args:
        vehicle: rigid bodies and rotors.
        about: delays and offsets.
        flights: stretches with the poses measured at their instants.
        horizons: s.
        gravity: m/s^2.
        disturbances: model of what the commands do not explain.
        weights: of the model's prediction over each horizon; the whole of it by default.
        after: s, of each stretch before the first prediction.

    Returns:
        For each horizon the errors of the model, and those of holding; of a horizon below a period those of one.
    """
    model: list[list[Errors]] = [[] for _ in horizons]
    held: list[list[Errors]] = [[] for _ in horizons]
    for stretch, poses in flights:
        for i, each in _ends_of(vehicle, about, stretch, poses, horizons, gravity, disturbances, after).items():
            last = each.model if weights is None else weights[i].mix(each.model, each.held, each.rest)
            model[i].append(errors_of(last, stretch, poses, each.rows))
            held[i].append(errors_of(each.held, stretch, poses, each.rows))
    return [(mean_errors(model[i], horizon), mean_errors(held[i], horizon)) for i, horizon in enumerate(horizons)]


def rotations(first: Array, second: Array) -> Array:
    """Rotation vectors (K, 3), base axes, from attitudes to others, the shorter way."""
    turn = Quaternion(*(first * [1.0, -1.0, -1.0, -1.0]).T) * Quaternion(*second.T)
    rows = vectors_of(turn, len(first))
    rows = rows * np.where(rows[:, :1] < 0.0, -1.0, 1.0)
    size = np.linalg.norm(rows[:, 1:], axis=1, keepdims=True)
    return rows[:, 1:] * np.where(size > 1e-9, 2.0 * np.arctan2(size, rows[:, :1]) / np.maximum(size, 1e-300), 2.0)


@immutable(kw_only=False, eq=False)
class Weights:
    """Shares of a prediction over one horizon, of each axis, in place of which holding stands.

    Attributes:
        position, velocity: (3,) world axes, of what the model's prediction is off holding.
        attitude, rate: (2, 3) base axes, of that, and of what an attitude that stays, without a rate, is off holding.
    """

    position: Array
    velocity: Array
    attitude: Array
    rate: Array

    def mix(self, model: BaseStates, held: BaseStates, rest: BaseStates) -> BaseStates:
        """Weighted prediction of the base's states."""
        off_model, off_rest = (rotations(held.quaternion, each.quaternion) for each in (model, rest))
        turn = Quaternion.of_rotation_vector(Vec3(*(self.attitude[0] * off_model + self.attitude[1] * off_rest).T))
        turned = Quaternion(*held.quaternion.T) * turn
        return BaseStates(
            held.position + self.position * (model.position - held.position),
            vectors_of(turned.normalized(), len(held.rate)),
            held.velocity + self.velocity * (model.velocity - held.velocity),
            held.rate + self.rate[0] * (model.rate - held.rate) - self.rate[1] * held.rate,
        )


def fit_weights(
    vehicle: Vehicle,
    about: Surroundings,
    flights: Sequence[tuple[Stretch, Poses]],
    horizons: Sequence[float] = HORIZONS,
    gravity: float = GRAVITY,
    disturbances: DisturbanceModel | None = None,
) -> list[Weights]:
    """Shares of the model, of holding and of rest with the least error (Bates and Granger 1969), for each horizon.

    A controller keeps a vehicle where a model alone, from a state that is known a little wrong, departs from it; the
    longer the horizon, the less of the model's prediction counts. Flights must be those of the fit, not the predicted.
    All of the model counts over a horizon that no stretch is long enough for.
    """
    parts: list[list[list[tuple[Array, Array]]]] = [[[], [], [], []] for _ in horizons]
    for stretch, poses in flights:
        for i, each in _ends_of(vehicle, about, stretch, poses, horizons, gravity, disturbances).items():
            model, held, rest, rows = each.model, each.held, each.rest, parts[i]
            goals = (model.quaternion, rest.quaternion, poses.quaternion[each.rows])
            turns = [rotations(held.quaternion, goal) for goal in goals]
            rows[0].append((np.stack([model.position - held.position]), poses.position[each.rows] - held.position))
            rows[1].append((np.stack([model.velocity - held.velocity]), poses.velocity[each.rows] - held.velocity))
            rows[2].append((np.stack(turns[:2]), turns[2]))
            rows[3].append((np.stack([model.rate - held.rate, -held.rate]), stretch.rate[each.rows] - held.rate))
    found = []
    for rows in parts:
        if not rows[0]:
            whole = np.stack([np.ones(3), np.zeros(3)])
            found.append(Weights(whole[0], whole[0], whole, whole))
            continue
        position, velocity, attitude, rate = (_shares(each) for each in rows)
        found.append(Weights(position[0], velocity[0], attitude, rate))
    return found


def _shares(rows: Sequence[tuple[Array, Array]]) -> Array:
    """Shares (parts, 3), 0 to 1, of parts (parts, K, 3) whose sum is nearest to the measured (K, 3), of each axis."""
    parts = np.concatenate([each for each, _ in rows], axis=1)
    wanted = np.concatenate([each for _, each in rows])
    scipy_parts()
    from scipy.optimize import lsq_linear

    # over a few samples all parts are within the noise: beyond 0 to 1 they would only fit that
    sizes = np.linalg.norm(parts, axis=1) + 1e-300
    solved = [lsq_linear(parts[:, :, i].T / sizes[:, i], wanted[:, i], (0.0, sizes[:, i])) for i in range(3)]
    return np.stack([each.x / sizes[:, i] for i, each in enumerate(solved)], axis=1)


@immutable(kw_only=False, eq=False)
class Ends:
    """Predictions a horizon after their begins.

    Attributes:
        rows: (K,) numbers of the instants there.
        model, held, rest: states by the model, by holding, and by holding without turning.
    """

    rows: IntArray
    model: BaseStates
    held: BaseStates
    rest: BaseStates


def _ends_of(
    vehicle: Vehicle,
    about: Surroundings,
    stretch: Stretch,
    poses: Poses,
    horizons: Sequence[float],
    gravity: float,
    disturbances: DisturbanceModel | None,
    after: float = 0.0,
) -> dict[int, Ends]:
    """Predictions of a stretch over horizons (s), by their number, in one pass; none for those that nothing begins at.

    A prediction that ends, as a period does not count, is left out of the pass.
    """
    after, h = after if disturbances is None else max(after, SETTLED), stretch.period
    ends = [max(1, round(horizon / h)) for horizon in horizons]
    last = max((end for end in ends if begins_of(stretch, end, vehicle, about, after)), default=0)
    rows = np.asarray(begins_of(stretch, 1, vehicle, about, after), dtype=int)
    now, pushed = _begin(vehicle, about, stretch, poses, rows, gravity, disturbances)
    memo, found = Memo(), dict[int, Ends]()
    for k in range(last):
        inside = (rows + k < stretch.size) & stretch.used[np.minimum(rows + k, stretch.size - 1)]
        rows, pushed = rows[inside], pushed[inside]
        now = BaseStates(now.position[inside], now.quaternion[inside], now.velocity[inside], now.rate[inside])
        beside = np.zeros((len(rows), 6)) if disturbances is None else disturbances.ahead(pushed, h, k)
        now = _next(vehicle, about, stretch, rows + k, now, beside, memo, gravity)
        for i in (i for i, end in enumerate(ends) if end == k + 1):
            held = hold(stretch, poses, rows, (k + 1) * h)
            rest = replace(held, quaternion=poses.quaternion[rows], rate=0.0 * held.rate)
            found[i] = Ends(rows + k + 1, now, held, rest)
    return found
