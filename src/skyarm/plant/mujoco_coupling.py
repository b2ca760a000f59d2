"""Joints that follow others on MuJoCo's plant: the forces that hold them are found exactly, not by soft constraints.

MuJoCo moves every joint by itself. With M and h its mass matrix and bias, G q the joints by the leaders' and f the
forces applied, the leaders' acceleration is a = (G^T M G)^-1 G^T (f - h), and the force M G a + h makes MuJoCo's own
solution G a. No mass matrix but MuJoCo's enters.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from skyarm.vehicle.vehicle_records import Vehicle


def own_to_mujoco(vehicle: Vehicle, model: Any, dofs: Sequence[int]) -> Any:
    """The matrix G, shape (nv, 6 + joints): MuJoCo's velocities from those of the vehicle's base and links.

    Args:
        vehicle: with or without followers.
        model: MuJoCo's.
        dofs: of links and followers, in ``model``.
    """
    G = np.zeros((int(model.nv), 6 + vehicle.n))
    G[:6, :6] = np.eye(6)
    for i in range(vehicle.n):
        G[dofs[i], 6 + i] = 1.0
    for k, each in enumerate(vehicle.followers):
        G[dofs[vehicle.n + k], 6 + each.leader] = float(each.ratio)
    return G


class Coupling:
    """Holds the followers of a vehicle in MuJoCo's data.

    Args:
        vehicle: with followers. model, data: MuJoCo's. dofs: of links and followers, in ``model``.
    """

    def __init__(self, vehicle: Vehicle, model: Any, data: Any, dofs: Sequence[int]) -> None:
        self._G = own_to_mujoco(vehicle, model, dofs)
        self._columns = np.ascontiguousarray(self._G.T)
        self._moved = np.zeros(self._columns.shape)
        self._force, self._bias = data.qfrc_applied, data.qfrc_bias

    def forward(self, model: Any, data: Any) -> None:
        """``mj_forward`` with the coupling's forces added to those applied."""
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        for column, moved in zip(self._columns, self._moved, strict=True):
            mujoco.mj_mulM(model, data, moved, column)
        M = self._moved @ self._G
        a = np.linalg.solve(M, self._columns @ (self._force - self._bias))
        self._force[:] = a @ self._moved + self._bias
        mujoco.mj_forward(model, data)
