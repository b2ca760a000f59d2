"""Reader of bags of ROS 1 and ROS 2: files ``.bag``, ``.mcap`` and ``.db3``, and folders of the latter two.

A topic's columns are the numbers of its messages: ``angular_velocity.x``, ``position[0]``; lists of messages, and of
more than 32 numbers, are left out. Standard messages are quantities by their type: inertial units, poses, transforms,
odometry, batteries, joint states, speeds of motors. Topics of references and commands are no measurements.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from skyarm.flight_data.columns_file import Columns, Signal
from skyarm.flight_data.flight_data import BAG_FOLDER, FlightData, FlightFormat
from skyarm.flight_data.own_log import is_own_mcap, read_own_log
from skyarm.flight_data.raw_tables import Table, flight_of
from skyarm.records.arrays import Array
from skyarm.records.files import needs_extra

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces import Connection


METADATA = "metadata.yaml"
"""File that each folder of a bag of ROS 2 holds."""

LONGEST_LIST = 32
"""Numbers of a list that become columns."""

NOT_MEASURED = re.compile(r"reference|setpoint|goal|desired|target|command|cmd", re.IGNORECASE)
"""Names of topics that hold no measurement."""

LARGE = re.compile(r"Image|PointCloud|LaserScan|OccupancyGrid|Marker|TFMessage")
"""Types of messages that are not decoded."""

SECOND, NANO = 1_000_000_000, 1e-9


def _signal(topic: str, columns: Sequence[str], frame: str = "", order: str = "wxyz") -> Signal:
    entries = [re.fullmatch(r"\w+\[(.*\D.*)\]", each) for each in columns]
    names = tuple(each[1] for each in entries if each)
    return Signal(columns=tuple(columns), topic=topic, frame=frame, order=order, names=names)


def _xyz(place: str) -> list[str]:
    return [f"{place}.{axis}" for axis in "xyz"]


def _pose(place: str, translation: str, rotation: str) -> dict[str, tuple[list[str], str]]:
    return {"position": (_xyz(f"{place}.{translation}"), ""), "quaternion": (_turn(f"{place}.{rotation}"), "")}


def _turn(place: str) -> list[str]:
    return [f"{place}.{axis}" for axis in "xyzw"]


TYPES: Mapping[str, Mapping[str, tuple[list[str], str]]] = {
    "sensor_msgs/msg/Imu": {
        "gyro": (_xyz("angular_velocity"), "FLU"),
        "accelerometer": (_xyz("linear_acceleration"), "FLU"),
        "quaternion": (_turn("orientation"), ""),
    },
    "geometry_msgs/msg/PoseStamped": _pose("pose", "position", "orientation"),
    "geometry_msgs/msg/PoseWithCovarianceStamped": _pose("pose.pose", "position", "orientation"),
    "geometry_msgs/msg/TransformStamped": _pose("transform", "translation", "rotation"),
    "nav_msgs/msg/Odometry": {
        **_pose("pose.pose", "position", "orientation"),
        "velocity": (_xyz("twist.twist.linear"), "FLU"),
        "gyro": (_xyz("twist.twist.angular"), "FLU"),
    },
    "sensor_msgs/msg/BatteryState": {"voltage": (["voltage"], "")},
}
"""Type of a message -> quantity -> columns, and frame of the base. Odometry has its speeds in base axes."""

LISTS: Mapping[str, Mapping[str, str]] = {
    "sensor_msgs/msg/JointState": {
        "joint_positions": "position",
        "joint_rates": "velocity",
        "joint_efforts": "effort",
    },
    "mav_msgs/msg/Actuators": {"rotor_speeds": "angular_velocities"},
    "actuator_msgs/msg/Actuators": {"rotor_speeds": "velocity"},
}
"""Type of a message -> quantity -> list with a number for each joint or rotor."""


@dataclass(slots=True)
class _Rows:
    """Numbers of the messages of a topic, as they are decoded."""

    scalars: list[str]
    lists: list[str]
    stamped: bool
    received: list[int] = field(default_factory=list)
    stamps: list[int] = field(default_factory=list)
    numbers: list[tuple[float, ...]] = field(default_factory=list)
    listed: list[list[Array]] = field(default_factory=list)
    names: list[tuple[str, ...]] = field(default_factory=list)


def read_bag(path: Path, columns: Columns | None) -> FlightData:
    """Read a bag of ROS.

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
    with _one_line(), AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        kinds = {each.topic: str(each.msgtype) for each in reader.connections}
        chosen = [each for each in reader.connections if _is_read(each, topics)]
        if chosen:
            _read(reader, chosen, rows, notes)
    if not rows:
        there = ", ".join(sorted(f"{topic} ({kind})" for topic, kind in kinds.items())[:20])
        raise ValueError(f"topics: none that is read holds a message; there is {there or 'none'}")
    origin = min(min(each.received) for each in rows.values())
    tables = {topic: _table(each, origin) for topic, each in rows.items()}
    usual = _usual(tables, kinds)
    for name, signals in usual.items():
        if len(signals) > 1 and name not in own:
            listed = ", ".join(each.topic for each in signals)
            notes.append(f"{name}: there is {listed}; the fastest is taken unless a columns.toml names another.")
    facts: dict[str, str | float] = {f"topic {topic}": kind for topic, kind in sorted(kinds.items())[:100]}
    return flight_of(path, tables, usual, columns, origin=origin * NANO, facts=facts, notes=notes)


