"""How far an arm reaches and what it weighs on its joints."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import E_Z, ZERO3, Motion
from skyarm.dynamics.kinematics import frame_pose, link_poses
from skyarm.dynamics.newton_euler import inverse_dynamics
from skyarm.vehicle.records import BASE, Vehicle

Array = npt.NDArray[np.float64]

SAMPLES, ROUNDS = 4096, 60
"""Random starts and shrinking rounds of the search; the two-joint arm's maximum is found to 1e-9."""


def _configurations(vehicle: Vehicle, rng: np.random.Generator, around: Array | None, spread: float) -> Array:
    """Joint values within limits: uniform (a full turn, or 1 m, where unlimited), or normal around given ones."""
    low = np.array([max(float(k.joint.lower), -math.pi if k.joint.kind == "revolute" else -1.0) for k in vehicle.links])
    high = np.array([min(float(k.joint.upper), math.pi if k.joint.kind == "revolute" else 1.0) for k in vehicle.links])
    if around is None:
        return rng.uniform(low, high, (SAMPLES, vehicle.n))
    return np.asarray(np.clip(around + spread * (high - low) * rng.normal(size=(256, vehicle.n)), low, high))


def _largest(vehicle: Vehicle, quantity: Any) -> tuple[float, Array]:
    """Largest value of quantity(joints) over the joint range and where it is, by random search with shrinking steps."""
    rng = np.random.default_rng(0)
    tried = _configurations(vehicle, rng, None, 1.0)
    best, spread = tried[int(np.argmax(quantity(tried)))], 0.1
    for _ in range(ROUNDS):
        tried = np.vstack([best, _configurations(vehicle, rng, best, spread)])
        best, spread = tried[int(np.argmax(quantity(tried)))], 0.75 * spread
    return float(quantity(best[None])[0]), best


def _columns(joints: Array) -> tuple[Array, ...]:
    return tuple(joints[:, i] for i in range(joints.shape[1]))


def reach(vehicle: Vehicle) -> float:
    """Largest distance from the arm's first joint to the end effector, m; 0 without an arm."""
    if not vehicle.links or not vehicle.end_effector:
        return 0.0
    frame = vehicle.frame(vehicle.end_effector)
    first = frame.link
    while first != BASE and vehicle.links[first].parent != BASE:
        first = vehicle.links[first].parent
    if first == BASE:
        return 0.0

    def distance(joints: Array) -> Array:
        q = _columns(joints)
        arm = frame_pose(vehicle, frame, q).p - link_poses(vehicle, q)[first].p
        return np.asarray(np.sqrt(sum(np.asarray(c, dtype=float) ** 2 for c in arm))) * np.ones(joints.shape[0])

    return _largest(vehicle, distance)[0]


def static_torques(vehicle: Vehicle, gravity: float) -> list[float]:
    """Largest |torque| (N m) or |force| (N) that holds each joint against gravity with a level base."""
    still = (0,) * vehicle.n
    level = Motion(ZERO3, E_Z * gravity)

    def holding(joint: int) -> Any:
        def torque(joints: Array) -> Array:
            _, torques = inverse_dynamics(vehicle, _columns(joints), ZERO3, still, level, still)
            return np.asarray(np.abs(np.asarray(torques[joint], dtype=float)) * np.ones(joints.shape[0]))

        return torque

    return [_largest(vehicle, holding(i))[0] for i in range(vehicle.n)]
