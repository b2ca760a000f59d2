"""Reader of ROS 1 and ROS 2 bags: files ``.bag``, ``.mcap`` and ``.db3``, and folders
of the latter two.

A topic's columns are the numbers of its messages: ``angular_velocity.x``,
``position[0]``; lists of more than 32 are left out. Standard messages, those of PX4 and
those of MAVROS are quantities by their type: inertial units, poses, transforms,
odometry, batteries, joint states, outputs to motors and their speeds. Topics of
references and commands are no measurements. Of several vehicles, told by the names of
their inertial units' topics, one is read. A pose is of one world: that of a motion
capture where there is one, not the autopilot's. PX4's ``actuator_motors`` are shares of
thrust, and are the signals of the rotors only where ``THR_MDL_FAC`` is 0.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, SupportsFloat

import numpy as np

from skyarm.algebra import ZERO3, Quaternion, Vec3
from skyarm.flight_data.bag_axes import IMU, PX4, MessageAxes
from skyarm.flight_data.clocks import POSE
from skyarm.flight_data.columns_file import (
    SOURCES,
    Columns,
    QuantitySource,
    usual_signals,
)
from skyarm.flight_data.flight_data import (
    BAG_FOLDER,
    PLACE,
    FlightData,
    FlightFormat,
    choose_log,
)
from skyarm.flight_data.own_log import is_own_mcap, read_own_log
from skyarm.flight_data.px4_topics import (
    BOTH_WAYS,
    by_attitude,
    is_reversible,
    middle_of_mean,
)
from skyarm.flight_data.raw_tables import (
    RawTable,
    alike_outputs,
    flight_of,
    shares_of,
    valid_rows,
)
from skyarm.flight_data.series import in_turned_axes
from skyarm.records.arrays import Array
from skyarm.records.files import needs_extra
from skyarm.records.files.messages import comma_list

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces import Connection


METADATA = "metadata.yaml"
"""File in each folder of a ROS 2 bag."""

LONGEST_LIST = 32
"""Largest number of items of a list that become columns; chosen, above the joints and
rotors of a vehicle."""

DEEPEST = 8
"""Largest nesting depth of messages."""

ENTRY = re.compile(r"\w+\[([^\]]*[^\]\d][^\]]*)\]")
"""Pattern of a list item with a name."""

NOT_MEASURED = re.compile(
    r"reference|setpoint|goal|desired|target|command|cmd|/global_position/",
    re.IGNORECASE,
)
"""Pattern of topic names without measurements, or with those of MAVROS of which another
topic has better ones."""

MOTION_CAPTURE = re.compile(
    r"mocap|motion_capture|vicon|optitrack|natnet|vrpn|qualisys", re.IGNORECASE
)
"""Pattern of topic names with poses of a motion capture."""

TO_PX4 = "/fmu/in/"
"""Part of the names of topics to PX4, which are on another clock."""

LARGE = re.compile(r"Image|PointCloud|LaserScan|OccupancyGrid|Marker|TFMessage")
"""Pattern of message types that are not decoded."""

STATIC, BASE = "/tf_static", "base_link"
"""Topic of fixed transforms, and frame of the base (REP 105)."""

STAMP = "timestamp"
"""Field of the time (us) of PX4's messages, of PX4's own clock."""

PLACES = f"{PX4}msg/VehicleLocalPosition"
"""Type of messages with flags of their validity."""

SECOND, NANO = 1_000_000_000, 1e-9

CONVERT = (
    "convert it by 'ros2 bag convert' to mcap where the package of that type is"
    " installed"
)
"""Cure of a bag without definitions of its messages."""


TYPES = {kind: usual_signals(each) for kind, each in SOURCES["ros"].items()}
"""Message type -> quantity -> its sources."""

MOTORS = f"{PX4}msg/ActuatorMotors"
"""Type of messages with PX4's shares of the motors' thrust."""

OF_THRUST = (
    "rotor_commands: of {} are shares of thrust, those of the signal only if"
    " THR_MDL_FAC is 0."
)
"""Note on commands from a topic of that type."""

LISTS: Mapping[str, Mapping[str, str]] = SOURCES["ros_lists"]
"""Message type -> quantity -> list with a number for each joint or rotor."""

OUTPUTS, PULSES, SHARES = (
    "mavros_msgs/msg/RCOut",
    (800.0, 2200.0),
    "rotor signals of {}",
)
"""Type of messages with outputs of an autopilot, their bounds (us), and name of the
table of their shares."""


COMMANDS = {"rotor_speeds": "rotor_speed_commands", "joint_positions": "joint_commands"}
"""Quantity of a list -> quantity of a topic without measurements."""


@dataclass(slots=True)
class _Rows:
    """Decoded messages of a topic: frames, arrival times (ns), and numeric values
    grouped by their field names.
    """

    frames: tuple[str, str] = ("", "")
    received: list[int] = field(default_factory=list)
    numbers: dict[tuple[str, ...], list[tuple[int, Array]]] = field(
        default_factory=dict
    )


def read_bag(path: Path, columns: Columns | None) -> FlightData:
    """Read a ROS bag as a measured flight.

    Raises:
        ValueError: one line: rosbags is missing, it is no bag, or a damaged one.
            OSError: it cannot be read.
    """
    if path.is_file() and is_own_mcap(path):
        return read_own_log(path, columns)
    if path.is_dir() and not (path / METADATA).is_file():
        raise ValueError(f"folder: must be a bag of ROS 2, with {METADATA}")
    notes: list[str] = []
    own = (columns or Columns()).signals
    kinds, rows, mounts = _decode(
        path, {signal.topic for signal in own.values()}, notes
    )
    apart, vehicles = _vehicles({topic: kinds[topic] for topic in rows})
    words = [
        ", ".join(sorted(each)) or "topics without a name of their own"
        for each in vehicles
    ]
    place, choices = choose_log(words, columns, 0, notes, "first vehicle")
    others = set(apart) - set(_of_vehicle(apart, vehicles, place))
    read = {topic: kind for topic, kind in kinds.items() if topic not in others}
    origin = min(min(each.received) for each in rows.values())
    tables = {
        topic: _table(each, origin, of_px4=kinds[topic].startswith(PX4))
        for topic, each in rows.items()
    }
    if of_px4 := {
        topic: each
        for topic, each in tables.items()
        if read.get(topic, "").startswith(PX4)
    }:
        # PX4's clock counts from its start: the message that waited least links it to
        # the bag's
        delays = [
            np.min(each.received - each.time)
            for each in of_px4.values()
            if each.received is not None
        ]
        moved = float(min(delays))
        tables |= {
            topic: replace(each, time=each.time + moved, origin=each.origin - moved)
            for topic, each in of_px4.items()
        }
    for topic in (
        each for each in tables if "accelerometer_time" in tables[each].columns
    ):
        attitudes = [
            each
            for each in tables
            if read.get(each, "").endswith(("/VehicleAttitude", "/VehicleOdometry"))
        ]
        if attitudes:
            tables[topic] = by_attitude(tables[topic], tables[attitudes[0]])
    for topic in (each for each in tables if read.get(each) == PLACES):
        tables[topic] = valid_rows(topic, tables[topic], notes)
    axes = MessageAxes(
        read,
        tables,
        {topic: each.frames for topic, each in rows.items()},
        frozenset(mounts),
        notes,
    )
    usual = _of_one_world(_usual(tables, read, axes), own, notes)
    for name, signals in usual.items():
        held = [
            each.topic for each in signals if _holds(tables[each.topic], each, name)
        ]
        if len(held) > 1 and name not in own:
            listed = ", ".join(held)
            notes.append(
                f"{name}: there is {listed}; the fastest is taken unless a columns.toml"
                " names another."
            )
    # a hundred topics at most, chosen
    facts: dict[str, str | float] = {
        f"topic {topic}": kind for topic, kind in sorted(kinds.items())[:100]
    }
    facts |= choices
    flight = flight_of(
        path, tables, usual, columns, origin=origin * NANO, facts=facts, notes=notes
    )
    # rate and force are of one unit: both are turned to base axes, or none
    turned = {"gyro", "accelerometer", "quaternion"} - {*own}
    return _in_base_axes(
        flight, {} if len(turned & {"gyro", "accelerometer"}) < 2 else mounts, turned
    )


def _decode(
    path: Path, topics: Collection[str], notes: list[str]
) -> tuple[dict[str, str], dict[str, _Rows], dict[str, tuple[Vec3, Quaternion]]]:
    """Types of all topics of a bag, rows of those that are read, and mounts of the
    inertial units.

    Raises:
        ValueError: one line: rosbags is missing, the bag is damaged, or no topic that
            is read has messages.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise ValueError(
            f"rosbags: is missing; a bag of ROS {needs_extra('flights')}"
        ) from None
    rows: dict[str, _Rows] = {}
    mounts: dict[str, tuple[Vec3, Quaternion]] = {}
    try:
        with AnyReader(
            [path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)
        ) as reader:
            kinds = {each.topic: str(each.msgtype) for each in reader.connections}
            chosen = [each for each in reader.connections if _is_read(each, topics)]
            # a .db3 of ROS 2 Humble defines none of its types, and rosbags knows those
            # of ROS alone
            unknown = {
                each.topic
                for each in chosen
                if each.msgtype not in reader.typestore.fielddefs
            }
            if known := [each for each in chosen if each.topic not in unknown]:
                _read(reader, known, rows, notes)
                mounts = _mounts(reader)
    # the caller says of a file that it cannot be read
    except OSError:
        raise
    except Exception as error:
        # YAML, SQLite, compression and messages have readers of their own
        raise ValueError(
            f"bag: must be a whole bag of ROS ({type(error).__name__}: {error})"
        ) from None
    if unknown:
        undefined = comma_list(sorted({kinds[topic] for topic in unknown}))
        notes.append(f"bag: holds no definition of {undefined}; {CONVERT}.")
        if not rows or not unknown.isdisjoint(topics):
            raise ValueError(notes[-1].removesuffix("."))
    if not rows:
        # twenty at most, so that the message stays short
        there = ", ".join(
            sorted(f"{topic} ({kind})" for topic, kind in kinds.items())[:20]
        )
        raise ValueError(
            f"topics: none that is read holds a message; there is {there or 'none'}"
        )
    return kinds, rows, mounts


