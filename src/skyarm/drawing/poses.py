"""Where the bodies of a vehicle are at one instant, as plain arrays for whoever draws them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Quaternion
from skyarm.dynamics.kinematics import link_poses
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle

Array = npt.NDArray[np.float64]


def body_poses(
    vehicle: Vehicle, position: Sequence[float], quaternion: Sequence[float], joints: Sequence[float]
) -> dict[int, tuple[Array, Array]]:
    """Pose of the base and of every link in the world.

    Args:
        vehicle: with concrete numbers.
        position: (3,) of the base, m.
        quaternion: (4,) wxyz, body to world; any length but zero.
        joints: (n,) rad or m.

    Returns:
        body (BASE or index of a link) -> (R_WB (3, 3), p_WB (3,)).
    """
    R = rotation_matrix(quaternion)
    p = np.array([float(c) for c in position])
    found = {BASE: (R, p)}
    for i, pose in enumerate(link_poses(vehicle, [float(q) for q in joints])):
        local = np.array([[float(c) for c in row] for row in pose.R.rows])
        found[i] = (R @ local, p + R @ np.array([float(c) for c in pose.p]))
    return found


def rotation_matrix(quaternion: Sequence[float]) -> Array:
    """R_WB (3, 3) of a quaternion wxyz of any length but zero."""
    w, x, y, z = np.asarray(quaternion, dtype=float) / np.linalg.norm(np.asarray(quaternion, dtype=float))
    R = Quaternion(float(w), float(x), float(y), float(z)).rotation()
    return np.array([[float(c) for c in row] for row in R.rows])
