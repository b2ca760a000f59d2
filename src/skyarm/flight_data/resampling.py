"""Measured flights on one even clock: stretches without gaps, and what was lost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.quantities import QUANTITIES
from skyarm.records.files import number

Array: TypeAlias = npt.NDArray[np.float64]

FASTER = 1.5
"""Ratio of a channel's rate to the even one from which its samples are averaged."""

MOST_ROWS = 20_000_000
"""Rows of a stretch at most: a stamp far away is no flight."""


def resample(
    flight: FlightData,
    *,
    rate: float = 0.0,
    channels: Sequence[str] = (),
    gap: float = 4.0,
    shortest: float = 0.5,
) -> tuple[FlightData, ...]:
    """Return the stretches of a flight on an even clock that all channels share.

    A command holds until the next one. A measurement is interpolated linearly, or, where its samples are the faster
    ones, averaged over the period around each instant, so that its vibrations do not appear as slow motion.

    Args:
        flight: as it was read.
        rate: Hz of the even clock; that of the gyro, or of the fastest measurement, if left out.
        channels: names of the channels to take; all if left out.
        gap: periods of a channel without a sample that end a stretch.
        shortest: s, stretches below which are left out.

    Raises:
        ValueError: one line: a channel that is not there, or no stretch that is long enough.
    """
    number(rate, "rate", low=0.0)
    number(gap, "gap", low=1.0, strict=True)
    number(shortest, "shortest", low=0.0)
    chosen = {name: flight[name] for name in channels or flight.channels}
    clock = rate or _usual_rate(chosen)
    if clock <= 0.0:
        raise ValueError(f"{flight.name}: rate: must be given, as no channel has two samples")
    period = 1.0 / clock
    start = max(float(each.time[0]) for each in chosen.values())
    end = min(float(each.time[-1]) for each in chosen.values())
    notes = _edges(chosen, start, end)
    spans = _without_gaps(chosen, start, end, gap, period, notes)
    kept = [(begin, until) for begin, until in spans if until - begin >= max(shortest, period)]
    if not kept:
        raise ValueError(
            f"{flight.name}: stretches = none: must be one of at least {shortest:g} s in which all of "
            f"{', '.join(chosen)} have samples"
        )
    if len(kept) < len(spans):
        notes.append(f"flight: {len(spans) - len(kept)} stretches below {shortest:g} s are left out.")
    if len(kept) > 1 or len(spans) > 1:
        lost = end - start - sum(until - begin for begin, until in kept)
        notes.append(f"flight: {len(kept)} stretches; {lost:.3g} of {end - start:.3g} s are lost.")
    notes += _changes(chosen, clock)
    return tuple(
        replace(
            flight,
            name=flight.name if len(kept) == 1 else f"{flight.name} ({k} of {len(kept)})",
            channels=_on_even_clock(chosen, begin, until, period),
            notes=(*flight.notes, *notes),
        )
        for k, (begin, until) in enumerate(kept, 1)
    )


def _usual_rate(channels: dict[str, Channel]) -> float:
    """Rate of the gyro, else of the fastest measurement, else of the fastest command, Hz."""
    if "gyro" in channels:
        return channels["gyro"].rate
    measured = [each.rate for name, each in channels.items() if not QUANTITIES[name].held]
    return max(measured or [each.rate for each in channels.values()], default=0.0)


def _edges(channels: dict[str, Channel], start: float, end: float) -> list[str]:
    """Notes of what lies outside the time that all channels share."""
    before = max(start - float(each.time[0]) for each in channels.values())
    after = max(float(each.time[-1]) - end for each in channels.values())
    if max(before, after) < 0.1:
        return []
    late = max(channels, key=lambda name: float(channels[name].time[0]))
    early = min(channels, key=lambda name: float(channels[name].time[-1]))
    return [
        f"flight: {before:.3g} s before the first sample of {late} and {after:.3g} s after the last one of {early} are "
        "left out."
    ]


