"""Series of samples: means over neighbours, differences, later values, and vectors of components."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from skyarm.records.arrays import Array


def delay_series(rows: Array, periods: float) -> Array:
    """Series (N, ...) that lags by a number of periods, whole or not, by the phase of each of its frequencies.

    Interpolation between its rows would smooth noise, the more the further from a row, earlier or later, and a series
    with noise would seem to have a lag.
    """
    around = [-1, *[1] * (rows.ndim - 1)]
    slope = (rows[-1:] - rows[:1]) / max(len(rows) - 1, 1)
    line = rows[:1] + slope * np.arange(len(rows)).reshape(around)
    # what is beside the line ends at zero and goes on so, to a length of which transforms are fast
    size = 2 ** math.ceil(math.log2(len(rows) + math.ceil(abs(periods)) + 1))
    turned = np.exp(-2j * np.pi * np.fft.rfftfreq(size) * periods).reshape(around)
    late = np.fft.irfft(np.fft.rfft(rows - line, size, axis=0) * turned, size, axis=0)[: len(rows)]
    return late + line - slope * periods


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


def smooth_rows(rows: Array, weights: Sequence[float]) -> Array:
    """Weighted means (N, n) of rows (N, n) and as many neighbours on both sides; the first and last go on."""
    half = len(weights) // 2
    around = np.pad(rows, ((half, half), (0, 0)), mode="edge")
    return np.asarray(sum(w * around[i : i + len(rows)] for i, w in enumerate(weights)))


def position_differences(rows: Array, apart: int = 1) -> Array:
    """Rates (N, ...) of rows (N, ...) by central differences of fourth order over so many rows, in units of them.

    Those of second order are 0.07 % below a swing of 2 Hz at 200 Hz, coherent with all that the swing is to show.
    """
    found = np.gradient(rows, axis=0)
    one, two = rows[3 * apart : -apart] - rows[apart : -3 * apart], rows[4 * apart :] - rows[: -4 * apart]
    found[2 * apart : -2 * apart] = (8.0 * one - two) / (12.0 * apart)
    return found


def vectors_of(parts: Iterable[Any], count: int) -> Array:
    """Vectors (count, k) of k components, each a number or an array (count,)."""
    return np.stack([each + np.zeros(count) for each in parts], axis=1)
