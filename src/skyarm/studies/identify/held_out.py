"""Prediction of held-out flights: errors of the identified vehicle, of the start vehicle and of holding."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np

from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.quantities import GRAVITY
from skyarm.flight_data.series import attitude_at, middle, values_at
from skyarm.records.arrays import Array
from skyarm.records.immutable import immutable
from skyarm.studies.identify.disturbances import SETTLED, fit_disturbances
from skyarm.studies.identify.identified_numbers import Identified
from skyarm.studies.identify.identified_parts import Surroundings, surroundings_with
from skyarm.studies.identify.logged_commands import time_constants
from skyarm.studies.identify.motion_model import Stretch, predict
from skyarm.studies.identify.open_loop import (
    FORGOTTEN,
    HORIZONS,
    HorizonErrors,
    Poses,
    fit_weights,
    predict_flights,
)
from skyarm.vehicle.vehicle_records import Vehicle

SHORTEST = 0.01
"""s, of a horizon: all others are its multiples, and whole periods of the stretches."""

CURVE = (SHORTEST, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 1.0)
"""s, horizons of a figure; those of a table are among them."""

WINDOW, FEWEST = 0.1, 5
"""s and samples at least, over which the slope of a measured position is taken where no velocity is measured."""

IDENTIFIED, PAST, START, HOLD = "identified", "with past", "start vehicle", "hold"
"""Predictors; with the past, what the commands do not explain is estimated from the flight until then."""

ORDER = (IDENTIFIED, PAST, START, HOLD)
"""Of tables and figures."""

LEARNT = 120.0
"""s, of the flights of the fit at most, that show the noises of disturbances and how much of a prediction counts."""


@immutable
class OneStep:
    """Root mean square errors of the mean accelerations over one period.

    Attributes:
        specific_force: m/s^2. angular_acceleration: rad/s^2; both of the vector's length.
    """

    specific_force: float
    angular_acceleration: float


@immutable
class HeldOut:
    """Errors of predictions of flights that no fit has seen.

    Attributes:
        flights: names.
        period: s, of the one step.
        horizons: s.
        errors: predictor -> errors over each horizon; position, velocity and attitude are NaN if ``has_poses`` is not.
        one_step: predictor -> errors of accelerations; of holding, the spread of what is measured about its mean.
        has_poses: some flight measures position or velocity, and attitude.
        notes: how poses were made, a line each.
    """

    flights: tuple[str, ...]
    period: float
    horizons: tuple[float, ...]
    errors: Mapping[str, Sequence[HorizonErrors]]
    one_step: Mapping[str, OneStep]
    has_poses: bool
    notes: tuple[str, ...]


def predict_held_out(
    found: Identified,
    start: Vehicle,
    flights: Sequence[tuple[FlightData, Sequence[Stretch]]],
    *,
    seen: Sequence[tuple[FlightData, Sequence[Stretch]]] = (),
    known: Mapping[str, float] | None = None,
    horizons: Sequence[float] = CURVE,
    gravity: float = GRAVITY,
) -> HeldOut:
    """Predict flights from their commands by the identified vehicle, by the start vehicle and by holding.

    Where flights of the fit with poses are given, the identified vehicle predicts once more, with the disturbances that
    it estimates from a flight's past, and weighted beside holding as those flights show is best. The start vehicle
    flies with the delays and offsets that were thought of before the fit.

    Args:
        found: identified vehicle and surroundings.
        start: vehicle before.
        flights: with their stretches, of :func:`held_out_period`.
        seen: flights of the fit, with stretches of the same period.
        known: numbers that were given, by name.
        horizons: s.
        gravity: m/s^2.

    Raises:
        ValueError: one line: no stretch is long enough for a prediction.
    """
    before = surroundings_with({**{each.name: each.start for each in found.numbers}, **(known or {})})
    notes, placed, plain = list[str](), list[tuple[Stretch, Poses]](), list[tuple[Stretch, Poses]]()
    for flight, stretches in flights:
        note = no_poses(flight)
        target = plain if note else placed
        target += [(each, level_poses(each) if note else poses_of(flight, each)) for each in stretches]
        notes += [f"{flight.name}: {each}" for each in ([note] if note else _notes_on_poses(flight))]
    if start.n:
        notes.append("The motion of the joints is given as measured; over a few periods its noise is most of an error.")
    pairs = {IDENTIFIED: (found.vehicle, found.surroundings), START: (start, before)}
    errors = dict[str, Sequence[HorizonErrors]]()
    learnt = _learnt(seen) if placed else []
    # all predictors from the same instants on, if there are any after the filter of the disturbances has settled
    long = any(each.seconds > SETTLED + max(horizons) for each, _ in placed)
    after = SETTLED if learnt and long else 0.0
    for name, (vehicle, about) in pairs.items():
        rows = predict_flights(vehicle, about, placed or plain, horizons, gravity, after=after)
        errors[name] = [model for model, _ in rows]
        if name == IDENTIFIED:
            errors[HOLD] = [held for _, held in rows]
    if learnt:
        best = found.vehicle, found.surroundings
        noises = fit_disturbances(*best, learnt, gravity)
        weights = fit_weights(*best, learnt, horizons, gravity, noises)
        rows = predict_flights(*best, placed, horizons, gravity, noises, weights)
        errors[PAST] = [model for model, _ in rows]
    names = tuple(flight.name for flight, _ in flights)
    if not any(each.begins for each in errors[IDENTIFIED]):
        raise ValueError(f"{', '.join(names)}: no stretch is long enough for a prediction")
    every = [_without_run_in(each, start) for _, stretches in flights for each in stretches]
    one_step = {name: one_step_errors(every, *pair) for name, pair in pairs.items()} | {HOLD: spread_of(every)}
    return HeldOut(
        flights=names,
        period=every[0].period,
        horizons=tuple(horizons),
        errors={
            name: errors[name] if placed else [_rate_only(each) for each in errors[name]]
            for name in ORDER
            if name in errors
        },
        one_step=one_step,
        has_poses=bool(placed),
        notes=tuple(notes),
    )


def _learnt(seen: Sequence[tuple[FlightData, Sequence[Stretch]]]) -> list[tuple[Stretch, Poses]]:
    """Stretches and poses of the fit, from all flights in turn, as long as noises and weights need."""
    queues = [[(flight, each) for each in stretches] for flight, stretches in seen if not no_poses(flight)]
    found, seconds = list[tuple[Stretch, Poses]](), 0.0
    while any(queues) and seconds < LEARNT:
        for queue in (each for each in queues if each):
            flight, stretch = queue.pop(0)
            if seconds < LEARNT:
                found.append((stretch, poses_of(flight, stretch)))
                seconds += stretch.seconds
    return found


def _without_run_in(stretch: Stretch, start: Vehicle) -> Stretch:
    """Stretch whose first periods, in which the rotors' speeds are unknown, do not count."""
    lag = float(time_constants(start.rotors).max())
    used = stretch.used & (np.arange(stretch.size) * stretch.period > FORGOTTEN * lag)
    return dataclasses.replace(stretch, used=used)


