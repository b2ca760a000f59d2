"""Names and units of the columns of a log, the same in CSV and MCAP files.

``position_x``, ``quaternion_w``, ``joint_shoulder``, ``joint_rate_shoulder``,
``rotor_speed_front``: the array's name in the singular, then the axis, or the joint's
or rotor's own name. Names are lower case letters, digits and single underscores, as ROS
2 asks of the fields of a message.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, Protocol, TypeVar

from skyarm.log.flown_scenario import Info, restore_written, restored_at, written_at
from skyarm.log.sensor_data import COMPONENTS, sources_of
from skyarm.records.arrays import Array
from skyarm.records.files.names import distinct
from skyarm.records.immutable import positional
from skyarm.records.plain import Plain
from skyarm.records.units import Unit, units
from skyarm.vehicle import Link, Rotor

Part = TypeVar("Part", Link, Rotor)

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
    "tool": ("tip", ""),
    "tool_held": ("tip_held", ""),
    "tool_reference": ("tip_reference", ""),
}
"""Array -> prefix of its columns, and the :class:`Names` of their suffixes; all others
end in axes or nothing."""


def group_of(array: str) -> str:
    """Field of :class:`Names` with the names of an array's columns; empty for axes."""
    return COLUMNS.get(array, ("", ""))[1]


KINDS_OF_NAMES = {"joints": "joint", "rotors": "rotor", "tilting": "rotor"}
"""Kind of user-chosen names -> word that a column does not repeat."""

SETPOINT = "joint_setpoint"
"""Prefix of the columns of commands to joints whose drives take no torque."""


AXES = {1: ("",), 3: ("x", "y", "z"), 4: ("w", "x", "y", "z")}


class Arrays(Protocol):
    """Interface of objects that return a log's arrays by name, such as a log or some of
    its instants.
    """

    def __getitem__(self, array: str) -> Array: ...


class FlightArrays(Arrays, Protocol):
    """Interface of a log, :class:`skyarm.Log`: its arrays and its description."""

    @property
    def time(self) -> Array:
        """Times (s) of a log's control instants, (N,)."""

    @property
    def path_time(self) -> Array:
        """Times (s) of the reference at a log's instants, (N,); empty if they equal
        those of the flight.
        """

    @property
    def info(self) -> Info:
        """Metadata of a logged flight."""

    @property
    def agents(self) -> Mapping[str, FlightArrays]:
        """Log of each vehicle by name."""

    def arrays(self) -> Mapping[str, Array]:
        """All arrays of a log by name."""

    def component(self, name: str) -> Array:
        """Array logged by a wind, force or contact model; (N, 0) if the flight has no
        such array.
        """


@positional
class LogColumn:
    """Column of a log: one number over time, with name, unit and meaning.

    Attributes:
        name: name of the column. unit: SI; empty for pure numbers. meaning: in words,
            with axes.
        array: name of the log's array. index: place in its rows; None for an array
            without any.
    """

    name: str
    unit: str
    meaning: str
    array: str
    index: int | None

    def of(self, log: Arrays) -> Array:
        """Values (N,) of the column in a given log, or in an object with some of its
        instants.
        """
        array = log[self.array]
        return array if self.index is None else array[:, self.index]


@positional
class Names:
    """Names of a logged vehicle's joints and rotors, and the units of the joint
    commands.

    ``setpoints`` has a unit for each joint that takes a setpoint in place of a torque,
    None for the others; ``tilting`` are the rotors that tilt.
    """

    joints: tuple[str, ...]
    kinds: tuple[str, ...]
    rotors: tuple[str, ...]
    setpoints: tuple[str | None, ...]
    tilting: tuple[str, ...] = ()
    loops: tuple[str, ...] = ("rotors", "joints")