def _without_gaps(
    channels: dict[str, Channel], start: float, end: float, gap: float, period: float, notes: list[str]
) -> list[tuple[float, float]]:
    """Spans of time in which no channel has a gap."""
    cuts: list[tuple[float, float]] = []
    for name, each in channels.items():
        steps = np.diff(each.time)
        own = float(np.median(steps)) if steps.size else 0.0
        wide = np.flatnonzero(steps > gap * max(own, period))
        inside = [k for k in wide.tolist() if each.time[k + 1] > start and each.time[k] < end]
        cuts += [(float(each.time[k]), float(each.time[k + 1])) for k in inside]
        if inside:
            longest = max(inside, key=lambda k: float(steps[k]))
            notes.append(
                f"{name}: {len(inside)} gaps of over {gap:g} periods, the longest of {steps[longest]:.3g} s at "
                f"{each.time[longest]:.3f} s."
            )
    spans, begin = [], start
    for first, last in sorted(cuts):
        if first > begin:
            spans.append((begin, first))
        begin = max(begin, last)
    if end > begin:
        spans.append((begin, end))
    return spans


def _changes(channels: dict[str, Channel], clock: float) -> list[str]:
    """Notes of the channels whose samples are averaged or interpolated."""
    slow = [name for name, each in channels.items() if not QUANTITIES[name].held and each.rate < clock / FASTER]
    fast = [name for name, each in channels.items() if not QUANTITIES[name].held and each.rate > clock * FASTER]
    words = [f"{name} ({channels[name].rate:.4g} Hz)" for name in slow]
    notes = [f"{', '.join(words)}: interpolated to {clock:.4g} Hz."] if slow else []
    words = [f"{name} ({channels[name].rate:.4g} Hz)" for name in fast]
    return [*notes, f"{', '.join(words)}: averaged to {clock:.4g} Hz."] if fast else notes


def _on_even_clock(channels: dict[str, Channel], begin: float, until: float, period: float) -> dict[str, Channel]:
    """Channels on an even clock from ``begin`` to ``until``."""
    count = int((until - begin) / period + 1e-9) + 1
    if count > MOST_ROWS:
        raise ValueError(f"rows = {count}: must be at most {MOST_ROWS} on an even clock")
    time = begin + period * np.arange(count, dtype=float)
    return {name: replace(each, time=time, values=_at(name, each, time, period)) for name, each in channels.items()}


def _at(name: str, channel: Channel, time: Array, period: float) -> Array:
    """Values of a channel at the instants of an even clock."""
    if QUANTITIES[name].held:
        rows = np.searchsorted(channel.time, time + 1e-9, "right") - 1
        held: Array = channel.values[np.maximum(rows, 0)]
        return held
    if channel.rate > FASTER / period:
        first, last = float(channel.time[0]), float(channel.time[-1])
        before, after = np.maximum(time - 0.5 * period, first), np.minimum(time + 0.5 * period, last)
        steps = 0.5 * (channel.values[1:] + channel.values[:-1]) * np.diff(channel.time)[:, None]
        integral = np.concatenate([np.zeros((1, channel.values.shape[1])), np.cumsum(steps, axis=0)])
        found = (_exact(channel, integral, after) - _exact(channel, integral, before)) / (after - before)[:, None]
    else:
        found = np.stack([np.interp(time, channel.time, column) for column in channel.values.T], axis=1)
    if name == "quaternion":
        found = found / np.linalg.norm(found, axis=1)[:, None]
    return np.asarray(found, dtype=float)


def _exact(channel: Channel, integral: Array, when: Array) -> Array:
    """Integral of a channel that is linear between its samples, at given times."""
    rows = np.clip(np.searchsorted(channel.time, when, "right") - 1, 0, channel.time.size - 2)
    past = (when - channel.time[rows])[:, None]
    slope = (channel.values[rows + 1] - channel.values[rows]) / (channel.time[rows + 1] - channel.time[rows])[:, None]
    found: Array = integral[rows] + channel.values[rows] * past + 0.5 * slope * past**2
    return found
