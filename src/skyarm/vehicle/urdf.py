"""URDF files: read a vehicle's rigid bodies and joints.

The root link is the base. Fixed joints disappear: their child's mass joins the parent
and its frame stays as a named frame. So do joints whose two limits are one number, by
which simulators hang up sensors: they are fixed there; and joints that follow others,
unless these are to be coupled. What is left out or taken in another way is in the
notes.
Source: URDF specification (ROS wiki, urdf/XML).
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Container, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path, PurePosixPath
from types import MappingProxyType
from typing import Any

from skyarm.algebra import ZERO3, Mat3, Vec3
from skyarm.records.arrays import Array
from skyarm.records.files import PathLike, errors_as
from skyarm.records.files.mesh_vertices import MESHES, read_vertices
from skyarm.records.files.stl_mesh import FARTHEST, METRES, read_corners
from skyarm.records.immutable import positional
from skyarm.vehicle import description
from skyarm.vehicle.attach import (
    BodyTree,
    Mimic,
    Notes,
    RigidBodies,
    at_origin,
    follow,
    held_pose,
    moved_into,
    posed_in,
)
from skyarm.vehicle.check import VehicleError, refuse
from skyarm.vehicle.convex_hull import COLLISION_SIZES
from skyarm.vehicle.imported_shapes import collision_of, file_shape
from skyarm.vehicle.linkage import BASE, Body, Joint
from skyarm.vehicle.rotor_sources.own_files import OWN
from skyarm.vehicle.stated_rotors import RotorFile, rotors_in
from skyarm.vehicle.vehicle_records import WITHOUT_MESH, Collision, Frame, Look, Vehicle
from skyarm.vehicle.vehicle_tables import vehicle_from
from skyarm.vehicle.xacro_files import expand_xacro
from skyarm.vehicle.xml_elements import (
    child,
    finite,
    number,
    numbers,
    numbers_of,
    parse_xml,
    require_root,
    required_numbers,
    text_of,
)

READ = ("link", "joint", "material", "plugin", OWN)
"""Elements of a robot that are read, or concern only its appearance."""

UNLIMITED = 1e16
"""Size of a joint's limit from which on Gazebo takes it for none."""


@positional
class _File:
    """Parsed URDF file: links and joints by name, parent joint of each link, and mimic
    joints.
    """

    links: Mapping[str, ET.Element]
    joints: Mapping[str, ET.Element]
    above: Mapping[str, ET.Element]
    mimics: Mapping[str, Mimic]


def read_urdf(
    path: PathLike, mimic: str = "lock", xacro: Mapping[str, str] = MappingProxyType({})
) -> RigidBodies:
    """Read rigid bodies, joints and frames of a URDF file, or of a xacro file that
    describes one.

    Args:
        path: path of the file.
        mimic: one of ``attach.MIMIC``.
        xacro: arguments of a xacro file.

    Raises:
        VehicleError: without the file's name, which the caller adds.
    """
    file = Path(path)
    notes = Notes()
    robot = parse_xml(
        expand_xacro(file, xacro) if file.suffix == ".xacro" else file.read_bytes(),
        notes.add,
    )
    require_root(robot, "robot")
    for element in robot:
        if "loop" in str(element.tag):
            refuse(
                f"<{element.tag}>",
                element.get("name", ""),
                "closed chains are not supported",
            )
        # macros that nobody expanded would be links without numbers
        if "xacro" in str(element.tag):
            refuse(
                "element",
                element.tag,
                "must be plain URDF; expand xacro first: name it"
                f" {file.stem}.urdf.xacro",
            )
    return read_robot(robot, mimic, notes, file)


def read_robot(robot: ET.Element, mimic: str, notes: Notes, path: Path) -> RigidBodies:
    """Rigid bodies, joints, frames and rotors of a URDF robot.

    Args:
        robot: element <robot>.
        mimic: one of ``attach.MIMIC``.
        notes: notes of the reader.
        path: file that describes it.
    """
    rotors = rotors_in(RotorFile(path, robot))
    read = {id(element) for rotor in rotors for element in rotor.elements}
    # a plugin that a rotor was read from is not reported as unread
    for plugin in robot.iter("plugin"):
        if id(plugin) not in read:
            notes.add(
                "not read", plugin.get("name") or plugin.get("filename") or "", "plugin"
            )
    unread = [
        each.tag
        for each in robot
        if each.tag not in READ and read.isdisjoint(map(id, each.iter()))
    ]
    for tag, count in Counter(unread).items():
        notes.add(f"<{tag}> ({count}): not read")
    return replace(
        _bodies(robot, mimic, notes, path, {each.link for each in rotors}),
        rotors=rotors,
    )


