"""Workspace of an arm, and its gravity load on the joints."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from skyarm.algebra import E_Z, ZERO3, Motion
from skyarm.dynamics.kinematics import Pose, chain, link_poses
from skyarm.dynamics.newton_euler import inverse_dynamics
from skyarm.records.arrays import Array, doubles
from skyarm.vehicle import BASE, Joint, Vehicle

Quantities = Callable[[Array], list[Array]]

SAMPLES, ROUNDS, AROUND = 4096, 60, 256
"""Random starts, shrinking rounds of the search, and trials of each round; the
two-joint arm's maximum is found to 1e-9."""

MANY, FEW = 27, 400_000
"""Number of joints up to which the search takes 2 s at most; for more, number of links
(joints times samples) that are evaluated without rounds.
"""


def nearest_to_zero(joint: Joint) -> float:
    """Position of a joint nearest to zero within its limits, rad or m."""
    return min(max(0.0, float(joint.lower)), float(joint.upper))


def middle_position(joint: Joint) -> float:
    """Middle of a joint's range, or the allowed position nearest to zero if unbounded,
    rad or m.
    """
    low, high = joint.ends
    return 0.5 * (low + high) if math.isfinite(high - low) else nearest_to_zero(joint)


def samples_of(joints: int) -> int:
    """Number of random joint configurations from which a search over an arm's workspace
    starts.
    """
    return SAMPLES if joints <= MANY else max(min(SAMPLES, FEW // joints), 8)


def joint_range(joint: Joint) -> tuple[float, float]:
    """Range of a joint to sample: its limits, or one turn about zero for a joint that
    turns further.
    """
    # a slide has no turn that shows every pose: 1 m is chosen, far beyond those of the
    # shipped vehicles, which end at 0.12 m
    free = math.pi if joint.turns else 1.0
    low, high = joint.ends
    if math.isinf(low):
        low = min(-free, high - free)
    if math.isinf(high):
        high = max(free, low + free)
    if joint.turns and high - low > 2.0 * free:
        # one turn has every pose: the one about zero, moved as far as limits demand
        middle = min(max(0.0, low + free), high - free)
        return middle - free, middle + free
    return low, high


def _largest(vehicle: Vehicle, quantities: Quantities, count: int) -> list[float]:
    """Largest value of each function of the joint positions within limits, by random
    search with shrinking steps.

    Args:
        vehicle: its joints.
        quantities: ``count`` quantities as a function of joint values (lanes, n), each
            (lanes,) or one number for all.
        count: number of quantities.
    """
    # a fixed seed: the same vehicle always has the same reach
    rng = np.random.default_rng(0)
    spread = 0.1
    low, high = np.array([*map(joint_range, vehicle.joints)]).reshape(-1, 2).T
    tried = rng.uniform(low, high, (samples_of(vehicle.n), vehicle.n))
    values = np.stack([np.broadcast_to(each, len(tried)) for each in quantities(tried)])
    best = tried[np.argmax(values, axis=1)]
    most = np.max(values, axis=1)
    width = AROUND + 1
    # of more joints each round would take seconds
    for _ in range(ROUNDS if vehicle.n <= MANY else 0):
        # every quantity searches around its own best, with the same steps, in lanes of
        # its own
        steps = spread * (high - low) * rng.normal(size=(AROUND, vehicle.n))
        # the best itself is among them, so that a round never loses it
        near = np.clip(
            best[:, None] + np.vstack([np.zeros((1, vehicle.n)), steps]), low, high
        )
        for i, each in enumerate(quantities(near.reshape(count * width, vehicle.n))):
            own = np.broadcast_to(each, count * width)[i * width : (i + 1) * width]
            at = int(np.argmax(own))
            best[i], most[i] = near[i, at], own[at]
        # after all rounds a step is 0.1 * 0.75^60 = 3e-9 of the range
        spread *= 0.75
    return [float(value) for value in most]


def reach(vehicle: Vehicle) -> float:
    """Largest distance from the arm's first joint to the tip, m; 0 without an arm."""
    if not vehicle.links or not vehicle.end_effector:
        return 0.0
    frame = vehicle.frame()
    # no joint moves the tip
    if frame.link == BASE:
        return 0.0

    first = chain(vehicle, frame.link)[0]
    local = Pose(frame.rotation, frame.position)

    def distance(joints: Array) -> list[Array]:
        poses = link_poses(vehicle, tuple(joints.T))
        arm = (poses[frame.link] @ local).p - poses[first].p
        return [np.sqrt(sum(doubles(c) ** 2 for c in arm))]

    return _largest(vehicle, distance, 1)[0]


def static_torques(vehicle: Vehicle, gravity: float) -> list[float]:
    """Largest torque (N m) or force (N) that holds each joint against gravity, with a
    level base.
    """
    if not vehicle.links:
        return []
    still = (0,) * vehicle.n
    level = Motion(ZERO3, E_Z * gravity)

    def holding(joints: Array) -> list[Array]:
        _, torques = inverse_dynamics(
            vehicle, tuple(joints.T), ZERO3, still, level, still
        )
        return [np.abs(doubles(torque)) for torque in torques]

    return _largest(vehicle, holding, vehicle.n)
