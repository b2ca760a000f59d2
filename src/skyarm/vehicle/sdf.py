"""SDF files 1.4 to 1.12: read a vehicle's bodies, joints and rotors as an equal URDF
robot.

Included and nested models become one tree, whose names carry those of the models around
them (``arm::hand``). The link that no joint moves is the base. Links keep the axes of
their file; a joint that stands elsewhere than its link moves a link ``LINK.JOINT``,
which carries that one as a frame.
Source: SDFormat specification 1.12 (sdformat.org/spec), with "Specifying pose" and
"Model composition" there.
"""

from __future__ import annotations

import math
import os
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from skyarm.algebra import Mat3, Vec3
from skyarm.records.files import PathLike, errors_as
from skyarm.records.immutable import positional
from skyarm.vehicle import description
from skyarm.vehicle.attach import Notes, RigidBodies, at_origin, posed_in, with_pose
from skyarm.vehicle.check import VehicleError, refuse
from skyarm.vehicle.rotor_sources.own_files import OWN
from skyarm.vehicle.urdf import TRUE, UNLIMITED, read_robot, sdf_pose
from skyarm.vehicle.vehicle_records import Frame
from skyarm.vehicle.xml_elements import (
    finite,
    numbers_of,
    read_xml,
    require_root,
    text_of,
)

VERSIONS = tuple(f"1.{minor}" for minor in range(4, 13))

FOLDERS = (
    "GZ_SIM_RESOURCE_PATH",
    "IGN_GAZEBO_RESOURCE_PATH",
    "GAZEBO_MODEL_PATH",
    "SDF_PATH",
)
"""Environment variables with folders of models, as Gazebo reads them."""

DEEPEST = 100
"""Largest number of models in one vehicle, and of frames between a frame and the
vehicle's: files that include themselves and poses in a ring end in an error there."""

OF_PLUGINS = ("linkName", "jointName", "link_name")
"""Elements anywhere in a plugin that name a link or joint of its model."""

ROOT = "__model__"
"""Name by which every model knows its own frame, and the tree that of the vehicle."""

ORIGIN = at_origin()


@positional
class _Scope:
    """Model in which names are read: its file, the file's version, the prefix of its
    names, and its own frame.

    ``note`` takes a line on what is forgiven in its XML.
    """

    file: Path
    version: int
    note: Callable[[str], None]
    prefix: str = ""
    frame: str = ROOT

    def whole(self, name: str) -> str:
        """Whole name, in the vehicle, of an element that has a given name in this
        model.
        """
        return self.frame if name in ("", ROOT) else self.prefix + name


def read_sdf(path: PathLike, mimic: str = "lock", base: str = "") -> RigidBodies:
    """Read rigid bodies, joints, frames and rotors of an SDF file.

    Args:
        path: path of the file.
        mimic: one of ``attach.MIMIC``.
        base: name of the model that is the vehicle; "" for the file's only one.

    Raises:
        VehicleError: without the file's name, which the caller adds.
    """
    notes = Notes()
    model, scope = _vehicle(Path(path), base, notes)
    tree = _Tree(notes)
    tree.add(model, scope)
    bodies = read_robot(tree.robot(model.get("name", "sdf")), mimic, notes, Path(path))
    return with_pose(bodies, tree.pose_of(bodies.root), notes)


