"""MJCF files: read a vehicle's rigid bodies and joints with MuJoCo's parser.

The body with the free joint, or with three slides and three hinges in its place, is the
base; without one it is the only body of the world that has joints or weighs something,
which then floats, or the world itself. Hinges and slides become joints, several of one
body joints with massless links between them. Sites, and bodies without joints, become
frames. What has no counterpart is refused by its name; what acts on joints only is
refused where these are not held.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from skyarm.algebra import ZERO3, Mat3, Quaternion, Scalar, Sym3, Vec3
from skyarm.records.arrays import Array
from skyarm.records.files import one_line
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
    posed_in,
    with_pose,
)
from skyarm.vehicle.check import VehicleError, refuse, unused_name
from skyarm.vehicle.convex_hull import COLLISION_SIZES
from skyarm.vehicle.imported_shapes import collision_of, file_shape
from skyarm.vehicle.linkage import Body, Joint
from skyarm.vehicle.mjcf_actuators import (
    AT_JOINT,
    at_joint,
    carriers,
    effort_of,
    joints_of,
    limits,
    name_of,
    read_drives,
)
from skyarm.vehicle.rotor_sources.mujoco_thrust import SITE, MujocoVehicle
from skyarm.vehicle.stated_rotors import RotorFile, rotors_in
from skyarm.vehicle.vehicle_records import Collision, Frame
from skyarm.vehicle.xml_elements import finite, read_xml, require_root

if TYPE_CHECKING:
    from mujoco import MjData, MjModel


class _MujocoTree(BodyTree):
    """Kinematic tree of a compiled MuJoCo model, with the frame of each of its bodies.

    Attributes:
        seats: frame of each body. balls: ball joints, at rest.
        of_rotors: joints that spin or tilt rotors. carrying: links and sites that carry
            rotors.
        sites: site -> name of its frame, which is another one where a body has the
            site's.
    """

    def __init__(self, model: MjModel, coupled: bool, notes: Notes) -> None:
        super().__init__(mimics_of(model), notes)
        self.model = model
        self.coupled = coupled
        self.seats: dict[int, Frame] = {}
        self.of_rotors: set[str] = set()
        self.carrying: set[str] = set()
        self.balls: set[str] = set()
        self.sites: dict[str, str] = {}
        self.named = {name_of(model, "body", body) for body in range(1, model.nbody)}

    # MuJoCo lets a site, a body and a joint share a name; frames and links here may not
    def unique(self, name: str) -> str:
        """Unique name, with underscores appended where needed: MuJoCo has separate
        names for each kind of element.
        """
        frames = (each.name for each in self.frames)
        return unused_name(name, {*self.named, *frames, *(k.name for k in self.links)})


def read_mjcf(path: Path, mimic: str = "lock", base: str = "") -> RigidBodies:
    """Read rigid bodies, joints, frames, rotors and drives of an MJCF file.

    Args:
        path: path of the file.
        mimic: "lock" or "couple": joints that an equality ties to others are fixed
            where they rest, or follow.
        base: name of the body of the world that is the base; "" for the only one.

    Raises:
        VehicleError: without the file's name, which the caller adds.
    """
    notes = Notes()
    model = _compile(path, notes)
    _read_option(model, notes)
    # before the root is read: a disabled actuator must not make a body look driven
    root, left_out = _root(model, base, notes)
    faults = require_supported(model, root, notes)
    for body in left_out:
        notes.add(
            "fixed to the world beside the vehicle; not read",
            name_of(model, "body", body),
            "part",
        )
    tree = _MujocoTree(model, mimic == "couple", notes)
    tree.seats[root] = at_origin()
    rotors = rotors_in(
        # rotors first, because their joints and sites are left out of the notes on the
        # tree
        RotorFile(path, MujocoVehicle(model, _at_rest(model, root), root, notes))
    )
    tree.of_rotors = {name for each in rotors for name in (each.joint, each.tilt_joint)}
    tree.carrying = {each.link for each in rotors}
    _read_body(tree, root)
    # parents have lower numbers than their children in MuJoCo's models
    for body in range(1, model.nbody):
        if (
            body != root
            and model.body_parentid[body] in tree.seats
            and body not in left_out
        ):
            _read_child(tree, body)
    rotors = tuple(
        replace(each, link=tree.sites.get(each.link, each.link)) for each in rotors
    )
    title = model.names[: model.names.index(b"\0")].decode() or path.stem
    bodies = tree.bodies(
        title, name_of(model, "body", root) if root else "world", tree.coupled
    )
    driven = (
        {link.joint.name for link in tree.links} - tree.of_rotors - set(bodies.mimics)
    )
    drives = read_drives(model, driven, tree.mimics, notes)
    pose = (Mat3.identity(), ZERO3)
    # a fixed base stands in the world where its file put it; a free one starts anywhere
    if root and not joints_of(model, root):
        pose = _pose_of(model, "body", root)
    movable = {link.joint.name for link in tree.links} | tree.balls
    # the others are fixed
    acting = {
        fault: joints & movable for fault, joints in faults.items() if joints & movable
    }
    return with_pose(
        replace(bodies, rotors=rotors, drives=drives, faults=acting), pose, notes
    )


NUMBERS = (
    "pos quat axis axisangle euler xyaxes zaxis fromto size mass density diaginertia"
    " fullinertia ref damping armature frictionloss stiffness range actuatorfrcrange"
    " gear ctrlrange forcerange gainprm biasprm dynprm kp kv timeconst"
)
"""Attributes with the numbers of a vehicle; MuJoCo takes NaN in some of them for one
that is left out."""


def _require_finite(root: ET.Element) -> None:
    """Raise an error for a number that is not finite; a range may have no end, nor a
    floor, and a flag is no number.
    """
    for parent in root.iter():
        for element in (each for each in parent if each.tag != "flag"):
            field = f"{element.tag}[{element.get('name') or parent.get('name', '')}]"
            for word in NUMBERS.split():
                for text in element.get(word, "").split():
                    finite(
                        text,
                        f"{field}.{word}",
                        infinite=word.endswith("range")
                        or element.get("type") == "plane",
                    )


def _compile(path: Path, notes: Notes) -> MjModel:
    """Compile an MJCF file to MuJoCo's model; an error is shortened to one line, NaN in
    included files is refused.
    """
    root = read_xml(path, notes.add)
    require_root(root, "mujoco")
    # MuJoCo would take NaN for "not stated" without a word
    _require_finite(root)
    import mujoco

    # MuJoCo reports NaN in included files only through its global warning handler
    usual = mujoco.get_mju_user_warning()
    warnings = list[str]()
    mujoco.set_mju_user_warning(warnings.append)
    try:
        # a path that is no UTF-8 is a ValueError here, before MuJoCo sees it
        str(path).encode()
        model = mujoco.MjModel.from_xml_path(str(path))
        model.names.decode()  # MuJoCo takes bytes that are not UTF-8
        if any("NaN" in each for each in warnings):
            raise ValueError(warnings[0])
        return model
    except ValueError as error:
        text = one_line(str(error))
        cure = ", with the files that it names; put them there" * ("opening" in text)
        raise VehicleError(
            f"MJCF = {text!r}: must be a model that MuJoCo loads{cure}"
        ) from None
    finally:
        mujoco.set_mju_user_warning(usual)


NOWHERE = 1000
"""MuJoCo's enumeration value of a transmission that acts at nothing."""