def _in_base_axes(
    flight: FlightData,
    mounts: Mapping[str, tuple[Vec3, Quaternion]],
    quantities: Collection[str],
) -> FlightData:
    """Turn the readings of inertial units into base axes, and state the place of the
    accelerometer.
    """
    for quantity in sorted(quantities):
        topic = flight[quantity].source.partition(":")[0] if quantity in flight else ""
        if topic in mounts:
            place, turn = mounts[topic]
            changed = {quantity: in_turned_axes(quantity, flight[quantity], turn)}
            stated = (
                dict(zip(PLACE, place, strict=True))
                if quantity == "accelerometer"
                else {}
            )
            flight = flight.with_channels(
                changed, f"{quantity}: is turned to {BASE} by {STATIC}."
            )
            flight = replace(flight, facts={**flight.facts, **stated})
    return flight


def _mounts(reader: AnyReader) -> dict[str, tuple[Vec3, Quaternion]]:
    """Place (m) and axes of the inertial unit of each topic, by the fixed transforms
    that lead to it from the base.
    """
    links = dict[str, tuple[str, Vec3, Quaternion]]()
    mounts = dict[str, tuple[Vec3, Quaternion]]()
    fixed = [each for each in reader.connections if each.topic.endswith(STATIC)]
    for connection, _, data in reader.messages(connections=fixed) if fixed else ():
        for each in reader.deserialize(data, connection.msgtype).transforms:  # type: ignore[attr-defined]
            at, q = each.transform.translation, each.transform.rotation
            turn = Quaternion(q.w, q.x, q.y, q.z).normalized()
            links[each.child_frame_id] = (
                each.header.frame_id,
                Vec3(at.x, at.y, at.z),
                turn,
            )
    for connection in (
        [each for each in reader.connections if each.msgtype == IMU] if links else ()
    ):
        data = next(
            (data for _, _, data in reader.messages(connections=[connection])), b""
        )
        name = reader.deserialize(data, IMU).header.frame_id if data else ""  # type: ignore[attr-defined]
        mount = (ZERO3, Quaternion(1.0, 0.0, 0.0, 0.0))
        left = dict(links)
        while name in left:  # each once, that no circle is followed
            name, place, turn = left.pop(name)
            mount = place + turn.rotation().apply(mount[0]), turn * mount[1]
            if name.rpartition("/")[2] == BASE:
                mounts[connection.topic] = mount
    return mounts


