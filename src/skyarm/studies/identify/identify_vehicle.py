"""Vehicle parameters from measured flights, each with a 95 % interval, or with the words *not in this data*."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from skyarm.records.arrays import Array, Mask
from skyarm.records.immutable import immutable
from skyarm.studies.identify.accelerometer_lag import accelerometer_lag
from skyarm.studies.identify.identified_numbers import (
    LAGS,
    NOT_SHOWN,
    Identified,
    IdentifiedNumber,
    Scale,
    at_starts,
    bound_number,
    condition_on_start,
    identified_numbers,
    scale_of,
    unresolved_friction,
    with_reasons,
)
from skyarm.studies.identify.identified_parts import Surroundings, surroundings_with, vehicle_with
from skyarm.studies.identify.motion_model import Memo, Stretch, predict, prediction_errors
from skyarm.studies.identify.prediction_error import PredictedErrors, PredictionFit, bridge_unused, fit_prediction
from skyarm.studies.identify.unknowns import (
    ACCELEROMETER,
    THRUST,
    Reported,
    Unknown,
    reported_of,
    require_searched,
    unknowns_of,
    with_servos,
)
from skyarm.vehicle.vehicle_records import Vehicle

if TYPE_CHECKING:
    pass


BLOCK = 2.0
"""s, of a block of scores: noise of measured rates, integrated in a joint's prediction, stays for longer than 0.5 s."""

RATES = (3, 4, 5)
"""Rows of the base's rates: trim torques differ from flight to flight, by the battery's place and by propellers."""

UNEVEN = 0.01
"""Of a period: what the periods of flights may be off each other; clocks of files differ."""

LEAST = 160
"""Periods of the shortest stretch: 20 orders of the whitening filter."""


