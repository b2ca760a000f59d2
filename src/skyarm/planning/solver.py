"""Solver of plans: augmented Lagrangian over multiple shooting, steps by Riccati
recursion, a line search by lanes.

Gaps between stages stay open and close with the step; goals and all limits, those of
inputs too, have multipliers. A step minimises the Gauss-Newton model of the augmented
Lagrangian; no second derivatives of the dynamics are needed.
Sources: Bertsekas 1982 (method of multipliers); Nocedal, Wright 2006, section 17.4;
Mastalli et al. 2020 (gaps that close with the step); Howell, Jackson, Manchester 2019
(augmented Lagrangian in trajectory optimisation).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from skyarm.planning.stage import CompiledStage
from skyarm.records.arrays import Array, Mask
from skyarm.records.immutable import immutable, positional
from skyarm.records.leaves import parts

SHARES = np.array([1.0, 0.8, 0.6, 0.4, 0.25, 0.12, 0.05, 0.01])
"""Shares of a step that the line search tries at once, as lanes of one call; chosen."""

ITERATIONS = 600
"""Largest number of iterations from one guess."""

TOLERANCE = 1e-6
"""Largest violation of a solved plan: m, m/s, rad, and of limits as shares."""

PATIENCE = 8
"""Largest number of iterations between two updates of the multipliers.

