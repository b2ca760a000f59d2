"""Read vehicles from the tables of a TOML file (``schema = 1``); docs/vehicle_files.md
has the grammar.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

from skyarm.algebra import Mat3, Vec3
from skyarm.records import coerce
from skyarm.records.arrays import Array
from skyarm.records.coerce import concrete
from skyarm.records.files import Fields, errors_as, must_be_one_of, shown
from skyarm.records.files.fields import three_numbers
from skyarm.records.files.mesh_vertices import read_vertices
from skyarm.records.files.names import unreadable
from skyarm.records.files.stl_mesh import METRES
from skyarm.records.read_table import (
    make_at,
    numbers_from,
    record_from,
    registered_from,
)
from skyarm.vehicle import check, description
from skyarm.vehicle.attach import (
    MIMIC,
    Mimic,
    Mount,
    Notes,
    RigidBodies,
    attach,
    bodies_of,
    couple,
    place_in,
    posed_in,
)
from skyarm.vehicle.attach import limits_that_contradict as contradicting_limits
from skyarm.vehicle.battery import Battery
from skyarm.vehicle.check import TURN, VehicleError, refuse
from skyarm.vehicle.convex_hull import COLLISION_SIZES
from skyarm.vehicle.held_joints import hold_joints
from skyarm.vehicle.imported_shapes import (
    IMPORTS,
    MOST_CORNERS,
    MOST_VERTICES,
    collision_of,
    import_shapes,
)
from skyarm.vehicle.inertia_repair import with_real_inertias
from skyarm.vehicle.linkage import BASE, Body, Joint, Link
from skyarm.vehicle.rotor_tables import mount_rotors, read_rotor_tables, without_rotors
from skyarm.vehicle.stated_rotors import RotorFile, rotors_in
from skyarm.vehicle.stops import with_smooth_friction, with_stops
from skyarm.vehicle.vehicle_records import (
    FEWEST_CORNERS,
    BodyDrag,
    Collision,
    Frame,
    Look,
    MountedDrive,
    Vehicle,
)

OTHERS = {
    "urdf": (".urdf", ".xacro"),
    "mjcf": (".xml", ".mjcf"),
    "sdf": (".sdf", ".world"),
}
"""Formats of other programs -> suffixes of their files."""

RIGID = tuple(suffix for suffixes in OTHERS.values() for suffix in suffixes)
"""Suffixes of files with rigid bodies and joints of other programs."""

SOURCES: Mapping[str, tuple[str, ...]] = {**OTHERS, "airframe": (".toml", *RIGID)}
"""Keys that replace ``base`` and ``links``, one of them per file -> suffixes of the
files that they name."""

MOST_JOINTS = 250
"""Largest number of joints of a vehicle; the time of its checks grows with the cube:
3000 would take hours."""

Record = TypeVar("Record")

Default = TypeVar("Default")

Refer = Callable[
    [str, str, Collection[str], str, str, Mapping[str, str]], RigidBodies | Vehicle
]
"""Function that reads a named file: (field, name, allowed suffixes, treatment of
mimics, name of the body that is the base or "", arguments of xacro) -> bodies or
vehicle."""


def vehicle_from(
    document: Mapping[str, Any], refer: Refer, folder: Path = Path()
) -> Vehicle:
    """Read a vehicle from the tables of a vehicle file.

    Args:
        document: tables of the file.
        refer: reads the files that it names.
        folder: where the path of a rotor file starts.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    top = Fields(dict(document), "", named=True)
    # a bool is an int in Python, and schema = true would pass
    if (schema := top.take("schema")) != 1 or isinstance(schema, bool):
        refuse("schema", schema, "must be 1")
    mimic = top.choice("mimic", MIMIC, "lock")
    bodies, airframe = _bodies(top, refer, mimic)
    bodies = _with_rotor_file(bodies, top.inner("rotor_file"), folder)
    joints = [link.joint.name for link in bodies.links]
    # joints of an airframe or another file may be changed by [[joints]], those of this
    # file stand in their links
    own = [] if airframe or _source(top) else joints
    # joints of a vehicle file are settled: their stops and drives were stated or chosen
    # there
    settled, drives = (joints, list(airframe.drives)) if airframe else ([], [])
    for fields in top.tables("attach"):
        bodies, arm = _attach(bodies, fields, refer, mimic)
        if arm is not None:
            prefix = fields.text("prefix", "")
            settled += [prefix + link.joint.name for link in arm.links]
            drives += [replace(each, name=prefix + each.name) for each in arm.drives]
    changes: dict[str, dict[str, float]] = {}
    held: dict[str, float] = {}
    for fields in _named_tables(top, "joints"):
        # a joint that is held has nothing else to state, so all else is refused by
        # done()
        changes[name := fields.text("name")] = {}
        if "hold" not in fields.table:
            changes[name] = numbers_from(Joint, fields)
            fields.take("hold", None)
        else:
            held[name] = fields.number("hold")
        fields.done()
    # overrides first: a joint may be held only within the limits that stay
    bodies = hold_joints(_override_joints(changes, held, bodies, own), held)
    bodies.require_no_faults()
    if len(bodies.links) > MOST_JOINTS:
        allowed = (
            f"must be at most {MOST_JOINTS}, for its mass matrix takes minutes;"
            " [[joints]] hold fixes some"
        )
        refuse("number of joints", len(bodies.links), allowed)
    flying = mount_rotors(
        bodies,
        read_rotor_tables(top, any(each.tilt_joint for each in bodies.rotors)),
        airframe.rotors if airframe else (),
    )
    every = top.choice("inertia_repair", ("small", "nearest"), "small") == "nearest"
    # after the rotors' links were merged, because only the whole bodies have to be
    # physical
    bodies = with_real_inertias(flying.bodies, every=every)
    if _source(top):
        bodies.require_airframe()
    how = top.choice("import_collisions", IMPORTS, "none")
    notes = Notes()
    posed = (
        *(_frame(fields, bodies) for fields in top.tables("frames")),
        *import_shapes(bodies, how, notes),
        *(
            _collision(fields, bodies, folder, notes)
            for fields in top.tables("collisions")
        ),
    )
    links, followers, fixed = couple(
        # followers leave the list of links, so the indices of frames and looks change
        # with it
        bodies.links,
        (*bodies.frames, *bodies.looks, *posed),
        bodies.mimics,
    )
    stated = mounted_drives(top.inner("drives").table, "drives", bodies.speeds)
    # stated drives stand in place of the file's, and joints that became fixed have none
    open_to = {link.joint.name for link in links} - {each.name for each in stated}
    own_drives, unmounted = drives_of_file(
        replace(bodies, drives={k: v for k, v in bodies.drives.items() if k in open_to})
    )
    drives = [*(each for each in drives if each.name in open_to), *own_drives, *stated]
    # joints of this file stand in its links, those of another one in [[joints]]
    joint_tables = [each["joint"] for each in top.table.get("links", ())]
    described = {each["name"]: each for each in joint_tables} | changes

    def stating(field: str) -> set[str]:
        return {joint for joint, table in described.items() if field in table}

    made = Vehicle(
        name=top.text("name"),
        title=top.text("title", ""),
        base=bodies.base,
        links=_with_limits_of_drives(links, drives, stating("effort_limit")),
        followers=followers,
        rotors=flying.rotors,
        frames=tuple(each for each in fixed if type(each) is Frame),
        looks=tuple(each for each in fixed if type(each) is Look),
        collisions=tuple(each for each in fixed if type(each) is Collision),
        end_effector=top.text("end_effector", "")
        or (airframe.end_effector if airframe else ""),
        drag=_optional(
            BodyDrag, top, "drag", airframe.drag if airframe else BodyDrag(), "area"
        ),
        drives=tuple(drives),
        battery=_optional(
            Battery, top, "battery", airframe.battery if airframe else None
        ),
        sources=(
            *(airframe.sources if airframe else ()),
            *flying.sources,
            *_sources(top).items(),
        ),
        gaps=flying.gaps,
        notes=(
            *bodies.notes,
            *flying.notes,
            *unmounted,
            *contradicting_limits(links, followers),
            *notes.lines(),
        ),
    )
    limits = top.choice("joint_limits", ("stop", "end"), "stop")
    top.done()
    # a rate that somebody stated is not bent, however stiff
    rate_stated = {*own, *settled, *stating("coulomb_rate")}
    made = with_smooth_friction(made, set(made.joint_names) - rate_stated)
    return (
        made
        # without stops a limit ends the episode, as the user asked
        if limits == "end"
        else with_stops(made, {*settled, *stating("stop_stiffness")})
    )


