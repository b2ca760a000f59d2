"""URDF files: the rigid bodies and joints of a vehicle.

The root link is the base. Fixed joints disappear: their child's mass joins the parent and its frame stays as a named
frame. So do joints whose two limits are one number, by which simulators hang up sensors: they are fixed there; and
joints that follow others, unless these are to be coupled. What is left out or taken in another way is in the notes.
Source: URDF specification (ROS wiki, urdf/XML).
"""

from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from skyarm.algebra import ZERO3, Mat3, Vec3
from skyarm.vehicle import description
from skyarm.vehicle.bodies import RigidBodies
from skyarm.vehicle.check import refuse
from skyarm.vehicle.couple import Mimic
from skyarm.vehicle.dry_friction import with_smooth_friction
from skyarm.vehicle.linkage import BASE, Body, Link
from skyarm.vehicle.notes import Notes
from skyarm.vehicle.stops import with_stops
from skyarm.vehicle.urdf_joints import displaced, fixed_at, kind_of_joint, read_joint, read_mimics, resting
from skyarm.vehicle.urdf_meshes import looks_of
from skyarm.vehicle.vehicle_records import Frame, Vehicle
from skyarm.vehicle.xml_fields import child, origin_of, read_xml, required

MIMIC = ("lock", "couple")
"""What becomes of joints that follow others: fixed where they rest, or moved with their leaders."""

READ = ("link", "joint", "material")
"""Elements of a robot that are read, or say only how it looks."""


@dataclass(frozen=True, slots=True)
class _Seat:
    """Where a URDF link went: the moving body it belongs to, and its pose in that body."""

    body: int
    rotation: Mat3
    position: Vec3


@dataclass(frozen=True, slots=True)
class _Tree:
    """Links and joints of a file by name, the joint above each link, and what each joint follows."""

    links: Mapping[str, ET.Element]
    joints: Mapping[str, ET.Element]
    above: Mapping[str, ET.Element]
    mimics: Mapping[str, Mimic]


def read_urdf(path: str | os.PathLike[str], mimic: str = "lock") -> RigidBodies:
    """Rigid bodies of a URDF file.

    Args:
        path: of the file.
        mimic: one of ``MIMIC``.

    Raises:
        VehicleError: without the file's name, which the caller adds.
    """
    robot, blank = read_xml(path)
    if robot.tag != "robot":
        refuse("root element", robot.tag, "must be <robot>")
    for element in robot:
        if "loop" in str(element.tag):
            refuse(f"<{element.tag}>", element.get("name", ""), "closed chains are not supported")
        if "xacro" in str(element.tag):
            name = Path(path).name
            refuse("element", element.tag, f"must be plain URDF; expand xacro first: xacro {name} > plain_{name}")
    notes = Notes()
    if blank:
        notes.add("blank lines before the XML declaration were skipped")
    for tag, count in Counter(str(element.tag) for element in robot).items():
        if tag not in READ and isinstance(tag, str) and not tag.startswith("<function"):
            notes.add(f"<{tag}> ({count}): not read")
    return _bodies(robot, mimic, notes, Path(path))


def urdf_vehicle(bodies: RigidBodies) -> Vehicle:
    """A vehicle without rotors; the frame 'tip', if there is one, is the end effector."""
    if float(bodies.base.mass) == 0.0:
        allowed = (
            f"must be greater than 0; its root '{bodies.root}' weighs nothing, and an airframe can carry it (attach)"
        )
        refuse("base.mass", 0.0, allowed)
    tip = "tip" if any(frame.name == "tip" for frame in bodies.frames) else ""
    made = Vehicle(
        name=bodies.name,
        base=bodies.base,
        links=bodies.links,
        frames=bodies.frames,
        looks=bodies.looks,
        end_effector=tip,
        notes=bodies.notes,
    )
    return with_stops(with_smooth_friction(made, [link.joint.name for link in made.links]))


