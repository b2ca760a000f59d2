"""Windows of measured flights: short parts, simulated from an unknown initial state, on
one even clock.

A log is cut into windows. In each the commands are those of the log, late by any dead
time, and every sensor has at most one sample a step, at its own time within it. A
window lies where the vehicle flies, no sensor that is needed has a gap, and no motor
coasts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

from skyarm.algebra.frames import continuous, unit_rows
from skyarm.dynamics.actuators.rotor import speed_after
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.series import columns_at
from skyarm.identify.identified_parts import with_changes
from skyarm.identify.logged_commands import (
    are_samples,
    commanded_speeds,
    flying_spans,
    highest_speeds,
    sampling_period,
    slowest_lag,
    smooth_commands,
)
from skyarm.records.arrays import Array, IntArray, Mask
from skyarm.records.immutable import immutable, positional
from skyarm.vehicle import Rotor, Vehicle

SENSORS = (
    "gyro",
    "accelerometer",
    "position",
    "quaternion",
    "velocity",
    "joint_positions",
    "joint_rates",
)
"""Measured quantities that a window can compare, if the log contains them."""

DERIVED = ("velocity", "joint_rates")
"""Measured quantities derived from others by smoothing; a fit would rate their
information too high."""

NEEDED = ("gyro", "accelerometer", "joint_positions")
"""Sensors that must have no gap in a window."""

SHORTEST, LONGEST = 1e-3, 5e-3
"""Shortest and longest integration step (s); commands may switch once within it."""

RUN_IN = 8.0
"""Longest rotor time constants before a window from which the speeds are known; 3e-4 of
a change remains."""

GAP = 5.0
"""Interval over the usual one above which a sensor has a gap."""

COASTING = 0.1
"""Fraction of the full signal below which a motor coasts and does not follow its
lag."""

RECOVERED = 3.0
"""Time constants after coasting until a rotor's speed is predictable again: 5 % of an
error remains."""

AROUND = 0.05
"""Time (s) to each side of an instant over which parabolas through the samples give an
initial state."""


@positional(eq=False)
class SensorSamples:
    """Samples of one sensor on an even clock: per step at most one, the mean of all
    measured within that step.

    Attributes:
        values: (steps, k). share: (steps,) of the step that was over at the sample, 0
            to 1. there: (steps,) if any.
    """

    values: Array
    share: Array
    there: Mask


@immutable(eq=False)
class Clocked:
    """Measured flight whose commands and sensors are placed on a clock of even steps.

    Attributes:
        name: name of the flight. begin: start of the clock, s. step: s. size: steps.
        channels: sensor -> what it measured.
        speeds, efforts, setpoints: commands at their own times, rad/s and the joints'
            units; None if not logged.
        voltage: (steps,) over that of the rotors' data; 1 where it is not known.
        since: (steps,) s, after the flight's take-off.
        usable: (steps,) in the air, and no motor coasts.
    """

    name: str
    begin: float
    step: float
    size: int
    channels: Mapping[str, Channel]
    speeds: Channel
    efforts: Channel | None
    setpoints: Channel | None
    voltage: Array
    since: Array
    usable: Mask

    @property
    def edges(self) -> Array:
        """Times (size + 1,) at which the clock's steps begin and end, s."""
        return self.begin + self.step * np.arange(self.size + 1, dtype=float)


def clock_step(flights: Sequence[FlightData], start: Vehicle) -> float:
    """Clock step (s) for flights: an integer fraction of the sampling period of gyro or
    commands, the shorter one.

    Args:
        flights: measured.
        start: vehicle, by whose rotors' lags steps are short enough.
    """
    usual = min(
        1.0 / max(each["gyro"].rate, commanded_speeds(each, start).rate)
        for each in flights
    )
    # rounded, because the stamps' last bits would else decide on which side of a whole
    # number of steps a period lies
    usual = max(round(usual, 7), SHORTEST)
    return usual / math.ceil(usual / LONGEST - 1e-6)


