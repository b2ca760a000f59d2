"""Conversion of axes and quaternions from autopilot and ROS conventions to this
library's: FLU base, z-up world.

Wires and logs of autopilots have FRD (forward, right, down) and NED (north, east,
down): ours, turned by half a turn about x, so that NED becomes north, west, up. ROS has
FLU (forward, left, up), as we do, and ENU (east, north, up), which is a world with z up
and stays; its quaternions are x, y, z, w. Sources: PX4's ``VehicleAttitude.msg``,
MAVLink's ``ATTITUDE_QUATERNION`` and ``MAV_FRAME``, ROS REP 103 and the message
``geometry_msgs/Quaternion``.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from skyarm.algebra.quaternion import Quaternion
from skyarm.algebra.scalars import Scalar
from skyarm.algebra.vector import Vec3

Array = npt.NDArray[np.float64]

FRAMES, WORLDS, ORDERS = ("FLU", "FRD"), ("z up", "NED"), ("wxyz", "xyzw")
"""Base axes, world axes and quaternion orders that a file may declare; those of this
library come first."""


def to_our_axes(x: Scalar, y: Scalar, z: Scalar) -> Vec3:
    """Vector converted from FRD to FLU axes, or from NED to north-west-up axes; the
    conversion is its own inverse.
    """
    return Vec3(x, -y, -z)


def to_our_attitude(
    w: Scalar, x: Scalar, y: Scalar, z: Scalar, frame: str = "FRD", world: str = "NED"
) -> Quaternion:
    """Attitude of a base (FLU or FRD) in a world (z up or NED), converted to FLU base
    axes and z-up world axes.

    Half a turn about x is the quaternion i: a base's axes turn by a factor i from the
    right, a world's by -i from the left. Of FRD in NED both give w, x, -y, -z, which is
    its own inverse.
    """
    if frame == "FRD":
        w, x, y, z = -x, w, z, -y
    if world == "NED":
        w, x, y, z = x, -w, z, -y
    return Quaternion(w, x, y, z)


def of_euler_angles(
    roll: float | Array, pitch: float | Array, yaw: float | Array
) -> Quaternion:
    """Quaternion of Z-Y-X Euler angles (rad): yaw about z, then pitch about the new y,
    then roll about the new x.
    """
    # a quaternion has sine and cosine of half the angle
    (cr, sr), (cp, sp), (cy, sy) = (
        (np.cos(0.5 * each), np.sin(0.5 * each)) for each in (roll, pitch, yaw)
    )
    return (
        Quaternion(cy, 0.0, 0.0, sy)
        * Quaternion(cp, 0.0, sp, 0.0)
        * Quaternion(cr, sr, 0.0, 0.0)
    )


def unit_rows(rows: Array) -> Array:
    """Rows of an array (N, k) divided by their Euclidean lengths, as for unit
    quaternions or directions.
    """
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))


def continuous(quaternions: Array) -> Array:
    """Sequence of quaternions (N, 4), with signs chosen so that neighbours are close: q
    and -q are one attitude.
    """
    # two neighbours on opposite sides of the sphere are the same attitude nearby
    turns = np.where((quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0.0, -1.0, 1.0)
    # signs accumulate along the sequence; an empty one has no first sign
    return (
        quaternions
        * np.cumprod(np.concatenate([np.ones(min(1, len(quaternions))), turns]))[
            :, None
        ]
    )


def turn_vectors(quaternions: Array, vectors: Array) -> Array:
    """Vectors (N, 3) rotated by unit quaternions (N, 4), w first."""
    return np.stack(
        [*Quaternion(*quaternions.T).rotation().apply(Vec3(*vectors.T))], axis=1
    )


def to_base(quaternions: Array, vectors: Array) -> Array:
    """Vectors (N, 3) converted from world to base axes by unit quaternions (N, 4) from
    base to world, w first.
    """
    return np.stack(
        [*Quaternion(*quaternions.T).rotation().apply_T(Vec3(*vectors.T))], axis=1
    )
