"""Stretches for identification from a measured flight: one even clock, commands held, measurements averaged."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from skyarm.algebra.frames import to_base
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.series import attitude_at, common_span, measured_at, middle, values_at
from skyarm.records.arrays import Array, Mask
from skyarm.studies.identify.logged_commands import (
    commanded_speeds,
    flying_spans,
    highest_speeds,
    sampling_period,
    straight_lines,
    time_constants,
)
from skyarm.studies.identify.motion_model import PARABOLA, Stretch
from skyarm.studies.identify.sampled_series import moving_mean, position_differences
from skyarm.studies.identify.windows import COASTING, GAP, RECOVERED
from skyarm.vehicle.vehicle_records import Vehicle

PER_LAG = 2.5
"""Periods per time constant of the rotors."""

FINE = 0.2
"""Of the shortest time constant, longest period of the commands' clock."""

SHORTEST = 1.0
"""s, of a stretch."""

LATE, BLOCK = 0.25, 2.0
"""Of the time between samples, lag of joint rates that are left out; s, of a block of its least squares."""

SAME = 1e-9
"""Relative difference of periods that is rounding."""


def stretches_of(
    flight: FlightData,
    start: Vehicle,
    *,
    period: float = 0.0,
    full_voltage: float = 0.0,
    sections: Sequence[tuple[float, float]] = (),
    coasting: float | None = None,
) -> list[Stretch]:
    """Cut a measured flight into stretches without gaps, on an even clock.

    Args:
        flight: with gyro, accelerometer and rotor_commands or rotor_speed_commands; of joints positions.
        start: vehicle with what is known before: time constants, highest speeds.
        period: s; by default a part of the rotors' time constants, or the time between commands that were logged too
            seldom to be held.
        full_voltage: V, of the rotors' data; 0 leaves the battery's voltage out.
        sections: (begin, end), s, that count; by default all in which the vehicle flies.
        coasting: share of the full signal below which a motor does not obey its lag; by default 0.1 of motors that
            are commanded by a share of it, and none of those whose speed is commanded.

    Raises:
        ValueError: one line: a quantity is missing or does not fit the vehicle, or no stretch is long enough.
    """
    gyro = flight["gyro"]
    commands = commanded_speeds(flight, start)
    if commands.values.shape[1] != len(start.rotors):
        count = commands.values.shape[1]
        raise ValueError(
            f"{flight.name}: {commands.source}: {count} rotors, vehicle '{start.name}' has {len(start.rotors)}"
        )
    lags = time_constants(start.rotors).ravel().tolist()
    usual = float(np.median(np.diff(gyro.time)))
    wanted = period or max(sum(lags) / len(lags) / PER_LAG, sampling_period(commands))
    # the clock's last bits must not choose between two periods
    whole = max(1, round(round(wanted / usual, 3)))
    finer = max(1, math.ceil(usual / max(FINE * min(lags), 5e-4)))
    step = period / whole if period else usual
    if coasting is None:
        coasting = -1.0 if "rotor_speed_commands" in flight else COASTING
    longest, found = max(GAP, 1.5 * whole) * usual, list[Stretch]()
    if joint_rates_note(flight):
        channels = {name: each for name, each in flight.channels.items() if name != "joint_rates"}
        flight = dataclasses.replace(flight, channels=channels)
    spans = flying_spans(commands, start) or list(sections)
    for begin, end in sections or spans:
        earliest, latest = common_span(*_needed(flight))
        for first, last in _without_gaps(gyro, max(begin, earliest), min(end, latest), longest):
            if last - first >= SHORTEST:
                stretch = _stretch(flight, start, commands, first, last, step, whole, finer, full_voltage)
                used = ~_coasting(stretch, start, coasting, RECOVERED * max(lags))
                since, logged = first - spans[0][0], flight.duration
                found.append(dataclasses.replace(stretch, used=used, since=since, logged=logged))
    if not found:
        raise ValueError(f"{flight.name}: no stretch of {SHORTEST:g} s in the air without a gap")
    return found