def _vehicle(path: Path, base: str, notes: Notes) -> tuple[ET.Element, _Scope]:
    """Model of a file that is the vehicle: the only one that is not static, or the
    named one.
    """
    sdf, scope = _document(path, notes.add)
    missing = ""
    # models stand alone in a file, or in a world
    models = [
        (each, scope) for each in (*sdf.findall("model"), *sdf.findall("world/model"))
    ]
    # a world without a network lacks its included ground, which is no reason to refuse
    # the vehicle
    for include in sdf.findall("world/include"):
        try:
            models.append(_read_include(include, scope))
        except VehicleError as error:
            missing = f"; {error}"
            notes.add(f"not read: {error}")
    # static models are ground and walls
    moving = [pair for pair in models if text_of(pair[0], "static") not in TRUE]
    chosen = (
        [pair for pair in models if pair[0].get("name") == base]
        if base
        else moving or models
    )
    names = [each.get("name") for each, _ in chosen or models]
    if base and not chosen:
        refuse("base", base, f"must be one of {', '.join(map(str, names))}{missing}")
    # a model that is missing, and not the ground
    if len(chosen) != 1 or (missing and not base and not moving):
        cure = 'a TOML file with sdf = "FILE" and base = "NAME" names it'
        refuse("models", names, f"must be one, the vehicle; {cure}{missing}")
    start = _inner(chosen[0][0], "pose").get("relative_to", "")
    around = [each for each, _ in models]
    if start.partition("::")[0] not in (
        "",
        "world",
        *(each.get("name") for each in around + sdf.findall("world/*")),
    ):
        refuse(
            f"model[{names[0]}].pose.relative_to",
            start,
            "must be left out, or be a name of the world",
        )
    return chosen[0]


def _document(path: Path, note: Callable[[str], None]) -> tuple[ET.Element, _Scope]:
    """Root element of an SDF file, and the scope of its names."""
    sdf = read_xml(path, note)
    require_root(sdf, "sdf")
    version = sdf.get("version", "(missing)")
    if version not in VERSIONS:
        refuse(
            "root element",
            f"{sdf.tag} version {version}",
            "must be <sdf> of version 1.4 to 1.12",
        )
    # the minor number: VERSIONS begins at 1.4
    return sdf, _Scope(path, VERSIONS.index(version) + 4, note)


def _read_include(include: ET.Element, scope: _Scope) -> tuple[ET.Element, _Scope]:
    """Model that an <include> names, with the name, pose and plugins that it gives the
    model.
    """
    uri = text_of(include, "uri")
    for params in include.findall("experimental:params"):
        scope.note(f"<{params.tag}> of the include of {uri}: not read")
    file = _file_of(uri, scope.file)
    with errors_as(VehicleError, f"include = {uri!r}: ", VehicleError):
        sdf, inside = _document(file, scope.note)
        model = sdf.find("model")
        if model is None:
            refuse("sdf", "no <model>", "must have one")
    for word in ("name", "placement_frame"):
        # the include's own name and placement win over those of the model
        model.set(word, text_of(include, word) or model.get(word, ""))
    # the first one counts
    model[:0] = [*include.findall("pose"), *include.findall("static")]
    model.extend(include.findall("plugin"))
    return model, replace(scope, file=file, version=inside.version)


def _file_of(uri: str, file: Path) -> Path:
    """SDF file that a URI names, ``model://NAME`` or a path: beside the file, beside
    its folder, or where Gazebo looks.

    No model is fetched from the network.
    """
    name = uri.rpartition("://")[2]
    here = file.resolve().parent
    given = [
        each for key in FOLDERS for each in os.environ.get(key, "").split(os.pathsep)
    ]
    for folder in (here.parent, here, *map(Path, filter(None, given))):
        place = folder / name
        for each in (place, place / "model.sdf", place / f"{place.name}.sdf"):
            # a name with .. could lead to any file of the machine
            if name and ".." not in place.parts and each.is_file():
                return each
    refuse(
        "include.uri",
        uri,
        f"must be model://NAME, of a folder in {here.parent} or {FOLDERS[0]}, with"
        " NAME.sdf",
    )


