"""Experimental design: parameter values as a pure function of what is drawn and the
number of an episode.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from math import prod
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from skyarm.algebra.scalars.philox import uniform, uniforms
from skyarm.records.arrays import Array, Columns, IntArray
from skyarm.records.immutable import immutable
from skyarm.studies.sweep.distributions import Distribution, Values, finite
from skyarm.studies.sweep.expressions import Expression, with_derived
from skyarm.studies.sweep.sobol import BITS, sobol

FIRST_CHANNEL = 2**16
"""Channel of the random generator for the first varied number; lower ones are for the
noise of episodes."""

SHIFT_CHANNEL = 2**17
"""Channel of the digital shift of the first dimension."""

BLOCK = 2**16
"""Number of episodes whose numbers are drawn at once when only the least and greatest
values are kept: half a megabyte for each number."""


@immutable(slots=False)
class Design:
    """Parameters that differ from episode to episode.

    Attributes:
        vary: dotted path -> its distribution, in the order of the file; or a name that
            is only derived from.
        derived: dotted path, or a name that is only written into the rows -> its
            expression of what stands before it.
        design: "random", "grid" or "sobol".
        episodes: number of episodes, numbered from 0. seed: seed of the draws.
    """

    vary: Mapping[str, Distribution]
    design: str = "random"
    episodes: int
    seed: int = 0
    derived: Mapping[str, Expression] = field(
        default_factory=lambda: MappingProxyType({})
    )

    @property
    def axes(self) -> dict[str, Values]:
        """Discrete parameters whose values form the grid of a grid design, by path."""
        return finite(self.vary) if self.design == "grid" else {}


def values(draws: Design, episodes: npt.ArrayLike) -> Columns:
    """Values of the varied parameters: parameter path -> values (episodes,).

    Args:
        draws: what is drawn, and how.
        episodes: numbers of the episodes.
    """
    numbers = np.asarray(episodes, dtype=np.int64)
    cells = prod(len(d.values) for d in draws.axes.values())
    columns: Columns = {}
    # the last axis runs fastest, as in nested loops
    stride = cells
    for index, (path, distribution) in enumerate(draws.vary.items()):
        if path in draws.axes:
            points = np.array(draws.axes[path].values)
            stride //= len(points)
            columns[path] = points[numbers % cells // stride % len(points)]
        else:
            columns[path] = distribution.quantile(_unit(draws, numbers, index))
    return with_derived(columns, draws.derived)


def _unit(draws: Design, episodes: IntArray, index: int) -> Array:
    """Random numbers in (0, 1), one per episode, for one dimension of the experimental
    design.
    """
    if draws.design != "sobol":
        return uniform(draws.seed, episodes, FIRST_CHANNEL + index, 0)
    # a digital shift keeps the points' evenness and lets the seed choose among many
    # such sets
    shift = int(
        float(uniforms(draws.seed, 0, SHIFT_CHANNEL + index, 0, 1)[0]) * 2.0**BITS
    )
    shifted = sobol(episodes, index) ^ np.uint64(shift)
    # the middle of its interval: a quantile at 0 or 1 may be infinite
    return (shifted.astype(np.float64) + 0.5) * 2.0**-BITS


def extremes(draws: Design) -> dict[str, tuple[float, float, int, int]]:
    """Smallest and largest value of each varied or derived parameter, and the episodes
    that have them, by path.
    """
    ranges: dict[str, tuple[float, float, int, int]] = {}
    for start in range(0, draws.episodes, BLOCK):
        block = range(start, min(start + BLOCK, draws.episodes))
        for path, column in values(draws, block).items():
            low, high, first, last = ranges.get(path, (np.inf, -np.inf, 0, 0))
            i, j = int(column.argmin()), int(column.argmax())
            if column[i] < low:
                low = float(column[i])
                first = block[i]
            if column[j] > high:
                high = float(column[j])
                last = block[j]
            ranges[path] = low, high, first, last
    return ranges
