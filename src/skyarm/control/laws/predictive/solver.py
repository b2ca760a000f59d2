"""Solver of predictive control: linearisation, Riccati recursion and line search, one
iteration per call.

Every stage and every nudged copy of it is a lane: the prediction that the plant's own
compiler turns into machine code gives values and differences of a whole horizon in a
fraction of a millisecond. A rollout moves the model under a policy with steps of
several lengths at once, each with its true cost.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Generic, TypeVar

import numpy as np

from skyarm.algebra import ZERO3_DATA, Quaternion, Scalar, Scalars, differences
from skyarm.algebra.scalars import maximum, minimum
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.program import trace_call, trace_loop
from skyarm.control.blocks.prediction import Disturbance, no_disturbance
from skyarm.control.laws.predictive.cost import (
    ContactGoal,
    PlannedGoal,
    StageGoal,
    Weights,
    input_residuals,
    predict_stage,
    state_residuals,
)
from skyarm.control.laws.predictive.prediction import StageInputs
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics.state import example_state
from skyarm.records.arrays import Array, Mask
from skyarm.records.immutable import positional
from skyarm.records.leaves import Tree, leaves, rebuild

Result = TypeVar("Result", bound=Tree)


class Compiled(Generic[Result]):
    """Function of dataclasses compiled to machine code and evaluated on arrays.

    Args:
        function: function of records that returns a record.
        examples: a record of floats for each argument.
    """

    def __init__(self, function: Callable[..., Result], *examples: Tree) -> None:
        # one lane: rows of arguments come one after the other, and results are logged
        self.kernel = Kernel(trace_call(function, *examples), Lanes(1), logging=True)

    def __call__(self, *parts: Array) -> Array:
        """Evaluate the compiled function on flattened arguments, or on T rows of
        flattened arguments at once.
        """
        rows = np.concatenate(parts, axis=-1)
        # a function of one call carries nothing and has no parameters
        nothing = np.zeros((0, 1))
        _, log = self.kernel.run(nothing, nothing, np.atleast_2d(rows))
        values = np.ascontiguousarray(log[:, :, 0])
        return values if rows.ndim > 1 else np.asarray(values[0])

    def record(self, *parts: Array) -> Result:
        """Evaluate the compiled function on arrays and return its result as a dataclass
        of floats.
        """
        shape: Result = self.kernel.loop.result[1]
        return rebuild(shape, self(*parts).tolist())


NUDGE = 1e-5
"""Step of the central difference; errors are about 1e-10 of the numbers of order one
that states and residuals are."""


def examples(
    joints: int, rotors: int, contact: bool = False, planned: bool = False
) -> tuple[State, StageInputs, Disturbance, StageGoal]:
    """Example state, inputs, disturbance and goal, which fix the array shapes.

    ``contact``: the goal has a contact. ``planned``: it is of a planned state.
    """
    arm = (0.0,) * joints
    pressed = (
        ContactGoal(normal=ZERO3_DATA, touching=0.0, force=0.0, damping=0.0)
        if contact
        else ()
    )
    level = Quaternion(1.0, 0.0, 0.0, 0.0)
    whole = PlannedGoal(
        attitude=level, rate=ZERO3_DATA, rotor_accelerations=(0.0,) * rotors
    )
    goal = StageGoal(
        position=ZERO3_DATA,
        velocity=ZERO3_DATA,
        yaw=0.0,
        joints=arm,
        joint_rates=arm,
        joint_accelerations=arm,
        shift=ZERO3_DATA,
        contact=pressed,
        planned=whole if planned else (),
    )
    inputs = StageInputs(rotor_accelerations=(0.0,) * rotors, efforts=arm)
    return example_state(joints, rotors), inputs, no_disturbance(joints), goal


class CompiledStages:
    """Compiled model prediction and cost residuals for all stages of the prediction
    horizon.

    Args:
        model: the controller's. weights, mode: cost weights and mode
            (:mod:`skyarm.control.laws.predictive.cost`).
        scales: size of a unit of each input; nudges are taken in it. contact: whether
            goals may request one.

    Attributes:
        nx, nu: numbers of a state and of the inputs. input_errors: residuals at the end
            that are costs of inputs.
    """

    def __init__(
        self,
        model: Model,
        weights: Weights,
        mode: str,
        scales: Array,
        contact: bool = False,
    ) -> None:
        state, inputs, disturbance, goal = examples(
            model.vehicle.n, len(model.vehicle.rotors), contact, mode == "plan"
        )

        def stage(
            x: State,
            par: tuple[StageInputs, tuple[Scalar], Disturbance, StageGoal],
            _row: Tree,
            _uniforms: Tree,
        ) -> tuple[State, Scalars]:
            u, dt, d, target = par
            errors = state_residuals(model, weights, x, target, mode)
            pushes = input_residuals(model, weights, x, u, d, target)
            return predict_stage(model, x, u, d, target, dt[0]), (*errors, *pushes)

        loop = trace_loop(stage, state, (inputs, (0.0,), disturbance, goal), ())
        self.kernel = Kernel(loop, logging=True)
        self.nx, self.nu = len(leaves(state)), len(leaves(inputs))
        self.input_errors = model.vehicle.n + len(model.vehicle.rotors) + contact
        self.scales = np.concatenate([np.ones(self.nx), scales])
        # rotor speeds are some hundred rad/s, the other states of order one
        self.scales[self.nx - len(model.vehicle.rotors) : self.nx] = 100.0
        width = self.nx + self.nu
        self._nudges = (
            np.vstack([np.zeros(width), np.diag(self.scales), -np.diag(self.scales)])
            * NUDGE
        )

    def derivatives(
        self, x: Array, u: Array, dt: Array, d: Array, goals: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Predicted states and residuals at N + 1 stages, with their derivatives.

        Args:
            x: (N + 1, nx).
            u: (N + 1, nu), the last has no effect.
            dt: (N + 1,) s.
            d: leaves of the disturbance.
            goals: (N + 1, leaves of a goal).

        Returns:
            x after each stage (N + 1, nx), its derivative (N + 1, nx, nx + nu),
            residuals (N + 1, nr) and theirs.
        """
        count = len(x)
        width = self.nx + self.nu
        nudged = np.concatenate([x, u], axis=1)[:, None, :] + self._nudges
        copies = nudged.shape[1]
        constants = np.concatenate(
            [dt[:, None], np.broadcast_to(d, (count, len(d))), goals], axis=1
        )
        lanes = nudged.reshape(count * copies, width).T
        par = np.vstack([lanes[self.nx :], np.repeat(constants, copies, axis=0).T])
        carry, log = self.kernel.run(lanes[: self.nx], par, np.zeros((1, 0)))
        ends = carry.T.reshape(count, copies, self.nx)
        errors = log[0].T.reshape(count, copies, -1)
        return ends[:, 0], self._slopes(ends), errors[:, 0], self._slopes(errors)

    def _slopes(self, values: Array) -> Array:
        """Central-difference derivatives by state and input components, an array
        (stages, values, components).
        """
        width = self.nx + self.nu
        change = values[:, 1 : width + 1] - values[:, width + 1 :]
        return (change / (2.0 * NUDGE * self.scales[:, None])).transpose(0, 2, 1)