SWITCHES = (
    "constraint equality frictionloss limit spring damper gravity clampctrl actuation"
)
"""Flags of a file's option without which its simulation lacks a part of the physics;
contacts are not read anyway."""


def _read_option(model: MjModel, notes: Notes) -> None:
    """Leave out the actuators that a file's option disables, with notes on what else it
    changes of the physics.
    """
    import mujoco

    bits = {
        each: int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{each.upper()}"))
        for each in SWITCHES.split()
    }
    if flags := ", ".join(
        each for each, bit in bits.items() if model.opt.disableflags & bit
    ):
        notes.add(
            f"{flags}: disabled by the option of the file; not read: here they act"
        )
    gravity = model.opt.gravity.tolist()
    if any(gravity[:2]) or gravity[2] >= 0.0:
        notes.add(
            f"gravity {gravity} of the option: not read; the scenario states gravity,"
            " along -z"
        )
    for actuator, group in enumerate(model.actuator_group.tolist()):
        # MuJoCo's option has a bit for each of the groups 0 to 30; others cannot be
        # disabled
        if group in range(31) and model.opt.disableactuator >> group & 1:
            notes.add(
                "of a group that the option disables: left out",
                name_of(model, "actuator", actuator),
                "actuator",
            )
            model.actuator_trntype[actuator] = NOWHERE


