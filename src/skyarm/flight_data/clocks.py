"""Offset and drift between the clocks of two data streams that measure the same motion.

A gyro and an attitude, or an accelerometer and a position or velocity, are two readings
of one signal y. The slower stream gives its mean over each of its intervals, the faster
one the same mean at any time. The offset and the drift minimise the difference: first
over all offsets by cross-correlation, then by Gauss-Newton with Huber's weights, so
that a landing does not decide. The intervals are of 95 %; residuals may be correlated
in time (W. K. Newey, K. D. West, "A simple, positive semi-definite, heteroskedasticity
and autocorrelation consistent covariance matrix", Econometrica 55, 1987; critical
values of N. M. Kiefer, T. J. Vogelsang, Econometric Theory 21, 2005). Offsets of parts
of the flight show whether one offset and drift are enough.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Annotated

import numpy as np

from skyarm.algebra.frames import to_base
from skyarm.flight_data.flight_data import FlightData
from skyarm.flight_data.quantities import GRAVITY
from skyarm.flight_data.series import (
    attitude_at,
    columns_at,
    integral_of,
    middle,
    rotations_between,
    thin_samples,
)
from skyarm.records.arrays import Array, Mask, doubles
from skyarm.records.files import must_be_one_of
from skyarm.records.immutable import positional
from skyarm.records.units import Unit

PAIRS = (
    ("gyro", "quaternion"),
    ("accelerometer", "velocity"),
    ("accelerometer", "position"),
)
"""Reference and stream whose clocks can be compared, the best first."""

POSE = ("position", "velocity", "quaternion")
"""Channels of motion capture, on one clock."""

NEGLIGIBLE = 1e-3
"""Delay (s) of a sample that is negligible: at 1 rad/s an attitude is 1 mrad off."""

STEP = 0.06
"""Shortest interval (s) over which the slower stream is differenced: 1 mm of noise in a
position is 0.7 m/s^2 in its second difference; over 0.01 s it would be 24."""

WITHIN, WIDEST = 2.0, math.inf
"""Ranges of searched offsets (s to both sides): within one file first, then without
limit."""

LEAST_CORRELATION, FIRM_CORRELATION = 0.5, 0.9
"""Least correlation of a found offset, and of one beyond the usual offsets within a
file: a quarter, and four fifths, of the variance in common; chosen."""

RIVAL, RIVALS = 0.97, 5
"""Fraction of the best correlation that no other offset may reach; number of other
peaks that are compared with it. Both chosen: the number bounds the time."""

SHARED = 0.5
"""Least fraction of the rows at one offset that must lie within the reference at a
rival, for a comparison there."""

FINER = 8
"""Steps of the searched offsets in a step of the slower stream: motion to 12 Hz and
more has its peaks some steps wide."""

MEMORY = 1.0
"""Longest correlation time (s) of residuals."""

CLIPPED, HUBER = 4.0, 2.0
"""Robust standard deviations at which a signal is clipped in the search, and above
which residuals weigh less in the fit."""

# a landing has most of the leverage on offset and drift, which weights of residuals do
# not take away
SHOCK = 8.0
"""Robust standard deviations of signal or slope above which a row is left out of the
fit."""

PARTS = 4
"""Number of parts of the flight whose offsets are compared."""

NORMAL = 1.959964
"""Half-width of a 95 % interval, in standard deviations."""

BETWEEN = 0.05
"""Least half-width of the interval of an offset, in steps of the reference: what lies
between its samples is unknown."""

ITERATIONS, FEWEST = 30, 10
"""Largest number of iterations of a search; least number of rows that determine a
clock."""

WORSE = 0.9
"""Ratio of the offset's interval to that of straightened stamps below which the stamps
are the true ones."""

EVEN = 0.95
"""Least fraction of the distances between new rows of a held pose, in rows, that are at
most twice the usual one."""

UNEVEN = 0.2
"""Largest deviation of a step from the usual one, as a fraction, up to which its
difference counts: all kernels are taken to be of the usual width."""


@positional
class ClockOffset:
    """Clock offset of a data stream: the reference's time of a stamp t is t + offset +
    drift (t - middle).

    Attributes:
        reference, stream: channels that were compared.
        correlation: correlation of both at the offset.
    """

    reference: str
    stream: str
    offset: Annotated[
        float,
        Unit(
            "s",
            "estimated offset from the stream's clock to the reference's, at the stamp"
            " middle",
        ),
    ]
    offset_error: Annotated[
        float, Unit("s", "half-width of the 95 % interval of the offset")
    ]
    drift: Annotated[
        float,
        Unit("s/s", "estimated drift of the stream's clock against the reference's"),
    ]
    drift_error: Annotated[
        float, Unit("s/s", "half-width of the 95 % interval of the drift")
    ]
    middle: Annotated[
        float, Unit("s", "stamp of the stream's clock at which the offset holds")
    ]
    wander: Annotated[
        float, Unit("s", "largest deviation of the offset in a part of the flight")
    ]
    correlation: float

    @property
    def words(self) -> str:
        """Line of text with offset and drift and their confidence intervals."""
        return (
            f"offset {1e3 * self.offset:+.2f} ms, +- {1e3 * self.offset_error:.2f},"
            f" drift {1e6 * self.drift:+.0f} ppm, +- {1e6 * self.drift_error:.0f},"
            f" parts of the flight up to {1e3 * self.wander:.1f} ms from that, of"
            f" {self.stream} against {self.reference} (correlation"
            f" {self.correlation:.2f})"
        )

    def times(self, time: Array) -> Array:
        """Convert times of the stream's clock to the reference's clock."""
        return time + self.offset + self.drift * (time - self.middle)


def clock_offset(
    flight: FlightData, stream: str = "", *, other: FlightData | None = None
) -> ClockOffset:
    """Estimate the clock offset of a data stream against the gyro or accelerometer of a
    flight.

    Args:
        flight: flight with the reference.
        stream: quaternion, velocity or position; the first that the flights allow if
            left out.
        other: flight with the stream, if it is another file.

    Raises:
        ValueError: one line: no such streams, or a motion that does not show the
            offset.
    """
    second = flight if other is None else other
    if stream and stream not in {name for _, name in PAIRS}:
        raise ValueError(
            f"stream = {stream!r}:"
            f" {must_be_one_of([name for _, name in PAIRS], stream)}"
        )
    for first, name in PAIRS:
        needed = {name, "quaternion"}  # positions and velocities need an attitude
        if first in flight and needed <= set(second) and name == (stream or name):
            pair = _Pair(flight, first, second, name)
            time = second[name].time
            # about the middle of the stream, where errors of offset and drift are
            # least related
            search = partial(
                _offset, pair, first, name, 0.5 * float(time[0] + time[-1])
            )
            if other is not None:
                return search(WIDEST, LEAST_CORRELATION)
            try:
                return search(WITHIN, LEAST_CORRELATION)
            except ValueError as none:
                try:
                    # farther off than clocks of one file are: believed of a firm
                    # correlation alone
                    return search(WIDEST, FIRM_CORRELATION)
                except ValueError:
                    # the first search is the usual one, so its reason is the one to
                    # read
                    raise none from None
    pairs = " or ".join(
        f"{first} and {name}" for first, name in PAIRS if name == (stream or name)
    )
    there = ", ".join({**flight.channels, **second.channels})
    raise ValueError(f"{flight.name}: clocks: must hold {pairs}; there is {there}")


def align(
    flight: FlightData, offset: ClockOffset, channels: Sequence[str]
) -> FlightData:
    """Return a flight with some time series shifted to the clock of the reference
    sensor, and with a note on that.
    """
    moved = {
        name: replace(flight[name], time=offset.times(flight[name].time))
        for name in channels
    }
    words = (
        f"{', '.join(channels)}: moved to the clock of {offset.reference}:"
        f" {offset.words}."
    )
    # resets are stamped on the pose's clock, so they move with it
    return replace(
        flight.with_channels(moved, words), jumps=_moved_jumps(flight, offset)
    )


def _moved_jumps(
    flight: FlightData, offset: ClockOffset
) -> tuple[tuple[float, float], ...]:
    """Steps with resets of a flight's pose, on the clock of the reference sensor."""
    return tuple(
        map(tuple, offset.times(np.array(flight.jumps).reshape(-1, 2)).tolist())
    )