@positional
class Bounds:
    """Limits of joint efforts (n,) and rotor speeds (rotors,)."""

    efforts: Array
    speeds: Array


@positional
class Motions:
    """Candidate motions, one per SIMD lane: states (N + 1, nx, lanes), inputs (N, nu,
    lanes), costs (lanes,).
    """

    x: Array
    u: Array
    cost: Array


Row = tuple[
    State,
    StageInputs,
    Scalars,
    tuple[Scalars, ...],
    tuple[Scalar, Scalar, Scalar],
    StageGoal,
]
"""State and inputs of the guess, policy k and K, stage length and times for which
errors count (s), and goal."""


class Rollouts:
    """Rollouts of a policy within input limits, for several step sizes at once.

    Args:
        model: the controller's. weights, mode: cost weights and mode
            (:mod:`skyarm.control.laws.predictive.cost`).
        bounds: limits of the inputs. contact: whether goals may request one.

    Source: Tassa, Mansard, Todorov 2014 (limits within the rollout of a policy).
    """

    def __init__(
        self,
        model: Model,
        weights: Weights,
        mode: str,
        bounds: Bounds,
        contact: bool = False,
    ) -> None:
        state, inputs, disturbance, goal = examples(
            model.vehicle.n, len(model.vehicle.rotors), contact, mode == "plan"
        )
        nx, nu = len(leaves(state)), len(leaves(inputs))
        efforts, speeds = bounds.efforts.tolist(), bounds.speeds.tolist()

        def stage(
            carry: tuple[State, tuple[Scalar]],
            par: tuple[tuple[Scalar], Disturbance],
            row: Row,
            _uniforms: Tree,
        ) -> tuple[tuple[State, tuple[Scalar]], tuple[State, StageInputs]]:
            x, (cost,) = carry
            (a,), d = par
            x_guess, u_guess, k, K, (dt, whole, running), target = row
            change = differences(leaves(x), leaves(x_guess))
            u = [
                start
                + a * push
                + sum(gain * dx for gain, dx in zip(gains, change, strict=True))
                for start, push, gains in zip(leaves(u_guess), k, K, strict=True)
            ]
            # no rotor stops, none turns faster than it can
            rates = [
                maximum(-w / dt, minimum(rate, (most - w) / dt))
                for rate, w, most in zip(u, x.rotor_speeds, speeds, strict=False)
            ]
            torques = [
                maximum(-most, minimum(t, most))
                for t, most in zip(u[len(speeds) :], efforts, strict=True)
            ]
            taken = StageInputs(
                rotor_accelerations=tuple(rates), efforts=tuple(torques)
            )
            errors = sum(
                e * e for e in state_residuals(model, weights, x, target, mode)
            )
            pushes = sum(
                e * e for e in input_residuals(model, weights, x, taken, d, target)
            )
            spent = cost + whole * errors + running * pushes
            following = predict_stage(model, x, taken, d, target, dt)
            return (following, (spent,)), (x, taken)

        zero = (0.0,) * nu
        row = (state, inputs, zero, ((0.0,) * nx,) * nu, (0.0, 0.0, 0.0), goal)
        loop = trace_loop(stage, (state, (0.0,)), ((0.0,), disturbance), row)
        self.kernel = Kernel(loop, logging=True)
        self.nx = nx

    def run(
        self,
        x: Array,
        u: Array,
        feedback: Policy,
        a: Array,
        start: Array,
        given: tuple[Array, Array, Array],
    ) -> Motions:
        """Roll out a policy about a guessed trajectory from a start state, once per
        step size.

        Args:
            x: (N + 1, nx) states of the guess.
            u: (N, nu) its inputs.
            feedback: its policy.
            a: (lanes,) shares of the policy's feed-forward.
            start: (nx,) the state now.
            given: (N + 1, 2) lengths of the stages and time for which each state
                counts, s; leaves of the disturbance; goals (N + 1, leaves of a goal).
        """
        times, d, goals = given
        count = len(u)
        inputs = np.hstack([u, feedback.k, feedback.K.reshape(count, -1)])
        running = times[:, 1:].copy()
        # there is no input at the end of the horizon
        running[-1] = 0.0
        none = np.zeros_like(inputs[:1])
        rows = np.hstack([x, np.vstack([inputs, none]), times, running, goals])
        lanes = len(a)
        carry = np.zeros((self.nx + 1, lanes))
        carry[: self.nx] = start[:, None]
        par = np.vstack([a, np.repeat(d[:, None], lanes, axis=1)])
        last, log = self.kernel.run(carry, par, rows)
        return Motions(log[:, : self.nx], log[:count, self.nx :], last[self.nx])


