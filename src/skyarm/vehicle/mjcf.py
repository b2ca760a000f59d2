"""MJCF files: read a vehicle's rigid bodies and joints with MuJoCo's parser.

The body with the free joint is the base; without one it is the only body of the world, which then floats, or the world
itself. Hinges and slides become joints, several of one body joints with massless links between them. Sites, and bodies
without joints, become frames. What has no counterpart is refused by its name.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skyarm.algebra import Mat3, Quaternion, Sym3, Vec3
from skyarm.records.arrays import Array
from skyarm.records.files import one_line
from skyarm.vehicle import description
from skyarm.vehicle.attach import BodyTree, Mimic, Notes, RigidBodies, follow, held_pose, posed_in
from skyarm.vehicle.check import VehicleError, refuse
from skyarm.vehicle.linkage import BASE, Body, Joint
from skyarm.vehicle.stated_rotors import RotorFile, rotors_in
from skyarm.vehicle.vehicle_records import Frame
from skyarm.vehicle.xml_elements import read_xml

if TYPE_CHECKING:
    from mujoco import MjModel


class _Tree(BodyTree):
    """Kinematic tree of a compiled MuJoCo model, with the frame of each of its bodies."""

    def __init__(self, model: MjModel, coupled: bool, notes: Notes) -> None:
        super().__init__(mimics_of(model), notes)
        self.model, self.coupled = model, coupled
        self.seats: dict[int, Frame] = {}

    def unique(self, name: str) -> str:
        """Unique name, with underscores appended where needed: MuJoCo has separate names for each kind of element."""
        taken = {frame.name for frame in self.frames} | {link.name for link in self.links}
        while name in taken:
            name += "_"
        return name


def read_mjcf(path: Path, mimic: str = "lock") -> RigidBodies:
    """Read rigid bodies, joints and frames of an MJCF file.

    Args:
        path: path of the file.
        mimic: "lock" or "couple": joints that an equality ties to others are fixed where they rest, or follow.

    Raises:
        VehicleError: without the file's name, which the caller adds.
    """
    model, notes = _compile(path), Notes()
    require_supported(model, notes)
    root, left_out = _root(model)
    for body in left_out:
        notes.add("fixed to the world beside the vehicle; not read", name_of(model, "body", body), "body")
    tree = _Tree(model, mimic == "couple", notes)
    tree.seats[root] = Frame(name="", link=BASE, position=Vec3(0, 0, 0))
    _read_body(tree, root)
    for body in range(1, int(model.nbody)):
        if body != root and int(model.body_parentid[body]) in tree.seats and body not in left_out:
            _read_child(tree, body)
    title = model.names[: model.names.index(b"\0")].decode() or path.stem
    bodies = tree.bodies(title, name_of(model, "body", root) if root else "world", tree.coupled)
    return replace(bodies, rotors=rotors_in(RotorFile(path, model)))


def _compile(path: Path) -> MjModel:
    """Compile an MJCF file to MuJoCo's model; warnings are silenced, and an error is shortened to one line."""
    root = read_xml(path)
    if root.tag != "mujoco":
        refuse("root element", root.tag, "must be <mujoco>; a URDF file's name ends in .urdf")
    import mujoco

    usual = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(_ignore)
    try:
        str(path).encode()
        model = mujoco.MjModel.from_xml_path(str(path))
        model.names.decode()  # MuJoCo takes bytes that are not UTF-8
        return model
    except ValueError as error:
        raise VehicleError(f"MJCF = {one_line(str(error))!r}: must be a model that MuJoCo loads") from None
    finally:
        mujoco.set_mju_user_warning(usual)


def _ignore(text: str) -> None:
    """Discard a warning of MuJoCo."""


