"""Arms on an airframe: the bodies, joints and frames of one description at a link or a frame of another."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

from skyarm.algebra import Mat3, Vec3
from skyarm.vehicle import description
from skyarm.vehicle.bodies import RigidBodies
from skyarm.vehicle.check import refuse
from skyarm.vehicle.couple import Mimic
from skyarm.vehicle.linkage import BASE, Body, Link
from skyarm.vehicle.vehicle_records import Frame, Look, Vehicle


@dataclass(frozen=True, slots=True)
class Mount:
    """Where an arm's root link sits.

    Attributes:
        to: "base", the name of the airframe's root, of a link or of a frame.
        rotation, position: of the root link in the axes of that one, m.
        prefix: put before every name of the arm.
        field: of the vehicle file, for messages.
    """

    to: str
    rotation: Mat3
    position: Vec3
    prefix: str = ""
    field: str = "attach"


FrameOrLook = TypeVar("FrameOrLook", Frame, Look)


def place_in(bodies: RigidBodies, name: str, field: str) -> Frame:
    """Index of the moving body that carries a named link or frame, and the pose of that one in it."""
    names = [link.name for link in bodies.links]
    if name in ("base", bodies.root):
        return Frame(name=name, link=BASE, position=Vec3(0, 0, 0))
    if name in names:
        return Frame(name=name, link=names.index(name), position=Vec3(0, 0, 0))
    for frame in bodies.frames:
        if frame.name == name:
            return frame
    known = ["base", *names, *(frame.name for frame in bodies.frames)]
    refuse(field, name, f"must be one of {', '.join(known)}")


def posed_in(frame: Frame, R: Mat3, p: Vec3, name: str) -> Frame:
    """A frame at a pose in another one, in the moving body that carries both."""
    position = description.vector([float(c) for c in frame.position + frame.rotation.apply(p)])
    return Frame(name=name, link=frame.link, position=position, rotation=description.rotation(frame.rotation @ R))


def attach(airframe: RigidBodies, arm: RigidBodies, mount: Mount) -> RigidBodies:
    """Airframe and arm as one; the arm's root link becomes a part of the body that it sits on, and a frame.

    Args:
        airframe: with the arms that came before.
        arm: its root has neither a joint nor, in the result, a body of its own.
        mount: where.

    Raises:
        VehicleError: no such link, or a name that stands in both.
    """
    seat = posed_in(place_in(airframe, mount.to, f"{mount.field}.to"), mount.rotation, mount.position, "")
    named = _renamed(arm, mount.prefix)
    root = [] if named.root == "base" else [replace(seat, name=named.root)]
    _require_new_names(airframe, named, [frame.name for frame in root], mount)
    first = len(airframe.links)

    def moved(frame: FrameOrLook) -> FrameOrLook:
        if frame.link != BASE:
            return replace(frame, link=first + frame.link)
        at = posed_in(seat, frame.rotation, frame.position, frame.name)
        return replace(frame, link=at.link, position=at.position, rotation=at.rotation)

    def carried(link: Link) -> Link:
        if link.parent != BASE:
            return replace(link, parent=first + link.parent)
        at = posed_in(seat, link.joint.rotation, link.joint.position, "")
        return replace(link, parent=at.link, joint=replace(link.joint, position=at.position, rotation=at.rotation))

    load = Body(
        mass=named.base.mass,
        com=seat.position + seat.rotation.apply(named.base.com),
        inertia=named.base.inertia.rotated(seat.rotation),
        planar=named.base.planar,
    )
    base, links = airframe.base, list(airframe.links)
    if seat.link == BASE:
        base = description.body([base, load])
    else:
        links[seat.link] = replace(links[seat.link], body=description.body([links[seat.link].body, load]))
    return RigidBodies(
        airframe.name,
        airframe.root,
        base,
        (*links, *map(carried, named.links)),
        (*airframe.frames, *root, *map(moved, named.frames)),
        {**airframe.mimics, **named.mimics},
        (*airframe.notes, *(f"{arm.name}: {note}" for note in arm.notes)),
        (*airframe.looks, *map(moved, named.looks)),
    )


def bodies_of(vehicle: Vehicle) -> RigidBodies:
    """A vehicle's bodies without its rotors, its followers told as mimics."""
    leaders = [link.joint.name for link in vehicle.links]
    mimics = {
        each.link.joint.name: Mimic(leaders[each.leader], float(each.ratio), float(each.offset))
        for each in vehicle.followers
    }
    return RigidBodies(
        vehicle.name, "base", vehicle.base, vehicle.moving, vehicle.frames, mimics, vehicle.notes, vehicle.looks
    )


def _renamed(arm: RigidBodies, prefix: str) -> RigidBodies:
    if not prefix:
        return arm
    links = tuple(
        replace(link, name=prefix + link.name, joint=replace(link.joint, name=prefix + link.joint.name))
        for link in arm.links
    )
    frames = tuple(replace(frame, name=prefix + frame.name) for frame in arm.frames)
    mimics = {prefix + name: replace(each, joint=prefix + each.joint) for name, each in arm.mimics.items()}
    looks = tuple(replace(look, name=prefix + look.name) for look in arm.looks)
    return replace(arm, root=prefix + arm.root, links=links, frames=frames, mimics=mimics, looks=looks)


def _require_new_names(airframe: RigidBodies, arm: RigidBodies, root: list[str], mount: Mount) -> None:
    """Refuse links, frames and joints of an arm whose names the airframe has."""
    taken = {"base", airframe.root, *(link.name for link in airframe.links), *(f.name for f in airframe.frames)}
    joints = {link.joint.name for link in airframe.links}
    found = [("link", link.name) for link in arm.links if link.name in taken]
    found += [("frame", name) for name in (*root, *(f.name for f in arm.frames)) if name in taken - {"base"}]
    found += [("joint", link.joint.name) for link in arm.links if link.joint.name in joints]
    if found:
        kind, name = found[0]
        refuse(
            f"{mount.field}.prefix",
            mount.prefix,
            f"must tell the arm's {kind} '{name}' from the airframe's of that name",
        )
