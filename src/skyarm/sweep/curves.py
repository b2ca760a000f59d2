"""Metrics over each varied number: middle and spread of what the episodes gave, cell by cell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skyarm.sweep.derived_numbers import is_own_name
from skyarm.sweep.intervals import quantiles
from skyarm.sweep.maps import Axis, axis
from skyarm.sweep.stats import Rows

Array = npt.NDArray[np.float64]

FIRST = ("ee_error_mean", "position_error_mean", "joint_error_mean", "pitch_rms", "tau1_rms", "iae_position")
"""Metrics that are drawn where a study has them, after those that limit its successes."""

MOST = 6
"""Metrics that are drawn."""

BAND = (0.05, 0.5, 0.95)
"""Shares of the episodes below the band's lower edge, its line, its upper edge."""


@dataclass(frozen=True, kw_only=True, slots=True)
class MetricCurve:
    """A metric over one varied number.

    Attributes:
        controller: that flew. axis: of the varied number; one point in each of its cells.
        middle: (cells,) median; NaN where no episode fell or none flew to its end.
        low, high: (cells,) what 5 and 95 % of the episodes lie below; of a grid without chance the least and largest.
    """

    controller: str
    axis: Axis
    middle: Array
    low: Array
    high: Array


def drawn_metrics(rows: Rows) -> list[str]:
    """The metrics that are drawn: those that limit successes, then the usual ones, then any others."""
    wanted = dict.fromkeys((*rows.limits, *FIRST, *rows.metrics))
    return [name for name in wanted if name in rows.metrics][:MOST]


def varying(rows: Rows) -> list[str]:
    """Numbers that differ among the episodes; paths that follow from those by expressions are left out."""
    drawn = rows.manifest.origin.study["vary"] or {}
    wanted = [path for path in rows.parameters if path in drawn or is_own_name(path)]
    return [path for path in wanted if np.ptp(rows.of(rows.controllers[0], path)) > 0.0]


def metric_curves(rows: Rows, metric: str) -> dict[str, list[MetricCurve]]:
    """Path -> the curve of each controller, of the episodes that flew to their end."""
    return {path: _over(rows, metric, path) for path in varying(rows)}


def _over(rows: Rows, metric: str, path: str) -> list[MetricCurve]:
    kind = next(iter(rows.manifest.origin.study["vary"].get(path, ("derived",))))
    across = axis(path, rows.of(rows.controllers[0], path), logarithmic=kind == "log_uniform", label=rows.label(path))
    cells = len(across.edges) - 1
    found = []
    for name in rows.controllers:
        values, number = rows.of(name, metric), rows.of(name, path)
        kept = np.isfinite(values) & (rows.of(name, "status") == "completed")
        cell = np.clip(np.searchsorted(across.edges, number, side="right") - 1, 0, cells - 1)
        bands = np.full((len(BAND), cells), np.nan)
        for k in range(cells):
            inside = values[kept & (cell == k)]
            if inside.size:
                ends = (0.0, 0.5, 1.0) if rows.deterministic else BAND
                bands[:, k] = quantiles(inside, ends)
        low, middle, high = bands
        found.append(MetricCurve(controller=name, axis=across, middle=middle, low=low, high=high))
    return found