def _optional(
    kind: type[Record], top: Fields, name: str, default: Default, *required: str
) -> Record | Default:
    """Read a dataclass from an optional TOML table, which must state the required
    fields if it is present.
    """
    if not top.states(name):
        return default
    fields = top.inner(name)
    for field in required:
        fields.take(field)
    return record_from(kind, fields)


def _named_tables(fields: Fields, name: str) -> list[Fields]:
    """Read a list of TOML tables, such as ``[[links]]``, whose names must be unique."""
    tables = fields.tables(name)
    check.unique(fields.at(f"{name}.name"), [each.text("name") for each in tables])
    return tables


def _source(top: Fields) -> str:
    """Name of the vehicle-file field, such as ``urdf``, that refers to another file of
    bodies; empty if absent.
    """
    given = [name for name in SOURCES if top.states(name)]
    if len(given) > 1:
        refuse(
            given[1],
            top.table[given[1]],
            f"must not be given together with '{given[0]}'",
        )
    return given[0] if given else ""


def _bodies(
    top: Fields, refer: Refer, mimic: str
) -> tuple[RigidBodies, Vehicle | None]:
    """Read the rigid bodies of a vehicle file or of the file it refers to, and the
    vehicle in that file, if any.
    """
    source = _source(top)
    base, links = top.take("base", None), top.take("links", [])
    if not source:
        if base is None:
            raise VehicleError(
                "base: is missing: must be a table, or 'urdf' the path of a URDF file"
            )
        return _own_bodies(top), None
    # base may be the name of a body of another file as well as a table
    named = base if isinstance(base, str) else ""
    referred = refer(
        source,
        top.text(source),
        SOURCES[source],
        mimic,
        named,
        _arguments(top, top.text(source)),
    )
    for field, given in (("base", "" if named else base), ("links", links)):
        if given:
            refuse(field, "a table", f"must not be given together with '{source}'")
    return (
        (referred, None)
        if isinstance(referred, RigidBodies)
        else (bodies_of(referred), referred)
    )