def _is_read(connection: Connection, topics: Collection[str]) -> bool:
    """True if a topic must be decoded: named by the mapping, of a known type, or any if
    the mapping names none.
    """
    topic, kind = connection.topic, connection.msgtype
    is_usual = (kind in TYPES or kind in LISTS) and TO_PX4 not in topic
    return topic in topics or is_usual or ("" in topics and LARGE.search(kind) is None)


def _read(
    reader: AnyReader,
    chosen: Collection[Connection],
    rows: dict[str, _Rows],
    notes: list[str],
) -> None:
    """Decode the messages of the chosen topics; failures are noted."""
    wrong = 0
    try:
        for connection, received, data in reader.messages(connections=chosen):
            try:
                message = reader.deserialize(data, connection.msgtype)
                numbers = {
                    name: float(value) for name, value in _numbers_of(message, "")
                }
                of_topic = rows.setdefault(connection.topic, _Rows(_frames_of(message)))
                alike = of_topic.numbers.setdefault(tuple(numbers), [])
                alike.append((len(of_topic.received), np.array([*numbers.values()])))
                of_topic.received.append(received)
            except Exception:  # of a damaged message, in whichever of its fields
                wrong += 1
    except Exception as error:  # of a damaged chunk: those before it are read
        if not rows:
            raise
        notes.append(
            f"bag: is damaged and read up to there ({type(error).__name__}: {error})."
        )
    if wrong:
        notes.append(f"bag: {wrong} messages cannot be decoded and are left out.")


