"""Kinematics of the links: joint placements, poses of links and frames."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from skyarm.algebra import ZERO3, Mat3, Motion, Scalar, Scalars, Vec3, axis_rotation
from skyarm.algebra.scalars import (
    add,
    data,
    divide,
    logical_and,
    mul,
    same,
    sqrt,
    where,
)
from skyarm.dynamics.state import State
from skyarm.records.immutable import positional
from skyarm.vehicle import BASE, Frame, Joint, Vehicle


@positional
class Pose:
    """Pose of a frame B in a frame A: rotation R_AB (B axes to A axes) and position
    p_AB (m, A axes).
    """

    R: Mat3
    p: Vec3

    def __matmul__(self, other: Pose) -> Pose:
        """Pose of a frame C in a frame A, from the poses of a frame B in A and of C in
        B.
        """
        return Pose(self.R @ other.R, self.p + self.R.apply(other.p))

    def apply(self, point: Vec3) -> Vec3:
        """Coordinates (m) in a frame A of a point given in a frame B."""
        return self.p + self.R.apply(point)


IDENTITY = Pose(Mat3.identity(), ZERO3)

IDENTITY_ROWS = [1, 0, 0, 0, 1, 0, 0, 0, 1]
"""Entries of the identity matrix, row by row."""


def joint_placement(joint: Joint, q: Scalar) -> Pose:
    """Pose of the child link in its parent at joint value ``q`` (rad or m)."""
    if joint.turns:
        return Pose(joint.rotation @ axis_rotation(joint.axis, q), joint.position)
    return Pose(joint.rotation, joint.position + joint.rotation.apply(joint.axis * q))


def link_poses(
    vehicle: Vehicle, joints: Sequence[Scalar], *, summed: bool = False
) -> list[Pose]:
    """Poses of all links in the base frame; those of coupled joints come last.

    ``summed`` turns a hinge that is parallel to its parent's by the sum of their
    angles: fewer operations, but other roundings.
    """
    if vehicle.followers:
        return link_poses(
            vehicle.with_free_followers, every_joint(vehicle, joints), summed=summed
        )
    poses: list[Pose] = []
    angles: list[Scalar] = []
    # rotation of each chain of parallel hinges before it turns
    straight: list[Mat3] = []
    for link, q in zip(vehicle.links, joints, strict=True):
        joint, parent = link.joint, link.parent
        if summed and parent != BASE and parallel(vehicle.links[parent].joint, joint):
            angle = add(angles[parent], q)
            before = straight[parent]
            pose = Pose(
                before @ axis_rotation(joint.axis, angle),
                poses[parent].apply(joint.position),
            )
        else:
            angle = q
            before = joint.rotation
            pose = joint_placement(joint, q)
            if parent != BASE:
                before = poses[parent].R @ before if summed else before
                pose = poses[parent] @ pose
        poses.append(pose)
        angles.append(angle)
        straight.append(before)
    return poses


def parallel(parent: Joint, child: Joint) -> bool:
    """True if two joints in succession are hinges with parallel axes."""
    # ints only: a float identity may vary from flight to flight
    entries = [entry for row in child.rotation.rows for entry in row]
    straight = all(type(entry) is int for entry in entries) and entries == IDENTITY_ROWS
    hinges = parent.turns and child.turns
    return hinges and straight and all(map(same, parent.axis, child.axis))


def frame_pose(
    vehicle: Vehicle, frame: Frame, joints: Sequence[Scalar], *, summed: bool = False
) -> Pose:
    """Pose of a frame in the base frame; ``summed`` adds the angles of parallel hinges
    to save operations.
    """
    local = Pose(frame.rotation, frame.position)
    return (
        local
        if frame.link == BASE
        else link_poses(vehicle, joints, summed=summed)[frame.link] @ local
    )


def jacobian_columns(
    vehicle: Vehicle, frame: Frame, joints: Sequence[Scalar], *, summed: bool = False
) -> list[Motion]:
    """Jacobian of a frame by the joint rates, one column per joint: angular and linear
    velocity, base axes.

    A joint that does not carry the frame gives a structural zero. ``summed`` as of
    :func:`link_poses`.
    """
    if vehicle.followers:
        free = vehicle.with_free_followers
        all_joints = every_joint(vehicle, joints)
        return columns_of_leaders(
            vehicle, jacobian_columns(free, frame, all_joints, summed=summed)
        )
    poses = link_poses(vehicle, joints, summed=summed)
    tip = (
        frame.position
        if frame.link == BASE
        else poses[frame.link].apply(frame.position)
    )
    # joints of other branches do not move the frame: zeros of structure
    columns = [Motion(ZERO3, ZERO3) for _ in vehicle.links]
    index = frame.link
    while index != BASE:
        link, pose = vehicle.links[index], poses[index]
        own = link.joint.motion_subspace
        turn = pose.R.apply(own.angular)
        columns[index] = Motion(
            turn, pose.R.apply(own.linear) + turn.cross(tip - pose.p)
        )
        index = link.parent
    return columns


def chain(vehicle: Vehicle, index: int) -> list[int]:
    """Indices of the joints from the base to a link."""
    indices: list[int] = []
    while index != BASE:
        # a follower moves by its leader's coordinate
        own = index < vehicle.n
        indices.insert(0, index if own else vehicle.followers[index - vehicle.n].leader)
        index = vehicle.moving[index].parent
    return indices


def every_joint(vehicle: Vehicle, joints: Sequence[Scalar]) -> Scalars:
    """Positions of all joints, coupled ones included, from those of the independent
    joints, rad or m.
    """
    return (
        *joints,
        *(
            add(mul(each.ratio, joints[each.leader]), each.offset)
            for each in vehicle.followers
        ),
    )


def every_rate(vehicle: Vehicle, rates: Sequence[Scalar]) -> Scalars:
    """First or second time derivatives of all joint positions, coupled ones
    included.
    """
    return (
        *rates,
        *(mul(each.ratio, rates[each.leader]) for each in vehicle.followers),
    )


def onto_leaders(vehicle: Vehicle, efforts: Sequence[Scalar]) -> Scalars:
    """Generalised forces of the independent joints, from the torques or forces of all
    joints.
    """
    # by virtual work: a follower moves ratio times as far as its leader
    forces = list(efforts[: vehicle.n])
    for each, effort in zip(vehicle.followers, efforts[vehicle.n :], strict=True):
        forces[each.leader] = add(forces[each.leader], mul(each.ratio, effort))
    return tuple(forces)


def columns_of_leaders(vehicle: Vehicle, columns: Sequence[Motion]) -> list[Motion]:
    """Jacobian columns of the independent joints, from those of all joints."""
    independent = list(columns[: vehicle.n])
    for each, column in zip(vehicle.followers, columns[vehicle.n :], strict=True):
        independent[each.leader] = independent[each.leader] + column * each.ratio
    return independent


def untie_followers(vehicle: Vehicle, state: State) -> tuple[Vehicle, State]:
    """Vehicle and state in which every coupled joint is an independent joint."""
    if not vehicle.followers:
        return vehicle, state
    joints = every_joint(vehicle, state.joints)
    rates = every_rate(vehicle, state.joint_rates)
    return vehicle.with_free_followers, dataclasses.replace(
        state, joints=joints, joint_rates=rates
    )


NEAREST = 1e-3
"""Distance (m) from an axis below which the radial direction is undefined."""


def out_of_axis(tip: Vec3, pivot: Vec3, axis: Vec3, grips: bool, normal: Vec3) -> Vec3:
    """Unit vector from a hinge axis to the tip while a handle is gripped, else the
    surface normal.

    Args:
        tip: m, world axes.
        pivot: m, on the axis.
        axis: its unit vector.
        grips: condition.
        normal: also where the tip is within ``NEAREST`` of the axis.
    """
    arm = tip - pivot
    out = arm - axis * axis.dot(arm)
    size = out.dot(out)
    # on the axis the direction would be noise, so the normal stands in
    # an axis of zeros has no direction out of it either: its square is the factor
    turns = logical_and(grips, size * axis.dot(axis) > NEAREST * NEAREST)
    # 1e-6 m keeps the unused branch finite on the axis
    unit = out * divide(1.0, sqrt(size + 1e-12))
    return Vec3(
        *(where(turns, data(a), data(b)) for a, b in zip(unit, normal, strict=True))
    )