def _at_rest(model: MjModel, root: int) -> MjData:
    """Poses of the bodies, joints and sites of a MuJoCo model at rest, a free base at
    the origin of the world.
    """
    import mujoco

    if joints_of(model, root):
        # where the file puts a floating base is no property of the vehicle
        model.body_pos[root], model.body_quat[root] = (0, 0, 0), (1, 0, 0, 0)
    data = mujoco.MjData(model)
    for joint in joints_of(model, root)[:1]:
        if kind_of(model, joint) == "free":
            # a free body stands at the origin, unturned
            data.qpos[model.jnt_qposadr[joint] :][:7] = (0, 0, 0, 1, 0, 0, 0)
    # no mj_forward: poses alone are read, no forces
    mujoco.mj_kinematics(model, data)
    return data


def _root(model: MjModel, wanted: str, notes: Notes) -> tuple[int, list[int]]:
    """Body that becomes the base (0 for the world), and other bodies of the world,
    which are not read.

    Raises:
        VehicleError: several bodies could be the base, or ``wanted`` is none of them.
    """
    top = {
        body: name_of(model, "body", body)
        for body in range(1, model.nbody)
        if not model.body_parentid[body]
    }
    free = [body for body in top if _is_free(model, body)]
    moving = [
        body
        for body in top
        if body not in free and body in model.body_rootid[model.jnt_bodyid]
    ]
    heavy = [
        body
        for body in top
        if model.body_subtreemass[body] and model.body_mocapid[body] < 0
    ]
    chosen = (
        # what floats is the vehicle; else what moves; else what weighs; else all that
        # is there
        [body for body in top if top[body] == wanted]
        if wanted
        else free or moving or heavy or list(top)
    )
    listed = ", ".join(
        f"{top[body]} ({float(model.body_subtreemass[body]):.6g} kg)" for body in top
    )
    cure = f'base = "NAME" of the vehicle file takes one: {listed}'
    if wanted and not chosen:
        refuse("base", wanted, f"must be a body of the world: {listed}")
    if not wanted and free and moving:
        refuse(
            f"body[{top[moving[0]]}]",
            "beside the base",
            f"must be a part of the base's tree; {cure}",
        )
    if len(chosen) > 1 and not moving:
        what = "bodies with a free joint" if free else "bodies of the world"
        refuse(what, [top[body] for body in chosen], f"must be one, the base; {cure}")
    if len(chosen) > 1:
        notes.add(f"together on the world, which is the base; {cure}")
        return 0, []
    # a root on a hinge is moved by the world, so the world is the base
    root = (
        chosen[0]
        if chosen and (chosen[0] in free or not joints_of(model, chosen[0]))
        else 0
    )
    if root in free and len(joints_of(model, root)) > 1:
        why = (
            "on three slides and three hinges: taken as free; their limits, damping and"
            " friction are not read"
        )
        notes.add(why, top[root], "body")
    return root, [body for body in top if body not in chosen]


