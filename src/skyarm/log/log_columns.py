"""Names and units of a log's numbers, one column each: the same in CSV, Parquet, MCAP and ROS 1 bags.

``position_x``, ``quaternion_w``, ``joint_shoulder``, ``joint_rate_shoulder``, ``rotor_speed_front``: the array's name
in the singular, then the axis, or the joint's or rotor's own name. Names are lower case letters, digits and single
underscores, as ROS 2 asks of the fields of a message.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.actuation.drive import TorqueDrive
from skyarm.contact.mechanism import KINDS
from skyarm.log.flight_log import Log
from skyarm.log.flown_scenario import written_part
from skyarm.log.sensor_data import sources_of
from skyarm.records.restore import restore
from skyarm.records.units import Unit, units

Array = npt.NDArray[np.float64]

COLUMNS: dict[str, tuple[str, str]] = {
    "joints": ("joint", "joints"),
    "joint_rates": ("joint_rate", "joints"),
    "efforts": ("joint_effort", "joints"),
    "joints_held": ("joint_held", "joints"),
    "joint_rates_held": ("joint_rate_held", "joints"),
    "joints_reference": ("joint_reference", "joints"),
    "measured_joints": ("measured_joint", "joints"),
    "rotor_speeds": ("rotor_speed", "rotors"),
    "rotor_commands": ("rotor_command", "rotors"),
    "tilts": ("rotor_tilt", "tilting"),
    "tilt_commands": ("rotor_tilt_command", "tilting"),
    "lag_found": ("lag_found", "loops"),
    "payload_mass": ("payload_mass", "payloads"),
    "contact_force": ("contact_force", "contacts"),
    "contact_friction": ("contact_friction", "contacts"),
    "contact_depth": ("contact_depth", "contacts"),
    "object_position": ("object_position", "objects"),
    "object_quaternion": ("object_quaternion", "objects"),
    "object_velocity": ("object_velocity", "objects"),
    "object_rate": ("object_rate", "objects"),
    "mechanism_position": ("mechanism_position", "mechanisms"),
    "mechanism_rate": ("mechanism_rate", "mechanisms"),
    "gripper_taken": ("gripper_taken", "grippers"),
    "gripper_force": ("gripper_force", "grippers"),
    "gripper_lost": ("gripper_lost", "grippers"),
    "gripper_pull": ("gripper_pull", "grippers"),
    "tool": ("tip", ""),
    "tool_held": ("tip_held", ""),
    "tool_reference": ("tip_reference", ""),
}
"""Array -> beginning of its columns, and the :class:`Names` with which they end; of all others axes, or nothing."""

KINDS_OF_NAMES = {"joints": "joint", "rotors": "rotor", "tilting": "rotor"}
"""Names that a user chose -> the word that a column does not repeat."""

SETPOINT = "joint_setpoint"
"""Beginning of the commands to joints whose drives take no torque."""

CONTACT_ARRAYS = ("contact_force", "contact_friction", "contact_depth")
"""Arrays of a number for each surface of the world with each point of the vehicle."""

OBJECT_ARRAYS = {"object_position": 3, "object_quaternion": 4, "object_velocity": 3, "object_rate": 3}
"""Arrays of free objects, in the order in which a contact logs them, and how many numbers each object has in them."""

MECHANISM_ARRAYS = ("mechanism_position", "mechanism_rate")
"""Arrays of a number for each mechanism, in the order in which a contact logs them, behind the objects."""

GRIPPER_ARRAYS = {"gripper_taken": 1, "gripper_force": 1, "gripper_lost": 1, "gripper_pull": 3}
"""Arrays of grippers, in the order in which a contact logs them, and how many numbers each gripper has in them."""

AXES = {1: ("",), 3: ("x", "y", "z"), 4: ("w", "x", "y", "z")}


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a log.

    Attributes:
        name: of the column. unit: SI; empty for pure numbers. meaning: in words, with axes.
        array: name of the log's array. index: place in its rows; None for an array without any.
    """

    name: str
    unit: str
    meaning: str
    array: str
    index: int | None

    def of(self, log: Log) -> Array:
        """Its numbers (N,)."""
        array = log[self.array]
        return array if self.index is None else array[:, self.index]