def urdf_vehicle(bodies: RigidBodies, collisions: str = "none") -> Vehicle:
    """Vehicle from a URDF file, with the rotors that it states; a frame named 'tip'
    becomes the end effector.

    ``collisions`` is the word of ``import_collisions``.
    """
    document = {
        "schema": 1,
        "name": bodies.name,
        "urdf": bodies.name,
        "import_collisions": collisions,
    }
    # a robot without end effector still flies; only a frame called tip is sure to be
    # one
    if any(frame.name == "tip" for frame in bodies.frames):
        document["end_effector"] = "tip"
    return vehicle_from(document, lambda *_: bodies)


def _bodies(
    robot: ET.Element, mimic: str, notes: Notes, path: Path, spun: Container[str]
) -> RigidBodies:
    """Bodies of a robot; nothing is noted on the joints of the links ``spun``, which
    are rotors.
    """
    file = _read_elements(robot)
    roots = [name for name in file.links if name not in file.above]
    parents = {
        name: _end(joint, "parent", file.links) for name, joint in file.above.items()
    }
    # the base is the one link that no joint moves
    if len(roots) > 1:
        refuse("links without a parent", roots, "must be exactly one, the base")
    root = "".join(roots)
    order = description.tree_order(parents, root, "parent of link[{}]")
    root, order = _without_freedom([root, *order], parents, file, notes)
    tree = BodyTree(file.mimics, notes)
    seats = {root: at_origin()}
    for name in order:
        joint = file.above[name]
        at = posed_in(
            seats[parents[name]], *origin_of(joint, f"joint[{joint.get('name')}]"), name
        )
        value = _constant_value(joint, file, mimic, notes)
        if value is None:
            # joints of rotors disappear later, so notes on their limits would mislead
            heard = Notes() if name in spun else notes
            seats[name] = tree.add_link(
                name, at.link, read_joint(joint, at.rotation, at.position, heard)
            )
        else:
            kind = kind_of_joint(joint)
            pose = held_pose(kind, ZERO3 if kind == "fixed" else axis_of(joint), value)
            seats[name] = posed_in(at, *pose, name)
            tree.frames.append(seats[name])
    for name, seat in seats.items():
        for body in _inertial(file.links[name]):
            tree.add_body(seat, body)
        tree.looks += [
            moved_into(seat, look) for look in looks_of(file.links[name], path, notes)
        ]
        for element in file.links[name].findall("collision"):
            read = partial(_shape_of, name, element, path)
            tree.looks.append(file_shape(seat, name, read))
    made = tree.bodies(robot.get("name") or "urdf", root, mimic == "couple")
    return replace(
        made, speeds={name: _speed(joint) for name, joint in file.joints.items()}
    )


def _without_freedom(
    links: list[str], parents: Mapping[str, str], file: _File, notes: Notes
) -> tuple[str, list[str]]:
    """Root and the links after it, without the massless ones by whose joints a file
    lets its base fly.

    These are a chain to the first body that holds a floating joint, or two slides or
    more; others are those of an arm.
    """
    first = next(
        (
            i
            for i, name in enumerate(links)
            if any(body.mass for body in _inertial(file.links[name]))
        ),
        0,
    )
    chain = [file.above[name] for name in links[1 : first + 1]]
    kinds = [joint.get("type") for joint in chain]
    # a branch before the first body is an arm of the root, not its freedom
    alone = {parents[name] for name in links[first + 1 :]}.isdisjoint(links[:first])
    # one slide alone may be a rail of an arm
    if not alone or ("floating" not in kinds and kinds.count("prismatic") < 2):
        return links[0], links[1:]
    for joint in chain:
        notes.add(
            "freedom of the base, which it has here anyway; left out",
            joint.get("name", ""),
        )
    return links[first], links[first + 1 :]