def stretches_of_flights(
    flights: Sequence[FlightData],
    start: Vehicle,
    *,
    period: float = 0.0,
    full_voltage: float = 0.0,
    sections: Sequence[tuple[float, float]] = (),
) -> list[list[Stretch]]:
    """Cut several measured flights into stretches of one period, the longest of those that suit each flight.

    Args:
        flights: as of :func:`stretches_of`.
        start: vehicle with what is known before.
        period: s, in place of the longest one.
        full_voltage: V, of the rotors' data; 0 leaves the battery's voltage out.
        sections: (begin, end), s, of each flight that count; by default all in which the vehicle flies.

    Raises:
        ValueError: one line: a flight lacks a quantity, does not fit the vehicle or has no stretch long enough.
    """
    options: dict[str, Any] = {"full_voltage": full_voltage, "sections": sections}
    names = [each.name for each in flights]
    flights = [
        each if names.count(each.name) == 1 else dataclasses.replace(each, name=f"{each.name} ({i + 1})")
        for i, each in enumerate(flights)
    ]
    found = [stretches_of(each, start, period=period, **options) for each in flights]
    longest = period or max(each.period for stretches in found for each in stretches)
    for i, flight in enumerate(flights):
        if any(abs(each.period - longest) > SAME * longest for each in found[i]):
            found[i] = stretches_of(flight, start, period=longest, **options)
        found[i] = [dataclasses.replace(each, period=longest) for each in found[i]]
    return found


def _air_velocity(flight: FlightData, time: Array) -> Array:
    """Velocity in base axes, m/s, in still air."""
    velocity = measured_at(flight["velocity"], time, float(time[1] - time[0]))
    return to_base(attitude_at(flight["quaternion"], time), velocity)


def _impulse(width: int, samples: int) -> Array:
    """One among zeros, longer than all that measurements are averaged over."""
    return np.asarray(np.eye(1, 4 * (width + samples) + 1, 2 * (width + samples))[0])


def _noise_of_means(rows: Array, response: Array, width: int, samples: int) -> Array:
    """Standard deviation of the noise of a period's mean rate, smoothed, from the white noise of samples (N, n).

    Differences of the fourth order hold noise alone: a motion of 2 Hz at 200 Hz has 2e-5 of its size in them.

    Args:
        rows: positions or rates.
        response: of a rate to an impulse in them.
        width: samples of the moving mean.
        samples: per period.
    """
    white = 1.4826 * np.median(np.abs(np.diff(rows, 4, axis=0)), axis=0) / math.sqrt(70.0)
    smooth = moving_mean(response, width)
    means = 0.5 * (smooth[samples:] + smooth[:-samples])
    spaced = np.zeros(4 * samples + 1)
    spaced[::samples] = PARABOLA
    gain = math.sqrt(float((np.convolve(means.ravel(), spaced) ** 2).sum()))
    return white * gain


def joint_rates_note(flight: FlightData) -> str:
    """Reason for which measured joint rates are left for those of the positions, in words; empty if there is none.

    Rates that are differences to the sample before are half a sample late: they would act at another time than the
    joints' positions say, and everything would be fitted to that.
    """
    if "joint_rates" not in flight or "joint_positions" not in flight:
        return ""
    late, step = joint_rate_lag(flight["joint_positions"], flight["joint_rates"])
    if abs(late) <= LATE * step:
        return ""
    return (
        f"{flight.name}: joint_rates: {1e3 * late:.2g} ms behind joint_positions: left out for rates of the positions"
    )


def joint_rate_lag(positions: Channel, rates: Channel) -> tuple[float, float]:
    """Time by which measured rates are behind the positions, and the time between samples of the positions, s.

    The sum of late rates is behind the positions by the lag times the rate: least squares over blocks of two seconds,
    without constants and lines. Noise of the positions is on the left side, where it makes no error.
    """
    step = float(np.median(np.diff(positions.time)))
    time = np.arange(*common_span(positions, rates), step)
    if positions.values.shape != (len(positions.time), rates.values.shape[1]) or len(time) < 8:
        return 0.0, step
    q, qd = (values_at(each, time) for each in (positions, rates))
    summed = np.concatenate([np.zeros((1, q.shape[1])), np.cumsum(middle(qd), axis=0) * step])
    both = size = 0.0
    for part in np.array_split(np.arange(len(time)), max(1, round(len(time) * step / BLOCK))):
        lines = np.vander(np.linspace(-1.0, 1.0, len(part)), 2)
        off, rate = (
            rows - lines @ np.linalg.lstsq(lines, rows, rcond=None)[0] for rows in ((q - summed)[part], qd[part])
        )
        both, size = both + float((off * rate).sum()), size + float((rate**2).sum())
    return both / max(size, 1e-300), step


def _coasting(stretch: Stretch, start: Vehicle, share: float, recovered: float) -> Mask:
    """Periods (N,) in or after which a motor coasts, for so many seconds."""
    limits = highest_speeds(start.rotors)
    low = np.where(np.isfinite(limits), share * limits, 0.0)
    idle: Mask = np.asarray((stretch.commands < low).any(axis=1))
    if share < 0.0:
        idle = np.zeros(len(idle), dtype=bool)
    step = stretch.period / stretch.fine
    since = np.convolve(idle.astype(float), np.ones(max(1, round(recovered / step))), "full")[: len(idle)] > 0.0
    return np.asarray(since.reshape(stretch.size, stretch.fine).any(axis=1))


