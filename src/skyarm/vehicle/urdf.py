"""URDF files: the rigid bodies and joints of a vehicle.

The root link is the base. Fixed joints disappear: their child's mass joins the parent and its frame stays as a named
frame. So do joints whose two limits are one number, by which simulators hang up sensors: they are fixed there.
Source: URDF specification (ROS wiki, urdf/XML).
"""

from __future__ import annotations

import math
import os
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from skyarm.algebra import ZERO3, Mat3, Vec3, axis_rotation
from skyarm.vehicle import description
from skyarm.vehicle.bodies import RigidBodies
from skyarm.vehicle.check import VehicleError, refuse
from skyarm.vehicle.stops import with_stops
from skyarm.vehicle.vehicle_records import BASE, Body, Frame, Joint, Link, Vehicle

KINDS = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "fixed": "fixed"}


@dataclass(frozen=True, slots=True)
class _Seat:
    """Where a URDF link went: the moving body it belongs to, and its pose in that body."""

    body: int
    rotation: Mat3
    position: Vec3


def read_urdf(path: str | os.PathLike[str]) -> RigidBodies:
    """Rigid bodies of a URDF file.

    Raises:
        VehicleError: without the file's name, which the caller adds.
    """
    try:
        robot = ET.parse(path).getroot()
    except (ET.ParseError, LookupError, ValueError) as error:  # the last two: encodings
        raise VehicleError(f"XML = {str(error)!r}: must be well-formed") from error
    if robot.tag != "robot":
        refuse("root element", robot.tag, "must be <robot>")
    for element in robot:
        if "loop" in str(element.tag):
            refuse(f"<{element.tag}>", element.get("name", ""), "closed chains are not supported")
        if "xacro" in str(element.tag):
            refuse("element", element.tag, "must be plain URDF; expand xacro first")
    return _tree(robot)


def urdf_vehicle(bodies: RigidBodies) -> Vehicle:
    """A vehicle without rotors; the frame 'tip', if there is one, is the end effector."""
    tip = "tip" if any(frame.name == "tip" for frame in bodies.frames) else ""
    return with_stops(
        Vehicle(name=bodies.name, base=bodies.base, links=bodies.links, frames=bodies.frames, end_effector=tip)
    )


def _tree(robot: ET.Element) -> RigidBodies:
    links = _by_name(robot, "link")
    joints = _by_name(robot, "joint")
    above = _joints_above(links, joints)
    roots = [name for name in links if name not in above]
    parents = {child: _end(joint, "parent", links) for child, joint in above.items()}
    root = roots[0] if roots else ""
    order = description.tree_order(parents, root, "parent of link[{}]")
    if len(roots) != 1:
        refuse("links without a parent", roots, "must be exactly one, the base")
    parts: list[list[Body]] = [_inertial(links[root])]
    seats = {root: _Seat(BASE, Mat3.identity(), ZERO3)}
    moving: list[Link] = []
    frames: list[Frame] = []
    for name in order:
        joint, seat = above[name], seats[parents[name]]
        R, p = _origin(joint, f"joint[{joint.get('name')}]")
        R, p = description.rotation(seat.rotation @ R), description.vector(list(seat.position + seat.rotation.apply(p)))
        locked = _locked(joint)
        if locked is not None:
            turn, shift = locked
            R, p = description.rotation(R @ turn), description.vector(list(p + R.apply(shift)))
            seats[name] = _Seat(seat.body, R, p)
            parts[seat.body + 1] += [_seated(part, R, p) for part in _inertial(links[name])]
            frames.append(Frame(name=name, link=seat.body, position=p, rotation=R))
            continue
        placeholder = Body(mass=0)
        moving.append(Link(name=name, parent=seat.body, joint=_joint(joint, R, p), body=placeholder))
        parts.append(_inertial(links[name]))
        seats[name] = _Seat(len(moving) - 1, Mat3.identity(), ZERO3)
    base, *bodies = (description.body(each) if each else Body(mass=0.0) for each in parts)
    made = tuple(replace(link, body=body) for link, body in zip(moving, bodies, strict=True))
    return RigidBodies(robot.get("name") or "urdf", root, base, made, tuple(frames))


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
        _kind(joint)
        mimic = _child(joint, "mimic", f"joint[{name}]")
        if mimic is not None:
            refuse(f"joint[{name}].mimic", mimic.get("joint", ""), "mimic joints are not supported")
        child = _end(joint, "child", links)
        if child in above:
            other = above[child].get("name")
            refuse(f"joint[{name}].child", child, f"closed chains are not supported (joint '{other}' moves it already)")
        above[child] = joint
    return above


def _kind(joint: ET.Element) -> str:
    kind = joint.get("type", "")
    if kind not in KINDS:
        refuse(f"joint[{joint.get('name')}].type", kind, f"must be one of {', '.join(KINDS)}")
    return KINDS[kind]


def _end(joint: ET.Element, tag: str, links: dict[str, ET.Element]) -> str:
    element = _child(joint, tag, f"joint[{joint.get('name')}]")
    name = element.get("link", "") if element is not None else ""
    if name not in links:
        refuse(f"joint[{joint.get('name')}].{tag}", name, f"must be one of {', '.join(links)}")
    return name


