"""Experimental design: parameter values as a pure function of study and episode number."""

from __future__ import annotations

from math import prod

import numpy as np
import numpy.typing as npt

from skyarm.algebra.scalars.philox import uniform, uniforms
from skyarm.records.arrays import Array, IntArray
from skyarm.studies.sweep.expressions import with_derived
from skyarm.studies.sweep.sobol import BITS, sobol
from skyarm.studies.sweep.study import Study

FIRST_CHANNEL = 2**16
"""Channel of the random generator for the first varied number; lower ones are for the noise of episodes."""

SHIFT_CHANNEL = 2**17
"""Channel of the digital shift of the first dimension."""

BLOCK = 2**16
"""Number of episodes whose numbers are drawn at once when only the least and greatest values are kept."""


def values(study: Study, episodes: npt.ArrayLike) -> dict[str, Array]:
    """Values of the varied parameters of a study: parameter path -> values (episodes,).

    Args:
        study: study with its design.
        episodes: numbers of the episodes.
    """
    numbers = np.asarray(episodes, dtype=np.int64)
    cells = prod(len(d.values) for d in study.axes.values())
    columns: dict[str, Array] = {}
    # the last axis runs fastest, as in nested loops
    stride = cells
    for index, (path, distribution) in enumerate(study.vary.items()):
        if path in study.axes:
            points = np.array(study.axes[path].values)
            stride //= len(points)
            columns[path] = points[numbers % cells // stride % len(points)]
        else:
            columns[path] = distribution.quantile(_unit(study, numbers, index))
    return with_derived(columns, study.derived)


def _unit(study: Study, episodes: IntArray, index: int) -> Array:
    """Random numbers in (0, 1), one per episode, for one dimension of the experimental design."""
    if study.design != "sobol":
        return uniform(study.seed, episodes, FIRST_CHANNEL + index, 0)
    # a digital shift keeps the points' evenness and lets the seed choose among many such sets
    shift = int(float(uniforms(study.seed, 0, SHIFT_CHANNEL + index, 0, 1)[0]) * 2.0**BITS)
    shifted = sobol(episodes, index) ^ np.uint64(shift)
    return (shifted.astype(np.float64) + 0.5) * 2.0**-BITS


def extremes(study: Study) -> dict[str, tuple[float, float, int, int]]:
    """Smallest and largest value of each varied or derived parameter, and the episodes that have them, by path."""
    ranges: dict[str, tuple[float, float, int, int]] = {}
    for start in range(0, study.episodes, BLOCK):
        block = range(start, min(start + BLOCK, study.episodes))
        for path, column in values(study, block).items():
            low, high, first, last = ranges.get(path, (np.inf, -np.inf, 0, 0))
            i, j = int(column.argmin()), int(column.argmax())
            if column[i] < low:
                low, first = float(column[i]), block[i]
            if column[j] > high:
                high, last = float(column[j]), block[j]
            ranges[path] = low, high, first, last
    return ranges
