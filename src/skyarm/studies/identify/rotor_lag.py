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


def lag_response(targets: Array, period: float, up: float, down: float) -> tuple[Array, Array]:
    """Means over and values after each period of a first-order lag with another time constant up than down.

    Args:
        targets: (N, rotors), each held for one period. The lag has settled at the first.
        period: s, at most a few times shorter than the time constants.
        up: s, time constant towards a larger value.
        down: s, time constant towards a smaller one.

    Returns:
        Both (N, rotors), exact for held targets.
    """
    size = max(1, round(STRETCH / period))
    before = math.ceil(FORGOTTEN * max(up, down) / period)
    starts = np.arange(0, len(targets), size)
    places = np.clip(starts[None, :] - before + np.arange(before + size)[:, None], 0, len(targets) - 1)
    value = targets[places[0]]
    found = np.empty((2, size, *value.shape))
    decays = math.exp(-period / up), math.exp(-period / down)
    means = up / period * (1.0 - decays[0]), down / period * (1.0 - decays[1])
    for k, place in enumerate(places):
        target = targets[place]
        off = value - target
        falling = off > 0.0
        value = target + off * np.where(falling, decays[1], decays[0])
        if k >= before:
            found[0, k - before] = target + off * np.where(falling, means[1], means[0])
            found[1, k - before] = value
    joined = found.transpose(0, 2, 1, 3).reshape(2, -1, targets.shape[1])[:, : len(targets)]
    return joined[0], joined[1]


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