def _root(model: MjModel) -> tuple[int, list[int]]:
    """Body that becomes the base (0 for the world), and other bodies fixed to the world, which are ignored."""
    top = [body for body in range(1, int(model.nbody)) if model.body_parentid[body] == 0]
    free = [body for body in top if _joints(model, body) and kind_of(model, _joints(model, body)[0]) == "free"]
    if len(free) > 1:
        names = [name_of(model, "body", body) for body in free]
        refuse("bodies with a free joint", names, "must be one, the base")
    alone = [body for body in top if body not in free]
    if not free and len(alone) == 1 and not _joints(model, alone[0]):
        return alone[0], []
    if not free:
        return 0, []
    for body in alone:
        if any(_joints(model, each) for each in _subtree(model, body)):
            refuse(f"body[{name_of(model, 'body', body)}]", "beside the base", "must be a part of the base's tree")
    return free[0], alone


def _subtree(model: MjModel, body: int) -> list[int]:
    """A body of a MuJoCo model and all its descendants, as body numbers."""
    bodies = [body]
    for each in range(body + 1, int(model.nbody)):
        if int(model.body_parentid[each]) in bodies:
            bodies.append(each)
    return bodies


def _joints(model: MjModel, body: int) -> list[int]:
    first = int(model.body_jntadr[body])
    return list(range(first, first + int(model.body_jntnum[body])))


def _read_child(tree: _Tree, body: int) -> None:
    """Add a body and its joints to the tree; MuJoCo applies the joints in sequence, each about its own anchor."""
    model, name = tree.model, name_of(tree.model, "body", body)
    carrier = tree.seats[int(model.body_parentid[body])]
    at = posed_in(carrier, _rotation(model.body_quat[body]), _vector(model.body_pos[body]))
    moving = [joint for joint in _joints(model, body) if not _is_fixed(tree, joint)]
    for joint in _joints(model, body):
        anchor = _vector(model.jnt_pos[joint])
        at = posed_in(at, Mat3.identity(), anchor)
        if joint in moving:
            made = read_joint(model, joint, at.rotation, at.position, tree.notes)
            link = name if joint == moving[-1] else tree.unique(f"{name}.{made.name}")
            at = tree.add_link(link, at.link, made)
        else:
            at = _held_pose(tree, joint, at)
        at = posed_in(at, Mat3.identity(), -anchor)
    tree.seats[body] = at
    if not moving:
        tree.frames.append(replace(at, name=tree.unique(name)))
    _read_body(tree, body)


def _is_fixed(tree: _Tree, joint: int) -> bool:
    """True if a joint cannot move: it follows a fixed joint, or follows any joint while mimic joints are locked."""
    name = name_of(tree.model, "jnt", joint)
    if name not in tree.mimics or not tree.coupled:
        return name in tree.mimics
    leader = follow(name, tree.mimics)
    return not leader.joint or leader.ratio == 0.0


def _held_pose(tree: _Tree, joint: int, at: Frame) -> Frame:
    """Pose of the body behind a joint that is fixed at a constant value."""
    name = name_of(tree.model, "jnt", joint)
    value = resting(tree.model, name, tree.mimics)
    tree.notes.add(f"tied by an equality: fixed at {value:g}", name)
    return posed_in(at, *held_pose(kind_of(tree.model, joint), _vector(tree.model.jnt_axis[joint]), value))


def _read_body(tree: _Tree, body: int) -> None:
    """Add the mass and the sites (named frames) of a MuJoCo body to the tree."""
    model, at = tree.model, tree.seats[body]
    mass = float(model.body_mass[body])
    if mass > 0.0 and body:
        R = description.rotation(at.rotation @ _rotation(model.body_iquat[body]))
        com = at.position + at.rotation.apply(_vector(model.body_ipos[body]))
        moments = Sym3.from_numbers(*model.body_inertia[body].tolist())
        tree.add_body(at.link, Body(mass=mass, com=com, inertia=moments.rotate(R)))
    for site in range(int(model.nsite)):
        if int(model.site_bodyid[site]) == body and model.site(site).name:
            pose = _rotation(model.site_quat[site]), _vector(model.site_pos[site])
            tree.frames.append(posed_in(at, *pose, tree.unique(model.site(site).name)))


def _vector(values: Array) -> Vec3:
    return description.vector(values.tolist())


def _rotation(wxyz: Array) -> Mat3:
    return description.rotation(Quaternion(*wxyz.tolist()).normalized().rotation())


