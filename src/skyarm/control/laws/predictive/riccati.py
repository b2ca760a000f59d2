"""A linear-quadratic problem along a horizon, solved by the Riccati recursion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

FLOOR = 1e-9
"""Added to the inputs' second derivatives: an input that nothing weighs stays where it is."""

HOLD = 1e8
"""Weight of a held input against its own second derivative."""


@dataclass(frozen=True, slots=True)
class Linear:
    """Stages x[k+1] = A[k] x[k] + B[k] u[k] + c[k] with residuals Jx[k] x[k] + Ju[k] u[k] + r[k], all deviations.

    Attributes:
        AB: (N, nx, nx + nu). c: (N, nx). J: (N + 1, nr, nx + nu), of which the last counts x alone. r: (N + 1, nr).
    """

    AB: Array
    c: Array
    J: Array
    r: Array


@dataclass(frozen=True, slots=True)
class Policy:
    """u[k] = k[k] + K[k] x[k]: feed-forward (N, nu), gains (N, nu, nx); P (nx, nx) is the cost-to-go at the start."""

    k: Array
    K: Array
    P: Array


def policy(problem: Linear, held: Array | None = None, at: Array | None = None, *, damping: float = 0.0) -> Policy:
    """Minimise the sum of squared residuals.

    Args:
        problem: the stages.
        held: (N, nu) True where an input is fixed.
        at: (N, nu) where to.
        damping: share by which the second derivatives of the inputs are raised: the step is shorter.

    Source: Mayne 1966; Rawlings, Mayne, Diehl 2017, section 8.8.3 (Gauss-Newton, Riccati recursion).
    """
    stages, nx, width = problem.AB.shape
    nu = width - nx
    # columns in the order inputs, states, one: every stage is then two products and one small system
    J = np.concatenate([problem.J[:, :, nx:], problem.J[:, :, :nx], problem.r[:, :, None]], axis=2)
    step = np.concatenate([problem.AB[:, :, nx:], problem.AB[:, :, :nx], problem.c[:, :, None]], axis=2)
    own = J.transpose(0, 2, 1)[:, :width] @ J
    P, p = own[stages, nu:, nu:width], own[stages, nu:, width]
    Kk = np.empty((stages, nu, nx + 1))
    nothing = np.zeros((stages, nu))
    strength, wanted = (nothing, nothing) if held is None or at is None else (np.where(held, HOLD, 0.0), at)
    raised = strength + damping
    for i in reversed(range(stages)):
        ahead = P @ step[i]
        ahead[:, width] += p
        M = own[i] + step[i, :, :width].T @ ahead
        inner, cross = M[:nu, :nu], M[:nu, nu:]
        # a held input weighs more than all else by a factor of its own, whatever its unit
        weight = FLOOR + raised[i] * inner.diagonal()
        left, right = inner.copy(), cross.copy()
        left.flat[:: nu + 1] += weight
        right[:, nx] -= weight * wanted[i] * (strength[i] > 0.0)
        found = Kk[i] = -np.linalg.solve(left, right)
        # the general form: with held inputs K and k are not the minimiser's
        to_go = M[nu:, nu:] + found[:, :nx].T @ (inner @ found + cross) + M[nu:, :nu] @ found
        P, p = 0.5 * (to_go[:, :nx] + to_go[:, :nx].T), to_go[:, nx]
    return Policy(Kk[:, :, nx], Kk[:, :, :nx], P)


def rollout(problem: Linear, found: Policy, first: Array, low: Any, high: Any) -> tuple[Array, Array]:
    """Deviations x (N + 1, nx) and u (N, nu) from ``first`` on, each input kept within (N, nu) limits."""
    stages, nx, width = problem.AB.shape
    x, u = np.empty((stages + 1, nx)), np.empty((stages, width - nx))
    x[0] = first
    for i in range(stages):
        u[i] = np.minimum(np.maximum(found.k[i] + found.K[i] @ x[i], low[i]), high[i])
        x[i + 1] = problem.AB[i] @ np.concatenate([x[i], u[i]]) + problem.c[i]
    return x, u