def identify_vehicle(
    stretches: Sequence[Stretch],
    start: Vehicle,
    *,
    curve: bool = False,
    velocity: bool | None = None,
    known: Mapping[str, float] | None = None,
    drag_height: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Identified:
    """Identify the parameters of a vehicle from measured flights.

    Args:
        stretches: of the flights; those below 160 periods do not count.
        start: vehicle with what is known before: data sheet, drawing.
        curve: find a thrust curve of its own in place of the start's times a factor.
        velocity: whether the stretches hold it; by default, if it is not 0.
        known: numbers that are not searched, by name.
        drag_height: the rotors' hub drag acts at a height of its own, which is then identified beside the centre of
            mass; needs the velocity.
        progress: called with one line a step of the search.

    Raises:
        ValueError: one line: flights that do not fit the vehicle, or nothing to identify, or SciPy is missing.
    """
    stretches = long_stretches(stretches)
    search = search_of(stretches, start, curve=curve, velocity=velocity, known=known, drag_height=drag_height)
    search = _from_accelerometer_lag(search, stretches)
    found = fit_prediction(
        search.errors, search.begin, search.prior, search.steps, search.block, search.used, progress, RATES
    )
    scale = search.scale(found)
    period, sample = stretches[0].period, stretches[0].period / stretches[0].samples
    free, correlation = identified_numbers(found, scale, period, sample, [each.name for each in stretches])
    numbers = [bound_number(each, of.least) for each, of in zip(free, scale.reported, strict=True)]
    inside = {each.name for each in search.unknowns if each.in_vehicle}
    of_vehicle = [any(part in inside for part in each.parts) for each in scale.reported]
    # of a number of the vehicle and one around it that look alike, it is the vehicle that stays as it was
    groups = [[i for i, each in enumerate(of_vehicle) if each is first] for first in (True, False)]
    # what physics excludes is not in the data either, whatever its share
    blurred = unresolved_friction({each.name: each for each in numbers}, search.start.links, _rate_noise(stretches))
    unseen = unseen_lags(stretches)
    blurred |= unseen
    numbers = [replace(each, reason=NOT_SHOWN) if each.name in blurred else each for each in numbers]
    excluded = [a.is_known and not b.is_known for a, b in zip(free, numbers, strict=True)]
    shares = np.array([0.0 if out else each.data_share for out, each in zip(excluded, numbers, strict=True)])
    # time constants go back even where they show beside others; the dead time then stands for all that is late
    shares[[each.name in unseen - {"delay"} for each in numbers]] = -math.inf
    told = condition_on_start(found.values, found.curvature, scale.rows, scale.off, scale.before, shares, groups)
    driven = search.driven
    rows = ["specific_force.x", "specific_force.y", "specific_force.z", "rate.x", "rate.y", "rate.z"]
    rows += [f"{link.joint.name}.rate" for link, moves in zip(start.links, driven, strict=True) if moves]
    rows += [f"{link.joint.name}.position" for link, moves in zip(start.links, search.servoed, strict=True) if moves]
    plain = at_starts(search.numbers(told.values), scale, told.replaced, [each.name for each in search.unknowns])
    return Identified(
        numbers=with_reasons(numbers, told.beside),
        correlation=correlation,
        vehicle=vehicle_with(search.start, plain, checked=True),
        surroundings=surroundings_with(plain),
        explained=dict(zip(rows, _explained_shares(found, stretches, driven, search.servoed).tolist(), strict=True)),
        deviation=dict(zip(rows, found.noise.scales.tolist(), strict=True)),
        settled=found.settled,
        seconds=sum(float(each.used.sum()) * each.period for each in stretches),
        searched=plain,
        period=stretches[0].period,
    )


def unseen_lags(stretches: Sequence[Stretch]) -> set[str]:
    """Names of lags and delays that commands logged at a low rate cannot show."""
    return set(LAGS) if any(each.slow for each in stretches) else set()


def _rate_noise(stretches: Sequence[Stretch]) -> list[float]:
    """Largest noise (n,) of the joints' mean rates, rad/s or m/s; 0 where it is not known."""
    known = [each.rate_noise.tolist() for each in stretches if each.rate_noise.size]
    return [max(each) for each in zip(*known, strict=True)] if known else [0.0] * stretches[0].joints.shape[1]


@immutable(kw_only=False, eq=False)
class Search:
    """Numbers that flights may show, and the errors of the model's prediction as a function of them.

    Attributes:
        unknowns: searched numbers, P of them. reported: numbers that an estimate of them gives.
        known: numbers that are not searched, by name. driven: of each joint, whether its torque is commanded.
        servoed: of each joint, whether a position servo moves it. start: vehicle, with a servo on each of these.
        errors: searched values (P,) -> of each stretch (N, rows).
        block: periods of a block of scores. used: of each stretch (N,), which periods count.
    """

    unknowns: Sequence[Unknown]
    reported: Sequence[Reported]
    known: Mapping[str, float]
    driven: Sequence[bool]
    servoed: Sequence[bool]
    start: Vehicle
    errors: PredictedErrors
    block: int
    used: Sequence[Mask]

    @property
    def begin(self) -> Array:
        """Values (P,) of the start vehicle, on the scale of the search."""
        return np.array([each.begin for each in self.unknowns])

    @property
    def prior(self) -> Array:
        """Standard deviations (P,) of what is known before."""
        return np.array([each.spread for each in self.unknowns])

    @property
    def steps(self) -> Array:
        """Differences (P,) for slopes."""
        return np.array([each.step for each in self.unknowns])

    def scale(self, found: PredictionFit) -> Scale:
        """Reported numbers at an estimate."""
        return scale_of(found, self.unknowns, self.reported, self.known)

    def numbers(self, searched: Array) -> dict[str, float]:
        """Numbers by name from searched values (P,), with those that are not searched."""
        return _numbers_of(self.unknowns, self.known, searched)


def search_of(
    stretches: Sequence[Stretch],
    start: Vehicle,
    *,
    curve: bool = False,
    driven: Sequence[bool] | None = None,
    velocity: bool | None = None,
    voltage: bool | None = None,
    known: Mapping[str, float] | None = None,
    drag_height: bool = False,
) -> Search:
    """Search for the numbers of a vehicle in measured flights.

    A position servo moves each joint of which the stretches hold any setpoint and no torque; a joint without a drive
    gets one of moderate gains to begin with.

    Args:
        stretches: of the flights.
        start: vehicle with what is known before.
        curve: find a thrust curve of its own.
        driven: of each joint, whether its torque is commanded; by default, if the stretches hold any torque of it.
        velocity: whether the stretches hold it; by default, if it is not 0.
        voltage: whether the stretches hold it; by default, if it varies.
        known: numbers that are not searched, by name.
        drag_height: the rotors' hub drag acts at a height of its own.

    Raises:
        ValueError: one line: flights that do not fit the vehicle, or nothing to identify.
    """
    stretches = long_stretches(stretches)
    _check(stretches, start)
    moved = [any(bool(np.any(each.efforts[:, i])) for each in stretches) for i in range(start.n)]
    driven = moved if driven is None else driven
    setpoints = [any(bool(np.any(each.setpoints[:, i])) for each in stretches) for i in range(start.n)]
    servoed = [given and not torque for given, torque in zip(setpoints, driven, strict=True)]
    start = with_servos(start, servoed)
    if velocity is None:
        velocity = any(bool(np.any(each.velocity)) for each in stretches)
    if voltage is None:
        voltage = any(bool(np.ptp(each.voltage) > 0.0) for each in stretches)
    fixed = dict(known or {})
    every = unknowns_of(
        start,
        curve=curve,
        velocity=velocity,
        voltage=voltage,
        driven=driven,
        servoed=servoed,
        drag_height=drag_height,
        others=list(dict.fromkeys(each.name for each in stretches if each.name != stretches[0].name)),
    )
    require_searched(fixed, every)
    unknowns = [each for each in every if each.name not in fixed]
    memos = [Memo() for _ in stretches]

    def candidate(searched: Array) -> tuple[Vehicle, Surroundings]:
        numbers = _numbers_of(unknowns, fixed, searched)
        return vehicle_with(start, numbers), surroundings_with(numbers)

    def prepare(every: Sequence[Array]) -> None:
        if any(servoed):
            candidates = [candidate(each) for each in every]
            for stretch, memo in zip(stretches, memos, strict=True):
                memo.servos.prepare(candidates, stretch, servoed)

    def errors(searched: Array) -> list[Array]:
        vehicle, about = candidate(searched)
        numbers = _numbers_of(unknowns, fixed, searched)
        every = (replace(about, thrust=numbers.get(f"{THRUST}{each.name}", 1.0)) for each in stretches)
        return [
            prediction_errors(vehicle, around, each, driven, memo, servoed)
            for around, each, memo in zip(every, stretches, memos, strict=True)
        ]

    return Search(
        unknowns=unknowns,
        reported=reported_of(every),
        known=fixed,
        driven=driven,
        servoed=servoed,
        start=start,
        errors=PredictedErrors(errors, prepare),
        block=round(BLOCK / stretches[0].period),
        used=[each.used for each in stretches],
    )


def _from_accelerometer_lag(search: Search, stretches: Sequence[Stretch]) -> Search:
    """Search that begins at the accelerometer's lag if that is beyond what is expected of one."""
    names = [each.name for each in search.unknowns]
    if ACCELEROMETER not in names:
        return search
    numbers = search.numbers(search.begin)
    about = surroundings_with(numbers)
    vehicle = vehicle_with(search.start, numbers)
    predicted = [predict(vehicle, about, each, search.driven) for each in stretches]
    lag = accelerometer_lag(stretches, predicted)
    place = names.index(ACCELEROMETER)
    if abs(lag) <= search.unknowns[place].spread:
        return search
    moved = replace(search.unknowns[place], start=lag)
    return replace(search, unknowns=[*search.unknowns[:place], moved, *search.unknowns[place + 1 :]])


def _numbers_of(unknowns: Sequence[Unknown], known: Mapping[str, float], searched: Array) -> dict[str, float]:
    return {**known, **{each.name: each.value(x) for each, x in zip(unknowns, searched.tolist(), strict=True)}}


def intervals_at(found: PredictionFit, search: Search, stretch: Stretch) -> tuple[IdentifiedNumber, ...]:
    """Numbers with their intervals at an estimate, from flights of the period and samples of a stretch."""
    return identified_numbers(found, search.scale(found), stretch.period, stretch.period / stretch.samples)[0]


def long_stretches(stretches: Sequence[Stretch]) -> list[Stretch]:
    """Stretches that are long enough for a whitening filter.

    Raises:
        ValueError: one line: there are some, and none is.
    """
    found = [each for each in stretches if each.size >= LEAST]
    if stretches and not found:
        longest = max(stretches, key=lambda each: each.size)
        at = f"{longest.name}, from {longest.start:g} s: {longest.size} periods: must be at least {LEAST}"
        of = f" of {longest.logged:.3g} s" if longest.logged else ""
        counts = f"{longest.size * longest.period:.3g} s{of} count, in the air without a gap"
        remedy = "fly longer; the start's rotors, or commands below 40 Hz, set the period"
        raise ValueError(f"{at}: {counts}, and {LEAST * longest.period:.3g} s are needed: {remedy}")
    return found


def _check(stretches: Sequence[Stretch], start: Vehicle) -> None:
    """Raise an error in one line for flights that do not fit a vehicle."""
    if not stretches:
        raise ValueError("stretches: must be one or more")
    for each in stretches:
        at = f"{each.name}, from {each.start:g} s"
        commands, rotors = each.commands.shape[1], len(start.rotors)
        if commands != rotors:
            raise ValueError(f"{at}: rotor commands: there are {commands}, vehicle '{start.name}' has {rotors} rotors")
        if each.joints.shape[1] != start.n:
            raise ValueError(f"{at}: joints: there are {each.joints.shape[1]}, vehicle '{start.name}' has {start.n}")
        if abs(each.period - stretches[0].period) > UNEVEN * stretches[0].period:
            raise ValueError(f"{at}: period = {each.period:g} s: must be {stretches[0].period:g} s, as of the first")
        for name in (
            "commands",
            "rate",
            "specific_force",
            "joints",
            "joint_rates",
            "efforts",
            "setpoints",
            "velocity",
            "voltage",
        ):
            if not np.isfinite(getattr(each, name)).all():
                raise ValueError(f"{at}: {name}: must be finite throughout")


def _explained_shares(
    found: PredictionFit, stretches: Sequence[Stretch], driven: Sequence[bool], servoed: Sequence[bool]
) -> Array:
    """Share of each row's whitened variance that the commands explain."""
    moving, turning = np.flatnonzero(driven), np.flatnonzero(servoed)
    used, nothing = [each.used for each in stretches], []
    for each in stretches:
        rates = np.concatenate([each.rate, each.joint_rates[:, moving], each.joints[:, turning]], axis=1)[1:]
        whole = np.concatenate([each.specific_force, rates], axis=1)
        time = np.linspace(-1.0, 1.0, len(whole))[:, None]
        whole = whole - whole.mean(axis=0)
        # a constant torque explains a straight line of a rate
        nothing.append(whole - time * (time * whole).sum(axis=0) / (time**2).sum())
    left, before = ((found.noise.apply(rows) ** 2).sum(axis=0) for rows in (found.errors, bridge_unused(nothing, used)))
    return np.asarray(1.0 - left / np.maximum(before, 1e-300))