def _bodies(robot: ET.Element, mimic: str, notes: Notes, path: Path) -> RigidBodies:
    tree = _read_tree(robot)
    roots = [name for name in tree.links if name not in tree.above]
    parents = {name: _end(joint, "parent", tree.links) for name, joint in tree.above.items()}
    root = roots[0] if roots else ""
    order = description.tree_order(parents, root, "parent of link[{}]")
    if len(roots) != 1:
        refuse("links without a parent", roots, "must be exactly one, the base")
    parts: list[list[Body]] = [_inertial(tree.links[root])]
    seats = {root: _Seat(BASE, Mat3.identity(), ZERO3)}
    moving: list[Link] = []
    frames: list[Frame] = []
    for name in order:
        joint, seat = tree.above[name], seats[parents[name]]
        R, p = origin_of(joint, f"joint[{joint.get('name')}]")
        R, p = description.rotation(seat.rotation @ R), description.vector(list(seat.position + seat.rotation.apply(p)))
        value = _held_at(joint, tree, mimic, notes)
        if value is not None:
            turn, shift = displaced(joint, value)
            R, p = description.rotation(R @ turn), description.vector(list(p + R.apply(shift)))
            seats[name] = _Seat(seat.body, R, p)
            parts[seat.body + 1] += [_seated(part, R, p) for part in _inertial(tree.links[name])]
            frames.append(Frame(name=name, link=seat.body, position=p, rotation=R))
            continue
        moving.append(Link(name=name, parent=seat.body, joint=read_joint(joint, R, p, notes), body=Body(mass=0)))
        parts.append(_inertial(tree.links[name]))
        seats[name] = _Seat(len(moving) - 1, Mat3.identity(), ZERO3)
    looks = [
        replace(look, link=seat.body, position=seat.position + seat.rotation.apply(look.position),
                rotation=description.rotation(seat.rotation @ look.rotation))
        for name, seat in seats.items() for look in looks_of(tree.links[name], path, notes)
    ]  # fmt: skip
    base, *bodies = (description.body(each) if each else Body(mass=0.0) for each in parts)
    made = tuple(replace(link, body=body) for link, body in zip(moving, bodies, strict=True))
    mimics = dict(tree.mimics) if mimic == "couple" else {}
    kept = {link.joint.name: mimics[link.joint.name] for link in made if link.joint.name in mimics}
    return RigidBodies(robot.get("name") or "urdf", root, base, made, tuple(frames), kept, notes.lines(), tuple(looks))


def _held_at(joint: ET.Element, tree: _Tree, mimic: str, notes: Notes) -> float | None:
    """Where a joint is fixed, rad or m; None if it moves."""
    name = joint.get("name", "")
    follows = tree.mimics.get(name)
    if follows is None:
        return fixed_at(joint)
    value = resting(name, tree.joints, tree.mimics)
    leader = _leader(name, tree)
    if mimic == "couple" and leader not in tree.joints:
        refuse(f"joint[{name}].mimic.joint", leader, f"must be one of {', '.join(tree.joints)}")
    if mimic == "couple" and fixed_at(tree.joints[leader]) is None:
        notes.add("follows another one, without a drive of its own", name)
        return None
    notes.add(f"follows {follows.joint}: fixed at {value:g}; mimic = 'couple' lets it move", name)
    return value


def _leader(name: str, tree: _Tree) -> str:
    """The joint that another one follows in the end."""
    while name in tree.mimics:
        name = tree.mimics[name].joint
    return name


def _read_tree(robot: ET.Element) -> _Tree:
    links, joints = _by_name(robot, "link"), _by_name(robot, "joint")
    if "world" not in links and any(joint.find("parent[@link='world']") is not None for joint in joints.values()):
        links = {"world": ET.Element("link", name="world"), **links}  # what simulators know without being told
    return _Tree(links, joints, _joints_above(links, joints), read_mimics(joints))


def _by_name(robot: ET.Element, tag: str) -> dict[str, ET.Element]:
    found: dict[str, ET.Element] = {}
    for element in robot.findall(tag):
        name = element.get("name", "")
        if not name:
            refuse(f"{tag}.name", name, "must not be empty")
        if name in found:
            refuse(f"{tag}.name", name, "stands twice; names must be unique")
        found[name] = element
    if tag == "link" and not found:
        refuse("robot", "no <link>", "must have at least one link")
    return found


def _joints_above(links: dict[str, ET.Element], joints: dict[str, ET.Element]) -> dict[str, ET.Element]:
    """The joint above each child link, in the order of the file; every joint refused that cannot be simulated."""
    above: dict[str, ET.Element] = {}
    for name, joint in joints.items():
        kind_of_joint(joint)
        below = _end(joint, "child", links)
        if below in above:
            other = above[below].get("name")
            refuse(f"joint[{name}].child", below, f"closed chains are not supported (joint '{other}' moves it already)")
        above[below] = joint
    return above


def _end(joint: ET.Element, tag: str, links: Mapping[str, ET.Element]) -> str:
    element = child(joint, tag, f"joint[{joint.get('name')}]")
    name = element.get("link", "") if element is not None else ""
    if name not in links:
        refuse(f"joint[{joint.get('name')}].{tag}", name, f"must be one of {', '.join(links)}")
    return name


def _inertial(link: ET.Element) -> list[Body]:
    """Body of one link in its own axes; none if the file gives no inertial. An inertial must be whole."""
    inertial = child(link, "inertial", f"link[{link.get('name')}]")
    if inertial is None:
        return []
    field = f"link[{link.get('name')}].inertial"
    mass = required(inertial, "mass", ("value",), field)[0]
    if mass < 0.0:
        refuse(f"{field}.mass", mass, "must be at least 0")
    entries = required(inertial, "inertia", ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), field)
    R, p = origin_of(inertial, field)
    return [Body(mass=mass, com=p, inertia=description.inertia(entries).rotated(R))]


def _seated(body: Body, R: Mat3, p: Vec3) -> Body:
    """A body given in a merged link's frame, in the frame of the link that carries it."""
    return Body(mass=body.mass, com=p + R.apply(body.com), inertia=body.inertia.rotated(R), planar=body.planar)
