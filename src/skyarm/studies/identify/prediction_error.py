"""Prediction-error fit: parameters of a model from measured series, with intervals.

Each row of the errors is whitened by an autoregressive filter found from its own errors, in turns with the numbers
(generalised least squares, Clarke 1967; Ljung, System Identification, 1999, 7.2 and 13.4): the likelihood of a model
with coloured noise. Errors beyond a few standard deviations count less (Huber 1964). What was known before enters as
one more measurement of each number. Intervals: sandwich of scores summed over blocks of time, each block by the errors
of a fit without it (White 1980; Liang and Zeger 1986; Bell and McCaffrey 2002).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np

from skyarm.records.arrays import Array, Mask
from skyarm.records.immutable import immutable
from skyarm.studies.identify.autoregression import ar_coefficients, innovations
from skyarm.studies.identify.whitened_fit import FEWEST, jackknife_scores
from skyarm.studies.identify.window_fit import scipy_parts, student_quantiles

ORDER = 8
"""Of the whitening filter."""

WINDOWS = 6
"""Means of what is past beyond the order: a memory of 512 periods. White noise of a rate, in a sum whose errors walk
slowly, is seen apart from them over seconds; a filter of the order alone takes slow errors for small ones.
"""

PART = 4
"""Times that the longest stretch must hold the longest window, so that a short flight's motion is not its noise."""

OTHERS = (3, 4, 5)
"""Windows of shorter memories, by which the numbers could be found as well. What they would move the numbers by adds to
the uncertainty (Buckland, Burnham, Augustin 1997).
"""

TURNS, FIRST, STEPS = 24, 5, 2
"""Most turns of filter and numbers; most steps of the search in the first and in each other."""

SETTLED = 0.1
"""Standard deviations: a turn that moves every number by less is the last."""

ALTERNATE = 6
"""Turns after which numbers and noise may go to and fro: noise is then half that of the turn before, slopes are new."""

NOISES, RESTED, LONGER = 20, 0.03, 0.9
"""Most turns of a linear model and its noise; standard deviations that the last of them may move a number by; longest
extrapolation of a row of moves, by the ratio of one to the one before.
"""

GAINED = 0.1
"""Of the sum of squares: a step that gains less ends a turn."""

OUTLIER = 3.0
"""Standard deviations beyond which an error counts by its size only, not by its square."""

STALE = 2.0
"""Standard deviations that a number may move before the slopes, which cost most of a fit, are taken anew."""

Errors: TypeAlias = Callable[[Array], Sequence[Array]]
"""numbers (P,) -> for each stretch (N, rows): what the prediction leaves."""


@immutable(kw_only=False)
class PredictedErrors:
    """Prediction errors as a function of the parameters, with work that several candidates share done beforehand.

    Attributes:
        at: errors at numbers (P,), of each stretch (N, rows).
        prepare: called with all numbers at which errors are asked for next.
    """

    at: Errors
    prepare: Callable[[Sequence[Array]], None]

    def __call__(self, values: Array) -> Sequence[Array]:
        """Errors at numbers (P,)."""
        return self.at(values)


@immutable(kw_only=False)
class Whitening:
    """Noise of a model's errors: a filter and a standard deviation of each row, and a weight of each error.

    Attributes:
        filters: (rows, ORDER + WINDOWS) autoregressive coefficients.
        scales: (rows,) standard deviations of the errors of one step ahead.
        weights: (all, rows) square roots of the weights; 0 where an error does not count.
        levels: rows whose errors of one step ahead have a mean of their own in each stretch.
    """

    filters: Array
    scales: Array
    weights: Array
    levels: Sequence[int] = ()

    def apply(self, errors: Sequence[Array]) -> Array:
        """Whitened and weighted errors (all, rows) of all stretches, one after the other."""
        return _level_rows(errors, self.filters, self.weights, self.levels) / self.scales * self.weights


