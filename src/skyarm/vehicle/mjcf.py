"""MJCF files: the rigid bodies and joints of a vehicle, as MuJoCo's own parser reads them.

The body with the free joint is the base; without one it is the only body of the world, which then floats, or the world
itself. Hinges and slides become joints, several of one body joints with massless links between them. Sites, and bodies
without joints, become frames. What has no counterpart is refused by its name.
"""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from skyarm.algebra import Mat3, Quaternion, Sym3, Vec3
from skyarm.records.files import one_line
from skyarm.vehicle import description
from skyarm.vehicle.attach import Mimic, Notes, RigidBodies, follow, held_pose, posed_in
from skyarm.vehicle.check import VehicleError, refuse
from skyarm.vehicle.linkage import BASE, Body, Joint, Link
from skyarm.vehicle.vehicle_records import Frame


@dataclass(slots=True)
class _Tree:
    """Bodies, joints and frames read so far.

    Attributes:
        model: MuJoCo's, compiled.
        mimics: joint -> what it follows.
        mimic: "lock" or "couple".
        links, frames: read so far.
        parts: of the base and of each link.
        seats: MuJoCo's body -> moving body that carries it, and pose in that one.
    """

    model: Any
    mimics: dict[str, Mimic]
    mimic: str
    notes: Notes
    links: list[Link] = field(default_factory=list)
    frames: list[Frame] = field(default_factory=list)
    parts: list[list[Body]] = field(default_factory=lambda: [[]])
    seats: dict[int, Frame] = field(default_factory=dict)


def read_mjcf(path: Path, mimic: str = "lock") -> RigidBodies:
    """Rigid bodies of an MJCF file.

    Args:
        path: of the file.
        mimic: "lock" or "couple": joints that an equality ties to others are fixed where they rest, or follow.

    Raises:
        VehicleError: without the file's name, which the caller adds.
    """
    model = _compile(path)
    notes = Notes()
    refuse_what_is_not_here(model, notes)
    root, left_out = _root(model)
    for body in left_out:
        notes.add("fixed to the world beside the vehicle; not read", name_of(model, "body", body), "body")
    tree = _Tree(model, mimics_of(model), mimic, notes)
    tree.seats[root] = Frame(name="", link=BASE, position=Vec3(0, 0, 0))
    _read_body(tree, root)
    for body in range(1, int(model.nbody)):
        if body != root and int(model.body_parentid[body]) in tree.seats and body not in left_out:
            _read_child(tree, body)
    base, *bodies = (description.body(each) if each else Body(mass=0.0) for each in tree.parts)
    links = tuple(replace(link, body=body) for link, body in zip(tree.links, bodies, strict=True))
    moving = {link.joint.name for link in links}
    kept = {name: each for name, each in tree.mimics.items() if name in moving} if mimic == "couple" else {}
    name = name_of(model, "body", root) if root else "world"
    title = path.stem if model.names[:1] == b"\0" else model.names[: model.names.index(b"\0")].decode()
    return RigidBodies(title, name, base, links, tuple(tree.frames), kept, notes.lines())


SECONDS, BYTES = 20.0, 4 * 2**30
"""Most time and memory of compiling a file: a line of XML can take hours or fill a disk, and MuJoCo heeds no signal."""

MOST_TEXT, MOST_COMPILED = 10e6, 100e6
"""Bytes of a file, and of its compiled model."""

PLAIN = (
    *("mujoco", "compiler", "option", "default", "worldbody", "body", "inertial", "joint", "freejoint", "geom", "site"),
    *("light", "actuator", "motor", "position", "velocity", "equality", "contact", "exclude"),
)
"""Elements of which some thousand compile at once: nothing in them repeats, generates or reads."""

MOST_PLAIN = 2000

COMPILE = """
import sys
try:
    import resource
    resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[3]),) * 2)
except (ImportError, ValueError):
    pass
import mujoco
try:
    mujoco.mj_saveModel(mujoco.MjModel.from_xml_path(sys.argv[1]), sys.argv[2])
except ValueError as error:
    print(error)
"""
"""Program of a process of its own: paths of XML and compiled model, and bytes of memory."""


