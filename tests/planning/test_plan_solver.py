"""Solver of plans on linear stages, whose optimum is one linear system, and on the
shipped catch beside IPOPT.
"""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.sparse import csc_array, eye_array
from scipy.sparse.linalg import spsolve

from skyarm.planning.planner import (
    guess_from,
    node_counts,
    outline,
    problem_of,
    seeds,
    stage_of,
)
from skyarm.planning.solver import (
    ITERATIONS,
    LAX,
    MOST_DAMPING,
    STUCK,
    Guess,
    PlanProblem,
    PlanSolver,
    _Values,
    curvature,
    linear_step,
    merit_of,
    next_damping,
    recursion,
)
from skyarm.planning.task import load_task
from support.plans import catch, planned

STAGES, NT, NU = 12, 3, 2


class LinearStage:
    """Stages x' = A x + B u + c with quadratic costs, goals and limits that are linear;
    the last state may be free.
    """

    def __init__(self, seed: int = 0, free: int = 0) -> None:
        rng = np.random.default_rng(seed)
        self.A = np.eye(NT) + 0.2 * rng.normal(size=(NT, NT))
        self.B, self.c = rng.normal(size=(NT, NU)), 0.1 * rng.normal(size=NT)
        self.G, self.g = rng.normal(size=(2, NT)), rng.normal(size=2)
        self.H, self.h = rng.normal(size=(2, NT + NU)), np.array([0.4, 0.3])
        self.weights = np.array([0.5, 1.0, 0.2, 0.7, 0.4])
        if free:
            self.A[-1], self.B[-1], self.c[-1] = [0.0, 0.0, 1.0], 0.0, 0.0
        self.stage = SimpleNamespace(free=free)
        self.nx = self.nt = NT
        self.nu = NU
        self.costs, self.goals, self.limits = (
            slice(NT, NT + 5),
            slice(NT + 5, NT + 7),
            slice(NT + 7, NT + 9),
        )

    def _rows(self) -> np.ndarray:
        return np.vstack(
            [
                np.hstack([self.A, self.B]),
                np.diag(self.weights),
                np.hstack([self.G, np.zeros((2, NU))]),
                self.H,
            ]
        )

    def values(
        self, x: Any, u: Any, data: Any, step: Any = None, shares: Any = (0.0,)
    ) -> np.ndarray:
        dx, du = step if step is not None else (np.zeros_like(x), np.zeros_like(u))
        lanes = []
        for share in shares:
            at, push = x + share * dx, np.vstack([u + share * du, np.zeros(NU)])
            rows = np.hstack([at, push]) @ self._rows().T
            rows[:-1, :NT] += self.c - at[1:]
            rows[:, self.goals] -= self.g
            rows[:, self.limits] -= self.h
            lanes.append(rows)
        return np.array(lanes)

    def jacobians(self, x: Any, u: Any, data: Any) -> np.ndarray:
        return np.tile(self._rows(), (len(x), 1, 1))

    def retract(self, x: Any, d: Any) -> Any:
        return x + d


def linear_problem(
    stage: LinearStage, limited: bool = False
) -> tuple[PlanProblem, Guess]:
    """Goals in the middle and at the end; limits everywhere or nowhere; a guess with
    gaps.
    """
    goals, limits = (
        np.zeros((STAGES + 1, 2), dtype=bool),
        np.zeros((STAGES + 1, 2), dtype=bool),
    )
    goals[6, 0], goals[-1, :] = True, True
    limits[:-1] = limited
    rng = np.random.default_rng(9)
    guess = Guess(rng.normal(size=(STAGES + 1, NT)), rng.normal(size=(STAGES, NU)))
    return (
        PlanProblem(data=np.zeros((STAGES + 1, 1)), goals=goals, limits=limits),
        guess,
    )


