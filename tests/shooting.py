"""Optimal control problems in stages as nonlinear programs of CasADi, solved by one of its own solvers.

The variables stand in the order x0, u0, x1, u1 ... xN and every stage's continuity before its other constraints, which
is the structure that fatrop finds and uses; ipopt solves the same program without it.

Source: Bock, Plitt 1984 (multiple shooting); Vanroye, Sathya, De Schutter, Decre 2023 (fatrop).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.compile.machine_code import missing_extra
from skyarm.compile.tracing.program import Program

try:
    import casadi

    from casadi_functions import casadi_function
except ImportError as error:  # pragma: no cover  (the library is there when this is tested)
    raise missing_extra("casadi") from error

Array = npt.NDArray[np.float64]

SOLVERS = ("fatrop", "ipopt")

QUIET: dict[str, dict[str, Any]] = {
    "fatrop": {"fatrop.print_level": 0},
    "ipopt": {"ipopt.print_level": 0, "ipopt.sb": "yes"},
}


class Shooting:
    """Sum of squares over stages of different lengths, dynamics as constraints.

    Args:
        stage: traced (x, u, par) -> (next x, residuals). final: traced (x, par) -> residuals.
        roots: (N + 1,) factor of each stage's residuals.
        solver: one of ``SOLVERS``. iterations: most that a solution may take. tolerance: of the optimality conditions.
    """

    def __init__(
        self,
        stage: Program,
        final: Program,
        roots: Array,
        *,
        solver: str = "fatrop",
        iterations: int = 30,
        tolerance: float = 1e-6,
    ) -> None:
        if not casadi.has_nlpsol(solver):
            raise ImportError(
                f"this CasADi has no solver '{solver}'; it has {[s for s in SOLVERS if casadi.has_nlpsol(s)]}"
            )
        step = casadi_function(stage, name="stage", inputs=["x", "u", "par"], outputs=["next", "errors"])
        last = casadi_function(final, name="final", inputs=["x", "par"], outputs=["errors"])
        self.stages = len(roots) - 1
        self.nx, self.nu, self.np = (step.size1_in(i) for i in range(3))
        weight = casadi.SX.sym("weight")
        x, u, par = (casadi.SX.sym(name, size) for name, size in (("x", self.nx), ("u", self.nu), ("par", self.np)))
        following, errors = step(x, u, par)
        motion = casadi.Function("motion", [x, u, par], [following])
        cost = casadi.Function("cost", [x, u, par, weight], [0.5 * weight**2 * casadi.sumsqr(errors)])
        ending = casadi.Function("ending", [x, par, weight], [0.5 * weight**2 * casadi.sumsqr(last(x, par))])
        self._nlp(motion, cost, ending, roots)
        options = {
            **QUIET[solver],
            "print_time": False,
            "error_on_fail": False,
            f"{solver}.max_iter": iterations,
            f"{solver}.tol": tolerance,
        }
        if solver == "fatrop":
            options |= {"structure_detection": "auto", "equality": [True] * self.constraints}
        self.solver = casadi.nlpsol("shooting", solver, self.problem, options)

    def _nlp(self, motion: Any, cost: Any, ending: Any, roots: Array) -> None:
        """Variables, objective and constraints."""
        X = [casadi.MX.sym(f"x{k}", self.nx) for k in range(self.stages + 1)]
        U = [casadi.MX.sym(f"u{k}", self.nu) for k in range(self.stages)]
        start = casadi.MX.sym("start", self.nx)
        P = [casadi.MX.sym(f"p{k}", self.np) for k in range(self.stages + 1)]
        variables, constraints, total = [], [], 0
        for k in range(self.stages):
            variables += [X[k], U[k]]
            constraints.append(X[k + 1] - motion(X[k], U[k], P[k]))
            if k == 0:
                constraints.append(X[0] - start)
            total = total + cost(X[k], U[k], P[k], float(roots[k]))
        total = total + ending(X[-1], P[-1], float(roots[-1]))
        self.constraints = (self.stages + 1) * self.nx
        self.problem = {
            "x": casadi.vertcat(*variables, X[-1]),
            "f": total,
            "g": casadi.vertcat(*constraints),
            "p": casadi.vertcat(start, *P),
        }

    def solve(
        self, start: Array, parameters: Array, x: Array, u: Array, low: tuple[Array, Array], high: tuple[Array, Array]
    ) -> tuple[Array, Array, str]:
        """Best motion from a state.

        Args:
            start: (nx,).
            parameters: (N + 1, np).
            x: first guess, (N + 1, nx).
            u: first guess, (N, nu).
            low: limits (nx,) of states after the first and (nu,) of inputs.
            high: the same from above.

        Returns:
            x, u, and how the solver ended.
        """
        free = np.full(self.nx, np.inf)
        found = self.solver(
            x0=self._joined(x, u),
            p=np.concatenate([start, parameters.ravel()]),
            lbx=self._joined(np.vstack([-free, np.tile(low[0], (self.stages, 1))]), np.tile(low[1], (self.stages, 1))),
            ubx=self._joined(np.vstack([free, np.tile(high[0], (self.stages, 1))]), np.tile(high[1], (self.stages, 1))),
            lbg=0.0,
            ubg=0.0,
        )
        values = np.asarray(found["x"]).ravel()
        wide = self.nx + self.nu
        stages = values[: self.stages * wide].reshape(self.stages, wide)
        states = np.vstack([stages[:, : self.nx], values[self.stages * wide :]])
        return states, stages[:, self.nx :], str(self.solver.stats()["return_status"])

    def _joined(self, x: Array, u: Array) -> Array:
        return np.concatenate([np.hstack([x[:-1], u]).ravel(), x[-1]])
