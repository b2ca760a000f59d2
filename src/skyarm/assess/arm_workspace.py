"""The places that the tip can reach, and whether every joint does something of its own."""

from __future__ import annotations

import numpy as np

from skyarm.assess.arm_poses import ArmPoses, Array
from skyarm.assess.finding import NOTE, OK, WARNING, Finding
from skyarm.assess.level_hover import columns
from skyarm.assess.mass_balance import disc_radius
from skyarm.dynamics.array_front import center_of_mass, frame_jacobian
from skyarm.dynamics.kinematics import Pose, link_poses
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle

NOTHING = 1e-9
"""m or m per rad below which a joint moves a point by rounding only."""

PROBED = 16
"""Poses in which Jacobians are looked at."""

SMALLEST_RANGE = {"revolute": 0.05, "prismatic": 0.005}
"""rad or m; fingers slide by some millimetres."""


def arm_workspace(vehicle: Vehicle, poses: ArmPoses) -> list[Finding]:
    """Box of the tip's places over all poses, joints without effect, and limits that look wrong."""
    if not vehicle.n:
        return []
    found = [*_ranges(vehicle)]
    if vehicle.end_effector and vehicle.frame().link != BASE:
        tips = tip_places(vehicle, poses.joints)
        ends, _ = poses.worst(lambda joints: np.vstack([tip_places(vehicle, joints).T, -tip_places(vehicle, joints).T]))
        low, high = (np.round(each, 9) + 0.0 for each in (ends[:3], -ends[3:]))
        box = ", ".join(f"{c} {a:.3g} ... {b:.3g}" for c, a, b in zip("xyz", low, high, strict=True))
        found.append(Finding(question="workspace", level=OK, text=f"tip in base axes: {box} m", field="frames"))
        if vehicle.rotors:
            found += _blades(vehicle, tips)
    return [*found, *_joints_without_effect(vehicle, poses)]


def tip_places(vehicle: Vehicle, joints: Array) -> Array:
    """Tip (lanes, 3) in base axes, m."""
    frame = vehicle.frame()
    place = link_poses(vehicle, columns(joints))[frame.link] @ Pose(frame.rotation, frame.position)
    return np.stack([np.broadcast_to(np.asarray(c, dtype=float), len(joints)) for c in place.p], axis=1)


def _ranges(vehicle: Vehicle) -> list[Finding]:
    found = []
    for link in vehicle.links:
        joint, name = link.joint, f"joints[{link.joint.name}]"
        width = float(joint.upper) - float(joint.lower)
        smallest = SMALLEST_RANGE[joint.kind]
        if width < smallest:
            text = f"moves by {width:.3g} only"
            remedy = f"check {name}.lower and {name}.upper (rad or m)"
            found.append(
                Finding(
                    question=f"range of {name}",
                    level=WARNING,
                    text=text,
                    field=f"{name}.lower",
                    value=width,
                    limit=smallest,
                    remedy=remedy,
                )
            )
        if not float(joint.lower) <= 0.0 <= float(joint.upper):
            text = f"zero is outside {float(joint.lower):g} ... {float(joint.upper):g}: a flight must state its start"
            found.append(Finding(question=f"range of {name}", level=NOTE, text=text, field=f"{name}.lower"))
    return found


def _blades(vehicle: Vehicle, tips: Array) -> list[Finding]:
    """Whether the tip can come into a rotor's disc."""
    radius = 0.8 * disc_radius(vehicle)
    for rotor in vehicle.rotors:
        away = tips - np.array([float(c) for c in rotor.position])
        axis = np.array([float(c) for c in rotor.axis])
        height = away @ axis
        beside = np.linalg.norm(away - height[:, None] * axis, axis=1)
        if np.any((np.abs(height) < 0.1 * radius) & (beside < radius)):
            text = f"the tip can come into the disc of rotors[{rotor.name}]: joint limits are up to whoever flies it"
            return [Finding(question="tip and rotors", level=NOTE, text=text, field="joints.lower, joints.upper")]
    return []


def _joints_without_effect(vehicle: Vehicle, poses: ArmPoses) -> list[Finding]:
    """Joints that move neither the tip nor the centre of mass, and pairs that do the same in every pose."""
    n, probed = vehicle.n, poses.joints[:PROBED]
    lanes = len(probed)
    still, level = np.zeros((lanes, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (lanes, 1))
    step = 1e-6
    moved = []
    for i in range(n):
        ends = [center_of_mass(vehicle, still, level, probed + sign * step * np.eye(n)[i]) for sign in (1.0, -1.0)]
        moved.append(np.linalg.norm(ends[0] - ends[1], axis=1).max() / (2.0 * step))
    tip = vehicle.frame() if vehicle.end_effector else None
    jacobian = None if tip is None else frame_jacobian(vehicle, still, level, probed)[:, :, 6:]
    found = []
    leaders = {each.leader for each in vehicle.followers}  # of fingers that close evenly nothing else moves
    for i, link in enumerate(vehicle.links):
        name = f"joints[{link.joint.name}]"
        turns = jacobian is not None and np.abs(jacobian[:, :3, i]).max() > NOTHING
        if moved[i] < 1e-7 and not turns and i not in leaders:
            text = f"{name} moves neither the tip nor the centre of mass: its axis lies along its own link"
            found.append(_axis(name, text))
        if jacobian is None:
            continue
        for j in range(i):
            if _same(jacobian[:, :, i], jacobian[:, :, j]):
                other = vehicle.links[j].joint.name
                found.append(
                    _axis(name, f"{name} and joints[{other}] move the tip alike in every pose: one axis twice")
                )
    return found


def _same(a: Array, b: Array) -> bool:
    """Whether two columns (lanes, 6) of Jacobians are parallel everywhere and not zero."""
    scales = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
    return bool(np.all(scales > NOTHING) and np.all(np.abs(np.sum(a * b, axis=1)) > (1.0 - 1e-12) * scales))


def _axis(name: str, text: str) -> Finding:
    remedy = f"check {name}.axis and {name}.position"
    return Finding(question=f"axis of {name}", level=WARNING, text=text, field=f"{name}.axis", remedy=remedy)