def fresh_poses(flight: FlightData) -> FlightData:
    """Return a flight without the repeated pose samples of a logger that runs faster
    than the pose sensor.
    """
    for name in POSE:
        if name not in flight:
            continue
        channel = flight[name]
        new = np.flatnonzero(
            np.append(True, np.diff(channel.values, axis=0).any(axis=1))
        )
        rows = np.diff(new)
        # a vehicle that stands still repeats one row for long, and no other
        if (
            new.size >= FEWEST
            and np.median(rows) >= 2.0
            and np.quantile(rows, EVEN) <= 2.0 * np.median(rows)
        ):
            words = (
                f"{name}: {len(channel.values) - new.size} rows repeat the one before:"
                " left out."
            )
            fresh = replace(channel, time=channel.time[new], values=channel.values[new])
            flight = flight.with_channels({name: fresh}, words)
    return flight


def align_poses(flight: FlightData) -> tuple[FlightData, ClockOffset | None]:
    """Return a flight with its pose on the gyro's clock, and the offset; unchanged if
    the motion shows no offset.

    Of poses that a logger held the new rows are kept (:func:`fresh_poses`). Stamps of
    the attitude that are even but for the gyro's rows are straightened before, where it
    then fits the gyro as well. An offset and a drift that lie within their intervals,
    or move no sample by a millisecond, change nothing. Channels with the very times of
    the attitude are of its clock, too, unless the gyro has these times as well.
    """
    flight = fresh_poses(flight)
    if "gyro" not in flight or "quaternion" not in flight:
        return flight, None
    rows, stamps = flight["gyro"].time, flight["quaternion"].time
    alike = [name for name in flight if np.array_equal(flight[name].time, stamps)]
    pose = [
        name
        for name in flight
        if name in POSE or (name in alike and "gyro" not in alike)
    ]
    offset = _clock_of_attitude(flight)
    if (even := straight_stamps(stamps, rows)) is not stamps:
        words = (
            f"{', '.join(alike)}: stamps straightened: they are even but for the rows"
            " of the gyro."
        )
        straight = flight.with_channels(
            {name: replace(flight[name], time=even) for name in alike}, words
        )
        other = _clock_of_attitude(straight)
        # a recorder that takes every so many rows has such stamps, too, but true ones
        if other is not None and (
            offset is None or WORSE * other.offset_error < offset.offset_error
        ):
            flight, offset = straight, other
    if offset is None:
        return flight, None
    late = abs(offset.offset)
    drifted = 0.5 * abs(offset.drift) * flight["quaternion"].duration
    if late <= max(offset.offset_error, NEGLIGIBLE) and (
        abs(offset.drift) <= offset.drift_error or drifted <= NEGLIGIBLE
    ):
        return flight, None
    return align(flight, offset, pose), offset


