"""Offset and drift between the clocks of two streams that measure the same motion.

A gyro and an attitude, or an accelerometer and a position or velocity, are two readings of one signal y. The slower
stream gives its mean over each of its intervals, the faster one the same mean at any time. The offset and the drift
minimise the difference: first over all offsets by cross-correlation, then by Gauss-Newton with Huber's weights, so that
a landing does not decide. The intervals are of 95 %; residuals may be correlated in time (W. K. Newey, K. D. West, "A
simple, positive semi-definite, heteroskedasticity and autocorrelation consistent covariance matrix", Econometrica 55,
1987; critical values of N. M. Kiefer, T. J. Vogelsang, Econometric Theory 21, 2005). Offsets of parts of the flight
show whether one offset and drift are enough.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Annotated, TypeAlias

import numpy as np

from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.quantities import GRAVITY
from skyarm.flight_data.raw_tables import to_base
from skyarm.flight_data.series import attitude_at, columns_at, integral_of, middle, thin_samples
from skyarm.records.arrays import Array, Mask
from skyarm.records.files import must_be_one_of
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit

PAIRS = (("gyro", "quaternion"), ("accelerometer", "velocity"), ("accelerometer", "position"))
"""Reference and stream whose clocks can be compared, the best first."""

POSE = ("position", "velocity", "quaternion")
"""Channels of motion capture, on one clock."""

NEGLIGIBLE = 1e-3
"""s, by which a sample may be late."""

STEP = 0.06
"""Shortest interval, s, over which the slower stream is differenced."""

WITHIN, WIDEST = 2.0, math.inf
"""Offsets that are searched, s to both sides: within one file, and of two files."""

LEAST_CORRELATION = 0.5
"""Correlation from which an offset counts as found."""

RIVAL = 0.97
"""Share of the best correlation that no other offset may reach."""

MEMORY = 1.0
"""Time, s, over which residuals are correlated at most."""

CLIPPED, HUBER = 4.0, 2.0
"""Robust standard deviations beyond which a signal is cut off in the search, and residuals weigh less in the fit."""

SHOCK = 8.0
"""Robust standard deviations of signal or slope beyond which a row is left out of the fit."""

PARTS = 4
"""Parts of the flight whose own offsets are compared."""

NORMAL = 1.959964
"""Half-width of an interval of 95 %, in standard deviations."""

ITERATIONS = 30


@immutable
class ClockOffset:
    """Offset of a stream's clock: a sample stamped t was taken at t + offset + drift (t - middle) of the reference.

    Attributes:
        reference, stream: channels that were compared.
        correlation: of both at the offset.
    """

    reference: str
    stream: str
    offset: Annotated[float, Unit("s")]
    offset_error: Annotated[float, Unit("s", "half-width of the interval of 95 %")]
    drift: Annotated[float, Unit("s/s")]
    drift_error: Annotated[float, Unit("s/s", "half-width of the interval of 95 %")]
    middle: Annotated[float, Unit("s", "time of the stream's clock at which the offset holds")]
    wander: Annotated[float, Unit("s", "largest distance of the offset of a part of the flight")]
    correlation: float

    @property
    def words(self) -> str:
        """Offset and drift with their intervals as one line of text."""
        return (
            f"offset {1e3 * self.offset:+.2f} ms, +- {1e3 * self.offset_error:.2f}, drift {1e6 * self.drift:+.0f} ppm, "
            f"+- {1e6 * self.drift_error:.0f}, parts of the flight up to {1e3 * self.wander:.1f} ms from that, of "
            f"{self.stream} against {self.reference} "
            f"(correlation {self.correlation:.2f})"
        )

    def times(self, time: Array) -> Array:
        """Times of the reference's clock from times of the stream's."""
        return time + self.offset + self.drift * (time - self.middle)


def clock_offset(flight: FlightData, stream: str = "", *, other: FlightData | None = None) -> ClockOffset:
    """Find the offset of a stream's clock against the gyro or accelerometer of a flight.

    Args:
        flight: with the reference.
        stream: quaternion, velocity or position; the first that the flights allow if left out.
        other: flight with the stream, if it is another file.

    Raises:
        ValueError: one line: no such streams, or a motion that does not show the offset.
    """
    second = flight if other is None else other
    if stream and stream not in {name for _, name in PAIRS}:
        raise ValueError(f"stream = {stream!r}: {must_be_one_of([name for _, name in PAIRS], stream)}")
    for first, name in PAIRS:
        if first in flight and name in second and name == (stream or name) and _is_measurable(second, name):
            return _offset(flight[first], first, name, *_means(second, name), WITHIN if other is None else WIDEST)
    wanted = " or ".join(f"{first} and {name}" for first, name in PAIRS if name == (stream or name))
    there = ", ".join({**flight.channels, **second.channels})
    raise ValueError(f"{flight.name}: clocks: must hold {wanted}; there is {there}")


def align(flight: FlightData, found: ClockOffset, channels: Sequence[str]) -> FlightData:
    """Return a flight with the times of some channels moved to the clock of the reference, and a note."""
    moved = {name: replace(flight[name], time=found.times(flight[name].time)) for name in channels}
    words = f"{', '.join(channels)}: moved to the clock of {found.reference}: {found.words}."
    return flight.with_channels(moved, words)


def align_poses(flight: FlightData) -> tuple[FlightData, ClockOffset | None]:
    """Return a flight whose pose is on the gyro's clock, and its offset; the same flight if that shows none.

    An offset and a drift that lie within their intervals, or move no sample by a millisecond, change nothing. Channels
    with the very times of the attitude are of its clock, too, unless the gyro has these times as well.
    """
    try:
        found = clock_offset(flight, "quaternion")
    except ValueError:  # no attitude, or a motion that does not show its clock
        return flight, None
    time = flight["quaternion"].time
    late = abs(found.offset), 0.5 * abs(found.drift) * float(np.ptp(time))
    if (late[0] <= max(found.offset_error, NEGLIGIBLE)) and (
        abs(found.drift) <= found.drift_error or late[1] <= NEGLIGIBLE
    ):
        return flight, None
    own = not np.array_equal(time, flight["gyro"].time)
    moved = [name for name in flight if name in POSE or (own and np.array_equal(flight[name].time, time))]
    return align(flight, found, moved), found


def join_flights(flight: FlightData, other: FlightData) -> tuple[FlightData, ClockOffset]:
    """Return a flight with the channels of another file of the same flight, on the first one's clock, and the offset.

    Raises:
        ValueError: one line: the motion does not show the offset of the clocks.
    """
    found = clock_offset(flight, other=other)
    added = {
        name: replace(each, time=found.times(each.time), source=f"{other.name}: {each.source}")
        for name, each in other.channels.items()
        if name not in flight
    }
    words = f"{', '.join(added)}: are of {other.name}, moved to the clock of {found.reference}: {found.words}."
    both = flight.with_channels(added, *other.notes, words)
    return replace(both, facts={**other.facts, **flight.facts}), found


def _is_measurable(flight: FlightData, name: str) -> bool:
    """True if a stream gives rates or forces: positions and velocities need an attitude of the same clock."""
    return name == "quaternion" or "quaternion" in flight


@immutable(kw_only=False)
class _Means:
    """Means of a signal: (N, 3) at (N,) s, each over a kernel of ``order`` boxes of a width in s."""

    time: Array
    values: Array
    width: float
    order: int


def _means(flight: FlightData, name: str) -> tuple[_Means, Array]:
    """Means of the reference's signal from a stream, with the times of its rows."""
    channel = flight[name]
    time, values = thin_samples(channel, STEP)
    if time.size < 10:
        raise ValueError(f"{flight.name}: {name}: {channel.time.size} rows: must be of a longer flight")
    steps = np.diff(time)
    width = float(np.median(steps))
    off = np.abs(steps - width)
    if name == "position":
        at, order = time[1:-1], 2
        slopes = (values[2:] - 2.0 * values[1:-1] + values[:-2]) / width**2
        even = (off[1:] < 0.01 * width) & (off[:-1] < 0.01 * width)
    else:
        at, order = middle(time), 1
        slopes = (rotation_steps(values) if name == "quaternion" else np.diff(values, axis=0)) / steps[:, None]
        even = off < 0.2 * width
    if name != "quaternion":
        slopes = to_base(attitude_at(flight["quaternion"], at), slopes + np.array([0.0, 0.0, GRAVITY]))
    return _Means(at[even], slopes[even], width, order), time