@contextmanager
def _one_line() -> Iterator[None]:
    """Context manager that makes one error of all that a damaged bag raises in its readers."""
    try:
        yield
    except OSError:
        raise
    except Exception as error:  # YAML, SQLite, compression and messages have readers of their own
        raise ValueError(f"bag: must be a whole bag of ROS ({type(error).__name__}: {error})") from None


def _is_read(connection: Connection, topics: Collection[str]) -> bool:
    """True if the messages of a topic are decoded: one that is named, or known; any if a quantity names no topic."""
    kind = connection.msgtype
    return connection.topic in topics or kind in TYPES or kind in LISTS or ("" in topics and LARGE.search(kind) is None)


def _read(reader: AnyReader, chosen: Collection[Connection], rows: dict[str, _Rows], notes: list[str]) -> None:
    """Decode the messages of some topics; what cannot be decoded is named in the notes."""
    wrong = 0
    try:
        for connection, received, data in reader.messages(connections=chosen):
            try:
                message = reader.deserialize(data, connection.msgtype)
                if connection.topic not in rows:
                    rows[connection.topic] = _columns_of(message)
                _append(rows[connection.topic], message, received)
            except Exception:  # of a damaged message, in whichever of its fields
                wrong += 1
    except Exception as error:  # of a damaged chunk: those before it are read
        if not rows:
            raise
        notes.append(f"bag: is damaged and read up to there ({type(error).__name__}: {error}).")
    if wrong:
        notes.append(f"bag: {wrong} messages cannot be decoded and are left out.")
    for topic in [topic for topic, each in rows.items() if not each.received]:
        del rows[topic]


def _columns_of(message: object) -> _Rows:
    """Columns of a topic, by its first message."""
    scalars, lists = list[str](), list[str]()

    def walk(part: object, place: str) -> None:
        for name in getattr(part, "__dataclass_fields__", {}):
            if name.startswith("__"):
                continue
            value, at = getattr(part, name), f"{place}{name}"
            if isinstance(value, (bool, int, float, np.number)):
                scalars.append(at)
            elif isinstance(value, np.ndarray):
                if value.size <= LONGEST_LIST and value.dtype.kind in "biuf":
                    lists.append(at)
            elif hasattr(value, "__dataclass_fields__") and place.count(".") < 8:
                walk(value, f"{at}.")

    walk(message, "")
    return _Rows(scalars, lists, {"header.stamp.sec", "header.stamp.nanosec"} <= set(scalars))


def _append(rows: _Rows, message: object, received: int) -> None:
    """Append the numbers of a message to those of its topic."""
    numbers = tuple(float(attrgetter(name)(message)) for name in rows.scalars)
    listed = [np.asarray(attrgetter(name)(message), dtype=float)[:LONGEST_LIST] for name in rows.lists]
    stamp = received
    if rows.stamped:
        head = attrgetter("header.stamp")(message)
        stamp = int(head.sec) * SECOND + int(head.nanosec) or received
    rows.numbers.append(numbers)
    rows.listed.append(listed)
    rows.names.append(_names_of(message))
    rows.received.append(received)
    rows.stamps.append(stamp)