def _is_free(model: MjModel, body: int) -> bool:
    """True if a body of the world has a free joint, or three slides and three hinges
    that nothing holds.
    """
    joints = joints_of(model, body)
    kinds = np.array([kind_of(model, joint) for joint in joints])
    if sorted(kinds) != ["prismatic"] * 3 + ["revolute"] * 3:
        return "free" in kinds
    # an actuator, a tie or a spring on one of the six would hold the body to the world
    driven = set(
        model.actuator_trnid[np.isin(model.actuator_trntype, AT_JOINT), 0].tolist()
    )
    tied = {name_of(model, "jnt", joint) for joint in joints} & set(mimics_of(model))
    sprung = any(
        _is_stated(model, ("jnt_stiffness", "jnt_stiffnesspoly"), joint)
        for joint in joints
    )
    # only axes that span space let the body turn and slide every way
    axes = (model.jnt_axis[joints][kinds == each] for each in set(kinds))
    # MuJoCo keeps axes at unit length: 1e-6 is far above their rounding
    return not (driven & {*joints} or tied or sprung) and all(
        np.linalg.matrix_rank(each, 1e-6) == 3 for each in axes
    )


def _read_child(tree: _MujocoTree, body: int) -> None:
    """Add a body and its joints to the tree; MuJoCo applies the joints in sequence,
    each about its own anchor.
    """
    model = tree.model
    name = name_of(tree.model, "body", body)
    carrier = tree.seats[model.body_parentid[body]]
    at = posed_in(carrier, *_pose_of(model, "body", body))
    joints = joints_of(model, body)
    balls = [joint for joint in joints if kind_of(model, joint) == "ball"]
    tree.balls |= {name_of(model, "jnt", joint) for joint in balls}
    moving = [
        joint for joint in joints if joint not in balls and not _is_fixed(tree, joint)
    ]
    for joint in joints:
        anchor = description.vector(model.jnt_pos[joint])
        at = posed_in(at, Mat3.identity(), anchor)
        if joint in moving:
            silent = name_of(model, "jnt", joint) in tree.of_rotors
            made = read_joint(
                model,
                joint,
                at.rotation,
                at.position,
                Notes() if silent else tree.notes,
            )
            # only the last joint carries the body; those before it move massless links
            link = name if joint == moving[-1] else tree.unique(f"{name}.{made.name}")
            at = tree.add_link(link, at.link, made)
        elif joint not in balls:
            at = _held_pose(tree, joint, at)
        # each joint turns about its own anchor, and the next pose counts from the
        # body's origin again
        at = posed_in(at, Mat3.identity(), -anchor)
    tree.seats[body] = at
    if not moving:
        tree.frames.append(replace(at, name=name))
    _read_body(tree, body)


def _is_fixed(tree: _MujocoTree, joint: int) -> bool:
    """True if a joint cannot move: it follows a fixed joint, or follows any joint while
    mimic joints are locked.
    """
    name = name_of(tree.model, "jnt", joint)
    if name not in tree.mimics or not tree.coupled:
        return name in tree.mimics
    leader = follow(name, tree.mimics)
    return not leader.joint or leader.ratio == 0.0


def _held_pose(tree: _MujocoTree, joint: int, at: Frame) -> Frame:
    """Pose of the body behind a joint that is fixed at a constant value."""
    name = name_of(tree.model, "jnt", joint)
    value = resting(tree.model, name, tree.mimics)
    tree.notes.add(f"tied by an equality: fixed at {value:g}", name)
    return posed_in(
        at,
        *held_pose(
            kind_of(tree.model, joint),
            description.vector(tree.model.jnt_axis[joint]),
            value,
        ),
    )