def names_of(log: FlightArrays) -> Names:
    """Names of joints and rotors from a log; index numbers if the log does not name
    them.
    """
    joints, rotors = log["joints"].shape[1], log["rotor_speeds"].shape[1]
    driven = [link.joint for link in _records(log.info, Link, "links")]
    turning, takes = _records(log.info, Rotor, "rotors"), setpoints_of(log.info)
    # a record that cannot be restored names nothing; numbers serve then
    if len(driven) != joints or len(turning) != rotors:
        return Names(
            tuple(map(str, range(joints))),
            ("",) * joints,
            tuple(map(str, range(rotors))),
            (None,) * joints,
        )
    return Names(
        tuple(each.name for each in driven),
        tuple(each.kind for each in driven),
        tuple(each.name for each in turning),
        tuple(
            (
                unit_of_kind(Unit(takes[each.name]), each.kind)
                if each.name in takes
                else None
            )
            for each in driven
        ),
        tuple(each.name for each in turning if each.tilt is not None),
    )


def _records(info: Info, kind: type[Part], part: str) -> list[Part]:
    """Links or rotors of the logged vehicle as records; empty for a damaged file."""
    records = restored_at(info, f"plant.vehicle.{part}")
    return (
        [each for each in records if isinstance(each, kind)]
        if isinstance(records, tuple)
        else []
    )


def columns(log: FlightArrays) -> tuple[LogColumn, ...]:
    """List the columns of a log, in the order of its arrays; of several vehicles each
    with the vehicle's name.
    """
    # one vehicle has its columns without a name before them, as files of one have had
    # them
    if len(log.agents) > 1:
        return _columns_of_team(log)
    names = names_of(log)
    listed = list[LogColumn]()
    for array, unit in units(type(log)).items():
        width = log[array].shape[1:]
        kinds = names.kinds if group_of(array) == "joints" else ()
        for index, name in enumerate(
            _endings(array, width[0] if width else None, names)
        ):
            setpoint = names.setpoints[index] if array == "efforts" else None
            own = (
                unit_of_kind(unit, kinds[index] if index < len(kinds) else "")
                if setpoint is None
                else setpoint
            )
            listed.append(
                LogColumn(name, own, unit.meaning, array, index if width else None)
            )
    return _uniquely_named([*listed, *_sensor_columns(log, names)])


def _columns_of_team(log: FlightArrays) -> tuple[LogColumn, ...]:
    """List the columns of a log of several vehicles: those of each, then those of what
    all share.
    """
    arrays = log.arrays()
    listed = list[LogColumn]()
    shared = dict[str, LogColumn]()
    for name, own in log.agents.items():
        for each in columns(own):
            if f"{name}/{each.array}" in arrays:
                listed.append(
                    replace(
                        each,
                        name=f"{word(name)}_{each.name}",
                        array=f"{name}/{each.array}",
                    )
                )
            elif each.array in arrays:
                shared[each.name] = each
    # time first, as in a log of one vehicle
    return _uniquely_named([shared.pop("time"), *listed, *shared.values()])


def _uniquely_named(listed: list[LogColumn]) -> tuple[LogColumn, ...]:
    """Columns with a number behind a repeated name: two joints may have one name in
    lower case.
    """
    unique = distinct([each.name for each in listed])
    return tuple(
        replace(each, name=name) for name, each in zip(unique, listed, strict=True)
    )


def _sensor_columns(log: FlightArrays, names: Names) -> Iterator[LogColumn]:
    """Yield the columns of sensor readings, estimate and environment models of a
    log.
    """
    arrays = log.arrays()
    for source, described in sources_of(log.info).items():
        begin = "" if source == COMPONENTS else f"{word(source.rpartition('.')[2])}_"
        for name, each in described.fields.items():
            array, group = f"{source}.{name}", group_of(name)
            if array not in arrays:
                continue
            if each.axes is None:
                yield LogColumn(
                    f"{begin}{word(name)}", each.unit, each.meaning, array, None
                )
                continue
            # names of the vehicle fit only an array with one column for each of them
            named = group in KINDS_OF_NAMES and len(getattr(names, group)) == len(
                each.axes
            )
            endings = _endings(name, len(each.axes), names) if named else []
            for index, axis in enumerate(each.axes):
                ending = (
                    endings[index]
                    if named
                    else f"{word(name)}_{word(axis) if axis else index}"
                )
                kind = names.kinds[index] if named and group == "joints" else ""
                unit = (
                    each.units[index]
                    if each.units
                    else unit_of_kind(Unit(each.unit), kind)
                )
                yield LogColumn(f"{begin}{ending}", unit, each.meaning, array, index)