def _needed(flight: FlightData) -> list[Channel]:
    others = ("joint_positions", "joint_rates", "rotor_commands", "rotor_speed_commands")
    return [flight["gyro"], flight["accelerometer"], *(flight[name] for name in others if name in flight)]


def _without_gaps(gyro: Channel, begin: float, end: float, longest: float) -> list[tuple[float, float]]:
    """Spans of time (s) in which samples of the gyroscope are no longer apart than the longest time (s)."""
    time = gyro.time[(gyro.time >= begin) & (gyro.time <= end)]
    if len(time) < 2:
        return []
    cuts = np.flatnonzero(np.diff(time) > longest)
    firsts, lasts = [0, *(cuts + 1)], [*cuts, len(time) - 1]
    return [(float(time[a]), float(time[b])) for a, b in zip(firsts, lasts, strict=True)]


def _stretch(
    flight: FlightData,
    start: Vehicle,
    commands: Channel,
    first: float,
    last: float,
    step: float,
    samples: int,
    finer: int,
    full_voltage: float,
) -> Stretch:
    """One stretch of a flight, from instant to instant (s).

    Args:
        flight: that is measured.
        start: vehicle.
        commands: commanded speeds.
        first: s.
        last: s.
        step: s, from sample to sample.
        samples: per period.
        finer: commands per sample.
        full_voltage: V.
    """
    periods = int((last - first) / step + 1e-6) // samples
    time: Array = first + step * np.arange(periods * samples + 1, dtype=float)
    n, width = start.n, samples | 1 if samples > 1 else 1
    # of the commands' clock; a share of a step late, so that rounding of times does not shift a command by a step
    grid: Array = first + step / finer * (np.arange(periods * samples * finer, dtype=float) + 1e-3)

    def at(name: str) -> Array:
        return measured_at(flight[name], time, step)

    def means(rows: Array) -> Array:
        # of straight lines between the samples
        return np.asarray(middle(rows).reshape(periods, samples, -1).mean(axis=1))

    def hold(channel: Channel) -> Array:
        place = np.searchsorted(channel.time, grid, side="right") - 1
        return channel.values[np.maximum(place, 0)]

    def of_joints(name: str) -> Channel:
        count = flight[name].values.shape[1]
        if count != n:
            raise ValueError(f"{flight.name}: {name}: {count} columns, vehicle '{start.name}' has {n}")
        return flight[name]

    joints, rates, noise = np.zeros((len(time), n)), np.zeros((len(time), n)), np.zeros(n)
    differenced = False
    if n:
        joints = measured_at(of_joints("joint_positions"), time, step)
        rates, differenced = position_differences(joints) / step, True
        noise = _noise_of_means(joints, position_differences(_impulse(width, samples)) / step, width, samples)
        if "joint_rates" in flight:
            rates, differenced = at("joint_rates"), False
            noise = _noise_of_means(rates, _impulse(width, samples), width, samples)
    still = np.zeros((periods * samples * finer, n))

    def held_joints(name: str) -> Array:
        return hold(of_joints(name)) if n and name in flight else still

    voltage = np.ones(periods)
    if full_voltage > 0.0 and "voltage" in flight:
        voltage = means(at("voltage"))[:, 0] / full_voltage
    velocity = np.zeros((periods, 3))
    if "velocity" in flight and "quaternion" in flight:
        velocity = means(_air_velocity(flight, time))
    return Stretch(
        name=flight.name,
        start=first,
        period=step * samples,
        samples=samples,
        fine=samples * finer,
        commands=straight_lines(commands, grid + 0.5 * step / finer) if sampling_period(commands) else hold(commands),
        rate=moving_mean(at("gyro"), width)[::samples],
        specific_force=means(moving_mean(at("accelerometer"), width)),
        joints=moving_mean(joints, width)[::samples],
        joint_rates=moving_mean(rates, width)[::samples],
        efforts=held_joints("joint_efforts"),
        setpoints=held_joints("joint_commands"),
        velocity=velocity,
        voltage=voltage,
        width=width,
        sampled_rate=at("gyro"),
        sampled_force=middle(at("accelerometer")),
        sampled_joints=joints,
        rate_noise=noise,
        differenced=differenced,
        slow=sampling_period(commands) > 0.0,
    )
