"""Text of a vehicle as a TOML file, which :func:`skyarm.load_vehicle` reads back
(docs/vehicle_files.md).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from skyarm.algebra import Mat3, Vec3
from skyarm.records.files import shown
from skyarm.records.files.toml import toml_key, toml_value
from skyarm.records.leaves import parts
from skyarm.records.read_table import record_entry
from skyarm.records.registry.registrations import name_of
from skyarm.records.units import scalars
from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.description import unit_quaternion
from skyarm.vehicle.linkage import BASE, Body, Joint
from skyarm.vehicle.rotor_tables import coefficients_of
from skyarm.vehicle.thrust_table import ThrustTable
from skyarm.vehicle.vehicle_records import Frame, MountedDrive, Rotor, Vehicle

Table = dict[str, Any]

Notes = Mapping[str, str]
"""Comments: dotted path of a field, with the names of links and without those of
rotors -> comment behind it, or above it if it has several lines."""


def vehicle_text(
    vehicle: Vehicle, head: Sequence[str] = (), notes: Notes | None = None
) -> str:
    """TOML text of a vehicle file that holds the whole vehicle and refers to no other
    file.

    Numbers are written in full: the vehicle that is read back differs by the rounding
    of rotations and of scaled thrust tables only. Meshes for pictures, which a vehicle
    file cannot name, are left out.

    Args:
        vehicle: vehicle of concrete numbers.
        head: lines of a comment at the beginning.
        notes: comments behind fields, such as ``base.inertia``, ``links.upper.mass``,
            ``rotors.time_constant_up``.

    Raises:
        VehicleError: one line: a joint has a drive that is not registered, so that no
            file can name it.
    """
    notes = notes or {}
    top: Table = {"schema": 1, "name": vehicle.name}
    if vehicle.title:
        top["title"] = vehicle.title
    # left out where it is empty, because a key must have a value
    if vehicle.end_effector:
        top["end_effector"] = vehicle.end_effector
    if vehicle.followers:
        top["mimic"] = "couple"
    lines = [*(f"# {line}".rstrip() for line in head), *_lines(top, "", notes)]
    lines += _section("[base]", _body(vehicle.base), "base", notes)
    names = [link.name for link in vehicle.moving]
    of_follower = {each.name: each for each in vehicle.followers}
    # in the order of the vehicle, parents first, as the reader demands
    for link in vehicle.moving:
        at = f"links.{link.name}"
        parent = {
            "name": link.name,
            "parent": "base" if link.parent == BASE else names[link.parent],
        }
        lines += _section("[[links]]", {**parent, **_body(link.body)}, at, notes)
        joint = _joint(link.joint)
        if link.name in of_follower:
            tie = of_follower[link.name]
            leader = vehicle.links[tie.leader].joint.name
            joint["mimic"] = {
                "joint": leader,
                "ratio": float(tie.ratio),
                "offset": float(tie.offset),
            }
        lines += _section("[links.joint]", joint, f"{at}.joint", notes)[1:]
    for frame in vehicle.frames:
        lines += _section(
            "[[frames]]", _frame(frame, names), f"frames.{frame.name}", notes
        )
    for each in vehicle.collisions:
        table = _frame(each, names)
        if table.pop("faces", None):
            table["vertices"] = [list(map(float, corner)) for corner in each.vertices]
        lines += _section("[[collisions]]", table, f"collisions.{each.name}", notes)
    lines += rotor_lines(vehicle.rotors, notes)
    if any(map(float, vehicle.drag.area)) or "drag.area" in notes:
        lines += _section(
            "[drag]", _record(vehicle.drag, ("area", "air_density")), "drag", notes
        )
    for drive in vehicle.drives:
        lines += _section(
            f"[drives.{toml_key(drive.name)}]",
            _drive(drive),
            f"drives.{drive.name}",
            notes,
        )
    if vehicle.battery is not None:
        lines += _section("[battery]", _record(vehicle.battery), "battery", notes)
    if vehicle.sources:
        lines += _section("[sources]", dict(vehicle.sources), "sources", notes)
    return "\n".join(lines) + "\n"


def _section(head: str, table: Table, at: str, notes: Notes) -> list[str]:
    """Lines of one table of a vehicle file, after an empty line."""
    return ["", head, *_lines(table, at, notes)]


def _lines(table: Table, at: str, notes: Notes) -> list[str]:
    """Lines of a table's entries in a vehicle file, each with its comment."""
    lines = []
    for name, value in table.items():
        # a note of several lines stands above its entry, because a comment ends with
        # the line
        note = notes.get(f"{at}.{name}", "").split("\n")
        lines += [f"# {line}" for line in note if len(note) > 1]
        lines.append(
            f"{toml_key(name)} = {toml_value(value)}"
            + (f"  # {note[0]}" if note[0] and len(note) == 1 else "")
        )
    return lines