def _frames_of(message: Any) -> tuple[str, str]:
    """Names of a message's frame and of its child frame; "" for one that it has not."""
    return getattr(getattr(message, "header", None), "frame_id", ""), getattr(
        message, "child_frame_id", ""
    )


def _numbers_of(message: Any, place: str) -> Iterator[tuple[str, SupportsFloat]]:
    """Yield field path and value of each number in a message; list entries by name if
    the message gives names.
    """
    names = getattr(message, "name", ())
    named = isinstance(names, (list, tuple)) and all(
        isinstance(each, str) and each for each in names
    )
    for name in (
        each
        for each in getattr(message, "__dataclass_fields__", ())
        if not each.startswith("__")
    ):
        value = getattr(message, name)
        at = f"{place}{name}"
        if isinstance(value, (bool, int, float, np.number)):
            yield at, value
        elif isinstance(value, np.ndarray):
            if value.size <= LONGEST_LIST and value.dtype.kind in "biuf":
                entries = (
                    names
                    if named and len(set(names)) == value.size
                    else range(value.size)
                )
                yield from (
                    (f"{at}[{entry}]", each)
                    for entry, each in zip(entries, value.ravel(), strict=True)
                )
        elif place.count(".") < DEEPEST:
            each_of = (
                {f"{at}[{k}].": each for k, each in enumerate(value)}
                if isinstance(value, list)
                else {f"{at}.": value}
            )
            for inner, each in each_of.items() if len(each_of) <= LONGEST_LIST else ():
                yield from _numbers_of(each, inner)


def _table(rows: _Rows, origin: int, *, of_px4: bool = False) -> RawTable:
    """Numeric table of a ROS topic, NaN where a message lacks a number; named list
    entries also by index.
    """
    every = {
        name: place for place, name in enumerate(dict.fromkeys(chain(*rows.numbers)))
    }
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
    columns |= {
        f"{name}[{k}]": columns[each]
        for name, entries in lists.items()
        for k, each in enumerate(entries)
    }
    received = np.array(rows.received)
    stamps = received
    if {"header.stamp.sec", "header.stamp.nanosec"} <= set(columns):
        # a message without a stamp has NaN here
        seconds, rest = (
            np.nan_to_num(columns[f"header.stamp.{part}"]).astype(int)
            for part in ("sec", "nanosec")
        )
        stated = seconds * SECOND + rest
        stamps = np.where(stated == 0, received, stated)
    elif of_px4 and STAMP in columns:
        stamps = columns[STAMP] * 1e3
        if "accelerometer_m_s2[0]" in columns:
            columns["accelerometer_time"] = (
                columns[STAMP] + middle_of_mean(columns, "accelerometer")
            ) * 1e-6
            # a sample without a span stays at its stamp
            stamps = stamps + np.nan_to_num(middle_of_mean(columns, "gyro")) * 1e3
    # as they were sent, not as they arrived
    order = np.argsort(stamps, kind="stable") if of_px4 else slice(None)
    time, arrival = ((each[order] - origin) * NANO for each in (stamps, received))
    columns = {name: each[order] for name, each in columns.items()}
    return RawTable(columns=columns, time=time, received=arrival, origin=origin * NANO)


