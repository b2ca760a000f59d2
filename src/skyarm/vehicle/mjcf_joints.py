"""Joints of an MJCF model: kind, limits, drives, and joints that equalities tie to others."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from skyarm.algebra import Mat3, Vec3
from skyarm.vehicle import description
from skyarm.vehicle.check import refuse
from skyarm.vehicle.couple import Mimic
from skyarm.vehicle.linkage import Joint
from skyarm.vehicle.mjcf_limits import name_of
from skyarm.vehicle.notes import Notes

KINDS = ("free", "ball", "prismatic", "revolute")
"""By MuJoCo's number of a joint's type."""

AT_JOINT = (0, 1)
"""MuJoCo's numbers of the transmissions that act at a joint."""


def kind_of(model: Any, joint: int) -> str:
    """One of ``KINDS``."""
    return KINDS[int(model.jnt_type[joint])]


def joint_name(model: Any, joint: int) -> str:
    """Name of a joint, made up where the file gives none."""
    return name_of(model, "jnt", joint)


def read_joint(model: Any, joint: int, R: Mat3, p: Vec3, notes: Notes) -> Joint:
    """Joint record at a pose in its parent; its zero is where the model stands at first (``ref``)."""
    name = joint_name(model, joint)
    zero = float(model.qpos0[model.jnt_qposadr[joint]])
    if zero:
        notes.add("with a ref: its zero here is where the file's model stands", name)
    lower, upper = -math.inf, math.inf
    if model.jnt_limited[joint]:
        lower, upper = (float(each) - zero for each in model.jnt_range[joint])
    effort = _effort(model, joint)
    if effort == 0.0:
        notes.add("without an actuator, so passive; [[joints]] effort_limit gives it a drive", name)
    dof = int(model.jnt_dofadr[joint])
    given = {"damping": "dof_damping", "coulomb": "dof_frictionloss", "armature": "dof_armature"}
    rubbing: dict[str, Any] = {
        ours: description.zero_is_structure(float(getattr(model, theirs)[dof])) for ours, theirs in given.items()
    }
    axis = description.unit_axis(f"joint[{name}].axis", [float(each) for each in model.jnt_axis[joint]])
    return Joint(
        name=name,
        kind=kind_of(model, joint),
        axis=axis,
        position=p,
        rotation=R,
        lower=lower,
        upper=upper,
        effort_limit=effort,
        **rubbing,
    )


def _effort(model: Any, joint: int) -> float:
    """Largest effort of all actuators at a joint, N m or N; 0 without any."""
    total = 0.0
    for actuator in range(int(model.nu)):
        if int(model.actuator_trntype[actuator]) in AT_JOINT and int(model.actuator_trnid[actuator][0]) == joint:
            total += abs(float(model.actuator_gear[actuator][0])) * _largest_force(model, actuator)
    if model.jnt_actfrclimited[joint]:
        total = min(total, max(abs(float(each)) for each in model.jnt_actfrcrange[joint]))
    return total


def _largest_force(model: Any, actuator: int) -> float:
    """N m or N before the gear: by the range of the force, or of the control where the force is proportional to it."""
    found = math.inf
    if model.actuator_forcelimited[actuator]:
        found = max(abs(float(each)) for each in model.actuator_forcerange[actuator])
    plain = not model.actuator_gaintype[actuator] and not model.actuator_biastype[actuator]
    if plain and model.actuator_ctrllimited[actuator]:
        gain = abs(float(model.actuator_gainprm[actuator][0]))
        found = min(found, gain * max(abs(float(each)) for each in model.actuator_ctrlrange[actuator]))
    return found


def mimics_of(model: Any) -> dict[str, Mimic]:
    """Joint -> the one that it follows, of the equalities of joints; one that is held by itself follows nothing ("").

    Raises:
        VehicleError: an equality that is no straight line.
    """
    import mujoco

    found: dict[str, Mimic] = {}
    for each in range(int(model.neq)):
        if model.eq_type[each] != mujoco.mjtEq.mjEQ_JOINT or not model.eq_active0[each]:
            continue
        name, other = joint_name(model, int(model.eq_obj1id[each])), int(model.eq_obj2id[each])
        numbers = [float(value) for value in model.eq_data[each][:5]]
        if any(numbers[2:]):
            refuse(f"equality of joint[{name}].polycoef", numbers, "must be a straight line: two numbers, then zeros")
        if name in found:
            refuse(f"equality of joint[{name}]", "two of them", "must be at most one")
        found[name] = Mimic(joint_name(model, other) if other >= 0 else "", numbers[1], numbers[0])
    return found


def stands_still(name: str, mimics: Mapping[str, Mimic]) -> bool:
    """Whether a joint that follows never moves: an equality holds it, or the one that it follows in the end."""
    passed = [name]
    while passed[-1] in mimics:
        mimic = mimics[passed[-1]]
        if not mimic.joint or mimic.ratio == 0.0:
            return True
        if mimic.joint in passed:  # a ring is refused where it is followed
            return False
        passed.append(mimic.joint)
    return False


def resting(model: Any, name: str, mimics: Mapping[str, Mimic]) -> float:
    """Value of a joint where the one that it follows in the end is at zero, or at the limit next to zero."""
    passed = [name]
    while passed[-1] in mimics and mimics[passed[-1]].joint:
        leader = mimics[passed[-1]].joint
        if leader in passed:
            refuse(f"equality of joint[{name}]", leader, f"must not lead back ({' -> '.join([*passed, leader])})")
        passed.append(leader)
    value = 0.0
    joint = model.joint(passed[-1]).id if passed[-1] not in mimics else -1
    if joint >= 0 and model.jnt_limited[joint]:
        zero = float(model.qpos0[model.jnt_qposadr[joint]])
        lower, upper = (float(each) - zero for each in model.jnt_range[joint])
        value = min(max(0.0, lower), upper)
    for each in reversed(passed):
        if each in mimics:
            value = mimics[each].ratio * value + mimics[each].offset
    return value