def _compile(path: Path) -> Any:
    """MuJoCo's model of a file; its warnings and its errors on many lines become one line."""
    if (size := path.stat().st_size) > MOST_TEXT:
        raise VehicleError(f"XML: has {size / 1e6:.0f} MB, must have at most {MOST_TEXT / 1e6:.0f} MB")
    content = path.read_bytes().lstrip()
    try:
        read = ET.fromstring(content)
    except (ET.ParseError, LookupError, ValueError) as error:
        raise VehicleError(f"XML = {str(error)!r}: must be well-formed") from None
    if read.tag != "mujoco":
        refuse("root element", read.tag, "must be <mujoco>; a URDF file's name ends in .urdf")
    tags = [element.tag for element in read.iter()]
    # MuJoCo reads a DOCTYPE otherwise than ElementTree
    if len(tags) > MOST_PLAIN or not {*tags} <= {*PLAIN} or b"<!DOCTYPE" in content:
        return _compiled_apart(path)
    import mujoco

    usual = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(_say_nothing)
    try:
        return mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise VehicleError(f"MJCF = {one_line(str(error))!r}: must be a model that MuJoCo loads") from None
    finally:
        mujoco.set_mju_user_warning(usual)


def _compiled_apart(path: Path) -> Any:
    """The model compiled by a process that ends with its time or its memory."""
    import mujoco

    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "model.mjb"
        words = [sys.executable, "-c", COMPILE, str(path.resolve()), str(made), str(BYTES)]
        try:
            ended = subprocess.run(words, capture_output=True, text=True, timeout=SECONDS, cwd=folder, check=False)
        except subprocess.TimeoutExpired:
            ended = None
        if made.exists() and ended is not None and ended.returncode == 0 and made.stat().st_size < MOST_COMPILED:
            return mujoco.MjModel.from_binary_path(str(made))
    if ended is not None and ended.stdout.strip():
        raise VehicleError(f"MJCF = {one_line(ended.stdout)!r}: must be a model that MuJoCo loads")
    most = f"{SECONDS:g} s, {BYTES / 2**30:g} GB of memory and {MOST_COMPILED / 1e6:g} MB of numbers"
    raise VehicleError(f"MJCF = {path.name!r}: must be a model that MuJoCo compiles in {most}")


def _say_nothing(text: str) -> None:
    """Silence MuJoCo's warnings while it compiles."""


def _root(model: Any) -> tuple[int, list[int]]:
    """The body that is the base (0 for the world), and bodies of the world that are left out."""
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
        if any(_joints(model, each) for each in _below(model, body)):
            refuse(f"body[{name_of(model, 'body', body)}]", "beside the base", "must be a part of the base's tree")
    return free[0], alone


def _below(model: Any, body: int) -> list[int]:
    """A body and all that it carries."""
    found = [body]
    for each in range(body + 1, int(model.nbody)):
        if int(model.body_parentid[each]) in found:
            found.append(each)
    return found


def _joints(model: Any, body: int) -> list[int]:
    first = int(model.body_jntadr[body])
    return list(range(first, first + int(model.body_jntnum[body])))


def _read_child(tree: _Tree, body: int) -> None:
    """A body with its joints; MuJoCo turns and shifts it by one after the other, about anchors in its own axes."""
    model, name = tree.model, name_of(tree.model, "body", body)
    carrier = tree.seats[int(model.body_parentid[body])]
    at = posed_in(carrier, _rotation(model.body_quat[body]), _vector(model.body_pos[body]))
    joints = [joint for joint in _joints(model, body) if not _is_fixed(tree, joint)]
    for joint in _joints(model, body):
        anchor = _vector(model.jnt_pos[joint])
        at = posed_in(at, Mat3.identity(), anchor)
        if joint in joints:
            last = joint == joints[-1]
            made = read_joint(model, joint, at.rotation, at.position, tree.notes)
            link = name if last else _new_name(tree, f"{name}.{made.name}")
            tree.links.append(Link(name=link, parent=at.link, joint=made, body=Body(mass=0)))
            tree.parts.append([])
            at = Frame(name="", link=len(tree.links) - 1, position=Vec3(0, 0, 0))
        else:
            at = _held_pose(tree, joint, at)
        at = posed_in(at, Mat3.identity(), -anchor)
    tree.seats[body] = at
    if not joints:
        tree.frames.append(replace(at, name=_new_name(tree, name)))
    _read_body(tree, body)


def _is_fixed(tree: _Tree, joint: int) -> bool:
    """True if a joint is fixed: it follows another one and followers are locked, or one that is fixed itself."""
    name = name_of(tree.model, "jnt", joint)
    if name not in tree.mimics or tree.mimic == "lock":
        return name in tree.mimics
    found = follow(name, tree.mimics)
    return not found.joint or found.ratio == 0.0


