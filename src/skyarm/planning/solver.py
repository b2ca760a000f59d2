"""Solver of plans: augmented Lagrangian over multiple shooting, steps by Riccati recursion, a line search by lanes.

Gaps between stages stay open and close with the step; goals and all limits, those of inputs too, have multipliers. A
step minimises the Gauss-Newton model of the augmented Lagrangian; no second derivatives of the dynamics are needed.
Sources: Bertsekas 1982 (method of multipliers); Nocedal, Wright 2006, section 17.4; Mastalli et al. 2020 (gaps that
close with the step); Howell, Jackson, Manchester 2019 (augmented Lagrangian in trajectory optimisation).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np

from skyarm.control.laws.predictive.solver import Linear, Policy, policy
from skyarm.planning.stage import CompiledStage
from skyarm.records.arrays import Array, Mask
from skyarm.records.immutable import immutable

SHARES = np.array([1.0, 0.8, 0.6, 0.4, 0.25, 0.12, 0.05, 0.01])
"""Shares of a step that the line search tries at once."""

TOLERANCE = 1e-6
"""Largest violation of a solved plan: m, m/s, rad, and of limits as shares."""

PATIENCE = 8
"""Largest number of iterations between two updates of the multipliers."""

MOST_DAMPING = 1e3
"""Damping at which no step is found."""

STEEPEST = 1e6
"""Largest penalty."""

LAX = -1e3
"""Value of a limit that a stage does not have."""


@immutable(kw_only=False, eq=False)
class Guess:
    """Motion to begin from: states (N + 1, nx) and inputs (N, nu)."""

    x: Array
    u: Array


@immutable(eq=False)
class PlanProblem:
    """Numbers of all stages and which of their goals and limits count.

    Attributes:
        data: (N + 1, leaves of StageData). goals: (N + 1, goals). limits: (N + 1, limits).
    """

    data: Array
    goals: Mask
    limits: Mask


@immutable(eq=False)
class Solution:
    """Result of a solution.

    Attributes:
        x, u: states (N + 1, nx) and inputs (N, nu). K: gains (N, nu, nt) of the last step.
        solved: True within the tolerance. cost: of the motion. violation: largest, of gaps, goals and limits.
        iterations, seconds: spent. gap, goals, limits: what is left of them, by stage.
        forces: multipliers of goals and limits: what they cost.
    """

    x: Array
    u: Array
    K: Array
    solved: bool
    cost: float
    violation: float
    iterations: int
    seconds: float
    gap: Array
    goals: Array
    limits: Array
    forces: tuple[Array, Array]


@immutable(eq=False)
class _Values:
    """Values of all stages: gaps, cost residuals, goals and limits; what does not count is 0, or far from its limit."""

    gap: Array
    costs: Array
    goals: Array
    limits: Array

    @property
    def cost(self) -> Array:
        """Cost of each motion."""
        return np.asarray(0.5 * (self.costs**2).sum((-2, -1)))

    @property
    def violation(self) -> float:
        """Largest violation of one motion."""
        return float(max(np.abs(self.gap).max(), np.abs(self.goals).max(), self.limits.max(), 0.0))

    def of(self, lane: int) -> _Values:
        """Values of one motion of several."""
        return _Values(gap=self.gap[lane], costs=self.costs[lane], goals=self.goals[lane], limits=self.limits[lane])


class Solver:
    """Augmented-Lagrangian solver for one compiled stage.

    Args:
        stage: compiled. penalty: first one; it grows by 10 while the violation does not fall by 4.
    """

    def __init__(self, stage: CompiledStage, penalty: float = 100.0) -> None:
        self.stage, self.penalty = stage, penalty

    def _read(self, values: Array, problem: PlanProblem) -> _Values:
        s = self.stage
        costs = values[..., s.costs].copy()
        costs[..., -1, :] = 0.0
        return _Values(
            gap=values[..., :-1, : s.nt],
            costs=costs,
            goals=values[..., s.goals] * problem.goals,
            limits=np.where(problem.limits, values[..., s.limits], LAX),
        )

    def solve(self, problem: PlanProblem, guess: Guess, *, iterations: int = 600, seconds: float = 20.0) -> Solution:
        """Solve from a guess; the first state stays but for the lengths of free phases."""
        *_, last = self.steps(problem, guess, iterations=iterations, seconds=seconds)
        return last

    def steps(
        self, problem: PlanProblem, guess: Guess, *, iterations: int = 600, seconds: float = 20.0
    ) -> Iterator[Solution]:
        """Solve from a guess; yields the motion after each iteration."""
        s, begun = self.stage, time.perf_counter()
        x, u = guess.x, guess.u
        stages, free = len(u), s.stage.free
        y, z = np.zeros(problem.goals.shape), np.zeros(problem.limits.shape)
        penalty, damping, weight, before, K = self.penalty, 0.0, 1.0, np.inf, np.zeros((stages, s.nu, s.nt))
        inner, lax = 0, 1e-2
        now = self._read(s.values(x, u, problem.data)[0], problem)
        linear: Linear | None = None
        for k in range(iterations):
            if linear is None:
                linear, gradient = self._linear(problem, x, u, now, y, z, penalty)
            feedback = policy(linear, lift=damping)
            dx, du, K = _step(linear, feedback, free)
            weight = max(0.5 * weight, 1.2 * _steepest(linear, gradient, dx, du))
            tried = self._read(s.values(x, u, problem.data, (dx, du), SHARES), problem)
            merit = merit_of(problem, y, z, penalty, weight)
            here, there = float(merit(now)), merit(tried)
            step = np.concatenate([dx, np.vstack([du, np.zeros((1, s.nu))])], axis=1)
            slope = float((gradient * step).sum() - weight * np.abs(now.gap).sum())
            better = np.flatnonzero(there <= here + 1e-4 * SHARES * min(slope, 0.0) + 1e-12 * abs(here))
            share = float(SHARES[better[0]]) if len(better) else 0.0
            if share:
                x, u, now, linear = s.retract(x, share * dx), u + share * du, tried.of(int(better[0])), None
            damping = next_damping(damping, share)
            cost, violation, spent = float(now.cost), now.violation, time.perf_counter() - begun
            inner += 1
            done = -slope < lax * max(1e-3, cost) or damping >= MOST_DAMPING
            solved = done and violation < TOLERANCE and -slope < 1e-4 * max(1e-2, cost)
            yield Solution(
                x=x, u=u, K=K, solved=solved, cost=cost, violation=violation, iterations=k + 1, seconds=spent,
                gap=now.gap, goals=now.goals, limits=now.limits,
                forces=(y + penalty * now.goals, np.maximum(z + penalty * now.limits, 0.0)),
            )  # fmt: skip
            if solved or spent > seconds or not np.isfinite(cost):
                return
            if done or inner >= PATIENCE:
                y = y + penalty * now.goals
                z = np.where(problem.limits, np.maximum(z + penalty * now.limits, 0.0), 0.0)
                if done and violation > 0.25 * before:
                    penalty = min(10.0 * penalty, STEEPEST)
                weight, inner, linear, lax = 1.0, 0, None, max(0.3 * lax, 1e-5)
                damping, before = 0.1 * damping, violation

    def _linear(
        self, problem: PlanProblem, x: Array, u: Array, now: _Values, y: Array, z: Array, penalty: float
    ) -> tuple[Linear, Array]:
        """Linear-quadratic problem of a step, and the gradient (N + 1, nt + nu) of the augmented Lagrangian."""
        s = self.stage
        J = s.jacobians(x, u, problem.data)
        active = np.maximum(z + penalty * now.limits, 0.0)
        root = np.sqrt(penalty)
        r = np.concatenate([now.costs, (y + penalty * now.goals) / root * problem.goals, active / root], axis=1)
        slopes = J[:, s.nt :].copy()
        slopes[-1, s.costs.start - s.nt : s.costs.stop - s.nt] = 0.0
        slopes[:, s.goals.start - s.nt : s.goals.stop - s.nt] *= (root * problem.goals)[:, :, None]
        slopes[:, s.limits.start - s.nt :] *= (root * (active > 0.0))[:, :, None]
        gradient = (r[:, None, :] @ slopes)[:, 0]
        return Linear(J[:-1, : s.nt], now.gap, slopes, r), gradient


def merit_of(problem: PlanProblem, y: Array, z: Array, penalty: float, weight: float) -> Callable[[_Values], Array]:
    """Merit function: augmented Lagrangian plus the weighted sum of the gaps' sizes."""

    def merit(at: _Values) -> Array:
        active = np.maximum(z + penalty * at.limits, 0.0)
        goals = (y * at.goals).sum((-2, -1)) + 0.5 * penalty * (at.goals**2).sum((-2, -1))
        limits = ((active**2 - z**2) * problem.limits).sum((-2, -1)) / (2.0 * penalty)
        return np.asarray(at.cost + goals + limits + weight * np.abs(at.gap).sum((-2, -1)))

    return merit