@immutable(kw_only=False)
class PredictionFit:
    """Estimated numbers.

    Attributes:
        values: (P,).
        curvature: (P, P) inverse of the information of data and of what was known before.
        covariance: (P, P) beyond the noise's model; of a fit with what others, or unsettled last turns, move it by.
        block_information: (blocks, P, P) of the data of each block.
        noise: of the errors that are left.
        errors: of each stretch, (N, rows).
        settled: whether the search came to rest.
        stretch_information: (stretches, P, P) of the data of each. stretch_scores: (stretches, P) their sums.
    """

    values: Array
    curvature: Array
    covariance: Array
    block_information: Array
    stretch_information: Array
    stretch_scores: Array
    noise: Whitening
    errors: Sequence[Array]
    settled: bool

    @property
    def prior_information(self) -> Array:
        """Information (P, P) of what was known before."""
        return np.asarray(np.linalg.inv(self.curvature) - self.stretch_information.sum(axis=0))

    def quantiles(self, rows: Array) -> Array:
        """Quantiles (K,) of Student's t for half widths of 95 % of sums (K, P) of the numbers."""
        return student_quantiles(rows @ self.curvature, self.block_information)


def fit_prediction(
    errors: Errors,
    start: Array,
    prior: Array,
    steps: Array,
    block: int,
    used: Sequence[Mask] = (),
    progress: Callable[[str], None] | None = None,
    levels: Sequence[int] = (),
) -> PredictionFit:
    """Fit numbers by whitened least squares with a normal prior around the start.

    Args:
        errors: of a prediction.
        start: (P,) where the search begins, and the prior's mean.
        prior: (P,) standard deviations of what is known before.
        steps: (P,) of the differences.
        block: rows of a block of scores.
        used: of each stretch (N,), which rows count; all by default.
        progress: called with one line a step of the search.
        levels: rows whose slow drift differs from stretch to stretch: the mean of their whitened errors counts of all
            stretches together only.
    """
    scipy_parts()
    errors = _errors_over_used(errors, used)
    values, known = start.copy(), np.diag(prior**-2.0)
    found = errors(values)
    counted = _counted_rows(found, used)
    noise = _noise(found, counted, None, levels)
    settled, stale, trail = False, STALE, list[Array]()
    slopes, taken_at, deviation = error_slopes(errors, values, found, steps), values, np.zeros(len(values))
    for turn in range(TURNS):
        before = values
        share, stale = (1.0, stale) if turn < ALTERNATE else (0.5, SETTLED)

        def cost_of(values: Array, found: Sequence[Array], noise: Whitening = noise) -> float:
            return float((noise.apply(found) ** 2).sum() + (((values - start) / prior) ** 2).sum())

        trust, cost = 0.0, cost_of(values, found)
        for step in range(STEPS if turn else FIRST):
            if progress is not None:
                progress(f"turn {turn + 1} of at most {TURNS}, step {step + 1}")
            if (np.abs(values - taken_at) > stale * deviation).any():
                slopes, taken_at = error_slopes(errors, values, found, steps), values
            flat, slope = _whitened_errors(noise, found, slopes)
            information = slope.T @ slope + known
            deviation = np.sqrt(np.diag(np.linalg.inv(information)))
            uphill = slope.T @ flat + known @ (values - start)
            trial, there, below, trust = _step(errors, cost_of, values, found, information, uphill, trust)
            gained = cost - below
            values, found, cost = trial, there, below
            if gained < GAINED:
                break
        # under the noise at this estimate alone, the turns would go on for long: what a number leaves looks like noise
        linear = LinearErrors(values, found, slopes)
        noise = _blend(noise, _settle(linear, start, prior, counted, levels, noise.weights)[1], share)
        trail.append(values)
        if turn > 0 and (np.abs(values - before) < share * SETTLED * deviation).all():
            settled = bool((np.abs(values - taken_at) <= SETTLED * deviation).all())
            if settled:
                break
            stale = SETTLED
    slopes = error_slopes(errors, values, found, steps)
    fit = _fit_at(values, found, noise, slopes, prior, block, settled=settled)
    others = [_noise(found, counted, noise.weights, levels, windows) for windows in OTHERS]
    moved = np.stack([_linear_change(each, found, slopes, values - start, known) for each in others])
    covariance = fit.covariance + moved.T @ moved / len(moved)
    if not settled:
        # their sum and not their mean: a search that creeps has as far to go as it came, and more
        moved = np.stack(trail[-ALTERNATE:]) - values
        covariance += moved.T @ moved
    return dataclasses.replace(fit, covariance=covariance)


