"""Prediction of a flight from its commands alone, over horizons of parts of a second to seconds.

From a measured state on, the base moves as the vehicle's model says, by the commands that were flown; nothing that was
measured later enters, but the motion of the joints, which is given. Many begins are followed side by side. The errors
are shown beside those of *holding*: the velocity and the rate of the begin go on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Quaternion, Vec3
from skyarm.studies.identify.motion_model import Memo, Stretch, Surroundings, base_acceleration
from skyarm.vehicle.vehicle_records import Vehicle

Array: TypeAlias = npt.NDArray[np.float64]

HORIZONS = (0.01, 0.1, 0.5, 1.0)
"""s, of the reported errors."""

APART = 0.1
"""s from begin to begin."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Poses:
    """Measured pose and velocity at the instants of a stretch.

    Attributes:
        position: (N + 1, 3) m, world axes. quaternion: (N + 1, 4) w x y z, base to world.
        velocity: (N + 1, 3) m/s, world axes.
    """

    position: Array
    quaternion: Array
    velocity: Array


@dataclass(frozen=True, kw_only=True, slots=True)
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


@dataclass(frozen=True, slots=True, eq=False)
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
    gravity: float = 9.81,
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

    Returns:
        States after 0, 1, ... periods.
    """
    memo, h = Memo(), stretch.period
    rows = np.asarray(begins, dtype=int)
    now = BaseStates(poses.position[rows], poses.quaternion[rows], poses.velocity[rows], stretch.rate[rows])
    found = [now]
    for k in range(periods):

        def slopes(at: BaseStates, place: npt.NDArray[np.int_]) -> tuple[Array, Array]:
            R = Quaternion(*at.quaternion.T).rotation()
            speed = R.apply_T(Vec3(*at.velocity.T))
            linear, angular = base_acceleration(vehicle, about, stretch, place, Vec3(*at.rate.T), speed, memo)
            world = np.stack([each + np.zeros(len(place)) for each in R.apply(linear)], axis=1)
            world[:, 2] -= gravity
            return world, np.stack([each + np.zeros(len(place)) for each in angular], axis=1)

        first = slopes(now, rows + k)
        middle = _advance(now, *first, 0.5 * h)
        now = _advance(now, *slopes(middle, rows + k), h, middle)
        found.append(now)
    return found


def _advance(
    now: BaseStates, acceleration: Array, turning: Array, seconds: float, middle: BaseStates | None = None
) -> BaseStates:
    """State after some time, at the velocities of the middle if they are known."""
    velocity, rate = (now.velocity, now.rate) if middle is None else (middle.velocity, middle.rate)
    turn = Quaternion.of_rotation_vector(Vec3(*(rate.T * seconds)))
    turned = Quaternion(*now.quaternion.T) * turn
    return BaseStates(
        now.position + velocity * seconds,
        np.stack([each + np.zeros(len(rate)) for each in turned.normalized()], axis=1),
        now.velocity + acceleration * seconds,
        now.rate + turning * seconds,
    )


def hold(stretch: Stretch, poses: Poses, begins: Sequence[int], seconds: float) -> BaseStates:
    """BaseStates of the base whose velocity and rate stay as they are."""
    rows = np.asarray(begins, dtype=int)
    now = BaseStates(poses.position[rows], poses.quaternion[rows], poses.velocity[rows], stretch.rate[rows])
    return _advance(now, np.zeros((len(rows), 3)), np.zeros((len(rows), 3)), seconds)


def errors_of(
    motion: BaseStates, stretch: Stretch, poses: Poses, rows: Sequence[int]
) -> tuple[Array, Array, Array, Array]:
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


def begins_of(stretch: Stretch, periods: int, vehicle: Vehicle, about: Surroundings) -> list[int]:
    """Instants that predictions over some periods begin at: rotor speeds are known there, and every period counts."""
    lags = [float(lag) for each in vehicle.rotors for lag in (each.time_constant_up, each.time_constant_down)]
    first = math.ceil((about.delay + FORGOTTEN * max(lags, default=0.0)) / stretch.period)
    step = max(1, round(APART / stretch.period))
    return [k for k in range(first, stretch.size - periods + 1, step) if stretch.used[k : k + periods].all()]


def mean_errors(pieces: Sequence[tuple[Array, Array, Array, Array]], horizon: float) -> HorizonErrors:
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
    gravity: float = 9.81,
) -> list[tuple[HorizonErrors, HorizonErrors]]:
    """Errors of a vehicle's model and of holding over several horizons (s), on flights that no fit has seen.

    Returns:
        For each horizon the errors of the model, and those of holding; of a horizon below a period those of one.
    """
    found = []
    for horizon in horizons:
        model, held = [], []
        for stretch, poses in flights:
            periods = max(1, round(horizon / stretch.period))
            begins = begins_of(stretch, periods, vehicle, about)
            if not begins:
                continue
            ends = [k + periods for k in begins]
            last = predict_ahead(vehicle, about, stretch, poses, begins, periods, gravity)[-1]
            model.append(errors_of(last, stretch, poses, ends))
            held.append(errors_of(hold(stretch, poses, begins, periods * stretch.period), stretch, poses, ends))
        found.append((mean_errors(model, horizon), mean_errors(held, horizon)))
    return found
