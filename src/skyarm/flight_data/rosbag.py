"""Reader of ROS 1 and ROS 2 bags: files ``.bag``, ``.mcap`` and ``.db3``, and folders of the latter two.

A topic's columns are the numbers of its messages: ``angular_velocity.x``, ``position[0]``; lists of messages, and of
more than 32 numbers, are left out. Standard messages are quantities by their type: inertial units, poses, transforms,
odometry, batteries, joint states, speeds of motors. Topics of references and commands are no measurements.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, SupportsFloat

import numpy as np

from skyarm.algebra import ZERO3, Quaternion, Vec3
from skyarm.algebra.frames import turn_vectors
from skyarm.flight_data.columns_file import SOURCES, Columns, QuantitySource, usual_signals
from skyarm.flight_data.flight_data import BAG_FOLDER, PLACE, FlightData, FlightFormat
from skyarm.flight_data.own_log import is_own_mcap, read_own_log
from skyarm.flight_data.raw_tables import RawTable, flight_of
from skyarm.records.arrays import Array
from skyarm.records.files import needs_extra

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces import Connection


METADATA = "metadata.yaml"
"""File in each folder of a ROS 2 bag."""

LONGEST_LIST = 32
"""Largest number of items of a list that become columns."""

DEEPEST = 8
"""Largest nesting depth of messages."""

ENTRY = re.compile(r"\w+\[(.*\D.*)\]")
"""Pattern of a list item with a name."""

NOT_MEASURED = re.compile(r"reference|setpoint|goal|desired|target|command|cmd", re.IGNORECASE)
"""Pattern of topic names without measurements."""

LARGE = re.compile(r"Image|PointCloud|LaserScan|OccupancyGrid|Marker|TFMessage")
"""Pattern of message types that are not decoded."""

IMU, STATIC, BASE = "sensor_msgs/msg/Imu", "/tf_static", "base_link"
"""Type of the messages of inertial units, topic of fixed transforms, and frame of the base (REP 105)."""

PX4, STAMP = "px4_msgs/", "timestamp"
"""Beginning of the types of PX4's messages, and their field of the time (us), of PX4's own clock."""

SECOND, NANO = 1_000_000_000, 1e-9


TYPES = {kind: usual_signals(each) for kind, each in SOURCES["ros"].items()}
"""Message type -> quantity -> its sources."""

LISTS: Mapping[str, Mapping[str, str]] = {
    "sensor_msgs/msg/JointState": {
        "joint_positions": "position",
        "joint_rates": "velocity",
        "joint_efforts": "effort",
    },
    "mav_msgs/msg/Actuators": {"rotor_speeds": "angular_velocities"},
    "actuator_msgs/msg/Actuators": {"rotor_speeds": "velocity"},
    "px4_msgs/msg/ActuatorMotors": {"rotor_commands": "control"},
}
"""Message type -> quantity -> list with a number for each joint or rotor."""


COMMANDS = {"rotor_speeds": "rotor_speed_commands", "joint_positions": "joint_commands"}
"""Quantity of a list -> quantity of a topic without measurements."""


@dataclass(slots=True)
class _Rows:
    """Decoded messages of a topic: arrival times (ns), and numeric values grouped by their field names."""

    received: list[int] = field(default_factory=list)
    numbers: dict[tuple[str, ...], list[tuple[int, Array]]] = field(default_factory=dict)


def read_bag(path: Path, columns: Columns | None) -> FlightData:
    """Read a ROS bag as a measured flight.

    Raises:
        ValueError: one line: rosbags is missing, it is no bag, or a damaged one. OSError: it cannot be read.
    """
    if path.is_file() and is_own_mcap(path):
        return read_own_log(path, columns)
    if path.is_dir() and not (path / METADATA).is_file():
        raise ValueError(f"folder: must be a bag of ROS 2, with {METADATA}")
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise ValueError(f"rosbags: is missing; a bag of ROS {needs_extra('flights')}") from None
    notes: list[str] = []
    own = {} if columns is None else columns.signals
    topics = {signal.topic for signal in own.values()}
    rows: dict[str, _Rows] = {}
    mounts: dict[str, tuple[Vec3, Quaternion]] = {}
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            kinds = {each.topic: str(each.msgtype) for each in reader.connections}
            if chosen := [each for each in reader.connections if _is_read(each, topics)]:
                _read(reader, chosen, rows, notes)
                mounts = _mounts(reader)
    except OSError:
        raise
    except Exception as error:  # YAML, SQLite, compression and messages have readers of their own
        raise ValueError(f"bag: must be a whole bag of ROS ({type(error).__name__}: {error})") from None
    if not rows:
        there = ", ".join(sorted(f"{topic} ({kind})" for topic, kind in kinds.items())[:20])
        raise ValueError(f"topics: none that is read holds a message; there is {there or 'none'}")
    origin = min(min(each.received) for each in rows.values())
    tables = {topic: _table(each, origin, of_px4=kinds[topic].startswith(PX4)) for topic, each in rows.items()}
    if of_px4 := {topic: each for topic, each in tables.items() if kinds[topic].startswith(PX4)}:
        delays = [np.min(each.received - each.time) for each in of_px4.values() if each.received is not None]
        moved = origin * NANO if columns is not None and columns.time == STAMP else float(min(delays))
        tables |= {topic: replace(each, time=each.time + moved) for topic, each in of_px4.items()}
    usual = _usual(tables, kinds)
    for name, signals in usual.items():
        if len(signals) > 1 and name not in own:
            listed = ", ".join(each.topic for each in signals)
            notes.append(f"{name}: there is {listed}; the fastest is taken unless a columns.toml names another.")
    facts: dict[str, str | float] = {f"topic {topic}": kind for topic, kind in sorted(kinds.items())[:100]}
    flight = flight_of(path, tables, usual, columns, origin=origin * NANO, facts=facts, notes=notes)
    return _in_base_axes(flight, {} if {"gyro", "accelerometer"} & set(own) else mounts)


def _in_base_axes(flight: FlightData, mounts: Mapping[str, tuple[Vec3, Quaternion]]) -> FlightData:
    """Turn the readings of inertial units into base axes, and state the place of the accelerometer."""
    for quantity in ("gyro", "accelerometer"):
        topic = flight[quantity].source.partition(":")[0] if quantity in flight else ""
        if topic in mounts:
            place, turn = mounts[topic]
            turned = turn_vectors(np.array([[*turn]]), flight[quantity].values)
            changed = {quantity: replace(flight[quantity], values=turned)}
            facts = {**flight.facts, **dict(zip(PLACE, place, strict=True))}
            flight = replace(
                flight.with_channels(changed, f"{quantity}: is turned to {BASE} by {STATIC}."), facts=facts
            )
    return flight


def _mounts(reader: AnyReader) -> dict[str, tuple[Vec3, Quaternion]]:
    """Place (m) and axes of the inertial unit of each topic, by the fixed transforms that lead to it from the base."""
    links = dict[str, tuple[str, Vec3, Quaternion]]()
    mounts = dict[str, tuple[Vec3, Quaternion]]()
    fixed = [each for each in reader.connections if each.topic.endswith(STATIC)]
    for connection, _, data in reader.messages(connections=fixed) if fixed else ():
        for each in reader.deserialize(data, connection.msgtype).transforms:  # type: ignore[attr-defined]
            at, q = each.transform.translation, each.transform.rotation
            turn = Quaternion(q.w, q.x, q.y, q.z).normalized()
            links[each.child_frame_id] = (each.header.frame_id, Vec3(at.x, at.y, at.z), turn)
    for connection in [each for each in reader.connections if each.msgtype == IMU] if links else ():
        data = next((data for _, _, data in reader.messages(connections=[connection])), b"")
        name = reader.deserialize(data, IMU).header.frame_id if data else ""  # type: ignore[attr-defined]
        mount, left = (ZERO3, Quaternion(1.0, 0.0, 0.0, 0.0)), dict(links)
        while name in left:  # each once, that no circle is followed
            name, place, turn = left.pop(name)
            mount = place + turn.rotation().apply(mount[0]), turn * mount[1]
            if name.rpartition("/")[2] == BASE:
                mounts[connection.topic] = mount
    return mounts


def _is_read(connection: Connection, topics: Collection[str]) -> bool:
    """True if a topic must be decoded: named by the mapping, of a known type, or any if the mapping names none."""
    kind = connection.msgtype
    return connection.topic in topics or kind in TYPES or kind in LISTS or ("" in topics and LARGE.search(kind) is None)


def _read(reader: AnyReader, chosen: Collection[Connection], rows: dict[str, _Rows], notes: list[str]) -> None:
    """Decode the messages of the chosen topics; failures are noted."""
    wrong = 0
    try:
        for connection, received, data in reader.messages(connections=chosen):
            try:
                message = reader.deserialize(data, connection.msgtype)
                numbers = {name: float(value) for name, value in _numbers_of(message, "")}
                of_topic = rows.setdefault(connection.topic, _Rows())
                alike = of_topic.numbers.setdefault(tuple(numbers), [])
                alike.append((len(of_topic.received), np.array([*numbers.values()])))
                of_topic.received.append(received)
            except Exception:  # of a damaged message, in whichever of its fields
                wrong += 1
    except Exception as error:  # of a damaged chunk: those before it are read
        if not rows:
            raise
        notes.append(f"bag: is damaged and read up to there ({type(error).__name__}: {error}).")
    if wrong:
        notes.append(f"bag: {wrong} messages cannot be decoded and are left out.")


def _numbers_of(message: Any, place: str) -> Iterator[tuple[str, SupportsFloat]]:
    """Yield field path and value of each number in a message; list entries by name if the message gives names."""
    names = getattr(message, "name", ())
    named = isinstance(names, (list, tuple)) and all(isinstance(each, str) and each for each in names)
    for name in (each for each in getattr(message, "__dataclass_fields__", ()) if not each.startswith("__")):
        value, at = getattr(message, name), f"{place}{name}"
        if isinstance(value, (bool, int, float, np.number)):
            yield at, value
        elif isinstance(value, np.ndarray):
            if value.size <= LONGEST_LIST and value.dtype.kind in "biuf":
                entries = names if named and len(set(names)) == value.size else range(value.size)
                yield from ((f"{at}[{entry}]", each) for entry, each in zip(entries, value.ravel(), strict=True))
        elif place.count(".") < DEEPEST:
            yield from _numbers_of(value, f"{at}.")


def _table(rows: _Rows, origin: int, *, of_px4: bool = False) -> RawTable:
    """Numeric table of a ROS topic, NaN where a message lacks a number; named list entries also by index."""
    every = {name: place for place, name in enumerate(dict.fromkeys(chain(*rows.numbers)))}
    table = np.full((len(rows.received), len(every)), np.nan)
    for names, alike in rows.numbers.items():
        at, values = zip(*alike, strict=True)
        table[np.ix_(at, [every[name] for name in names])] = np.array(values)
    columns = {name: table[:, place] for name, place in every.items()}
    for name, column in columns.items():
        # a first variance below 0: what this message has not (sensor_msgs/msg/Imu)
        variance = columns.get(f"{name.partition('.')[0]}_covariance[0]")
        if variance is not None:
            column[variance < 0.0] = np.nan
    lists: dict[str, list[str]] = {}
    for name in filter(ENTRY.fullmatch, every):
        lists.setdefault(name[: name.index("[")], []).append(name)
    columns |= {f"{name}[{k}]": columns[each] for name, entries in lists.items() for k, each in enumerate(entries)}
    received = np.array(rows.received)
    stamps = received
    if {"header.stamp.sec", "header.stamp.nanosec"} <= set(columns):
        # a message without a stamp has NaN here
        seconds, rest = (np.nan_to_num(columns[f"header.stamp.{part}"]).astype(int) for part in ("sec", "nanosec"))
        stated = seconds * SECOND + rest
        stamps = np.where(stated == 0, received, stated)
    elif of_px4 and STAMP in columns:
        stamps = columns[STAMP] * 1e3
    order = np.argsort(stamps, kind="stable") if of_px4 else slice(None)  # as they were sent, not as they arrived
    time, arrival = ((each[order] - origin) * NANO for each in (stamps, received))
    return RawTable(columns={name: each[order] for name, each in columns.items()}, time=time, received=arrival)


def _usual(tables: Mapping[str, RawTable], kinds: Mapping[str, str]) -> dict[str, list[QuantitySource]]:
    """Default sources of each quantity, by the message types of the topics."""
    sources: dict[str, list[QuantitySource]] = {}
    ranks = [*TYPES, *LISTS]
    for topic in sorted((each for each in tables if kinds[each] in ranks), key=lambda each: ranks.index(kinds[each])):
        table, kind, measured = tables[topic], kinds[topic], NOT_MEASURED.search(topic) is None
        for name, signals in TYPES.get(kind, {}).items() if measured else ():
            held = (replace(each, topic=topic) for each in signals if _holds(table, each, name))
            sources.setdefault(name, []).extend(held)
        for listed, place in LISTS.get(kind, {}).items():
            name = listed if measured else COMMANDS.get(listed, "")
            if name and (entries := _usual_entries(table, f"{place}[")):
                names = tuple(match[1] for match in map(ENTRY.fullmatch, entries) if match)
                sources.setdefault(name, []).append(QuantitySource(columns=entries, topic=topic, names=names))
    return sources


def _usual_entries(table: RawTable, begin: str) -> tuple[str, ...]:
    """Columns of a topic's list with the most numbers; only named list entries if there are any."""
    every = [each for each in table.columns if each.startswith(begin)]
    counts = {each: int(np.isfinite(table.columns[each]).sum()) for each in every}
    named = [each for each in every if ENTRY.fullmatch(each)] or every
    most = max((counts[each] for each in named), default=0)
    return tuple(each for each in named if counts[each] == most > 0)


def _holds(table: RawTable, source: QuantitySource, name: str) -> bool:
    """True if a topic has numbers of a quantity; zeros alone are no attitude."""
    values = [table.numbers(each) for each in source.columns if table.has(each)]
    return bool((np.nan_to_num(values) if name == "quaternion" else np.isfinite(values)).any())


BAG = FlightFormat(read_bag, suffixes=("bag",), begins=(b"#ROSBAG V",))
MCAP = FlightFormat(read_bag, suffixes=("mcap",), begins=(b"\x89MCAP0\r\n",))
DATABASE = FlightFormat(read_bag, suffixes=(BAG_FOLDER,), begins=(b"SQLite format 3\0",))
