"""Values of the varied numbers in given episodes: a pure function of study and episode number."""

from __future__ import annotations

from collections.abc import Iterator
from math import prod

import numpy as np
import numpy.typing as npt

from skyarm.scalars.philox import uniform, uniforms
from skyarm.sweep.derived_numbers import with_derived
from skyarm.sweep.sobol import BITS, sobol
from skyarm.sweep.study import Study

Array = npt.NDArray[np.float64]

FIRST_CHANNEL = 2**16
"""Channel of the noise generator for the first varied number; those below belong to the episodes' own noise."""

SHIFT_CHANNEL = 2**17
"""Channel of the first dimension's digital shift."""

BLOCK = 2**16
"""Episodes that are drawn at once where only their extremes are kept."""


def values(study: Study, episodes: npt.ArrayLike) -> dict[str, Array]:
    """Path -> (episodes,), derived ones last: the same for an episode in whatever company it is drawn.

    Args:
        study: with its design.
        episodes: numbers of the episodes.
    """
    numbers = np.asarray(episodes, dtype=np.int64)
    cells = prod(len(d.values) for d in study.axes.values())
    found: dict[str, Array] = {}
    # the last axis runs fastest, as in nested loops
    stride = cells
    for index, (path, distribution) in enumerate(study.vary.items()):
        if path in study.axes:
            points = np.array(study.axes[path].values)
            stride //= len(points)
            found[path] = points[numbers % cells // stride % len(points)]
        else:
            found[path] = distribution.quantile(_unit(study, numbers, index))
    return with_derived(found, study.derived)


def _unit(study: Study, episodes: npt.NDArray[np.int64], index: int) -> Array:
    """Numbers in (0, 1) for one dimension."""
    if study.design != "sobol":
        return uniform(study.seed, episodes, FIRST_CHANNEL + index, 0)
    # a digital shift keeps the points' evenness and lets the seed choose among many such sets
    shift = int(float(uniforms(study.seed, 0, SHIFT_CHANNEL + index, 0, 1)[0]) * 2.0**BITS)
    shifted = sobol(episodes, index) ^ np.uint64(shift)
    return np.asarray((shifted.astype(np.float64) + 0.5) * 2.0**-BITS)


def extremes(study: Study) -> dict[str, tuple[float, float]]:
    """Path -> smallest and largest value that an episode of the study takes."""
    found: dict[str, tuple[float, float]] = {}
    for block in _blocks(study.episodes):
        for path, column in values(study, block).items():
            low, high = found.get(path, (np.inf, -np.inf))
            found[path] = (min(low, float(column.min())), max(high, float(column.max())))
    return found


def derived_extremes(study: Study) -> dict[str, tuple[int, int]]:
    """Derived path -> the episodes in which it is smallest and largest."""
    found: dict[str, tuple[int, int]] = {}
    ends: dict[str, tuple[float, float]] = {}
    for block in _blocks(study.episodes) if study.derived else ():
        numbers = values(study, block)
        for path in study.derived:
            column = numbers[path]
            first, last = int(column.argmin()), int(column.argmax())
            low, high = ends.get(path, (np.inf, -np.inf))
            at = found.get(path, (0, 0))
            found[path] = (
                int(block[first]) if column[first] < low else at[0],
                int(block[last]) if column[last] > high else at[1],
            )
            ends[path] = (min(low, float(column[first])), max(high, float(column[last])))
    return found


def _blocks(count: int) -> Iterator[npt.NDArray[np.int64]]:
    return (np.arange(start, min(start + BLOCK, count)) for start in range(0, count, BLOCK))
