"""Least squares with prewhitened residuals: parameters, confidence intervals, explained variance.

A residual is what a candidate's prediction leaves of an impulse, summed up over time: what the law saw as noise of the
rates is white in it, what disturbs is slow. Each row is whitened by an autoregressive filter that is found from its own
residuals, in turns with the parameters (generalised least squares, Clarke 1967): in a closed loop, in which commands
follow the measured noise, only then is the fit unbiased (Ljung, System Identification, 1999, 13.4). Intervals are those
of the sandwich of scores summed over blocks of half a second, each of the residuals that a fit without the block leaves
(White 1980; Liang and Zeger 1986; Bell and McCaffrey 2002), by Student's t.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from skyarm.records.arrays import Array, Mask
from skyarm.records.immutable import immutable
from skyarm.studies.identify.autoregression import ar_coefficients, innovations
from skyarm.studies.identify.window_fit import scipy_parts

ORDER, TURNS = 6, 3
"""Of the whitening filter; turns of filter and parameters."""

BLOCK, FEWEST = 0.5, 8
"""s of a block of scores, and least number of blocks."""

RIDGE = 1e-4
"""Of the size of what is measured: residuals below are rounding, whose colour means nothing."""

CONFIDENCE = 0.95

Left = Callable[[Array], Array]
"""(candidates, parameters) -> (candidates, N, rows): what predictions leave, summed up over time."""


@immutable(kw_only=False)
class Fit:
    """Result of a least-squares fit: parameters, covariance, explained share of the variance.

    Attributes:
        values: (parameters,). covariance: of them. quantile: of Student's t for the interval's half width.
        explained: share of the whitened variance that the commands explain, 0 to 1.
        beyond: (parameters,) whether a parameter lies at the upper end of its range.
    """

    values: Array
    covariance: Array
    quantile: float
    explained: float
    beyond: Mask

    def half_width(self, direction: Sequence[float] | Array) -> float:
        """Half-width of the confidence interval of a weighted sum of the parameters."""
        weights = np.asarray(direction, dtype=float)
        return self.quantile * float(np.sqrt(max(float(weights @ self.covariance @ weights), 0.0)))


def fit(
    left: Left, nothing: Array, starts: Array, bounds: tuple[Array, Array], steps: Array, blocks: int, size: Array
) -> Fit:
    """Fit parameters by nonlinear least squares on whitened residuals.

    Args:
        left: function from candidates to residuals.
        nothing: (N, rows) residual without any effect of the commands.
        starts: (candidates, parameters); the best one is the initial guess.
        bounds: lowest and highest parameters.
        steps: (parameters,) of the finite differences.
        blocks: number of jackknife blocks.
        size: (rows,) size of the measured quantities.
    """
    least_squares, student = scipy_parts()
    rows = len(size)
    filters, scales = np.eye(1, ORDER) * np.full((rows, 1), 0.9), RIDGE * size + 1e-300
    # of a spread that every start has in common
    first = np.stack([_white(each, filters, np.ones(rows)) for each in left(starts)])
    scales = np.maximum(scales, first.std(axis=1).min(axis=0))
    values = starts[np.argmin(((first / scales) ** 2).sum(axis=(1, 2)))]

    def white(parameters: Array) -> Array:
        return np.stack([_white(each, filters, scales) for each in left(parameters)])

    def around(x: Array) -> tuple[Array, Array]:
        """Residual of a fit at given parameters, and its Jacobian by central differences."""
        low, high = np.maximum(x - steps, bounds[0]), np.minimum(x + steps, bounds[1])
        every = np.repeat(x[None, :], 2 * len(x) + 1, axis=0)
        index = np.arange(len(x))
        every[1 + index, index], every[1 + len(x) + index, index] = low, high
        found = white(every).reshape(len(every), -1)
        return found[0], ((found[1 + len(x) :] - found[1 : 1 + len(x)]) / (high - low)[:, None]).T

    inside = 1e-9 * (bounds[1] - bounds[0])
    last: dict[bytes, tuple[Array, Array]] = {}

    def once(x: Array) -> tuple[Array, Array]:
        """Residual of a fit and its Jacobian at given parameters; the last result is cached."""
        if x.tobytes() not in last:
            last.clear()
            last[x.tobytes()] = around(x)
        return last[x.tobytes()]

    search: dict[str, Any] = {"bounds": bounds, "x_scale": steps, "ftol": 1e-4, "xtol": 1e-4, "gtol": None}
    for _ in range(TURNS):
        last.clear()  # filters are others now
        begin = np.clip(values, bounds[0] + inside, bounds[1] - inside)
        values = least_squares(lambda x: once(x)[0], begin, jac=lambda x: once(x)[1], max_nfev=30, **search).x
        rest = left(values[None, :])[0]
        filters = np.array([ar_coefficients([x], ORDER, None, RIDGE * s) for x, s in zip(rest.T, size, strict=True)])
        scales = np.maximum(_white(rest, filters, np.ones(rows)).std(axis=0), RIDGE * size + 1e-300)
    flat, slope = around(values)
    error = flat.reshape(-1, rows)
    curvature = np.asarray(np.linalg.pinv(slope.T @ slope), dtype=float)
    sums = jackknife_scores(slope.reshape(*error.shape, -1), error, curvature, blocks)
    covariance = curvature @ (sums.T @ sums) @ curvature * (blocks - 1) / blocks
    edge = 0.01 * (bounds[1] - bounds[0])
    unexplained = float((error**2).sum() / max((_white(nothing, filters, scales) ** 2).sum(), 1e-300))
    return Fit(
        values=values,
        covariance=covariance,
        quantile=float(student(blocks - 1, 0.5 + 0.5 * CONFIDENCE)),
        explained=max(0.0, 1.0 - unexplained),
        beyond=values > bounds[1] - edge,
    )


def jackknife_scores(slope: Array, error: Array, curvature: Array, blocks: int | Sequence[int]) -> Array:
    """Block jackknife scores (blocks, parameters): each block by residuals of the fit without it.

    A fit comes closest to the blocks that tell most, so that their own residuals are too small: of the block b,
    with G_b = S_b^T S_b of its slopes and A the inverse of the whole, (I - G_b A)^-1 S_b^T e_b is the score of what
    the other blocks predict (Bell and McCaffrey 2002).

    Args:
        slope: (N, rows, P) of the whitened errors.
        error: (N, rows), whitened.
        curvature: (P, P) inverse of the information.
        blocks: their number, or the rows at which they begin but for the first.
    """
    found = []
    # in units of the parameters' deviations: kg m^2 beside seconds make a matrix that no solver inverts
    unit = np.sqrt(np.diag(curvature))
    inverse = curvature / np.outer(unit, unit)
    for block, rest in zip(np.array_split(slope, blocks), np.array_split(error, blocks), strict=True):
        s = block.reshape(-1, block.shape[-1]) * unit
        left = np.eye(len(inverse)) - s.T @ s @ inverse
        found.append(np.linalg.lstsq(left, s.T @ rest.ravel(), rcond=None)[0] / unit)
    return np.array(found)


def blocks_of(seconds: float) -> int:
    """Number of jackknife blocks of a flight of given duration, s."""
    return max(FEWEST, int(seconds / BLOCK))


def _white(left: Array, filters: Array, scales: Array) -> Array:
    """Whitened residual (N - order, rows): prediction error of an autoregressive model over its standard deviation."""
    found = innovations([left], filters)
    whitened: Array = (found - found.mean(axis=0)) / scales
    return whitened