def _constant_value(
    joint: ET.Element, file: _File, mimic: str, notes: Notes
) -> float | None:
    """Constant value of a joint that cannot move, rad or m; None for a joint that can
    move.
    """
    name = joint.get("name", "")
    follows = file.mimics.get(name)
    if follows is None:
        value = fixed_at(joint)
        if value is not None and joint.get("type") != "fixed":
            notes.add(f"lower equal to upper: fixed at {value:g}", name)
        return value
    last = follow(name, file.mimics)
    value = resting(last, file.joints)
    leader = last.joint
    if mimic == "couple":
        # checked here, because resting() takes an unknown leader as at zero
        if leader not in file.joints:
            refuse(
                f"joint[{name}].mimic.joint",
                leader,
                f"must be one of {', '.join(file.joints)}",
            )
        if fixed_at(file.joints[leader]) is None:
            notes.add("follows another one, without a drive of its own", name)
            return None
    notes.add(
        f"follows {follows.joint}: fixed at {value:g}; mimic = 'couple' lets it move",
        name,
    )
    return value


def _read_elements(robot: ET.Element) -> _File:
    """Links, joints and mimic joints of a robot; a missing link world is added."""
    links, joints = _by_name(robot, "link"), _by_name(robot, "joint")
    if "world" not in links and any(
        joint.find("parent[@link='world']") is not None for joint in joints.values()
    ):
        # simulators define it
        links = {"world": ET.Element("link", name="world"), **links}
    return _File(links, joints, _joints_above(links, joints), read_mimics(joints))


def _by_name(robot: ET.Element, tag: str) -> dict[str, ET.Element]:
    """Links or joints of a robot by name, which must be there and unique."""
    elements: dict[str, ET.Element] = {}
    for element in robot.findall(tag):
        name = element.get("name", "")
        if not name:
            refuse(f"{tag}.name", name, "must not be empty")
        if name in elements:
            refuse(f"{tag}.name", name, "stands twice; names must be unique")
        elements[name] = element
    if tag == "link" and not elements:
        refuse("robot", "no <link>", "must have at least one link")
    return elements


def _joints_above(
    links: dict[str, ET.Element], joints: dict[str, ET.Element]
) -> dict[str, ET.Element]:
    """Parent joint of each link, in the order of the file; unsupported joints raise an
    error.
    """
    above: dict[str, ET.Element] = {}
    for name, joint in joints.items():
        below = _end(joint, "child", links)
        if below in above:
            other = above[below].get("name")
            refuse(
                f"joint[{name}].child",
                below,
                f"closed chains are not supported (joint '{other}' moves it already)",
            )
        above[below] = joint
    return above


def _end(joint: ET.Element, tag: str, links: Mapping[str, ET.Element]) -> str:
    """Name of the parent or child link of a joint (``tag``), which must exist."""
    element = child(joint, tag, f"joint[{joint.get('name')}]")
    name = element.get("link", "") if element is not None else ""
    if name not in links:
        refuse(
            f"joint[{joint.get('name')}].{tag}",
            name,
            f"must be one of {', '.join(links)}",
        )
    return name


def _inertial(link: ET.Element) -> list[Body]:
    """Mass distribution of one link in its axes; an empty list if the file states no
    <inertial>.
    """
    inertial = child(link, "inertial", f"link[{link.get('name')}]")
    if inertial is None:
        return []
    field = f"link[{link.get('name')}].inertial"
    mass = required_numbers(inertial, "mass", ("value",), field)[0]
    if mass < 0.0:
        refuse(f"{field}.mass", mass, "must be at least 0")
    entries = required_numbers(
        inertial, "inertia", ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), field
    )
    R, p = origin_of(inertial, field)
    return [Body(mass=mass, com=p, inertia=description.inertia(entries).rotate(R))]


KINDS = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "fixed": "fixed",
}


