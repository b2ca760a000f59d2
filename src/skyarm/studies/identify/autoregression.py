"""Autoregressive noise model of a fit's residuals: its coefficients, and the innovations that it leaves.

Residuals whose colour is known are whitened by it, in turns with the parameters of the fit (generalised least squares,
Clarke 1967; Ljung, System Identification, 1999, 7.2). A long memory costs few coefficients where values long past count
by their means over windows, each twice as long as the one before (Corsi 2009): the model of white noise that a measured
rate adds to its random walk, which decays over seconds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from skyarm.records.arrays import Array


def ar_coefficients(
    series: Sequence[Array], order: int, weights: Array | None = None, rounding: float = 0.0, windows: int = 0
) -> Array:
    """Coefficients (order + windows,) of an autoregressive model of some series of one kind, by weighted least squares.

    Args:
        series: each (N,); a constant and a straight line of each are no noise.
        order: of the model.
        weights: (sum of N - order,) square roots of the weights; 1 by default.
        rounding: standard deviation below which a residual is rounding, whose colour means nothing.
        windows: number of means of what is past beyond the order.
    """
    size, at = order + windows, 0
    square, right = np.zeros((size, size)), np.zeros(size)
    for each in series:
        rows = len(each) - order
        weight = np.ones(rows) if weights is None else weights[at : at + rows]
        at += rows
        # a constant error, or one that grows steadily, must not look like noise that hardly changes
        left = without_line(each, weight)
        past = np.stack(list(_past_values(left, order, windows)), axis=1) * weight[:, None]
        square += past.T @ past + rows * rounding**2 * np.eye(size)
        right += past.T @ (left[order:] * weight)
    square = square + (1e-10 * np.trace(square) + 1e-300) * np.eye(size)
    return np.linalg.solve(square, right)


def without_line(row: Array, weight: Array) -> Array:
    """Series (N,) without its straight line, by least squares over its last rows (K,) with the roots of their weights.

    A constant alone makes a line of its sums.
    """
    lines, first = np.stack([np.ones(len(row)), np.linspace(-1.0, 1.0, len(row))], axis=1), len(row) - len(weight)
    weighted = lines[first:] * weight[:, None]
    return np.asarray(row - lines @ np.linalg.lstsq(weighted, row[first:] * weight, rcond=None)[0])


def innovations(series: Sequence[Array], filters: Array, windows: int = 0) -> Array:
    """Errors of one step ahead (all, rows) of autoregressive models (rows, order + windows), of series (N, rows)."""
    order, pieces = filters.shape[1] - windows, []
    for each in series:
        left = each[order:].copy()
        for k, past in enumerate(_past_values(each, order, windows)):
            left -= filters[:, k] * past
        pieces.append(left)
    return np.concatenate(pieces)


def _past_values(rows: Array, order: int, windows: int) -> Iterator[Array]:
    """Past values of each row (N - order, ...) from the order on: rows before it, then means of windows before those.

    The first window is as long as the order. The mean of the first rows stands for what was before them.
    """
    size = len(rows) - order
    for k in range(order):
        yield rows[order - 1 - k : order - 1 - k + size]
    if not windows:
        return
    level, longest = rows[:order].mean(axis=0), order * 2**windows
    nothing = np.zeros((longest + 1, *rows.shape[1:]))
    sums = np.concatenate([nothing, np.cumsum(rows - level, axis=0)])
    for k in range(windows):
        near, far = (longest + order - order * 2**i for i in (k, k + 1))
        yield (sums[near : near + size] - sums[far : far + size]) / (order * 2**k) + level