class _Tree:
    """Links, joints and frames of a vehicle under construction, by whole names.

    Attributes:
        frames: frame -> the frame that its pose starts at, the pose, and the frame of a
            model that is put there.
        carriers: frame, joint or model -> the frame or link that it is fixed to.
    """

    def __init__(self, notes: Notes) -> None:
        self.notes = notes
        self.models = 0
        self.links: dict[str, ET.Element] = {}
        self.joints: dict[str, tuple[ET.Element, _Scope]] = {}
        self.named: list[str] = []
        self.frames: dict[str, tuple[str, Frame, str]] = {}
        self.carriers: dict[str, str] = {}
        self.plugins: list[ET.Element] = []

    def add(self, model: ET.Element, scope: _Scope) -> None:
        """Add the links, joints, frames and plugins of an SDF model and of the models
        nested in it.
        """
        self.models += 1
        # a file that includes itself would never end
        if self.models > DEEPEST:
            refuse(
                "models",
                self.models,
                f"must be at most {DEEPEST} in one vehicle; does a file include"
                " itself?",
            )
        own = [scope.whole(each.get("name", "")) for each in model.findall("link")]
        before = len(self.links)
        # plugins name parts by the names of their own model, which are prefixed in the
        # vehicle
        for element in model:
            if element.tag in ("plugin", OWN):
                for named in (
                    each for word in OF_PLUGINS for each in element.iter(word)
                ):
                    if text := text_of(named):
                        named.text = scope.whole(text)
                self.plugins.append(element)
            elif element.tag == "include":
                inner, inside = _read_include(element, scope)
                self._add_placed(inner, inside, element.get("merge") in TRUE)
            elif element.tag in ("link", "frame", "joint", "model"):
                self._add_placed(element, scope)
        canonical = model.get("canonical_link")
        # SDF: the canonical link is the stated one, else the first of the model, own
        # links before nested ones
        first = [*own, *[*self.links][before:], "?"][0]
        self.carriers[scope.frame] = scope.whole(canonical) if canonical else first

    def _add_placed(
        self, element: ET.Element, scope: _Scope, merge: bool = False
    ) -> None:
        """Add a link, frame, joint or model; each is a frame."""
        kind = element.tag
        name = scope.whole(element.get("name", ""))
        # a joint may have the name of a link in older files, so its frame gets a key of
        # its own
        key = f"{kind} {name}" if merge or kind == "joint" else name
        if key in self.frames or not element.get("name"):
            refuse(f"{kind}.name", name, "must be there, and once in its model")
        base = scope.whole(
            text_of(element, "child", "?")
            if kind == "joint"
            else element.get("attached_to", "")
        )
        inner = replace(scope, prefix=scope.prefix if merge else f"{name}::", frame=key)
        pose = _inner(element, "pose")
        placement = element.get("placement_frame")
        # "frame" is the word of SDF 1.5 and 1.6 for relative_to
        start = pose.get("relative_to") or pose.get("frame")
        self.frames[key] = (
            scope.whole(start) if start else base,
            sdf_pose(pose, f"{kind}[{name}].pose"),
            inner.whole(placement) if placement else "",
        )
        for sensor in element.findall("sensor"):
            self.notes.add("not read", sensor.get("name", ""), "sensor")
        if kind == "model":
            self.add(element, inner)
        elif kind == "link":
            self.links[name] = element
            for uri in element.iterfind("collision//uri"):
                # an included file names meshes from its own folder
                if "://" not in (mesh := text_of(uri)):
                    uri.text = str(scope.file.resolve().parent / mesh)
            if text_of(element, "gravity", "1") not in TRUE:
                self.notes.add(
                    "without gravity in the file; here it weighs", name, "link"
                )
        else:
            self.carriers[key] = base
            if kind == "frame":
                self.named.append(name)
            else:
                self.joints[name] = element, scope

    def _at(self, name: str, top: str = ROOT, depth: int = 0) -> Frame:
        """Pose of a frame in another one on the way of its pose, as a rule the
        vehicle's.
        """
        if name == top:
            return ORIGIN
        key = name if name in self.frames else f"joint {name}"
        if key not in self.frames or depth > DEEPEST:
            refuse(
                "relative_to",
                name,
                "must be a link, frame, joint or model whose pose does not lead back",
            )
        base, pose, placement = self.frames[key]
        # depth bounds the walk, so poses in a ring end in an error
        at = posed_in(self._at(base, top, depth + 1), pose.rotation, pose.position)
        return (
            # placement_frame: the model is put so that this frame of it, not its own,
            # has the pose
            posed_in(at, *_within(self._at(placement, key, depth + 1), ORIGIN))
            if placement
            else at
        )

    def pose_of(self, link: str) -> tuple[Mat3, Vec3]:
        """Rotation and position (m) of a link in the vehicle's model."""
        at = self._at(link)
        return at.rotation, at.position

    def _link_of(self, name: str, field: str) -> str:
        """Link that a frame, joint or model is fixed to."""
        carrier = name
        # a chain of frames that leads nowhere ends here, too
        for _ in range(DEEPEST):
            if carrier in self.links:
                return carrier
            carrier = self.carriers.get(carrier) or self.carriers.get(
                f"joint {carrier}", "?"
            )
        refuse(field, name, f"must be a link, as {', '.join([*self.links][:4])}")

    def robot(self, name: str) -> ET.Element:
        """URDF robot of the same links, joints, frames and plugins."""
        robot = ET.Element("robot", name=name)
        for link, element in self.links.items():
            urdf = ET.SubElement(robot, "link", name=link)
            _add_inertial(urdf, element, self.notes)
            urdf.extend(element.findall("collision"))
        for joint, (element, scope) in self.joints.items():
            above, below = (text_of(element, end, "?") for end in ("parent", "child"))
            # SDF's world joint pins the vehicle; in flight it must be free
            if above == "world":
                self.notes.add(
                    "holds the vehicle to the world; not read: the base floats", joint
                )
                continue
            above, below = (
                self._link_of(scope.whole(end), f"joint[{joint}]")
                for end in (above, below)
            )
            self._join(robot, joint, above, below)
        for frame in self.named:
            link = self._link_of(frame, f"frame[{frame}].attached_to")
            ET.SubElement(robot, "link", name=frame)
            _connect(
                robot,
                f"{frame} frame",
                "fixed",
                (link, frame),
                (self._at(link), self._at(frame)),
            )
        for each in self.frames:  # also the root's, which moves nothing
            with errors_as(VehicleError, f"pose of {each}: "):
                self._at(each)
        robot.extend(self.plugins)
        return robot

    def _join(self, robot: ET.Element, name: str, above: str, below: str) -> None:
        """Add a joint to a URDF robot, and a link of its own where it stands elsewhere
        than the link of the file.
        """
        joint, scope = self.joints[name]
        kind = joint.get("type", "")
        field = f"joint[{name}]"
        parent, link = self._at(above), self._at(below)
        if kind == "fixed":
            _connect(robot, name, kind, (above, below), (parent, link))
            return
        moved = below
        seat = self._at(f"joint {name}")
        # equal frames need no link between them, so most joints keep the link of the
        # file
        if seat != link:
            moved = f"{below}.{name}"
            ET.SubElement(robot, "link", name=moved)
            _connect(robot, f"{below} frame", "fixed", (moved, below), (seat, link))
        urdf = _connect(robot, name, kind, (above, moved), (parent, seat))
        axis = _inner(joint, "axis")
        limit = {"lower": "-inf", "upper": "inf"}
        xyz = numbers_of(text_of(axis, "xyz", "0 0 1"), f"{field}.axis.xyz", 3)
        turned = _within(seat, self._at(self._axes_of(axis, name, scope)))[0]
        ET.SubElement(urdf, "axis", xyz=_digits(turned.apply(description.vector(xyz))))
        for word, text in _texts(axis, "limit").items():
            value = finite(text, f"{field}.limit.{word}", infinite=True)
            # a negative effort or rate is SDF's word for none
            if word in limit or value >= 0.0:
                # Gazebo takes 1e16 and more for none
                limit[word] = (
                    text
                    if abs(value) < UNLIMITED
                    else repr(math.copysign(math.inf, value))
                )
        # both ends open: only a continuous joint may lack limits in URDF
        if kind == "revolute" and (limit["lower"], limit["upper"]) == ("-inf", "inf"):
            urdf.set("type", "continuous")
        ET.SubElement(urdf, "limit", limit)
        rubbing = _texts(axis, "dynamics")
        if finite(
            spring := rubbing.get("spring_stiffness", "0"), f"{field}.spring_stiffness"
        ):
            refuse(
                f"{field}.spring_stiffness",
                spring,
                "must be 0; springs are not supported",
            )
        ET.SubElement(urdf, "dynamics", rubbing)
        for mimic in axis.iterfind("mimic"):
            defaults = {"multiplier": "1", "offset": "0", "reference": "0"}
            numbers = {
                word: finite(text_of(mimic, word, usual), f"{field}.mimic.{word}")
                for word, usual in defaults.items()
            }
            # SDF counts the leader from a reference: ratio (q - reference) + offset
            numbers["offset"] -= numbers["multiplier"] * numbers.pop("reference")
            leader = scope.whole(mimic.get("joint", ""))
            ET.SubElement(
                urdf,
                "mimic",
                {word: repr(each) for word, each in numbers.items()},
                joint=leader,
            )

    def _axes_of(self, axis: ET.Element, name: str, scope: _Scope) -> str:
        """Frame in whose axes a joint's axis is stated."""
        if stated := _inner(axis, "xyz").get("expressed_in"):
            return scope.whole(stated)
        # up to SDF 1.4 axes were stated in the model's frame without a word
        if scope.version < 5 or text_of(axis, "use_parent_model_frame") in TRUE:
            if scope.version < 7:
                return scope.frame
            self.notes.add(
                "use_parent_model_frame is no word of SDF 1.7 and later; not read", name
            )
        return f"joint {name}"