def kind_of_joint(joint: ET.Element) -> str:
    """Kind of a URDF joint: revolute, prismatic or fixed."""
    kind = joint.get("type", "")
    if kind not in KINDS:
        refuse(
            f"joint[{joint.get('name')}].type",
            kind,
            f"must be one of {', '.join(KINDS)}",
        )
    return KINDS[kind]


def limits(joint: ET.Element) -> tuple[float, float]:
    """Lower and upper limit of a joint, rad or m; infinite where the file states none,
    zero of a fixed joint.

    Gazebo's number for none is none, too.

    By the specification a limit that is not stated is 0. That is taken where the other
    one leaves the joint room to move; elsewhere it has been forgotten.
    """
    if kind_of_joint(joint) == "fixed":
        return 0.0, 0.0
    field = f"joint[{joint.get('name')}]"
    limit = child(joint, "limit", field)
    if joint.get("type") == "continuous" or limit is None:
        return -math.inf, math.inf
    lower = number(limit, "lower", f"{field}.limit", math.nan, infinite=True)
    upper = number(limit, "upper", f"{field}.limit", math.nan, infinite=True)
    lower = -math.inf if lower <= -UNLIMITED else lower
    upper = math.inf if upper >= UNLIMITED else upper
    for word, value in (("lower", lower), ("upper", -upper)):
        if value == math.inf:
            refuse(
                f"{field}.limit.{word}",
                limit.get(word),
                "must be on the other side of 0, or finite",
            )
    # a missing limit is 0 by the specification where that leaves a range, else none
    if math.isnan(lower):
        lower = 0.0 if upper > 0.0 else -math.inf
    if math.isnan(upper):
        upper = 0.0 if -math.inf < lower < 0.0 else math.inf
    return lower, upper


def fixed_at(joint: ET.Element) -> float | None:
    """Constant value of a fixed joint or one with equal limits, rad or m; None if it
    can move.
    """
    # limits that are left out are never equal: limits() leaves the joint room there
    lower, upper = limits(joint)
    return lower if lower == upper else None


def axis_of(joint: ET.Element) -> Vec3:
    """Unit vector along a joint's axis; x if there is no <axis>, as the specification
    defines.
    """
    field = f"joint[{joint.get('name')}]"
    axis = child(joint, "axis", field)
    if axis is not None and axis.get("xyz") is None:
        refuse(f"{field}.axis.xyz", "(missing)", "must be three numbers")
    return description.unit_axis(
        f"{field}.axis", numbers(axis, "xyz", f"{field}.axis", (1.0, 0.0, 0.0))
    )


def read_joint(joint: ET.Element, R: Mat3, p: Vec3, notes: Notes) -> Joint:
    """Joint record of a moving link, with the pose of its frame in the parent."""
    name = joint.get("name", "")
    field = f"joint[{name}]"
    limit, dynamics = child(joint, "limit", field), child(joint, "dynamics", field)
    lower, upper = limits(joint)
    if joint.get("type") != "continuous":
        if math.isinf(lower) and math.isinf(upper):
            notes.add("without limits, so it turns or slides without end", name)
        elif limit is None or None in (limit.get("lower"), limit.get("upper")):
            notes.add("with one limit stated only; the other is 0 or none", name)
    effort = number(limit, "effort", f"{field}.limit", math.nan, infinite=True)
    if math.isnan(effort):
        notes.add(
            "without an effort, so passive; [[joints]] effort_limit gives it a drive",
            name,
        )
    elif effort == 0.0:
        notes.add("of effort 0, so passive", name)
    elif math.isinf(effort):
        notes.add("of infinite effort, so without a limit of its drive", name)
    if joint.find("safety_controller") is not None:
        notes.add("soft limits of its safety_controller: not read", name)
    if 0.0 < (speed := _speed(joint)) < math.inf:
        notes.add(
            f"velocity limit {speed:g}: the speed_limit of a servo in [drives]; nothing"
            " else keeps it",
            name,
        )
    values: dict[str, Any] = {
        "lower": lower,
        "upper": upper,
        # URDF demands an effort; a file without one says nothing of a drive
        "effort_limit": 0.0 if math.isnan(effort) else effort,
    }
    for ours, theirs in (("damping", "damping"), ("coulomb", "friction")):
        values[ours] = description.zero_is_structure(
            number(dynamics, theirs, f"{field}.dynamics", 0.0)
        )
    return Joint(
        name=name,
        kind=kind_of_joint(joint),
        axis=axis_of(joint),
        position=p,
        rotation=R,
        **values,
    )