def _clock_of_attitude(flight: FlightData) -> ClockOffset | None:
    """Clock offset of the measured attitude against the gyro; None if the motion does
    not determine it.
    """
    try:
        return clock_offset(flight, "quaternion")
    except ValueError:
        return None


def straight_stamps(time: Array, rows: Array) -> Array:
    """Evenly spaced times (s) of samples whose time stamps were rounded to log rows;
    the stamps if they were not.

    Rounded stamps are a saw of less than a row around a straight line. Stamps stay if
    one is no row, if all are equally many rows apart, as samples of the rows themselves
    are, or if a line leaves a row or more: a gap, a real jitter.
    """
    if (
        time.size < FEWEST
        or not np.isin(time, rows).all()
        or np.ptp(np.diff(np.searchsorted(rows, time))) == 0
    ):
        return time
    count = np.arange(time.size) - 0.5 * (time.size - 1)
    line = np.mean(time) + count * float(count @ time) / float(count @ count)
    return line if np.ptp(time - line) < np.median(np.diff(rows)) else time


def join_flights(
    flight: FlightData, other: FlightData
) -> tuple[FlightData, ClockOffset]:
    """Merge the time series of a second file of the same flight, shifted to the first's
    clock; also return the offset.

    Position, velocity and attitude refer to one world: the x axis of a motion capture
    is not north. The second file always has an attitude, without which no clock is
    found, so its pose replaces all of the first one's.

    Raises:
        ValueError: one line: the motion does not show the offset of the clocks.
    """
    offset = clock_offset(flight, other=other)
    onboard = {name: each for name, each in flight.channels.items() if name not in POSE}
    dropped = [name for name in flight if name in POSE]
    added = {
        name: replace(
            each, time=offset.times(each.time), source=f"{other.name}: {each.source}"
        )
        for name, each in other.channels.items()
        if name not in onboard
    }
    words = [
        f"{', '.join(added)}: are of {other.name}, moved to the clock of"
        f" {offset.reference}: {offset.words}."
    ]
    if dropped:
        words.append(
            f"{', '.join(dropped)}: of {flight.name} are dropped: a pose is of one"
            f" world, that of {other.name}."
        )
    both = replace(
        flight,
        channels={**onboard, **added},
        notes=(*flight.notes, *other.notes, *words),
    )
    return (
        replace(
            both,
            # of what both files state that of the file with the reference counts
            facts={**other.facts, **flight.facts},
            jumps=_moved_jumps(other, offset),
        ),
        offset,
    )