def _held_pose(tree: _Tree, joint: int, at: Frame) -> Frame:
    """Pose of the body of a fixed joint."""
    name = name_of(tree.model, "jnt", joint)
    value = resting(tree.model, name, tree.mimics)
    tree.notes.add(f"tied by an equality: fixed at {value:g}", name)
    return posed_in(at, *held_pose(kind_of(tree.model, joint), _vector(tree.model.jnt_axis[joint]), value))


def _read_body(tree: _Tree, body: int) -> None:
    """Mass and sites of a body at its seat."""
    model, at = tree.model, tree.seats[body]
    mass = float(model.body_mass[body])
    if mass > 0.0 and body:
        R = description.rotation(at.rotation @ _rotation(model.body_iquat[body]))
        com = at.position + at.rotation.apply(_vector(model.body_ipos[body]))
        moments = Sym3.from_numbers(*(float(each) for each in model.body_inertia[body]))
        tree.parts[at.link + 1].append(Body(mass=mass, com=com, inertia=moments.rotate(R)))
    for site in range(int(model.nsite)):
        if int(model.site_bodyid[site]) == body and model.site(site).name:
            pose = _rotation(model.site_quat[site]), _vector(model.site_pos[site])
            tree.frames.append(posed_in(at, *pose, _new_name(tree, model.site(site).name)))


def _new_name(tree: _Tree, name: str) -> str:
    """The name, with underscores until it is unique: MuJoCo has a list of names for each kind of element."""
    taken = {frame.name for frame in tree.frames} | {link.name for link in tree.links}
    while name in taken:
        name += "_"
    return name


def _vector(values: Any) -> Vec3:
    return description.vector([float(each) for each in values])


def _rotation(wxyz: Any) -> Mat3:
    return description.rotation(Quaternion.of([float(each) for each in wxyz]).normalized().rotation())


KINDS = ("free", "ball", "prismatic", "revolute")
"""By MuJoCo's number of a joint's type."""

AT_JOINT = (0, 1)
"""MuJoCo's numbers of the transmissions that act at a joint."""


def kind_of(model: Any, joint: int) -> str:
    """One of ``KINDS``."""
    return KINDS[int(model.jnt_type[joint])]


def read_joint(model: Any, joint: int, R: Mat3, p: Vec3, notes: Notes) -> Joint:
    """Joint record at a pose in its parent; its zero is the model's reference position (``ref``)."""
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
    axis = description.unit_axis(f"joint[{name}].axis", [float(each) for each in model.jnt_axis[joint]])
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


def _effort(model: Any, joint: int) -> float:
    """Largest effort of all actuators at a joint, N m or N; 0 without any."""
    total = 0.0
    for actuator in range(int(model.nu)):
        if int(model.actuator_trntype[actuator]) in AT_JOINT and int(model.actuator_trnid[actuator][0]) == joint:
            total += abs(float(model.actuator_gear[actuator][0])) * _largest_force(model, actuator)
    if model.jnt_actfrclimited[joint]:
        total = min(total, max(abs(float(each)) for each in model.jnt_actfrcrange[joint]))
    return total


def _largest_force(model: Any, actuator: int) -> float:
    """N m or N before the gear: by the range of the force, or of the control where the force is proportional to it."""
    found = math.inf
    if model.actuator_forcelimited[actuator]:
        found = max(abs(float(each)) for each in model.actuator_forcerange[actuator])
    plain = not model.actuator_gaintype[actuator] and not model.actuator_biastype[actuator]
    if plain and model.actuator_ctrllimited[actuator]:
        gain = abs(float(model.actuator_gainprm[actuator][0]))
        found = min(found, gain * max(abs(float(each)) for each in model.actuator_ctrlrange[actuator]))
    return found


def mimics_of(model: Any) -> dict[str, Mimic]:
    """Joint -> the one that it follows, from the equalities of joints; a joint fixed by an equality follows none ("").

    Raises:
        VehicleError: an equality that is no straight line.
    """
    import mujoco

    found: dict[str, Mimic] = {}
    for each in range(int(model.neq)):
        if model.eq_type[each] != mujoco.mjtEq.mjEQ_JOINT or not model.eq_active0[each]:
            continue
        name, other = name_of(model, "jnt", int(model.eq_obj1id[each])), int(model.eq_obj2id[each])
        numbers = [float(value) for value in model.eq_data[each][:5]]
        if any(numbers[2:]):
            refuse(f"equality of joint[{name}].polycoef", numbers, "must be a straight line: two numbers, then zeros")
        if name in found:
            refuse(f"equality of joint[{name}]", "two of them", "must be at most one")
        found[name] = Mimic(name_of(model, "jnt", other) if other >= 0 else "", numbers[1], numbers[0])
    return found


