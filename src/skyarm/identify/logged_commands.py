"""Rotor commands of measured flights: original samples, commanded speeds, and the time
spans in the air.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from skyarm.compile.machine_code import missing_extra
from skyarm.dynamics.actuators.rotor import push
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.quantities import GRAVITY
from skyarm.flight_data.series import values_at
from skyarm.log.periods import runs_of
from skyarm.records.arrays import Array, IntArray, float_array
from skyarm.vehicle import Rotor, Vehicle

SLOWEST = 0.025
"""Longest interval (s) between rotor commands; pulse widths come at 50 Hz or more, and
slower ones are samples of faster ones."""

AUTOPILOTS, SENT, SAMPLES = (
    ("PX4", "ArduPilot", "Betaflight"),
    "rotor commands",
    "samples of a faster loop",
)
"""Vehicles whose loop is faster than their log; fact of a flight, and its value for
such commands."""

ROUNDED, NOUGHT = 2.5, 1e-9
"""Largest second differences that rounding makes of a straight line, in units of the
smallest: numbers rounded to a unit have 0, 1 or 2 of them; fraction of the largest one
that counts as zero."""

EVEN, REGULAR = 0.1, 0.5
"""Largest relative deviation of sample intervals from their median, and fraction of
intervals that must satisfy it."""

FEWEST = 20
"""Least number of consecutive samples; steps of a test are hardly longer."""

AIRBORNE, SETTLING = 0.5, 0.5
"""Thrust over weight above which a vehicle flies; time (s) over which the thrust is
averaged and which is left out at both ends."""


def commanded_speeds(flight: FlightData, start: Vehicle) -> Channel:
    """Commanded rotor speeds (rad/s), from logged speeds or from logged fractions of
    the full signal.
    """
    if "rotor_speed_commands" in flight:
        return flight["rotor_speed_commands"]
    share = flight["rotor_commands"]
    highest = highest_speeds(start.rotors)
    # another number of rotors is a fault of the log, which its checks name
    if len(highest) != share.values.shape[1]:
        return share
    if not np.isfinite(highest).all():
        raise ValueError(
            "rotors.max_speed = inf: must be finite, the speed of the full signal of"
            " rotor_commands"
        )
    return replace(share, values=share.values * highest)


def command_samples(commands: Channel) -> Channel:
    """Original samples of logged commands, recovered from an upsampled signal (held or
    linearly interpolated).

    Args:
        commands: commands of the rotors.

    Returns:
        Those at even times at which any command changes, or bends, which may lie
        between two rows; all rows if there are no such times.
    """
    time, values = commands.time, commands.values
    steps = np.diff(values, axis=0)
    changed = np.flatnonzero((steps != 0.0).any(axis=1))
    if _is_regular(changed):
        rows = np.concatenate([[0], changed + 1])
        return replace(commands, time=time[rows], values=values[rows])
    # no row repeats another: the samples are where straight lines bend
    bends = np.abs(np.diff(steps, axis=0))
    most = bends.max(axis=0, initial=0.0)
    least = np.where(bends > NOUGHT * most, bends, np.inf).min(axis=0, initial=np.inf)
    straight = np.maximum(ROUNDED * least, NOUGHT * most)
    sharp = np.append(
        np.where(bends > straight, bends / np.maximum(most, 1e-300), 0.0).sum(axis=1),
        0.0,
    )
    first = np.flatnonzero(sharp)
    # a sample between two rows bends the lines at both: it lies where these meet
    first = first[np.diff(first, prepend=-2) > 1]
    share = sharp[first + 1] / (sharp[first] + sharp[first + 1])
    if not _is_regular(first + share):
        return commands
    late = share * (time[first + 2] - time[first + 1])
    met = (
        values[first + 1]
        + (late / (time[first + 1] - time[first]))[:, None] * steps[first]
    )
    return replace(
        commands,
        time=np.concatenate([time[:1], time[first + 1] + late, time[-1:]]),
        values=np.concatenate([values[:1], met, values[-1:]]),
    )


def _is_regular(places: Array | IntArray) -> bool:
    """True if most of the given row indices are evenly spaced, by more than one row."""
    gaps = np.diff(places)
    usual = float(np.median(gaps)) if len(gaps) >= FEWEST else 1.0
    return usual > 1.0 and bool(np.mean(np.abs(gaps - usual) <= EVEN * usual) > REGULAR)


def sampling_period(commands: Channel) -> float:
    """Sampling period (s) of commands logged too rarely for a zero-order hold; 0 if
    they are logged often enough.
    """
    rate = command_samples(commands).rate
    return 1.0 / rate if 0.0 < rate < 1.0 / SLOWEST else 0.0


def are_samples(flight: FlightData) -> bool:
    """True if the rotor commands were logged more slowly than the loop that sends them.

    An autopilot's log has every so many of its commands; between two of them it sent
    others. Held from one to the next they would act half a period late, and the delay
    come out that much too early.
    """
    return (
        flight.facts.get("vehicle") in AUTOPILOTS or flight.facts.get(SENT) == SAMPLES
    )


def as_samples(flight: FlightData) -> FlightData:
    """Flight whose rotor commands are samples of a faster loop's."""
    return replace(flight, facts={**flight.facts, SENT: SAMPLES})