Chosen. With half of it five shipped tasks take up to twice the iterations, with twice
of it 0.83 to 1 times as many, for costs within 3 % (measured)."""

MOST_DAMPING = 1e3
"""Damping at which no step is found."""

STEEPEST = 1e6
"""Largest penalty."""

LAX = -1e3
"""Value of a limit that a stage does not have."""

BENDING = 0.1
"""Least cosine between a step and the change of the slopes for which that change counts
as curvature."""

NOISE = 1e-14
"""Change of a slope along a step that may be rounding."""

SMALLEST_WEIGHT = 1e-9
"""Number added to the inputs' second derivatives: an input without a cost stays
unchanged."""

SETTLED = 100.0
"""Decrease a step may still promise, over what the violation costs, where the penalty
grows: else the step is due."""

STUCK = 60
"""Number of updates at the largest penalty in which the violation does not fall, after
which the search ends."""


@positional(eq=False)
class Guess:
    """Motion to begin from: states (N + 1, nx) and inputs (N, nu)."""

    x: Array
    u: Array


@immutable(eq=False)
class PlanProblem:
    """Numbers of all stages and which of their goals and limits count.

    Attributes:
        data: (N + 1, leaves of StageData). goals: (N + 1, goals). limits: (N + 1,
            limits).
    """

    data: Array
    goals: Mask
    limits: Mask


@immutable(eq=False)
class Solution:
    """Result of a solution.

    Attributes:
        x, u: states (N + 1, nx) and inputs (N, nu). K: gains (N, nu, nt) of the last
            step.
        solved: True within the tolerance. cost: of the motion. violation: largest, of
            gaps, goals and limits.
        iterations: their number. gap, goals, limits: what is left of them, by stage.
        forces: multipliers of goals and limits: what they cost.
    """

    x: Array
    u: Array
    K: Array
    solved: bool
    cost: float
    violation: float
    iterations: int
    gap: Array
    goals: Array
    limits: Array
    forces: tuple[Array, Array]


@immutable(eq=False)
class _Values:
    """Values of all stages: gaps, cost residuals, goals and limits; what does not count
    is 0, or far from its limit.
    """

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
        return float(
            max(
                np.abs(self.gap).max(), np.abs(self.goals).max(), self.limits.max(), 0.0
            )
        )

    def of(self, lane: int) -> _Values:
        """Values of one motion of several."""
        return _Values(**{name: each[lane] for name, each in parts(self).items()})


class PlanSolver:
    """Augmented-Lagrangian solver for one compiled stage.

    Args:
        stage: compiled. penalty: first one; it grows by 10 while the violation does not
            fall by 4.
    """

    def __init__(self, stage: CompiledStage, penalty: float = 100.0) -> None:
        self.stage, self.penalty = stage, penalty

    def _read(self, values: Array, problem: PlanProblem) -> _Values:
        s = self.stage
        costs = values[..., s.costs].copy()
        # no stage follows the last state, so it has no cost
        costs[..., -1, :] = 0.0
        return _Values(
            gap=values[..., :-1, : s.nt],
            costs=costs,
            goals=values[..., s.goals] * problem.goals,
            limits=np.where(problem.limits, values[..., s.limits], LAX),
        )

    def solve(self, problem: PlanProblem, guess: Guess) -> Solution:
        """Solve from a guess; the first state stays but for the lengths of free
        phases.
        """
        *_, last = self.steps(problem, guess)
        return last

    def steps(
        self, problem: PlanProblem, guess: Guess, *, iterations: int = ITERATIONS
    ) -> Iterator[Solution]:
        """Solve from a guess; yields the motion after each iteration, of which no clock
        decides the number.
        """
        s = self.stage
        x, u = guess.x, guess.u
        y, z = np.zeros(problem.goals.shape), np.zeros(problem.limits.shape)
        penalty, damping, weight, before = self.penalty, 0.0, 1.0, np.inf
        # early multipliers are rough, so that their motions need not be exact: lax
        # falls from 1e-2 to 1e-5 of the cost by 0.3 an update (chosen)
        inner, stuck, lax = 0, 0, 1e-2
        now = self._read(s.values(x, u, problem.data)[0], problem)
        J, taken = np.zeros(0), (np.zeros(0),) * 3
        bent = np.zeros((s.nt + s.nu,) * 2)
        for k in range(iterations):
            forces = np.hstack(multipliers(y, z, penalty, now))
            if not len(J):
                J = s.jacobians(x, u, problem.data)
                J[-1, s.costs] = 0.0
                if k:
                    pulls = forces * self._counting(problem, forces)
                    bent = curvature(J, np.hstack([now.costs, pulls]), *taken)
            Q = self._model(problem, J, now.costs, forces, penalty)
            Q[:, :-1, :-1] += bent
            P, gains = recursion(Q, J[:-1, : s.nt], now.gap, damping)
            dx, du = linear_step(P, gains, J[:-1, : s.nt], now.gap, s.stage.free)
            costates = (
                P[1:, :-1] @ np.hstack([dx[1:], np.ones((len(u), 1))])[:, :, None]
            )[:, :, 0]
            # the sum of gaps is an exact penalty only with a weight above every
            # multiplier; it falls slowly, so that merits stay comparable
            weight = max(0.5 * weight, 1.2 * float(np.abs(costates).max()))
            tried = self._read(s.values(x, u, problem.data, (dx, du), SHARES), problem)
            step = np.hstack([np.vstack([du, np.zeros((1, s.nu))]), dx])
            slope = float((Q[:, :-1, -1] * step).sum() - weight * np.abs(now.gap).sum())
            merit = merit_of(problem, y, z, penalty, weight)
            lane = largest_decrease(merit, now, tried, slope)
            share = 0.0 if lane is None else float(SHARES[lane])
            if lane is not None:
                x, u = s.retract(x, share * dx), u + share * du
                now = tried.of(lane)
                # the derivatives are out of date at the new motion
                J, taken = np.zeros(0), (J, share * step, costates)
            damping = next_damping(damping, share)
            cost, violation = float(now.cost), now.violation
            inner += 1
            # done: a step promises less than a share of the cost, which falls; of a
            # motion that hardly costs, less than a share of 1e-3
            done = -slope < lax * max(1e-3, cost) or damping >= MOST_DAMPING
            # solved: within all limits, and hardly anything is left to gain
            solved = violation < TOLERANCE and -slope < 1e-4 * max(1e-2, cost)
            updated = multipliers(y, z, penalty, now)
            yield Solution(
                x=x,
                u=u,
                K=gains[:, :, :-1],
                solved=solved,
                cost=cost,
                violation=violation,
                iterations=k + 1,
                gap=now.gap,
                goals=now.goals,
                limits=now.limits,
                forces=updated,
            )
            if solved or stuck >= STUCK or not np.isfinite(cost):
                return
            if done or inner >= PATIENCE:
                y = y + penalty * now.goals
                z = np.where(problem.limits, updated[1], 0.0)
                # down to a quarter (chosen) by the multipliers alone: the penalty need
                # not grow
                if violation <= 0.25 * before:
                    stuck = 0
                elif done and -slope < SETTLED * penalty * violation**2:
                    stuck += penalty == STEEPEST
                    penalty = min(10.0 * penalty, STEEPEST)
                # other multipliers have other costates: the gaps' weight begins anew
                weight, inner, lax = 1.0, 0, max(0.3 * lax, 1e-5)
                damping, before = 0.1 * damping, violation

    def _counting(self, problem: PlanProblem, forces: Array) -> Mask:
        """Goals that count and limits that act, (N + 1, goals and limits)."""
        return np.hstack([problem.goals, forces[:, problem.goals.shape[1] :] > 0.0])

    def _model(
        self,
        problem: PlanProblem,
        J: Array,
        costs: Array,
        forces: Array,
        penalty: float,
    ) -> Array:
        """Gauss-Newton model of the augmented Lagrangian by inputs, tangents and 1,
        (N + 1, nu + nt + 1, same).
        """
        s = self.stage
        rows = np.concatenate(
            [inputs_first(J[:, s.costs], s.nt), costs[:, :, None]], axis=2
        )
        Q: Array = rows.transpose(0, 2, 1) @ rows
        counting = self._counting(problem, forces)
        # few stages have goals or limits that act, and their numbers differ
        for k in np.flatnonzero(counting.any(axis=1)):
            at = counting[k]
            rows = np.column_stack(
                [inputs_first(J[k, s.goals.start :][at], s.nt), forces[k, at] / penalty]
            )
            Q[k] += penalty * (rows.T @ rows)
        return Q


def multipliers(y: Array, z: Array, penalty: float, at: _Values) -> tuple[Array, Array]:
    """Multipliers of goals and limits after an update with the values of a motion."""
    return y + penalty * at.goals, np.maximum(z + penalty * at.limits, 0.0)


def inputs_first(J: Array, nt: int) -> Array:
    """Derivatives by inputs and tangents from those by tangents (nt) and inputs, in the
    last axis.
    """
    return np.concatenate([J[..., nt:], J[..., :nt]], axis=-1)


def curvature(
    J: Array, pulls: Array, old: Array, step: Array, costates: Array
) -> Array:
    """Second derivatives (N + 1, nu + nt, same) of each stage along the step before,
    which Gauss-Newton leaves out.

    Args:
        J: derivatives (N + 1, outputs, nt + nu) after the step.
        pulls: (N + 1, outputs behind the gap) by which they count.
        old: derivatives before it.
        step: (N + 1, nu + nt).
        costates: (N, nt).
    """
    nt = costates.shape[1]
    weights = np.hstack([np.vstack([costates, np.zeros((1, nt))]), pulls])[:, None]
    change = inputs_first((weights @ J - weights @ old)[:, 0], nt)
    along = (step * change).sum(axis=1)
    sure = (
        along
        > BENDING * np.sqrt((step**2).sum(axis=1) * (change**2).sum(axis=1)) + NOISE
    )
    # the inner choice keeps a division by zero out of rows that do not count
    share = np.where(sure, 1.0 / np.where(sure, along, 1.0), 0.0)
    return share[:, None, None] * (change[:, :, None] * change[:, None, :])


def merit_of(
    problem: PlanProblem, y: Array, z: Array, penalty: float, weight: float
) -> Callable[[_Values], Array]:
    """Merit function: augmented Lagrangian plus the weighted sum of the gaps' sizes."""

    def merit(at: _Values) -> Array:
        active = np.maximum(z + penalty * at.limits, 0.0)
        goals = (y * at.goals).sum((-2, -1)) + 0.5 * penalty * (at.goals**2).sum(
            (-2, -1)
        )
        # of a limit that is not active this is constant: only its multiplier counts
        limits = ((active**2 - z**2) * problem.limits).sum((-2, -1)) / (2.0 * penalty)
        return np.asarray(
            at.cost + goals + limits + weight * np.abs(at.gap).sum((-2, -1))
        )

    return merit


