"""Where the bodies of a vehicle are at many instants at once: what a film or a recording plays."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Quaternion
from skyarm.dynamics.kinematics import link_poses
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle

Array = npt.NDArray[np.float64]


def moving_poses(vehicle: Vehicle, position: Array, quaternion: Array, joints: Array) -> dict[int, tuple[Array, Array]]:
    """Poses of the base and of every link in the world at N instants.

    Args:
        vehicle: with concrete numbers.
        position: (N, 3) of the base, m.
        quaternion: (N, 4) wxyz, body to world; any length but zero.
        joints: (N, n) rad or m.

    Returns:
        body (BASE or index of a link) -> (R_WB (N, 3, 3), p_WB (N, 3)).
    """
    count = len(position)
    unit = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
    R = stack([list(row) for row in Quaternion(*unit.T).rotation().rows], count)
    found = {BASE: (R, np.array(position, dtype=float))}
    for i, pose in enumerate(link_poses(vehicle, list(joints.T))):
        rotation = stack([list(row) for row in pose.R.rows], count)
        offset = stack(list(pose.p), count)
        found[i] = (R @ rotation, position + np.einsum("nij,nj->ni", R, offset))
    return found


def stack(entries: list[object], count: int) -> Array:
    """Numbers and columns (N,), nested in lists, as one array (N, ...)."""
    if isinstance(entries[0], list):
        return np.stack([stack(row, count) for row in entries if isinstance(row, list)], axis=1)
    return np.stack([np.broadcast_to(np.asarray(entry, dtype=float), count) for entry in entries], axis=1)
