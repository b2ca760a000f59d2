"""What a candidate of a law's gains costs: error, jitter and effort over wrong plants, losses, margins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skyarm.records.leaves import parts
from skyarm.tune.candidate_flights import Flown

Array = npt.NDArray[np.float64]

QUANTILE = 0.9
"""Over the plants of each kind of motion: the error that nine of ten plants stay below."""

WEIGHTS = (2.0, 0.7, 0.25, 0.1, 0.03)
"""Of the logarithms of jitter and effort against that of the error, from calm to stiff."""

LOSS = 100.0
"""Of the share of the plants that is lost: one of 16 costs more than error and jitter ever win."""

SMALLEST = 1e-5
"""m and rad/s: improvements below count no more."""


@dataclass(frozen=True, slots=True)
class Scores:
    """Of each candidate (candidates,).

    Attributes:
        error, tip: m, 90 % quantiles over the plants, of kinds of motion the geometric mean.
        jitter: rad/s, effort: N m, medians over the plants.
        lost: share of the plants. short: cost of falling short of the margins.
    """

    error: Array
    tip: Array
    jitter: Array
    effort: Array
    lost: Array
    short: Array

    def part(self, which: slice | Sequence[int]) -> Scores:
        """Scores of some of the candidates."""
        return Scores(**{name: values[which] for name, values in parts(self).items()})

    def cost(self, weight: float) -> Array:
        """ln error + weight (ln jitter + ln effort) + losses + what the margins are short of; smaller is better.

        Logarithms make every ratio of improvement count alike, whatever the vehicle's size.
        """
        active = np.log(self.jitter + SMALLEST) + np.where(self.effort > 0.0, np.log(self.effort + SMALLEST), 0.0)
        total: Array = np.log(self.error + SMALLEST) + weight * active + LOSS * self.lost + self.short
        return total


def scores(flown: Flown) -> Scores:
    """Scores of candidates over the plants that they flew."""
    return Scores(
        error=_quantile(flown.error, flown.kinds),
        tip=_quantile(flown.tip, flown.kinds),
        jitter=np.median(flown.jitter, axis=1),
        effort=np.median(flown.effort, axis=1),
        lost=flown.lost.mean(axis=1),
        short=np.zeros(len(flown.lost)),
    )


def _quantile(errors: Array, kinds: npt.NDArray[np.int_]) -> Array:
    """The smallest error that at least nine of ten plants do not exceed; of several kinds their geometric mean.

    One quantile over all would be that of the hardest kind alone.
    """
    each = [np.quantile(errors[:, kinds == kind], QUANTILE, axis=1, method="higher") for kind in np.unique(kinds)]
    found: Array = np.exp(np.mean([np.log(np.maximum(one, SMALLEST)) for one in each], axis=0))
    return found