def expected_fit(
    errors: Errors,
    start: Array,
    prior: Array,
    steps: Array,
    block: int,
    used: Sequence[Mask] = (),
    levels: Sequence[int] = (),
) -> PredictionFit:
    """Fit of the errors' linear models at the start and at its estimate: the accuracy that a search may reach.

    It costs two steps of the search. At the start alone, numbers whose effect is a product with one that starts at zero
    would seem without effect: the height of the centre of mass, at which drag acts.

    Args:
        errors: of a prediction.
        start: (P,) numbers that the errors are linearised at first, and the prior's mean.
        prior: (P,) standard deviations of what is known before.
        steps: (P,) of the differences.
        block: rows of a block of scores.
        used: of each stretch (N,), which rows count; all by default.
        levels: rows whose slow drift differs from stretch to stretch.
    """
    scipy_parts()
    errors = _errors_over_used(errors, used)
    first = errors(start)
    counted = _counted_rows(first, used)
    linear = LinearErrors(start, first, error_slopes(errors, start, first, steps))
    values, noise, settled = _settle(linear, start, prior, counted, levels)
    there = errors(values)
    if (noise.apply(there) ** 2).sum() < (noise.apply(first) ** 2).sum():
        linear = LinearErrors(values, there, _larger(error_slopes(errors, values, there, steps), linear.slopes))
        values, noise, settled = _settle(linear, start, prior, counted, levels)
    found = linear.at(values)
    return _fit_at(values, found, noise, linear.slopes, prior, block, settled=settled)


@immutable(kw_only=False, eq=False)
class LinearErrors:
    """Errors of a prediction, linear in the numbers.

    Attributes:
        point: (P,) numbers. errors: of each stretch (N, rows) there. slopes: of each number, of each stretch (N, rows).
    """

    point: Array
    errors: Sequence[Array]
    slopes: Sequence[Sequence[Array]]

    def at(self, values: Array) -> list[Array]:
        """Errors at other numbers (P,)."""
        off = values - self.point
        parts = (np.stack(rows) for rows in zip(*self.slopes, strict=True))
        return [each + np.tensordot(off, part, axes=1) for each, part in zip(self.errors, parts, strict=True)]


VANISHED = 0.05
"""Of the slope at the start: below, a number has passed a bound of the model, such as drag below zero."""


def _larger(slopes: Sequence[Sequence[Array]], before: Sequence[Sequence[Array]]) -> list[Sequence[Array]]:
    """Slopes of each number, those before where they have vanished."""

    def size(rows: Sequence[Array]) -> float:
        return float(sum((each**2).sum() for each in rows))

    return [new if size(new) > VANISHED**2 * size(old) else old for new, old in zip(slopes, before, strict=True)]


def _settle(
    linear: LinearErrors,
    start: Array,
    prior: Array,
    counted: Mask,
    levels: Sequence[int],
    weights: Array | None = None,
) -> tuple[Array, Whitening, bool]:
    """Numbers and noise, in turns, under which a linear model is best; and whether they came to rest.

    Each move is about a constant share of the one before. Every third turn goes to where their sum would (Aitken 1926).
    """
    values, known, settled = linear.point, np.diag(prior**-2.0), False
    last: Array = np.zeros(len(prior))
    for turn in range(NOISES):
        found = linear.at(values)
        noise = _noise(found, counted, weights, levels)
        flat, slope = _whitened_errors(noise, found, linear.slopes)
        information = slope.T @ slope + known
        change: Array = np.asarray(np.linalg.solve(information, slope.T @ flat + known @ (values - start)))
        weights = noise.weights
        settled = bool((np.abs(change) < RESTED * np.sqrt(np.diag(np.linalg.inv(information)))).all())
        ratio = 0.0
        if turn % 3 == 2:
            ratio = float(np.clip(last @ information @ change / (last @ information @ last), 0.0, LONGER))
        values, last = values - change / (1.0 - ratio), change
        if settled:
            break
    return values, _noise(linear.at(values), counted, weights, levels), settled