def _with_rotor_file(bodies: RigidBodies, fields: Fields, folder: Path) -> RigidBodies:
    """Bodies with the rotors of the file that ``[rotor_file]`` names."""
    if not fields.table:
        return bodies
    name = fields.text("file")
    if bodies.rotors:
        refuse(
            fields.at("file"),
            name,
            "must be left out: the file of the bodies states rotors",
        )
    if reason := unreadable(folder / name):
        refuse(fields.at("file"), name, reason)
    with errors_as(VehicleError, f"{fields.at('file')} = {name!r}: ", VehicleError):
        rotors = rotors_in(RotorFile(folder / name, None, fields))
    if not rotors:
        refuse(
            fields.at("file"),
            name,
            "must state rotors: a platform of eagle-mpc (.yaml), or CA_ROTOR* of PX4",
        )
    fields.done()
    return replace(bodies, rotors=rotors)


def _arguments(fields: Fields, file: str) -> dict[str, str]:
    """Read the arguments that a table states for the xacro file which it names."""
    table = fields.inner("xacro").table
    if table and not file.endswith(".xacro"):
        refuse(
            fields.at("xacro"), "a table", f"must be left out: {file} is no .xacro file"
        )
    return {
        # xacro compares with true and false in lower case
        name: str(value).lower() if value in (True, False) else str(value)
        for name, value in table.items()
    }


