"""Axes and quaternions of files and messages in ours: base x forward, y left, z up; world z up; w x y z, base to world.

Wires and logs of autopilots have FRD (forward, right, down) and NED (north, east, down): ours, turned by half a turn
about x, so that NED becomes north, west, up. ROS has FLU (forward, left, up), as we do, and ENU (east, north, up),
which is a world with z up and stays; its quaternions are x, y, z, w. Sources: PX4's ``VehicleAttitude.msg``,
MAVLink's ``ATTITUDE_QUATERNION`` and ``MAV_FRAME``, ROS REP 103 and the message ``geometry_msgs/Quaternion``.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from skyarm.algebra.quaternion import Quaternion
from skyarm.algebra.scalars import Scalar
from skyarm.algebra.vector import Vec3

Array = npt.NDArray[np.float64]

FRAMES, WORLDS, ORDERS = ("FLU", "FRD"), ("z up", "NED"), ("wxyz", "xyzw")
"""Axes of the base, axes of the world, and orders of a quaternion's numbers that a file may state; ours first."""


def to_our_axes(x: Scalar, y: Scalar, z: Scalar) -> Vec3:
    """Vector of forward, right, down or north, east, down in our axes; and back, for the map is its own inverse."""
    return Vec3(x, -y, -z)


def to_our_attitude(w: Scalar, x: Scalar, y: Scalar, z: Scalar, frame: str = "FRD", world: str = "NED") -> Quaternion:
    """Attitude of a base (FLU or FRD) in a world (z up or NED) in our axes.

    Half a turn about x is the quaternion i: a base's axes turn by a factor i from the right, a world's by -i from the
    left. Of FRD in NED both give w, x, -y, -z, which is its own inverse.
    """
    if frame == "FRD":
        w, x, y, z = -x, w, z, -y
    if world == "NED":
        w, x, y, z = x, -w, z, -y
    return Quaternion(w, x, y, z)


def of_euler_angles(roll: float | Array, pitch: float | Array, yaw: float | Array) -> Quaternion:
    """Quaternion of roll, pitch and yaw, rad: turned by yaw about z, then by pitch about the new y, by roll about x."""
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(0.5 * each), np.sin(0.5 * each)) for each in (roll, pitch, yaw))
    return Quaternion(cy, 0.0, 0.0, sy) * Quaternion(cp, 0.0, sp, 0.0) * Quaternion(cr, sr, 0.0, 0.0)


def unit_rows(rows: Array) -> Array:
    """Rows (N, k) over their lengths: quaternions of unit length, directions."""
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))


def continuous(quaternions: Array) -> Array:
    """Quaternions (N, 4) with signs in which neighbours are close: halfway between q and -q there is no rotation."""
    turns = np.where((quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0.0, -1.0, 1.0)
    return quaternions * np.cumprod(np.concatenate([np.ones(min(1, len(quaternions))), turns]))[:, None]


def turn_vectors(quaternions: Array, vectors: Array) -> Array:
    """Vectors (N, 3) turned by unit quaternions (N, 4), w first."""
    return np.stack([*Quaternion(*quaternions.T).rotation().apply(Vec3(*vectors.T))], axis=1)


def to_base(quaternions: Array, vectors: Array) -> Array:
    """Vectors (N, 3) in base axes from those in world axes; unit quaternions (N, 4), w first, base to world."""
    return np.stack([*Quaternion(*quaternions.T).rotation().apply_T(Vec3(*vectors.T))], axis=1)