SMALLEST_WEIGHT = 1e-9
"""Number added to the inputs' second derivatives: an input without a cost stays
unchanged."""

HOLD = 1e8
"""Weight of an input that is fixed at its limit, over its own second derivative."""


@positional
class Linear:
    """Linear-quadratic problem x[k+1] = A x[k] + B u[k] + c with least-squares
    residuals.

    Attributes:
        AB: (N, nx, nx + nu). c: (N, nx). J: (N + 1, nr, nx + nu), of which the last
            counts x alone. r: (N + 1, nr).
    """

    AB: Array
    c: Array
    J: Array
    r: Array


@positional
class Policy:
    """Affine policy u[k] = k[k] + K[k] x[k] of N stages, with the initial cost-to-go x'
    P x / 2 + p' x.
    """

    k: Array
    K: Array
    P: Array
    p: Array


def policy(
    problem: Linear,
    held: Mask | None = None,
    at: Array | None = None,
    *,
    damping: float = 0.0,
) -> Policy:
    """Riccati recursion: the affine policy that minimises the sum of squared residuals.

    Args:
        problem: the stages.
        held: (N, nu) True where an input is fixed.
        at: (N, nu) where to.
        damping: share by which the second derivatives of the inputs are raised: the
            step is shorter.

    Source: Mayne 1966; Rawlings, Mayne, Diehl 2017, section 8.8.3 (Gauss-Newton,
    Riccati recursion).
    """
    stages, nx, width = problem.AB.shape
    nu = width - nx
    # columns in the order inputs, states, one: every stage is then two products and one
    # small system
    J, step = (
        np.concatenate([A[:, :, nx:], A[:, :, :nx], b[:, :, None]], axis=2)
        for A, b in ((problem.J, problem.r), (problem.AB, problem.c))
    )
    own = J.transpose(0, 2, 1)[:, :width] @ J
    P, p = own[stages, nu:, nu:width], own[stages, nu:, width]
    Kk = np.empty((stages, nu, nx + 1))
    nothing = np.zeros((stages, nu))
    strength, targets = (
        (nothing, nothing)
        if held is None or at is None
        else (np.where(held, HOLD, 0.0), at)
    )
    raised = strength + damping
    for i in reversed(range(stages)):
        ahead = P @ step[i]
        ahead[:, width] += p
        M = own[i] + step[i, :, :width].T @ ahead
        inner, cross = M[:nu, :nu], M[:nu, nu:]
        # a held input weighs more than all else by a factor of its own, whatever its
        # unit
        weight = SMALLEST_WEIGHT + raised[i] * inner.diagonal()
        left, right = inner.copy(), cross.copy()
        left.flat[:: nu + 1] += weight
        right[:, nx] -= weight * targets[i] * (strength[i] > 0.0)
        gains = Kk[i] = -np.linalg.solve(left, right)
        # the general form: with held inputs K and k are not the minimiser's
        to_go = (
            M[nu:, nu:]
            + gains[:, :nx].T @ (inner @ gains + cross)
            + M[nu:, :nu] @ gains
        )
        # rounding would make P unsymmetric, more with each stage
        P = 0.5 * (to_go[:, :nx] + to_go[:, :nx].T)
        p = to_go[:, nx]
    return Policy(Kk[:, :, nx], Kk[:, :, :nx], P, p)


