"""From a checked vehicle file to the records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from skyarm.algebra import ZERO3, Mat3, Vec3
from skyarm.vehicle import check, description
from skyarm.vehicle.attach import Mimic, Mount, RigidBodies, attach, couple, limits_that_contradict, place_in, posed_in
from skyarm.vehicle.battery import Battery, CellCurve
from skyarm.vehicle.check import VehicleError, refuse, with_real_inertias
from skyarm.vehicle.linkage import BASE, Body, Joint, Link
from skyarm.vehicle.mounted_drives import mounted_drives, with_limits_of_drives
from skyarm.vehicle.schema import (
    Actuation,
    BatteryTable,
    BodyTable,
    FrameTable,
    JointOverride,
    JointTable,
    LinkTable,
    PoseTable,
    RotorDefaults,
    RotorTable,
    ThrustTableTable,
    TiltTable,
    VehicleFile,
)
from skyarm.vehicle.stops import with_smooth_friction, with_stops
from skyarm.vehicle.thrust_table import COLUMNS, ThrustTable
from skyarm.vehicle.tilt import Tilt, arm_direction
from skyarm.vehicle.vehicle_records import BodyDrag, Frame, Look, MountedDrive, Rotor, Vehicle

SOURCES = ("urdf", "mjcf", "airframe")
"""Fields of which one may stand in place of ``base`` and ``links``."""


@dataclass(frozen=True, slots=True)
class Referred:
    """What a vehicle file takes from other files.

    Attributes:
        bodies: of ``urdf``, ``mjcf`` or ``airframe``; None if the file has its own.
        airframe: the vehicle of ``airframe``, with rotors and drag.
        arms: bodies of each table of ``attach``.
        settled: names of joints whose stops another vehicle file has chosen.
        drives: of the arms' joints, by the names that these have here.
    """

    bodies: RigidBodies | None = None
    airframe: Vehicle | None = None
    arms: tuple[RigidBodies, ...] = ()
    settled: tuple[str, ...] = ()
    drives: tuple[MountedDrive, ...] = ()


def assemble(file: VehicleFile, referred: Referred) -> Vehicle:
    """Vehicle of a file and of what it refers to."""
    bodies = _own_bodies(file) if referred.bodies is None else _others_bodies(file, referred.bodies)
    own = [link.joint.name for link in file.links]
    for index, (table, arm) in enumerate(zip(file.attach, referred.arms, strict=True)):
        field = f"attach[{index}]"
        at = Mount(table.to, _rotation(field, table), description.vector(table.position), table.prefix, field)
        bodies = attach(bodies, _with_armature(arm, table.armature), at)
    bodies = with_real_inertias(_overridden(file.joints, bodies, own), file.repair)
    frames = tuple(_frame(table, bodies) for table in file.frames)
    links, followers, fixed = couple(bodies.links, (*bodies.frames, *frames, *bodies.looks), bodies.mimics)
    drives = _drives(file, referred)
    links = tuple(with_limits_of_drives(links, drives, _stating(file, "effort_limit")))
    airframe = referred.airframe
    drag = BodyDrag() if airframe is None else airframe.drag
    if file.drag is not None:
        drag = BodyDrag(area=description.vector(file.drag.area), air_density=file.drag.air_density)
    made = Vehicle(
        name=file.name,
        title=file.title,
        base=bodies.base,
        links=links,
        followers=followers,
        rotors=(
            *(() if airframe is None else airframe.rotors),
            *(rotor_of(table, file.rotor_defaults) for table in file.rotors),
        ),
        frames=tuple(each for each in fixed if not isinstance(each, Look)),
        looks=tuple(each for each in fixed if isinstance(each, Look)),
        end_effector=file.end_effector or ("" if airframe is None else airframe.end_effector),
        drag=drag,
        drives=drives,
        battery=battery_of(file.battery) if airframe is None or file.battery is not None else airframe.battery,
        sources=(*(() if airframe is None else airframe.sources), *file.sources.items()),
        notes=(*bodies.notes, *limits_that_contradict(links, followers)),
    )
    stated = {*own, *referred.settled, *(each.name for each in file.joints if each.coulomb_rate is not None)}
    made = with_smooth_friction(made, {link.joint.name for link in made.links} - stated)
    if file.joint_limits == "end":
        return made
    stiff, damped = _stating(file, "stop_stiffness"), _stating(file, "stop_damping")
    settled = {*referred.settled} - {*stiff, *damped}
    return with_stops(made, settled, stiff=stiff, damped=damped)


def _with_armature(arm: RigidBodies, armature: float) -> RigidBodies:
    """An arm whose revolute joints have drives, where its own file knows of none."""
    if armature == 0.0:
        return arm
    links = [
        replace(k, joint=replace(k.joint, armature=armature))
        if k.joint.kind == "revolute" and not k.joint.armature
        else k
        for k in arm.links
    ]
    return replace(arm, links=tuple(links))


def _drives(file: VehicleFile, referred: Referred) -> tuple[MountedDrive, ...]:
    """Drives of the airframe and of the arms, where the file does not state another one for the same joint."""
    own = mounted_drives(file.drives, "drives")
    stated = {each.name for each in own}
    others = (*(() if referred.airframe is None else referred.airframe.drives), *referred.drives)
    return (*(each for each in others if each.name not in stated), *own)


def _stating(file: VehicleFile, field: str) -> list[str]:
    """Names of the joints of which the file states a number."""
    tables: list[JointTable | JointOverride] = [*(link.joint for link in file.links), *file.joints]
    return [table.name for table in tables if getattr(table, field) is not None]


def _own_bodies(file: VehicleFile) -> RigidBodies:
    if file.base is None:
        raise VehicleError("base = (missing): must be a table, or 'urdf' the path of a URDF file")
    for field, names in (
        ("links.name", [k.name for k in file.links]),
        ("joints.name", [k.joint.name for k in file.links]),
    ):
        check.unique(field, names)
    if "base" in [link.name for link in file.links]:
        refuse("links.name", "base", "is the airframe's name")
    tables = {link.name: link for link in file.links}
    order = description.tree_order({k: table.parent for k, table in tables.items()}, "base", "links[{}].parent")
    links = tuple(_link(tables[name], order) for name in order)
    told = {k.joint.name: k.joint.mimic for k in file.links if k.joint.mimic is not None}
    mimics = {name: Mimic(table.joint, table.ratio, table.offset) for name, table in told.items()}
    return RigidBodies(file.name, "base", _body("base", file.base), links, (), mimics)


def _others_bodies(file: VehicleFile, bodies: RigidBodies) -> RigidBodies:
    source = next(name for name in SOURCES if getattr(file, name) is not None)
    for field, given in (("base", file.base), ("links", file.links)):
        if given:
            refuse(field, "a table", f"must not be given together with '{source}'")
    return bodies


def _overridden(tables: Sequence[JointOverride], bodies: RigidBodies, own: Sequence[str]) -> RigidBodies:
    """Bodies with the limits and friction that the file states for joints that another file describes."""
    check.unique("joints.name", [each.name for each in tables])
    changes = {each.name: each for each in tables}
    known = [link.joint.name for link in bodies.links if link.joint.name not in own]
    for name in changes:
        if name in own:
            refuse("joints.name", name, "must stand in its link; only another file's joints are changed here")
        if name in bodies.mimics:
            what = f"must be left out: it follows {bodies.mimics[name].joint!r} and has nothing of its own to state"
            refuse("joints.name", name, what)
        if name not in known:
            refuse("joints.name", name, f"must be one of {', '.join(known) or 'none'}")
    if not changes:
        return bodies
    links = tuple(replace(k, joint=_changed(k.joint, changes.get(k.joint.name))) for k in bodies.links)
    return replace(bodies, links=links)


def _changed(joint: Joint, change: JointOverride | None) -> Joint:
    return joint if change is None else replace(joint, **_actuation(change))


def _body(field: str, table: BodyTable) -> Body:
    """Own mass and parts of a link as one body."""
    check.unique(f"{field}.parts.name", [part.name for part in table.parts])
    own: list[Body] = []
    if table.mass is not None:
        own.append(_piece(field, table.mass, table.com, table.inertia, table.planar))
    elif table.com is not None or table.inertia is not None or not table.parts:
        raise VehicleError(
            f"{field}.mass = (missing): must be a finite number of at least 0, kg, unless there are parts only"
        )
    own += [_piece(f"{field}.parts[{p.name}]", p.mass, p.com, p.inertia, p.planar) for p in table.parts]
    whole = description.body(own)
    return replace(whole, planar=whole.planar or table.planar)


def _piece(field: str, mass: float, com: list[float] | None, inertia: list[float] | None, planar: bool) -> Body:
    entries = inertia or [0.0, 0.0, 0.0]
    if len(entries) not in (3, 6):
        refuse(f"{field}.inertia", entries, "must be three (xx yy zz) or six (xx yy zz xy xz yz) numbers, kg m^2")
    at = ZERO3 if com is None else description.vector(com)
    piece = Body(mass=mass, com=at, inertia=description.inertia(entries), planar=planar)
    check.body(field, piece)
    return piece


def _link(table: LinkTable, order: list[str]) -> Link:
    parent = BASE if table.parent == "base" else order.index(table.parent)
    field = f"links[{table.name}]"
    joint = table.joint
    made = Joint(
        name=joint.name,
        kind=joint.kind,
        axis=description.unit_axis(f"{field}.joint.axis", joint.axis),
        position=description.vector(joint.position),
        rotation=_rotation(f"{field}.joint", joint),
        **_actuation(joint),
    )
    return Link(name=table.name, parent=parent, joint=made, body=_body(field, table))


def _actuation(table: Actuation) -> dict[str, Any]:
    """Fields that are given; damping and friction of exactly zero are structure."""
    given = {name: getattr(table, name) for name in Actuation.model_fields}
    found: dict[str, Any] = {name: float(value) for name, value in given.items() if value is not None}
    for name in ("damping", "coulomb", "armature", "stop_stiffness", "stop_damping"):
        if name in found:
            found[name] = description.zero_is_structure(found[name])
    return found


def _rotation(field: str, table: PoseTable) -> Mat3:
    if table.rpy is not None and table.quaternion_wxyz is not None:
        refuse(f"{field}.rpy", table.rpy, "must not be given together with quaternion_wxyz")
    if table.quaternion_wxyz is not None:
        return description.rotation_quaternion(f"{field}.quaternion_wxyz", table.quaternion_wxyz)
    return description.rotation_rpy(table.rpy) if table.rpy is not None else Mat3.identity()


def _frame(table: FrameTable, bodies: RigidBodies) -> Frame:
    """Frame in the moving body that carries the named link."""
    field = f"frames[{table.name}]"
    R, p = _rotation(field, table), description.vector(table.position)
    return posed_in(place_in(bodies, table.link, f"{field}.link"), R, p, table.name)


DIRECTIONS = {"ccw": 1, "cw": -1}


def rotor_of(table: RotorTable, defaults: RotorDefaults) -> Rotor:
    """A rotor whose table leaves to the defaults what it does not state."""
    field = f"rotors[{table.name}]"
    values: dict[str, Any] = {}
    for name in RotorDefaults.model_fields:
        own, default = getattr(table, name), getattr(defaults, name)
        value = default if own is None else own
        if value is not None:
            values[name] = value
    if (columns := values.pop("thrust_table", None)) is not None:
        _take_table(field, columns, values)
    for name in ("thrust_coefficient", "moment_coefficient"):
        if name not in values:
            raise VehicleError(f"{field}.{name} = (missing): must stand here or in rotor_defaults")
    for name in ("moment_coefficient", "drag_coefficient", "rolling_moment_coefficient", "inertia"):
        if name in values:
            values[name] = description.zero_is_structure(values[name])
    values["axis"] = description.unit_axis(f"{field}.axis", values.get("axis", [0.0, 0.0, 1.0]))
    position: Vec3 = description.vector(table.position)
    if (tilt := values.pop("tilt", None)) is not None:
        values["tilt"] = _tilt_of(f"{field}.tilt", tilt, table.position, values["axis"])
    return Rotor(name=table.name, position=position, direction=DIRECTIONS[table.direction], **values)


def _tilt_of(field: str, table: TiltTable, position: list[float], thrust_axis: Vec3) -> Tilt:
    """A rotor's servo; its axis is the arm's direction where the table has none."""
    values = {name: value for name in TiltTable.model_fields if (value := getattr(table, name)) is not None}
    if table.axis is None:
        values["axis"] = arm_direction(field, position, thrust_axis)
    else:
        values["axis"] = description.unit_axis(f"{field}.axis", table.axis)
    return Tilt(**values)


def _require_speeds(throttle: bool, coefficient: bool) -> None:
    """A thrust table without speeds has a throttle, and a thrust coefficient of which its speeds follow.

    Raises:
        VehicleError: what is missing of these.
    """
    if not throttle:
        allowed = "must be a column, rad/s; without it throttle must be one, and the rotor have a thrust_coefficient"
        raise VehicleError(f"thrust_table.speed = (missing): {allowed}")
    if not coefficient:
        allowed = "must be a number, N s^2/rad^2, where thrust_table has no column speed: the speeds follow from it"
        raise VehicleError(f"thrust_coefficient = (missing): {allowed}")


def _take_table(field: str, columns: ThrustTableTable, values: dict[str, Any]) -> None:
    """Put a rotor's thrust table among its values, and the coefficients and the highest speed that follow from it."""
    held: dict[str, Any] = {name: tuple(getattr(columns, name) or ()) for name in COLUMNS}
    try:
        if columns.speed is None:
            _require_speeds(bool(columns.throttle), "thrust_coefficient" in values)
            # a sheet without speeds: those of k_f W^2
            held["speed"] = tuple((thrust / values["thrust_coefficient"]) ** 0.5 for thrust in held["thrust"])
        elif "thrust_coefficient" in values:
            refuse("thrust_coefficient", values["thrust_coefficient"], "must be left out: it follows from thrust_table")
        if held["torque"] and "moment_coefficient" in values:
            refuse("moment_coefficient", values["moment_coefficient"], "must be left out: it follows from thrust_table")
        table = ThrustTable(**held)
    except VehicleError as error:
        raise VehicleError(f"{field}.{error}") from None
    values["table"], values["thrust_coefficient"] = table, table.thrust_coefficient
    if held["torque"]:
        values["moment_coefficient"] = table.moment_coefficient
    values.setdefault("max_speed", table.speed[-1])


def battery_of(table: BatteryTable | None) -> Battery | None:
    """The battery of a file; None where it has none."""
    if table is None:
        return None
    values = {name: getattr(table, name) for name in BatteryTable.model_fields if name != "open_circuit"}
    columns = table.open_circuit
    return Battery(open_circuit=CellCurve(charge=tuple(columns.charge), voltage=tuple(columns.voltage)), **values)
