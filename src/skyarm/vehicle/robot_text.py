"""Text of a vehicle as URDF or SDF, with Gazebo's motor-model plugins for its rotors.

Each link's frame is its joint's frame at zero, as in this library. A rotor is a link of its own, which Gazebo demands,
with z along the thrust; it takes a thousandth of the base's mass, less where the base could not give it. Numbers are
written in full. Source: URDF specification (ROS wiki, urdf/XML); SDFormat specification 1.11; gz-sim,
MulticopterMotorModel.cc.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import field
from typing import Any

from skyarm.algebra import ZERO3, Mat3, Sym3, Vec3
from skyarm.records.immutable import positional
from skyarm.vehicle import check
from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.export_losses import ALWAYS_LOST, head_of, unused_name
from skyarm.vehicle.linkage import BASE, Body, Follower, Joint
from skyarm.vehicle.rotor_sources.motor_model import WORDS
from skyarm.vehicle.vehicle_records import Rotor, Vehicle, require_plant

BASE_LINK = "base_link"
"""Usual name of a robot's root link."""

FAR = 1e3
"""Number in place of an infinite limit or effort where the format must have one."""

_LOST = {
    **ALWAYS_LOST,
    "tilts": "tilts of rotors, which stand at angle 0",
    "tables": "thrust tables, for which the nearest parabola stands",
    "spin": "spin inertia of rotors, which skyarm alone reads back (rotorInertia)",
    "signed": "rolling moment by the sense of rotation, here the same for every rotor",
    "max_speed": "unlimited rotor speed, which is left out and must be stated to fly",
    "armature": "armature, which is left out",
    "drag": "drag of the body, which is left out",
    "coulomb": "smooth Coulomb friction, here without the rate over which it is smooth",
    "stops": "stiffness and damping of stops, here bare limits",
    "followers": 'joints that follow others, which skyarm reads back with mimic = "couple"',
    "names": "names that two parts have; the second one's gets an underscore",
}

LOST_IN_URDF = {
    **_LOST,
    "effort": f"unlimited effort, here {FAR:g}",
    "one_limit": f"limit on one side only, here also {FAR:g} on the other",
    "slides": f"slides without limits, here {FAR:g} m",
}
"""Feature that a URDF file holds otherwise or not at all -> its line."""


@positional
class _Piece:
    """Link of a robot's file: what moves it, or fixes it where it has no joint, and where it is in its parent."""

    name: str
    parent: str = ""
    joint_name: str = ""
    position: Vec3 = ZERO3
    rotation: Mat3 = field(default_factory=Mat3.identity)
    body: Body | None = None
    joint: Joint | None = None
    mimic: tuple[str, Follower] | None = None


def urdf_text(vehicle: Vehicle) -> str:
    """URDF text of a vehicle of concrete numbers, with what is lost in its first lines.

    Raises:
        VehicleError: a planar model, which no robot is.
    """
    robot = ET.Element("robot", name=vehicle.name)
    pieces = _pieces(vehicle)
    for piece in pieces:
        link = ET.SubElement(robot, "link", name=piece.name)
        if piece.body is not None:
            inertial = ET.SubElement(link, "inertial")
            ET.SubElement(inertial, "origin", xyz=_text(*piece.body.com), rpy="0 0 0")
            ET.SubElement(inertial, "mass", value=_text(piece.body.mass))
            ET.SubElement(inertial, "inertia", {name: _text(each) for name, each in _moments(piece.body)})
    for piece in pieces[1:]:
        _urdf_joint(robot, piece)
    for number, (rotor, piece) in enumerate(_rotors_of(vehicle, pieces)):
        _plugin(ET.SubElement(robot, "gazebo"), rotor, piece, number)
    return _document(robot, vehicle, "URDF", LOST_IN_URDF)


def sdf_text(vehicle: Vehicle) -> str:
    """SDF text of a vehicle of concrete numbers, with what is lost in its first lines.

    Raises:
        VehicleError: a planar model, which no robot is.
    """
    root, pieces = ET.Element("sdf", version="1.11"), _pieces(vehicle)
    model = ET.SubElement(root, "model", name=vehicle.name, canonical_link=pieces[0].name)
    for piece in pieces:
        if piece.body is None:
            _pose(ET.SubElement(model, "frame", name=piece.name, attached_to=piece.parent), piece)
            continue
        link = ET.SubElement(model, "link", name=piece.name)
        _pose(link, piece)
        inertial = ET.SubElement(link, "inertial")
        _entry(inertial, "pose", _text(*piece.body.com, 0, 0, 0))
        _entry(inertial, "mass", piece.body.mass)
        inertia = ET.SubElement(inertial, "inertia")
        for name, each in _moments(piece.body):
            _entry(inertia, name, each)
    for piece in pieces:
        if piece.joint is not None:
            _sdf_joint(model, piece, piece.joint)
    for number, (rotor, piece) in enumerate(_rotors_of(vehicle, pieces)):
        _plugin(model, rotor, piece, number)
    return _document(root, vehicle, "SDF", _LOST)


