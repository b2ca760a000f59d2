"""Joints of a URDF file: kind, axis, limits, effort and friction, and joints that follow others.

Files leave out what the specification asks for. Limits left out are none, an effort left out is none (a passive
joint); each is said in a note, and a vehicle file states what is meant by ``[[joints]]``.
Source: URDF specification (ROS wiki, urdf/XML/joint).
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from typing import Any

from skyarm.algebra import ZERO3, Mat3, Vec3, axis_rotation
from skyarm.vehicle import description
from skyarm.vehicle.check import refuse
from skyarm.vehicle.couple import Mimic
from skyarm.vehicle.linkage import Joint
from skyarm.vehicle.notes import Notes
from skyarm.vehicle.xml_fields import child, number, numbers

KINDS = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "fixed": "fixed"}


def kind_of_joint(joint: ET.Element) -> str:
    """Kind of a joint, as records name it, or "fixed"."""
    kind = joint.get("type", "")
    if kind not in KINDS:
        refuse(f"joint[{joint.get('name')}].type", kind, f"must be one of {', '.join(KINDS)}")
    return KINDS[kind]


def limits(joint: ET.Element) -> tuple[float, float]:
    """Lowest and highest value of a joint, rad or m; infinite where the file states none.

    By the specification a limit that is not stated is 0. That is taken where the other one leaves the joint room to
    move; elsewhere it has been forgotten.
    """
    field = f"joint[{joint.get('name')}]"
    limit = child(joint, "limit", field)
    if joint.get("type") == "continuous" or limit is None:
        return -math.inf, math.inf
    lower = number(limit, "lower", f"{field}.limit", math.nan, infinite=True)
    upper = number(limit, "upper", f"{field}.limit", math.nan, infinite=True)
    if math.isnan(lower):
        lower = 0.0 if upper > 0.0 else -math.inf
    if math.isnan(upper):
        upper = 0.0 if -math.inf < lower < 0.0 else math.inf
    return lower, upper


def fixed_at(joint: ET.Element) -> float | None:
    """Where a joint cannot move from, rad or m; None if it can move."""
    if kind_of_joint(joint) == "fixed":
        return 0.0
    limit = child(joint, "limit", f"joint[{joint.get('name')}]")
    stated = limit is not None and None not in (limit.get("lower"), limit.get("upper"))
    lower, upper = limits(joint)
    return lower if stated and lower == upper else None


def displaced(joint: ET.Element, value: float) -> tuple[Mat3, Vec3]:
    """R and p by which a joint at a value, rad or m, places its child in the joint's frame."""
    kind = kind_of_joint(joint)
    if kind == "fixed":
        return Mat3.identity(), ZERO3
    axis = axis_of(joint)
    return (axis_rotation(axis, value), ZERO3) if kind == "revolute" else (Mat3.identity(), axis * value)


def axis_of(joint: ET.Element) -> Vec3:
    """Unit vector of a joint's axis; the specification's default is x, where there is no <axis> at all."""
    field = f"joint[{joint.get('name')}]"
    axis = child(joint, "axis", field)
    if axis is not None and axis.get("xyz") is None:
        refuse(f"{field}.axis.xyz", "(missing)", "must be three numbers")
    return description.unit_axis(f"{field}.axis", numbers(axis, "xyz", f"{field}.axis", (1.0, 0.0, 0.0)))


def read_joint(joint: ET.Element, R: Mat3, p: Vec3, notes: Notes) -> Joint:
    """Joint of a moving link, with the pose of its frame in the parent."""
    name = joint.get("name", "")
    field = f"joint[{name}]"
    limit, dynamics = child(joint, "limit", field), child(joint, "dynamics", field)
    lower, upper = limits(joint)
    if joint.get("type") != "continuous" and math.isinf(lower) and math.isinf(upper):
        notes.add("without limits, so it turns or slides without end", name)
    elif joint.get("type") != "continuous" and (limit is None or None in (limit.get("lower"), limit.get("upper"))):
        notes.add("with one limit stated only; the other is 0 or none", name)
    effort = number(limit, "effort", f"{field}.limit", math.nan, infinite=True)
    if math.isnan(effort):
        notes.add("without an effort, so passive; [[joints]] effort_limit gives it a drive", name)
    elif effort == 0.0:
        notes.add("of effort 0, so passive", name)
    values: dict[str, Any] = {"lower": lower, "upper": upper, "effort_limit": 0.0 if math.isnan(effort) else effort}
    for ours, theirs in (("damping", "damping"), ("coulomb", "friction")):
        values[ours] = description.zero_is_structure(number(dynamics, theirs, f"{field}.dynamics", 0.0))
    return Joint(name=name, kind=kind_of_joint(joint), axis=axis_of(joint), position=p, rotation=R, **values)


def read_mimics(joints: Mapping[str, ET.Element]) -> dict[str, Mimic]:
    """Name of each joint that follows another one -> how; of joints that can move only."""
    found: dict[str, Mimic] = {}
    for name, joint in joints.items():
        field = f"joint[{name}]"
        mimic = child(joint, "mimic", field)
        if mimic is None or fixed_at(joint) is not None:
            continue
        ratio = number(mimic, "multiplier", f"{field}.mimic", 1.0)
        found[name] = Mimic(mimic.get("joint", ""), ratio, number(mimic, "offset", f"{field}.mimic", 0.0))
    return found


def resting(name: str, joints: Mapping[str, ET.Element], mimics: Mapping[str, Mimic]) -> float:
    """Value of a joint where the one that it follows in the end is at zero, or at the limit next to zero."""
    passed = [name]
    while passed[-1] in mimics:
        leader = mimics[passed[-1]].joint
        if leader in passed:
            refuse(f"joint[{name}].mimic.joint", leader, f"must not lead back ({' -> '.join([*passed, leader])})")
        passed.append(leader)
    value = 0.0
    if passed[-1] in joints:
        lower, upper = limits(joints[passed[-1]])
        fixed = fixed_at(joints[passed[-1]])
        value = min(max(0.0, lower), upper) if fixed is None else fixed
    for each in reversed(passed[:-1]):
        value = mimics[each].ratio * value + mimics[each].offset
    return value
