"""Links whose joints follow others are taken out of a tree: the coordinates that are left are those of the leaders."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.records.coerce import concrete
from skyarm.scalars import add, mul
from skyarm.vehicle.check import refuse
from skyarm.vehicle.linkage import Follower, Joint, Link
from skyarm.vehicle.notes import Notes
from skyarm.vehicle.vehicle_records import Frame

PLAIN = ("damping", "coulomb", "armature", "stop_stiffness", "stop_damping")


@dataclass(frozen=True, slots=True)
class Mimic:
    """What a file says of a joint that follows: q = ratio q_joint + offset.

    Attributes:
        joint: name of the joint that it follows, which may follow another one.
        ratio, offset: rad or m.
    """

    joint: str
    ratio: float = 1.0
    offset: float = 0.0


def couple(
    links: Sequence[Link], frames: Sequence[Frame], mimics: Mapping[str, Mimic]
) -> tuple[tuple[Link, ...], tuple[Follower, ...], tuple[Frame, ...]]:
    """Links with joints of their own, followers, and the frames with the new indices of both.

    Damping and armature of a follower's joint are felt at its leader, by the square of the ratio; its dry friction by
    the ratio, at the leader's own rate. Its limits narrow those of its leader; where they would leave it no range, as
    in files whose limits forget a sign, the leader keeps its own (:func:`limits_that_contradict`).

    Args:
        links: in an order in which parents precede children.
        frames: fixed to them.
        mimics: name of a joint -> what it follows.

    Raises:
        VehicleError: a joint that is not there, a ring, or a link with a joint of its own on a follower.
    """
    if not mimics:
        return tuple(links), (), tuple(frames)
    whole = {link.joint.name: resolve(link.joint.name, mimics, links) for link in links if link.joint.name in mimics}
    free = [i for i, link in enumerate(links) if link.joint.name not in whole]
    tied = [i for i, link in enumerate(links) if link.joint.name in whole]
    place = {old: new for new, old in enumerate([*free, *tied])} | {-1: -1}
    joints = {links[i].joint.name: links[i].joint for i in free}
    followers = []
    for i in tied:
        mimic, joint = whole[links[i].joint.name], links[i].joint
        joints[mimic.joint] = _narrowed(_with_friction(joints[mimic.joint], joint, mimic.ratio), joint, mimic)
        nothing: dict[str, Any] = dict.fromkeys(PLAIN, 0)
        plain = dataclasses.replace(joint, **nothing)
        link = dataclasses.replace(links[i], parent=place[links[i].parent], joint=plain)
        leader = next(k for k, old in enumerate(free) if links[old].joint.name == mimic.joint)
        followers.append(Follower(link=link, leader=leader, ratio=mimic.ratio, offset=_structure(mimic.offset)))
    kept = []
    for i in free:
        if place[links[i].parent] >= len(free):
            name = links[links[i].parent].name
            refuse(f"joint[{links[i].joint.name}].parent", name, "must not follow another joint; lock it instead")
        kept.append(dataclasses.replace(links[i], parent=place[links[i].parent], joint=joints[links[i].joint.name]))
    moved = tuple(dataclasses.replace(frame, link=place[frame.link]) for frame in frames)
    return tuple(kept), tuple(followers), moved


def resolve(name: str, mimics: Mapping[str, Mimic], links: Sequence[Link]) -> Mimic:
    """What a joint follows in the end, through joints that follow themselves."""
    known = [link.joint.name for link in links]
    passed, ratio, offset = [name], 1.0, 0.0
    while passed[-1] in mimics:
        mimic = mimics[passed[-1]]
        if mimic.joint not in known:
            refuse(f"joint[{passed[-1]}].mimic.joint", mimic.joint, f"must be one of {', '.join(known)}")
        ratio, offset = ratio * mimic.ratio, offset + ratio * mimic.offset
        if mimic.joint in passed:
            ring = " -> ".join([*passed, mimic.joint])
            refuse(f"joint[{name}].mimic.joint", mimic.joint, f"must not lead back ({ring})")
        passed.append(mimic.joint)
    if ratio == 0.0:
        refuse(f"joint[{name}].mimic.ratio", ratio, "must not be 0; a joint that never moves is fixed")
    return Mimic(passed[-1], ratio, offset)


def _with_friction(leader: Joint, follower: Joint, ratio: float) -> Joint:
    """A leader that feels its follower's drive."""
    values: dict[str, Any] = {}
    for name, by in (("damping", ratio * ratio), ("armature", ratio * ratio), ("coulomb", abs(ratio))):
        more = getattr(follower, name)
        if not (type(more) is int and more == 0):
            values[name] = add(getattr(leader, name), mul(by, more))
    return dataclasses.replace(leader, **values) if values else leader


def _range_of_leader(leader: Joint, follower: Joint, ratio: Any, offset: Any) -> tuple[Any, Any] | None:
    """Values of a leader with which both joints are within their limits; None where there are none."""
    if not concrete(leader.lower, leader.upper, follower.lower, follower.upper, ratio, offset):
        return leader.lower, leader.upper
    first, last = sorted(((follower.lower - offset) / ratio, (follower.upper - offset) / ratio))
    low, high = max(leader.lower, first), min(leader.upper, last)
    return (low, high) if low < high else None


def _narrowed(leader: Joint, follower: Joint, mimic: Mimic) -> Joint:
    found = _range_of_leader(leader, follower, mimic.ratio, mimic.offset)
    if found is None or found == (leader.lower, leader.upper):
        return leader
    return dataclasses.replace(leader, lower=found[0], upper=found[1])


def limits_that_contradict(links: Sequence[Link], followers: Sequence[Follower]) -> tuple[str, ...]:
    """A note on the followers whose limits leave their leaders no range, and so do not count."""
    notes = Notes()
    for each in followers:
        if _range_of_leader(links[each.leader].joint, each.link.joint, each.ratio, each.offset) is None:
            notes.add("has limits that leave the joint it follows no range; they do not count", each.link.joint.name)
    return notes.lines()


def _structure(value: float) -> Any:
    return 0 if value == 0.0 else value