def held_out_period(period: float) -> float:
    """Period of stretches to predict, s: the shortest horizon, or the largest part of it below that of the fit."""
    return SHORTEST / math.ceil(SHORTEST / period - 1e-9)


def no_poses(flight: FlightData) -> str:
    """Reason for which a flight has no poses; empty if it has."""
    if "quaternion" in flight and ("position" in flight or "velocity" in flight):
        return ""
    missing = "quaternion" if "quaternion" not in flight else "position"
    return f"no {missing} is measured: rate and specific force are predicted, and no pose"


def _notes_on_poses(flight: FlightData) -> list[str]:
    """Notes on poses that are not measured whole."""
    if "velocity" not in flight:
        return [f"the velocity is the slope of the position over {WINDOW:g} s, of begins over the {WINDOW:g} s before"]
    return [] if "position" in flight else ["the position is the sum of the velocity"]


def poses_of(flight: FlightData, stretch: Stretch) -> Poses:
    """Measured poses at the instants of a stretch.

    Between samples they are interpolated. Without a velocity, that is the slope of the position over :data:`WINDOW`
    (local parabola: Savitzky and Golay 1964): around each sample, and for begins before it; without a position, that is
    the sum of the velocity.

    Args:
        flight: with quaternion, and position or velocity.
        stretch: of this flight.

    Raises:
        ValueError: one line: the flight lacks a quantity.
    """
    time: Array = stretch.start + stretch.period * np.arange(stretch.size + 1, dtype=float)
    given = "velocity" in flight
    velocity = values_at(flight["velocity"] if given else _slope(flight["position"]), time)
    known = velocity if given else values_at(_slope(flight["position"], past=True), time)
    if "position" in flight:
        position = values_at(flight["position"], time)
    else:
        steps = middle(velocity) * stretch.period
        position = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    return Poses(
        position=position, quaternion=attitude_at(flight["quaternion"], time), velocity=velocity, known_velocity=known
    )


