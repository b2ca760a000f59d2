"""Follower joints, payloads and stuck joints of the MuJoCo plant.

Joints that follow others are held by forces that are found exactly, not by soft
constraints. MuJoCo moves every joint by itself. With M and h its mass matrix and bias,
G q the joints by the leaders' and f the forces applied, the leaders' acceleration is
a = (G^T M G)^-1 G^T (f - h), and the force M G a + h makes MuJoCo's own solution G a.
No mass matrix but MuJoCo's enters.

Each load is a body of MuJoCo's own, welded to the link that may hold it, at its centre
of mass and along its principal axes; only its mass and its moments change. A stuck
joint has a large armature. Velocities after a grasp, or when a joint gets stuck, come
from MuJoCo's mass matrices before and after.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from skyarm.algebra import Scalar, Scalars
from skyarm.algebra.scalars import data
from skyarm.compile.llvm.lane_stepper import Quick
from skyarm.plant.interface import Flat
from skyarm.plant.loads import LOCKED, rigid_loads, stuck_of
from skyarm.plant.mujoco_layout import Layout
from skyarm.plant.mujoco_model import load_name
from skyarm.plant.surroundings import Together
from skyarm.records.arrays import Array


def own_to_mujoco(layout: Layout) -> Array:
    """Matrix (nv, 6 + joints of each vehicle) that maps base and joint velocities to
    MuJoCo's velocities.
    """
    vehicles = layout.vehicles
    G = np.zeros((layout.nv, sum(6 + each.n for each in vehicles)))
    first = 0
    for vehicle, base, dofs in zip(vehicles, layout.bases, layout.dofs, strict=True):
        G[base : base + 6, first : first + 6] = np.eye(6)
        for i in range(vehicle.n):
            G[dofs[i], first + 6 + i] = 1.0
        for k, each in enumerate(vehicle.followers):
            G[dofs[vehicle.n + k], first + 6 + each.leader] = float(each.ratio)
        first += 6 + vehicle.n
    return G


class Coupling:
    """Constraint in MuJoCo's data by which a vehicle's follower joints move with their
    leader joints.

    Args:
        layout: layout of vehicles with followers. data: MuJoCo's.
    """

    def __init__(self, layout: Layout, data: mujoco.MjData) -> None:
        G = own_to_mujoco(layout)
        # objects move by themselves, behind the vehicles
        self._G = np.pad(G, ((0, len(data.qvel) - len(G)), (0, 0)))
        self._own = len(G)
        self._columns = np.ascontiguousarray(self._G.T)
        self._moved = np.zeros(self._columns.shape)
        self._force, self._bias = data.qfrc_applied, data.qfrc_bias

    def forward(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Compute MuJoCo's forward dynamics including the constraint forces of follower
        joints.
        """
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        for column, moved in zip(self._columns, self._moved, strict=True):
            mujoco.mj_mulM(model, data, moved, column)
        # one product M G serves both G^T M G and the force; no other force acts: this
        # model's joints have neither damping nor limits, and with constraints ties hold
        # followers in place of this class
        M = self._moved @ self._G
        a = np.linalg.solve(M, self._columns @ (self._force - self._bias))
        self._force[: self._own] = (a @ self._moved + self._bias)[: self._own]
        # computes place and velocity anew: 2.4 of 6.9 us of a six-joint arm (measured)
        mujoco.mj_forward(model, data)


OF_A_LOAD = 5
"""Numbers of a load in a period: mass, three moments, and 1 in the period in which it
is grasped."""


