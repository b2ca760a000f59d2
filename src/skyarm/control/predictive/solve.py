"""One real-time iteration: linearise at the foreseen motion, solve the linear-quadratic problem, move there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from skyarm.control.predictive.linearise import Stages
from skyarm.control.predictive.riccati import Linear, policy, rollout

Array = npt.NDArray[np.float64]

PASSES = 3
"""Times that inputs at their limits are fixed and the rest solved again."""


@dataclass(frozen=True, slots=True)
class Plan:
    """A foreseen motion: states (N + 1, nx), inputs (N, nu) and the gains (N, nu, nx) of u = u* + K (x - x*)."""

    x: Array
    u: Array
    K: Array


@dataclass(frozen=True, slots=True)
class Problem:
    """What a solver is given.

    Attributes:
        start: (nx,) the state now. disturbance: its leaves. goals: (N + 1, leaves of a goal).
    """

    start: Array
    disturbance: Array
    goals: Array


@dataclass(frozen=True, slots=True)
class Bounds:
    """Limits of joint efforts (n,) and rotor speeds (rotors,)."""

    efforts: Array
    speeds: Array


class Solver(Protocol):
    """A way to improve a guess."""

    steps: Array

    def solve(self, problem: Problem, guess: Plan) -> Plan:
        """A better plan."""
        ...


class Riccati:
    """One Gauss-Newton step a call by the Riccati recursion, inputs clipped as the motion is rolled out.

    Args:
        stages: compiled prediction. steps: (N,) lengths of the stages, s. final: s for which the end counts.
        bounds: of the inputs.

    Source: Diehl, Bock, Schloeder 2005 (real-time iteration).
    """

    def __init__(self, stages: Stages, steps: Array, final: float, bounds: Bounds) -> None:
        self.stages, self.steps, self.bounds = stages, steps, bounds
        self._roots = np.sqrt(np.append(steps, final))

    def solve(self, problem: Problem, guess: Plan) -> Plan:
        """The motion one step nearer to the best, and the policy around it."""
        here = linear_problem(self.stages, problem, guess.x, guess.u, self.steps, self._roots)
        low, high = self._room(guess, len(self.bounds.speeds))
        first = problem.start - guess.x[0]
        found = policy(here)
        dx, du = rollout(here, found, first, low, high)
        held = np.zeros(du.shape, dtype=bool)
        for _ in range(PASSES):
            clipped = (du <= low) | (du >= high)
            if not (clipped & ~held).any():
                break
            # what is at a limit stays there, and the other inputs make the best of it
            held |= clipped
            found = policy(here, held, np.where(du <= low, low, high))
            dx, du = rollout(here, found, first, low, high)
        x = guess.x + dx
        x[:, 3:7] /= np.linalg.norm(x[:, 3:7], axis=1, keepdims=True)
        return Plan(x, guess.u + du, found.K)

    def _room(self, guess: Plan, rotors: int) -> tuple[Array, Array]:
        """How far each input may still fall and rise (N, nu): no rotor stops, none turns faster than it can."""
        speeds, dt = guess.x[:-1, -rotors:], self.steps[:, None]
        efforts = np.broadcast_to(self.bounds.efforts, (len(self.steps), len(self.bounds.efforts)))
        low, high = np.hstack([-speeds / dt, -efforts]), np.hstack([(self.bounds.speeds - speeds) / dt, efforts])
        return np.minimum(low - guess.u, 0.0), np.maximum(high - guess.u, 0.0)


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
    return Plan(x, plan.u[at[:-1]], plan.K)
