"""Minimisers for batches: differential evolution, then a compass search; the same
points whatever the machine.

Both take a function of many points at once, (points, dimensions) of the unit cube ->
(points,).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from decimal import Decimal

import numpy as np
import numpy.typing as npt

from inference.study import Parameter
from skyarm.studies.sweep.sobol import BITS, sobol

Array = npt.NDArray[np.float64]
Cost = Callable[[Array], Array]

SHARE, CROSSOVER = (0.5, 0.9), 0.9
"""Of differential evolution: range of the weight of a difference, drawn anew each
generation; probability to cross."""

FIRST, LAST = 0.125, 1.0 / 512.0
"""Of the compass search: steps in the unit cube it begins and ends with."""


def decode(parameters: Sequence[Parameter], points: Array) -> dict[str, Array]:
    """Parameter -> (points,): values of points of the unit cube, in whole steps of each
    parameter from its low end.
    """
    found: dict[str, Array] = {}
    for parameter, column in zip(parameters, np.clip(points, 0.0, 1.0).T, strict=True):
        low, high = parameter.low, parameter.high
        if parameter.scale == "log":
            value = np.exp(np.log(low) + column * (np.log(high) - np.log(low)))
        else:
            value = low + column * (high - low)
        steps = np.round((value - low) / parameter.step)
        # as a decimal, so that 0.06 is 0.06
        places = max(_decimals(each) for each in (low, high, parameter.step))
        found[parameter.name] = np.round(
            np.minimum(low + steps * parameter.step, high), places
        )
    return found


def _decimals(value: float) -> int:
    """Digits behind the point of a number's shortest text."""
    return max(0, -int(Decimal(repr(value)).as_tuple().exponent))


def encode(parameters: Sequence[Parameter], values: Sequence[float]) -> Array:
    """The point of the unit cube of some values."""
    found = []
    for parameter, value in zip(parameters, values, strict=True):
        low, high = parameter.low, parameter.high
        if parameter.scale == "log":
            found.append((np.log(value) - np.log(low)) / (np.log(high) - np.log(low)))
        else:
            found.append((value - low) / (high - low))
    point: Array = np.clip(np.array(found, dtype=float), 0.0, 1.0)
    return point


def differential_evolution(
    cost: Cost, dimensions: int, *, population: int, generations: int, seed: int
) -> Array:
    """The best point found, (dimensions,).

    From a Sobol sequence, rand-to-best/1/bin with a dithered weight (Storn, Price 1997;
    Das, Suganthan 2011). A point beyond the cube is reflected.
    """
    draw = np.random.Generator(np.random.Philox(seed))
    numbers = np.arange(1, population + 1)
    points: Array = np.stack(
        [
            (sobol(numbers, k).astype(float) + 0.5) / 2.0**BITS
            for k in range(dimensions)
        ],
        axis=1,
    )
    costs = cost(points)
    for _ in range(generations):
        share = draw.uniform(*SHARE)
        others = np.stack([draw.permutation(population) for _ in range(3)], axis=1)
        a, b, c = (points[others[:, i]] for i in range(3))
        best = points[int(costs.argmin())]
        mutants = (
            a
            + share * (best - a) * (draw.random((population, 1)) < 0.5)
            + share * (b - c)
        )
        mutants = 1.0 - np.abs(1.0 - np.abs(mutants) % 2.0)
        crossing = draw.random((population, dimensions)) < CROSSOVER
        crossing[np.arange(population), draw.integers(0, dimensions, population)] = True
        trial = np.where(crossing, mutants, points)
        found = cost(trial)
        better = found <= costs
        points, costs = (
            np.where(better[:, None], trial, points),
            np.where(better, found, costs),
        )
    return np.asarray(points[int(costs.argmin())])


def compass(
    cost: Cost, starts: Array, held: npt.NDArray[np.bool_] | None = None
) -> tuple[Array, Array]:
    """Points from which no step along an axis leads down, and their costs; all starts
    move at once.

    Each round tries both ways along every axis from each point and takes the best, or
    halves the point's step (Kolda, Lewis, Torczon 2003).

    Args:
        cost: to minimise.
        starts: (starts, dimensions).
        held: (starts, dimensions), True where a coordinate stays.
    """
    points = np.array(starts, dtype=float)
    count, dimensions = points.shape
    free = np.ones_like(points, dtype=bool) if held is None else ~held
    costs, sizes = cost(points), np.full(count, FIRST)
    directions = np.concatenate([np.eye(dimensions), -np.eye(dimensions)])
    while np.any(sizes >= LAST):
        moving = np.flatnonzero(sizes >= LAST)
        trial = (
            points[moving, None, :]
            + sizes[moving, None, None] * directions * free[moving, None, :]
        )
        found = cost(np.clip(trial, 0.0, 1.0).reshape(-1, dimensions)).reshape(
            len(moving), -1
        )
        best = found.argmin(axis=1)
        lower = found[np.arange(len(moving)), best] < costs[moving] - 1e-9
        down = moving[lower]
        points[down] = np.clip(trial, 0.0, 1.0)[lower, best[lower]]
        costs[down] = found[lower, best[lower]]
        sizes[moving[~lower]] *= 0.5
    return points, costs