def _document(root: ET.Element, vehicle: Vehicle, form: str, losses: dict[str, str]) -> str:
    ET.indent(root)
    first = f"Written by skyarm export as {form}; rotors are motor-model plugins, their command a speed in rad/s."
    head = head_of(vehicle, first, losses)
    return f'<?xml version="1.0"?>\n{head}{ET.tostring(root, encoding="unicode")}\n'


def _pieces(vehicle: Vehicle) -> list[_Piece]:
    """Links of the file: base, moving links, one for each rotor, one without mass for each frame."""
    require_plant(vehicle)
    taken, joints = [link.name for link in vehicle.moving], [link.joint.name for link in vehicle.moving]
    root = unused_name(BASE_LINK, [*taken, *(each.name for each in (*vehicle.rotors, *vehicle.frames))])
    followers = {each.name: each for each in vehicle.followers}
    base, spun = _with_rotor_links(vehicle)
    pieces, names = [_Piece(root, body=base)], [*taken, root]  # BASE is the last name
    for link in vehicle.moving:
        at, follower = link.joint, followers.get(link.name)
        mimic = follower and (vehicle.links[follower.leader].joint.name, follower)
        parent = names[link.parent]
        pieces.append(_Piece(link.name, parent, at.name, at.position, at.rotation, link.body, at, mimic))
    taken.append(root)
    for rotor, body in zip(vehicle.rotors, spun, strict=True):
        pose = rotor.position, _upright(rotor.axis)
        pieces.append(_placed(rotor.name, root, taken, joints, pose, body))
    for frame in vehicle.frames:
        pieces.append(_placed(frame.name, names[frame.link], taken, joints, (frame.position, frame.rotation)))
    return pieces


def _placed(
    name: str, parent: str, taken: list[str], joints: list[str], pose: tuple[Vec3, Mat3], body: Body | None = None
) -> _Piece:
    """Link of a rotor, or of a frame without mass, with names that no other link or joint has."""
    taken.append(unused_name(name, taken))
    joints.append(unused_name(f"{taken[-1]}_joint", joints))
    spins = None if body is None else Joint(name=joints[-1], axis=Vec3(0, 0, 1), effort_limit=0.0)
    return _Piece(taken[-1], parent, joints[-1], *pose, body, spins)


def _with_rotor_links(vehicle: Vehicle) -> tuple[Body, list[Body]]:
    """Body of the base without its rotors' links, and the rotors' own bodies, in the axes of their links."""
    mass = float(vehicle.base.mass)
    for share in (1e-3, 1e-5, 1e-7, 1e-9):
        disc = 1e-4 * share * mass  # a few centimetres across
        rotor = Body(mass=share * mass, inertia=Sym3(disc, disc, 2.0 * disc))
        placed = [rotor.transform(_upright(each.axis), each.position) for each in vehicle.rotors]
        left = _less(vehicle.base, placed) if placed else vehicle.base
        try:
            check.inertia("base.inertia", left.inertia, planar=False)
        except VehicleError:
            continue
        break
    return left, [rotor] * len(placed)


def _less(whole: Body, parts: Sequence[Body]) -> Body:
    """Body without parts of it: the inverse of :meth:`Body.of_parts`."""
    mass = float(whole.mass) - sum(float(part.mass) for part in parts)
    moment = whole.com * whole.mass
    for part in parts:
        moment = moment - part.com * part.mass
    com = moment * (1.0 / mass)
    inertia = whole.inertia + Sym3.parallel_axis(whole.mass, whole.com - com)
    for part in parts:
        inertia = inertia - part.inertia - Sym3.parallel_axis(part.mass, part.com - com)
    return Body(mass=mass, com=com, inertia=inertia)


def _upright(axis: Vec3) -> Mat3:
    """Rotation whose z axis is a given one, by the shortest turn from z; about x where it points down."""
    x, y, z = map(float, axis)
    if z <= -1.0 + 1e-12:
        return Mat3.from_numbers([[1, 0, 0], [0, -1, 0], [0, 0, -1]])
    k = 1.0 / (1.0 + z)
    return Mat3.from_numbers([[1.0 - k * x * x, -k * x * y, x], [-k * x * y, 1.0 - k * y * y, y], [-x, -y, z]])


def _rotors_of(vehicle: Vehicle, pieces: list[_Piece]) -> list[tuple[Rotor, _Piece]]:
    first = 1 + len(vehicle.moving)
    return list(zip(vehicle.rotors, pieces[first : first + len(vehicle.rotors)], strict=True))