def _read_body(tree: _MujocoTree, body: int) -> None:
    """Add the mass and the sites (named frames) of a MuJoCo body to the tree."""
    model = tree.model
    at = tree.seats[body]
    mass = float(model.body_mass[body])
    # the world has no mass of its own, also where MuJoCo gives it static geometry
    if mass > 0.0 and body:
        R = description.rotation(at.rotation @ _rotation(model.body_iquat[body]))
        com = at.position + at.rotation.apply(description.vector(model.body_ipos[body]))
        moments = Sym3.from_numbers(*model.body_inertia[body].tolist())
        weight = Body(mass=mass, com=com, inertia=moments.rotate(R))
        tree.add_body(at_origin(at.link), weight)
    # geoms of the world are its floor and walls
    touching = (model.geom_contype | model.geom_conaffinity).astype(bool)
    link = name_of(model, "body", body)
    for geom in np.flatnonzero(touching & (model.geom_bodyid == (body or -1))):
        read = partial(_shape_of, model, int(geom), link)
        tree.looks.append(file_shape(at, link, read))
    for site in range(model.nsite):
        name = name_of(model, "site", site)
        if model.site_bodyid[site] == body and (
            # unnamed sites are marks of a viewer, unless a rotor pushes there
            model.site(site).name or name in tree.carrying
        ):
            R, p = _pose_of(model, "site", site)
            tree.sites[name] = tree.unique(name)
            tree.frames.append(posed_in(at, R, p, tree.sites[name]))


GEOMS = "plane heightfield sphere capsule ellipsoid cylinder box hull sdf"
"""Shapes of geoms, in the order of MuJoCo's enumeration; its mesh is a hull."""


def _shape_of(model: MjModel, geom: int, link: str, notes: Notes) -> Collision | None:
    """Shape of a geom; None, with a note, for one that has no counterpart."""
    kind = GEOMS.split()[model.geom_type[geom]]
    if kind not in COLLISION_SIZES:
        notes.add(f"its {kind} left out: no shape that touches", link, "link")
        return None
    at = posed_in(at_origin(), *_pose_of(model, "geom", geom))
    return collision_of(link, kind, at, _size_of(model, geom, kind), notes)


def _size_of(model: MjModel, geom: int, kind: str) -> list[float] | Array:
    """Lengths (m) of a geom as of ``COLLISION_SIZES``, or the vertices of its mesh."""
    if kind == "hull":
        mesh = model.geom_dataid[geom]
        first = model.mesh_vertadr[mesh]
        rows = slice(first, first + model.mesh_vertnum[mesh])
        vertices: Array = model.mesh_vert[rows].astype(float)
        return vertices
    # MuJoCo states halves of all lengths but radii
    return [
        half if word == "radius" else 2.0 * half
        for word, half in zip(
            COLLISION_SIZES[kind], model.geom_size[geom].tolist(), strict=False
        )
    ]


UNREAD = "surfacevel margin gap adhesion"
"""Attributes of a geom that change its contacts and are not read."""


@positional
class SceneShape:
    """Shape of a scene: its name and pose, its words as those of a surface, and its
    friction coefficient.

    The heights of a heightfield are numbers from 0 to 1.
    """

    at: Frame
    words: dict[str, Any]
    friction: Scalar


def words_of(shape: Collision) -> dict[str, Any]:
    """Shape, lengths and corners of a shape that touches."""
    return {each: getattr(shape, each) for each in ("shape", "size", "vertices")}


def _relief_of(model: MjModel, index: int) -> dict[str, Any]:
    """Lengths (m) and heights of a heightfield of MuJoCo."""
    x, y, height, base = model.hfield_size[index].tolist()
    rows, columns = model.hfield_nrow[index], model.hfield_ncol[index]
    first = model.hfield_adr[index]
    heights = model.hfield_data[first : first + rows * columns].reshape(rows, columns)
    return {"size": (2.0 * x, 2.0 * y, height, base), "heights": heights}


def read_image(path: Path, scale: Sequence[Scalar], base: float) -> dict[str, Any]:
    """Lengths (m) and heights of the heightfield of an image, as MuJoCo reads it.

    Args:
        path: path of a PNG file.
        scale: distance of pixels along x and y, and of the highest from the lowest, m.
        base: thickness below the lowest, m.

    Raises:
        ValueError: one line: no image.
    """
    import mujoco

    spec = mujoco.MjSpec()
    # any size: heights of an image are from 0 to 1, and nothing else is read of it
    spec.add_hfield(name="image", file=str(path), size=[1.0] * 4)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="image")
    try:
        heights = _relief_of(spec.compile(), 0)["heights"]
    except ValueError as error:
        raise ValueError(f"MuJoCo reads no image: {one_line(str(error))}") from None
    # pixels are corners of the relief: one gap less than pixels
    y, x = (each - 1.0 for each in heights.shape)
    size = (x * scale[0], y * scale[1], scale[2], base)
    return {"shape": "heightfield", "size": size, "heights": heights}