def _speed(joint: ET.Element) -> float:
    """Largest rate of a joint, rad/s or m/s; 0 if the file states none."""
    return number(
        joint.find("limit"),
        "velocity",
        f"joint[{joint.get('name')}].limit",
        0.0,
        infinite=True,
    )


def read_mimics(joints: Mapping[str, ET.Element]) -> dict[str, Mimic]:
    """Mimic relation (leader, ratio, offset) of each movable joint that follows another
    one.
    """
    mimics: dict[str, Mimic] = {}
    for name, joint in joints.items():
        field = f"joint[{name}]"
        mimic = child(joint, "mimic", field)
        # two equal limits fix a joint, and then it follows nobody
        if mimic is None or fixed_at(joint) is not None:
            continue
        ratio = number(mimic, "multiplier", f"{field}.mimic", 1.0)
        mimics[name] = Mimic(
            mimic.get("joint", ""),
            ratio,
            number(mimic, "offset", f"{field}.mimic", 0.0),
        )
    return mimics


def resting(follows: Mimic, joints: Mapping[str, ET.Element]) -> float:
    """Value of a mimic joint while the last leader in its chain of mimic joints is at
    rest.
    """
    if follows.joint not in joints:
        return follows.at_rest()
    return follows.at_rest(*limits(joints[follows.joint]))


PACKAGES, FILE = ("package://", "model://"), "file://"


def mesh_file(address: str, urdf: Path) -> Path | None:
    """Path of the file that a mesh address denotes; None if there is no such file.

    Args:
        address: ``package://PACKAGE/PATH``, so with ``model://``, ``file://PATH`` or a
            path beside the URDF file.
        urdf: the file that states it. A package is the folder of that name above it or
            beside one above it, or the folder above it that holds a ``package.xml``.
    """
    try:
        return next(
            (each for each in _candidates(address, urdf) if each.is_file()), None
        )
    except (OSError, ValueError):  # a name that no file can have
        return None


def _candidates(address: str, urdf: Path) -> list[Path]:
    """Paths at which the file of a mesh address may lie, the likeliest first."""
    folder = urdf.resolve().parent
    if address.startswith(FILE):
        return [Path(address.removeprefix(FILE))]
    if not address.startswith(PACKAGES):
        return [folder / address]
    package, *inside = PurePosixPath(address.partition("://")[2]).parts or ("",)
    above = [folder, *folder.parents]
    # nearest packages first: the one around the file, then those beside it
    roots = [each for each in above if each.name == package]
    roots += [each / package for each in above]
    roots += [each for each in above if (each / "package.xml").is_file()]
    return [root.joinpath(*inside) for root in roots]


def looks_of(link: ET.Element, urdf: Path, notes: Notes) -> list[Look]:
    """Visual meshes of a URDF link; meshes that cannot be drawn are left out, with a
    note.

    Args:
        link: link of the file.
        urdf: the file.
        notes: notes of its reader.
    """
    name = link.get("name", "")
    looks = []
    for visual in link.findall("visual"):
        for mesh in visual.findall("geometry/mesh"):
            file = mesh_file(mesh.get("filename", ""), urdf)
            field = f"link[{name}].visual"
            if file is None or file.suffix.lower() != ".stl":
                why = "is not there" if file is None else "is no .stl"
                notes.add(f"a mesh file {why}; {WITHOUT_MESH}", name, "link")
                continue
            try:
                # a picture that cannot be drawn changes nothing of how the vehicle
                # flies
                rotation, position = origin_of(visual, field)
                # a mesh in millimetres or far away would shrink everything else in the
                # picture
                if max(map(abs, position)) > FARTHEST:
                    refuse(
                        f"{field}.origin.xyz",
                        list(position),
                        f"must be within {FARTHEST:g} m",
                    )
                x, y, z = numbers(mesh, "scale", f"{field}.mesh", METRES)
                read_corners(file, (x, y, z))
            except ValueError as error:
                notes.add(
                    f"a mesh cannot be drawn ({error}); {WITHOUT_MESH}",
                    name,
                    "link",
                )
                continue
            scale = Vec3(x, y, z)
            looks.append(
                Look(
                    name=name,
                    link=BASE,
                    position=position,
                    rotation=rotation,
                    file=str(file),
                    scale=scale,
                )
            )
    return looks