def _locked(joint: ET.Element) -> tuple[Mat3, Vec3] | None:
    """R and p by which a joint that cannot move places its child in the joint's frame; None if it can move."""
    field = f"joint[{joint.get('name')}]"
    kind, limit = _kind(joint), _child(joint, "limit", field)
    if kind == "fixed":
        return Mat3.identity(), ZERO3
    # limits left out are 0 by the specification, but more likely forgotten: such a joint is refused
    if joint.get("type") == "continuous" or limit is None or None in (limit.get("lower"), limit.get("upper")):
        return None
    lower, upper = (_number(limit, name, f"{field}.limit", 0.0) for name in ("lower", "upper"))
    if lower != upper:
        return None
    axis = _axis(joint)
    return (axis_rotation(axis, lower), ZERO3) if kind == "revolute" else (Mat3.identity(), axis * lower)


def _axis(joint: ET.Element) -> Vec3:
    """Unit vector of a joint's axis; the specification's default is x, where there is no <axis> at all."""
    field = f"joint[{joint.get('name')}]"
    axis = _child(joint, "axis", field)
    if axis is not None and axis.get("xyz") is None:
        refuse(f"{field}.axis.xyz", "(missing)", "must be three numbers")
    return description.unit_axis(f"{field}.axis", _numbers(axis, "xyz", f"{field}.axis", (1.0, 0.0, 0.0)))


def _joint(joint: ET.Element, R: Mat3, p: Vec3) -> Joint:
    name = joint.get("name", "")
    field = f"joint[{name}]"
    values: dict[str, Any] = {}
    limit, dynamics = _child(joint, "limit", field), _child(joint, "dynamics", field)
    if limit is not None:
        if joint.get("type") != "continuous":
            # the specification's default of both is 0
            values["lower"] = _number(limit, "lower", f"{field}.limit", 0.0)
            values["upper"] = _number(limit, "upper", f"{field}.limit", 0.0)
        values["effort_limit"] = _number(limit, "effort", f"{field}.limit", math.inf)
    elif joint.get("type") != "continuous":
        refuse(f"{field}.limit", "(missing)", "is required for revolute and prismatic joints; 'continuous' has none")
    values["damping"] = description.zero_is_structure(_number(dynamics, "damping", f"{field}.dynamics", 0.0))
    values["coulomb"] = description.zero_is_structure(_number(dynamics, "friction", f"{field}.dynamics", 0.0))
    return Joint(name=name, kind=_kind(joint), axis=_axis(joint), position=p, rotation=R, **values)


def _inertial(link: ET.Element) -> list[Body]:
    """Body of one link in its own axes; none if the file gives no inertial. An inertial must be whole."""
    inertial = _child(link, "inertial", f"link[{link.get('name')}]")
    if inertial is None:
        return []
    field = f"link[{link.get('name')}].inertial"
    mass = _required(inertial, "mass", ("value",), field)[0]
    if mass < 0.0:
        refuse(f"{field}.mass", mass, "must be at least 0")
    entries = _required(inertial, "inertia", ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), field)
    R, p = _origin(inertial, field)
    return [Body(mass=mass, com=p, inertia=description.inertia(entries).rotated(R))]


def _seated(body: Body, R: Mat3, p: Vec3) -> Body:
    """A body given in a merged link's frame, in the frame of the link that carries it."""
    return Body(mass=body.mass, com=p + R.apply(body.com), inertia=body.inertia.rotated(R), planar=body.planar)


def _origin(element: ET.Element, field: str) -> tuple[Mat3, Vec3]:
    origin = _child(element, "origin", field)
    xyz = _numbers(origin, "xyz", f"{field}.origin", (0.0, 0.0, 0.0))
    rpy = _numbers(origin, "rpy", f"{field}.origin", (0.0, 0.0, 0.0))
    return description.rotation_rpy(rpy), description.vector(xyz)


def _child(element: ET.Element, tag: str, field: str) -> ET.Element | None:
    """The child element of a kind of which there may be one."""
    found = element.findall(tag)
    if len(found) > 1:
        refuse(f"{field}.{tag}", f"{len(found)} elements <{tag}>", "must be at most one")
    return found[0] if found else None


def _required(element: ET.Element, tag: str, names: Sequence[str], field: str) -> list[float]:
    """Numbers of a child element that must be there, with all of them."""
    child = _child(element, tag, field)
    if child is None:
        refuse(f"{field}.{tag}", "(missing)", f"must give {', '.join(names)}; a link without mass has no <inertial>")
    for name in names:
        if child.get(name) is None:
            refuse(f"{field}.{tag}.{name}", "(missing)", "must be a number")
    return [_finite(child.get(name, ""), f"{field}.{tag}.{name}") for name in names]


def _number(element: ET.Element | None, name: str, field: str, default: float) -> float:
    text: Any = None if element is None else element.get(name)
    if text is None:
        return default
    return _finite(text, f"{field}.{name}")


def _numbers(element: ET.Element | None, name: str, field: str, default: tuple[float, float, float]) -> Sequence[float]:
    text: Any = None if element is None else element.get(name)
    if text is None:
        return default
    words = text.split()
    if len(words) != 3:
        refuse(f"{field}.{name}", text, "must be three numbers")
    return [_finite(word, f"{field}.{name}") for word in words]


def _finite(text: str, field: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        refuse(field, text, "must be a finite number")
    return value