@dataclass(frozen=True, slots=True)
class Names:
    """Names of the plant's joints and rotors as its file has them, the joints' kinds, and what they are told.

    ``setpoints`` has a unit for each joint that takes a setpoint in place of a torque, None for the others; ``tilting``
    are the rotors that tilt, ``contacts`` the pairs of a surface of the world and a point of the vehicle, ``objects``
    its free bodies, ``mechanisms`` those with one degree of freedom (kinds as those of joints), ``grippers`` those of
    the vehicle.
    """

    joints: tuple[str, ...]
    kinds: tuple[str, ...]
    rotors: tuple[str, ...]
    setpoints: tuple[str | None, ...]
    tilting: tuple[str, ...] = ()
    contacts: tuple[str, ...] = ()
    objects: tuple[str, ...] = ()
    mechanisms: tuple[str, ...] = ()
    grippers: tuple[str, ...] = ()
    mechanism_kinds: tuple[str, ...] = ()
    loops: tuple[str, ...] = ("rotors", "joints")
    payloads: tuple[str, ...] = ()


def names_of(log: Log) -> Names:
    """Names of joints and rotors; their numbers where a log of an earlier version keeps none."""
    joints, rotors = log.joints.shape[1], log.rotor_speeds.shape[1]
    vehicle = _table(written_part(log.info, "agent", "plant", "vehicle"))
    links, turning = (each if isinstance(each := vehicle.get(part), list) else [] for part in ("links", "rotors"))
    found = [_below(link, "joint") for link in links]
    named = len(found) == joints and len(turning) == rotors
    if not named or not all(isinstance(each.get("name"), str) for each in (*found, *map(_table, turning))):
        return Names(tuple(map(str, range(joints))), ("",) * joints, tuple(map(str, range(rotors))), (None,) * joints)
    told = setpoints_of(log.info)
    kinds = tuple(str(each.get("kind", "")) for each in found)
    return Names(
        tuple(each["name"] for each in found),
        kinds,
        tuple(_table(each)["name"] for each in turning),
        tuple(
            unit_of_kind(Unit(told[each["name"]]), kind) if each["name"] in told else None
            for each, kind in zip(found, kinds, strict=True)
        ),
        tuple(each["name"] for each in map(_table, turning) if each.get("tilt")),
        *_contacts(log),
    )


def _contacts(log: Log) -> tuple[tuple[str, ...], ...]:
    """Pairs of a surface and a point; objects and mechanisms, whose skins are surfaces, too; grippers."""
    world = _table(written_part(log.info, "environment", "world"))
    points, objects, mechanisms, grippers = (
        tuple(word(str(_table(each).get("name"))) for each in world.get(of) or [])
        for of in ("points", "objects", "mechanisms", "grippers")
    )
    surfaces = map(word, touched_surfaces(world))
    pairs = tuple(f"{surface}_{point}" for surface in surfaces for point in points)
    return pairs, objects, mechanisms, grippers, tuple(_joint_kind(each) for each in world.get("mechanisms") or [])


def _joint_kind(mechanism: Any) -> str:
    """The kind of joint that a mechanism is."""
    kind = KINDS.get(str(_table(mechanism).get("kind")))
    return "" if kind is None else "revolute" if kind.turns else "prismatic"


def touched_surfaces(world: Mapping[str, Any]) -> list[str]:
    """Names of all that the vehicle's points may touch, as plain data of a contact tell them, in a log's order."""
    found = [str(_table(each).get("name")) for of in ("surfaces", "objects") for each in world.get(of) or []]
    for each in map(_table, world.get("mechanisms") or []):
        found += [str(each.get("name"))] * bool(each.get("size"))
        found += [str(_table(part).get("name")) for part in each.get("parts") or []]
    return found


def _below(data: Any, *path: str) -> Mapping[str, Any]:
    for name in path:
        data = _table(data).get(name)
    return _table(data)


def _table(data: Any) -> Mapping[str, Any]:
    return data if isinstance(data, dict) else {}


def columns(log: Log) -> tuple[Column, ...]:
    """Columns of a log, in the order of its arrays."""
    names, found = names_of(log), []
    for array, unit in units(Log).items():
        width = getattr(log, array).shape[1:]
        group = COLUMNS.get(array, ("", ""))[1]
        kinds = {"joints": names.kinds, "mechanisms": names.mechanism_kinds}.get(group, ())
        for index, name in enumerate(_endings(array, width[0] if width else None, names)):
            told = names.setpoints[index] if array == "efforts" else None
            own = unit_of_kind(unit, kinds[index] if index < len(kinds) else "") if told is None else told
            found.append(Column(name, own, unit.meaning, array, index if width else None))
    found += _sensor_columns(log, names)
    unique = distinct([each.name for each in found])
    return tuple(replace(each, name=name) for name, each in zip(unique, found, strict=True))


