"""An upper bound of the structured singular value for complex factors of single channels.

For a diagonal of n complex numbers, mu(M) is at most the largest singular value of D M D^-1 with any positive diagonal
D; the least of those is mu itself up to three numbers, and rarely more than some per cent above it beyond.

Source: Doyle 1982, Analysis of feedback systems with structured uncertainties, IEE Proc. D 129 (6); the first scaling
is that of Perron's vectors: Safonov 1982, Stability margins of diagonally perturbed multivariable feedback systems,
the same issue.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

ROUNDS = 30
"""Of the power iteration that finds Perron's vectors."""

STEPS = 60
"""Of the descent of one frequency's bound; it ends where a step gains less than ``ENOUGH``."""

ENOUGH = 2e-4
"""Share of the bound."""

CLOSE = 2e-3
"""A largest bound that exceeds the largest which a descent has reached by this share is good enough."""

SMALLEST = 1e-12
"""Share of its largest entry that is added to a matrix: Perron's vectors are positive where nothing is zero."""


def upper_bound(M: Complex) -> Array:
    """Bound of mu of each matrix (count, n, n); the largest of them is as low as a descent gets it, to ``CLOSE``.

    Others are bounds, too, though looser ones than they could be.
    """
    if M.shape[1] == 1:
        return np.asarray(np.abs(M[:, 0, 0]))
    scaled = _perron_scaled(M)
    found = np.linalg.norm(scaled, ord=2, axis=(1, 2))
    lowest = 0.0
    while len(found) and found.max() > lowest * (1.0 + CLOSE):
        worst = int(np.argmax(found))
        found[worst] = min(found[worst], _descended(scaled[worst]))
        lowest = max(lowest, float(found[worst]))
    return np.asarray(found)


def _perron_scaled(M: Complex) -> Complex:
    """D M D^-1 with D the root of the left over the right Perron vector of |M|."""
    size = np.abs(M)
    size = size + SMALLEST * size.max(axis=(1, 2), keepdims=True, initial=1e-300)
    right, left = np.ones(M.shape[:2]), np.ones(M.shape[:2])
    for _ in range(ROUNDS):
        right = np.einsum("fij,fj->fi", size, right)
        left = np.einsum("fij,fi->fj", size, left)
        right, left = (v / v.max(axis=1, keepdims=True) for v in (right, left))
    d = np.sqrt(left / right)
    return np.asarray(d[:, :, None] * M / d[:, None, :])


def _descended(M: Complex) -> float:
    """The largest singular value, made smaller by diagonal scalings along its gradient with halved steps."""
    value, slope = _slope(M)
    step = 0.5
    for _ in range(STEPS):
        if step < 1e-3 or not np.linalg.norm(slope) > 0.0:
            break
        d = np.exp(-step * slope / np.linalg.norm(slope))
        moved = d[:, None] * M / d[None, :]
        lower, its_slope = _slope(moved)
        if lower < value * (1.0 - ENOUGH):
            M, value, slope, step = moved, lower, its_slope, 1.5 * step
        else:
            step *= 0.5
    return value


def _slope(M: Complex) -> tuple[float, Array]:
    """The largest singular value and its slope by the logarithms of D: value (|u_i|^2 - |v_i|^2)."""
    U, sizes, Vh = np.linalg.svd(M)
    return float(sizes[0]), np.asarray(sizes[0] * (np.abs(U[:, 0]) ** 2 - np.abs(Vh[0]) ** 2))
