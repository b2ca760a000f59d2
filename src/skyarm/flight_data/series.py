"""Resampling of time series: linear interpolation, means over intervals, and
interpolation of attitudes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Quaternion
from skyarm.algebra.frames import continuous, turn_vectors, unit_rows
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.quantities import QUANTITIES
from skyarm.records.arrays import Array, doubles, lengths

FASTER = 1.5
"""Ratio of a channel's rate to that of a clock above which its samples are averaged."""


def columns_at(time: npt.ArrayLike, known: npt.ArrayLike, values: Array) -> Array:
    """Values (N, k) of a series at given times (N,) by linear interpolation, constant
    beyond the ends.

    Args:
        time: (N,), at which the values are asked.
        known: (M,), rising, of the samples.
        values: (M, k), samples.
    """
    asked, given = doubles(time), doubles(known)
    return np.stack([np.interp(asked, given, column) for column in values.T], axis=1)


def values_at(channel: Channel, time: Array) -> Array:
    """Values (N, k) of a time series at given times (s), by linear interpolation."""
    return columns_at(time, channel.time, channel.values)


def thin_samples(channel: Channel, step: float) -> tuple[Array, Array]:
    """Thin out a time series to samples about ``step`` s apart; return times and
    values.
    """
    every = max(1, round(step * channel.rate))
    return channel.time[::every], channel.values[::every]


def middle(rows: Array) -> Array:
    """Mean of each row of an array and the next one: (N + 1, ...) to (N, ...)."""
    return 0.5 * (rows[1:] + rows[:-1])


def attitude_at(attitude: Channel, time: Array) -> Array:
    """Measured attitude (unit quaternions w x y z) at given times (s), by linear
    interpolation.
    """
    return unit_rows(columns_at(time, attitude.time, continuous(attitude.values)))


def in_turned_axes(name: str, channel: Channel, turn: Quaternion) -> Channel:
    """Channel of a quantity of a name in other axes of the base, to which a rotation
    turns those that it is in.
    """
    if name == "quaternion":  # from the new axes to the old, then to the world
        attitudes = Quaternion(*channel.values.T) * turn.conjugate()
        return replace(channel, values=np.stack([*attitudes], axis=1))
    return replace(channel, values=turn_vectors(np.array([[*turn]]), channel.values))


def rotations_between(first: Array, second: Array) -> Array:
    """Rotation vectors (K, 3), base axes, between two series of attitudes (K, 4), w x y
    z, the shorter way.
    """
    w, *axis = Quaternion(*first.T).conjugate() * Quaternion(*second.T)
    rows = np.stack(axis, axis=1) * np.where(w < 0.0, -1.0, 1.0)[:, None]
    size = lengths(rows)
    angle = 2.0 * np.arctan2(size, np.abs(w))
    # of a tiny turn the angle is twice the sine, which spares 0 / 0
    return np.asarray(
        rows * np.where(size > 1e-9, angle / np.maximum(size, 1e-300), 2.0)[:, None]
    )


def integral_of(time: Array, values: Array) -> Array:
    """Integral (M, k) of a series (M, k) from its first time on, by the trapezoidal
    rule.
    """
    steps = middle(values) * np.diff(time)[:, None]
    return np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(steps, axis=0)])


def means_of(time: Array, values: Array) -> Callable[[Array, Array], Array]:
    """Make a function (begins, ends) -> means (N, k) of a linearly interpolated series
    over intervals.

    An interval that reaches beyond the samples is cut off there.
    """
    table = integral_of(time, values)

    def integral(when: Array) -> Array:
        # the last sample belongs to the interval before it, as none begins there
        rows = np.clip(np.searchsorted(time, when, "right") - 1, 0, time.size - 2)
        past, step = when - time[rows], time[rows + 1] - time[rows]
        slope = (values[rows + 1] - values[rows]) / step[:, None]
        return (
            table[rows]
            + values[rows] * past[:, None]
            + 0.5 * slope * past[:, None] ** 2
        )

    def mean(begins: Array, ends: Array) -> Array:
        first, last = np.maximum(begins, time[0]), np.minimum(ends, time[-1])
        return np.asarray((integral(last) - integral(first)) / (last - first)[:, None])

    return mean


def measured_at(channel: Channel, time: Array, period: float) -> Array:
    """Values (N, k) of a measurement at regular times (N,), averaged over each period
    (s) if sampled faster.

    Samples that come faster than the clock are averaged over the period around each
    instant, so that vibration does not appear as slow motion; others are interpolated.
    """
    if channel.rate > FASTER / period:
        inside = np.clip(time, channel.time[0], channel.time[-1])
        return means_of(channel.time, channel.values)(
            inside - 0.5 * period, inside + 0.5 * period
        )
    return values_at(channel, time)


def rates_note(flight: FlightData, period: float) -> str:
    """Text that names the measurements averaged to a longer sample period (s); empty if
    there are none.
    """
    rates = {name: flight[name].rate for name in flight if not QUANTITIES[name].held}
    fast = [
        f"{name} ({rate:.4g} Hz)"
        for name, rate in rates.items()
        if rate * period > FASTER
    ]
    return (
        f"{flight.name}: {', '.join(fast)} averaged to {1.0 / period:.4g} Hz"
        if fast
        else ""
    )
