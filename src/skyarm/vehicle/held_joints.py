"""Joints held at a value: their links become part of what carries them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TypeVar

from skyarm.vehicle import description
from skyarm.vehicle.attach import RigidBodies, at_origin, follow, held_pose, posed_in
from skyarm.vehicle.linkage import BASE, Body, Link
from skyarm.vehicle.vehicle_records import Frame, Look

Posed = TypeVar("Posed", Frame, Look)


def hold_joints(bodies: RigidBodies, values: Mapping[str, float]) -> RigidBodies:
    """Bodies in which some joints stand still for good: each link joins its parent and stays as a frame.

    Args:
        bodies: bodies, joints and frames.
        values: name of a joint -> its constant value, rad or m. Joints that follow it are held where it puts them.
    """
    if not values:
        return bodies
    held = dict(values)
    for name in bodies.mimics:
        leader = follow(name, bodies.mimics)
        if leader.joint in values:
            held.setdefault(name, leader.ratio * values[leader.joint] + leader.offset)
    seats = {BASE: at_origin()}
    links: list[Link] = []
    parts: list[list[Body]] = [[bodies.base]]
    frames: list[Frame] = []
    for index, link in enumerate(bodies.links):
        joint = link.joint
        at = posed_in(seats[link.parent], joint.rotation, joint.position, link.name)
        if joint.name in held:
            seat = posed_in(at, *held_pose(joint.kind, joint.axis, held[joint.name]), link.name)
            parts[seat.link + 1].append(link.body.transform(seat.rotation, seat.position))
            frames.append(seat)
        else:
            seat = at_origin(len(links))
            parts.append([link.body])
            links.append(
                replace(link, parent=at.link, joint=replace(joint, position=at.position, rotation=at.rotation))
            )
        seats[index] = seat

    def move(frame: Posed) -> Posed:
        at = posed_in(seats[frame.link], frame.rotation, frame.position)
        return replace(frame, link=at.link, position=at.position, rotation=at.rotation)

    base, *others = (description.body(each) for each in parts)
    return replace(
        bodies,
        base=base,
        links=tuple(replace(link, body=body) for link, body in zip(links, others, strict=True)),
        frames=(*map(move, bodies.frames), *frames),
        looks=tuple(map(move, bodies.looks)),
        mimics={name: each for name, each in bodies.mimics.items() if name not in held},
        drives={name: each for name, each in bodies.drives.items() if name not in held},
        faults={fault: joints - held.keys() for fault, joints in bodies.faults.items() if joints - held.keys()},
    )