class _Pair:
    """Signal of a reference sensor, and averages of it over time kernels, which a
    second sensor measured.

    Attributes:
        reference: times (M,), s, of the signal.
        integrals: the signal (M, 3) and its integrals, as many as a kernel has boxes.
        time: (N,) s, middles of the kernels. values: (N, 3). width: width of a box, s.

    Raises:
        ValueError: one line: a stream or a reference of a few rows.
    """

    def __init__(
        self, flight: FlightData, first: str, other: FlightData, name: str
    ) -> None:
        time, values = thin_samples(other[name], STEP)
        if time.size < FEWEST:
            raise ValueError(
                f"{other.name}: {name}: {other[name].time.size} rows: must be of a"
                " longer flight"
            )
        steps = np.diff(time)
        order = 2 if name == "position" else 1
        self.width = float(np.median(steps))
        usual = np.abs(steps - self.width) < UNEVEN * self.width
        for begin, end in other.jumps:
            usual &= (time[1:] <= begin) | (time[:-1] >= end)
        # a second difference is of two steps, so both must be usual
        even = np.convolve(usual, np.ones(order), "valid") == order
        self.reference = flight[first].time
        self.integrals = [flight[first].values]
        for _ in range(order):
            slopes = (
                rotations_between(values[:-1], values[1:])
                if name == "quaternion"
                else np.diff(values, axis=0)
            )
            values = slopes / np.diff(time)[:, None]
            time = middle(time)
            self.integrals.append(integral_of(self.reference, self.integrals[-1]))
        self.time = time[even]
        self.values = values[even]
        self.order = order
        if min(self.reference.size, self.time.size) < FEWEST:
            raise ValueError(f"clock of {name}: must be of a longer flight")
        if name != "quaternion":
            # an accelerometer reads acceleration less gravity, which points down
            force = self.values + np.array([0.0, 0.0, GRAVITY])
            self.values = to_base(attitude_at(other["quaternion"], self.time), force)

    def means(self, when: Array) -> tuple[Array, Array]:
        """Averages of the reference signal over kernels centred at given times (s), and
        their time derivatives.
        """
        edges = when + self.width * (
            np.arange(self.order + 1)[:, None] - 0.5 * self.order
        )
        # the last integral gives the mean, and the one before it the slope
        tables = self.integrals[:-3:-1]
        values = [
            np.stack([columns_at(each, self.reference, table) for each in edges])
            for table in tables
        ]
        # the order-th difference of the order-th integral is the mean over the kernel
        mean, slope = (
            np.diff(each, self.order, axis=0)[0] / self.width**self.order
            for each in values
        )
        return mean, slope

    def is_inside(self, when: Array) -> Mask:
        """Mask of the averaging kernels that lie within the time range of the reference
        signal.
        """
        return _is_inside(self.reference, when, self.width * self.order)


def _is_inside(reference: Array, when: Array, edge: float) -> Mask:
    """Mask of the times that lie at least ``edge`` s within the time range of a
    reference signal.
    """
    return np.asarray((when - edge >= reference[0]) & (when + edge <= reference[-1]))


def _scale(values: Array) -> Array:
    """Robust standard deviation of each column, by the median absolute deviation."""
    # 1.4826: of normal numbers this is their standard deviation; 1e-12: of constant
    # ones it is 0, by which nothing can be divided
    return (
        1.4826 * np.median(np.abs(values - np.median(values, axis=0)), axis=0) + 1e-12
    )


def _is_usual(values: Array) -> Mask:
    """Mask of the samples (rows) without shocks, which would dominate a fit."""
    return np.asarray(
        (np.abs(values - np.median(values, axis=0)) < SHOCK * _scale(values)).all(
            axis=1
        )
    )


def _clip(values: Array) -> Array:
    """Clip a signal to some robust standard deviations about its median, and subtract
    its mean.
    """
    limit = CLIPPED * _scale(values)
    usual = np.median(values, axis=0)
    clipped = np.clip(values, usual - limit, usual + limit)
    return np.asarray(clipped - clipped.mean(axis=0))


