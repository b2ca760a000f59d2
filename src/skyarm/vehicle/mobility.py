"""Does every joint move mass? A joint that moves none makes the mass matrix singular: its acceleration is not defined.

A link whose inertia is positive definite always passes. Only vehicles with point masses, thin rods, planar links or
massless links are tested, by eliminating joint after joint from the tips to the base at a few joint values.
Source: Featherstone 2008, section 7.3 (articulated inertia), in 6x6 matrices; angular components first.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from skyarm.algebra import Mat3, Vec3
from skyarm.records.coerce import concrete

if TYPE_CHECKING:
    from skyarm.vehicle.linkage import Body, Joint
    from skyarm.vehicle.vehicle_records import Vehicle

SINGULAR = 1e-12
"""Moved inertia, relative to that of the outer bodies, below which nothing is left but rounding (1e-16 times a few)."""

GOLDEN = 0.6180339887498949


def what_does_not_move(value: Vehicle) -> tuple[str, Any, str] | None:
    """Field, value and what is allowed where a motion moves no mass at the joint values tried; None if all do."""
    found = immobile(value) if concrete(*_rigid_numbers(value)) else None
    if found is None:
        return None
    field, joints = found
    if field != "base.inertia":
        at = ", ".join(f"{q:g}" for q in joints)
        return (
            field,
            _describe(value, field),
            f"must move mass outward of it (the mass matrix is singular at joint values [{at}])",
        )
    if value.base.mass > 0 and _definite(value.base):
        # the base alone moves along and about every axis: only rounding hides that
        allowed = "must not hide the base's inertia (the mass matrix is singular to rounding or overflows)"
        return "base.mass", value.base.mass, allowed
    allowed = "must leave no axis without inertia (the mass matrix of the whole vehicle is singular)"
    return field, _describe(value, field), allowed


def immobile(vehicle: Vehicle) -> tuple[str, tuple[float, ...]] | None:
    """First field found whose motion moves no mass, with the joint values; None if the mass matrix is regular.

    All numbers of the vehicle must be concrete.
    """
    if all(_solid(body) for body in vehicle.bodies):
        return None
    import numpy as np

    for turn in range(3):
        joints = tuple(_joint_value(link.joint, turn, index) for index, link in enumerate(vehicle.links))
        with np.errstate(all="ignore"):  # absurd masses overflow; their flight ends as diverged
            found = _eliminate(vehicle, joints)
        if found:
            return found, joints
    return None


def _solid(body: Body) -> bool:
    """Positive mass and an inertia that is positive definite."""
    import numpy as np

    moments = np.linalg.eigvalsh(_matrix(body.inertia.full()))
    return bool(body.mass > 0 and moments[0] > 1e-9 * moments[2])


def _joint_value(joint: Joint, turn: int, index: int) -> float:
    """Zero (or the limit next to it) first, then values without any symmetry."""
    free = 0.0 if turn == 0 else 0.2 + ((turn * 7 + index * 3 + 1) * GOLDEN) % 1.0
    lower, upper = _numbers(joint.lower, joint.upper)
    return min(max(free, lower), upper)


def _eliminate(vehicle: Vehicle, joints: Sequence[float]) -> str:
    """Field of the first degree of freedom, from the tips, that moves no inertia; empty if there is none."""
    import numpy as np

    whole = [rigid_inertia(body) for body in vehicle.bodies]
    left = [inertia.copy() for inertia in whole]
    for k in reversed(range(len(vehicle.followers))):
        # what follows is looked at as fixed where it is: it can only move more than that
        each = vehicle.followers[k]
        X = _to_child(each.link.joint, float(each.ratio) * joints[each.leader] + float(each.offset))
        for inertias in (whole, left):
            inertias[each.link.parent + 1] += X.T @ inertias[vehicle.n + k + 1] @ X
    for i in reversed(range(vehicle.n)):
        joint, outer, S = vehicle.links[i].joint, whole[i + 1], _direction(vehicle.links[i].joint)
        size = np.trace(outer[:3, :3]) if joint.kind == "revolute" else outer[3, 3]
        moved = float(S @ outer @ S) + float(joint.armature)
        size = size + float(joint.armature)
        if not moved > SINGULAR * size or not pivot_into_parent(vehicle, i, joints[i], whole, left) > SINGULAR * moved:
            return f"joints[{joint.name}]"
    diagonal = np.diag(left[0])
    if not np.all(diagonal > 0.0):
        return "base.inertia"
    scale = 1.0 / np.sqrt(diagonal)
    try:
        smallest = float(np.linalg.eigvalsh(left[0] * np.outer(scale, scale))[0])
    except np.linalg.LinAlgError:  # numbers that overflowed
        smallest = math.nan
    return "" if smallest > SINGULAR else "base.inertia"


def pivot_into_parent(vehicle: Vehicle, i: int, value: float, whole: list[Any], left: list[Any]) -> float:
    """Articulated inertia about joint ``i`` with the joints outward of it free; adds its link to the parent.

    Args:
        vehicle: its links.
        i: index of the joint; those outward of it are done.
        value: of this joint, rad or m.
        whole: 6x6 inertias of base and links with all joints locked, changed in place.
        left: the same with the joints outward of each body free, changed in place.
    """
    import numpy as np

    link = vehicle.links[i]
    X, S = _to_child(link.joint, value), _direction(link.joint)
    U = left[i + 1] @ S
    pivot = float(S @ U) + float(link.joint.armature)
    if pivot > 0.0:
        left[link.parent + 1] += X.T @ (left[i + 1] - np.outer(U, U) / pivot) @ X
    whole[link.parent + 1] += X.T @ whole[i + 1] @ X
    return pivot


def joint_mobility(vehicle: Vehicle) -> list[Any]:
    """Joint accelerations per joint effort, (n, n), at six configurations within the limits; NaN if undefined.

    The block of the joints in the inverse of the mass matrix, with all that is not a joint free to move.
    """
    import numpy as np

    found = []
    for turn in range(6):
        J = [np.eye(6, 6 + vehicle.n)]
        M = J[0].T @ rigid_inertia(vehicle.base) @ J[0]
        for i, link in enumerate(vehicle.links):
            value = _joint_value(link.joint, turn, i)
            columns = _to_child(link.joint, value) @ J[link.parent + 1]
            columns[:, 6 + i] += _direction(link.joint)
            J.append(columns)
            M += columns.T @ rigid_inertia(link.body) @ columns
            M[6 + i, 6 + i] += float(link.joint.armature)
        for each in vehicle.followers:
            leader = _joint_value(vehicle.links[each.leader].joint, turn, each.leader)
            X = _to_child(each.link.joint, float(each.ratio) * leader + float(each.offset))
            columns = X @ J[each.link.parent + 1]
            columns[:, 6 + each.leader] += float(each.ratio) * _direction(each.link.joint)
            J.append(columns)
            M += columns.T @ rigid_inertia(each.link.body) @ columns
        with np.errstate(all="ignore"):
            try:
                found.append(np.linalg.inv(M)[6:, 6:])
            except np.linalg.LinAlgError:
                found.append(np.full((vehicle.n, vehicle.n), np.nan))
    return found


def _numbers(*values: Any) -> list[float]:
    return [float(value) for value in values]


def _matrix(m: Mat3) -> Any:
    import numpy as np

    return np.array([list(row) for row in m.rows], dtype=float)


def rigid_inertia(body: Body) -> Any:
    """6x6 inertia about the link's origin."""
    import numpy as np

    S = _matrix(Mat3.cross(body.com))
    (m,) = _numbers(body.mass)
    return np.block([[_matrix(body.inertia.full()) - m * S @ S, m * S], [-m * S, m * np.eye(3)]])


