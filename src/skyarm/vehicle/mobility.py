"""Regularity of the mass matrix: a joint that moves no mass makes the matrix singular.

A link whose inertia is positive definite always passes. Only vehicles with point
masses, thin rods, planar links or massless links are tested, by eliminating joint after
joint from the tips to the base at a few joint values.
Source: Featherstone 2008, section 7.3 (articulated inertia), in 6x6 matrices; angular
components first.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from skyarm.algebra import Mat3, Vec3
from skyarm.records.arrays import Array, doubles, float_array
from skyarm.records.coerce import concrete
from skyarm.records.leaves import leaves
from skyarm.vehicle.check import principal_moments
from skyarm.vehicle.linkage import Body, Joint, Linkage

SINGULAR = 1e-12
"""Moved inertia over that of the outer bodies below which the remainder is rounding
(1e-16 times a few)."""

ALIKE = 1e-6
"""Relative difference of mobilities up to which they are those of mirrored joints;
rounding is far below."""

GOLDEN = 0.6180339887498949
"""Golden ratio less 1, whose multiples modulo 1 spread most evenly."""


def what_does_not_move(value: Linkage) -> tuple[str, Any, str] | None:
    """Error (field, value, requirement) about a joint or base that moves no mass; None
    if each moves mass.
    """
    first = immobile(value) if concrete(*_rigid_numbers(value)) else None
    if first is None:
        return None
    field, joints = first
    if field != "base.inertia":
        at = ", ".join(f"{q:g}" for q in joints)
        return (
            field,
            # a free joint or base that moves nothing needs words of its own, for no
            # drive cures it
            _describe(value, field),
            "must move mass outward of it (the mass matrix is singular at joint values"
            f" [{at}]), or its drive "
            f'must have inertia: [[joints]] name = "{field[len("joints[") : -1]}",'
            " armature = 1e-4 beside another file",
        )
    if value.base.mass > 0 and principal_moments(value.base.inertia)[0] > 0.0:
        # the base alone moves along and about every axis: only rounding hides that
        allowed = (
            "must not hide the base's inertia (the mass matrix is singular to rounding"
            " or overflows)"
        )
        return "base.mass", value.base.mass, allowed
    allowed = (
        "must leave no axis without inertia (the mass matrix of the whole vehicle is"
        " singular)"
    )
    return field, _describe(value, field), allowed


def immobile(vehicle: Linkage) -> tuple[str, tuple[float, ...]] | None:
    """First joint (or base) that moves no mass, and the tested joint values; None if
    each moves mass.

    All numbers of the vehicle must be concrete.
    """
    if all(map(_solid, vehicle.bodies)):
        return None
    # three postures, because a joint may move nothing in one of them only, as a
    # straight arm
    for turn in range(3):
        joints = _joint_values(vehicle, turn)
        # absurd masses overflow; their flight ends as diverged
        with np.errstate(all="ignore"):
            field = _eliminate(vehicle, joints)
        if field:
            return field, joints
    return None


def _joint_values(vehicle: Linkage, turn: int) -> tuple[float, ...]:
    return tuple(
        _joint_value(link.joint, turn, index)
        for index, link in enumerate(vehicle.links)
    )


def _solid(body: Body) -> bool:
    """True if a body has positive mass and a positive definite inertia."""
    moments = principal_moments(body.inertia)
    # relative to the largest moment: a thin rod must not count as solid by rounding
    return bool(body.mass > 0 and moments[0] > 1e-9 * moments[2])


def _joint_value(joint: Joint, turn: int, index: int) -> float:
    """Value of a joint in a test posture: zero (or the nearest limit) in posture 0,
    irregular in the others.
    """
    # multiples of the golden ratio never repeat, so no posture is symmetric by chance
    free = 0.0 if turn == 0 else 0.2 + ((turn * 7 + index * 3 + 1) * GOLDEN) % 1.0
    # 0.2 to 1.2 and the steps 7 and 3 are chosen: values away from zero, another one
    # for each joint
    lower, upper = joint.ends
    return min(max(free, lower), upper)


def mass_matrix(vehicle: Linkage, joints: Sequence[float]) -> tuple[Any, list[Any]]:
    """Mass matrix of base (rotation first) and joints, and the 6 x (6 + n) Jacobian of
    each body in its axes.
    """
    J = [np.eye(6, 6 + vehicle.n)]
    M = J[0].T @ rigid_inertia(vehicle.base) @ J[0]
    rows = [(link, joints[i], 1.0, i) for i, link in enumerate(vehicle.links)]
    for each in vehicle.followers:
        ratio = float(each.ratio)
        rows.append(
            (
                each.link,
                ratio * joints[each.leader] + float(each.offset),
                ratio,
                each.leader,
            )
        )
    for link, value, ratio, i in rows:
        columns = _to_child(link.joint, value) @ J[link.parent + 1]
        columns[:, 6 + i] += ratio * _direction(link.joint)
        J.append(columns)
        M += columns.T @ rigid_inertia(link.body) @ columns
        # armature resists the joint's rate against its parent, hence only the diagonal
        M[6 + i, 6 + i] += float(link.joint.armature)
    return M, J


def _eliminate(vehicle: Linkage, joints: Sequence[float]) -> str:
    """Find the outermost joint (or base) that moves no mass by elimination in the mass
    matrix; empty if none.

    The pivot of a joint in the mass matrix is the articulated inertia about it: with
    the joints after it free.
    """
    M, J = mass_matrix(vehicle, joints)
    inertias = [rigid_inertia(body) for body in vehicle.bodies]
    moved = np.diag(M).copy()
    # from the tips inwards, so each pivot is the inertia with the outer joints free
    for k in reversed(range(6, len(M))):
        joint = vehicle.links[k - 6].joint
        size = float(joint.armature)
        # the inertia about the joint or more, as a trace exceeds every moment; rounding
        # is a share of it
        for inertia, columns in zip(inertias, J, strict=True):
            turn, slide = columns[:3, k], columns[3:, k]
            size += np.trace(inertia[:3, :3]) * (turn @ turn) + inertia[3, 3] * (
                slide @ slide
            )
        # both: moved against what the bodies alone have, and the pivot against what is
        # left of it
        if not moved[k] > SINGULAR * size or not M[k, k] > SINGULAR * moved[k]:
            return f"joints[{joint.name}]"
        # Schur complement: the outer joint is eliminated
        M = M[:k, :k] - np.outer(M[:k, k], M[:k, k]) / M[k, k]
    diagonal = np.diag(M)
    if not np.all(diagonal > 0.0):
        return "base.inertia"
    # scaled to a unit diagonal, because kg and kg m^2 differ by orders of magnitude
    scale = 1.0 / np.sqrt(diagonal)
    try:
        smallest = float(np.linalg.eigvalsh(M * np.outer(scale, scale))[0])
    except np.linalg.LinAlgError:  # numbers that overflowed
        smallest = math.nan
    return "" if smallest > SINGULAR else "base.inertia"


def joint_mobility(vehicle: Linkage) -> Array:
    """Matrices (6, n, n) of joint acceleration per joint effort, at six configurations
    within limits; NaN if undefined.

    The block of the joints in the inverse of the mass matrix, with all that is not a
    joint free to move.
    """
    # six postures, more than the three of the test: the largest mobility sets stiffness
    # and friction
    masses = [
        mass_matrix(vehicle, _joint_values(vehicle, turn))[0] for turn in range(6)
    ]
    with np.errstate(all="ignore"):
        try:
            return doubles(np.linalg.inv(masses)[:, 6:, 6:])
        except np.linalg.LinAlgError:
            # a matrix that has no inverse shows as NaN, as one that is not finite does
            return np.full((6, vehicle.n, vehicle.n), np.nan)


def of_mirrored(values: Array, mobilities: Array) -> Array:
    """Largest of the values (..., n) among joints of one mobility at rest, thus one
    number for mirrored joints.

    Sampled configurations are no mirror images of each other; that at rest, zero or the
    nearest limits, is its own.

    Args:
        values: one per joint, or rows of them.
        mobilities: (S, n, n) at the sampled configurations, that at rest first.
    """
    still = mobilities[0].diagonal()
    alike = np.isclose(still[:, None], still, rtol=ALIKE, atol=0.0)
    return doubles(np.where(alike, values[..., None, :], 0.0).max(axis=-1, initial=0.0))


def _matrix(m: Mat3) -> Array:
    # of lists, which NumPy reads in a third of the time of vectors
    return doubles([list(row) for row in m.rows])


def rigid_inertia(body: Body) -> Array:
    """Spatial inertia (6 x 6) of a body about its link's origin."""
    S = _matrix(Mat3.cross(body.com))
    m = float(body.mass)
    return np.block(
        # parallel axes: S is antisymmetric, so -m S S adds the distance from the origin
        [[_matrix(body.inertia.full()) - m * S @ S, m * S], [-m * S, m * np.eye(3)]]
    )