def rotation_steps(quaternions: Array) -> Array:
    """Rotation vectors (N - 1, 3), base axes, from each attitude to the next."""
    w, v = quaternions[:, :1], quaternions[:, 1:]
    real = w[:-1] * w[1:] + np.sum(v[:-1] * v[1:], axis=1, keepdims=True)
    imaginary = w[:-1] * v[1:] - w[1:] * v[:-1] - np.cross(v[:-1], v[1:])
    size = np.linalg.norm(imaginary, axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(size, np.abs(real))
    found: Array = np.sign(real) * imaginary * np.where(size > 1e-12, angle / np.maximum(size, 1e-12), 2.0)
    return found


Smooth: TypeAlias = Callable[[Array], tuple[Array, Array]]


def _smooth(channel: Channel, width: float, order: int) -> Smooth:
    """Function of time that returns the means of a channel over a kernel, and their slopes."""
    time, values = channel.time, channel.values
    integral = integral_of(time, values)
    double = integral_of(time, integral)

    def at(table: Array, when: Array) -> Array:
        return columns_at(when, time, table)

    def mean(when: Array) -> tuple[Array, Array]:
        if order == 1:
            before, after = when - 0.5 * width, when + 0.5 * width
            means, slopes = (at(each, after) - at(each, before) for each in (integral, values))
            return means / width, slopes / width
        before, after = when - width, when + width
        means, slopes = (at(each, after) - 2.0 * at(each, when) + at(each, before) for each in (double, integral))
        return means / width**2, slopes / width**2

    return mean


def _offset(reference: Channel, first: str, name: str, means: _Means, time: Array, widest: float) -> ClockOffset:
    """Offset and drift of a stream by least squares, from the best offset of the cross-correlation on."""
    if reference.time.size < 10 or means.time.size < 10:
        raise ValueError(f"clock of {name}: must be of a longer flight")
    mean = _smooth(reference, means.width, means.order)
    start = _best_offset(reference, means, mean, widest)
    middle = 0.5 * float(time[0] + time[-1])
    found, errors = _refine(reference, means, mean, np.array([start, 0.0]), middle)
    inside = _inside(reference, means, means.time + found[0])
    fitted, _ = mean(means.time[inside] + found[0] + found[1] * (means.time[inside] - middle))
    correlation = _correlation(_clip(fitted), _clip(means.values[inside]))
    if correlation < LEAST_CORRELATION:
        raise ValueError(
            f"clock of {name}: correlation with {first} = {correlation:.2f}: must be at least {LEAST_CORRELATION}, "
            "else the motion does not show its offset"
        )
    edges = np.linspace(means.time[0], means.time[-1], PARTS + 1)
    wander = 0.0
    for begin, end in pairwise(edges.tolist()):
        rows = (means.time >= begin) & (means.time <= end)
        part = replace(means, time=means.time[rows], values=means.values[rows])
        if _inside(reference, part, part.time + found[0]).sum() > 10:
            own, _ = _refine(reference, part, mean, found, middle, drifts=False)
            wander = max(wander, abs(float(own[0] - found[0])))
    return ClockOffset(
        reference=first,
        stream=name,
        offset=float(found[0]),
        offset_error=float(errors[0]),
        drift=float(found[1]),
        drift_error=float(errors[1]),
        middle=middle,
        wander=wander,
        correlation=correlation,
    )


def _scale(values: Array) -> Array:
    """Robust standard deviation of each column, from the median distance from its median."""
    distance = np.median(np.abs(values - np.median(values, axis=0)), axis=0)
    return 1.4826 * distance + 1e-12


def _is_usual(values: Array) -> Mask:
    """Rows without a shock, which would have most of the leverage on a fit."""
    distance = np.abs(values - np.median(values, axis=0)) / _scale(values)
    found: Mask = distance.max(axis=1, initial=0.0) < SHOCK
    return found


def _clip(values: Array) -> Array:
    """Signal without its medians, cut off at some robust standard deviations."""
    limit = CLIPPED * _scale(values)
    return np.clip(values - np.median(values, axis=0), -limit, limit)


def _inside(reference: Channel, means: _Means, when: Array) -> Mask:
    """Rows whose kernels lie within the reference."""
    edge = means.width * means.order
    found: Mask = (when - edge >= reference.time[0]) & (when + edge <= reference.time[-1])
    return found


def _correlation(first: Array, second: Array) -> float:
    """Correlation of two signals (N, 3), each column without its mean, all columns together."""
    a, b = first - first.mean(axis=0), second - second.mean(axis=0)
    size = float(np.sqrt(np.sum(a * a) * np.sum(b * b)))
    return float(np.sum(a * b)) / size if size > 0.0 else 0.0


def _best_offset(reference: Channel, means: _Means, mean: Smooth, widest: float) -> float:
    """Offset of the largest correlation on an even grid.

    Raises:
        ValueError: one line: two offsets that are equally good.
    """
    step = means.width
    grid = np.arange(reference.time[0], reference.time[-1], step)
    other = np.arange(means.time[0], means.time[-1], step)
    a = _clip(mean(grid)[0])
    b = _clip(columns_at(other, means.time, means.values))
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    size = 1 << (len(a) + len(b) - 1).bit_length()
    spectrum = np.fft.rfft(a, size, axis=0) * np.conj(np.fft.rfft(b, size, axis=0))
    sums = np.fft.irfft(spectrum, size, axis=0).sum(axis=1)
    lags = np.concatenate([np.arange(-len(b) + 1, 0), np.arange(len(a))])
    sums = np.concatenate([sums[size - len(b) + 1 :], sums[: len(a)]])
    offsets = grid[0] - other[0] + lags * step
    overlap = np.minimum(lags + len(b), len(a)) - np.maximum(lags, 0)
    near = (np.abs(offsets) <= widest) & (overlap >= 0.3 * min(len(a), len(b)))
    if not near.any():
        raise ValueError("clocks: must be of streams that were taken at the same time")
    scores = np.where(near, sums, -np.inf)
    best = int(np.argmax(scores))
    peaks = np.flatnonzero((scores[1:-1] >= scores[:-2]) & (scores[1:-1] >= scores[2:])) + 1
    rivals = peaks[np.abs(lags[peaks] - lags[best]) * step > 3.0 * step]
    rival = int(rivals[np.argmax(scores[rivals])]) if rivals.size else best
    if rival != best and scores[rival] > RIVAL * scores[best] > 0.0:
        raise ValueError(
            f"clocks: offsets of {offsets[best]:.2f} and {offsets[rival]:.2f} s fit equally well: must be a motion "
            "that does not repeat itself"
        )
    return float(offsets[best])


def _refine(
    reference: Channel, means: _Means, mean: Smooth, start: Array, middle: float, *, drifts: bool = True
) -> tuple[Array, Array]:
    """Offset and drift by Gauss-Newton, a scale and a bias of each axis beside them, and half-widths of 95 %."""
    found = start.copy()
    free = [0, 1] if drifts else [0]
    for _ in range(ITERATIONS):
        inside = _inside(reference, means, means.time + found[0] + found[1] * (means.time - middle))
        time, given = means.time[inside] - middle, means.values[inside]
        fitted, slope = mean(means.time[inside] + found[0] + found[1] * time)
        usual = _is_usual(fitted) & _is_usual(slope) & _is_usual(given)
        time, given, fitted, slope = time[usual], given[usual], fitted[usual], slope[usual]
        count, axes = fitted.shape
        jacobian = np.zeros((count, axes, 2 + 2 * axes))
        jacobian[:, :, 0], jacobian[:, :, 1] = slope, slope * time[:, None]
        for axis in range(axes):
            jacobian[:, axis, 2 + axis], jacobian[:, axis, 2 + axes + axis] = 1.0, fitted[:, axis]
        jacobian = jacobian[:, :, [*free, *range(2, 2 + 2 * axes)]]
        change, residual, weights = _robust(jacobian, given - fitted)
        limit = np.array([means.width, means.width / max(1.0, float(np.ptp(time)))])[free]
        step = np.clip(change[: len(free)], -limit, limit)
        found[free] += step
        if np.abs(step[0]) < 1e-7 and np.abs(step[-1]) < 1e-8:
            break
    moments = np.einsum("nap,na->np", jacobian * weights[:, :, None], residual)
    curved = (jacobian * (weights == 1.0)[:, :, None]).reshape(count * axes, -1)  # of Huber's loss, linear beyond
    memory = max(1, round(MEMORY / means.width))
    share = memory / max(count, 1)
    normal = NORMAL + 2.9694 * share + 0.4160 * share**2  # of an estimate over some of the rows (Kiefer, Vogelsang)
    errors = np.zeros(2)
    errors[free] = normal * np.sqrt(np.maximum(np.diag(_covariance(curved, moments, memory))[: len(free)], 0.0))
    return found, errors


def _robust(jacobian: Array, given: Array) -> tuple[Array, Array, Array]:
    """Least squares with Huber's weights: parameters, residuals and weights."""
    count, axes = given.shape
    flat, weights = jacobian.reshape(count * axes, -1), np.ones_like(given)
    for _ in range(4):
        root = np.sqrt(weights)
        change, *_ = np.linalg.lstsq(flat * root.reshape(-1, 1), (given * root).ravel(), rcond=None)
        residual = given - (flat @ change).reshape(count, axes)
        weights = np.minimum(1.0, HUBER * _scale(residual) / (np.abs(residual) + 1e-12))
    return np.asarray(change, dtype=float), residual, weights


def _covariance(jacobian: Array, moments: Array, memory: int) -> Array:
    """Covariance of a least-squares estimate whose residuals are correlated over some rows (Newey and West)."""
    inverse = np.linalg.pinv(jacobian.T @ jacobian)
    spread = moments.T @ moments
    for lag in range(1, min(memory, len(moments) - 1) + 1):
        shifted = moments[lag:].T @ moments[:-lag]
        spread = spread + (1.0 - lag / (memory + 1.0)) * (shifted + shifted.T)
    return inverse @ spread @ inverse
