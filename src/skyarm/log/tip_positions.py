"""Tip positions computed for arrays of base poses and joint positions."""

from __future__ import annotations

import numpy as np

from skyarm.algebra.frames import unit_rows
from skyarm.dynamics.array_front import frame_pose_world
from skyarm.records.arrays import Array
from skyarm.vehicle import Vehicle


def tip(vehicle: Vehicle, position: Array, quaternion: Array, joints: Array) -> Array:
    """World position (m) of the tip, (N, 3), or of the base if the vehicle has no
    tip.
    """
    # a vehicle without a tip is tracked by its base
    if not vehicle.end_effector:
        return position
    return frame_pose_world(vehicle, position, unit_rows(quaternion), joints)[0]


def level_tip(vehicle: Vehicle, position: Array, yaw: Array, joints: Array) -> Array:
    """World position (m) of the tip, (N, 3), if the base were level at the given
    yaw.
    """
    return tip(vehicle, position, yaw_quaternion(yaw), joints)


def yaw_quaternion(yaw: Array) -> Array:
    """Quaternions wxyz (N, 4) of a level attitude with the given yaw."""
    zero = np.zeros_like(yaw)
    return np.stack([np.cos(0.5 * yaw), zero, zero, np.sin(0.5 * yaw)], axis=1)
