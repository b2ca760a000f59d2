"""Names and units of a log's numbers, one column each: the same in CSV, Parquet, MCAP and ROS 1 bags.

``position_x``, ``quaternion_w``, ``joint_shoulder``, ``joint_rate_shoulder``, ``rotor_speed_front``: the array's name
in the singular, then the axis, or the joint's or rotor's own name. Names are lower case letters, digits and single
underscores, as ROS 2 asks of the fields of a message.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.contact.mechanism import KINDS
from skyarm.log.flight_log import IF_ANY, Log
from skyarm.log.joint_setpoints import setpoints_of
from skyarm.log.sensor_data import sources_of
from skyarm.records.units import Unit, units

Array = npt.NDArray[np.float64]

JOINT_ARRAYS = {
    "joints": "joint",
    "joint_rates": "joint_rate",
    "efforts": "joint_effort",
    "joints_held": "joint_held",
    "joint_rates_held": "joint_rate_held",
    "joints_reference": "joint_reference",
    "measured_joints": "measured_joint",
}
"""Array of a number for each joint -> beginning of its columns."""

SETPOINT = "joint_setpoint"
"""The same of the commands to joints whose drives take no torque."""

ROTOR_ARRAYS = {"rotor_speeds": "rotor_speed", "rotor_commands": "rotor_command"}
"""Array of a number for each rotor -> beginning of its columns."""

TILT_ARRAYS = {"tilts": "rotor_tilt", "tilt_commands": "rotor_tilt_command"}
"""Array of a number for each rotor that tilts -> beginning of its columns."""

BY_NAME = (*JOINT_ARRAYS, *ROTOR_ARRAYS, *TILT_ARRAYS)
"""Arrays, of a log or of a reading, whose columns bear the names of joints and rotors."""

LOOPS = {"lag_found": ("rotors", "joints")}
"""Array of a number for each group of loops -> endings of its columns."""

PLACES = ("measured_position", "load_place_found", "load_inertia_found")
"""Arrays of three axes that not every flight has."""

CONTACT_ARRAYS = ("contact_force", "contact_friction", "contact_depth")
"""Arrays of a number for each surface of the world with each point of the vehicle."""

OBJECT_ARRAYS = {"object_position": 3, "object_quaternion": 4, "object_velocity": 3, "object_rate": 3}
"""Arrays of free objects, in the order in which a contact logs them, and how many numbers each object has in them."""

MECHANISM_ARRAYS = ("mechanism_position", "mechanism_rate")
"""Arrays of a number for each mechanism, in the order in which a contact logs them, behind the objects."""

GRIPPER_ARRAYS = {"gripper_taken": 1, "gripper_force": 1, "gripper_lost": 1, "gripper_pull": 3}
"""Arrays of grippers, in the order in which a contact logs them, and how many numbers each gripper has in them."""

RENAMED = {"tool": "tip", "tool_held": "tip_held", "tool_reference": "tip_reference"}
"""Array that a log's file of arrays keeps under its first name -> the word for it."""

AXES = {3: ("x", "y", "z"), 4: ("w", "x", "y", "z")}


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


def names_of(log: Log) -> Names:
    """Names of joints and rotors; their numbers where a log of an earlier version keeps none."""
    joints, rotors = log.joints.shape[1], log.rotor_speeds.shape[1]
    vehicle = _below(log.info, "scenario_record", "world", "vehicle")
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
    world = _below(log.info, "scenario_record", "contact")
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
        for index, ending in enumerate(_endings(array, width[0] if width else None, names)):
            kind = names.kinds[index] if array in JOINT_ARRAYS else ""
            if array in MECHANISM_ARRAYS and len(names.mechanism_kinds) == width[0]:
                kind = names.mechanism_kinds[index]
            place = index if width else None
            told = names.setpoints[index] if array == "efforts" else None
            own = unit_of_kind(unit, kind) if told is None else told
            found.append(Column(ending, own, unit.meaning, array, place))
    found += _sensor_columns(log, names)
    unique = distinct([each.name for each in found])
    return tuple(
        Column(name, each.unit, each.meaning, each.array, each.index) for name, each in zip(unique, found, strict=True)
    )


def _sensor_columns(log: Log, names: Names) -> Iterator[Column]:
    """Columns of readings and estimate: the source's name, then as the log's own arrays are called."""
    for source, described in sources_of(log.info).items():
        begin = word(source.rpartition(".")[2])
        for name, each in described.fields.items():
            array, axes = f"{source}.{name}", each.axes
            if array not in log.received:
                continue
            if axes is None:
                yield Column(f"{begin}_{word(name)}", each.unit, each.meaning, array, None)
                continue
            endings = _endings(name, len(axes), names) if name in BY_NAME else []
            by_name = len(endings) == len(axes)
            for index, axis in enumerate(axes):
                ending = endings[index] if by_name else f"{word(name)}_{word(axis)}"
                kind = names.kinds[index] if by_name and name in JOINT_ARRAYS else ""
                unit = unit_of_kind(Unit(each.unit), kind)
                yield Column(f"{begin}_{ending}", unit, each.meaning, array, index)


def _endings(array: str, width: int | None, names: Names) -> list[str]:
    """Names of an array's columns; of arrays with other columns, their numbers."""
    begin = RENAMED.get(array, array)
    if width is None:
        return [begin]
    if array == "efforts":
        begins = [JOINT_ARRAYS[array] if told is None else SETPOINT for told in names.setpoints]
        return [f"{first}_{word(each, 'joint')}" for first, each in zip(begins, names.joints, strict=True)]
    if array in JOINT_ARRAYS:
        return [f"{JOINT_ARRAYS[array]}_{word(each, 'joint')}" for each in names.joints[:width]]
    if array in ROTOR_ARRAYS:
        return [f"{ROTOR_ARRAYS[array]}_{word(each, 'rotor')}" for each in names.rotors]
    if array in TILT_ARRAYS and len(names.tilting) == width:
        return [f"{TILT_ARRAYS[array]}_{word(each, 'rotor')}" for each in names.tilting]
    if array in LOOPS:
        return [f"{begin}_{each}" for each in LOOPS[array][:width]]
    if array in CONTACT_ARRAYS and len(names.contacts) == width:
        return [f"{begin}_{each}" for each in names.contacts]
    if array in OBJECT_ARRAYS and len(names.objects) * OBJECT_ARRAYS[array] == width:
        return [f"{begin}_{each}_{axis}" for each in names.objects for axis in AXES[OBJECT_ARRAYS[array]]]
    if array in MECHANISM_ARRAYS and len(names.mechanisms) == width:
        return [f"{begin}_{each}" for each in names.mechanisms]
    if array in GRIPPER_ARRAYS and len(names.grippers) * GRIPPER_ARRAYS[array] == width:
        axes = [f"_{axis}" for axis in AXES[3]] if GRIPPER_ARRAYS[array] == 3 else [""]
        return [f"{begin}_{each}{axis}" for each in names.grippers for axis in axes]
    if array in IF_ANY and array not in PLACES:
        return [f"{begin}_{i}" for i in range(width)]
    return [f"{begin}_{axis}" for axis in AXES.get(width, map(str, range(width)))]


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
