"""The force across body z that fully actuated rotors can give beside a level hover."""

from __future__ import annotations

import math

import numpy as np

from skyarm.actuation import AllocationError, make_mixer
from skyarm.actuation.tilting import as_pairs
from skyarm.assess.arm_poses import ArmPoses, Array
from skyarm.assess.finding import OK, Finding
from skyarm.assess.level_hover import Allocation, hover_efforts
from skyarm.dynamics.array_front import center_of_mass
from skyarm.vehicle.vehicle_records import Vehicle


def sideways_reach(vehicle: Vehicle, poses: ArmPoses, gravity: float) -> list[Finding]:
    """The force at the centre of mass, in the direction of least, in the worst arm pose; nothing of flat rotors.

    A direction's force is found as the centroidal law gives it: with the rotors' least squares, which for more than
    six rotors is less than they could.
    """
    try:
        mixer = make_mixer(as_pairs(vehicle), "priority", sideways=True)
    except AllocationError:
        return []
    allocation, across = Allocation.of(mixer), np.array(mixer.across, dtype=float)

    def quantities(joints: Array) -> Array:
        squared = allocation.squared(hover_efforts(vehicle, gravity, joints))
        still, level = np.zeros((len(joints), 3)), np.tile([1.0, 0.0, 0.0, 0.0], (len(joints), 1))
        com = center_of_mass(vehicle, still, level, joints)
        # a force through the centre of mass turns about the base's origin by com x force
        turning = np.cross(allocation.inverse[:, None, :3], com[None, :, :])
        sizes = np.hypot(across[:, None, 0] + turning[:, :, 0], across[:, None, 1] + turning[:, :, 1])
        room = np.minimum(squared, allocation.highest[:, None] - squared)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.min(room / sizes, axis=0))[None]

    (least,), at = poses.worst(quantities)
    force, weight = max(float(least), 0.0), float(vehicle.mass) * gravity
    text = (
        f"rotors give up to {force:.3g} N sideways at a level hover in any direction, as a tilt of "
        f"{math.degrees(math.atan2(force, weight)):.3g} deg would; option sideways of law centroidal uses it"
    )
    return [
        Finding(
            question="sideways force",
            level=OK,
            text=text,
            field="rotors.axis",
            value=force,
            unit="N",
            joints=tuple(map(float, at[0])),
        )
    ]
