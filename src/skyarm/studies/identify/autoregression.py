"""Autoregressive noise model of a fit's residuals: its coefficients, and the innovations that it leaves.

Residuals whose colour is known are whitened by it, in turns with the parameters of the fit (generalised least squares,
Clarke 1967; Ljung, System Identification, 1999, 7.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[np.float64]


def ar_coefficients(series: Sequence[Array], order: int, weights: Array | None = None, rounding: float = 0.0) -> Array:
    """Coefficients (order,) of an autoregressive model of some series of one kind, by weighted least squares.

    Args:
        series: each (N,); a constant and a straight line of each are no noise.
        order: of the model.
        weights: (sum of N - order,) square roots of the weights; 1 by default.
        rounding: standard deviation below which a residual is rounding, whose colour means nothing.
    """
    square, right, at = np.zeros((order, order)), np.zeros(order), 0
    for each in series:
        rows = len(each) - order
        weight = np.ones(rows) if weights is None else weights[at : at + rows]
        at += rows
        # a constant error, or one that grows steadily, must not look like noise that hardly changes
        lines = np.stack([np.ones(len(each)), np.linspace(-1.0, 1.0, len(each))], axis=1)
        weighted = lines[order:] * weight[:, None]
        height = np.linalg.lstsq(weighted, each[order:] * weight, rcond=None)[0]
        left = each - lines @ height
        past = np.stack([left[order - 1 - i : len(left) - 1 - i] for i in range(order)], axis=1) * weight[:, None]
        square += past.T @ past + rows * rounding**2 * np.eye(order)
        right += past.T @ (left[order:] * weight)
    square = square + (1e-10 * np.trace(square) + 1e-300) * np.eye(order)
    found: Array = np.linalg.solve(square, right)
    return found


def innovations(series: Sequence[Array], filters: Array) -> Array:
    """Errors of one step ahead (all, rows) of autoregressive models (rows, order), of some series (N, rows)."""
    order, pieces = filters.shape[1], []
    for each in series:
        left = each[order:].copy()
        for k in range(order):
            left -= filters[:, k] * each[order - 1 - k : len(each) - 1 - k]
        pieces.append(left)
    return np.concatenate(pieces)
