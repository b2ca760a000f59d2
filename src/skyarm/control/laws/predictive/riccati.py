"""Real-time iteration: linearise at the predicted motion, solve the linear-quadratic problem by Riccati, move there."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.control.laws.predictive.linearise import Bounds, Rollouts, Stages

Array = npt.NDArray[np.float64]

SMALLEST_WEIGHT = 1e-9
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
        weight = SMALLEST_WEIGHT + raised[i] * inner.diagonal()
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


PASSES = 3
"""Times that inputs at their limits are fixed and the rest solved again."""

SHARES = np.array([1.0, 0.7, 0.45, 0.25, 0.12, 0.05, 0.02, 0.0])
"""Of the feed-forward step: all are tried at once, the cheapest motion is taken. At 0 the old motion is followed."""

DAMPING = (1e-3, 1e3)
"""Least and largest Levenberg-Marquardt damping, as shares of the inputs' own second derivatives; below it is none."""

GROWTH = 8.0
"""Damping grows by this factor after a step cut by more than half, and shrinks by it after a whole one."""


class NoPlanError(Exception):
    """No motion with a finite cost was found."""


@dataclass(frozen=True, slots=True)
class Plan:
    """A planned motion: states (N + 1, nx), inputs (N, nu) and the gains (N, nu, nx) of u = u* + K (x - x*).

    Attributes:
        x, u, K: those. damping: of the next step. cost: sum of squared residuals; NaN if not known.
        share: of the last step that was taken.
    """

    x: Array
    u: Array
    K: Array
    damping: float = 0.0
    cost: float = float("nan")
    share: float = 1.0


@dataclass(frozen=True, slots=True)
class Problem:
    """Input of the solver.

    Attributes:
        start: (nx,) the state now. disturbance: its leaves. goals: (N + 1, leaves of a goal).
    """

    start: Array
    disturbance: Array
    goals: Array


class Riccati:
    """One damped Gauss-Newton step a call by the Riccati recursion; of the steps along it the cheapest motion is taken.

    Args:
        stages: compiled prediction. rollouts: compiled motions. steps: (N,) lengths of the stages, s.
        final: s for which the end counts. bounds: of the inputs.

    Source: Diehl, Bock, Schloeder 2005 (real-time iteration); Tassa, Mansard, Todorov 2014 (line search by rolling the
    policy out); Levenberg 1944, Marquardt 1963 (damping, here of the inputs).
    """

    def __init__(self, stages: Stages, rollouts: Rollouts, steps: Array, final: float, bounds: Bounds) -> None:
        self.stages, self.rollouts, self.steps, self.bounds = stages, rollouts, steps, bounds
        counted = np.append(steps, final)
        self._roots = np.sqrt(counted)
        self._times = np.column_stack([np.append(steps, steps[-1]), counted])

    def solve(self, problem: Problem, guess: Plan) -> Plan:
        """The motion one step nearer to the best, and the policy around it.

        Raises:
            NoPlanError: the guess leads nowhere.
        """
        with np.errstate(all="ignore"):
            try:
                found = self._policy(problem, guess)
            except np.linalg.LinAlgError:
                raise NoPlanError from None
            given = self._times, problem.disturbance, problem.goals
            tried = self.rollouts.run(guess.x, guess.u, found, SHARES, problem.start, given)
        cost = np.where(np.isfinite(tried.cost), tried.cost, np.inf)
        best = int(np.argmin(cost))
        if not (np.isfinite(cost[best]) and np.isfinite(found.K).all()):
            raise NoPlanError
        share = float(SHARES[best])
        x, u = np.ascontiguousarray(tried.x[:, :, best]), np.ascontiguousarray(tried.u[:, :, best])
        return Plan(x, u, found.K, damped(guess.damping, share), float(cost[best]), share)

    def _policy(self, problem: Problem, guess: Plan) -> Policy:
        """The policy of the linearised problem, inputs at their limits held there."""
        here = linear_problem(self.stages, problem, guess.x, guess.u, self.steps, self._roots)
        low, high = self._room(guess, len(self.bounds.speeds))
        first = problem.start - guess.x[0]
        found = policy(here, damping=guess.damping)
        _, du = rollout(here, found, first, low, high)
        held = np.zeros(du.shape, dtype=bool)
        for _ in range(PASSES):
            clipped = (du <= low) | (du >= high)
            if not (clipped & ~held).any():
                break
            # what is at a limit stays there, and the other inputs make the best of it
            held |= clipped
            found = policy(here, held, np.where(du <= low, low, high), damping=guess.damping)
            _, du = rollout(here, found, first, low, high)
        return found

    def _room(self, guess: Plan, rotors: int) -> tuple[Array, Array]:
        """How far each input may still fall and rise (N, nu): no rotor stops, none turns faster than it can."""
        speeds, dt = guess.x[:-1, -rotors:], self.steps[:, None]
        efforts = np.broadcast_to(self.bounds.efforts, (len(self.steps), len(self.bounds.efforts)))
        low, high = np.hstack([-speeds / dt, -efforts]), np.hstack([(self.bounds.speeds - speeds) / dt, efforts])
        return np.minimum(low - guess.u, 0.0), np.maximum(high - guess.u, 0.0)


def damped(damping: float, share: float) -> float:
    """Damping of the step that follows one of which a share was taken."""
    least, most = DAMPING
    if share < 0.5:
        return min(max(damping * GROWTH, least), most)
    if share < 1.0:
        return damping
    return damping / GROWTH if damping > least else 0.0


def linear_problem(stages: Stages, problem: Problem, x: Array, u: Array, steps: Array, roots: Array) -> Linear:
    """The problem linearised at a motion x (N + 1, nx), u (N, nu), in deviations from it."""
    dt, inputs = np.append(steps, steps[-1]), np.vstack([u, u[-1:]])
    ends, AB, errors, slopes = stages.derivatives(x, inputs, dt, problem.disturbance, problem.goals)
    J, r = slopes * roots[:, None, None], errors * roots[:, None]
    # there is no input at the end of the horizon
    J[-1, -stages.input_errors :], r[-1, -stages.input_errors :] = 0.0, 0.0
    return Linear(AB[:-1], ends[:-1] - x[1:], J, r)


def shifted(plan: Plan, steps: Array, dt: float) -> Plan:
    """The same motion seen ``dt`` s later, on stages of the same lengths; its last piece is held."""
    times = np.append(0.0, np.cumsum(steps))
    later = np.minimum(times + dt, times[-1])
    at = np.clip(np.searchsorted(times, later, side="right") - 1, 0, len(steps) - 1)
    part = ((later - times[at]) / steps[at])[:, None]
    x = plan.x[at] + part * (plan.x[at + 1] - plan.x[at])
    x[:, 3:7] /= np.linalg.norm(x[:, 3:7], axis=1, keepdims=True)
    return dataclasses.replace(plan, x=x, u=plan.u[at[:-1]])
