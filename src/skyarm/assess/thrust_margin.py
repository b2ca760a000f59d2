"""The thrust margin: whether the rotors can hold the vehicle level in every arm pose, and what is left."""

from __future__ import annotations

import math

import numpy as np

from skyarm.assess.arm_poses import ArmPoses, Array
from skyarm.assess.endurance import speed_share
from skyarm.assess.finding import FAULT, NOTE, OK, WARNING, Finding, graded
from skyarm.assess.level_hover import Allocation, hover_efforts
from skyarm.assess.mass_balance import field_of_mass
from skyarm.vehicle.vehicle_records import Vehicle

ENOUGH = 1.2
"""What the busiest rotor can give over what hover asks of it: with less, attitude control saturates often."""

LEAST_SHARE = 0.05
"""Of the slowest rotor's thrust in the mean: below it a small torque stops that rotor."""


def thrust_margin(
    vehicle: Vehicle, allocation: Allocation, poses: ArmPoses, gravity: float, held: str = ""
) -> list[Finding]:
    """Thrust margin of the busiest rotor and share of the idlest, over all arm poses.

    Args:
        vehicle: with its payload, if it holds one.
        allocation: of its rotors.
        poses: of its arm.
        gravity: m/s^2.
        held: says of the payload that it is held, as " with 0.3 kg"; empty without one.
    """

    def quantities(joints: Array) -> Array:
        squared = allocation.squared(hover_efforts(vehicle, gravity, joints))
        busiest = np.max(squared / allocation.highest[:, None], axis=0)
        idlest = np.min(squared, axis=0) / np.mean(np.abs(squared), axis=0)
        return np.stack([-busiest, idlest])

    (busiest, idlest), at = poses.worst(quantities)
    busiest = -float(busiest)
    return [
        _margin(vehicle, gravity, busiest, tuple(map(float, at[0])), held),
        _idlest(vehicle, float(idlest), tuple(map(float, at[1])), held),
    ]


def _margin(vehicle: Vehicle, gravity: float, busiest: float, joints: tuple[float, ...], held: str) -> Finding:
    question = f"thrust margin{held}"
    if any(math.isinf(float(rotor.max_speed)) for rotor in vehicle.rotors):
        text = "not known: a rotor has no max_speed"
        remedy = "state rotors.max_speed, rad/s"
        return Finding(question=question, level=NOTE, text=text, field="rotors.max_speed", remedy=remedy)
    sagging = speed_share(vehicle, gravity)
    margin = sagging**2 / busiest if busiest > 0.0 else math.nan
    level = graded(margin, fault_below=1.0, warning_below=ENOUGH)
    weight = float(vehicle.mass) * gravity
    text = f"the busiest rotor gives up to {margin:.3g} times what hover asks of it in the worst arm pose"
    if sagging < 1.0:
        text += f", on its battery at the start, whose voltage lets rotors turn at {sagging:.3g} of max_speed"
    if level == FAULT:
        text = f"cannot hover: {text} ({weight:.3g} N of weight)"
    if sagging < 1.0:
        remedy = "a fuller battery, more cells, less mass, or more thrust: rotors.max_speed"
    else:
        remedy = "less mass, a shorter arm, or more thrust: rotors.max_speed, rotors.thrust_coefficient"
    return Finding(
        question=question,
        level=level,
        text=text,
        field="rotors.max_speed" if busiest * ENOUGH > 1.0 or sagging == 1.0 else "battery.charge, battery.cells",
        value=margin,
        limit=1.0 if level == FAULT else ENOUGH,
        remedy="" if level == OK else remedy,
        joints=joints,
    )


def _idlest(vehicle: Vehicle, share: float, joints: tuple[float, ...], held: str) -> Finding:
    level = FAULT if share < 0.0 else WARNING if share < LEAST_SHARE else OK
    field = field_of_mass(vehicle, np.array(joints))
    text = f"the idlest rotor carries {share:.2g} of the mean in the worst arm pose"
    if level == FAULT:
        text = f"a rotor would have to pull down: {text}; the centre of mass lies too far from the rotors' middle"
    return Finding(
        question=f"balance of the rotors{held}",
        level=level,
        text=text,
        field=field,
        value=share,
        limit=0.0 if level == FAULT else LEAST_SHARE,
        remedy="" if level == OK else f"move mass towards the rotors' middle ({field}; m, not mm?)",
        joints=joints,
    )