def _own_bodies(top: Fields) -> RigidBodies:
    """Read base and links that a vehicle file states itself, parents first."""
    tables = {fields.text("name"): fields for fields in _named_tables(top, "links")}
    if "base" in tables:
        refuse("links.name", "base", "is the airframe's name")
    parents = {}
    for link, fields in tables.items():
        fields.expect(("parts",))
        parents[link] = parent = fields.take("parent")
        if not isinstance(parent, str) or not parent:
            allowed = (
                "must be the name of one parent, 'base' or a link (closed chains are"
                " not supported)"
            )
            refuse(fields.at("parent"), parent, allowed)
    order = description.tree_order(parents, "base", "links[{}].parent")
    base = _body(top.inner("base"), ())
    links, mimics = [], {}
    for link in order:
        fields = tables[link]
        inner = Fields(fields.take("joint"), fields.at("joint"), named=True)
        joint = _joint(inner)
        if (table := inner.take("mimic", None)) is not None:
            mimics[joint.name] = record_from(Mimic, Fields(table, inner.at("mimic")))
        inner.done()
        # an index into the tree's order, in which parents stand first
        parent = BASE if parents[link] == "base" else order.index(parents[link])
        links.append(
            Link(
                name=link,
                parent=parent,
                joint=joint,
                body=_body(fields, ("name", "parent", "joint")),
            )
        )
    check.unique("joints.name", [link.joint.name for link in links])
    return RigidBodies("", "base", base, tuple(links), (), mimics)


def _body(fields: Fields, read_elsewhere: Sequence[str]) -> Body:
    """Read the mass distribution of a link, merged from its own numbers and its
    [[parts]].
    """
    for word in read_elsewhere:
        fields.take(word, None)
    parts = _named_tables(fields, "parts")
    stated = [word for word in ("mass", "com", "inertia") if fields.states(word)]
    # a link of parts alone has no body of its own
    pieces = [
        _piece(each) for each in ([fields, *parts] if stated or not parts else parts)
    ]
    planar = fields.flag("planar", False)
    for each in (*parts, fields):
        # done() after all reads: what is left over is a misspelt key
        each.done()
    whole = description.body(pieces)
    return replace(whole, planar=whole.planar or planar)


def _piece(fields: Fields) -> Body:
    """Read the mass distribution of a base, a link or one of its parts."""
    mass = numbers_from(Body, fields)
    planar = fields.flag("planar", False)
    com = fields.vector("com", (0.0, 0.0, 0.0))
    entries = fields.numbers("inertia", (0.0, 0.0, 0.0))
    if len(entries) not in (3, 6):
        allowed = "must be three (xx yy zz) or six (xx yy zz xy xz yz) numbers, kg m^2"
        refuse(fields.at("inertia"), list(entries), allowed)
    placed, turning = description.vector(com), description.inertia(entries)
    piece = make_at(
        fields.where, Body, **mass, com=placed, inertia=turning, planar=planar
    )
    # each part must be possible by itself: the sum would hide an impossible one
    check.inertia(fields.at("inertia"), piece.inertia, planar=planar)
    return piece


def _joint(fields: Fields) -> Joint:
    """Read the joint of a link, without its mimic relation."""
    axis = description.unit_axis(fields.at("axis"), fields.vector("axis"))
    R, p = _pose(fields)
    kind = fields.choice("kind", ("revolute", "prismatic"), "revolute")
    name = fields.text("name")
    return Joint(
        name=name,
        kind=kind,
        axis=axis,
        position=p,
        rotation=R,
        **numbers_from(Joint, fields),
    )


def _pose(fields: Fields) -> tuple[Mat3, Vec3]:
    """Read the pose of a frame relative to another frame: rotation and position (m)."""
    R = Mat3.identity()
    rpy = fields.take("rpy", None)
    wxyz = fields.take("quaternion_wxyz", None)
    if rpy is not None and wxyz is not None:
        refuse(fields.at("rpy"), rpy, "must not be given together with quaternion_wxyz")
    if wxyz is not None:
        four = fields.numbers("quaternion_wxyz")
        if len(four) != 4:
            refuse(
                fields.at("quaternion_wxyz"),
                wxyz,
                "must be four numbers of unit length",
            )
        R = description.rotation_quaternion(fields.at("quaternion_wxyz"), four)
    elif rpy is not None:
        angles = fields.vector("rpy")
        # one turn and a margin; more is an angle in degrees
        if max(map(abs, angles)) > TURN[0]:
            refuse(fields.at("rpy"), rpy, "must be within a turn: rad, not degrees")
        R = description.rotation_rpy(angles)
    return R, description.vector(fields.vector("position", (0.0, 0.0, 0.0)))


def _frame(fields: Fields, bodies: RigidBodies) -> Frame:
    """Read a frame, relative to the moving body that carries the named link."""
    R, p = _pose(fields)
    name = fields.text("name")
    at = place_in(bodies, fields.text("link", "base"), fields.at("link"))
    fields.done()
    return posed_in(at, R, p, name)


