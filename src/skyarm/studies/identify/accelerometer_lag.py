"""Lag of the accelerometer behind the gyroscope, by correlation of both with what the commands foretell.

A search for a delay is local: from a start that is off by more than the rotors' lag it rests beside the truth, with a
narrow interval. The lag at which foretold and measured forces agree best, less that of the angular accelerations, which
holds what commands are late, is where it must begin. Forces are differenced first: a thrust that wanders with battery
and speed makes a peak so wide that what the model lacks moves it by a tenth of a second (Knapp and Carter 1976, who
whiten both).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skyarm.records.arrays import Array
from skyarm.studies.identify.motion_model import Stretch

LONGEST = 0.25
"""s, lags that are tried to both sides."""

FOLLOWS, CHANCE = 0.05, 16.0
"""Least sum of the squares of three correlations that a lag is believed of, and its least product with the number of
periods: squares of chance are above in one of 900 lags (chi squared of three).
"""


def accelerometer_lag(stretches: Sequence[Stretch], predicted: Sequence[Array]) -> float:
    """Lag (s) of the accelerometer behind the gyroscope; 0 where either does not follow the commands.

    Args:
        stretches: specific forces and rates.
        predicted: of each (N, 6 or more): specific force and angular acceleration by the commands.
    """
    forces = [_changes(each.specific_force) for each in stretches]
    foretold = [_changes(each[:, :3]) for each in predicted]
    turning = [np.diff(each.rate, axis=0) / each.period for each in stretches]
    first, second = (
        _best_lag(rows, expected, stretches)
        for rows, expected in ((forces, foretold), (turning, [each[:, 3:6] for each in predicted]))
    )
    return 0.0 if first is None or second is None else (first - second) * stretches[0].period


def _changes(rows: Array) -> Array:
    """Differences (N, ...) of rows from one to the next; the last one, of which there is no next, is 0."""
    return np.diff(rows, axis=0, append=rows[-1:])


def _best_lag(measured: Sequence[Array], predicted: Sequence[Array], stretches: Sequence[Stretch]) -> float | None:
    """Periods by which measured rows (N, 3) are behind the predicted ones; None if they do not follow them."""
    longest = min(round(LONGEST / stretches[0].period), min(each.size for each in stretches) // 4)
    lags = np.arange(-longest, longest + 1)
    scores = np.array([_agreement(measured, predicted, stretches, int(lag)) for lag in lags])
    best = int(np.argmax(scores))
    periods = sum(int(each.used.sum()) for each in stretches)
    if scores[best] < max(FOLLOWS, CHANCE / max(periods, 1)) or best in (0, len(lags) - 1):
        return None
    before, at, after = scores[best - 1 : best + 2]
    return float(lags[best] + 0.5 * (before - after) / min(before - 2.0 * at + after, -1e-12))


def _agreement(measured: Sequence[Array], predicted: Sequence[Array], stretches: Sequence[Stretch], lag: int) -> float:
    """Sum of the squares of the correlations of three rows at a lag (periods); of opposite ones nothing."""
    sums = np.zeros((3, 3))
    for rows, foretold, stretch in zip(measured, predicted, stretches, strict=True):
        both = np.append(stretch.used[:-1] & stretch.used[1:], False)  # rows are differences to the next
        place = np.arange(max(lag, 0), stretch.size + min(lag, 0))
        place = place[both[place] & both[place - lag]]
        if len(place) > 1:
            x, y = (each - each.mean(axis=0) for each in (foretold[place - lag], rows[place]))
            sums += np.stack([(x * y).sum(axis=0), (x * x).sum(axis=0), (y * y).sum(axis=0)])
    both, one, other = sums
    return float((np.maximum(both, 0.0) ** 2 / np.maximum(one * other, 1e-300)).sum())