def _inner(element: ET.Element, path: str) -> ET.Element:
    """First element at a path below another one; an empty one if there is none."""
    return next(element.iterfind(path), ET.Element(path))


def _texts(element: ET.Element, path: str) -> dict[str, str]:
    """Texts of the elements in the one at a path, by tag; empty ones are left out."""
    return {
        each.tag: each.text.strip()
        for each in element.iterfind(f"{path}/*")
        if each.text
    }


def _within(outer: Frame, inner: Frame) -> tuple[Mat3, Vec3]:
    """Pose of a frame in another one, both in the axes of a third."""
    R = outer.rotation
    return description.rotation(R.T @ inner.rotation), R.apply_T(
        inner.position - outer.position
    )


def _digits(values: Iterable[Any]) -> str:
    return " ".join(repr(float(each)) for each in values)


def _set_origin(urdf: ET.Element, R: Mat3, p: Vec3) -> None:
    """Give a URDF element its pose."""
    # a quaternion, because roll, pitch and yaw lose digits near a right angle
    w, *xyz = description.unit_quaternion(R)
    ET.SubElement(urdf, "origin", xyz=_digits(p), quat_xyzw=_digits((*xyz, w)))


def _connect(
    robot: ET.Element,
    name: str,
    kind: str,
    ends: tuple[str, str],
    poses: tuple[Frame, Frame],
) -> ET.Element:
    """Add a joint between two links of a URDF robot, at given poses of these."""
    joint = ET.SubElement(robot, "joint", name=name, type=kind)
    for tag, link in zip(("parent", "child"), ends, strict=True):
        ET.SubElement(joint, tag, link=link)
    _set_origin(joint, *_within(*poses))
    return joint


