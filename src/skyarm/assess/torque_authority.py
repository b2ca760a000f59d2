"""The torques that the rotors can add to a level hover, in the worst arm pose."""

from __future__ import annotations

import math

import numpy as np

from skyarm.assess.arm_poses import ArmPoses, Array
from skyarm.assess.finding import FAULT, OK, WARNING, Finding
from skyarm.assess.hanging_joints import hanging_joints
from skyarm.assess.level_hover import WRENCH, Allocation, hover_efforts
from skyarm.dynamics.array_front import mass_matrix
from skyarm.vehicle.vehicle_records import Vehicle

AXES = ("roll", "pitch", "yaw")

FAULTS, WARNINGS = (1.0, 1.0, 0.05), (5.0, 5.0, 0.2)
"""rad/s^2: below the first it cannot be held against a breeze, below the second it is slow; yaw can be weaker."""

RAYS = 72
"""Directions in which the boundary of attainable roll and pitch torque is found."""


def torque_authority(vehicle: Vehicle, allocation: Allocation, poses: ArmPoses, gravity: float) -> list[Finding]:
    """Angular acceleration that the rotors can add to hover about each axis, either way, in the worst arm pose.

    The worst pose is that of the least acceleration: an arm that is stretched out adds inertia and takes no torque.
    """
    directions = [sign * np.eye(WRENCH)[axis] for axis in range(3) for sign in (1.0, -1.0)]

    def quantities(joints: Array) -> Array:
        squared = allocation.squared(hover_efforts(vehicle, gravity, joints))
        inertias = locked_inertia(vehicle, joints)
        return np.stack([allocation.room(squared, d) / inertias[:, i // 2, i // 2] for i, d in enumerate(directions)])

    least, at = poses.worst(quantities)
    found = []
    for axis, name in enumerate(AXES):
        i = 2 * axis + int(np.argmin(least[2 * axis : 2 * axis + 2]))
        acceleration, joints = float(least[i]), at[i]
        torque = acceleration * float(locked_inertia(vehicle, joints[None])[0, axis, axis])
        found.append(_finding(name, axis, torque, acceleration, tuple(map(float, joints))))
    return found


def _finding(name: str, axis: int, torque: float, acceleration: float, joints: tuple[float, ...]) -> Finding:
    level = FAULT if not acceleration >= FAULTS[axis] else WARNING if acceleration < WARNINGS[axis] else OK
    text = f"rotors can add {max(torque, 0.0):.3g} N m to hover either way, {max(acceleration, 0.0):.3g} rad/s^2"
    fields = "rotors.direction, rotors.moment_coefficient" if name == "yaw" else "rotors.position"
    return Finding(
        question=f"{name} authority",
        level=level,
        text=text if level != FAULT else f"cannot be turned: {text}",
        field=f"{fields}, base.inertia",
        value=acceleration,
        limit=FAULTS[axis] if level == FAULT else WARNINGS[axis],
        unit="rad/s^2",
        remedy="" if level == OK else f"check {fields}, base.inertia; more thrust margin",
        joints=joints,
    )


def locked_inertia(vehicle: Vehicle, joints: Array) -> Array:
    """Inertia (lanes, 3, 3) about the whole centre of mass with the joints (lanes, n) held, base axes, kg m^2.

    Joints that hang give way: they add the inertia that is felt while no torque acts about them.
    """
    still, level = np.zeros((len(joints), 3)), np.tile([1.0, 0.0, 0.0, 0.0], (len(joints), 1))
    M = mass_matrix(vehicle, still, level, joints)
    hanging = hanging_joints(vehicle)
    if hanging:
        free = [0, 1, 2, *(6 + i for i in hanging)]
        turned = M[:, free, 3:6]
        return np.asarray(M[:, 3:6, 3:6] - turned.swapaxes(1, 2) @ np.linalg.solve(M[:, free][:, :, free], turned))
    return np.asarray(M[:, 3:6, 3:6] - M[:, 3:6, :3] @ M[:, :3, 3:6] / M[:, :1, :1], dtype=float)


def roll_pitch_boundary(vehicle: Vehicle, allocation: Allocation, joints: Array, gravity: float) -> Array:
    """Corners (RAYS, 2) of the roll and pitch torques that can be added to hover in a pose, N m."""
    squared = allocation.squared(hover_efforts(vehicle, gravity, joints[None]))
    angles = 2.0 * math.pi * np.arange(RAYS) / RAYS
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    far = [allocation.room(squared, np.array([*ray, 0.0, 0.0]))[0] for ray in rays]
    return np.asarray(np.maximum(far, 0.0)[:, None] * rays, dtype=float)
