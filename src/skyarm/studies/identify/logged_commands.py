"""Rotor commands of measured flights: their own samples, the speeds they mean, and when the vehicle flies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from skyarm.dynamics.actuators.rotor import push
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.quantities import GRAVITY
from skyarm.flight_data.series import values_at
from skyarm.log.periods import runs_of
from skyarm.records.arrays import Array
from skyarm.vehicle.vehicle_records import Rotor, Vehicle

SLOWEST = 0.025
"""s, between commands of rotors: pulse widths come at 50 Hz at least, and slower ones are samples of faster ones."""

ROUNDED, NOUGHT = 2.5, 1e-9
"""Smallest second differences that rounding makes of a straight line; share of the largest one that is nought."""

EVEN, REGULAR = 0.1, 0.5
"""Share by which times between samples differ at most from their median, and share of those that do not."""

FEWEST = 20
"""Samples in a row that steps of a test hardly are."""

AIRBORNE, SETTLING = 0.5, 0.5
"""Of the weight, thrust beyond which a vehicle flies; s, over which it is averaged and that are left out beside it."""


def commanded_speeds(flight: FlightData, start: Vehicle) -> Channel:
    """Commanded rotor speeds, rad/s, from speeds or from shares of the full signal."""
    if "rotor_speed_commands" in flight:
        return flight["rotor_speed_commands"]
    share = flight["rotor_commands"]
    highest = highest_speeds(start.rotors)
    if len(highest) != share.values.shape[1]:
        return share
    if not np.isfinite(highest).all():
        raise ValueError("rotors.max_speed = inf: must be finite, the speed of the full signal of rotor_commands")
    return Channel(time=share.time, values=share.values * highest, source=share.source)


def command_samples(commands: Channel) -> Channel:
    """Rows at which a command was logged: of commands that were sampled up, held or on straight lines, one in several.

    Args:
        commands: of the rotors.

    Returns:
        The rows at even times at which any command changes, or bends; all rows if there are no such times.
    """
    steps = np.diff(commands.values, axis=0)
    bends = np.abs(np.diff(steps, axis=0))
    nought = NOUGHT * bends.max(axis=0, initial=0.0)
    straight = np.maximum(ROUNDED * np.where(bends > nought, bends, np.inf).min(axis=0, initial=np.inf), nought)
    for rows in (np.flatnonzero((steps != 0.0).any(axis=1)), np.flatnonzero((bends > straight).any(axis=1))):
        gaps = np.diff(rows)
        usual = float(np.median(gaps)) if len(gaps) >= FEWEST else 1.0
        if usual > 1.0 and np.mean(np.abs(gaps - usual) <= EVEN * usual) > REGULAR:
            kept = np.concatenate([[0], rows + 1])
            return replace(commands, time=commands.time[kept], values=commands.values[kept])
    return commands


def sampling_period(commands: Channel) -> float:
    """Time, s, between samples of commands that were logged too seldom to be held from one to the next; else 0."""
    rate = command_samples(commands).rate
    return 1.0 / rate if 0.0 < rate < 1.0 / SLOWEST else 0.0


def straight_lines(commands: Channel, time: Array) -> Array:
    """Commands (N, rotors) at given times (s), on straight lines between the samples."""
    return values_at(command_samples(commands), time)


def period_note(flight: FlightData, start: Vehicle) -> str:
    """Note on rotor commands that were logged too seldom to be held between; empty of others."""
    period = sampling_period(commanded_speeds(flight, start))
    if not period:
        return ""
    return (
        f"{flight.name}: period = {period:.3g} s, of the rotor commands, which are on straight lines between: "
        "lags do not show, and what the commands did in between may put numbers beside their intervals"
    )


def flying_spans(commands: Channel, start: Vehicle) -> list[tuple[float, float]]:
    """Spans of time (s) in which the start vehicle's rotors lift a good part of its weight."""
    step = 0.02
    time = np.arange(commands.time[0], commands.time[-1], step)
    speeds = commands.values[np.searchsorted(commands.time, time, side="right") - 1]
    thrust = sum(float(r.thrust_coefficient) * push(r, w) for r, w in zip(start.rotors, speeds.T, strict=True))
    flies = _moving_mean(np.asarray(thrust), round(SETTLING / step) | 1) > AIRBORNE * GRAVITY * float(start.mass)
    spans = [(float(time[a]) + SETTLING, float(time[b - 1]) - SETTLING) for a, b in runs_of(flies)]
    return [(a, b) for a, b in spans if b > a]


def time_constants(rotors: Sequence[Rotor]) -> Array:
    """Time constants (rotors, 2) of rotors, up and down, s."""
    pairs = [[float(each.time_constant_up), float(each.time_constant_down)] for each in rotors]
    return np.array(pairs).reshape(-1, 2)


def highest_speeds(rotors: Sequence[Rotor]) -> Array:
    """Highest speeds (rotors,), rad/s."""
    return np.array([float(each.max_speed) for each in rotors])


def _moving_mean(rows: Array, width: int) -> Array:
    """Moving mean (N, ...) over an odd number of rows, of what there is at both ends."""
    if width <= 1:
        return rows
    half = width // 2
    total = np.cumsum(np.concatenate([np.zeros((1, *rows.shape[1:])), rows]), axis=0)
    low = np.maximum(np.arange(len(rows)) - half, 0)
    high = np.minimum(np.arange(len(rows)) + half + 1, len(rows))
    count = (high - low).reshape(-1, *[1] * (rows.ndim - 1))
    mean: Array = (total[high] - total[low]) / count
    return mean