def _fit_at(
    values: Array,
    found: Sequence[Array],
    noise: Whitening,
    slopes: Sequence[Sequence[Array]],
    prior: Array,
    block: int,
    *,
    settled: bool,
) -> PredictionFit:
    """Fit that rests at some numbers, with the covariance by whitened errors and slopes there."""
    flat, slope = _whitened_errors(noise, found, slopes)
    known = np.diag(prior**-2.0)
    curvature = np.asarray(np.linalg.inv(slope.T @ slope + known))
    rows = len(noise.scales)
    white = flat.reshape(-1, rows)
    blocks = _block_begins([len(each) - ORDER for each in found], block)
    whitened = slope.reshape(-1, rows, len(values))
    scores = jackknife_scores(whitened, white, curvature, blocks)
    parts = [each.reshape(-1, len(values)) for each in np.array_split(whitened, blocks)]
    inner = scores.T @ scores * (len(scores) - 1) / len(scores) + known
    ends = np.cumsum([rows * (len(each) - ORDER) for each in found])[:-1]
    pairs = list(zip(np.split(slope, ends), np.split(flat, ends), strict=True))
    return PredictionFit(
        values=values,
        curvature=curvature,
        covariance=curvature @ inner @ curvature,
        block_information=np.stack([each.T @ each for each in parts]),
        stretch_information=np.stack([each.T @ each for each, _ in pairs]),
        stretch_scores=np.stack([each.T @ errors for each, errors in pairs]),
        noise=noise,
        errors=found,
        settled=settled,
    )


