"""Mass matrix and acceleration of a vehicle by MuJoCo, state by state."""

from __future__ import annotations

import warnings
from typing import Any

import mujoco
import numpy as np

from skyarm.plant.mujoco_loads import own_to_mujoco
from skyarm.plant.mujoco_model import build_spec, joint_addresses
from skyarm.vehicle.vehicle_records import Vehicle

Array = Any


class Equations:
    """Mass matrix and acceleration by MuJoCo; joints that follow others are eliminated by their constant ratios.

    Args:
        vehicle: with concrete numbers. gravity: m/s^2.

    Raises:
        ValueError: MuJoCo refuses the vehicle.
    """

    def __init__(self, vehicle: Vehicle, gravity: float) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of masses beyond measure
            self._model = build_spec(vehicle, gravity).compile()
        self._data, self._vehicle = mujoco.MjData(self._model), vehicle
        self._q, self._v = joint_addresses(vehicle, self._model)
        self._G = own_to_mujoco(vehicle, self._model, self._v)

    def at(
        self, position: Array, quaternion: Array, joints: Array, velocity: Array, force: Array
    ) -> tuple[Array, Array]:
        """Mass matrix (6+n, 6+n) and acceleration (6+n,) at a state, under a generalised force (6+n,).

        Conventions are those of :mod:`skyarm.dynamics.array_front`.
        """
        data, model = self._data, self._model
        every: list[Any] = [float(q) for q in joints]
        every += [float(f.ratio) * every[f.leader] + float(f.offset) for f in self._vehicle.followers]
        data.qpos[:7] = (*position, *quaternion)
        data.qpos[self._q] = every
        data.qvel[:] = self._G @ velocity
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        columns = np.ascontiguousarray(self._G.T)
        moved = np.zeros_like(columns)
        for column, row in zip(columns, moved, strict=True):
            mujoco.mj_mulM(model, data, row, column)
        M = np.asarray(moved @ self._G, dtype=float)
        return M, np.asarray(np.linalg.solve(M, force - columns @ data.qfrc_bias), dtype=float)
