"""Poses of a vehicle's bodies as one program: for pictures that are drawn sixty times a second."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Quaternion, Vec3
from skyarm.compile import trace
from skyarm.dynamics.kinematics import link_poses
from skyarm.scalars import divide, sqrt
from skyarm.vehicle.vehicle_records import Vehicle

Array = npt.NDArray[np.float64]


class PoseProgram:
    """Where the base, the links and the tip of a vehicle are; the numbers are those of :mod:`skyarm.drawing.poses`.

    Args:
        vehicle: with concrete numbers.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        frame = vehicle.frame() if vehicle.end_effector else None

        def poses(position: Vec3, quaternion: Quaternion, joints: tuple[Any, ...]) -> tuple[Any, ...]:
            q = quaternion
            length = sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z)
            R_WB = Quaternion(*(divide(c, length) for c in q)).rotation()
            local = link_poses(vehicle, joints)
            links = [(R_WB @ pose.R, position + R_WB.apply(pose.p)) for pose in local]
            tip = position if frame is None else links[frame.link][1] + links[frame.link][0].apply(frame.position)
            placed = [(R_WB, position), *links]
            rows = [(*chain.from_iterable(R.rows), *p) for R, p in placed]
            return (*chain.from_iterable(rows), *tip)

        self._bodies = 1 + len(vehicle.moving)
        example = Vec3(0.1, 0.2, 0.3), Quaternion(0.9, 0.1, 0.2, 0.3), (0.1,) * vehicle.n
        self._program = trace(poses, *example)

    def __call__(self, position: Sequence[Any], quaternion: Sequence[Any], joints: Sequence[Any]) -> Placed:
        """Evaluate.

        Args:
            position: (3,) of the base, m.
            quaternion: (4,) wxyz, body to world; any length but zero.
            joints: (n,) rad or m.
        """
        out = np.array(self._program.flat((*map(float, position), *map(float, quaternion), *map(float, joints))))
        table = out[:-3].reshape(self._bodies, 12)
        return Placed(table[:, :9].reshape(-1, 3, 3), table[:, 9:], out[-3:])


class Placed:
    """Bodies in the world; row 0 is the base, row 1 + i is link i.

    Args:
        rotations: (bodies, 3, 3), R_WB.
        positions: (bodies, 3), m.
        tip: (3,), m; the base's origin where there is no tip.
    """

    __slots__ = ("positions", "rotations", "tip")

    def __init__(self, rotations: Array, positions: Array, tip: Array) -> None:
        self.rotations, self.positions, self.tip = rotations, positions, tip

    @property
    def quaternions(self) -> Array:
        """(bodies, 4) wxyz."""
        return quaternions_of(self.rotations)


def quaternions_of(rotations: Array) -> Array:
    """Unit quaternions (N, 4) wxyz of rotation matrices (N, 3, 3): squares from the diagonal, signs from the rest.

    Source: Shepperd 1978, without its branches: next to half a turn the signs are those of rounding, which a picture
    does not show.
    """
    xx, yy, zz = rotations[:, 0, 0], rotations[:, 1, 1], rotations[:, 2, 2]
    squares = np.stack([1.0 + xx + yy + zz, 1.0 + xx - yy - zz, 1.0 - xx + yy - zz, 1.0 - xx - yy + zz], axis=1)
    halves = 0.5 * np.sqrt(np.maximum(squares, 0.0))
    halves[:, 1] = np.copysign(halves[:, 1], rotations[:, 2, 1] - rotations[:, 1, 2])
    halves[:, 2] = np.copysign(halves[:, 2], rotations[:, 0, 2] - rotations[:, 2, 0])
    halves[:, 3] = np.copysign(halves[:, 3], rotations[:, 1, 0] - rotations[:, 0, 1])
    quaternions: Array = halves / np.linalg.norm(halves, axis=1, keepdims=True)
    return quaternions
