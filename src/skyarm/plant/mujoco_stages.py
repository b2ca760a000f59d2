"""Fourth-order Runge-Kutta step for MuJoCo's bodies, with forces evaluated at each
stage.

The attitude of a step is its first one times the exponential of a rotation vector u,
and it is u that the method integrates: du/dt = w + 1/2 u x w + 1/12 u x (u x w), the
rest of the series being of fifth order.
Source: Munthe-Kaas 1999, Runge-Kutta methods on Lie groups; tableau of Kutta 1901.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import mujoco
import numpy as np

from skyarm.algebra import Quaternion, Scalar, Scalars, Vec3, sums
from skyarm.algebra.scalars import add, data, mul
from skyarm.compile.llvm.lane_stepper import Quick
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.state import State
from skyarm.plant.interface import example_command
from skyarm.plant.loads import follow_commands, with_equivalent_rotors
from skyarm.plant.mujoco_layout import Layout
from skyarm.plant.mujoco_welds import Welds
from skyarm.plant.surroundings import Together, coupled_places
from skyarm.records.arrays import Array, field_views
from skyarm.records.immutable import immutable
from skyarm.records.leaves import leaves, rebuild

STAGES = (
    (1.0 / 2.0, 1.0 / 6.0, 0.0, 0.5),
    (1.0 / 2.0, 1.0 / 3.0, 0.0, 0.5),
    (1.0, 1.0 / 3.0, 0.0, 1.0),
    (1.0 / 6.0, 0.0, 1.0, 1.0),
)
"""Coefficients of each stage, in steps: of its slope in the next state, and in the sum
of slopes; of the sum in the next state; time of the next state. The state after the
last stage is that after the step."""


Numbers = Scalars
"""Numbers of a record in a row, over any scalar type."""


@immutable
class RungeKuttaInputs:
    """Numerical inputs of one Runge-Kutta stage, apart from command and environment;
    states in MuJoCo's order.

    Attributes:
        start, first: state and memories of the coupled components at the beginning of
            the step.
        now, memory: state and memories of the stage.
        turn: rotation vector of the stage from the first attitude.
        total, rates: sums of the slopes of earlier stages, of the state and of the
            memories.
        acceleration: MuJoCo's generalised acceleration. weights: row of ``STAGES``, and
            the step (s).
    """

    start: Numbers
    first: Numbers
    now: Numbers
    memory: Numbers
    turn: Numbers
    total: Numbers
    rates: Numbers
    acceleration: Numbers
    weights: Numbers


class StagedRungeKutta:
    """Fourth-order Runge-Kutta integrator that takes accelerations from MuJoCo and
    forces from this library.

    Args:
        layout: layout of the vehicles. model, data: MuJoCo's; a step works in ``data``.
        around: surroundings as an example.
        forward: MuJoCo's forward dynamics, or with the forces that hold followers.
        welds: constraints of grasps in ``model``, with the objects that they hold.
    """

    def __init__(
        self,
        layout: Layout,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        around: Together,
        forward: Callable[[mujoco.MjModel, mujoco.MjData], None],
        welds: Sequence[Welds],
    ) -> None:
        self._welds = welds
        self._layout = layout
        self._model = model
        self._data = data
        self._forward = forward
        nq, nv = layout.nq, layout.nv
        self._qpos, self._qvel = data.qpos[:nq], data.qvel[:nv]
        self._force, self._qacc = data.qfrc_applied, data.qacc
        vehicles = layout.vehicles
        # velocities without the followers', which their leaders' give
        own = sum(6 + each.n for each in vehicles)
        state = (0.0,) * layout.end
        slopes = (0.0,) * (2 * own)
        self._coupled = (0.0,) * len(coupled_places(around))
        inputs = RungeKuttaInputs(
            start=state,
            first=self._coupled,
            now=state,
            memory=self._coupled,
            turn=(0.0,) * (3 * len(vehicles)),
            total=slopes,
            rates=self._coupled,
            acceleration=(0.0,) * len(self._qacc),
            weights=(0.0,) * 5,
        )
        commands = tuple(example_command(*each.sizes) for each in vehicles)
        self._program = Quick(self._stage, inputs, commands, around)
        # views of the program's inputs, by field
        self._at, count = field_views(inputs, self._program.inputs)
        self._given = self._program.inputs[count:]
        # state, memories, rotation vector and sums stand side by side among inputs and
        # outputs: one copy
        before = layout.end + len(self._coupled)
        width = before + len(inputs.turn) + 2 * own + len(self._coupled)
        self._moving = self._program.inputs[before:][:width]
        self._move_state = self._program.outputs[:width]
        self._loads = self._program.outputs[width:]
        now = self._at["now"]
        self._positions, self._velocities = now[:nq], now[nq : nq + nv]

    def _stage(
        self, inputs: RungeKuttaInputs, commands: tuple[Command, ...], around: Together
    ) -> Numbers:
        """Compute one Runge-Kutta stage: the next states, their rotation vectors, sums
        of slopes and forces.
        """
        layout = self._layout
        first, now = layout.states(inputs.start), layout.states(inputs.now)
        own, share, earlier, time, step = inputs.weights
        shape = around.coupled_memories()
        there = around.with_coupled(rebuild(shape, inputs.memory))
        faster = leaves(there.slopes(there.motions(layout.worlds, now)))
        for each in self._welds:
            for place, rate in zip(
                each.moving, inputs.acceleration[layout.nv :], strict=True
            ):
                # objects that MuJoCo holds move by its accelerations, not by our forces
                # alone
                faster[place] = rate
        rows = list(zip(inputs.first, inputs.rates, faster, strict=True))
        memory = [add(m, add(mul(earlier, s), mul(own, k))) for m, s, k in rows]
        rates = [add(s, mul(share, k)) for _, s, k in rows]
        around = around.with_coupled(rebuild(shape, memory))
        slopes = list[Scalar]()
        turns = iter(inputs.turn)
        total = iter(inputs.total)
        turned, following = list[Scalar](), list[State]()
        lags = follow_commands(layout.worlds, first, commands, around, time)
        for x, lag, acceleration in zip(
            now, lags, layout.accelerations(inputs.acceleration), strict=True
        ):
            slope = _slope(
                x, Vec3(next(turns), next(turns), next(turns)), *acceleration
            )
            change = [add(mul(earlier, next(total)), mul(own, k)) for k in slope]
            following.append(_move_state(lag, change))
            turned += change[3:6]
            slopes += slope
        sums = [
            add(s, mul(share, k)) for s, k in zip(inputs.total, slopes, strict=True)
        ]
        # the state after the last stage is the begin of the next step
        begun = follow_commands(layout.worlds, first, commands, around, earlier * step)
        worlds, (_, equivalent) = with_equivalent_rotors(
            layout.worlds, (begun, following), commands, around, step
        )
        loads = layout.generalized_forces(worlds, equivalent, commands, around)
        numbers = layout.to_mujoco(leaves(tuple(following)))
        return tuple(map(data, (*numbers, *memory, *turned, *sums, *rates, *loads)))

    def advance(
        self,
        x: Sequence[float],
        memory: Sequence[float],
        forces: Array,
        given: Sequence[float],
        steps: int,
        dt: float,
    ) -> tuple[list[float], list[float]]:
        """Vehicle state in MuJoCo's order and contact states after several Runge-Kutta
        steps.

        Args:
            x: state now, in MuJoCo's order.
            memory: numbers of the coupled memories now.
            forces: generalised forces on the state.
            given: rotor commands, setpoints, angles and numbers of the surroundings.
            steps: count of the steps.
            dt: length of a step, s.
        """
        tableau = dt * np.array(STAGES)
        # a share of a sum of slopes that hold a step's length already
        tableau[:, 2] = [row[2] for row in STAGES]
        program = self._program.step
        at = self._at
        at["now"][:] = x
        at["memory"][:] = memory
        self._given[:] = given
        self._loads[:] = forces
        for _ in range(steps):
            at["start"][:], at["first"][:] = at["now"], at["memory"]
            # the rotation vector counts from the attitude at which the step begins
            at["turn"][:], at["total"][:], at["rates"][:] = 0.0, 0.0, 0.0
            for row in tableau:
                self._solve()
                at["acceleration"][:] = self._qacc
                at["weights"][:] = (*row, dt)
                program()
                self._moving[:] = self._move_state
        for each in self._welds:
            self._solve()
            # at the state that is reached: the last stage was solved at its estimate
            at["memory"][each.forces] = each.wrenches()
        return at["now"].tolist(), at["memory"].tolist()

    def _solve(self) -> None:
        """Compute MuJoCo's accelerations and constraint forces at the stage's state
        under its forces.
        """
        self._qpos[:] = self._positions
        self._qvel[:] = self._velocities
        self._force[:] = self._loads
        for each in self._welds:
            each.put(self._at["memory"])
        self._forward(self._model, self._data)


def _slope(
    x: State, u: Vec3, linear: Vec3, angular: Vec3, joints: Sequence[Scalar]
) -> list[Scalar]:
    """Time derivatives of position, rotation vector, joint positions and velocities of
    one vehicle.
    """
    # Bortz: the next term is of fourth order in u
    across = u.cross(x.rate)
    turning = x.rate + across * 0.5 + u.cross(across) * (1.0 / 12.0)
    return [*x.velocity, *turning, *x.joint_rates, *linear, *angular, *joints]


def _move_state(first: State, change: Sequence[Scalar]) -> State:
    """Vehicle state after increments of position, rotation, joint positions and
    velocities.
    """
    n = len(first.joints)
    turned = first.quaternion * Quaternion.of_rotation_vector(Vec3(*change[3:6]))
    return replace(
        first,
        position=first.position + Vec3(*change[0:3]),
        # a product of unit quaternions drifts off unit length by rounding
        quaternion=turned.normalized(),
        joints=sums(first.joints, change[6 : 6 + n]),
        velocity=first.velocity + Vec3(*change[6 + n : 9 + n]),
        rate=first.rate + Vec3(*change[9 + n : 12 + n]),
        joint_rates=sums(first.joint_rates, change[12 + n :]),
    )