def _endings(array: str, width: int | None, names: Names) -> list[str]:
    """Column names of an array, made from joint, rotor or axis names."""
    begin, group = COLUMNS.get(array, (array, ""))
    if width is None:
        return [begin]
    parts = getattr(names, group) if group else ("",)
    # components of vectors follow the part to which they belong
    axes = AXES.get(width // len(parts)) if parts and width % len(parts) == 0 else None
    if not axes:
        return [f"{begin}_{i}" for i in range(width)]
    begins = [begin] * len(parts)
    # a servo takes a setpoint, whose column must not be called an effort
    if array == "efforts":
        begins = [
            begin if setpoint is None else SETPOINT for setpoint in names.setpoints
        ]
    kind = KINDS_OF_NAMES.get(group)
    labels = [word(each, kind) if kind else each for each in parts]
    return [
        "_".join(filter(None, (first, label, axis)))
        for first, label in zip(begins, labels, strict=True)
        for axis in axes
    ]


def word(name: str, kind: str = "") -> str:
    """Convert a joint's or rotor's name for a column name: ``Wrist-Roll`` becomes
    wrist_roll.
    """
    text = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
    # a joint called joint_1 is not to become joint_joint_1
    return text.removeprefix(kind).strip("_") or text or "unnamed"


def unit_of_kind(unit: Unit, kind: str) -> str:
    """Choose from a pair of units such as ``rad or m``: the first if a joint is
    revolute, the second if prismatic.
    """
    options = unit.unit.split(" or ")
    return options[kind == "prismatic"] if kind and len(options) == 2 else unit.unit


def component_labels(log: FlightArrays, array: str) -> list[str]:
    """Column labels of an array that a wind, force or contact model logged."""
    # components belong to the world, so any vehicle's log describes them
    source = sources_of(next(iter(log.agents.values())).info).get(COMPONENTS)
    field = None if source is None else source.fields.get(array)
    return [] if field is None else field.axes or []


def layout(log: FlightArrays) -> dict[str, dict[str, list[str]]]:
    """Names and units of each array's columns as plain data, for files that store
    arrays.
    """
    arrays: dict[str, dict[str, list[str]]] = {}
    for each in columns(log):
        entry = arrays.setdefault(each.array, {"columns": [], "units": []})
        entry["columns"].append(each.name)
        entry["units"].append(each.unit)
    return arrays


def setpoints_of(info: Info) -> dict[str, str]:
    """Setpoint unit of each joint that is not commanded by torque, by the joint's name.

    Args:
        info: description of a log, which keeps the scenario that was flown.

    Returns:
        units as ``rad or m``, of a revolute and of a prismatic joint; empty where a
        user's drive states none, or its plugin is not loaded.
    """
    units_of_joints = {}
    for joint, drive in drives_of(info).items():
        # a drive whose plugin is missing counts as one that takes no torque
        if not getattr(drive, "takes_torque", False):
            takes = getattr(drive, "takes", "")
            units_of_joints[joint] = takes if isinstance(takes, str) else ""
    return units_of_joints


def drives_of(info: Info) -> dict[str, Any]:
    """Drive of each joint that has one, by joint name; None for a drive whose plugin is
    not loaded.

    Args:
        info: description of a log, which keeps the scenario that was flown.
    """
    carried = _rows(written_at(info, "plant.vehicle.drives"))
    # the scenario's own drive of a joint wins over the vehicle's
    given = {each.get("name"): each.get("drive") for each in carried}
    given |= {
        each.get("joint"): each.get("drive")
        for each in _rows(written_at(info, "plant.drives"))
    }
    return {
        joint: restore_written(info, drive)
        for joint, drive in given.items()
        if isinstance(joint, str)
    }


def _rows(data: Plain) -> list[dict[str, Plain]]:
    return (
        [each for each in data if isinstance(each, dict)]
        if isinstance(data, list)
        else []
    )