def _add_inertial(urdf: ET.Element, link: ET.Element, notes: Notes) -> None:
    """Give a URDF link the mass of a link of SDF; what the file does not state has the
    values that SDF defines.
    """
    name = urdf.get("name", "")
    stated = _inner(link, "inertial")
    if stated.get("auto") in TRUE:
        refuse(
            f"link[{name}].inertial.auto",
            "true",
            "must be false, beside <mass>, <inertia>; no shape is weighed",
        )
    for added in stated.findall("fluid_added_mass"):
        notes.add(f"<{added.tag}>: not read", name, "link")
    given = {"mass": text_of(stated, "mass"), **_texts(stated, "inertia")}
    if missing := [
        word for word in ("mass", "ixx", "iyy", "izz") if not given.get(word)
    ]:
        notes.add(
            f"without {', '.join(missing)}: 1 kg and 1 kg m^2, as SDF defines",
            name,
            "link",
        )
        # SDF defines 1 for what is left out; a silent default could fly, so it is noted
        given |= dict.fromkeys(missing, "1")
    inertial = ET.SubElement(urdf, "inertial")
    at = sdf_pose(_inner(stated, "pose"), f"link[{name}].inertial.pose")
    _set_origin(inertial, at.rotation, at.position)
    ET.SubElement(inertial, "mass", value=given["mass"])
    ET.SubElement(inertial, "inertia", {"ixy": "0", "ixz": "0", "iyz": "0", **given})
