"""Where the joints that no drive holds come to rest in a level hover: a pendulum and a slung load hang."""

from __future__ import annotations

import math

import numpy as np

from skyarm.assess.level_hover import WRENCH, Array, hover_efforts
from skyarm.vehicle.undriven import undriven_joints
from skyarm.vehicle.vehicle_records import Vehicle

GRAVITY = 9.81
"""m/s^2: a rest under weight alone is the same under any."""

ROUNDS, SETTLED = 50, 1e-9
"""Times that every joint is brought to rest while the others stay, and rad or m by which none moves any more."""

NOTHING = 1e-9
"""N m or N: a joint that weight does not move stays where it is."""


def hanging_joints(vehicle: Vehicle) -> tuple[int, ...]:
    """Indices of the joints that no drive holds and that weight alone moves; those that lead others are left out."""
    leaders = {each.leader for each in vehicle.followers}
    free = undriven_joints(vehicle)
    return tuple(i for i, link in enumerate(vehicle.links) if link.joint.name in free and i not in leaders)


def rest_of_hanging(vehicle: Vehicle, joints: Array) -> Array:
    """Joints (lanes, n) with the hanging ones where the potential energy is least, base level, within their limits.

    The energy of weight is a single sine of each revolute joint while the others stay, so that two torques give its
    lowest point exactly; the joints take turns until none moves.
    """
    hanging = hanging_joints(vehicle)
    rest = np.array(joints, dtype=float)
    for _ in range(ROUNDS if hanging else 0):
        before = rest.copy()
        for i in hanging:
            rest[:, i] = _lowest(vehicle, rest, i)
        if np.max(np.abs(rest - before)) < SETTLED:
            break
    return rest


def _lowest(vehicle: Vehicle, joints: Array, i: int) -> Array:
    """Values (lanes,) of joint i with the least energy while the other joints stay."""
    joint = vehicle.links[i].joint
    low, high = float(joint.lower), float(joint.upper)

    def torque(value: float) -> Array:
        moved = joints.copy()
        moved[:, i] = value
        return np.asarray(hover_efforts(vehicle, GRAVITY, moved)[WRENCH + i], dtype=float)

    at_zero = torque(0.0)
    if joint.kind != "revolute":  # slides down as far as it can
        end = np.where(at_zero > 0.0, low, high)
        return np.where((np.abs(at_zero) > NOTHING) & np.isfinite(end), end, joints[:, i])
    at_quarter = torque(0.5 * math.pi)  # the energy is b sin q - a cos q, its slope b cos q + a sin q
    lowest = np.arctan2(-at_zero, at_quarter)
    turns = np.ceil((low - lowest) / (2.0 * math.pi)) if math.isfinite(low) else 0.0
    lowest = lowest + 2.0 * math.pi * turns
    if math.isfinite(high):
        ends = [at_zero * math.sin(end) - at_quarter * math.cos(end) for end in (max(low, high - math.tau), high)]
        lowest = np.where(lowest <= high, lowest, np.where(ends[0] < ends[1], max(low, high - math.tau), high))
    return np.where(np.hypot(at_zero, at_quarter) > NOTHING, lowest, joints[:, i])
