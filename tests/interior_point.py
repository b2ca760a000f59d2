"""Oracle of the NMPC solver: the nonlinear program of the horizon solved to its optimum by CasADi's fatrop or ipopt."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from shooting import Shooting
from skyarm.compile import trace
from skyarm.control.laws.predictive.cost import Weights, input_residuals, predict_stage, state_residuals
from skyarm.control.laws.predictive.prediction import Inputs
from skyarm.control.laws.predictive.solver import (
    Bounds,
    Linear,
    NoPlanError,
    Plan,
    Problem,
    Stages,
    examples,
    linear_problem,
    policy,
)
from skyarm.control.model import Model
from skyarm.dynamics import State

Array = npt.NDArray[np.float64]

MET = 1e-3
"""Largest gap between two stages of a solution, in the units of the state."""


class InteriorPoint:
    """Solutions of the whole nonlinear program, warm started; the feedback in between is that of its linearisation.

    Args:
        solver: "fatrop" or "ipopt". model, weights, mode: what is foreseen and wanted.
        stages: compiled prediction. steps: (N,) lengths of the stages, s. bounds: of the inputs.
        contact: whether goals may ask for one.
    """

    def __init__(
        self,
        solver: str,
        model: Model,
        weights: Weights,
        mode: str,
        stages: Stages,
        steps: Array,
        bounds: Bounds,
        contact: bool = False,
    ) -> None:
        self.steps, self.stages = steps, stages
        shapes = examples(model.vehicle.n, len(model.vehicle.rotors), contact)
        state, inputs, disturbance, goal = shapes
        par = ((0.0,), disturbance, goal)

        def stage(x: State, u: Inputs, given: tuple[Any, ...]) -> tuple[State, tuple[Any, ...]]:
            dt, d, wanted = given
            errors = (
                *state_residuals(model, weights, x, wanted, mode),
                *input_residuals(model, weights, x, u, d, wanted),
            )
            return predict_stage(model, x, u, d, wanted, dt[0]), errors

        def final(x: State, given: tuple[Any, ...]) -> tuple[Any, ...]:
            return state_residuals(model, weights, x, given[2], mode)

        self.roots = np.sqrt(np.append(steps, float(weights.final)))
        self.shooting = Shooting(trace(stage, state, inputs, par), trace(final, state, par), self.roots, solver=solver)
        free, rotors = np.full(stages.nx, np.inf), len(bounds.speeds)
        low, high = -free, free.copy()
        low[-rotors:], high[-rotors:] = 0.0, bounds.speeds
        turning = np.full(rotors, np.inf)
        self.low = (low, np.concatenate([-turning, -bounds.efforts]))
        self.high = (high, np.concatenate([turning, bounds.efforts]))

    def solve(self, problem: Problem, guess: Plan) -> Plan:
        """The best motion, and the policy around it.

        Raises:
            NoPlanError: the solver gives no numbers.
        """
        dt = np.append(self.steps, self.steps[-1])[:, None]
        held = np.broadcast_to(problem.disturbance, (len(dt), len(problem.disturbance)))
        parameters = np.hstack([dt, held, problem.goals])
        first = np.vstack([problem.start, guess.x[1:]])
        x, u, _ = self.shooting.solve(problem.start, parameters, first, guess.u, self.low, self.high)
        if not (np.isfinite(x).all() and np.isfinite(u).all()):
            raise NoPlanError
        found: Linear = linear_problem(self.stages, problem, x, u, self.steps, self.roots)
        # stages that do not meet are no motion
        cost = float(np.sum(found.r * found.r)) if np.abs(found.c).max() < MET else float("nan")
        return Plan(x, u, policy(found).K, cost=cost)
