"""Fit of a vehicle's parameters to simulated flight windows, with the noise of every
sensor.

Nothing that is measured enters the dynamics, so that noise of a sensor biases no number
(errors in variables). What belongs to a window alone is eliminated from the normal
equations by its Schur complement; the numbers follow by damped Gauss-Newton. The noise
of every row is that of restricted maximum likelihood, and so is the spread of the
wrench over the windows (MacKay 1992). Intervals: by the scores of blocks of time (Bell,
McCaffrey 2002), never narrower than by the curvature.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from skyarm.compile.machine_code import missing_extra
from skyarm.identify.window_errors import (
    OUTLIER,
    NormalEquations,
    WindowErrors,
    WindowStates,
)
from skyarm.identify.windows import ClockedWindows
from skyarm.records.arrays import Array, IntArray, Mask
from skyarm.records.files import needs_extra
from skyarm.records.immutable import positional

TURNS = 40
"""Largest number of iterations of the search."""

SETTLED, SOONEST = 0.1, 3
"""Change of every parameter, in standard deviations, below which the search ends; and
first iteration at which it may: the first with an estimated spread of the wrench."""

TRIES, SHORTER = 6, 0.4
"""Largest number of steps tried per iteration, and factor from one to the next: the
last is a hundredth of the first."""

FIRM, SLOWLY = 1e-3, 5.0
"""Least spread of the wrench over its prior size; largest factor of change per
iteration."""

TOLD = 0.3
"""Least fraction of a row's samples that a window's free parameters must leave for an
estimate of its noise."""

FAINT, LASTS = 0.05, 0.25
"""Least fraction of an error that persists to the next one; longest memory, as a
fraction of a window: with more of it a fit of commands at 10 Hz did not settle."""

BLOCK = 2.0
"""Duration (s) of a block of data whose errors may be correlated: eight windows;
chosen, as longer ones leave few blocks of a flight."""

MANY = 10
"""Number of blocks needed to see whether the errors are noise alone: Student's t of
nine degrees is 15 % above the normal quantile."""

NORMAL = 1.959964
"""Half-width of a 95 % interval in standard deviations, for a known spread (normal
distribution)."""

LEAST = {
    "gyro": 1e-4,
    "accelerometer": 1e-3,
    "position": 1e-4,
    "quaternion": 1e-4,
    "velocity": 1e-4,
    "joint_positions": 1e-5,
    "joint_rates": 1e-4,
}
"""Least noise of a sensor in SI units; with a noiseless one the search would converge
slowly."""


Quantile = Callable[[Array, float], Array]
"""Quantile function of degrees of freedom and a probability."""


def student_quantile() -> Quantile:
    """Import the quantile function of Student's t distribution from SciPy.

    Raises:
        ValueError: it is not installed.
    """
    try:
        from scipy.special import stdtrit
    except ImportError:
        raise ValueError(
            f"scipy: is missing; 'skyarm identify' {needs_extra('identify')}"
        ) from None
    quantile: Quantile = stdtrit
    return quantile


def student_quantiles(influence: Array, information: Array) -> Array:
    """Student's t quantiles (K,) for 95 % half widths of parameters estimated from few
    blocks of data.

    Of a number that a few blocks tell, the spread of the scores is known by these few
    alone: its degrees of freedom are those of a sum of squares of unequal sizes
    (Satterthwaite 1946; Bell and McCaffrey 2002).

    Args:
        influence: (K, P) of a score on the numbers.
        information: (blocks, P, P) of the data of each block.
    """
    student = student_quantile()
    sizes = np.einsum("kp,bpq,kq->kb", influence, information, influence)
    freedom = sizes.sum(axis=1) ** 2 / np.maximum((sizes**2).sum(axis=1), 1e-300)
    blocks = len(information)
    # one block is lost to the mean of the scores; below one degree of freedom the
    # quantile grows beyond use; 0.975: of an interval of 95 % to both sides
    return student(np.maximum(freedom * (blocks - 1) / blocks, 1.0), 0.975)


def variances_of(rows: Array, covariance: Array) -> Array:
    """Variances (K,) of linear combinations (K, P) of parameters with a covariance (P,
    P).
    """
    return np.asarray(np.einsum("kp,pq,kq->k", rows, covariance, rows))


@positional(eq=False)
class WindowFit:
    """Estimate of P vehicle parameters with its covariance and the noise of the
    sensors.

    Attributes:
        values: (P,) on the scale of the search.
        curvature: (P, P) inverse of the information of data and of what was known
            before.
        covariance: (P, P) by the scores of the blocks.
        prior_information: (P, P) of what was known before.
        block_information: (blocks, P, P) of the data of each block.
        stretch_information: (flights, P, P) of each flight. stretch_scores: (flights,
            P) their sums of scores.
        noise: (flights, sensor axes) standard deviations. spread: (6,) of the wrench
            over the windows, N and N m.
        errors, counted: (steps, W, sensor axes) what the windows leave, and which
            samples there are.
        states: states of the windows. settled: whether the search came to rest.
    """

    values: Array
    curvature: Array
    covariance: Array
    prior_information: Array
    block_information: Array
    stretch_information: Array
    stretch_scores: Array
    noise: Array
    spread: Array
    errors: Array
    counted: Mask
    states: WindowStates
    settled: bool

    def half_widths(self, rows: Array) -> Array:
        """Half widths (K,) of 95 % intervals of parameter combinations (K, P): the
        larger by data blocks or by noise.

        Few blocks hardly tell that errors are the noise alone, and it counts by
        Student's t, too.
        """
        blocks, noise = (
            np.sqrt(variances_of(rows, each))
            for each in (self.covariance, self.curvature)
        )
        students = student_quantiles(rows @ self.curvature, self.block_information)
        few = len(self.block_information) < MANY
        return np.asarray(
            np.maximum(students * blocks, (students if few else NORMAL) * noise)
        )

    def of_more(self, times: float) -> WindowFit:
        """Expected fit if the number of windows were multiplied by a factor."""
        blocks = times * self.block_information
        curvature: Array = np.asarray(
            np.linalg.inv(
                at_least(
                    blocks.sum(axis=0) + self.prior_information, self.prior_information
                )
            )
        )
        # by scores over by curvature: more windows of the same kind keep this factor
        wider = np.sqrt(np.diag(self.covariance) / np.diag(self.curvature))
        return dataclasses.replace(
            self,
            curvature=curvature,
            covariance=curvature * np.outer(wider, wider),
            block_information=blocks,
        )


@positional(eq=False)
class Reduced:
    """Normal equations of the vehicle parameters, after elimination of each window's
    own unknowns.

    Attributes:
        information: (W, P, P). scores: (W, P). total: (P, P) of all, with what was
            known before.
        slopes: (W, x, P) free numbers over numbers, turned. shift: (W, x) their own
            change, turned.
        inverse: (W, x, x) covariance of the free numbers.
    """

    information: Array
    scores: Array
    total: Array
    slopes: Array
    shift: Array
    inverse: Array


@contextmanager
def one_thread() -> Iterator[None]:
    """Context or decorator that limits BLAS to one thread.

    For small matrices further threads only wait, and the bits of a product may depend
    on their number.
    """
    try:
        from threadpoolctl import threadpool_limits
    except (
        ImportError
    ) as error:  # pragma: no cover  (the library is there when this is tested)
        raise missing_extra("identify") from error
    with threadpool_limits(1, user_api="blas"):
        yield


@one_thread()
def fit_windows(
    errors: WindowErrors,
    begin: Array,
    *,
    noise: Array | None = None,
    spread: Array | None = None,
    block: float = BLOCK,
    turns: int = TURNS,
    lasting: bool = False,
    progress: Callable[[str], None] | None = None,
) -> WindowFit:
    """Fit vehicle parameters to windows, with a normal prior around those of the start
    vehicle.

    Args:
        errors: errors of the windows.
        begin: (P,) where the search begins.
        noise: (flights, sensor axes) to begin with; by default from differences of the
            samples.
        spread: (6,) of the wrench, to begin with.
        block: s, of a block of data whose errors may depend on each other.
        turns: largest number of turns of the search.
        lasting: whether errors last from sample to sample: what commands did between
            rare samples is not known.
        progress: called with one line a turn of the search.
    """
    student_quantile()  # whose absence is no news for after the search
    start, prior = (
        np.array([getattr(each, name) for each in errors.unknowns])
        for name in ("begin", "spread")
    )
    least = np.array(
        [-math.inf if each.positive else each.least for each in errors.unknowns]
    )
    values = begin
    noise = first_noise(errors) if noise is None else noise
    spread = errors.push if spread is None else spread
    errors.take_samples(values)
    states = errors.first_states()
    settled = False
    memory = None
    for turn in range(turns):
        errors.take_samples(values)
        residuals, there, normal = errors.normal(values, states, noise, memory=memory)
        loose = loose_with(errors, spread)
        reduced = reduce(normal, states.beside, loose, prior)
        uphill = reduced.scores.sum(axis=0) + (values - start) / prior**2
        step = bounded_step(reduced.total, uphill, least - values)
        cost = Cost(there, noise[errors.windows.owners], start, prior, loose)
        # no number goes by more than what is known of it before
        length = min(1.0, 1.0 / max(1e-9, float(np.abs(step / prior).max())))
        before = cost.at(errors.innovations(residuals, there, memory), values, states)
        for _ in range(TRIES):
            change = length * step
            moved = values + change
            free = states.moved_by(-length * reduced.shift - reduced.slopes @ change)
            left, _ = errors.errors_at(moved, free)
            after = cost.at(errors.innovations(left, there, memory), moved, free)
            # 1e-9: at rest the cost moves by its rounding alone, which is no rise
            if math.isfinite(after) and after < before * (1.0 + 1e-9):
                break
            # the linear model holds near the estimate, so a shorter step is tried
            length *= SHORTER
        else:  # no step lowers the cost
            change, moved, free, left = 0.0 * change, values, states, residuals
        if not math.isfinite(before):
            raise ValueError(
                "the start vehicle does not fly: its motion under the logged commands"
                " is no number"
            )
        values, states = moved, free
        # judged by the whole step, however much of it is taken
        sizes = np.abs(step) / np.sqrt(np.diag(np.linalg.inv(reduced.total)))
        if progress is not None:
            progress(
                f"turn {turn + 1} of at most {turns}: by at most {sizes.max():.2g}"
                " standard deviations"
            )
        noise = new_noise(
            errors,
            errors.innovations(left, there, memory),
            there,
            noise,
            normal,
            reduced.inverse,
        )
        memory = new_memory(errors, left, there, noise) if lasting else None
        # in the first turn the noise may be that of the samples alone, not of residuals
        if turn:
            spread = new_spread(errors, states, spread, reduced.inverse)
        settled = turn + 1 >= SOONEST and bool((sizes < SETTLED).all())
        if settled:
            break
    # the last step's own, to first order: else what is left of it would pass for
    # disagreement of flights
    scores = reduced.scores + reduced.information @ change
    return WindowFit(
        values=values,
        noise=noise,
        spread=spread,
        errors=left,
        counted=there,
        states=states,
        settled=settled,
        **_information(errors.windows, reduced, scores, np.diag(prior**-2.0), block),
    )


@positional(eq=False)
class Cost:
    """Cost of a fit: twice the negative log-posterior, up to a constant, with Huber's
    weights.

    Attributes:
        there: (steps, W, sensor axes) which samples there are. noise: (W, sensor axes).
        start, prior: (P,) mean and standard deviation of the numbers before. loose:
            (x,) of the free numbers.
    """

    there: Mask
    noise: Array
    start: Array
    prior: Array
    loose: Array

    def at(self, errors: Array, values: Array, states: WindowStates) -> float:
        """Cost of residuals (steps, W, sensor axes), parameters (P,) and the unknowns
        of each window.
        """
        with np.errstate(over="ignore"):
            z = np.abs(np.where(self.there, errors, 0.0)) / self.noise
            huber = np.where(z > OUTLIER, OUTLIER * (2.0 * z - OUTLIER), z**2).sum()
        beside = states.beside / self.loose[len(self.loose) - states.beside.shape[1] :]
        return float(
            huber
            + (((values - self.start) / self.prior) ** 2).sum()
            + (beside**2).sum()
        )


def bounded_step(information: Array, uphill: Array, least: Array) -> Array:
    """Step (P,) to the minimum of a quadratic cost, with a lower bound on each
    component.

    What would pass its bound stays there, and the others are fitted to that: a body
    drag that pushes would leave its trace in them.
    """
    free, step = np.ones(len(uphill), dtype=bool), np.zeros(len(uphill))
    for _ in range(len(uphill)):
        pull = uphill[free] + information[np.ix_(free, ~free)] @ step[~free]
        step[free] = -np.linalg.solve(information[np.ix_(free, free)], pull)
        beyond = free & (step < least)
        if not beyond.any():
            break
        step[beyond], free = least[beyond], free & ~beyond
    return step


def reduce(
    normal: NormalEquations, beside: Array, loose: Array, prior: Array
) -> Reduced:
    """Eliminate the unknowns of each window from the normal equations by the Schur
    complement.

    Args:
        normal: normal equations of windows and numbers.
        beside: (W, k) the last free numbers of each window, whose usual value is 0.
        loose: (x,) standard deviations of the free numbers before.
        prior: (P,) those of the numbers.
    """
    # first states are drawn nowhere, what is beside the model is drawn to 0
    off = np.zeros_like(normal.pull)
    off[:, off.shape[1] - beside.shape[1] :] = beside
    inverse: Array = np.asarray(np.linalg.inv(normal.own + np.diag(loose**-2.0)))
    slopes = inverse @ normal.mixed
    shift = (inverse @ (normal.pull + off / loose**2)[..., None])[..., 0]
    information = normal.common - normal.mixed.transpose(0, 2, 1) @ slopes
    scores = normal.push - np.einsum("wxp,wx->wp", normal.mixed, shift)
    before = np.diag(prior**-2.0)
    return Reduced(
        information,
        scores,
        at_least(information.sum(axis=0) + before, before),
        slopes,
        shift,
        inverse,
    )


def loose_with(errors: WindowErrors, spread: Array) -> Array:
    """Prior standard deviations (x,) of the unknowns of a window, with given ones (6,)
    for the wrench.
    """
    loose = errors.loose.copy()
    loose[errors.wrench] = spread
    return loose


def first_noise(errors: WindowErrors) -> Array:
    """Initial estimate of the sensor noise (flights, sensor axes), from third
    differences of the samples.
    """
    noise = np.ones((len(errors.windows.flights), len(errors.rows)))
    for i, flight in enumerate(errors.windows.flights):
        for j, (name, column) in enumerate(errors.rows):
            if name in flight.channels:
                # a rotation is twice a quaternion's x, y, z
                factor, shift = (2.0, 1) if name == "quaternion" else (1.0, 0)
                bends = np.diff(flight.channels[name].values[:, column + shift], 3)
                # third differences hold no smooth motion; of white noise they have 20
                # times the variance (1 + 9 + 9 + 1)
                white = (
                    factor * 1.4826 * float(np.median(np.abs(bends))) / math.sqrt(20.0)
                )
                noise[i, j] = max(white, LEAST[name])
    return noise


def new_noise(
    errors: WindowErrors,
    found: Array,
    there: Mask,
    noise: Array,
    normal: NormalEquations,
    inverse: Array,
) -> Array:
    """Sensor noise (flights, sensor axes) by restricted maximum likelihood, which
    allows for the windows' unknowns.
    """
    owners = errors.windows.owners
    taken = np.einsum("wxy,rwxy->wr", inverse, normal.of_rows)
    z = np.abs(found / noise[owners]) * there
    # an outlier weighs by its size alone, as in the cost (Huber)
    square, count = (np.minimum(z, OUTLIER) * z).sum(axis=0), there.sum(axis=0)
    least, rows = np.array([LEAST[name] for name, _ in errors.rows]), list[Array]()
    for i, before in enumerate(noise):
        own = owners == i
        total, left = count[own].sum(axis=0), (count - taken)[own].sum(axis=0)
        size = np.sqrt(square[own].sum(axis=0) / np.maximum(left, 1.0))
        rows.append(
            np.maximum(
                before * np.where(left > TOLD * np.maximum(total, 1), size, 1.0), least
            )
        )
    return np.stack(rows)


def new_memory(errors: WindowErrors, found: Array, there: Mask, noise: Array) -> Array:
    """Correlation times (flights, sensor axes) of the residuals, from consecutive
    samples in a window, s.

    Where few samples tell what a vehicle was commanded, its errors last: as independent
    ones they would be taken for more than they tell, and outweigh what is known of the
    numbers and of the unexplained wrench.
    """
    owners = errors.windows.owners
    time = errors.times()
    memory = np.zeros_like(noise)
    sizes = np.clip(np.where(there, found / noise[owners], 0.0), -OUTLIER, OUTLIER)
    for i, j in np.ndindex(*noise.shape):
        windows, steps = np.nonzero(there[:, :, j].T & (owners == i)[:, None])
        rows = sizes[steps, windows, j]
        when = time[steps, windows, j]
        follow = np.diff(windows) == 0
        square = float(np.mean(rows**2)) if follow.any() else 0.0
        if square > 0.0:
            # below 1, whose logarithm is 0: an endless memory
            correlation = min(
                float(np.mean((rows[1:] * rows[:-1])[follow])) / square, 1.0 - 1e-9
            )
            memory[i, j] = (
                -float(np.mean(np.diff(when)[follow])) / math.log(correlation)
                if correlation > FAINT
                else 0.0
            )
    # of what lasts longer a window shows no end: its size and its memory would grow
    # together
    return np.minimum(memory, LASTS * errors.windows.length * errors.windows.step)


def new_spread(
    errors: WindowErrors, states: WindowStates, spread: Array, inverse: Array
) -> Array:
    """Spread (6,) of the unexplained wrench over the windows, from its estimates and
    their uncertainty.
    """
    wrench = states.beside[:, :6]
    uncertain = inverse[:, errors.wrench, errors.wrench]
    # effective number of windows that tell the wrench (MacKay), not 0 where none does
    effective = np.maximum(
        (1.0 - uncertain / spread**2).sum(axis=0), 1e-3 * len(wrench)
    )
    size = np.clip(
        np.sqrt((wrench**2).sum(axis=0) / effective), spread / SLOWLY, spread * SLOWLY
    )
    return np.asarray(np.maximum(size, FIRM * errors.push))


def _information(
    windows: ClockedWindows,
    reduced: Reduced,
    scores: Array,
    before: Array,
    block: float,
) -> dict[str, Array]:
    """Fields of :class:`WindowFit`: information and covariance, from the scores of data
    blocks of a given length (s).

    ``before`` (P, P) is the information before the data.
    """
    blocks = blocks_of(windows, block)
    parts, pulls = (
        np.stack([rows[each].sum(axis=0) for each in blocks])
        for rows in (reduced.information, scores)
    )
    curvature: Array = np.asarray(np.linalg.inv(reduced.total))
    flights = [windows.owners == i for i in range(len(windows.flights))]
    return {
        "curvature": curvature,
        # what was known before is one more observation, whose score has the variance of
        # its information
        "covariance": (
            blocks_covariance(reduced.total, parts, pulls)
            + curvature @ before @ curvature
        ),
        "prior_information": before,
        "block_information": parts,
        "stretch_information": np.stack(
            [reduced.information[own].sum(axis=0) for own in flights]
        ),
        "stretch_scores": np.stack([scores[own].sum(axis=0) for own in flights]),
    }


SHARPEST = 1e14
"""Largest information over that before the data: of more, double precision keeps too
little of the rest."""


def at_least(total: Array, before: Array) -> Array:
    """Information matrix (P, P) raised to what was known before the data, where
    rounding has made it smaller.

    Args:
        total: (P, P) of data and prior. The free numbers of the windows are reduced
            from it by differences, of which little is left where a flight shows
            nothing.
        before: (P, P) before the data, diagonal.
    """
    size = np.sqrt(np.diag(before))
    if not size.size or not size.all():  # of a number of which nothing was known
        return total
    shares, axes = np.linalg.eigh(total / np.outer(size, size))
    # in exact numbers no share is below 1, as data add to what was known; half, chosen,
    # passes for harmless rounding
    if shares[0] >= 0.5:
        return total
    root = size[:, None] * axes * np.sqrt(np.clip(shares, 1.0, SHARPEST))
    return np.asarray(root @ root.T)


def blocks_covariance(total: Array, parts: Array, scores: Array) -> Array:
    """Cluster-robust covariance (P, P) of an estimate, from the scores of B blocks of
    data.

    What a block leaves is less than its errors, as the estimate follows them: each
    score is divided by the root of the share that is left (CR2 of Bell and McCaffrey
    2002). Without that an interval is too narrow; by the whole share, which is the
    jackknife, too wide.

    Args:
        total: (P, P) information of all, with what was known before.
        parts: (B, P, P) of the data of each block.
        scores: (B, P) likewise.
    """
    root = np.linalg.inv(np.linalg.cholesky(total))
    followed, axes = np.linalg.eigh(root @ parts @ root.T)
    # the mean of the scores is what the prior pulls, which no block has alone
    turned = np.einsum("bpk,pq,bq->bk", axes, root, scores - scores.mean(axis=0))
    # 1e-9, because a block that alone tells a number leaves no share of it
    moves = (
        np.einsum(
            "bpk,bk->bp", axes, turned / np.sqrt(np.maximum(1.0 - followed, 1e-9))
        )
        @ root
    )
    return np.asarray(moves.T @ moves)


def blocks_of(windows: ClockedWindows, seconds: float = BLOCK) -> list[IntArray]:
    """Indices of the windows in each block of time of a flight."""
    size = max(1, round(seconds / windows.step))
    keys = (
        # no flight has so many blocks, so that those of two flights have no common key
        windows.owners * 10**9
        + (windows.begins - windows.firsts[windows.owners]) // size
    )
    return [np.flatnonzero(keys == key) for key in np.unique(keys)]