def on_clock(
    flight: FlightData,
    start: Vehicle,
    step: float,
    *,
    full_voltage: float = 0.0,
    sections: Sequence[tuple[float, float]] = (),
    sensors: Sequence[str] = (),
) -> Clocked:
    """Place a measured flight on a clock of even steps.

    Args:
        flight: measured.
        start: vehicle with what is known before.
        step: s.
        full_voltage: V, of the rotors' data; 0 leaves the battery's voltage out.
        sections: (begin, end), s, that count; by default all in which the vehicle
            flies.
        sensors: sensors that are compared where the flight holds them, of which an
            accelerometer must be there; by default those that are not made of others.

    Raises:
        ValueError: one line: a quantity is missing or does not fit the vehicle.
    """
    gyro = flight["gyro"]
    speeds = commanded_speeds(flight, start)
    _require_columns(flight, start, speeds, sensors or SENSORS)
    # 1e-6: a flight of whole steps must not lose the last one to rounding
    begin, size = float(gyro.time[0]), int((gyro.time[-1] - gyro.time[0]) / step + 1e-6)
    edges = begin + step * np.arange(size + 1, dtype=float)
    if sampling_period(speeds) or are_samples(flight):
        middles = edges[:-1] + 0.5 * step
        speeds = replace(
            speeds, time=edges[:-1], values=smooth_commands(speeds, middles)
        )
    # a rotor does not follow a command beyond its range
    limits = highest_speeds(start.rotors)
    least = [float(rotor.min_speed) for rotor in start.rotors]
    speeds = replace(speeds, values=np.clip(speeds.values, least, limits))
    aloft = flying_spans(speeds, start) or list(sections)
    usable = np.zeros(size, dtype=bool)
    for first, last in sections or aloft:
        usable |= (edges[:-1] >= first) & (edges[1:] <= last)
    if "rotor_speed_commands" not in flight:
        low = np.where(np.isfinite(limits), COASTING * limits, 0.0)
        idle = (held_over(speeds, edges, 0.0).after < low).any(axis=1).astype(float)
        after = np.ones(max(1, round(RECOVERED * slowest_lag(start) / step)))
        usable &= np.convolve(idle, after, "full")[:size] == 0.0
    # joints of a vehicle without any are no joints of it
    others = [
        name
        for name in SENSORS
        if name not in DERIVED or (name == "velocity" and "position" not in flight)
    ]
    names = sensors or others
    channels = {
        name: flight[name]
        for name in names
        if name in flight and (start.n or not name.startswith("joint"))
    }
    for name in NEEDED:
        if name in channels:
            usable &= _without_gaps(flight[name], edges)
    # a pose that its estimator resets jumps, and the vehicle does not
    for first, last in flight.jumps:
        usable &= (edges[1:] <= first) | (edges[:-1] >= last)
    voltage = np.ones(size)
    if full_voltage and "voltage" in flight:
        measured = flight["voltage"]
        voltage = (
            np.interp(edges[:-1], measured.time, measured.values[:, 0]) / full_voltage
        )
    return Clocked(
        name=flight.name,
        begin=begin,
        step=step,
        size=size,
        channels=channels,
        speeds=speeds,
        efforts=flight.channels.get("joint_efforts"),
        setpoints=flight.channels.get("joint_commands"),
        voltage=voltage,
        # since the take-off, not the section: the battery falls from there on
        since=edges[:-1] - (aloft[0][0] if aloft else begin),
        usable=usable,
    )


def _require_columns(
    flight: FlightData, start: Vehicle, speeds: Channel, sensors: Sequence[str]
) -> None:
    """Raise an error in one line for a flight whose channels are missing or do not fit
    the vehicle.
    """
    count = speeds.values.shape[1]
    if count != len(start.rotors):
        has = f"vehicle '{start.name}' has {len(start.rotors)}"
        raise ValueError(f"{flight.name}: {speeds.source}: {count} rotors, {has}")
    if "accelerometer" in sensors:
        flight["accelerometer"]  # raises
    if start.n:
        flight["joint_positions"]  # raises
    for name in ("joint_positions", "joint_efforts", "joint_commands"):
        columns = flight[name].values.shape[1] if name in flight else start.n
        if columns != start.n:
            raise ValueError(
                f"{flight.name}: {name}: {columns} columns, vehicle '{start.name}' has"
                f" {start.n}"
            )


def samples_on(channel: Channel, edges: Array) -> SensorSamples:
    """Average the samples of a measured channel in each step of a clock with evenly
    spaced step edges (s).
    """
    step = float(edges[1] - edges[0])
    size = len(edges) - 1
    # a sample on an edge, but for rounding, ends the step before it
    place = np.ceil((channel.time - edges[0]) / step - 1e-6).astype(int) - 1
    inside = (place >= 0) & (place < size)
    place, time, rows = place[inside], channel.time[inside], channel.values[inside]
    if channel.values.shape[1] == 4:
        rows = continuous(rows)
    count = np.bincount(place, minlength=size)
    least = np.maximum(count, 1)
    values = np.stack(
        [np.bincount(place, column, size) / least for column in rows.T], axis=1
    )
    if values.shape[1] == 4:
        # rows without a sample are not compared, but must be attitudes
        values[count == 0] = [1.0, 0.0, 0.0, 0.0]
        values = unit_rows(values)
    share = np.bincount(place, (time - edges[place]) / step, size) / least
    return SensorSamples(values, np.clip(share, 0.0, 1.0), count > 0)