def largest_decrease(
    merit: Callable[[_Values], Array], now: _Values, ahead: _Values, slope: float
) -> int | None:
    """Index of the largest share of a step that lowers the merit enough; None if none
    does.

    Args:
        merit: of :func:`merit_of`.
        now: values before the step.
        ahead: values after each of the :data:`SHARES` of it.
        slope: change of the merit along the whole step, to first order.
    """
    present = float(merit(now))
    # sufficient decrease (Armijo), as far as rounding lets it be seen
    enough = present + 1e-4 * SHARES * min(slope, 0.0) + 1e-12 * abs(present)
    better = np.flatnonzero(merit(ahead) <= enough)
    return int(better[0]) if len(better) else None


def next_damping(damping: float, share: float) -> float:
    """Number added to all second derivatives for the next step, after a step of which a
    share was taken.
    """
    # chosen; below 1e-6 damping is off, so that good steps are Newton's own
    if share > 0.5:
        return damping / 4.0 if damping > 1e-6 else 0.0
    if share >= 0.2:
        return damping
    return max(2.0 * damping, 1e-5) if share else max(4.0 * damping, 1e-4)


def recursion(
    Q: Array, AB: Array, gap: Array, damping: float = 0.0
) -> tuple[Array, Array]:
    """Riccati recursion of quadratic models (N + 1, nu + nt + 1, same) of inputs,
    states and 1 on linear stages.

    The predictive law has one of its own, on residuals, which can fix inputs at their
    limits; here limits have multipliers, and of most stages only a model is known.

    Args:
        Q: the models; of the last one the states count. Damping is added in place.
        AB: (N, nt, nt + nu) derivatives of the stages.
        gap: (N, nt).
        damping: number added to all second derivatives.

    Returns:
        costs to go (N + 1, nt + 1, nt + 1) and gains (N, nu, nt + 1), of states and 1.

    Source: Rawlings, Mayne, Diehl 2017, section 8.8.3.
    """
    stages, nt, width = AB.shape
    nu = width - nt
    S = np.zeros((stages, nt + 1, width + 1))
    S[:, :nt, :width] = inputs_first(AB, nt)
    S[:, :nt, width] = gap
    S[:, nt, width] = 1.0
    Q[:, np.arange(width), np.arange(width)] += damping
    Q[:, np.arange(nu), np.arange(nu)] += SMALLEST_WEIGHT
    P, gains = np.empty((stages + 1, nt + 1, nt + 1)), np.empty((stages, nu, nt + 1))
    P[stages] = Q[stages, nu:, nu:]
    for k in reversed(range(stages)):
        M = S[k].T @ (P[k + 1] @ S[k])
        M += Q[k]
        cross = M[:nu, nu:]
        # an inverse takes 7 us here, np.linalg.solve 10 (nu = 9, measured)
        gains[k] = np.linalg.inv(-M[:nu, :nu]) @ cross
        to_go = M[nu:, nu:] + cross.T @ gains[k]
        # rounding makes it unsymmetric, and more so from stage to stage
        P[k] = 0.5 * (to_go + to_go.T)
    return P, gains


def linear_step(
    P: Array, gains: Array, AB: Array, gap: Array, free: int
) -> tuple[Array, Array]:
    """Changes of states (N + 1, nt) and inputs (N, nu) under gains; of the first state
    those of its free lengths.
    """
    stages, nt, _ = AB.shape
    # one product for all stages leaves the loop below small ones only
    closed = (
        np.concatenate([AB[:, :, :nt], gap[:, :, None]], axis=2) + AB[:, :, nt:] @ gains
    )
    dx = np.zeros((stages + 1, nt))
    if free:
        at = slice(nt - free, nt)
        dx[0, at] = -np.linalg.solve(
            P[0, at, at] + SMALLEST_WEIGHT * np.eye(free), P[0, at, nt]
        )
    for k in range(stages):
        dx[k + 1] = closed[k, :, :nt] @ dx[k] + closed[k, :, nt]
    return dx, (gains[:, :, :nt] @ dx[:-1, :, None])[:, :, 0] + gains[:, :, nt]