def _names_of(message: object) -> tuple[str, ...]:
    """Names of the entries of a message's lists, as of joints; none if it has none, or one of them twice."""
    names = getattr(message, "name", ())
    if not isinstance(names, (list, tuple)) or not all(isinstance(each, str) and each for each in names):
        return ()
    return tuple(names[:LONGEST_LIST]) if len(set(names)) == len(names) else ()


def _entries(rows: _Rows, k: int) -> dict[str, Array]:
    """Columns of a list by the names of its entries, which messages may give in any order; by places without names."""
    every = list(dict.fromkeys(name for names in rows.names for name in names))
    if not every or any(
        each[k].size not in (0, len(names)) for each, names in zip(rows.listed, rows.names, strict=True)
    ):
        every = [str(place) for place in range(max(each[k].size for each in rows.listed))]
        places = [list(range(each[k].size)) for each in rows.listed]
    else:
        column = {name: place for place, name in enumerate(every)}
        places = [[column[name] for name in names] for names in rows.names]
    table = np.full((len(rows.listed), len(every)), np.nan)
    for row, (each, at) in enumerate(zip(rows.listed, places, strict=True)):
        if each[k].size:
            table[row, at] = each[k].ravel()
    return {name: table[:, place] for place, name in enumerate(every)}


def _table(rows: _Rows, origin: int) -> Table:
    """Table of a topic; rows of a shorter list hold NaN for the rest."""
    columns: dict[str, Array] = {}
    if rows.scalars:
        found = np.array(rows.numbers, dtype=float)
        columns |= {name: found[:, k] for k, name in enumerate(rows.scalars)}
    for k, name in enumerate(rows.lists):
        entries = _entries(rows, k)
        columns |= {f"{name}[{entry}]": each for entry, each in entries.items()}
        columns |= {f"{name}[{place}]": each for place, each in enumerate(entries.values())}
    time, received = (
        np.array([each - origin for each in given], dtype=float) * NANO for given in (rows.stamps, rows.received)
    )
    return Table(columns=columns, time=time, received=received)


def _usual(tables: Mapping[str, Table], kinds: Mapping[str, str]) -> dict[str, list[Signal]]:
    """Sources of each quantity by the types of the messages."""
    found: dict[str, list[Signal]] = {}
    ranks = [*TYPES, *LISTS]
    ordered = sorted(tables, key=lambda topic: ranks.index(kinds[topic]) if kinds[topic] in ranks else len(ranks))
    for topic in ordered:
        table, kind = tables[topic], kinds[topic]
        commanded = NOT_MEASURED.search(topic) is not None
        for name, (columns, frame) in TYPES.get(kind, {}).items():
            if commanded or (name == "quaternion" and _is_unknown(table)):
                continue
            signal = _signal(topic, columns, frame, "xyzw" if name == "quaternion" else "wxyz")
            found.setdefault(name, []).append(signal)
        for name, listed in LISTS.get(kind, {}).items():
            columns = _usual_entries(table, listed)
            if not columns:
                continue
            commands = {"rotor_speeds": "rotor_speed_commands", "joint_positions": "joint_commands"}
            if not commanded:
                found.setdefault(name, []).append(_signal(topic, columns))
            elif name in commands:
                found.setdefault(commands[name], []).append(_signal(topic, columns))
    return found


def _usual_entries(table: Table, listed: str) -> list[str]:
    """Columns of a list with the most numbers, by their names if they have any: others are of other messages."""
    every = [each for each in table.columns if each.startswith(f"{listed}[")]
    named = [each for each in every if not re.fullmatch(r"\d+", each[len(listed) + 1 : -1])] or every
    counts = {each: int(np.isfinite(table.columns[each]).sum()) for each in named}
    most = max(counts.values(), default=0)
    return [each for each, count in counts.items() if count == most > 0]


def _is_unknown(table: Table) -> bool:
    """True if an inertial unit gives no attitude: the first of its variances is negative, or all numbers are zero."""
    variance = table.columns.get("orientation_covariance[0]")
    turns = [table.columns[name] for name in _turn("orientation") if name in table.columns]
    return (variance is not None and bool((variance < 0.0).all())) or (bool(turns) and not np.any(turns))


BAG = FlightFormat(read_bag, suffixes=("bag",), begins=(b"#ROSBAG V",))
MCAP = FlightFormat(read_bag, suffixes=("mcap",), begins=(b"\x89MCAP0\r\n",))
DATABASE = FlightFormat(read_bag, suffixes=(BAG_FOLDER,), begins=(b"SQLite format 3\0",))