def _direction(joint: Joint) -> Array:
    still = (0.0, 0.0, 0.0)
    return float_array((*joint.axis, *still) if joint.turns else (*still, *joint.axis))


def _to_child(joint: Joint, value: float) -> Array:
    """Spatial transform (6 x 6) of a motion vector from the parent link's origin to the
    child link's.
    """
    R, p = _matrix(joint.rotation), float_array(joint.position)
    axis = Vec3(*map(float, joint.axis))
    if joint.turns:
        K = _matrix(Mat3.cross(axis))
        # Rodrigues' formula
        R = R @ (np.eye(3) + math.sin(value) * K + (1.0 - math.cos(value)) * K @ K)
    else:
        p = p + R @ np.array(list(axis)) * value
    return np.block(
        [[R.T, np.zeros((3, 3))], [-R.T @ _matrix(Mat3.cross(Vec3(*p))), R.T]]
    )


def _describe(value: Linkage, field: str) -> str:
    """Text that describes the joint or base that moves no mass, for an error
    message.
    """
    for link in value.links:
        if field == f"joints[{link.joint.name}]":
            return f"{link.joint.kind} joint of '{link.name}', mass {link.body.mass} kg"
    return f"base of {value.base.mass} kg"


def _rigid_numbers(value: Linkage) -> list[Any]:
    """All parameters of a vehicle on which its mass matrix depends."""
    joints = [
        (j.axis, j.position, j.rotation, j.lower, j.upper, j.armature)
        for j in (k.joint for k in value.moving)
    ]
    ties = [(each.ratio, each.offset) for each in value.followers]
    return leaves((value.bodies, tuple(joints), tuple(ties)))