def constraints(
    stage: LinearStage, problem: PlanProblem, first: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Equations C w = d of all unknowns: x of all nodes, then u of all stages."""
    count = (STAGES + 1) * NT + STAGES * NU
    x, u = (
        np.arange((STAGES + 1) * NT).reshape(-1, NT),
        (STAGES + 1) * NT + np.arange(STAGES * NU).reshape(-1, NU),
    )
    rows, right = [], []

    def add(columns: Any, values: Any, to: float) -> None:
        row = np.zeros(count)
        row[columns] = values
        rows.append(row), right.append(to)

    for i in range(NT - stage.stage.free):
        add(x[0, i], 1.0, first[i])
    for k in range(STAGES):
        for i in range(NT):
            add(
                [*x[k], *u[k], x[k + 1, i]],
                [*stage.A[i], *stage.B[i], -1.0],
                -stage.c[i],
            )
    for k, i in np.argwhere(problem.goals):
        add(x[k], stage.G[i], stage.g[i])
    return np.array(rows), np.array(right)


def hessian(stage: LinearStage) -> np.ndarray:
    """Second derivatives of the cost: of the states of all nodes but the last, and of
    all inputs.
    """
    w = stage.weights**2
    return np.diag([*np.tile(w[:NT], STAGES), *np.zeros(NT), *np.tile(w[NT:], STAGES)])


@pytest.mark.parametrize("free", [0, 1])
def test_a_linear_problem_has_the_optimum_of_its_kkt_system(free: int) -> None:
    stage = LinearStage(free=free)
    problem, guess = linear_problem(stage)
    C, d = constraints(stage, problem, guess.x[0])
    H = hessian(stage)
    kkt = np.block([[H, C.T], [C, np.zeros((len(C), len(C)))]])
    w = np.linalg.lstsq(kkt, np.concatenate([np.zeros(len(H)), d]), rcond=None)[0][
        : len(H)
    ]
    found = PlanSolver(stage).solve(problem, guess)
    assert found.solved
    assert found.violation < 1e-6
    np.testing.assert_allclose(found.x.ravel(), w[: found.x.size], atol=2e-5)
    np.testing.assert_allclose(found.u.ravel(), w[found.x.size :], atol=2e-5)
    assert found.cost == pytest.approx(0.5 * w @ H @ w, rel=1e-5)
    np.testing.assert_array_equal(found.x[0, : NT - free], guess.x[0, : NT - free])
    assert (found.x[0, NT - free :] != guess.x[0, NT - free :]).all()


def test_limits_that_bind_and_some_that_do_not() -> None:
    stage = LinearStage(seed=1)
    problem, guess = linear_problem(stage, limited=True)
    guess.x[0] *= 0.1  # the first limit holds at the start
    C, d = constraints(stage, problem, guess.x[0])
    H, size = hessian(stage), (STAGES + 1) * NT

    def inside(w: np.ndarray) -> np.ndarray:
        nodes = np.hstack([w[:size].reshape(-1, NT)[:-1], w[size:].reshape(-1, NU)])
        return (stage.h - nodes @ stage.H.T).ravel()

    oracle = minimize(
        lambda w: 0.5 * w @ H @ w,
        np.zeros(len(H)),
        jac=lambda w: H @ w,
        method="SLSQP",
        constraints=[
            {"type": "eq", "fun": lambda w: C @ w - d, "jac": lambda _: C},
            {"type": "ineq", "fun": inside},
        ],
        options={"maxiter": 500, "ftol": 1e-12},
    )
    assert oracle.success
    active = inside(oracle.x) < 1e-7
    assert 0 < active.sum() < active.size
    found = PlanSolver(stage).solve(problem, guess)
    assert found.solved
    assert found.cost == pytest.approx(oracle.fun, rel=1e-4)
    np.testing.assert_allclose(found.x.ravel(), oracle.x[:size], atol=2e-3)
    assert found.limits.max() < 1e-6
    # without its limits the optimum passes them
    free = PlanSolver(stage).solve(
        dataclasses.replace(problem, limits=np.zeros_like(problem.limits)), guess
    )
    assert free.cost < found.cost - 1e-3


def test_gains_are_those_of_the_riccati_recursion() -> None:
    stage = LinearStage(seed=2)
    problem, guess = linear_problem(stage)
    problem.goals[:] = False
    w, P, gains = stage.weights**2, np.zeros((NT, NT)), []
    for _ in range(STAGES):
        S = np.diag(w[NT:]) + stage.B.T @ P @ stage.B
        K = -np.linalg.solve(S, stage.B.T @ P @ stage.A)
        P = np.diag(w[:NT]) + stage.A.T @ P @ (stage.A + stage.B @ K)
        gains.append(K)
    np.testing.assert_allclose(
        PlanSolver(stage).solve(problem, guess).K, gains[::-1], atol=1e-9
    )


def test_a_problem_without_a_solution_ends_and_says_how_far_it_is_off() -> None:
    stage = LinearStage()
    stage.B[:] = 0.0  # nothing reaches the goals
    problem, guess = linear_problem(stage)
    steps = list(PlanSolver(stage).steps(problem, guess))
    # it ends before its last iteration: the violation no longer falls
    assert STUCK < len(steps) < ITERATIONS // 4
    assert steps[-1].violation == pytest.approx(steps[-STUCK].violation, rel=1e-3)
    assert len(list(PlanSolver(stage).steps(problem, guess, iterations=10))) == 10
    assert not any(step.solved for step in steps)
    assert steps[-1].violation > 1e-2
    assert [step.iterations for step in steps] == list(range(1, len(steps) + 1))
    for step in steps:  # the reported parts are those of the motion
        gap = (
            np.hstack([step.x[:-1], step.u]) @ np.hstack([stage.A, stage.B]).T
            + stage.c
            - step.x[1:]
        )
        np.testing.assert_allclose(step.gap, gap, atol=1e-9)
        assert step.violation == pytest.approx(
            max(np.abs(gap).max(), np.abs(step.goals).max())
        )
        assert not step.goals[~problem.goals].any()
        assert (step.limits == LAX).all()


def test_one_step_of_the_recursion_solves_the_kkt_system_of_its_models() -> None:
    rng = np.random.default_rng(3)
    size = NT + NU
    AB, gap = rng.normal(size=(STAGES, NT, size)), rng.normal(size=(STAGES, NT))
    roots = rng.normal(size=(STAGES + 1, size + 3, size + 1))
    Q = roots.transpose(0, 2, 1) @ roots
    # unknowns: inputs and states of each node; the first state but for its last entry
    # is fixed, as a free length is not
    count = (STAGES + 1) * size
    H, g, rows, right = np.zeros((count, count)), np.zeros(count), [], []
    for k in range(STAGES + 1):
        at = np.arange(k * size, (k + 1) * size)
        own = np.arange(size) if k < STAGES else np.arange(NU, size)
        H[np.ix_(at[own], at[own])], g[at[own]] = (
            Q[k][np.ix_(own, own)],
            Q[k][own, size],
        )
        for i in range(NT) if k < STAGES else ():
            row = np.zeros(count)
            row[at[NU:]], row[at[:NU]], row[at[NU + i] + size] = (
                AB[k, i, :NT],
                AB[k, i, NT:],
                -1.0,
            )
            rows.append(row), right.append(-gap[k, i])
    fixed = [NU, NU + 1, *range(STAGES * size, STAGES * size + NU)]
    rows += [np.eye(count)[i] for i in fixed]
    C, d = np.array(rows), np.array(right + [0.0] * len(fixed))
    kkt = np.block([[H, C.T], [C, np.zeros((len(C), len(C)))]])
    w = np.linalg.solve(kkt, np.concatenate([-g, d]))[:count].reshape(-1, size)
    P, gains = recursion(Q.copy(), AB, gap)
    dx, du = linear_step(P, gains, AB, gap, 1)
    np.testing.assert_allclose(dx, w[:, NU:], atol=1e-6)
    np.testing.assert_allclose(du, w[:-1, :NU], atol=1e-6)


def test_curvature_along_a_step_is_that_of_the_outputs_and_never_negative() -> None:
    rng = np.random.default_rng(4)
    size, outputs = NT + NU, NT + 4
    bent = rng.normal(size=(STAGES + 1, outputs, size, size))
    bent = bent + bent.transpose(0, 1, 3, 2)
    pulls, costates = (
        rng.normal(size=(STAGES + 1, outputs - NT)),
        rng.normal(size=(STAGES, NT)),
    )
    step = rng.normal(size=(STAGES + 1, size))
    old = rng.normal(size=(STAGES + 1, outputs, size))
    J = old + np.einsum("koij,kj->koi", bent, step)
    found = curvature(J, pulls, old, np.hstack([step[:, NT:], step[:, :NT]]), costates)
    order, used = np.r_[NT:size, :NT], 0
    for k in range(STAGES + 1):
        weights = np.concatenate(
            [costates[k] if k < STAGES else np.zeros(NT), pulls[k]]
        )
        change = np.einsum("o,oij,j->i", weights, bent[k], step[k])
        cosine = change @ step[k] / np.linalg.norm(change) / np.linalg.norm(step[k])
        if cosine > 0.11:
            used += 1
            np.testing.assert_allclose(
                found[k] @ step[k][order], change[order], rtol=1e-9, atol=1e-9
            )
        if cosine < 0.09:
            assert not found[k].any()
        assert np.linalg.eigvalsh(found[k]).min() > -1e-9 * (
            1.0 + np.abs(found[k]).max()
        )
    assert 0 < used < STAGES


def test_merit_is_the_augmented_lagrangian_and_the_weighted_gaps() -> None:
    rng = np.random.default_rng(0)
    goals, limits = rng.uniform(size=(4, 2)) > 0.5, rng.uniform(size=(4, 3)) > 0.5
    at = _Values(
        gap=rng.normal(size=(2, 3, 5)),
        costs=rng.normal(size=(2, 4, 6)),
        goals=rng.normal(size=(2, 4, 2)) * goals,
        limits=np.where(limits, rng.normal(size=(2, 4, 3)), LAX),
    )
    y, z, rho, weight = (
        rng.normal(size=(4, 2)),
        np.abs(rng.normal(size=(4, 3))) * limits,
        7.0,
        3.0,
    )
    expected = []
    for lane in range(2):
        total = 0.5 * sum(c**2 for c in at.costs[lane].ravel()) + weight * sum(
            abs(g) for g in at.gap[lane].ravel()
        )
        for k, i in np.argwhere(goals):
            total += (
                y[k, i] * at.goals[lane, k, i] + 0.5 * rho * at.goals[lane, k, i] ** 2
            )
        for k, i in np.argwhere(limits):
            g = at.limits[lane, k, i]
            total += (
                z[k, i] * g + 0.5 * rho * g**2
                if z[k, i] + rho * g > 0
                else -0.5 * z[k, i] ** 2 / rho
            )
        expected.append(total)
    problem = PlanProblem(data=np.zeros((4, 1)), goals=goals, limits=limits)
    np.testing.assert_allclose(
        merit_of(problem, y, z, rho, weight)(at), expected, rtol=1e-12
    )
    assert at.of(1).cost == at.cost[1]


def test_damping_grows_where_steps_fail_and_falls_where_they_are_taken() -> None:
    assert next_damping(0.0, 1.0) == 0.0
    assert next_damping(0.4, 1.0) == pytest.approx(0.1)
    assert next_damping(1e-3, 1.0) == pytest.approx(2.5e-4)
    assert next_damping(1e-7, 0.6) == 0.0
    assert next_damping(0.4, 0.4) == 0.4
    assert next_damping(0.4, 0.05) == pytest.approx(0.8)
    assert next_damping(0.0, 0.05) == 1e-5
    assert next_damping(0.0, 0.0) == 1e-4
    damping, count = 0.0, 0
    while damping < MOST_DAMPING:
        damping, count = next_damping(damping, 0.0), count + 1
    assert count < 20


def test_the_catch_is_optimal_to_first_order_where_its_constraints_hold() -> None:
    """No feasible direction lowers the cost: the gradient is a combination of the
    active constraints' slopes.
    """
    plan = catch()
    stage, x, u = plan.compiled, plan.x, plan.u
    task = plan.task
    problem = problem_of(
        task, stage, np.diff(plan.edges).tolist(), task.limits.clearance
    )
    values = stage.values(x, u, problem.data)[0]
    J, nt, nu, count = stage.jacobians(x, u, problem.data), stage.nt, stage.nu, len(u)
    columns = [np.r_[k * (nt + nu) : (k + 1) * (nt + nu)] for k in range(count)]
    size = count * (nt + nu) + nt
    last = np.r_[count * (nt + nu) : size]
    gradient, rows = np.zeros(size), []
    for k in range(count + 1):
        at = columns[k] if k < count else last
        slopes = J[k][:, : len(at)]
        if k < count:
            gradient[at] += slopes[stage.costs].T @ values[k, stage.costs]
            ahead = (columns[k + 1] if k + 1 < count else last)[:nt]
            block = np.zeros((nt, size))
            block[:, at] = slopes[:nt]
            block[np.arange(nt), ahead] -= 1.0
            rows.append(block)
        active = np.r_[
            problem.goals[k], problem.limits[k] & (values[k, stage.limits] > -1e-5)
        ]
        block = np.zeros((int(active.sum()), size))
        block[:, at] = slopes[stage.goals.start :][active]
        rows.append(block)
    start = np.zeros((nt, size))
    start[np.arange(nt), np.arange(nt)] = 1.0
    C = csc_array(np.vstack([start, *rows]))
    # least squares by normal equations: the multipliers
    multipliers = spsolve(
        C @ C.T + 1e-10 * eye_array(C.shape[0], format="csc"), C @ gradient
    )
    rest = gradient - C.T @ multipliers
    assert np.linalg.norm(rest) < 1e-3 * np.linalg.norm(gradient)


@pytest.mark.thorough
def test_ipopt_over_casadi_finds_no_better_catch() -> None:
    from ipopt_oracle import ipopt

    task = load_task("eagle_catch")
    stage, shape = stage_of(task), outline(task)
    counts = node_counts(task, shape.lengths)
    problem = problem_of(task, stage, counts, task.limits.clearance)
    guess = guess_from(task, stage, counts, seeds(task, shape)[0], shape)
    cost, violation, status = ipopt(stage, problem, guess)
    assert violation < 1e-6, status
    assert catch().solution.cost < 1.01 * cost


@pytest.mark.thorough
def test_ipopt_over_casadi_finds_no_better_way_to_a_goal() -> None:
    from ipopt_oracle import ipopt

    found = planned(
        vehicle="hexarotor_arm6",
        phases=[
            {
                "to": {"tip": [1.0, 0.5, 0.6], "tip_velocity": [0.0, 0.0, 0.0]},
                "duration": 1.6,
            }
        ],
    )
    counts, shape = [len(found.u)], outline(found.task)
    problem = problem_of(
        found.task, found.compiled, counts, found.task.limits.clearance
    )
    guess = guess_from(
        found.task, found.compiled, counts, seeds(found.task, shape)[0], shape
    )
    cost, violation, status = ipopt(found.compiled, problem, guess)
    assert violation < 1e-6, status
    assert found.solution.cost < 1.01 * cost
