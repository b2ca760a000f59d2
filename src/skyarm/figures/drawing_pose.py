"""The pose in which a vehicle is drawn, and what of it is measured: joints, frames and lengths in the world."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.drawing.poses import body_poses
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle

Array = npt.NDArray[np.float64]

BENT = 0.5
"""rad: angle of the joints whose motion the side view shows."""

UPRIGHT = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class DrawnFrame:
    """Axes to draw: a name, their origin (3,), m, and R (3, 3), whose columns are x, y and z in the world."""

    name: str
    at: Array
    R: Array


@dataclass(frozen=True, slots=True)
class DrawnJoint:
    """A joint to draw.

    Attributes:
        name: as in the vehicle. revolute: it turns; else it slides. value: rad or m.
        at: origin (3,), m. axis: unit vector (3,) of positive motion. zero: (3,) where its rod would point at zero, m;
            of no length where its link carries nothing.
    """

    name: str
    revolute: bool
    value: float
    at: Array
    axis: Array
    zero: Array


@dataclass(frozen=True, slots=True)
class Rod:
    """A length to write: from one joint to the next joint or frame, both (3,), m."""

    start: Array
    end: Array


@dataclass(frozen=True, slots=True)
class Posed:
    """A vehicle in a pose, level, its base at the world's origin.

    Attributes:
        poses: body -> (R_WB, p_WB). frames: base first, then the named ones. joints, rods: in their order.
        reach: the longest distance from the base to anything that is named, m.
    """

    poses: dict[int, tuple[Array, Array]]
    frames: tuple[DrawnFrame, ...]
    joints: tuple[DrawnJoint, ...]
    rods: tuple[Rod, ...]
    reach: float


def drawing_angles(vehicle: Vehicle) -> tuple[float, ...]:
    """Joint values for a drawing: BENT where the axis lies across the side view at zero, else zero; within limits."""
    level = _at_origin(vehicle, [0.0] * vehicle.n)
    found = []
    for i, link in enumerate(vehicle.links):
        axis = level[i][0] @ np.array([float(c) for c in link.joint.axis])
        wanted = BENT if link.joint.kind == "revolute" and abs(axis[1]) > 0.9 else 0.0
        found.append(min(max(wanted, float(link.joint.lower)), float(link.joint.upper)))
    return tuple(found)


def pose(vehicle: Vehicle, joints: Sequence[float] | None = None) -> Posed:
    """A vehicle as it is drawn.

    Args:
        vehicle: with concrete numbers.
        joints: rad or m; :func:`drawing_angles` if left out.

    Raises:
        ValueError: one line: another number of joints.
    """
    values = drawing_angles(vehicle) if joints is None else tuple(float(q) for q in joints)
    if len(values) != vehicle.n:
        raise ValueError(f"joints = {list(values)}: must be {vehicle.n} numbers, one a joint of {vehicle.name}")
    poses = _at_origin(vehicle, values)
    frames = [DrawnFrame("base", poses[BASE][1], poses[BASE][0])]
    for frame in vehicle.frames:
        R, p = poses[frame.link]
        local = np.array([[float(c) for c in row] for row in frame.rotation.rows])
        frames.append(DrawnFrame(frame.name, p + R @ _vector(frame.position), R @ local))
    drawn = tuple(_joint(vehicle, i, values, poses) for i in range(vehicle.n))
    points = [frame.at for frame in frames] + [joint.at for joint in drawn]
    points += [_vector(rotor.position) for rotor in vehicle.rotors]
    rods = tuple(Rod(poses[i][1], end) for i in range(len(vehicle.moving)) for end in _ends(vehicle, i, poses))
    return Posed(poses, tuple(frames), drawn, rods, max(float(np.linalg.norm(each)) for each in points) or 0.1)


def _joint(vehicle: Vehicle, i: int, values: Sequence[float], poses: dict[int, tuple[Array, Array]]) -> DrawnJoint:
    joint = vehicle.links[i].joint
    R, p = poses[i]
    axis = R @ _vector(joint.axis)
    ends = _ends(vehicle, i, poses)
    rod = ends[0] - p if ends else np.zeros(3)
    if joint.kind == "revolute":
        # the rod turned back by the joint's own angle
        back = -values[i]
        along = axis * (axis @ rod)
        rod = along + math.cos(back) * (rod - along) + math.sin(back) * np.cross(axis, rod)
    return DrawnJoint(joint.name, joint.kind == "revolute", values[i], p, axis, rod)


def _ends(vehicle: Vehicle, i: int, poses: dict[int, tuple[Array, Array]]) -> list[Array]:
    """Joints and frames that a link carries away from its own joint."""
    R, p = poses[i]
    found = [R @ _vector(other.joint.position) for other in vehicle.moving if other.parent == i]
    found += [R @ _vector(frame.position) for frame in vehicle.frames if frame.link == i]
    return [p + each for each in found if np.linalg.norm(each) > 1e-6]


def _at_origin(vehicle: Vehicle, joints: Sequence[float]) -> dict[int, tuple[Array, Array]]:
    """Body -> (R_WB, p_WB) of a level base at the origin."""
    found = body_poses(vehicle, np.zeros((1, 3)), np.array([UPRIGHT]), np.array([joints], dtype=float))
    return {body: (R[0], p[0]) for body, (R, p) in found.items()}


def _vector(v: Iterable[Any]) -> Array:
    return np.array([float(c) for c in v])