def _vehicles(
    kinds: Mapping[str, str],
) -> tuple[Mapping[str, str], list[frozenset[str]]]:
    """Topics and types by which vehicles differ, and the words that those of each
    vehicle have alone.

    Vehicles are told by topics of one type and last word: by their inertial units.
    Beside a single unit the bodies of a motion capture are told, all other poses are
    estimates of one vehicle; without a unit whatever moves is one.
    """
    given = {
        each: {*TYPES.get(kinds[each], {})}
        for each in sorted(kinds)
        if NOT_MEASURED.search(each) is None
    }
    units = [
        each
        for each, names in given.items()
        if "gyro" in names and "position" not in names
    ]
    captured = (
        {each: kinds[each] for each in kinds if MOTION_CAPTURE.search(each)}
        if units
        else kinds
    )
    for name, topics, apart in (
        ("gyro", units, kinds),
        ("gyro", given, captured),
        ("position", given, captured),
    ):
        alike = dict[tuple[str, str], list[frozenset[str]]]()
        for topic in (each for each in topics if each in apart and name in given[each]):
            alike.setdefault((kinds[topic], topic.rpartition("/")[2]), []).append(
                frozenset(topic.split("/"))
            )
        for every in alike.values():
            if len(every) > 1:
                return apart, [
                    each - frozenset.intersection(*every)
                    # the topic of fewest words first: that without a name of its own
                    for each in sorted(every, key=len)
                ]
    return {}, []


def _of_vehicle(
    kinds: Mapping[str, str], vehicles: Sequence[frozenset[str]], place: int
) -> dict[str, str]:
    """Topics and their types without those of other vehicles: with their words, or as
    one of this vehicle without.
    """
    own = vehicles[place] if vehicles else frozenset[str]()
    others = frozenset[str]().union(*vehicles) - own
    parts = {topic: frozenset(topic.split("/")) for topic in kinds}
    # what is this vehicle's but for the name is the topic of one without a name
    of_this = {each - own for each in parts.values() if own & each}
    return {
        topic: kinds[topic]
        for topic, each in parts.items()
        if not others & each and each not in of_this
    }


def _usual(
    tables: dict[str, RawTable], kinds: Mapping[str, str], axes: MessageAxes
) -> dict[str, list[QuantitySource]]:
    """Default sources of each quantity, by the types of the topics; shares of outputs
    are added to ``tables``.
    """
    sources: dict[str, list[QuantitySource]] = {}
    ranks = [*TYPES, *LISTS]
    for topic in sorted(
        (each for each in tables if kinds.get(each) in ranks),
        key=lambda each: ranks.index(kinds[each]),
    ):
        table = tables[topic]
        kind = kinds[topic]
        measured = NOT_MEASURED.search(topic) is None
        for name, signals in TYPES.get(kind, {}).items() if measured else ():
            # of PX4 a source without any number is noted, as that of an estimate that
            # failed
            there = [
                e
                for e in signals
                if _holds(table, e, name)
                or (kind.startswith(PX4) and table.has(*e.columns))
            ]
            held = (axes.of(name, replace(each, topic=topic)) for each in there)
            sources.setdefault(name, []).extend(filter(None, held))
        if kind == MOTORS:
            axes.notes.append(
                BOTH_WAYS if is_reversible(table) else OF_THRUST.format(topic)
            )
            # signals with a sign are no shares of a range from 0 to 1
            if is_reversible(table):
                continue
            tables[topic] = table = _motor_shares(table)
        for listed, place in LISTS.get(kind, {}).items():
            name = listed if measured else COMMANDS.get(listed, "")
            if name and (entries := _usual_entries(table, *place.split("[]"))):
                names = tuple(
                    match[1] for match in map(ENTRY.fullmatch, entries) if match
                )
                unit = "rpm" if place.endswith(".rpm") else ""
                source = QuantitySource(
                    columns=entries, topic=topic, names=names, unit=unit
                )
                if kind == OUTPUTS:
                    source = _signals(tables, source, axes.notes)
                sources.setdefault(name, []).extend([source] if source.columns else [])
    return sources


