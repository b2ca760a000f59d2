"""Text of a vehicle as URDF or SDF, with Gazebo's motor-model plugins for its rotors.

Each link's frame is its joint's frame at zero, as in this library. A rotor is a link of
its own, which Gazebo demands, with z along the thrust; it takes a thousandth of the
base's mass, less where the base could not give it. Numbers are written in full. What
only this library reads back of the rotors is an element of its own, which others skip.
A format of export is a registered function (kind ``vehicle_format``); its template
names in the first lines what the file loses.
Source: URDF specification (ROS wiki, urdf/XML); SDFormat specification 1.11; gz-sim,
MulticopterMotorModel.cc.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

from skyarm.algebra import E_Z, ZERO3, Mat3, Sym3, Vec3
from skyarm.records.immutable import positional
from skyarm.vehicle import check, description
from skyarm.vehicle.check import VehicleError, unused_name
from skyarm.vehicle.linkage import BASE, Body, Follower, Joint
from skyarm.vehicle.vehicle_records import Frame, Rotor, Vehicle, require_plant
from skyarm.vehicle.vehicle_text import rotor_lines
from skyarm.view.pages.markup import render_template


@positional
class _Piece:
    """Link of a robot's file: what moves it, or fixes it where it has no joint, and
    where it is in its parent.
    """

    name: str
    parent: str = ""
    joint_name: str = ""
    position: Vec3 = ZERO3
    rotation: Mat3 = Mat3.identity()
    body: Body | None = None
    joint: Joint | None = None
    follower: Follower | None = None

    @property
    def angles(self) -> tuple[float, float, float]:
        """Roll, pitch and yaw (rad) about fixed axes."""
        return description.rpy_of(self.rotation)


def urdf_text(vehicle: Vehicle) -> str:
    """URDF text of a vehicle of concrete numbers, with what is lost in its first lines.

    Raises:
        VehicleError: a planar model, which no robot is.
    """
    return _robot("urdf", vehicle)


def sdf_text(vehicle: Vehicle) -> str:
    """SDF text of a vehicle of concrete numbers, with what is lost in its first lines.

    Raises:
        VehicleError: a planar model, which no robot is.
    """
    return _robot("sdf", vehicle)


def _robot(form: str, vehicle: Vehicle) -> str:
    """Text of a vehicle in a robot format, ``form`` being urdf or sdf."""
    pieces = _pieces(vehicle, one_space=form == "sdf")
    first = 1 + len(vehicle.moving)
    return render_vehicle(
        form,
        vehicle,
        pieces=pieces,
        motors=list(zip(vehicle.rotors, pieces[first:], strict=False)),
    )


def render_vehicle(form: str, vehicle: Vehicle, **values: Any) -> str:
    """Render the template of a format with a vehicle and further values."""
    names = Counter(
        [*_part_names(vehicle), *(_joint_names(vehicle) if form == "sdf" else ())]
    )
    endless = {each.name: sum(map(math.isinf, each.ends)) for each in vehicle.joints}
    return render_template(
        f"vehicle/exported/{form}.jinja",
        vehicle=vehicle,
        digits=_digits,
        shared=[name for name, times in names.items() if times > 1],
        renamed=[name for name in names if name == WORLD or _plain_name(name) != name],
        limited=[name for name, ends in endless.items() if ends < 2],
        one_limit=[name for name, ends in endless.items() if ends == 1],
        rotors="\n".join(rotor_lines(vehicle.rotors)),
        **values,
    )


def _pieces(vehicle: Vehicle, *, one_space: bool) -> list[_Piece]:
    """Links of the file: base, moving links, one for each rotor, one without mass for
    each frame.

    Args:
        vehicle: its parts.
        one_space: no link or frame may have the name of a joint.
    """
    require_plant(vehicle)
    plain = _plain_name if one_space else str
    joints = [*map(plain, _joint_names(vehicle)), WORLD]
    # in SDF links, joints and frames share one space of names, in URDF links and joints
    # do not
    taken = joints if one_space else []
    names = list[str]()
    for link in vehicle.moving:
        names.append(unused_name(plain(link.name), taken))
        taken.append(names[-1])
    names.append(unused_name("base_link", [*taken, *_part_names(vehicle)]))
    base, spun = _with_rotor_links(vehicle)
    followers = {each.name: each for each in vehicle.followers}
    pieces = [_Piece(names[-1], body=base)]
    # joints are named before frames add theirs, hence a copy of the list
    for name, joint, link in zip(names, list(joints), vehicle.moving, strict=False):
        pieces.append(
            _Piece(
                name,
                # BASE is the last name
                parent=names[link.parent],
                joint_name=joint,
                position=link.joint.position,
                rotation=link.joint.rotation,
                body=link.body,
                joint=link.joint,
                follower=followers.get(link.name),
            )
        )
    hubs = [
        Frame(
            name=each.name, link=BASE, position=each.position, rotation=_upright(each)
        )
        for each in vehicle.rotors
    ]
    for k, frame in enumerate((*hubs, *vehicle.frames)):
        name = unused_name(plain(frame.name), taken)
        taken.append(name)
        # the joint of a frame needs a name of its own beside the frame's
        joint = unused_name(f"{name}_joint", joints)
        joints.append(joint)
        turns = k < len(hubs)
        pieces.append(
            _Piece(
                name,
                parent=names[frame.link],
                joint_name=joint,
                position=frame.position,
                rotation=frame.rotation,
                body=spun if turns else None,
                joint=Joint(name=joint, axis=E_Z) if turns else None,
            )
        )
    return pieces


WORLD = "world"
"""Name that SDF keeps for the world; "::" in a name stands between a model and its
part."""


def _plain_name(name: str) -> str:
    """Name of a part in an SDF file."""
    return name.replace("::", "_")


def _joint_names(vehicle: Vehicle) -> list[str]:
    return [link.joint.name for link in vehicle.moving]


def _part_names(vehicle: Vehicle) -> list[str]:
    """Names of links, rotors and frames, which share one space of names in a robot's
    file.
    """
    named: tuple[Any, ...] = (*vehicle.moving, *vehicle.rotors, *vehicle.frames)
    return [each.name for each in named]


def _digits(value: Any) -> str:
    """Text of a number or of several, in full."""
    return " ".join(
        repr(float(each))
        for each in (value if hasattr(value, "__iter__") else (value,))
    )


def actuator_names(vehicle: Vehicle) -> list[str]:
    """Unique names of a vehicle's actuators in an exported file: rotors, driven joints,
    then servos of tilts.
    """
    driven = (each.name for each in vehicle.joints if float(each.effort_limit) != 0.0)
    tilts = (f"{each.name}_tilt" for each in vehicle.rotors if each.tilt is not None)
    names: list[str] = []
    for name in (*(each.name for each in vehicle.rotors), *driven, *tilts):
        names.append(unused_name(name, names))
    return names


def _with_rotor_links(vehicle: Vehicle) -> tuple[Body, Body]:
    """Body of the base without its rotors' links, and that of one rotor, in the axes of
    its link.
    """
    # smaller rotors where the base's inertia could not give them up and stay physical
    for share in (1e-3, 1e-5, 1e-7, 1e-9):
        mass = share * float(vehicle.base.mass)
        disc = 1e-4 * mass  # a few centimetres across
        rotor = Body(mass=mass, inertia=Sym3(disc, disc, 2.0 * disc))
        # what the rotors' links get is taken from the base, so that their sum stays
        left = _less(
            vehicle.base,
            [rotor.transform(_upright(each), each.position) for each in vehicle.rotors],
        )
        try:
            # the last share stands even if it is refused
            check.inertia("base.inertia", left.inertia, planar=False)
        except VehicleError:
            continue
        break
    return left, rotor


def _less(whole: Body, parts: Sequence[Body]) -> Body:
    """Body without parts of it: the inverse of :meth:`Body.of_parts`."""
    mass, moment = whole.mass, whole.com * whole.mass
    for part in parts:
        mass, moment = mass - part.mass, moment - part.com * part.mass
    com = moment * (1.0 / mass)
    # Steiner's term of the whole about the remaining centre of mass; those of the parts
    # leave it
    inertia = whole.inertia + Sym3.parallel_axis(whole.mass, whole.com - com)
    for part in parts:
        inertia = inertia - part.inertia - Sym3.parallel_axis(part.mass, part.com - com)
    return Body(mass=mass, com=com, inertia=inertia)


def _upright(rotor: Rotor) -> Mat3:
    """Rotation whose z axis is a rotor's axis, by the shortest turn from z; about x
    where it points down.
    """
    return Mat3.from_numbers(description.turn_onto(rotor.axis))
