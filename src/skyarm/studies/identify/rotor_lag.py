"""First-order lag with dead time, up and down: its response to held commands, many stretches at once."""

from __future__ import annotations

import math

import numpy as np

from skyarm.records.arrays import Array

STRETCH = 0.5
"""s, of the stretches that are followed side by side."""

FORGOTTEN = 6.0
"""Time constants that are followed before a stretch: of what was before, 0.25 % is left."""


STEP = 0.2
"""Of a period, that the step of a held command takes at the end of a period."""


def delay_commands(commands: Array, period: float, delay: float) -> Array:
    """Means of held commands over each period after a dead time.

    Args:
        commands: (N, rotors), each held for one period; the first holds before, too.
        period: s.
        delay: s, whole periods or not; below 0 of commands that are stamped late.

    Returns:
        (N, rotors).
    """
    whole = math.floor(delay / period)
    share = delay / period - whole
    places = np.arange(len(commands)) - whole
    newer, older = (commands[np.clip(places - back, 0, len(commands) - 1)] for back in (0, 1))
    return (1.0 - share) * newer + share * older


def integral_bends(commands: Array, period: float, delay: float) -> Array:
    """Excess of the mean of the commands' integral over each period above a straight line, over the period.

    A step within a period bends it.

    Args:
        commands: (N, actuators), each held for one period; the first holds before, too.
        period: s.
        delay: s, dead time.
    """
    whole = math.floor(delay / period)
    share = delay / period - whole
    older, newer = (delay_commands(commands, period, (whole + back) * period) for back in (1, 0))
    return 0.5 * share * (1.0 - share) * (older - newer)


def commands_at_ends(commands: Array, period: float, delay: float) -> Array:
    """Held commands (N, actuators) that act at the end of each period after a dead time.

    The step from one to the next takes a share of a period, so that a search sees on which side of an end it lies.

    Args:
        commands: (N, actuators), each held for one period; the first holds before, too.
        period: s.
        delay: s, whole periods or not; below 0 of commands that are stamped late.
    """
    whole = math.floor(delay / period)
    share = max(0.0, (delay / period - whole - 1.0) / STEP + 1.0)
    return delay_commands(commands, period, (whole + share) * period)


def lag_response(
    commands: Array, period: float, delay: float | Array, up: float | Array, down: float | Array
) -> tuple[Array, Array, Array]:
    """Response of a first-order lag, with another time constant up than down, to held commands after a dead time.

    Args:
        commands: (N, rotors), each held for one period. The lag has settled at the first.
        period: s.
        delay: s, whole periods or not; below 0 of commands that are stamped late. Or (C,) of some candidates.
        up: s, time constant towards a larger value; or (C or 1, rotors or 1).
        down: s, time constant towards a smaller one; likewise.

    Returns:
        Means and mean squares over each period and values at its end, each (N, rotors), or (C, N, rotors); exact.
    """
    delays = np.atleast_1d(np.asarray(delay, dtype=float))
    rises, falls = (np.atleast_2d(np.asarray(each, dtype=float))[:, None, :] for each in (up, down))
    whole = np.floor(delays / period).astype(int)
    late = (delays - whole * period)[:, None, None]
    size = max(1, round(STRETCH / period))
    before = math.ceil(FORGOTTEN * float(max(rises.max(), falls.max())) / period)
    starts = np.arange(0, len(commands), size)
    places = starts[None, None, :] - before - whole[None, :, None] + np.arange(before + size)[:, None, None]
    spans = [(1, late), (0, period - late)] if late.max() > 1e-9 * period else [(0, period - late)]
    parts = [(back, span, np.exp(-span / rises), np.exp(-span / falls)) for back, span in spans]
    last, even = len(commands) - 1, up is down
    # of one candidate all at once, which is faster; of many that would take too much memory
    at_once = [commands[np.clip(places - back, 0, last)] if len(delays) == 1 else None for back, *_ in parts]
    value = commands[np.clip(places[0] - 1, 0, last)]
    found = np.empty((3, size, *value.shape))
    for k in range(before + size):
        mean, square = np.zeros_like(value), np.zeros_like(value)
        for (back, span, rising, falling), table in zip(parts, at_once, strict=True):
            target = commands[np.clip(places[k] - back, 0, last)] if table is None else table[k]
            off = value - target
            above = off > 0.0
            decay = rising if even else np.where(above, falling, rising)
            if k >= before:
                away = off * (rises if even else np.where(above, falls, rises)) * (1.0 - decay)
                mean += target * span + away
                square += target * (target * span + 2.0 * away) + 0.5 * off * away * (1.0 + decay)
            value = target + off * decay
        if k >= before:
            found[:, k - before] = mean / period, square / period, value
    joined = found.transpose(0, 2, 3, 1, 4).reshape(3, len(delays), -1, commands.shape[1])[:, :, : len(commands)]
    series = joined if np.ndim(delay) else joined[:, 0]
    return series[0], series[1], series[2]