def _of_one_world(
    usual: dict[str, list[QuantitySource]],
    own: Mapping[str, QuantitySource],
    notes: list[str],
) -> dict[str, list[QuantitySource]]:
    """Keep the sources of the pose that are of one world: a motion capture's, unless a
    mapping names another's.

    The x axis of a motion capture is not east, and its clock is another. A velocity has
    to be of the pose's clock even where it is in base axes.
    """
    named = [own[name].topic for name in POSE if name in own and own[name].topic]
    is_captured = not named or any(MOTION_CAPTURE.search(each) for each in named)
    pose = {name: usual[name] for name in POSE if name in usual and name not in own}
    kept = {
        name: [
            each
            for each in every
            if (MOTION_CAPTURE.search(each.topic) is not None) == is_captured
        ]
        for name, every in pose.items()
    }
    read, there = (
        {each.topic: 0 for every in some.values() for each in every}
        for some in (kept, pose)
    )
    if not read or len(read) == len(there):
        return usual
    others = ", ".join(each for each in there if each not in read)
    notes.append(
        f"pose: of {', '.join(read)}, not {others}: it is of one world; a columns.toml"
        " may name another."
    )
    alone = [name for name, every in kept.items() if not every and name != "velocity"]
    notes += [
        f"{name}: is of another world than the rest of the pose." for name in alone
    ]
    return {
        **usual,
        **{name: every for name, every in kept.items() if name not in alone},
    }


def _signals(
    tables: dict[str, RawTable], source: QuantitySource, notes: list[str]
) -> QuantitySource:
    """Source of the shares of outputs to rotors, whose table is added; without columns
    if it has none.
    """
    table = tables[source.topic]
    pulses = dict[str, Array]()
    for name in source.columns:
        sent = table.numbers(name)
        # what lies beyond is sent for a channel that is off
        is_pulse = (sent >= PULSES[0]) & (sent <= PULSES[1])
        if is_pulse.any():
            pulses[name] = np.where(is_pulse, sent, np.nan)
    outputs = replace(table, columns=pulses)
    rotors = alike_outputs(outputs, [*pulses], notes)
    if rotors:
        notes.append(
            "rotor_commands: limits of 1000 and 2000 us are assumed; a columns.toml may"
            " state others."
        )
    topic = SHARES.format(source.topic)
    tables[topic] = shares_of(outputs, rotors, 1000.0, 2000.0)
    return replace(source, columns=tuple(tables[topic].columns), topic=topic)


def _motor_shares(motors: RawTable) -> RawTable:
    """Shares of the motors' thrust, 0 of a motor that is stopped: NaN in some messages
    only.
    """
    stopped = {
        name: np.nan_to_num(each)
        for name, each in motors.columns.items()
        if name.startswith("control[") and np.isfinite(each).any()
    }
    return replace(motors, columns={**motors.columns, **stopped})


def _usual_entries(table: RawTable, begin: str, end: str = "") -> tuple[str, ...]:
    """Columns of a topic's list with the most numbers; only named list entries if there
    are any.
    """
    every = [
        each
        for each in table.columns
        if each.startswith(f"{begin}[") and each.endswith(f"]{end}")
    ]
    if end:  # of a motor that is not there
        every = [each for each in every if np.nan_to_num(table.columns[each]).any()]
    counts = {each: int(np.isfinite(table.columns[each]).sum()) for each in every}
    named = [each for each in every if ENTRY.fullmatch(each)] or every
    most = max((counts[each] for each in named), default=0)
    return tuple(each for each in named if counts[each] == most > 0)


def _holds(table: RawTable, source: QuantitySource, name: str) -> bool:
    """True if a topic has numbers of a quantity; zeros alone are no attitude."""
    values = [table.numbers(each) for each in source.columns if table.has(each)]
    return bool(
        (np.nan_to_num(values) if name == "quaternion" else np.isfinite(values)).any()
    )


BAG = FlightFormat(read_bag, suffixes=("bag",), begins=(b"#ROSBAG V",), several=True)
MCAP = FlightFormat(
    read_bag, suffixes=("mcap",), begins=(b"\x89MCAP0\r\n",), several=True
)
DATABASE = FlightFormat(
    read_bag, suffixes=(BAG_FOLDER,), begins=(b"SQLite format 3\0",), several=True
)