LEFT_OUT = (
    f"left out: must be {', '.join([*COLLISION_SIZES][:4])} or a mesh of"
    f" {' or '.join(MESHES)}, and not relative_to another frame"
)
"""Note on a shape that cannot be used."""


NO_MESH = (
    "must be a file that is there; put it there, or take import_collisions = 'none' or"
    " [[collisions]]"
)
"""What is allowed for the mesh of a shape that touches, with cures."""


def _shape_of(
    link: str, element: ET.Element, file: Path, notes: Notes
) -> Collision | None:
    """Shape of an element <collision> of URDF or SDF; None, with a note, for one that
    cannot be used.
    """
    shape = next(element.iterfind("geometry/*"), element)
    pose = element.find("pose")
    kind = shape.tag
    name = _entry(shape, "filename") or _entry(shape, "uri")
    mesh = mesh_file(name, file) if kind == "mesh" else None
    if kind == "mesh" and not mesh:
        # without it the body would fly through what it hits
        refuse(f"link[{link}].collision.mesh", name, NO_MESH)
    usable = mesh.suffix.lower() in MESHES if mesh else kind in COLLISION_SIZES
    if not usable or (pose is not None and pose.get("relative_to")):
        notes.add(f"its <{kind}> {name} {LEFT_OUT}", link, "link")
        return None
    with errors_as(VehicleError, f"link[{link}].collision: "):
        if pose is None:
            at = posed_in(at_origin(), *origin_of(element, "collision"))
        else:
            at = sdf_pose(pose, "pose")
        size: Sequence[float] | Array
        if mesh:
            scale = _entry(shape, "scale") or "1 1 1"
            size = read_vertices(mesh, numbers_of(scale, "scale", 3))
        elif kind == "box":
            size = numbers_of(_entry(shape, "size"), "size", 3)
        else:
            words = COLLISION_SIZES[kind]
            size = [finite(_entry(shape, word), word) for word in words]
        return collision_of(link, "hull" if mesh else kind, at, size, notes)


def _entry(shape: ET.Element, word: str) -> str:
    """Text of an entry of a shape: an attribute in URDF, an element in SDF."""
    return shape.get(word) or text_of(shape, word)


TRUE = ("1", "true", "True", "TRUE")


def sdf_pose(pose: ET.Element, field: str) -> Frame:
    """Position (m) and rotation of an SDF <pose>, by roll, pitch, yaw (rad or degrees)
    or a quaternion.
    """
    text = text_of(pose)
    four = pose.get("rotation_format") == "quat_xyzw"
    if not text:
        return at_origin()
    x, y, z, *turn = numbers_of(text, field, 7 if four else 6)
    if four:
        R = description.rotation_quaternion(field, [turn[3], *turn[:3]])
    else:
        R = description.rotation_rpy(
            list(map(math.radians, turn)) if pose.get("degrees") in TRUE else turn
        )
    return posed_in(at_origin(), R, description.vector((x, y, z)))


def origin_of(element: ET.Element, field: str) -> tuple[Mat3, Vec3]:
    """Rotation and position (m) of the <origin> of an XML element; identity and zero
    without one.
    """
    origin = child(element, "origin", field)
    position = description.vector(
        numbers(origin, "xyz", f"{field}.origin", (0.0, 0.0, 0.0))
    )
    # an element of our own readers: it carries the poses of SDF files in full digits
    if origin is not None and origin.get("quat_xyzw"):
        where = f"{field}.origin.quat_xyzw"
        x, y, z, w = numbers_of(origin.get("quat_xyzw", ""), where, 4)
        return description.rotation_quaternion(where, [w, x, y, z]), position
    rpy = numbers(origin, "rpy", f"{field}.origin", (0.0, 0.0, 0.0))
    return description.rotation_rpy(rpy), position
