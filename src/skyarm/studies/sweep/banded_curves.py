"""Curves of a metric over a varied parameter of a sweep: median, with a band over all
other variation.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skyarm.records.arrays import Array, IntArray, doubles
from skyarm.records.files import did_you_mean, shown
from skyarm.records.immutable import immutable
from skyarm.scenario.numbers import words_of
from skyarm.studies.sweep.expressions import read_expression
from skyarm.studies.sweep.maps import LISTED
from skyarm.studies.sweep.stats import Rows
from skyarm.studies.sweep.study import StudyError

BAND = (0.05, 0.95)
"""Quantiles of the episodes at the ends of a band."""

PER_CELL = 25
"""Target number of episodes in a cell of drawn values; its median is then accurate to a
fifth of the spread."""

FEWEST_CELLS, MOST_CELLS = 4, 30

FEWEST_OF_BAND = 5
"""Least number of completed episodes in a cell with a band."""


@immutable
class Variable:
    """Abscissa of a curve over a sweep: a varied parameter, or an expression of
    several.

    Attributes:
        words: label. unit: SI, "" if unknown.
        values: (episodes,). logarithmic: it was drawn so.
    """

    words: str
    values: Array
    unit: str = ""
    logarithmic: bool = False


@immutable
class BandedCurve:
    """Curve of one metric of one controller against a variable, with its band.

    Attributes:
        controller: controller that flew.
        x: (K,) value of the variable, of each cell the median.
        middle, low, high: (K,) median, and the ends of the band, of episodes that flew
            to their end; NaN where none did, or too few for a band.
        episodes, lost: (K,) how many there are, and how many of them ended before their
            time.
    """

    controller: str
    x: Array
    middle: Array
    low: Array
    high: Array
    episodes: IntArray
    lost: IntArray


@immutable
class BandedCurves:
    """Curves of one metric for all controllers.

    Attributes:
        metric: name of the metric. over: the variable. curves: one for each controller.
    """

    metric: str
    over: Variable
    curves: tuple[BandedCurve, ...]


def banded_curves(rows: Rows, metric: str, over: str) -> BandedCurves:
    """Curves of a metric against a variable, with bands over all other parameters and
    the noise.

    Args:
        rows: rows of a study.
        metric: one of its metrics.
        over: a varied number, an expression of some, or ``name = expression``.

    Raises:
        StudyError: one line: a metric or number that is not there.
        ExpressionError: an expression that cannot be read or has no value.
    """
    if metric not in rows.metrics:
        there = (
            f"{did_you_mean(metric, rows.metrics)}there are {', '.join(rows.metrics)}"
        )
        raise StudyError(
            f"metric = {shown(metric)}: must be one of these rows; {there}"
        )
    across = variable(rows, over, "over")
    curves = tuple(
        _curve(rows, metric, controller, across.values)
        for controller in rows.controllers
    )
    return BandedCurves(metric=metric, over=across, curves=curves)


def variable(rows: Rows, text: str, field: str) -> Variable:
    """Abscissa of a curve from text: a varied parameter, an expression, or ``label =
    expression``.

    Raises:
        StudyError, ExpressionError: one line.
    """
    name, equals, after = text.partition("=")
    if text in rows.parameters:
        unit = rows.manifest.units.get(text, "")
        logarithmic = rows.is_logarithmic(text)
        return Variable(
            words=words_of(text),
            unit=unit,
            values=_column(rows, text),
            logarithmic=logarithmic,
        )
    if not rows.parameters:
        raise StudyError(
            f"{field} = {shown(text)}: must be a varied number, and none varies in"
            " these rows"
        )
    read = read_expression(after if equals else text, rows.parameters, field)
    values = read.value({each: _column(rows, each) for each in read.names})
    spread = np.broadcast_to(values, (rows.episodes,))
    return Variable(
        words=name.strip() if equals and name.strip() else " ".join(text.split()),
        values=spread,
    )


def _column(rows: Rows, path: str) -> Array:
    """Values of a varied parameter in each flight of a sweep, which all controllers
    share.
    """
    return doubles(rows.of(rows.controllers[0], path))


def _cells(values: Array) -> IntArray:
    """Bin index of each value: one bin per value if there are few, otherwise bins of
    equal count.
    """
    different, place = np.unique(values, return_inverse=True)
    # values that recur have a cell each; others share cells of equally many
    if different.size <= LISTED and values.size >= 2 * different.size:
        return place
    cells = int(np.clip(values.size / PER_CELL, FEWEST_CELLS, MOST_CELLS))
    rank = np.empty(values.size, dtype=np.int64)
    # of equal values in the order of the episodes, so that a curve repeats
    rank[np.argsort(values, kind="stable")] = np.arange(values.size)
    return rank * cells // values.size


def _curve(rows: Rows, metric: str, controller: str, over: Array) -> BandedCurve:
    column = doubles(rows.of(controller, metric))
    flew = rows.of(controller, "status") == "completed"
    cells = _cells(over)
    table: list[Sequence[float]] = []
    for cell in np.unique(cells):
        here = cells == cell
        flown = column[here & flew & np.isfinite(column)]
        quantiles: tuple[float, ...] = (np.nan,) * 3
        if flown.size:
            ends = (
                np.quantile(flown, BAND)
                if flown.size >= FEWEST_OF_BAND
                else (np.nan, np.nan)
            )
            quantiles = (float(np.median(flown)), *map(float, ends))
        table.append(
            (
                float(np.median(over[here])),
                *quantiles,
                int(here.sum()),
                int((here & ~flew).sum()),
            )
        )
    x, middle, low, high, episodes, lost = doubles(table).reshape(-1, 6).T
    return BandedCurve(
        controller=controller,
        x=x,
        middle=middle,
        low=low,
        high=high,
        episodes=episodes.astype(np.int64),
        lost=lost.astype(np.int64),
    )