@positional(eq=False)
class Held:
    """Sampled and held commands over each of N steps, with at most one switch per step.

    Attributes:
        before, after: (N, k) commands until the switch, and the mean from it on. late:
            (N,) s, within the step.
    """

    before: Array
    after: Array
    late: Array


Arrays = TypeVar("Arrays")
"""Record whose fields are arrays."""


def join_arrays(every: Sequence[Arrays], joining: Callable[[Any], Array]) -> Arrays:
    """Combine records of arrays, field by field, by a function such as
    ``np.concatenate``.
    """
    kind: Any = type(every[0])
    joined: Arrays = kind(
        *(
            joining([getattr(each, field.name) for each in every])
            for field in fields(kind)
        )
    )
    return joined


def held_over(channel: Channel, edges: Array, delay: float, width: float = 0.0) -> Held:
    """Sample and hold commands over N steps between given times (s), with a dead time
    (s).

    With a width (s) they are means over it before the end of each step, if that is
    longer, and do not switch.
    """
    time, values = channel.time, channel.values
    sums = np.concatenate(
        [
            np.zeros((1, values.shape[1])),
            np.cumsum(values[:-1] * np.diff(time)[:, None], axis=0),
        ]
    )

    # the first and the last command hold beyond the samples
    def integral(when: Array) -> Array:
        inner = columns_at(when, time, sums)
        inner += np.minimum(when - time[0], 0.0)[:, None] * values[0]
        return np.asarray(
            inner + np.maximum(when - time[-1], 0.0)[:, None] * values[-1]
        )

    first, last = edges[:-1] - delay, edges[1:] - delay
    if width:
        first = np.minimum(first, last - width)
        mean = (integral(last) - integral(first)) / (last - first)[:, None]
        return Held(mean, mean, np.zeros(len(first)))
    # a command on an edge, but for rounding, is no switch within the step
    little = 1e-6 * (edges[1:] - edges[:-1])
    sample = np.searchsorted(time, first + little, "right") - 1
    after = np.minimum(sample + 1, len(time) - 1)
    switch = np.where(
        (sample + 1 < len(time)) & (time[after] < last - little), time[after], first
    )
    switch = np.maximum(switch, first)
    mean = (integral(last) - integral(switch)) / (last - switch)[:, None]
    return Held(values[np.maximum(sample, 0)], mean, switch - first)


def lagging(held: Held, lag: float, step: float, flat: bool = False) -> Held:
    """Commands filtered by a first-order lag, as one value for each half of every step.

    Impulse and first moment of each step are exact, so that all actuators switch at
    once, whatever their delays.

    Args:
        held: commands.
        lag: s, above 0.
        step: s.
        flat: the mean of a step acts all over it, as of a drive that is advanced once a
            control period.
    """
    from scipy.signal import lfilter

    early = held.late[:, None]
    share = early / step
    left = math.exp(-step / lag)
    first, last = np.exp(-early / lag), np.exp((early - step) / lag)
    gained = held.before * (1.0 - first) * last + held.after * (1.0 - last)
    begin = held.before[:1]
    # begins as if the first command had always acted
    ends = lfilter([1.0], [1.0, -left], gained, axis=0, zi=left * begin)[0]
    asked = share * held.before + (1.0 - share) * held.after
    mean = asked - lag / step * np.diff(ends, axis=0, prepend=begin)
    if flat:
        return Held(mean, mean, np.zeros(len(mean)))
    # halves a, b have the mean (a + b) / 2 and the first moment (a + 3 b) / 8
    moment = 0.5 * (
        share**2 * held.before + (1.0 - share**2) * held.after
    ) - lag / step * (ends - mean)
    return Held(
        3.0 * mean - 4.0 * moment, 4.0 * moment - mean, np.full(len(mean), 0.5 * step)
    )