def read_scene(path: Path, prefix: str, most: int, notes: Notes) -> list[SceneShape]:
    """Shapes of the geoms of an MJCF file that may touch and do not move, in its axes.

    Args:
        path: path of the file.
        prefix: begins the names of the shapes.
        most: largest number of corners of a hull.
        notes: takes what is left out, and a note on each hull without some corners of
            its mesh.

    Raises:
        VehicleError: without the file's name: no shape.
    """
    model = _compile(path, notes)
    moves = (model.body_jntnum > 0) | (model.body_mocapid >= 0)
    data = _at_rest(model, 0)
    shapes = list[SceneShape]()
    cure = "what moves is one of [[world.objects]] or a vehicle"
    for body in np.flatnonzero(moves).tolist():
        notes.add(f"moves: left out; {cure}", name_of(model, "body", body), "body")
    for geom in np.flatnonzero(model.geom_contype | model.geom_conaffinity).tolist():
        if any(moves[body] for body in carriers(model, model.geom_bodyid[geom])):
            continue
        name = name_of(model, "geom", geom)
        kind = GEOMS.split()[model.geom_type[geom]]
        if kind not in ("plane", "heightfield", *COLLISION_SIZES):
            why = f"{kind}: left out; it touches in MuJoCo alone"
            notes.add(why, name, "geom")
            continue
        R = Mat3.from_numbers(data.geom_xmat[geom].reshape(3, 3).tolist())
        p = description.vector(data.geom_xpos[geom])
        at = posed_in(at_origin(), R, p, prefix + name)
        words: dict[str, Any] = {"shape": kind}
        if kind == "heightfield":
            words |= _relief_of(model, model.geom_dataid[geom])
        elif kind != "plane":
            size = _size_of(model, geom, kind)
            words |= words_of(collision_of(at.name, kind, at, size, notes, most))
        for word in UNREAD.split():
            # an older MuJoCo has fewer of them
            if np.any(getattr(model, f"geom_{word}", model.geom_gap)[geom]):
                notes.add(f"{word}: not read", name, "geom")
        # the first number is for sliding, the other two for spinning and rolling
        shapes.append(SceneShape(at, words, float(model.geom_friction[geom][0])))
    if model.npair:
        notes.add(f"{model.npair} stated pairs: not read; all surfaces touch")
    if not shapes:
        allowed = "must be one or more that touch (contype or conaffinity) and rest"
        refuse("geoms", 0, f"{allowed}; {cure}")
    return shapes


def _pose_of(model: MjModel, kind: str, index: int) -> tuple[Mat3, Vec3]:
    """Rotation and position (m) of a body or site in the body that carries it."""
    wxyz, place = (getattr(model, f"{kind}_{part}")[index] for part in ("quat", "pos"))
    return _rotation(wxyz), description.vector(place)


def _rotation(wxyz: Array) -> Mat3:
    return description.rotation(Quaternion(*wxyz.tolist()).normalized().rotation())


KINDS = ("free", "ball", "prismatic", "revolute")
"""Kinds of joints, in the order of MuJoCo's enumeration."""


def kind_of(model: MjModel, joint: int) -> str:
    """Kind of a MuJoCo joint, one of ``KINDS``."""
    return KINDS[model.jnt_type[joint]]


