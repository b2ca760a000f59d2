"""IPOPT over CasADi on the same stage functions: shares neither derivatives nor the
solver with the planner.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from skyarm.planning.solver import Guess, PlanProblem
from skyarm.planning.stage import CompiledStage, gap
from skyarm.records.leaves import leaves, rebuild


def ipopt(
    stage: CompiledStage, problem: PlanProblem, guess: Guess, seconds: float = 400.0
) -> tuple[float, float, str]:
    """Cost, violation and status of IPOPT from a guess."""
    example = stage.stage.example()
    x, u, row = (
        ca.SX.sym(name, size)
        for name, size in zip(
            "xur", (stage.nx, stage.nu, len(leaves(example))), strict=True
        )
    )
    following = ca.SX.sym("n", stage.nx)

    def entries(v):
        return [v[i] for i in range(v.numel())]

    given = rebuild(example, iter(entries(row)))
    values = stage.stage(entries(x), entries(u), given)
    goals = [error for name in stage.goal for error in values.goals[name]]
    limits = [value for _, value in (*values.inputs, *values.limits)]
    outputs = [
        ca.vertcat(*gap(values.end, entries(following))),
        0.5 * ca.sumsqr(ca.vertcat(*values.costs)),
        ca.vertcat(*goals),
        ca.vertcat(*limits),
    ]
    function = ca.Function("stage", [x, u, following, row], outputs)
    count = len(guess.u)
    X = [ca.MX.sym(f"x{k}", stage.nx) for k in range(count + 1)]
    U = [ca.MX.sym(f"u{k}", stage.nu) for k in range(count)]
    cost, rows, low, high = 0, [], [], []
    for k in range(count + 1):
        last = k == count
        ahead, cost_k, goal_k, limit_k = function(
            X[k],
            ca.DM.zeros(stage.nu) if last else U[k],
            X[min(k + 1, count)],
            problem.data[k],
        )
        if not last:
            cost = cost + cost_k
            (
                rows.append(ahead),
                low.extend([0.0] * stage.nt),
                high.extend([0.0] * stage.nt),
            )
        # a unit quaternion, which the gap does not fix
        rows.append(ca.sumsqr(X[k][3:7]) - 1.0), low.append(0.0), high.append(0.0)
        for wanted, found, least in (
            (problem.goals[k], goal_k, 0.0),
            (problem.limits[k], limit_k, -np.inf),
        ):
            at = np.flatnonzero(wanted).tolist()
            if at:
                (
                    rows.append(found[at]),
                    low.extend([least] * len(at)),
                    high.extend([0.0] * len(at)),
                )
    w, w0, lower, upper = [], [], [], []
    for k in range(count + 1):
        w.append(X[k]), w0.extend(guess.x[k])
        fixed = guess.x[k].copy() if k == 0 else np.full(stage.nx, np.nan)
        fixed[stage.nx - stage.stage.free :] = np.nan
        (
            lower.extend(np.where(np.isnan(fixed), -np.inf, fixed)),
            upper.extend(np.where(np.isnan(fixed), np.inf, fixed)),
        )
        if k < count:
            w.append(U[k]), w0.extend(guess.u[k])
            lower.extend([-np.inf] * stage.nu), upper.extend([np.inf] * stage.nu)
    settings = {
        "hessian_approximation": "limited-memory",
        "limited_memory_max_history": 20,
        "tol": 1e-7,
        "sb": "yes",
    }
    settings |= {"max_iter": 1000, "max_cpu_time": seconds, "print_level": 0}
    options = {"print_time": 0} | {
        f"ipopt.{name}": value for name, value in settings.items()
    }
    solver = ca.nlpsol(
        "plan",
        "ipopt",
        {"x": ca.vertcat(*w), "f": cost, "g": ca.vertcat(*rows)},
        options,
    )
    found = solver(x0=w0, lbx=lower, ubx=upper, lbg=low, ubg=high)
    g = np.array(found["g"]).ravel()
    off = max(
        float(np.maximum(g - high, 0.0).max()),
        float(np.maximum(np.array(low) - g, 0.0)[np.isfinite(low)].max()),
    )
    return float(found["f"]), off, str(solver.stats()["return_status"])