class Loads:
    """Payloads and stuck joints in a MuJoCo model, updated every control period.

    Args:
        layout: layout of the vehicles. model, data: MuJoCo's, made with bodies for the
            loads of ``around``.
        around: surroundings as an example. prefixes: of the names in each vehicle's
            tree.
    """

    def __init__(
        self,
        layout: Layout,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        around: Together,
        prefixes: Sequence[str],
    ) -> None:
        self._model, self._data = model, data
        beside = [around.of(i) for i in range(len(prefixes))]
        names = [
            prefix + load_name(i)
            for prefix, own in zip(prefixes, beside, strict=True)
            for i in range(len(rigid_loads(own)))
        ]
        self._bodies = [model.body(name).id for name in names]
        stuck = [
            dofs
            for dofs, own in zip(layout.joints, beside, strict=True)
            if stuck_of(own)
        ]
        # int: an empty array would be of floats, which are no indices
        self._dofs = np.array([dof for dofs in stuck for dof in dofs], dtype=int)
        own_dofs = [
            (*range(base, base + 6), *dofs)
            for base, dofs in zip(layout.bases, layout.joints, strict=True)
        ]
        self._own = np.array([dof for dofs in own_dofs for dof in dofs], dtype=int)
        self._armature = model.dof_armature.copy()
        self._numbers = Quick(_numbers, around)
        self._set: tuple[bytes, bytes] | None = None
        self._G = own_to_mujoco(layout)

    def _of(self, around: Flat) -> tuple[Array, Array]:
        """Mass, moments of inertia and grasp flag of each payload, and stuck flags of
        the joints.
        """
        self._numbers.inputs[:] = around
        self._numbers.step()
        numbers = np.array(self._numbers.outputs)
        ends = OF_A_LOAD * len(self._bodies)
        return numbers[:ends].reshape(-1, OF_A_LOAD), numbers[ends:]

    def carry(self, around: Flat) -> None:
        """Set payload inertias and stuck joints in MuJoCo's model for a control
        period.
        """
        loads, stuck = self._of(around)
        self._put(loads[:, :4], stuck)

    def _put(self, loads: Array, stuck: Array) -> None:
        key = (loads.tobytes(), stuck.tobytes())
        # loads change at few instants: most periods have those of the one before
        if key == self._set:
            return
        self._set = key
        model = self._model
        # MuJoCo's masses of whole trees only choose the point about which it sums: they
        # stay
        for body, (mass, *moments) in zip(self._bodies, loads, strict=True):
            model.body_mass[body], model.body_inertia[body] = mass, moments
        # from the model's own numbers: a joint that comes free has no more of it
        model.dof_armature[:] = self._armature
        if len(stuck):
            model.dof_armature[self._dofs] += LOCKED * stuck

    def velocity_after(self, qvel: Array, around: Flat) -> Array:
        """Generalised velocities right after the impulse of a grasp or of a joint that
        gets stuck.
        """
        loads, stuck = self._of(around)
        # two mass matrices are the price of an impact only
        if not (loads[:, 4].any() or stuck.any()):
            return qvel
        # what is grasped now was at rest, and no brake has acted yet
        before = self._mass_matrix(
            loads[:, :4] * (1.0 - loads[:, 4:]), np.zeros_like(stuck)
        )
        after = self._mass_matrix(loads[:, :4], stuck)
        return self._G @ np.linalg.solve(after, before @ qvel[self._own])

    def _mass_matrix(self, loads: Array, stuck: Array) -> Array:
        """Mass matrix of base and joint coordinates, computed from MuJoCo's."""
        model, data = self._model, self._data
        self._put(loads, stuck)
        mujoco.mj_fwdPosition(model, data)
        whole = np.zeros((model.nv, model.nv))
        for column, moved in zip(np.eye(model.nv), whole, strict=True):
            mujoco.mj_mulM(model, data, moved, column)
        # vehicles come first: what follows are the velocities of free objects
        return self._G.T @ whole[: len(self._G), : len(self._G)] @ self._G


def _numbers(around: Together) -> Scalars:
    """Mass, moments of inertia and grasp flag of each payload, then the stuck flags of
    the joints.
    """
    numbers = list[Scalar]()
    beside = [around.of(i) for i in range(len(around.each))]
    for load, memory in (pair for own in beside for pair in rigid_loads(own)):
        numbers += [
            load.mass * memory.held,
            *(each * memory.held for each in load.inertia),
            memory.caught,
        ]
    return tuple(
        map(data, (*numbers, *(share for own in beside for share in stuck_of(own))))
    )