def toml_text(vehicle: Vehicle) -> str:
    """Text of a vehicle as an exported TOML file; meshes, which no vehicle file names,
    are lost.
    """
    lost = ", ".join(each.name for each in vehicle.looks)
    return vehicle_text(
        vehicle,
        [
            "Written by skyarm export.",
            *([f"lost or changed: meshes: {lost}"] if lost else []),
        ],
    )


def rotor_lines(
    rotors: Sequence[Rotor], notes: Notes = MappingProxyType({})
) -> list[str]:
    """Lines of a vehicle file for the rotors, with the values that all rotors share in
    ``[rotor_defaults]``.
    """
    tables = [_rotor(each) for each in rotors]
    # shared only if every rotor has the same value, so that reading back gives each its
    # own
    shared = {
        name: value
        for name, value in (tables[0] if tables else {}).items()
        if name not in PLACED and all(each.get(name) == value for each in tables)
    }
    lines = _section("[rotor_defaults]", shared, "rotors", notes) if shared else []
    for table in tables:
        own = {name: value for name, value in table.items() if name not in shared}
        lines += _section("[[rotors]]", own, "rotors", notes)
    return lines


PLACED = ("name", "position", "direction")
"""Keys that every rotor states itself."""


def _rotor(rotor: Rotor) -> Table:
    """Table of a rotor for a vehicle file."""
    # without max_speed a thrust table's last speed would be it
    entries = _record(
        rotor,
        [
            name
            for name in scalars(Rotor)
            if name != "max_speed" or rotor.table is not None
        ],
    )
    entries["direction"] = "ccw" if rotor.direction > 0 else "cw"
    if rotor.table is not None:
        # the reader takes coefficients from the table and refuses them beside it
        for name in ("table", *coefficients_of(rotor.table)):
            del entries[name]
        entries["thrust_table"] = _thrust_table(rotor, rotor.table)
    if rotor.shield:
        entries["shield"] = [*map(float, rotor.shield)]
    if rotor.tilt is not None:
        entries["tilt"] = _record(rotor.tilt)
    return entries


def _thrust_table(rotor: Rotor, table: ThrustTable) -> Table:
    """Thrust table for a vehicle file, with thrust and torque scaled to the rotor's own
    coefficients.
    """
    # a rotor may have been scaled after its table was made, so its columns are scaled
    # alike
    thrust = float(rotor.thrust_coefficient) / float(table.thrust_coefficient)
    columns: Table = {"thrust": [float(each) * thrust for each in table.thrust]}
    if table.torque:
        torque = (
            thrust * float(rotor.moment_coefficient) / float(table.moment_coefficient)
        )
        columns |= {"torque": [float(each) * torque for each in table.torque]}
    scales = {name: getattr(rotor, name) for name in coefficients_of(table)}
    return _record(replace(table, **columns, **scales))


def _body(body: Body) -> Table:
    entries = list(map(float, body.inertia.entries))
    # three moments suffice without products
    inertia = entries if any(entries[3:]) else entries[:3]
    return {**_record(body, ("com", "inertia")), "inertia": inertia}


def _joint(joint: Joint) -> Table:
    # stop_stiffness even where it is 0: a limited joint without would be given a stop
    # by the reader
    stated = ("damping", "coulomb", "coulomb_rate", "armature", "stop_stiffness")
    return _with_orientation(_record(joint, ("kind", "axis", *stated)), joint.rotation)


def _frame(frame: Frame, names: Sequence[str]) -> Table:
    link = "base" if frame.link == BASE else names[frame.link]
    return _with_orientation({**_record(frame), "link": link}, frame.rotation)


def _with_orientation(table: Table, rotation: Mat3) -> Table:
    """Vehicle-file table in which a rotation matrix is replaced by a quaternion, or
    left out for aligned axes.
    """
    oriented: Table = {}
    for name, each in table.items():
        if name != "rotation":
            oriented[name] = each
        elif rotation != Mat3.identity():
            oriented["quaternion_wxyz"] = unit_quaternion(rotation)
    return oriented


def _drive(drive: MountedDrive) -> Table:
    """Table of a joint's drive for a vehicle file, with its registered kind."""
    kind = name_of("drive", type(drive.drive))
    if kind is None:
        raise VehicleError(
            f"drives.{drive.name} = {shown(type(drive.drive).__name__)}: must be"
            " registered to be written"
        )
    return {"kind": kind, **_record(drive.drive)}


def _record(record: object, always: Collection[str] = ()) -> Table:
    """Table of a dataclass's fields for a vehicle file, with constants of compiled code
    as ordinary numbers.
    """
    entry: Table = record_entry(record, always)
    numbers = {
        name: float(entry[name]) for name in scalars(type(record)) if name in entry
    }
    vectors = {
        name: list(map(float, each))
        for name, each in parts(record).items()
        if name in entry and isinstance(each, Vec3)
    }
    # integers 0 and 1 of compiled code are written as numbers of the file's field
    return entry | numbers | vectors