def rollout(
    problem: Linear, feedback: Policy, first: Array, low: Array, high: Array
) -> tuple[Array, Array]:
    """Linear rollout of a policy with clipped inputs: deviations x (N + 1, nx) and u
    (N, nu).
    """
    stages, nx, width = problem.AB.shape
    x, u = np.empty((stages + 1, nx)), np.empty((stages, width - nx))
    x[0] = first
    for i in range(stages):
        u[i] = np.minimum(
            np.maximum(feedback.k[i] + feedback.K[i] @ x[i], low[i]), high[i]
        )
        x[i + 1] = problem.AB[i] @ np.concatenate([x[i], u[i]]) + problem.c[i]
    return x, u


PASSES = 3
"""Number of passes in which inputs at their limits are fixed and the others solved
again; chosen: each costs a recursion, and the rollout clips what is left."""

SHARES = np.array([1.0, 0.7, 0.45, 0.25, 0.12, 0.05, 0.02, 0.0])
"""Step sizes of the line search, as fractions of the feed-forward step: all are tried
at once, the cheapest motion is taken. At 0 the old motion is followed."""

DAMPING = (1e-3, 1e3)
"""Least and largest Levenberg-Marquardt damping, as fractions of the inputs' own second
derivatives. Below it is none."""

GROWTH = 8.0
"""Factor by which damping grows after a step cut by more than half, and shrinks after
an uncut one; chosen: seven from the least to the largest."""