def _collision(
    fields: Fields, bodies: RigidBodies, folder: Path, notes: Notes
) -> Collision:
    """Read a shape that touches, relative to the body that carries the named link; the
    path of a mesh starts at a folder.
    """
    R, p = _pose(fields)
    name = fields.text("name")
    at = place_in(bodies, fields.text("link", "base"), fields.at("link"))
    shape = fields.choice("shape", tuple(COLLISION_SIZES))
    path = fields.text("mesh", "")
    stated = fields.take("vertices", ())
    if (shape == "hull") != bool(path) ^ bool(stated):
        why = (
            "must have either vertices or mesh"
            if shape == "hull"
            else "must be 'hull' where vertices or mesh are stated"
        )
        refuse(fields.at("shape"), shape, why)
    for word in ("most_vertices", "scale"):
        if not path and fields.states(word):
            refuse(fields.at(word), fields.take(word), "must be left out without mesh")
    label = ""
    scale = METRES
    most = float(MOST_CORNERS)
    size: Sequence[float] | Array = ()
    if path:
        label = f"{fields.at('mesh')} = {shown(path)}: "
        most = fields.number("most_vertices", MOST_VERTICES, low=FEWEST_CORNERS)
        if most > MOST_CORNERS:
            allowed = f"must be at most {MOST_CORNERS}"
            refuse(fields.at("most_vertices"), most, allowed)
        scale = fields.vector("scale", METRES)
    elif stated:
        where = fields.at("vertices")
        allowed = f"must be 4 to {MOST_CORNERS} points"
        corners = coerce.items(where, stated, None, allowed)
        if not FEWEST_CORNERS <= len(corners) <= MOST_CORNERS:
            refuse(where, len(corners), f"{allowed}; a mesh may have more")
        label = f"{where}: "
        size = np.array(
            [three_numbers(each, f"{where}[{i}]") for i, each in enumerate(corners)]
        )
    else:
        size = fields.numbers("size")
    with errors_as(VehicleError, label):
        if path:
            size = read_vertices(folder / path, scale)
        made = collision_of(name, shape, posed_in(at, R, p), size, notes, most)
    fields.done()
    return made


def _attach(
    bodies: RigidBodies, fields: Fields, refer: Refer, mimic: str
) -> tuple[RigidBodies, Vehicle | None]:
    """Attach the arm that a TOML table names to a vehicle's bodies; also return an arm
    from a vehicle file.
    """
    arm = fields.text("arm")
    treatment = fields.choice("mimic", MIMIC, mimic)
    base = fields.text("base", "")
    referred = refer(
        fields.at("arm"),
        arm,
        SOURCES["airframe"],
        treatment,
        base,
        _arguments(fields, arm),
    )
    # an arm's vehicle file must bring no second source of thrust or of power
    carried = referred if isinstance(referred, Vehicle) else None
    if carried is not None and carried.rotors:
        words = (
            f"must have no rotors ({carried.rotors[0].name}); those of the airframe fly"
        )
        refuse(fields.at("arm"), arm, words)
    if carried is not None and carried.battery is not None:
        refuse(
            fields.at("arm"),
            arm,
            "must have no battery; that of the airframe feeds the rotors",
        )
    R, p = _pose(fields)
    to = fields.text("to", "base")
    prefix = fields.text("prefix", "")
    fields.done()
    whole = (
        without_rotors(referred)
        if isinstance(referred, RigidBodies)
        else bodies_of(referred)
    )
    return attach(bodies, whole, Mount(to, R, p, prefix, fields.where)), carried