KINDS = ("free", "ball", "prismatic", "revolute")
"""Kinds of joints, in the order of MuJoCo's enumeration."""

AT_JOINT = (0, 1)
"""MuJoCo's enumeration values of the transmissions that act at a joint."""


def kind_of(model: MjModel, joint: int) -> str:
    """Kind of a MuJoCo joint, one of ``KINDS``."""
    return KINDS[int(model.jnt_type[joint])]


def read_joint(model: MjModel, joint: int, R: Mat3, p: Vec3, notes: Notes) -> Joint:
    """Convert a MuJoCo joint to this library's joint, with zero at the model's reference position (``ref``)."""
    name = name_of(model, "jnt", joint)
    if model.qpos0[model.jnt_qposadr[joint]]:
        notes.add("with a ref: its zero here is where the file's model stands", name)
    lower, upper = limits(model, joint)
    effort = _effort(model, joint)
    if effort == 0.0:
        notes.add("without an actuator, so passive; [[joints]] effort_limit gives it a drive", name)
    dof = int(model.jnt_dofadr[joint])
    given = {"damping": "dof_damping", "coulomb": "dof_frictionloss", "armature": "dof_armature"}
    rubbing: dict[str, Any] = {
        ours: description.zero_is_structure(float(getattr(model, theirs)[dof])) for ours, theirs in given.items()
    }
    axis = description.unit_axis(f"joint[{name}].axis", model.jnt_axis[joint].tolist())
    return Joint(
        name=name,
        kind=kind_of(model, joint),
        axis=axis,
        position=p,
        rotation=R,
        lower=lower,
        upper=upper,
        effort_limit=effort,
        **rubbing,
    )


def _effort(model: MjModel, joint: int) -> float:
    """Effort limit of a joint from all its actuators together, N m or N; 0 without actuators."""
    total = 0.0
    for actuator in range(int(model.nu)):
        if int(model.actuator_trntype[actuator]) in AT_JOINT and int(model.actuator_trnid[actuator][0]) == joint:
            total += abs(float(model.actuator_gear[actuator][0])) * _largest_force(model, actuator)
    if model.jnt_actfrclimited[joint]:
        total = min(total, max(abs(float(each)) for each in model.jnt_actfrcrange[joint]))
    return total


def _largest_force(model: MjModel, actuator: int) -> float:
    """Largest actuator force or torque (N or N m) before the gear, from its force range or proportional control."""
    largest = math.inf
    if model.actuator_forcelimited[actuator]:
        largest = max(abs(float(each)) for each in model.actuator_forcerange[actuator])
    plain = not model.actuator_gaintype[actuator] and not model.actuator_biastype[actuator]
    if plain and model.actuator_ctrllimited[actuator]:
        gain = abs(float(model.actuator_gainprm[actuator][0]))
        largest = min(largest, gain * max(abs(float(each)) for each in model.actuator_ctrlrange[actuator]))
    return largest


def mimics_of(model: MjModel) -> dict[str, Mimic]:
    """Mimic relation of each joint from the file's joint equalities; the leader of a locked joint is "".

    Raises:
        VehicleError: an equality that is not linear.
    """
    import mujoco

    mimics: dict[str, Mimic] = {}
    for each in range(int(model.neq)):
        if model.eq_type[each] != mujoco.mjtEq.mjEQ_JOINT or not model.eq_active0[each]:
            continue
        name, other = name_of(model, "jnt", int(model.eq_obj1id[each])), int(model.eq_obj2id[each])
        numbers = [float(value) for value in model.eq_data[each][:5]]
        if any(numbers[2:]):
            refuse(f"equality of joint[{name}].polycoef", numbers, "must be a straight line: two numbers, then zeros")
        if name in mimics:
            refuse(f"equality of joint[{name}]", "two of them", "must be at most one")
        mimics[name] = Mimic(name_of(model, "jnt", other) if other >= 0 else "", numbers[1], numbers[0])
    return mimics


