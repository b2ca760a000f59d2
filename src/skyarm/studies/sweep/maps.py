"""Robustness maps: success rate over two varied parameters."""

from __future__ import annotations

import numpy as np

from skyarm.records.arrays import Array, IntArray, Mask
from skyarm.records.files import did_you_mean, shown
from skyarm.records.immutable import immutable
from skyarm.studies.sweep.stats import Rows
from skyarm.studies.sweep.study import StudyError

FEWEST, MOST = 4, 40
"""Least and largest number of cells along an axis of drawn values."""

PER_CELL = 25
"""Target number of episodes in a cell of drawn values; a fraction is then known to
0.2."""

LISTED = 100
"""Number of different values up to which an axis has a cell for each."""


@immutable
class Axis:
    """Axis of a robustness map: parameter path, bin edges, logarithmic or linear
    spacing, label.
    """

    path: str
    edges: Array
    logarithmic: bool = False
    label: str = ""

    @property
    def centers(self) -> Array:
        """Centres of the axis' bins."""
        if self.logarithmic:
            return np.sqrt(self.edges[:-1] * self.edges[1:])
        return 0.5 * (self.edges[:-1] + self.edges[1:])


@immutable
class RobustnessMap:
    """Success rate of one controller over two varied parameters, in bins.

    Attributes:
        controller: controller that flew. across, upward: the axes.
        rate: (upward, across) share of successes, NaN where no episode fell.
        count: (upward, across) episodes.
    """

    controller: str
    across: Axis
    upward: Axis
    rate: Array
    count: IntArray

    @property
    def constant(self) -> float | None:
        """Success rate if it is equal in all bins that hold flights, else None."""
        low, high = float(np.nanmin(self.rate)), float(np.nanmax(self.rate))
        return low if low == high else None


def robustness_maps(
    rows: Rows, paths: tuple[str, str] | None = None
) -> list[RobustnessMap]:
    """Maps of each controller's success rate over two varied parameters; empty if fewer
    vary.

    Args:
        rows: rows of the study.
        paths: across and upward; the first two that vary if left out.

    Raises:
        StudyError: a path that does not vary.
    """
    if paths is None:
        varying = [
            path
            for path in rows.parameters
            if np.ptp(rows.of(rows.controllers[0], path)) > 0.0
        ]
        if len(varying) < 2:
            return []
        paths = varying[0], varying[1]
    for path in paths:
        if path not in rows.parameters:
            there = (
                f"{did_you_mean(path, rows.parameters)}there are"
                f" {', '.join(rows.parameters)}"
            )
            raise StudyError(f"--map = {shown(path)}: must be a varied number; {there}")
    if paths[0] == paths[1]:
        raise StudyError(f"--map = {shown(paths[0])}: must be two different numbers")
    first = rows.controllers[0]
    columns = [rows.of(first, path) for path in paths]
    across, upward = (
        axis(
            path, column, logarithmic=rows.is_logarithmic(path), label=rows.label(path)
        )
        for path, column in zip(paths, columns, strict=True)
    )
    return [
        success_map(name, across, upward, columns[0], columns[1], rows.succeeded(name))
        for name in rows.controllers
    ]


def axis(
    path: str, values: Array, *, logarithmic: bool = False, label: str = ""
) -> Axis:
    """Bins of a parameter: one per value if there are few, otherwise evenly spaced
    ones, more for more episodes.
    """
    different = np.unique(values)
    # drawn values hardly recur: a cell for each would hold one episode
    if 2 <= different.size <= LISTED and values.size > 2 * different.size:
        # cells end half-way between values; the two outer ones reach as far out as in
        middle = 0.5 * (different[:-1] + different[1:])
        edges = np.concatenate(
            [
                [2.0 * different[0] - middle[0]],
                middle,
                [2.0 * different[-1] - middle[-1]],
            ]
        )
        return Axis(path=path, edges=edges, label=label)
    # the root, since a map has so many cells both ways
    cells = int(np.clip(np.sqrt(values.size / PER_CELL), FEWEST, MOST))
    low = float(different[0])
    high = float(different[-1])
    # one value still needs a cell of some width
    if low == high:
        low = low - 0.5
        high = high + 0.5
    logarithmic = logarithmic and low > 0.0
    spaced = np.geomspace if logarithmic else np.linspace
    edges = spaced(low, high, cells + 1)
    return Axis(path=path, edges=edges, logarithmic=logarithmic, label=label)


def success_map(
    controller: str, across: Axis, upward: Axis, x: Array, y: Array, won: Mask
) -> RobustnessMap:
    """Robustness map of one controller, from the success of each flight and its two
    parameters.
    """
    edges = (upward.edges, across.edges)
    count = np.histogram2d(y, x, bins=edges)[0].astype(np.int64)
    wins = np.histogram2d(y, x, bins=edges, weights=won)[0]
    rate = np.divide(wins, count, out=np.full(count.shape, np.nan), where=count > 0)
    return RobustnessMap(
        controller=controller, across=across, upward=upward, rate=rate, count=count
    )