def read_joint(model: MjModel, joint: int, R: Mat3, p: Vec3, notes: Notes) -> Joint:
    """Convert a MuJoCo joint to this library's joint, with zero at the model's
    reference position (``ref``).
    """
    name = name_of(model, "jnt", joint)
    if model.qpos0[model.jnt_qposadr[joint]]:
        notes.add("with a ref: its zero here is where the file's model stands", name)
    lower, upper = limits(model, joint)
    dof = model.jnt_dofadr[joint]
    given = {
        "damping": "dof_damping",
        "coulomb": "dof_frictionloss",
        "armature": "dof_armature",
    }
    rubbing: dict[str, Any] = {
        ours: description.zero_is_structure(float(getattr(model, theirs)[dof]))
        for ours, theirs in given.items()
    }
    axis = description.unit_axis(f"joint[{name}].axis", model.jnt_axis[joint])
    return Joint(
        name=name,
        kind=kind_of(model, joint),
        axis=axis,
        position=p,
        rotation=R,
        lower=lower,
        upper=upper,
        effort_limit=effort_of(model, joint, notes),
        **rubbing,
    )


def mimics_of(model: MjModel) -> dict[str, Mimic]:
    """Mimic relation of each joint from the file's joint equalities; the leader of a
    locked joint is "".

    Raises:
        VehicleError: an equality that is not linear.
    """
    import mujoco

    mimics: dict[str, Mimic] = {}
    for each in range(model.neq):
        if model.eq_type[each] != mujoco.mjtEq.mjEQ_JOINT or not model.eq_active0[each]:
            continue
        name = name_of(model, "jnt", model.eq_obj1id[each])
        other = model.eq_obj2id[each]
        numbers = [float(value) for value in model.eq_data[each][:5]]
        # a curve has no constant ratio, and a follower here has
        if any(numbers[2:]):
            refuse(
                f"equality of joint[{name}].polycoef",
                numbers,
                "must be a straight line: two numbers, then zeros",
            )
        if name in mimics:
            refuse(f"equality of joint[{name}]", "two of them", "must be at most one")
        leader = name_of(model, "jnt", other) if other >= 0 else ""
        offset, ratio = numbers[:2]
        driven = (
            other >= 0
            and at_joint(model, model.eq_obj1id[each])
            and not at_joint(model, other)
        )
        # MuJoCo's ties bind both: what is driven leads
        if driven and ratio and leader not in mimics:
            name, leader, offset, ratio = leader, name, -offset / ratio, 1.0 / ratio
        mimics[name] = Mimic(leader, ratio, offset)
    return mimics


def resting(model: MjModel, name: str, mimics: Mapping[str, Mimic]) -> float:
    """Value of a mimic joint while the last leader in its chain of mimic joints is at
    rest.
    """
    leader = follow(name, mimics)
    return leader.at_rest(
        *(limits(model, model.joint(leader.joint).id) if leader.joint else (0.0, 0.0))
    )


TENDON_FORCES = (
    "tendon_stiffness",
    "tendon_damping",
    "tendon_frictionloss",
    "tendon_limited",
    "tendon_armature",
)


def require_supported(
    model: MjModel, root: int, notes: Notes
) -> dict[str, frozenset[str]]:
    """Elements of an MJCF file that are not supported: error -> joints that make it
    harmless if all are held.

    Args:
        model: MuJoCo's model.
        root: body that is the base, 0 for the world.
        notes: takes what is ignored.

    Raises:
        VehicleError: the first element that no held joint makes harmless.
    """
    faults = {**_joint_faults(model, notes), **_loop_faults(model, root)}
    for tendon in range(model.ntendon):
        name = name_of(model, "tendon", tendon)
        wraps = slice(model.tendon_adr[tendon], None)
        if not _is_stated(model, TENDON_FORCES, tendon):
            notes.add("not read", name, "tendon")
        else:
            # the wraps of all tendons lie in one array; those of this one begin at its
            # address
            joints = model.wrap_objid[wraps][: model.tendon_num[tendon]]
            fault = (
                f"tendon[{name}] = 'a pull of its own': must pull nothing; tendons are"
                " not supported"
            )
            if (model.wrap_type[wraps][: len(joints)] != 1).any():
                raise VehicleError(fault)
            faults[fault] = frozenset(name_of(model, "jnt", joint) for joint in joints)
    # a body that MuJoCo holds up would fall here
    for body in range(1, model.nbody):
        if model.body_gravcomp[body]:
            refuse(
                f"body[{name_of(model, 'body', body)}].gravcomp",
                float(model.body_gravcomp[body]),
                "must be 0",
            )
    if model.nflex:
        refuse("flex", model.nflex, "must be rigid bodies only")
    for actuator in range(model.nactuator):
        name = name_of(model, "actuator", actuator)
        if _is_stated(model, ("actuator_armature", "actuator_damping"), actuator):
            refuse(
                f"actuator[{name}]",
                "armature or damping of its own",
                "must be stated at its joint",
            )
        if model.actuator_trntype[actuator] not in (*AT_JOINT, SITE, NOWHERE):
            notes.add("not at a joint or site, so not read", name, "actuator")
    if model.opt.density or model.opt.viscosity:
        notes.add(
            "density and viscosity of the option are not read; [drag] and the"
            " scenario's air say that"
        )
    return faults


