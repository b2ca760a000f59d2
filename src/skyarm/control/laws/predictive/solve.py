"""One real-time iteration: linearise at the foreseen motion, solve the linear-quadratic problem, move there."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from skyarm.control.laws.predictive.linearise import Stages
from skyarm.control.laws.predictive.riccati import Linear, Policy, policy, rollout
from skyarm.control.laws.predictive.rollout import Bounds, Rollouts

Array = npt.NDArray[np.float64]

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
    """A foreseen motion: states (N + 1, nx), inputs (N, nu) and the gains (N, nu, nx) of u = u* + K (x - x*).

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
    """What a solver is given.

    Attributes:
        start: (nx,) the state now. disturbance: its leaves. goals: (N + 1, leaves of a goal).
    """

    start: Array
    disturbance: Array
    goals: Array


class Solver(Protocol):
    """A way to improve a guess."""

    steps: Array

    def solve(self, problem: Problem, guess: Plan) -> Plan:
        """A better plan.

        Raises:
            NoPlanError: none was found.
        """
        ...


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
