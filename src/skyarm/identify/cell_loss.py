"""How far cells are from what was measured: a robust loss of their logarithms, and counts within some percent."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.identify.study import Cell

Array = npt.NDArray[np.float64]

WORST = 1e6
"""|u| of a cell that is missing or has another sign: the loss is at its ceiling."""


def slack_distance(ours: Array, cells: Sequence[Cell]) -> Array:
    """|ours - measured| less half a unit of the last digit, at least 0; (lanes, cells), infinite where missing."""
    measured, half = _columns(cells)
    apart = np.maximum(np.abs(ours - measured) - half, 0.0)
    return np.where(np.isfinite(ours), apart, np.inf)


def within(ours: Array, cells: Sequence[Cell], share: float) -> npt.NDArray[np.bool_]:
    """Whether each cell is within a share of what was measured, its rounding forgiven; (lanes, cells)."""
    measured, _ = _columns(cells)
    # 1e-9: a number on the very edge is within
    found: npt.NDArray[np.bool_] = slack_distance(ours, cells) <= share * np.abs(measured) * (1.0 + 1e-9)
    return found


def losses(ours: Array, cells: Sequence[Cell], width: float, knee: float) -> Array:
    """Loss of each cell, (lanes, cells): u^2 / (1 + u^2 / knee^2) with u = ln(ours / measured) / width.

    Quadratic near the measured number, at most knee^2 however far, so that one cell that a model cannot make does not
    decide over the others (Geman, McClure 1987). The rounding of the measured number is taken off the difference
    first; another sign and a missing number are as far as can be.
    """
    measured, half = _columns(cells)
    nearest = np.clip(measured, ours - half, ours + half)
    with np.errstate(all="ignore"):
        u = np.log(nearest / measured) / width
    u = np.where(np.isfinite(u), np.minimum(np.abs(u), WORST), WORST)
    found: Array = u**2 / (1.0 + (u / knee) ** 2)
    return found


def _columns(cells: Sequence[Cell]) -> tuple[Array, Array]:
    pairs = np.array([(cell.measured, cell.half) for cell in cells], dtype=float).reshape(-1, 2)
    return pairs[:, 0], pairs[:, 1]


def tally(ours: Array, cells: Sequence[Cell], shares: Sequence[float] = (0.05, 0.10, 0.25)) -> dict[str, Any]:
    """Counts of one lane: how many cells, and how many within each share."""
    lane = np.asarray(ours, dtype=float).reshape(1, -1)
    return {"cells": len(cells)} | {f"within_{share:.0%}": int(within(lane, cells, share).sum()) for share in shares}
