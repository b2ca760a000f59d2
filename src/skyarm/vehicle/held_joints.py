"""Joints held at a value: their links become part of what carries them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from skyarm.vehicle.attach import (
    BodyTree,
    Notes,
    RigidBodies,
    at_origin,
    follow,
    held_pose,
    moved_into,
    posed_in,
)
from skyarm.vehicle.linkage import BASE


def hold_joints(bodies: RigidBodies, values: Mapping[str, float]) -> RigidBodies:
    """Bodies in which some joints stand still for good: each link joins its parent and
    stays as a frame.

    Args:
        bodies: bodies, joints and frames.
        values: name of a joint -> its constant value, rad or m. Joints that follow it
            are held where it puts them.
    """
    if not values:
        return bodies
    held = dict(values)
    for name in bodies.mimics:
        # a follower that the file holds by a value of its own keeps that one
        leader = follow(name, bodies.mimics)
        if leader.joint in values:
            held.setdefault(name, leader.ratio * values[leader.joint] + leader.offset)
    tree = BodyTree({}, Notes())
    seats = {BASE: at_origin()}
    tree.add_body(seats[BASE], bodies.base)
    for index, link in enumerate(bodies.links):
        joint = link.joint
        at = posed_in(seats[link.parent], joint.rotation, joint.position)
        # the held link's mass joins the nearest body that still moves
        if joint.name in held:
            seat = posed_in(
                at, *held_pose(joint.kind, joint.axis, held[joint.name]), link.name
            )
            tree.frames.append(seat)
        else:
            seat = tree.add_link(
                link.name,
                at.link,
                replace(joint, position=at.position, rotation=at.rotation),
            )
        tree.add_body(seat, link.body)
        seats[index] = seat
    made = tree.bodies(bodies.name, bodies.root, coupled=False)
    return replace(
        bodies,
        base=made.base,
        links=made.links,
        frames=(
            *(moved_into(seats[each.link], each) for each in bodies.frames),
            *made.frames,
        ),
        looks=tuple(moved_into(seats[each.link], each) for each in bodies.looks),
        mimics={name: each for name, each in bodies.mimics.items() if name not in held},
        drives={name: each for name, each in bodies.drives.items() if name not in held},
        faults={
            # a fault stays as long as one of its joints is free
            fault: joints - held.keys()
            for fault, joints in bodies.faults.items()
            if joints - held.keys()
        },
    )