def _without_gaps(channel: Channel, edges: Array) -> Mask:
    """Mask (N,) of steps that lie within the samples of a channel and in none of its
    gaps.
    """
    usual = float(np.median(np.diff(channel.time)))
    usable = (edges[:-1] >= channel.time[0] - usual) & (
        edges[1:] <= channel.time[-1] + usual
    )
    wide = np.flatnonzero(np.diff(channel.time) > GAP * usual)
    for i in wide:
        usable &= (edges[1:] <= channel.time[i]) | (edges[:-1] >= channel.time[i + 1])
    return np.asarray(usable)


def run_in_of(vehicle: Vehicle, step: float) -> int:
    """Number of steps (s) of past commands from which the speeds of a vehicle's rotors
    follow.
    """
    return math.ceil(RUN_IN * slowest_lag(vehicle) / step)


class ClockedWindows:
    """Short windows of measured flights, cut where the vehicle flies and no needed
    sensor has a gap.

    Args:
        flights: flights of one step.
        start: vehicle before.
        seconds: length of a window, s.
        most: windows at most, evenly taken; 0 for all.
        places: first steps of the windows in each flight; by default one window behind
            the other where steps are usable.

    Attributes:
        length: steps of a window. count: windows, W of them. run_in: steps before one
            from which rotors' speeds follow.
        begins: (W,) number of each window's first step, among those of all flights.
        owners: (W,) number of its flight. firsts: (flights + 1,) number of each
            flight's first step.
    """

    def __init__(
        self,
        flights: Sequence[Clocked],
        start: Vehicle,
        seconds: float,
        most: int = 0,
        places: Sequence[IntArray] | None = None,
    ) -> None:
        self.flights = list(flights)
        self.step = flights[0].step
        self.length = max(1, round(seconds / self.step))
        # in a short flight rather from a part of the past than no window
        self.run_in = min(
            run_in_of(start, self.step), max(each.size for each in flights) // 2
        )
        self.firsts: IntArray = np.cumsum([0, *(each.size for each in flights)])
        rows = (
            [np.array(self._places(each), int) for each in flights]
            if places is None
            else places
        )
        # firsts has one entry more, the end of the last flight
        begins = np.concatenate(
            [first + part for first, part in zip(self.firsts, rows, strict=False)]
        )
        owners = np.repeat(np.arange(len(flights)), [len(part) for part in rows])
        if most and len(begins) > most:
            chosen = np.linspace(0, len(begins) - 1, most).astype(int)
            begins, owners = begins[chosen], owners[chosen]
        self.begins: IntArray = begins
        self.owners: IntArray = owners
        self.count = len(begins)

    def _places(self, flight: Clocked) -> list[int]:
        """First steps of the windows of a flight, back to back within usable parts."""
        places = list[int]()
        k = self.run_in
        while k + self.length <= flight.size:
            bad = np.flatnonzero(~flight.usable[k : k + self.length])
            if bad.size:
                k += int(bad[-1]) + 1
            else:
                places.append(k)
                k += self.length
        return places

    def before(self, k: int) -> IntArray:
        """Step indices (W,) that lie k steps after the starts of windows, limited to
        their flights.
        """
        first = self.firsts[self.owners]
        last = self.firsts[self.owners + 1] - 1
        return np.asarray(np.clip(self.begins + k, first, last), dtype=np.int64)

    def samples(self, late: Mapping[str, float | Array]) -> dict[str, SensorSamples]:
        """Samples of each sensor on the clock, all flights concatenated; marked absent
        where a sensor is missing.

        Args:
            late: sensor -> s, by which its samples are late, in all flights or
                (flights,) in each.
        """
        by_sensor = dict[str, SensorSamples]()
        for name in dict.fromkeys(
            name for each in self.flights for name in each.channels
        ):
            widths = [
                each.channels[name].values.shape[1]
                for each in self.flights
                if name in each.channels
            ]
            # of a flight without the sensor a channel without samples
            none = Channel(
                time=np.zeros(0), values=np.zeros((0, widths[0])), source="none"
            )
            delays = np.broadcast_to(late.get(name, 0.0), len(self.flights))
            parts = [
                samples_on(each.channels.get(name, none), each.edges + delay)
                for each, delay in zip(self.flights, delays, strict=True)
            ]
            by_sensor[name] = join_arrays(parts, np.concatenate)
        return by_sensor

    def commands(
        self, name: str, delay: float, hold: float = 0.0, lag: float = 0.0
    ) -> Held:
        """Logged commands of all flights in each clock step, with a dead time (s);
        zeros where none is logged.

        Args:
            name: ``speeds``, ``efforts`` or ``setpoints``.
            delay: s.
            hold: share of the time between its samples over which it is averaged once
                more.
            lag: s, time constant with which what acts follows them.
        """
        logged = [getattr(each, name) for each in self.flights]
        width = max((each.values.shape[1] for each in logged if each), default=0)
        rows = list[Held]()
        for flight, channel in zip(self.flights, logged, strict=True):
            if channel is None:
                none = np.zeros((flight.size, width))
                held = Held(none, none, np.zeros(flight.size))
            else:
                over = hold / channel.rate if hold else 0.0
                held = held_over(channel, flight.edges, delay, over)
            rows.append(lagging(held, lag, self.step, hold > 0.0) if lag else held)
        return join_arrays(rows, np.concatenate)

    def thrusts(self, sag: float, drift: float, *own: float) -> Array:
        """Thrust factor (steps,) from a power of the voltage, a drift since take-off
        (1/s), and a factor per flight.
        """
        rows = [
            a * each.voltage**sag * (1.0 + drift * each.since)
            for a, each in zip(own, self.flights, strict=True)
        ]
        return np.concatenate(rows)

    def rotor_speeds(
        self, rotors: Sequence[Sequence[Rotor]], held: Sequence[Held]
    ) -> Array:
        """Rotor speeds (sets, W, rotors) in rad/s at the starts of W windows, for
        several sets of rotor parameters.

        Args:
            rotors: rotors of each key.
            held: their commands.
        """
        names = ("time_constant_up", "time_constant_down", "max_speed")
        # all rotors of all keys at once: one whose numbers are arrays
        columns = {
            name: np.array([[[float(getattr(r, name)) for r in key]] for key in rotors])
            for name in names
        }
        every = with_changes(rotors[0][0], **columns)
        stacked = join_arrays(held, np.stack)
        before, after = stacked.before, stacked.after
        speeds = before[:, self.before(-self.run_in)]
        for k in range(-self.run_in, 0):
            at = self.before(k)
            begun = stacked.late[:, at, None]
            speeds = np.asarray(speed_after(every, speeds, before[:, at], begun))
            speeds = np.asarray(
                speed_after(every, speeds, after[:, at], self.step - begun)
            )
        return speeds

    def first_states(self, samples: Mapping[str, SensorSamples]) -> dict[str, Array]:
        """First estimates (W, k) of the states at the starts of W windows, from
        parabolas through nearby samples.
        """

        def parabola(name: str, width: int) -> tuple[Array, Array]:
            rows = samples.get(name)
            return (
                (np.zeros((self.count, width)),) * 2
                if rows is None
                else self._parabola(rows)
            )

        position, speed = parabola("position", 3)
        attitude, _ = parabola("quaternion", 4)
        joints, joint_rates = parabola("joint_positions", 0)
        # windows without a sample begin level, which is an attitude
        attitude[~attitude.any(axis=1)] = [1.0, 0.0, 0.0, 0.0]
        return {
            "position": position,
            "quaternion": unit_rows(attitude),
            "velocity": parabola("velocity", 3)[0] if "velocity" in samples else speed,
            "rate": parabola("gyro", 3)[0],
            "joints": joints,
            "joint_rates": (
                parabola("joint_rates", 0)[0]
                if "joint_rates" in samples
                else joint_rates
            ),
        }

    def _parabola(self, rows: SensorSamples) -> tuple[Array, Array]:
        """Value and slope (W, k) at the start of each of W windows, of a parabola
        through the nearest samples.
        """
        there = np.flatnonzero(rows.there)
        time = (there + rows.share[there]) * self.step
        usual = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
        # a parabola needs three samples: two to each side give five
        half = max(2, round(AROUND / usual))
        # a sensor of few samples leaves value and slope at zero, where the search
        # begins
        terms = np.zeros((2, self.count, rows.values.shape[1]))
        for i, (begin, owner) in enumerate(zip(self.begins, self.owners, strict=True)):
            first, last = np.searchsorted(there, self.firsts[owner : owner + 2])
            middle = int(
                np.clip(np.searchsorted(there, begin), first, max(first, last - 1))
            )
            chosen = there[max(first, middle - half) : min(last, middle + half + 1)]
            if not chosen.size:
                continue
            off = (chosen + rows.share[chosen] - begin) * self.step
            data = rows.values[chosen]
            if data.shape[1] == 4:
                data = continuous(data)
            powers = np.vander(off, min(3, len(chosen)), increasing=True)
            fitted = np.linalg.lstsq(powers, data, rcond=None)[0]
            terms[: min(2, len(fitted)), i] = fitted[:2]
        return terms[0], terms[1]
