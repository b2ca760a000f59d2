"""Rotor speeds from commands: dead time, first-order lag up and down, many stretches at once."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

STRETCH = 0.5
"""s, of the stretches that are followed side by side."""

FORGOTTEN = 6.0
"""Time constants that are followed before a stretch: of what was before, 0.25 % is left."""


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
    mixed: Array = (1.0 - share) * newer + share * older
    return mixed


def lag_response(commands: Array, period: float, delay: float, up: float, down: float) -> tuple[Array, Array, Array]:
    """Response of a first-order lag, with another time constant up than down, to held commands after a dead time.

    Args:
        commands: (N, rotors), each held for one period. The lag has settled at the first.
        period: s.
        delay: s, whole periods or not; below 0 of commands that are stamped late.
        up: s, time constant towards a larger value.
        down: s, time constant towards a smaller one.

    Returns:
        Means and mean squares over each period and values at its end, each (N, rotors); exact.
    """
    whole = math.floor(delay / period)
    late = delay - whole * period
    size = max(1, round(STRETCH / period))
    before = math.ceil(FORGOTTEN * max(up, down) / period)
    starts = np.arange(0, len(commands), size)
    places = starts[None, :] - before - whole + np.arange(before + size)[:, None]
    older, newer = (commands[np.clip(places - back, 0, len(commands) - 1)] for back in (1, 0))
    spans = [(span, targets) for span, targets in ((late, older), (period - late, newer)) if span > 1e-9 * period]
    decays = [(math.exp(-span / up), math.exp(-span / down)) for span, _ in spans]
    value = older[0]
    found = np.empty((3, size, *value.shape))
    for k in range(before + size):
        mean, square = np.zeros_like(value), np.zeros_like(value)
        for (span, targets), (rising, falling) in zip(spans, decays, strict=True):
            target = targets[k]
            off = value - target
            above = off > 0.0
            decay = np.where(above, falling, rising)
            if k >= before:
                away = off * np.where(above, down, up) * (1.0 - decay)
                mean += target * span + away
                square += target * (target * span + 2.0 * away) + 0.5 * off * away * (1.0 + decay)
            value = target + off * decay
        if k >= before:
            found[:, k - before] = mean / period, square / period, value
    joined = found.transpose(0, 2, 1, 3).reshape(3, -1, commands.shape[1])[:, : len(commands)]
    return joined[0], joined[1], joined[2]


def moving_mean(rows: Array, width: int) -> Array:
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