def resting(model: Any, name: str, mimics: Mapping[str, Mimic]) -> float:
    """Value of a joint where the one that it follows in the end rests."""
    found = follow(name, mimics)
    return found.at_rest(*(limits(model, model.joint(found.joint).id) if found.joint else (0.0, 0.0)))


def limits(model: Any, joint: int) -> tuple[float, float]:
    """Lowest and highest value of a joint from its reference position, rad or m; infinite for one without limits."""
    if not model.jnt_limited[joint]:
        return -math.inf, math.inf
    zero = float(model.qpos0[model.jnt_qposadr[joint]])
    lower, upper = (float(each) - zero for each in model.jnt_range[joint])
    return lower, upper


SPRINGS = ("jnt_stiffness", "jnt_stiffnesspoly")
CURVES = ("dof_dampingpoly",)


def name_of(model: Any, kind: str, index: int) -> str:
    """Name of an element, made up from its number where the file gives none."""
    return str(getattr(model, kind)(index).name) or f"{kind}{index}"


def refuse_what_is_not_here(model: Any, notes: Notes) -> None:
    """Refuse springs, balls, closed chains, actuated tendons, soft bodies; note elements that the vehicle ignores.

    Raises:
        VehicleError: the first of them.
    """
    for joint in range(int(model.njnt)):
        _refuse_springs(model, joint)
    _refuse_equalities(model)
    for tendon in range(int(model.ntendon)):
        pulls = ("tendon_stiffness", "tendon_damping", "tendon_frictionloss", "tendon_limited", "tendon_armature")
        name = name_of(model, "tendon", tendon)
        if any(_any(getattr(model, each)[tendon]) for each in pulls):
            refuse(f"tendon[{name}]", "a pull of its own", "must pull nothing; tendons are not supported")
        notes.add("not read", name, "tendon")
    for body in range(1, int(model.nbody)):
        if model.body_gravcomp[body]:
            refuse(f"body[{name_of(model, 'body', body)}].gravcomp", float(model.body_gravcomp[body]), "must be 0")
    if model.nflex:
        refuse("flex", int(model.nflex), "must be rigid bodies only")
    for actuator in range(int(model.nu)):
        _note_actuator(model, actuator, notes)
    if model.opt.density or model.opt.viscosity:
        notes.add("density and viscosity of the option are not read; [drag] and the scenario's air say that")


def _refuse_springs(model: Any, joint: int) -> None:
    import mujoco

    field = f"joint[{name_of(model, 'jnt', joint)}]"
    if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_BALL:
        refuse(f"{field}.type", "ball", "must be 'hinge' or 'slide'; or three hinges in one body")
    if any(_any(getattr(model, name)[joint]) for name in SPRINGS):
        refuse(f"{field}.stiffness", _first(model.jnt_stiffness[joint]), "must be 0; springs are not supported")
    if any(_any(getattr(model, name)[int(model.jnt_dofadr[joint])]) for name in CURVES):
        refuse(f"{field}.damping", "a polynomial", "must be one number")


def _note_actuator(model: Any, actuator: int, notes: Notes) -> None:
    import mujoco

    name, kinds = name_of(model, "actuator", actuator), mujoco.mjtTrn
    if _any(model.actuator_armature[actuator]) or _any(model.actuator_damping[actuator]):
        refuse(f"actuator[{name}]", "armature or damping of its own", "must be stated at its joint")
    kind = int(model.actuator_trntype[actuator])
    if kind == kinds.mjTRN_SITE:
        notes.add("at a site, not read; rotors are stated in [[rotors]]", name, "actuator")
    elif kind not in (kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT):
        notes.add("not at a joint, so not read", name, "actuator")


def _refuse_equalities(model: Any) -> None:
    import mujoco

    kinds = mujoco.mjtEq
    names = {int(kinds.mjEQ_CONNECT): "connect", int(kinds.mjEQ_WELD): "weld"}
    for each in range(int(model.neq)):
        kind = int(model.eq_type[each])
        if not model.eq_active0[each] or kind == kinds.mjEQ_JOINT:
            continue
        allowed = "closed chains are not supported" if kind in names else "only equalities of joints are supported"
        refuse(f"equality[{each}]", names.get(kind, "of another kind"), allowed)


def _any(value: Any) -> bool:
    import numpy as np

    return bool(np.any(np.asarray(value)))


def _first(value: Any) -> float:
    import numpy as np

    return float(np.asarray(value).ravel()[0])