def _block_begins(sizes: Sequence[int], block: int) -> list[int]:
    """Rows at which blocks of scores begin but for the first: none goes from one stretch (rows) into the next.

    Blocks across would be others if the flights were told in another order, and would tie what is independent.
    """
    blocks, first, found = max(FEWEST, sum(sizes) // max(block, 1)), 0, list[int]()
    for size in sizes:
        count = max(1, round(blocks * size / sum(sizes)))
        found += [int(each[0]) for each in np.array_split(np.arange(first, first + size), count)]
        first += size
    return found[1:]


def _linear_change(
    noise: Whitening, found: Sequence[Array], slopes: Sequence[Sequence[Array]], off: Array, known: Array
) -> Array:
    """Change (P,) to the best numbers under a noise model, by slopes; ``off`` from those known before."""
    flat, slope = _whitened_errors(noise, found, slopes)
    return np.asarray(-np.linalg.solve(slope.T @ slope + known, slope.T @ flat + known @ off), dtype=float)


def _step(
    errors: Errors,
    cost_of: Callable[[Array, Sequence[Array]], float],
    values: Array,
    found: Sequence[Array],
    information: Array,
    uphill: Array,
    trust: float,
) -> tuple[Array, Sequence[Array], float, float]:
    """Step of Levenberg and Marquardt: numbers, errors, sum of squares, and the damping of the next; none is worse."""
    cost = cost_of(values, found)
    for _ in range(8):
        trial = values - np.linalg.solve(information + trust * np.diag(np.diag(information)), uphill)
        there = errors(trial)
        below = cost_of(trial, there)
        if below < cost:
            return trial, there, below, trust * 0.1
        trust = max(trust, 1e-5) * 10.0
    return values, found, cost, trust


def _errors_over_used(errors: Errors, used: Sequence[Mask]) -> Errors:
    """Errors with straight lines over the rows that are not used, which would stay in the filters' memory."""
    if all(each.all() for each in used):
        return errors
    prepare = errors.prepare if isinstance(errors, PredictedErrors) else lambda values: None
    return PredictedErrors(lambda values: bridge_unused(errors(values), used), prepare)


def bridge_unused(series: Sequence[Array], used: Sequence[Mask]) -> list[Array]:
    """Series (N, rows) of each stretch with straight lines between the rows that are used."""
    found = []
    for rows, kept in zip(series, used, strict=True):
        place = np.arange(len(rows))
        whole = kept.all() or not kept.any()
        lines = [each if whole else np.interp(place, place[kept], each[kept]) for each in rows.T]
        found.append(np.stack(lines, axis=1))
    return found


def _counted_rows(found: Sequence[Array], used: Sequence[Mask]) -> Mask:
    """Which whitened rows count: those whose error and whose past ones are all used."""
    rows = []
    for i, each in enumerate(found):
        bad = np.zeros(len(each)) if not used else (~used[i]).astype(float)
        rows.append(np.convolve(bad, np.ones(ORDER + 1), "valid") == 0.0)
    return np.concatenate(rows)


def _noise(
    found: Sequence[Array],
    counted: Mask,
    weights: Array | None,
    levels: Sequence[int],
    windows: int = WINDOWS,
) -> Whitening:
    """Whitening filters, standard deviations and Huber's weights from the errors."""
    rows = found[0].shape[1]
    before = counted[:, None] * np.ones((1, rows)) if weights is None else weights
    filters = np.zeros((rows, ORDER + WINDOWS))
    longest = max(len(each) for each in found) / (PART * ORDER)
    windows = min(windows, max(0, int(math.log2(max(longest, 1.0)))))
    for i in range(rows):
        each = [part[:, i] for part in found]
        filters[i, : ORDER + windows] = ar_coefficients(each, ORDER, before[:, i], 0.0, windows)
    white = _level_rows(found, filters, before, levels)
    kept = white[counted]
    scales = 1.4826 * np.median(np.abs(kept - np.median(kept, axis=0)), axis=0) + 1e-300
    size = np.abs(white / scales)
    huber = np.sqrt(np.minimum(1.0, OUTLIER / np.maximum(size, 1e-9)))
    return Whitening(filters, scales, huber * counted[:, None], levels)


def _blend(old: Whitening, new: Whitening, share: float) -> Whitening:
    """Whitening whose filters and scales are a share of the way from one to another, with the other's weights."""
    filters, scales = ((1.0 - share) * a + share * b for a, b in ((old.filters, new.filters), (old.scales, new.scales)))
    return dataclasses.replace(new, filters=filters, scales=scales)


def _level_rows(found: Sequence[Array], filters: Array, weights: Array, levels: Sequence[int]) -> Array:
    """Errors of one step ahead, some rows without the straight line of each stretch, but with the mean of all of them.

    A constant torque of its own in each stretch makes a ramp of a summed rate, and a filter whose coefficients do not
    add up to just 1 leaves a line of it. It thus costs nothing, as an unknown without any prior would.
    """
    white, rows = innovations(found, filters, WINDOWS), list(levels)
    if len(found) == 1 or not rows:
        return white
    counts = weights[:, rows] ** 2
    whole = (counts * white[:, rows]).sum(axis=0) / np.maximum(counts.sum(axis=0), 1e-300)
    begin = 0
    for each in found:
        place = slice(begin, begin + len(each) - ORDER)
        begin = place.stop
        time, w, e = np.linspace(-1.0, 1.0, place.stop - place.start)[:, None], counts[place], white[place, rows]
        total, first, second = w.sum(axis=0), (w * time).sum(axis=0), (w * time**2).sum(axis=0)
        size = np.maximum(total * second - first**2, 1e-300)
        sums, moments = (w * e).sum(axis=0), (w * time * e).sum(axis=0)
        level, slope = (second * sums - first * moments) / size, (total * moments - first * sums) / size
        white[place, rows] -= level + slope * time - whole
    return white


def error_slopes(errors: Errors, values: Array, found: Sequence[Array], steps: Array) -> list[list[Array]]:
    """Slopes of the errors by forward differences: for each number, for each stretch (N, rows)."""
    moved = list(values + np.diag(steps))
    if isinstance(errors, PredictedErrors):
        errors.prepare(moved)
    return [
        [(after - before) / step for after, before in zip(errors(each), found, strict=True)]
        for each, step in zip(moved, steps, strict=True)
    ]


def _whitened_errors(
    noise: Whitening, found: Sequence[Array], slopes: Sequence[Sequence[Array]]
) -> tuple[Array, Array]:
    """Whitened, weighted errors as one column, and their slopes (all rows, numbers)."""
    flat = noise.apply(found).ravel()
    slope = np.empty((len(flat), len(slopes)))
    for i, each in enumerate(slopes):
        slope[:, i] = noise.apply(each).ravel()
    return flat, slope