def next_damping(damping: float, share: float) -> float:
    """Number added to all second derivatives for the next step, after a step of which a share was taken."""
    if share > 0.5:
        return damping / 4.0 if damping > 1e-6 else 0.0
    if share >= 0.2:
        return damping
    return max(2.0 * damping, 1e-5) if share else max(4.0 * damping, 1e-4)


def _step(linear: Linear, feedback: Policy, free: int) -> tuple[Array, Array, Array]:
    """Changes of states and inputs under a policy, of the first state those of its free phase lengths; and gains."""
    stages, nt, width = linear.AB.shape
    dx, du = np.zeros((stages + 1, nt)), np.empty((stages, width - nt))
    if free:
        P = feedback.P[nt - free :, nt - free :]
        dx[0, nt - free :] = -np.linalg.solve(P + 1e-9 * np.eye(free), feedback.p[nt - free :])
    for k in range(stages):
        du[k] = feedback.k[k] + feedback.K[k] @ dx[k]
        dx[k + 1] = linear.AB[k, :, :nt] @ dx[k] + linear.AB[k, :, nt:] @ du[k] + linear.c[k]
    return dx, du, feedback.K


def _steepest(linear: Linear, gradient: Array, dx: Array, du: Array) -> float:
    """Largest costate of a step: size of the merit's slope by a gap."""
    nt = dx.shape[1]
    w = np.concatenate([dx, np.vstack([du, np.zeros((1, du.shape[1]))])], axis=1)
    across = linear.J @ w[:, :, None]
    curved = (across.transpose(0, 2, 1) @ linear.J)[:, 0] + gradient
    costate, most = curved[-1, :nt], 0.0
    for k in reversed(range(len(du))):
        most = max(most, float(np.abs(costate).max()))
        costate = curved[k, :nt] + linear.AB[k, :, :nt].T @ costate
    return most