def _urdf_joint(robot: ET.Element, piece: _Piece) -> None:
    joint = piece.joint
    made = ET.SubElement(robot, "joint", name=piece.joint_name, type="fixed")
    ET.SubElement(made, "parent", link=piece.parent)
    ET.SubElement(made, "child", link=piece.name)
    ET.SubElement(made, "origin", xyz=_text(*piece.position), rpy=_text(*_rpy(piece.rotation)))
    if joint is None:
        return
    lower, upper = joint.ends
    endless = joint.turns and math.isinf(lower) and math.isinf(upper)
    made.set("type", "continuous" if endless else "revolute" if joint.turns else "prismatic")
    ET.SubElement(made, "axis", xyz=_text(*joint.axis))
    limit = ET.SubElement(made, "limit", effort=_text(min(float(joint.effort_limit), FAR)), velocity=_text(FAR))
    if not endless:
        limit.set("lower", _text(max(lower, -FAR)))
        limit.set("upper", _text(min(upper, FAR)))
    ET.SubElement(made, "dynamics", damping=_text(joint.damping), friction=_text(joint.coulomb))
    if piece.mimic is not None:
        leader, follower = piece.mimic
        numbers = {"multiplier": _text(follower.ratio), "offset": _text(follower.offset)}
        ET.SubElement(made, "mimic", joint=leader, **numbers)


def _sdf_joint(model: ET.Element, piece: _Piece, joint: Joint) -> None:
    kind = "revolute" if joint.turns else "prismatic"
    made = ET.SubElement(model, "joint", name=piece.joint_name, type=kind)
    _entry(made, "parent", piece.parent)
    _entry(made, "child", piece.name)
    axis = ET.SubElement(made, "axis")
    _entry(axis, "xyz", _text(*joint.axis))
    if piece.mimic is not None:
        leader, follower = piece.mimic
        mimic = ET.SubElement(axis, "mimic", joint=leader)
        for word, value in (("multiplier", follower.ratio), ("offset", follower.offset), ("reference", 0.0)):
            _entry(mimic, word, value)
    limit = ET.SubElement(axis, "limit")
    for word, value in (("lower", joint.lower), ("upper", joint.upper), ("effort", joint.effort_limit)):
        if math.isfinite(float(value)):  # what is left out is infinite
            _entry(limit, word, value)
    dynamics = ET.SubElement(axis, "dynamics")
    _entry(dynamics, "damping", joint.damping)
    _entry(dynamics, "friction", joint.coulomb)


def _plugin(parent: ET.Element, rotor: Rotor, piece: _Piece, number: int) -> None:
    """Add the motor-model plugin of a rotor."""
    named = {"filename": "gz-sim-multicopter-motor-model-system", "name": "gz::sim::systems::MulticopterMotorModel"}
    plugin = ET.SubElement(parent, "plugin", named)
    words: dict[str, Any] = {"jointName": piece.joint_name, "linkName": piece.name}
    words["turningDirection"] = "ccw" if rotor.direction > 0 else "cw"
    if rotor.reversible:
        words["reversible"] = "true"
    numbers = {word: float(getattr(rotor, ours)) for word, ours in WORDS.items()}
    words |= {word: each for word, each in numbers.items() if math.isfinite(each)}
    words |= {"commandSubTopic": "command/motor_speed", "motorNumber": str(number), "motorType": "velocity"}
    words |= {"motorSpeedPubTopic": f"motor_speed/{number}", "rotorVelocitySlowdownSim": "10"}
    for word, value in words.items():
        _entry(plugin, word, value)


def _pose(element: ET.Element, piece: _Piece) -> None:
    if piece.parent:
        pose = ET.SubElement(element, "pose", relative_to=piece.parent)
        pose.text = _text(*piece.position, *_rpy(piece.rotation))


def _entry(parent: ET.Element, tag: str, value: Any) -> None:
    ET.SubElement(parent, tag).text = value if isinstance(value, str) else _text(value)


def _moments(body: Body) -> list[tuple[str, Any]]:
    return list(zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), body.inertia.entries, strict=True))


def _text(*values: Any) -> str:
    return " ".join(repr(float(each)) for each in values)


def _rpy(R: Mat3) -> tuple[float, float, float]:
    """Roll, pitch and yaw (rad) of a rotation about fixed axes; exact also where the pitch is a right angle."""
    rows = [[float(each) for each in row] for row in R.rows]
    yaw = math.atan2(rows[1][0], rows[0][0])
    s, c = math.sin(yaw), math.cos(yaw)
    pitch = math.atan2(-rows[2][0], c * rows[0][0] + s * rows[1][0])
    roll = math.atan2(s * rows[0][2] - c * rows[1][2], c * rows[1][1] - s * rows[0][1])
    return roll, pitch, yaw