def _override_joints(
    changes: Mapping[str, Mapping[str, Any]],
    held: Mapping[str, float],
    bodies: RigidBodies,
    own: Sequence[str],
) -> RigidBodies:
    """Override joint limits and friction of bodies that come from another file; check
    which joints are held where.
    """
    ends = {
        link.joint.name: link.joint.ends
        for link in bodies.links
        if link.joint.name not in own
    }
    # a ball joint is no joint here and may only be held, at rest
    only_held = {
        name: (0.0, 0.0) for joints in bodies.faults.values() for name in joints
    }
    for name, value in held.items():
        # a held joint without limits may stand anywhere
        low, high = (only_held | ends).get(name, (value, value))
        if not low <= value <= high:
            refuse(
                f"joints[{name}].hold",
                value,
                f"must be within the joint's limits, {float(low)!r} to {float(high)!r}",
            )
    # names that messages may propose: a ball joint only if it is held
    changeable = [*ends, *(held.keys() & only_held)]
    for name in changes:
        if name in own:
            refuse(
                "joints.name",
                name,
                "must stand in its link; only another file's joints are changed here",
            )
        if name in bodies.mimics:
            what = (
                f"must be left out: it follows {bodies.mimics[name].joint!r} and has"
                " nothing of its own to state"
            )
            refuse("joints.name", name, what)
        if name not in changeable:
            refuse("joints.name", name, must_be_one_of(changeable, name))
    if not changes:
        return bodies
    links = tuple(
        replace(k, joint=replace(k.joint, **changes.get(k.joint.name, {})))
        for k in bodies.links
    )
    # armature that the user adds moves with the joint, so the servo's inertia grows by
    # it
    more = {
        k.joint.name: float(links[i].joint.armature - k.joint.armature)
        for i, k in enumerate(bodies.links)
    }
    drives = {
        name: {**each, "inertia": each["inertia"] + more[name]}
        for name, each in bodies.drives.items()
    }
    return replace(bodies, links=links, drives=drives)


def mounted_drives(
    tables: Mapping[str, Any],
    where: str,
    speeds: Mapping[str, float] = MappingProxyType({}),
) -> tuple[MountedDrive, ...]:
    """Read a table of joint drives by joint name, each with a registered ``kind`` and
    its parameters.

    Args:
        tables: tables by joint name.
        where: field of the table, for messages.
        speeds: largest rate of a joint by another file, rad/s or m/s: speed limit of a
            drive whose table states none.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    mounted = []
    for joint, table in tables.items():
        drive: Any = registered_from("drive", object, table, f"{where}.{joint}")
        # a rate that the robot's file states limits a drive that has such a field and
        # states none
        if (
            speeds.get(joint)
            and hasattr(drive, "speed_limit")
            and "speed_limit" not in table
        ):
            drive = replace(drive, speed_limit=speeds[joint])
        mounted.append(MountedDrive(name=joint, drive=drive))
    return tuple(mounted)


FASTEST = 2e-5
"""Least integration step (s) for which the servo of another file is mounted: stiff
servos of light links without the inertia of their motors, which simulators of implicit
steps take, move the link within microseconds."""


def drives_of_file(
    bodies: RigidBodies,
) -> tuple[tuple[MountedDrive, ...], tuple[str, ...]]:
    """Drives of the servos that another file states, and notes on those that are too
    fast to be stepped.
    """
    notes = Notes()
    drives = mounted_drives(bodies.drives, "drives")
    # a drive that states no largest step can be stepped at any
    fast = {
        each.name for each in drives if (each.drive.largest_step or FASTEST) < FASTEST
    }
    for name in sorted(fast):
        notes.add(
            "with a servo too fast to be stepped, so it takes a torque; [[joints]]"
            " armature slows the servo",
            name,
        )
    return tuple(each for each in drives if each.name not in fast), notes.lines()


def _with_limits_of_drives(
    links: Sequence[Link], drives: Sequence[MountedDrive], stated: Collection[str]
) -> tuple[Link, ...]:
    """Links with an effort limit of 0 replaced by their drive's limit (URDF files often
    state 0).
    """
    given = {each.name: each.drive for each in drives if each.name not in stated}

    def limit_effort(link: Link) -> Link:
        drive = given.get(link.joint.name)
        limit = link.joint.effort_limit
        # traced limits stay, and so does one that somebody stated, also 0
        if drive is None or not concrete(limit) or limit != 0:
            return link
        return replace(
            link, joint=replace(link.joint, effort_limit=drive.largest_effort())
        )

    return tuple(map(limit_effort, links))


def _sources(top: Fields) -> dict[str, str]:
    """Read [sources]: for the dotted name of a field, a text on where its value comes
    from.
    """
    sources = top.inner("sources")
    return {key: sources.text(key) for key in sources.table}