def resting(model: MjModel, name: str, mimics: Mapping[str, Mimic]) -> float:
    """Value of a mimic joint while the last leader in its chain of mimic joints is at rest."""
    leader = follow(name, mimics)
    return leader.at_rest(*(limits(model, model.joint(leader.joint).id) if leader.joint else (0.0, 0.0)))


def limits(model: MjModel, joint: int) -> tuple[float, float]:
    """Lower and upper joint limit relative to the reference position, rad or m; infinite without limits."""
    if not model.jnt_limited[joint]:
        return -math.inf, math.inf
    zero = float(model.qpos0[model.jnt_qposadr[joint]])
    lower, upper = (float(each) - zero for each in model.jnt_range[joint])
    return lower, upper


def name_of(model: MjModel, kind: str, index: int) -> str:
    """Name of an element of a MuJoCo model; made from its index if the file states none."""
    return str(getattr(model, kind)(index).name) or f"{kind}{index}"


TENDON_FORCES = ("tendon_stiffness", "tendon_damping", "tendon_frictionloss", "tendon_limited", "tendon_armature")


def require_supported(model: MjModel, notes: Notes) -> None:
    """Raise an error for unsupported MJCF elements, such as springs, and add notes on ignored elements.

    Raises:
        VehicleError: the first of them.
    """
    _require_plain_joints(model)
    for tendon in range(int(model.ntendon)):
        name = name_of(model, "tendon", tendon)
        if _is_stated(model, TENDON_FORCES, tendon):
            refuse(f"tendon[{name}]", "a pull of its own", "must pull nothing; tendons are not supported")
        notes.add("not read", name, "tendon")
    for body in range(1, int(model.nbody)):
        if model.body_gravcomp[body]:
            refuse(f"body[{name_of(model, 'body', body)}].gravcomp", float(model.body_gravcomp[body]), "must be 0")
    if model.nflex:
        refuse("flex", int(model.nflex), "must be rigid bodies only")
    for actuator in range(int(model.nu)):
        name = name_of(model, "actuator", actuator)
        if _is_stated(model, ("actuator_armature", "actuator_damping"), actuator):
            refuse(f"actuator[{name}]", "armature or damping of its own", "must be stated at its joint")
        if int(model.actuator_trntype[actuator]) not in AT_JOINT:
            notes.add("not at a joint, so not read; rotors are stated in [[rotors]]", name, "actuator")
    if model.opt.density or model.opt.viscosity:
        notes.add("density and viscosity of the option are not read; [drag] and the scenario's air say that")


def _is_stated(model: MjModel, names: tuple[str, ...], index: int) -> bool:
    """True if one of the named arrays of a MuJoCo model is nonzero at an index."""
    return any(getattr(model, name)[index].any() for name in names)


def _require_plain_joints(model: MjModel) -> None:
    """Raise an error for ball joints, springs, nonlinear damping and closed chains."""
    import mujoco

    for joint in range(int(model.njnt)):
        field = f"joint[{name_of(model, 'jnt', joint)}]"
        if kind_of(model, joint) == "ball":
            refuse(f"{field}.type", "ball", "must be 'hinge' or 'slide'; or three hinges in one body")
        if _is_stated(model, ("jnt_stiffness", "jnt_stiffnesspoly"), joint):
            stiffness = model.jnt_stiffness[joint].ravel().tolist()[0]
            refuse(f"{field}.stiffness", stiffness, "must be 0; springs are not supported")
        if _is_stated(model, ("dof_dampingpoly",), int(model.jnt_dofadr[joint])):
            refuse(f"{field}.damping", "a polynomial", "must be one number")
    kinds = {int(mujoco.mjtEq.mjEQ_CONNECT): "connect", int(mujoco.mjtEq.mjEQ_WELD): "weld"}
    for each in range(int(model.neq)):
        kind = int(model.eq_type[each])
        if model.eq_active0[each] and kind != mujoco.mjtEq.mjEQ_JOINT:
            allowed = "closed chains are not supported" if kind in kinds else "only equalities of joints are supported"
            refuse(f"equality[{each}]", kinds.get(kind, "of another kind"), allowed)