def _is_stated(model: MjModel, names: tuple[str, ...], index: int) -> bool:
    """True if one of the named arrays of a MuJoCo model is nonzero at an index."""
    return any(getattr(model, name)[index].any() for name in names)


def _joint_faults(model: MjModel, notes: Notes) -> dict[str, frozenset[str]]:
    """Ball joints, springs and nonlinear damping, with their joints; notes on what a
    free joint has of these.
    """
    faults = {}
    for joint in range(model.njnt):
        name = name_of(model, "jnt", joint)
        kind = kind_of(model, joint)
        dof = model.jnt_dofadr[joint]
        own = frozenset({name})
        if kind == "ball":
            faults[
                f"joint[{name}].type = 'ball': must be 'hinge' or 'slide'; or three"
                " hinges in one body"
            ] = own
        if _is_stated(model, ("jnt_stiffness", "jnt_stiffnesspoly"), joint):
            stiffness = model.jnt_stiffness[joint].ravel().tolist()[0]
            faults[
                f"joint[{name}].stiffness = {stiffness}: must be 0; springs are not"
                " supported"
            ] = own
        if _is_stated(model, ("dof_dampingpoly",), dof):
            faults[f"joint[{name}].damping = 'a polynomial': must be one number"] = own
        if kind == "free" and _is_stated(
            model, ("dof_armature", "dof_damping", "dof_frictionloss"), dof
        ):
            notes.add(
                "free, with armature or friction of the file's defaults, not read; a"
                " <freejoint/> has none",
                name,
            )
        # a fault of the free joint cannot be cured by holding it: the vehicle would not
        # fly
        if kind == "free" and own in faults.values():
            raise VehicleError(list(faults)[-1])
    return faults


def _loop_faults(model: MjModel, root: int) -> dict[str, frozenset[str]]:
    """Equalities that close a chain, with the joints between their two bodies."""
    import mujoco

    kinds = {
        int(mujoco.mjtEq.mjEQ_CONNECT): "connect",
        int(mujoco.mjtEq.mjEQ_WELD): "weld",
    }
    faults = {}
    for each in range(model.neq):
        kind = model.eq_type[each]
        ends = (model.eq_obj1id[each], model.eq_obj2id[each])
        if not model.eq_active0[each] or kind == mujoco.mjtEq.mjEQ_JOINT:
            continue
        allowed = (
            "closed chains are not supported"
            if kind in kinds
            else "only equalities of joints are supported"
        )
        fault = f"equality[{each}] = {kinds.get(kind, 'of another kind')!r}: {allowed}"
        at_bodies = kind in kinds and model.eq_objtype[each] == mujoco.mjtObj.mjOBJ_BODY
        trees = set(model.body_rootid[list(ends)].tolist()) if at_bodies else set()
        # it holds the vehicle to its world
        if not at_bodies or (root and root in trees and len(trees) > 1):
            raise VehicleError(f"{fault}; must be left out of the file")
        first, second = (set(carriers(model, body)) for body in ends)
        # the joints on either path from the two bodies to their common ancestor
        faults[fault] = frozenset(
            name_of(model, "jnt", j)
            for body in first ^ second
            for j in joints_of(model, body)
        )
    return faults
