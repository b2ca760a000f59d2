"""The largest mass that the tip can hold in every arm pose."""

from __future__ import annotations

import math

import numpy as np

from skyarm.assess.arm_poses import ArmPoses, Array
from skyarm.assess.finding import FAULT, NOTE, OK, WARNING, Finding
from skyarm.assess.joint_torques import effort_limits
from skyarm.assess.level_hover import WRENCH, Allocation, hover_efforts
from skyarm.assess.thrust_margin import ENOUGH
from skyarm.vehicle.vehicle_records import Vehicle

NOTHING = 1e-9
"""kg: rounding of a vehicle that holds its own weight and no more."""


def largest_payload(
    vehicle: Vehicle, allocation: Allocation, poses: ArmPoses, gravity: float, payload: float = 0.0
) -> list[Finding]:
    """Largest point mass at the tip with which hover is possible in every pose, with ENOUGH thrust left.

    Wrench and efforts of a level hover are linear in the mass at the tip, so that each pose has its largest mass in
    closed form; the least of them is sought over the poses.
    """
    question = "largest payload"
    if not vehicle.end_effector:
        return [Finding(question=question, level=NOTE, text="not known: the vehicle has no tip", field="end_effector")]
    loaded = vehicle.with_payload(1.0)
    names = [f"rotors[{rotor.name}]" for rotor in vehicle.rotors]
    names += [f"joints[{link.joint.name}].effort_limit" for link in vehicle.links]

    def largest(joints: Array) -> Array:
        parts = _largest_by_part(vehicle, loaded, allocation, joints, gravity)
        return np.asarray(np.min(parts, axis=0)[None], dtype=float)

    (least,), at = poses.worst(largest)
    parts = _largest_by_part(vehicle, loaded, allocation, at, gravity)[:, 0]
    binding = names[int(np.argmin(parts))]
    most, joints = max(float(least), 0.0), tuple(map(float, at[0]))
    if math.isinf(most):
        return [Finding(question=question, level=NOTE, text="not limited: no rotor or joint states a limit")]
    level = FAULT if payload > most else OK if most > NOTHING else WARNING
    text = f"{most:.3g} kg in every arm pose, with thrust for {ENOUGH:g} times the weight; {binding} comes first"
    remedy = f"at most {most:.3g} kg, or more of {binding}"
    if most <= NOTHING:
        text = f"none: {binding} has nothing left in some arm pose, with thrust for {ENOUGH:g} times the weight"
        remedy = f"more of {binding}, or a lighter vehicle"
    return [
        Finding(
            question=question,
            level=level,
            text=text if level != FAULT else f"--payload {payload:g} kg is more than it holds: {text}",
            field=binding,
            value=most,
            limit=payload if payload else math.nan,
            unit="kg",
            remedy="" if level == OK else remedy,
            joints=joints,
        )
    ]


def _largest_by_part(vehicle: Vehicle, loaded: Vehicle, allocation: Allocation, joints: Array, gravity: float) -> Array:
    """Largest payload (parts, lanes) that each rotor and joint allows, kg; negative where it bears not even itself."""
    bare = hover_efforts(vehicle, gravity, joints)
    per_kilogram = hover_efforts(loaded, gravity, joints) - bare
    squared, more = allocation.squared(bare), allocation.inverse @ per_kilogram[:WRENCH]
    with np.errstate(divide="ignore", invalid="ignore"):
        top = allocation.highest[:, None] / ENOUGH
        rotors = np.where(more > 0.0, (top - squared) / more, np.where(more < 0.0, -squared / more, np.inf))
        limits = effort_limits(vehicle)[:, None]
        effort, step = bare[WRENCH:], per_kilogram[WRENCH:]
        efforts = np.where(np.abs(step) > 1e-12, (limits - np.sign(step) * effort) / np.abs(step), np.inf)
    return np.vstack([rotors, efforts])
