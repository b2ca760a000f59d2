"""Stages of the horizon and their derivatives, all in one call of vector code.

Every stage and every nudged copy of it is a lane: the prediction that the plant's own compiler turns into machine code
gives values and differences of a whole horizon in a fraction of a millisecond.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Quaternion, Vec3
from skyarm.compile import leaves
from skyarm.compile.llvm.kernel import Kernel, host_width
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.stepped_loop import trace_loop
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.laws.predictive.contact_force import Contact
from skyarm.control.laws.predictive.cost import Goal, Weights, foreseen, input_residuals, state_residuals
from skyarm.control.laws.predictive.motion_plan import Inputs
from skyarm.control.model import Model
from skyarm.dynamics import State

Array = npt.NDArray[np.float64]

NUDGE = 1e-5
"""Of the central difference; errors are about 1e-10 of the numbers of order one that states and residuals are."""


def examples(joints: int, rotors: int, contact: bool = False) -> tuple[State, Inputs, Disturbance, Goal]:
    """Records of floats that give the shapes; with ``contact`` a goal may ask for one."""
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