class NoPlanError(Exception):
    """Error: no motion with a finite cost was found."""


@positional
class MotionPlan:
    """Planned motion: states (N + 1, nx), inputs (N, nu) and feedback gains (N, nu,
    nx).

    Attributes:
        x, u, K: states, inputs and gains. damping: Levenberg-Marquardt damping of the
            next step.
        cost: sum of squared residuals; NaN if not known. share: accepted part of the
            last step.
    """

    x: Array
    u: Array
    K: Array
    damping: float = 0.0
    cost: float = float("nan")
    share: float = 1.0


@positional
class Problem:
    """Optimal control problem for the solver: initial state, disturbance, and
    references over the horizon.

    Attributes:
        start: (nx,) the state now. disturbance: its leaves. goals: (N + 1, leaves of a
            goal).
    """

    start: Array
    disturbance: Array
    goals: Array


class Riccati:
    """Solver that makes one damped Gauss-Newton step per call, by Riccati recursion and
    line search.

    Args:
        stages: compiled prediction. rollouts: compiled motions. steps: (N,) lengths of
            the stages, s.
        final: time for which the end counts, s. bounds: limits of the inputs.

    Source: Diehl, Bock, Schloeder 2005 (real-time iteration); Tassa, Mansard, Todorov
    2014 (line search by rolling the policy out); Levenberg 1944, Marquardt 1963
    (damping, here of the inputs).
    """

    def __init__(
        self,
        stages: CompiledStages,
        rollouts: Rollouts,
        steps: Array,
        final: float,
        bounds: Bounds,
    ) -> None:
        self.stages = stages
        self.rollouts = rollouts
        self.steps = steps
        self.bounds = bounds
        counted = np.append(steps, final)
        # squares of residuals by roots of their times sum up to an integral
        self._roots = np.sqrt(counted)
        self._times = np.column_stack([np.append(steps, steps[-1]), counted])

    def solve(self, problem: Problem, guess: MotionPlan) -> MotionPlan:
        """Improve a plan by one iteration; return it with its feedback policy.

        Raises:
            NoPlanError: the guess leads nowhere.
        """
        # a motion that runs away ends in inf or NaN, and is then not the cheapest
        with np.errstate(all="ignore"):
            try:
                feedback = self._policy(problem, guess)
            except np.linalg.LinAlgError:
                # no cure lies in the numbers of a singular system, so its message is
                # dropped
                raise NoPlanError from None
            given = self._times, problem.disturbance, problem.goals
            tried = self.rollouts.run(
                guess.x, guess.u, feedback, SHARES, problem.start, given
            )
        cost = np.where(np.isfinite(tried.cost), tried.cost, np.inf)
        best = int(np.argmin(cost))
        if not (np.isfinite(cost[best]) and np.isfinite(feedback.K).all()):
            raise NoPlanError
        share = float(SHARES[best])
        x = np.ascontiguousarray(tried.x[:, :, best])
        u = np.ascontiguousarray(tried.u[:, :, best])
        return MotionPlan(
            x,
            u,
            feedback.K,
            next_damping(guess.damping, share),
            float(cost[best]),
            share,
        )

    def _policy(self, problem: Problem, guess: MotionPlan) -> Policy:
        """Policy of the linearised problem, with inputs fixed where they reach their
        limits.
        """
        here = linear_problem(
            self.stages, problem, guess.x, guess.u, self.steps, self._roots
        )
        low, high = self._room(guess, len(self.bounds.speeds))
        first = problem.start - guess.x[0]
        at = np.zeros(low.shape)
        fixed = np.zeros(low.shape, dtype=bool)
        for _ in range(PASSES + 1):
            feedback = policy(here, fixed, at, damping=guess.damping)
            _, du = rollout(here, feedback, first, low, high)
            clipped = (du <= low) | (du >= high)
            if not (clipped & ~fixed).any():
                break
            # what is at a limit stays there, and the other inputs make the best of it
            fixed |= clipped
            at = np.where(du <= low, low, high)
        return feedback

    def _room(self, guess: MotionPlan, rotors: int) -> tuple[Array, Array]:
        """Smallest and largest change of each input (N, nu) within rotor speed and
        effort limits.
        """
        speeds, dt = guess.x[:-1, -rotors:], self.steps[:, None]
        efforts = np.tile(self.bounds.efforts, (len(self.steps), 1))
        low = np.hstack([-speeds / dt, -efforts])
        high = np.hstack([(self.bounds.speeds - speeds) / dt, efforts])
        # a guess beyond its limits may stay: no change is always within
        return np.minimum(low - guess.u, 0.0), np.maximum(high - guess.u, 0.0)