def _sensor_columns(log: Log, names: Names) -> Iterator[Column]:
    """Columns of readings and estimate: the source's name, then as the log's own arrays are called."""
    for source, described in sources_of(log.info).items():
        begin = word(source.rpartition(".")[2])
        for name, each in described.fields.items():
            array, group = f"{source}.{name}", COLUMNS.get(name, ("", ""))[1]
            if array not in log.received:
                continue
            if each.axes is None:
                yield Column(f"{begin}_{word(name)}", each.unit, each.meaning, array, None)
                continue
            named = group in KINDS_OF_NAMES and len(getattr(names, group)) == len(each.axes)
            endings = _endings(name, len(each.axes), names) if named else []
            for index, axis in enumerate(each.axes):
                ending = endings[index] if named else f"{word(name)}_{word(axis)}"
                kind = names.kinds[index] if named and group == "joints" else ""
                unit = unit_of_kind(Unit(each.unit), kind)
                yield Column(f"{begin}_{ending}", unit, each.meaning, array, index)


def _endings(array: str, width: int | None, names: Names) -> list[str]:
    """Names of an array's columns; numbers where the log does not name as many parts."""
    begin, group = COLUMNS.get(array, (array, ""))
    if width is None:
        return [begin]
    parts = getattr(names, group) if group else ("",)
    axes = AXES.get(width // len(parts)) if parts and width % len(parts) == 0 else None
    if not axes:
        return [f"{begin}_{i}" for i in range(width)]
    begins = [begin] * len(parts)
    if array == "efforts":
        begins = [begin if told is None else SETPOINT for told in names.setpoints]
    kind = KINDS_OF_NAMES.get(group)
    labels = [word(each, kind) if kind else each for each in parts]
    return [
        "_".join(filter(None, (first, label, axis)))
        for first, label in zip(begins, labels, strict=True)
        for axis in axes
    ]


def word(name: str, kind: str = "") -> str:
    """A joint's or rotor's name as part of a column's: ``Wrist-Roll`` is wrist_roll, joint ``joint1`` is 1."""
    text = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
    return text.removeprefix(kind).strip("_") or text or "unnamed"


def distinct(names: Sequence[str]) -> list[str]:
    """The names, a number behind those that another one before them has."""
    found: list[str] = []
    for name in names:
        unique, k = name, 2
        while unique in found or (unique != name and unique in names):
            unique, k = f"{name}_{k}", k + 1
        found.append(unique)
    return found


def unit_of_kind(unit: Unit, kind: str) -> str:
    """A unit such as ``rad or m`` for one joint: the first of a revolute one, the second of a prismatic one."""
    options = unit.unit.split(" or ")
    return options[kind == "prismatic"] if kind and len(options) == 2 else unit.unit


def layout(log: Log) -> dict[str, dict[str, Any]]:
    """Names and unit of each array's columns as plain data, for files that keep arrays: array -> names, units."""
    found: dict[str, dict[str, Any]] = {}
    for each in columns(log):
        entry = found.setdefault(each.array, {"columns": [], "units": []})
        entry["columns"].append(each.name)
        entry["units"].append(each.unit)
    return found


def setpoints_of(info: Mapping[str, Any]) -> dict[str, str]:
    """Unit of the setpoint of each joint that takes no torque, by the joint's name.

    Args:
        info: of a log, which keeps the scenario that was flown.

    Returns:
        units as ``rad or m``, of a revolute and of a prismatic joint; empty where a drive of someone's own states none,
        or its plugin is not loaded.
    """
    carried = _rows(written_part(info, "agent", "plant", "vehicle", "drives"))
    # the scenario's own drive of a joint wins over the vehicle's
    given = {each.get("name"): each.get("drive") for each in carried}
    given |= {each.get("joint"): each.get("drive") for each in _rows(written_part(info, "agent", "drives"))}
    found = {}
    for joint, drive in given.items():
        try:
            made = restore(drive, info.get("plugins"))
        except (ValueError, TypeError, KeyError, AttributeError):
            made = None
        if isinstance(joint, str) and not isinstance(made, TorqueDrive):
            takes = getattr(made, "takes", "")
            found[joint] = takes if isinstance(takes, str) else ""
    return found


def _rows(data: Any) -> list[Mapping[str, Any]]:
    return [_table(each) for each in data] if isinstance(data, list) else []