def smooth_commands(commands: Channel, time: Array) -> Array:
    """Commands (N, rotors) at given times (s), on a smooth curve through the samples
    (cubic spline).

    Straight lines would cut off the tops of what a controller commands: of a sine of a
    fifth of the samples' rate an eighth.

    Raises:
        ValueError: one line: SciPy is missing.
    """
    try:
        from scipy.interpolate import CubicSpline
    except (
        ImportError
    ) as error:  # pragma: no cover  (the library is there when this is tested)
        raise missing_extra("identify") from error
    samples = command_samples(commands)
    usual = 1.0 / samples.rate
    # where lines did not bend at a sample it is on them
    parts = [
        np.linspace(first, last, max(1, round((last - first) / usual)), endpoint=False)
        for first, last in pairwise(samples.time)
    ]
    knots = np.concatenate([*parts, samples.time[-1:]])
    curve = CubicSpline(knots, values_at(samples, knots))
    return np.asarray(curve(np.clip(time, knots[0], knots[-1])))


def period_note(flight: FlightData, start: Vehicle) -> str:
    """Note that a flight's rotor commands are samples of those that were sent; empty
    otherwise.
    """
    commands = commanded_speeds(flight, start)
    period = sampling_period(commands)
    if not period and are_samples(flight):
        rate = command_samples(commands).rate
        return (
            f"{flight.name}: rotor commands: a curve through samples of {rate:.4g} Hz,"
            " as the loop is faster"
        )
    if not period:
        return ""
    return (
        f"{flight.name}: period = {period:.3g} s, of the rotor commands, between which"
        " a smooth curve is taken: lags do not show, and what the commands did in"
        " between may put numbers beside their intervals"
    )


def lift(vehicle: Vehicle, speeds: Array) -> Array:
    """Sum of the rotors' thrusts (K,) in N at K sets of speeds (K, rotors) in rad/s,
    regardless of rotor tilt.
    """
    return np.asarray(sum(thrusts_of(vehicle, speeds)))


def thrusts_of(vehicle: Vehicle, speeds: Array) -> list[Array]:
    """Thrust (K,) of each rotor in N at K sets of speeds (K, rotors) in rad/s."""
    return [
        float(rotor.thrust_coefficient) * push(rotor, speed)
        for rotor, speed in zip(vehicle.rotors, speeds.T, strict=True)
    ]


def flying_spans(commands: Channel, start: Vehicle) -> list[tuple[float, float]]:
    """Spans of time (s) in which the start vehicle's rotors lift a good part of its
    weight.
    """
    # chosen: fine beside the time over which the lift is averaged
    step = 0.02
    time = np.arange(commands.time[0], commands.time[-1], step)
    speeds = commands.values[np.searchsorted(commands.time, time, side="right") - 1]
    # | 1: an odd number of steps, so that the mean has a middle
    width = round(SETTLING / step) | 1
    weight = GRAVITY * float(start.mass)
    flies = _moving_mean(lift(start, speeds), width) > AIRBORNE * weight
    spans = [
        (float(time[a]) + SETTLING, float(time[b - 1]) - SETTLING)
        for a, b in runs_of(flies)
    ]
    return [(a, b) for a, b in spans if b > a]


def time_constants(rotors: Sequence[Rotor]) -> Array:
    """Rotor time constants (rotors, 2) for rising and falling speed, s."""
    pairs = [
        [float(each.time_constant_up), float(each.time_constant_down)]
        for each in rotors
    ]
    return np.array(pairs).reshape(-1, 2)


def slowest_lag(vehicle: Vehicle) -> float:
    """Longest time constant of a vehicle's rotors, s; 0 without rotors."""
    return float(time_constants(vehicle.rotors).max(initial=0.0))


def highest_speeds(rotors: Sequence[Rotor]) -> Array:
    """Highest rotor speeds (rotors,), rad/s."""
    return float_array(each.max_speed for each in rotors)


def _moving_mean(values: Array, width: int) -> Array:
    """Moving mean (N,) over an odd number of values, over fewer at both ends."""
    half = width // 2
    total = np.concatenate([[0.0], np.cumsum(values)])
    low = np.maximum(np.arange(len(values)) - half, 0)
    high = np.minimum(np.arange(len(values)) + half + 1, len(values))
    return np.asarray((total[high] - total[low]) / (high - low))