def _best_offset(pair: _Pair, widest: float) -> tuple[float, float | None]:
    """Clock offset (s) with the highest cross-correlation on a fine grid, and another
    that may be as good.

    A vehicle that shakes faster than the stream is sampled correlates about as well one
    period of its motion beside the true offset. Such a rival must be worse by more than
    chance (F. X. Diebold, R. S. Mariano, "Comparing predictive accuracy", Journal of
    Business and Economic Statistics 13, 1995).

    Raises:
        ValueError: one line: streams that hardly overlap.
    """
    step = pair.width / FINER
    grid = np.arange(pair.reference[0], pair.reference[-1], step)
    place = np.rint((pair.time - pair.time[0]) / step).astype(int)
    a = len(grid)
    b = int(place[-1]) + 1
    given, values = _clip(pair.means(grid)[0]), _clip(pair.values)
    seen = np.zeros((b, values.shape[1]))
    np.add.at(seen, place, values)
    # padded with zeros beyond both lengths, so that no lag wraps around
    size = 1 << (a + b).bit_length()
    spectra = np.fft.rfft(given, size, axis=0) * np.fft.rfft(seen, size, axis=0).conj()
    lags = np.arange(1 - b, a)
    # negative lags stand at the end of the result, where negative indices count from
    sums = np.fft.irfft(spectra.sum(axis=1), size)[lags]
    offsets = grid[0] - pair.time[0] + lags * step
    overlap = np.minimum(lags + b, a) - np.maximum(lags, 0)
    # a small overlap correlates well by chance; three tenths of the shorter stream are
    # chosen
    near = (np.abs(offsets) <= widest) & (overlap >= 0.3 * min(a, b))
    if not near.any():
        raise ValueError("clocks: must be of streams that were taken at the same time")
    scores = np.where(near, sums, -np.inf)
    best = int(np.argmax(scores))
    peaks = (
        np.flatnonzero((scores[1:-1] >= scores[:-2]) & (scores[1:-1] >= scores[2:])) + 1
    )
    # half a step of the stream beside the best is the same hill
    peaks = peaks[np.abs(peaks - best) > FINER // 2]
    for rival in peaks[np.argsort(-scores[peaks])][:RIVALS]:
        close = scores[rival] > RIVAL * scores[best] > 0.0
        if close or _is_as_good(pair, float(offsets[best]), float(offsets[rival])):
            return float(offsets[best]), float(offsets[rival])
    return float(offsets[best]), None


def _is_as_good(pair: _Pair, offset: float, rival: float) -> bool:
    """True if the stream correlates as well at another offset (s), or deviates there by
    chance alone.
    """
    inside = pair.is_inside(pair.time + offset)
    both = inside & pair.is_inside(pair.time + rival)
    if both.sum() < max(FEWEST, SHARED * inside.sum()):
        return False
    given = _clip(pair.values[both])
    own, other = (
        _clip(pair.means(pair.time[both] + each)[0]) for each in (offset, rival)
    )
    if np.sum(given * other) > RIVAL * np.sum(given * own):
        return True
    worse = np.sum((given - other) ** 2 - (given - own) ** 2, axis=1)
    memory = max(1, round(MEMORY / pair.width))
    spread = math.sqrt(_long_run(worse[:, None] - worse.mean(), memory)[0, 0])
    return float(worse.sum()) < NORMAL * spread


def _refine(
    pair: _Pair, rows: Mask, start: Array, middle: float, free: int = 2
) -> tuple[Array, Array]:
    """Refine offset and drift by Gauss-Newton with scale and bias per axis; also
    returns 95 % half-widths.

    Args:
        pair: signals.
        rows: (N,) of the stream that count.
        start: offset (s) and drift.
        middle: s, time of the stream at which the offset holds.
        free: 1 if only the offset is searched.
    """
    estimate, errors = start.copy(), np.zeros(2)
    for _ in range(ITERATIONS):
        when = pair.time + estimate[0] + estimate[1] * (pair.time - middle)
        inside = rows & pair.is_inside(when)
        time = pair.time[inside] - middle
        given = pair.values[inside]
        fitted, slope = pair.means(when[inside])
        usual = _is_usual(np.hstack([fitted, slope, given]))
        time = time[usual]
        given = given[usual]
        fitted = fitted[usual]
        slope = slope[usual]
        count, axes = fitted.shape
        moved = slope[:, :, None] * time[:, None, None] ** np.arange(free)
        biases = np.broadcast_to(np.eye(axes), (count, axes, axes))
        jacobian = np.concatenate([moved, biases, biases * fitted[:, :, None]], axis=2)
        change, residual, weights = _robust(jacobian, given - fitted)
        # Gauss-Newton is linear in the shift, which holds within a kernel's width
        limit = pair.width / max(1.0, float(np.ptp(time))) ** np.arange(free)
        step = np.clip(change[:free], -limit, limit)
        estimate[:free] += step
        # 0.1 us and 0.01 ppm: far below what a clock's interval can be
        if np.abs(step[0]) < 1e-7 and np.abs(step[-1]) < 1e-8:
            break
    moments = np.einsum("nap,na->np", jacobian * weights[:, :, None], residual)
    # of Huber's loss, linear beyond
    curved = (jacobian * (weights == 1.0)[:, :, None]).reshape(count * axes, -1)
    memory = max(1, round(MEMORY / pair.width))
    share = memory / max(count, 1)
    # of an estimate over some of the rows (Kiefer, Vogelsang)
    normal = NORMAL + 2.9694 * share + 0.4160 * share**2
    # of residuals that are correlated over neighbouring samples (Newey, West); pinv, as
    # scale and bias of an axis that hardly moves are one
    inverse = np.linalg.pinv(curved.T @ curved)
    covariance = inverse @ _long_run(moments, memory) @ inverse
    errors[:free] = normal * np.sqrt(np.maximum(np.diag(covariance)[:free], 0.0))
    return estimate, errors


def _offset(
    pair: _Pair, first: str, name: str, middle: float, widest: float, least: float
) -> ClockOffset:
    """Estimate offset and drift of a data stream by cross-correlation, then least
    squares.
    """
    best, rival = _best_offset(pair, widest)
    # -inf: of all rows
    estimate, errors = _refine(pair, pair.time > -np.inf, np.array([best, 0.0]), middle)
    when = pair.time + estimate[0] + estimate[1] * (pair.time - middle)
    inside = pair.is_inside(when)
    a, b = _clip(pair.means(when[inside])[0]), _clip(pair.values[inside])
    # 1e-300: a stream at rest has none, and 0 / 0 is no number
    correlation = float(
        np.sum(a * b) / max(np.sqrt(np.sum(a * a) * np.sum(b * b)), 1e-300)
    )
    if correlation < least:
        raise ValueError(
            f"clock of {name}: correlation with {first} = {correlation:.2f}: must be at"
            f" least {least:g}, else the motion does not show its offset, or the axes"
            " differ: a take of Motive must have y up, and its body the nose along x"
        )
    if rival is not None:
        raise ValueError(
            f"clocks: offsets of {best:.2f} and {rival:.2f} s fit equally well: must be"
            " a motion that does not repeat itself"
        )
    wander = 0.0
    for begin, end in pairwise(np.linspace(pair.time[0], pair.time[-1], PARTS + 1)):
        part = (pair.time >= begin) & (pair.time <= end)
        if (part & inside).sum() > FEWEST:
            own, _ = _refine(pair, part, estimate, middle, 1)
            wander = max(wander, abs(float(own[0] - estimate[0])))
    (offset, drift), (offset_error, drift_error) = estimate.tolist(), errors.tolist()
    # between the reference's samples nothing is measured, however many rows agree
    offset_error = math.hypot(
        offset_error, BETWEEN * float(np.median(np.diff(pair.reference)))
    )
    return ClockOffset(
        first,
        name,
        offset,
        offset_error,
        drift,
        drift_error,
        middle,
        wander,
        correlation,
    )


def _robust(jacobian: Array, given: Array) -> tuple[Array, Array, Array]:
    """Robust least squares with Huber weights; returns parameters, residuals and
    weights.
    """
    count, axes = given.shape
    flat, weights = jacobian.reshape(count * axes, -1), np.ones_like(given)
    # four rounds of new weights, chosen
    for _ in range(4):
        root = np.sqrt(weights)
        change, *_ = np.linalg.lstsq(
            flat * root.reshape(-1, 1), (given * root).ravel(), rcond=None
        )
        residual = given - (flat @ change).reshape(count, axes)
        # 1e-12, so that no residual is divided by 0
        weights = np.minimum(1.0, HUBER * _scale(residual) / (np.abs(residual) + 1e-12))
    return doubles(change), residual, weights


def _long_run(moments: Array, memory: int) -> Array:
    """Newey-West covariance (k, k) of the sum of samples (N, k) that are correlated
    over neighbouring ones.
    """
    sums = np.cumsum(np.pad(moments, ((memory + 1, memory), (0, 0))), axis=0)
    # whose products have Bartlett's weights
    windows = sums[memory + 1 :] - sums[: -memory - 1]
    return np.asarray(windows.T @ windows / (memory + 1))