def _direction(joint: Joint) -> Any:
    import numpy as np

    axis = _numbers(*joint.axis)
    return np.array([*axis, 0.0, 0.0, 0.0] if joint.kind == "revolute" else [0.0, 0.0, 0.0, *axis])


def _to_child(joint: Joint, value: float) -> Any:
    """6x6 map of a motion at the parent's origin to the child's."""
    import numpy as np

    R, p = _matrix(joint.rotation), np.array(_numbers(*joint.position))
    axis = Vec3(*_numbers(*joint.axis))
    if joint.kind == "revolute":
        K = _matrix(Mat3.cross(axis))
        R = R @ (np.eye(3) + math.sin(value) * K + (1.0 - math.cos(value)) * K @ K)
    else:
        p = p + R @ np.array(list(axis)) * value
    return np.block([[R.T, np.zeros((3, 3))], [-R.T @ _matrix(Mat3.cross(Vec3(*p))), R.T]])


def _definite(value: Body) -> bool:
    """True if the body resists turning about every axis."""
    import numpy as np

    return bool(np.linalg.eigvalsh(np.array([list(row) for row in value.inertia.full().rows], dtype=float))[0] > 0.0)


def _describe(value: Vehicle, field: str) -> str:
    """Words for the link or the base of a refused field."""
    for link in value.links:
        if field == f"joints[{link.joint.name}]":
            return f"{link.joint.kind} joint of '{link.name}', mass {link.body.mass} kg"
    return f"base of {value.base.mass} kg"


def _rigid_numbers(value: Vehicle) -> list[Any]:
    """Every number that the mass matrix depends on."""
    found: list[Any] = []
    for each in value.bodies:
        found += [each.mass, *each.com, *each.inertia.entries]
    for follower in value.followers:
        found += [follower.ratio, follower.offset]
    for link in value.moving:
        joint_ = link.joint
        found += [*joint_.axis, *joint_.position, *(c for row in joint_.rotation.rows for c in row)]
        found += [joint_.lower, joint_.upper, joint_.armature]
    return found
