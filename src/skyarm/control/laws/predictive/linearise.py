"""Stages of the horizon as vector code: their derivatives, and the motions that a policy makes.

Every stage and every nudged copy of it is a lane: the prediction that the plant's own compiler turns into machine code
gives values and differences of a whole horizon in a fraction of a millisecond. A rollout moves the model under a policy
with steps of several lengths at once, each with its true cost.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Quaternion, Vec3
from skyarm.compile import leaves
from skyarm.compile.llvm.kernel import Kernel, host_width
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.program import trace_loop
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.laws.predictive.cost import Contact, Goal, Weights, foreseen, input_residuals, state_residuals
from skyarm.control.laws.predictive.prediction import Inputs
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.scalars import maximum, minimum

if TYPE_CHECKING:
    from skyarm.control.laws.predictive.riccati import Policy

Array = npt.NDArray[np.float64]

NUDGE = 1e-5
"""Of the central difference; errors are about 1e-10 of the numbers of order one that states and residuals are."""


def examples(joints: int, rotors: int, contact: bool = False) -> tuple[State, Inputs, Disturbance, Goal]:
    """Records of floats that give the shapes; with ``contact`` a goal may request one."""
    zero, arm = Vec3(0.0, 0.0, 0.0), (0.0,) * joints
    state = State(
        position=zero,
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=zero,
        rate=zero,
        joints=arm,
        joint_rates=arm,
        rotor_speeds=(0.0,) * rotors,
    )
    pressed = Contact(normal=zero, touching=0.0, force=0.0, damping=0.0) if contact else ()
    goal = Goal(
        position=zero,
        velocity=zero,
        yaw=0.0,
        joints=arm,
        joint_rates=arm,
        joint_accelerations=arm,
        shift=zero,
        contact=pressed,
    )
    inputs = Inputs(rotor_accelerations=(0.0,) * rotors, efforts=arm)
    return state, inputs, Disturbance(force=zero, torque=zero, efforts=arm), goal


class Stages:
    """Prediction and residuals of all stages as machine code.

    Args:
        model: the belief. weights, mode: of :mod:`skyarm.control.laws.predictive.cost`.
        scales: size of a unit of each input; nudges are taken in it. contact: whether goals may ask for one.

    Attributes:
        nx, nu: numbers of a state and of the inputs. input_errors: residuals at the end that are costs of inputs.
    """

    def __init__(self, model: Model, weights: Weights, mode: str, scales: Array, contact: bool = False) -> None:
        shapes = examples(model.vehicle.n, len(model.vehicle.rotors), contact)
        state, inputs, disturbance, goal = shapes

        def stage(x: State, par: tuple[Any, ...], _row: Any, _uniforms: Any) -> tuple[State, tuple[Any, ...]]:
            u, dt, d, wanted = par
            errors = state_residuals(model, weights, x, wanted, mode)
            return foreseen(model, x, u, d, wanted, dt[0]), (
                *errors,
                *input_residuals(model, weights, x, u, d, wanted),
            )

        loop = trace_loop(stage, state, (inputs, (0.0,), disturbance, goal), ())
        self.kernel = Kernel(loop, Lanes(host_width()), logging=True)
        self.nx, self.nu = len(leaves(state)), len(leaves(inputs))
        self.input_errors = model.vehicle.n + len(model.vehicle.rotors) + contact
        self.scales = np.concatenate([np.ones(self.nx), scales])
        self.scales[self.nx - len(model.vehicle.rotors) : self.nx] = 100.0
        width = self.nx + self.nu
        self._nudges = np.vstack([np.zeros(width), np.diag(self.scales), -np.diag(self.scales)]) * NUDGE

    def derivatives(self, x: Array, u: Array, dt: Array, d: Array, goals: Array) -> tuple[Array, Array, Array, Array]:
        """Values and derivatives at N + 1 stages.

        Args:
            x: (N + 1, nx).
            u: (N + 1, nu), the last has no effect.
            dt: (N + 1,) s.
            d: leaves of the disturbance.
            goals: (N + 1, leaves of a goal).

        Returns:
            x after each stage (N + 1, nx), its derivative (N + 1, nx, nx + nu), residuals (N + 1, nr) and theirs.
        """
        count, width = len(x), self.nx + self.nu
        nudged = np.concatenate([x, u], axis=1)[:, None, :] + self._nudges
        copies = nudged.shape[1]
        held = np.concatenate([dt[:, None], np.broadcast_to(d, (count, len(d))), goals], axis=1)
        lanes = nudged.reshape(count * copies, width).T
        par = np.vstack([lanes[self.nx :], np.repeat(held, copies, axis=0).T])
        carry, log = self.kernel.run(lanes[: self.nx], par, np.zeros((1, 0)))
        ends = carry.T.reshape(count, copies, self.nx)
        errors = log[0].T.reshape(count, copies, -1)
        return ends[:, 0], self._slopes(ends), errors[:, 0], self._slopes(errors)

    def _slopes(self, values: Array) -> Array:
        """Central differences: (stages, values, inputs)."""
        width = self.nx + self.nu
        change = values[:, 1 : width + 1] - values[:, width + 1 :]
        return np.asarray((change / (2.0 * NUDGE * self.scales[:, None])).transpose(0, 2, 1))


@dataclass(frozen=True, slots=True)
class Bounds:
    """Limits of joint efforts (n,) and rotor speeds (rotors,)."""

    efforts: Array
    speeds: Array


@dataclass(frozen=True, slots=True)
class Motions:
    """Motions, one a lane: states (N + 1, nx, lanes), inputs (N, nu, lanes), sums of squared residuals (lanes,)."""

    x: Array
    u: Array
    cost: Array


class Rollouts:
    """u = u_guess + a k + K (x - x_guess) within the limits, for several a, as one call of vector code.

    Args:
        model: the belief. weights, mode: of :mod:`skyarm.control.laws.predictive.cost`. bounds: of the inputs.
        contact: whether goals may ask for one.

    Source: Tassa, Mansard, Todorov 2014 (limits within the rollout of a policy).
    """

    def __init__(self, model: Model, weights: Weights, mode: str, bounds: Bounds, contact: bool = False) -> None:
        state, inputs, disturbance, goal = examples(model.vehicle.n, len(model.vehicle.rotors), contact)
        nx, nu = len(leaves(state)), len(leaves(inputs))
        efforts, speeds = bounds.efforts.tolist(), bounds.speeds.tolist()

        def stage(carry: Any, par: Any, row: Any, _uniforms: Any) -> Any:
            x, (cost,) = carry
            (a,), d = par
            x_guess, u_guess, k, K, (dt, whole, running), wanted = row
            change = [b - c for b, c in zip(leaves(x), leaves(x_guess), strict=True)]
            u = [
                start + a * push + sum(gain * dx for gain, dx in zip(gains, change, strict=True))
                for start, push, gains in zip(leaves(u_guess), k, K, strict=True)
            ]
            # no rotor stops, none turns faster than it can
            rates = [
                maximum(-w / dt, minimum(rate, (most - w) / dt))
                for rate, w, most in zip(u, x.rotor_speeds, speeds, strict=False)
            ]
            torques = [maximum(-most, minimum(t, most)) for t, most in zip(u[len(speeds) :], efforts, strict=True)]
            taken = Inputs(rotor_accelerations=tuple(rates), efforts=tuple(torques))
            errors = sum(e * e for e in state_residuals(model, weights, x, wanted, mode))
            pushes = sum(e * e for e in input_residuals(model, weights, x, taken, d, wanted))
            return (foreseen(model, x, taken, d, wanted, dt), (cost + whole * errors + running * pushes,)), (
                x,
                taken,
            )

        zero = (0.0,) * nu
        row = (state, inputs, zero, ((0.0,) * nx,) * nu, (0.0, 0.0, 0.0), goal)
        loop = trace_loop(stage, (state, (0.0,)), ((0.0,), disturbance), row)
        self.kernel, self.nx, self.nu = Kernel(loop, Lanes(host_width()), logging=True), nx, nu

    def run(
        self, x: Array, u: Array, found: Policy, a: Array, start: Array, given: tuple[Array, Array, Array]
    ) -> Motions:
        """Motions from ``start`` of the policy about a guess x (N + 1, nx), u (N, nu).

        Args:
            x: (N + 1, nx) states of the guess.
            u: (N, nu) its inputs.
            found: its policy.
            a: (lanes,) shares of the policy's feed-forward.
            start: (nx,) the state now.
            given: (N + 1, 2) lengths of the stages and time for which each state counts, s; leaves of the disturbance;
                goals (N + 1, leaves of a goal).
        """
        times, d, goals = given
        count = len(u)
        rows = np.zeros((count + 1, self.kernel.loop.row))
        ends = np.cumsum([self.nx, self.nu, self.nu, self.nu * self.nx])
        rows[:, : ends[0]] = x
        rows[:count, ends[0] : ends[1]], rows[:count, ends[1] : ends[2]] = u, found.k
        rows[:count, ends[2] : ends[3]] = found.K.reshape(count, -1)
        # there is no input at the end of the horizon
        rows[:, ends[3] : ends[3] + 2], rows[:count, ends[3] + 2] = times, times[:count, 1]
        rows[:, ends[3] + 3 :] = goals
        lanes = len(a)
        carry = np.zeros((self.nx + 1, lanes))
        carry[: self.nx] = start[:, None]
        par = np.vstack([a, np.repeat(d[:, None], lanes, axis=1)])
        last, log = self.kernel.run(carry, par, rows)
        return Motions(log[:, : self.nx], log[:count, self.nx :], last[self.nx])