def level_poses(stretch: Stretch) -> Poses:
    """Poses of a vehicle that rests level, for predictions of which the rates alone count."""
    zero = np.zeros((stretch.size + 1, 3))
    level = np.concatenate([zero[:, :1] + 1.0, zero], axis=1)
    return Poses(position=zero, quaternion=level, velocity=zero, known_velocity=zero)


def _slope(position: Channel, *, past: bool = False) -> Channel:
    """Velocity of a measured position: slopes of parabolas through the samples around each one, or until it."""
    step = float(np.median(np.diff(position.time)))
    time = np.arange(position.time[0], position.time[-1] + 0.5 * step, step)
    rows = values_at(position, time)
    half = max(FEWEST, math.ceil(WINDOW / step)) // 2
    if len(rows) <= 2 * half:
        raise ValueError(f"{position.source}: {len(rows)} samples: must be at least {2 * half + 1}")
    before, after = (2 * half, 0) if past else (half, half)
    places = np.arange(-before, after + 1, dtype=float)
    weights = np.linalg.pinv(np.vander(places, 3))[1] / step
    longer = np.pad(rows, ((before, after), (0, 0)), mode="reflect", reflect_type="odd")
    slopes = np.stack([np.convolve(column, weights[::-1], "valid") for column in longer.T], axis=1)
    return Channel(time=time, values=slopes, source=f"slope of {position.source}")


def one_step_errors(stretches: Sequence[Stretch], vehicle: Vehicle, about: Surroundings) -> OneStep:
    """Errors of the mean accelerations over each period that counts; the motion of the joints is given."""
    pieces = [_accelerations(each) - predict(vehicle, about, each, (False,) * vehicle.n)[:, :6] for each in stretches]
    return _root_mean_square([left[each.used] for left, each in zip(pieces, stretches, strict=True)])


def spread_of(stretches: Sequence[Stretch]) -> OneStep:
    """Standard deviations of the measured accelerations: errors of a prediction by their mean."""
    pieces = [_accelerations(each)[each.used] for each in stretches]
    mean = np.concatenate(pieces).mean(axis=0)
    return _root_mean_square([each - mean for each in pieces])


def _accelerations(stretch: Stretch) -> Array:
    """Measured mean specific force and angular acceleration (N, 6) of each period."""
    return np.concatenate([stretch.specific_force, np.diff(stretch.rate, axis=0) / stretch.period], axis=1)


def _root_mean_square(pieces: Sequence[Array]) -> OneStep:
    squares = (np.concatenate(pieces) ** 2).mean(axis=0)
    force, turning = math.sqrt(float(squares[:3].sum())), math.sqrt(float(squares[3:].sum()))
    return OneStep(specific_force=force, angular_acceleration=turning)


def _rate_only(errors: HorizonErrors) -> HorizonErrors:
    return dataclasses.replace(errors, position=math.nan, velocity=math.nan, attitude=math.nan)


def table_horizons(held_out: HeldOut) -> list[int]:
    """Places of the horizons of a table among those that were predicted."""
    return [k for k, horizon in enumerate(held_out.horizons) if horizon in HORIZONS]
