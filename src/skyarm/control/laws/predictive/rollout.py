"""Motions that a policy makes, as the model moves: steps of several lengths at once, each with its true cost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.compile import leaves
from skyarm.compile.llvm.kernel import Kernel, host_width
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.stepped_loop import trace_loop
from skyarm.control.laws.predictive.cost import Weights, foreseen, input_residuals, state_residuals
from skyarm.control.laws.predictive.linearise import examples
from skyarm.control.laws.predictive.motion_plan import Inputs
from skyarm.control.laws.predictive.riccati import Policy
from skyarm.control.model import Model
from skyarm.scalars import maximum, minimum

Array = npt.NDArray[np.float64]


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