def next_damping(damping: float, share: float) -> float:
    """Damping of the next iteration, from the fraction of the last step that the line
    search took.
    """
    least, most = DAMPING
    if share < 0.5:
        return min(max(damping * GROWTH, least), most)
    if share < 1.0:
        return damping
    return damping / GROWTH if damping > least else 0.0


def linear_problem(
    stages: CompiledStages,
    problem: Problem,
    x: Array,
    u: Array,
    steps: Array,
    roots: Array,
) -> Linear:
    """Linear-quadratic problem about a trajectory x (N + 1, nx), u (N, nu), in
    deviations from that trajectory.
    """
    dt, inputs = np.append(steps, steps[-1]), np.vstack([u, u[-1:]])
    ends, AB, errors, slopes = stages.derivatives(
        x, inputs, dt, problem.disturbance, problem.goals
    )
    J, r = slopes * roots[:, None, None], errors * roots[:, None]
    # there is no input at the end of the horizon
    J[-1, -stages.input_errors :], r[-1, -stages.input_errors :] = 0.0, 0.0
    return Linear(AB[:-1], ends[:-1] - x[1:], J, r)


def shift_plan(plan: MotionPlan, steps: Array, dt: float) -> MotionPlan:
    """Plan advanced by ``dt`` seconds on unchanged stage lengths, with its end held
    constant.
    """
    times = np.append(0.0, np.cumsum(steps))
    later = np.minimum(times + dt, times[-1])
    # the last instant belongs to the last interval, behind which there is none
    at = np.clip(np.searchsorted(times, later, side="right") - 1, 0, len(steps) - 1)
    part = ((later - times[at]) / steps[at])[:, None]
    x = plan.x[at] + part * (plan.x[at + 1] - plan.x[at])
    x[:, 3:7] /= np.linalg.norm(x[:, 3:7], axis=1, keepdims=True)
    return replace(plan, x=x, u=plan.u[at[:-1]])
