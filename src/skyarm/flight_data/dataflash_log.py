"""Reader of ArduPilot's DataFlash logs.

The file is a sequence of messages: bytes A3 95, a type, a body of the type's length.
Messages of type 128 (FMT) define the others: type, length, name, a letter for each
field, names of the fields. Axes are forward, right, down of the base and north, east,
down of the world. Messages with an instance field, as of several inertial units, are
tables apart: ``IMU`` for the least instance, ``IMU[1]`` for another. The signal of a
rotor is its output between the least and the largest. Attitudes are those of the
inertial unit: ``ATT``, logged faster than the quaternion, is turned back by the trims
of the vehicle.

Source: ArduPilot 4.6, ``AP_AHRS``, ``AP_Motors_Class.cpp``, ``SRV_Channel.cpp``,
``AP_Logger.h``.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from skyarm.algebra.frames import of_euler_angles, to_our_attitude, to_our_axes
from skyarm.flight_data.columns_file import (
    SOURCES,
    Columns,
    QuantitySource,
    usual_signals,
)
from skyarm.flight_data.flight_data import PLACE, FlightData, FlightFormat, choose_log
from skyarm.flight_data.raw_tables import (
    RawTable,
    alike_outputs,
    flight_of,
    shares_of,
    valid_rows,
)
from skyarm.flight_data.series import in_turned_axes
from skyarm.records.arrays import AnyArray, Array

MAGIC = b"\xa3\x95"
"""First bytes of a message."""

DEFINITION, SIZE = MAGIC + b"\x80", 89
"""Head of a message that defines a type, and its length (bytes)."""

BEGINNING = DEFINITION + b"\x80YFMT\0"
"""First bytes of a log: the definition of definitions, of 89 (Y) bytes."""

LETTERS = "abBcCdeEfghHiILMnNqQZ"
"""Letters of the types of fields."""

OTHERS = {
    "c": "h",
    "C": "H",
    "e": "i",
    "E": "I",
    "L": "i",
    "M": "B",
    "g": "e",
    "a": "V64",
    "n": "S4",
    "N": "S16",
    "Z": "S64",
}
"""Letter of a field -> its type in NumPy, if that has another letter."""

UNITS: Mapping[str, float] = {**dict.fromkeys("cCeE", 0.01), "L": 1e-7}
"""Letter of a field whose numbers are multiples of a unit -> that unit."""

STAMPS = {"SampleUS": 1e-6, "TimeUS": 1e-6, "TimeMS": 1e-3}
"""Fields with the time of a message -> their unit (s); the first of these counts."""

INSTANCES = ("I", "C", "Instance", "Inst")
"""Names of fields that number the instance, if whole numbers of one byte."""

UNIT = r"(IMU|GYR|ACC)"
"""Pattern of the beginnings of messages of an inertial unit."""

STATUS: Mapping[str, tuple[int, Sequence[str]]] = {
    "horizontal velocity": (2, ("VN", "VE")),
    "vertical velocity": (4, ("VD",)),
    "horizontal position": (8 + 16, ("PN", "PE")),
    "vertical position": (32, ("PD",)),
}
"""Estimate -> bits of a filter's status (field SS) that state it, and columns of it."""

FUNCTIONS = (*range(33, 41), *range(82, 86))
"""SERVOn_FUNCTION of an output that drives the first motor, the second, ..."""

ROTORS: Mapping[float, tuple[int, ...]] = {7: (33, 34, 36), 8: (37, 38), 9: (37, 38)}
"""FRAME_CLASS -> functions that drive rotors, where others drive servos: tricopter,
single and coaxial copter."""

LIMITS = "MOT_PWM", "Q_M_PWM"
"""Beginnings of the parameters on outputs to motors, of a copter and of a plane that
hovers."""

DIGITAL = range(4, 8)
"""MOT_PWM_TYPE of digital outputs, which are logged from 1000 to 2000."""

RANGE, ANGLE = 8, 9
"""MOT_PWM_TYPE of outputs from their SERVOn_MIN to _MAX, and of those that have
SERVOn_TRIM at half signal."""

SERVO = {"MIN": 1100.0, "TRIM": 1500.0, "MAX": 1900.0}
"""Ends of the parameters' names SERVOn_... -> their defaults (us)."""

USUAL_LIMITS = 1000.0, 2000.0
"""Outputs (us) of zero and of full signal where no parameter states them."""

FILTERS = {"gyro": "INS_GYRO_FILTER", "accelerometer": "INS_ACCEL_FILTER"}
"""Quantity -> cut-off frequency (Hz) of the Butterworth filter of second order before
messages IMU."""

RESETS = {"EV": ("Id", (60.0, 62.0)), "ERR": ("Subsys", (24.0,))}
"""Messages -> field and its values where the filter resets height (EKF_ALT_RESET) or
yaw, or another lane flies on."""

LOOP = 0.02
"""Longest period (s) of the main loop, in which a reset precedes its message."""

SHARES = "rotor signals"
"""Name of the table of rotor signals as fractions, made from outputs and parameters."""

Definition = tuple[bytes, str, np.dtype[np.void], Mapping[str, float]]
"""Type of messages: head, name, NumPy type of the fields, units of those that are
multiples of one."""

Messages = Mapping[str, Mapping[str, AnyArray]]
"""Name of a type -> field -> its values in all messages."""


def read_dataflash(path: Path, columns: Columns | None) -> FlightData:
    """Read a DataFlash log of ArduPilot; of several in a file that of the mapping's
    number, else the longest.

    Raises:
        ValueError: one line: it is no such file, or of another autopilot. OSError: it
            cannot be read.
    """
    notes = list[str]()
    logs = [each for each in path.read_bytes().split(BEGINNING) if each] or [b""]
    longest = logs.index(max(logs, key=len))
    place, listed = choose_log(
        [f"{len(each)} bytes" for each in logs], columns, longest, notes, "longest"
    )
    rows = _rows(BEGINNING + logs[place], notes)
    tables = dict(_tables(rows))
    if not tables:
        old = (
            "PX4 before 2017 (.px4log): log as .ulg"
            if "TIME" in rows
            else "ArduPilot before 2014: log anew"
        )
        raise ValueError(
            f"messages: have no times (TimeUS or TimeMS), as those of {old}, with a"
            " newer version; or it is cut off"
        )
    numbers = rows.get("PARM", {}).get("Value", np.zeros(0)).astype(float)
    # of a parameter that changes in flight the last value counts
    values = dict(zip(_texts(rows, "PARM", "Name"), numbers.tolist(), strict=False))
    firmware = next(iter(_texts(rows, "MSG", "Message")), "unknown")
    facts: dict[str, str | float] = {
        "vehicle": "ArduPilot",
        "firmware": firmware,
        **listed,
    }
    units = {
        name: _unit(name, each)
        for name, each in tables.items()
        if re.fullmatch(rf"{UNIT}.*", name)
    }
    usual = _of_primary_lane(
        usual_signals(SOURCES["dataflash"]), tables, units, values, notes
    )
    _mask_invalid(
        tables,
        {each.topic for name in ("position", "velocity") for each in usual[name]},
        notes,
    )
    if "RCOU" in tables and (shares := _shares(tables["RCOU"], values, notes)):
        tables[SHARES] = shares
        usual["rotor_commands"] = (
            QuantitySource(columns=tuple(shares.columns), topic=SHARES),
        )
    flight = _with_attitude_of_unit(
        flight_of(path, tables, usual, columns, facts=facts, notes=notes), values
    )
    flight = _with_resets(_with_filters(flight, values), tables)
    source = (
        flight["accelerometer"].source.partition(":")[0]
        if "accelerometer" in flight
        else ""
    )
    # INS_POS1 is the place of unit 0
    at = to_our_axes(
        *(
            values.get(f"INS_POS{units.get(source, 0) + 1}_{axis}", 0.0)
            for axis in "XYZ"
        )
    )
    return (
        replace(flight, facts={**flight.facts, **dict(zip(PLACE, at, strict=True))})
        if any(at)
        else flight
    )


def _unit(name: str, table: RawTable) -> int:
    """Number of an inertial unit, from 0 on, by the instance of its messages or else
    their name (``IMU2``).
    """
    stated = next(
        (table.columns[each] for each in INSTANCES if each in table.columns), None
    )
    digits = re.sub(r"\D", "", name)
    return (
        int(stated[0]) if stated is not None and stated.size else int(digits or 1) - 1
    )


def _with_attitude_of_unit(
    flight: FlightData, parameters: Mapping[str, float]
) -> FlightData:
    """Flight with the attitude of its inertial unit in place of ATT, which AHRS_TRIM_X,
    Y, Z (rad) turn to the vehicle.

    AP_AHRS: R_ATT = R_unit R_trim^T, with the Euler angles of the trims in R_trim.
    """
    trims = [parameters.get(f"AHRS_TRIM_{axis}", 0.0) for axis in "XYZ"]
    if (
        "quaternion" not in flight
        or not flight["quaternion"].source.startswith("ATT: Roll")
        or not any(trims)
    ):
        return flight
    turn = to_our_attitude(*of_euler_angles(*trims)).conjugate()
    turned = in_turned_axes("quaternion", flight["quaternion"], turn)
    words = (
        "quaternion: is turned back by the trims AHRS_TRIM_X, Y, Z, to the axes of the"
        " inertial unit."
    )
    return flight.with_channels({"quaternion": turned}, words)


def _with_filters(flight: FlightData, parameters: Mapping[str, float]) -> FlightData:
    """Flight with notes on quantities of messages IMU, which passed a filter: the delay
    of low frequencies.
    """
    cuts = {
        name: parameters.get(each, 0.0)
        for name, each in FILTERS.items()
        if name in flight
    }
    notes = [
        f"{name}: is filtered at {FILTERS[name]} = {cut:g} Hz,"
        # a Butterworth filter of second order delays low frequencies by sqrt(2) / (2 pi
        # f)
        f" {1e3 * math.sqrt(0.5) / (math.pi * cut):.2g} ms late; log raw IMU"
        " (LOG_BITMASK)."
        for name, cut in cuts.items()
        if cut > 0.0 and flight[name].source.startswith("IMU")
    ]
    return flight.with_channels({}, *notes)


def _with_resets(flight: FlightData, tables: Mapping[str, RawTable]) -> FlightData:
    """Flight with the steps in which the filter reset its pose: from the last sample
    before to the first one after.
    """
    poses = [
        flight[each].time
        for each in ("position", "velocity", "quaternion")
        if each in flight
    ]
    spans = set[tuple[float, float]]()
    for name, (field, resets) in RESETS.items():
        if name in tables and tables[name].has(field):
            times = tables[name].time[
                np.isin(tables[name].numbers(field), resets)
            ] - float(flight.facts["start"])
            for each in times:
                around = [
                    (time[time < each - LOOP][-1], time[time >= each][0])
                    for time in poses
                    if time[0] < each - LOOP and time[-1] >= each
                ]
                if around:
                    spans.add((min(around)[0], max(last for _, last in around)))
    return flight.with_jumps(spans) if spans else flight


def _of_primary_lane(
    usual: Mapping[str, Sequence[QuantitySource]],
    tables: Mapping[str, RawTable],
    units: Mapping[str, int],
    parameters: Mapping[str, float],
    notes: list[str],
) -> dict[str, Sequence[QuantitySource]]:
    """Usual sources, those of an inertial unit and of a filter replaced by the ones of
    the filter's primary lane.

    A lane is a filter with an inertial unit of its own: that of the next bit of
    ``EK3_IMU_MASK``.
    """
    filters = [
        (each, table.columns["PI"])
        for each, table in tables.items()
        if re.fullmatch("[XN]KF4", each)
    ]
    name, primary = next(
        ((name, each) for name, each in filters if each.size), ("XKF4", np.zeros(1))
    )
    numbers, counts = np.unique(primary, return_counts=True)
    # a log is read of one lane: the one that flew for most of it
    lane = int(numbers[counts.argmax()])
    # XKF is written by the filter EKF3, NKF by EKF2
    mask = int(parameters.get(f"EK{3 if name.startswith('X') else 2}_IMU_MASK", 0.0))
    unit = (
        [*(bit for bit in range(8) if mask >> bit & 1), *range(8)][lane]
        if mask >> lane
        else lane
    )
    unit = unit if unit in units.values() else min(units.values(), default=0)
    sources = dict[str, Sequence[QuantitySource]]()
    for quantity, every in usual.items():
        named = list[QuantitySource]()
        for each in every:
            if re.fullmatch(rf"{UNIT}1?", each.topic):
                topics = [
                    topic
                    for topic in units
                    if topic.startswith(each.topic.rstrip("1")) and units[topic] == unit
                ]
            elif re.match("[XN]K|EKF", each.topic):
                stem = each.topic.rstrip("1")
                # before messages had instances, lane 1 wrote NKF6 to NKF10 for NKF1 to
                # 5, and NKQ2
                digit = 1 + (1 if "KQ" in each.topic else 5) * lane
                topics = [
                    *(
                        {f"{each.topic}[{lane}]", f"{stem}{digit}"} & set(tables)
                        if lane
                        else ()
                    )
                ] or [each.topic]
            else:
                topics = [each.topic]
            named += [replace(each, topic=topic) for topic in topics]
        sources[quantity] = named
    if len(set(units.values())) > 1:
        others = ", ".join(topic for topic in units if units[topic] != unit)
        notes.append(
            f"inertial unit {unit} is read, of the filter's lane {lane}; a columns.toml"
            f" may name {others}."
        )
    if numbers.size > 1:
        notes.append(
            f"pose: the filter changed its lane {np.count_nonzero(np.diff(primary))}"
            f" times; {lane} is read."
        )
    return sources


def _mask_invalid(
    tables: dict[str, RawTable], topics: Iterable[str], notes: list[str]
) -> None:
    """Put NaN where a filter states in its fourth message (XKF4 of XKF1) that it has no
    such estimate.
    """
    for topic in sorted({*topics} & {*tables}):
        status = tables.get(
            re.sub(r"\d", lambda digit: f"{int(digit[0]) + 3}", topic, count=1)
        )
        if status is not None and status.has("SS") and status.time.size:
            # each row has the last status before it
            place = np.maximum(
                np.searchsorted(status.time, tables[topic].time, "right") - 1, 0
            )
            # a status without a number states no estimate
            bits = np.nan_to_num(status.numbers("SS")[place]).astype(int)
            stated = {
                name: (bits & flags).astype(float)
                for name, (flags, _) in STATUS.items()
            }
            table = replace(tables[topic], columns={**tables[topic].columns, **stated})
            tables[topic] = valid_rows(
                topic,
                table,
                notes,
                {name: columns for name, (_, columns) in STATUS.items()},
            )


def _rows(data: bytes, notes: list[str]) -> Messages:
    """Messages of each type in a DataFlash log; bytes that belong to none are noted.

    Raises:
        ValueError: one line: no type is defined.
    """
    sizes = {DEFINITION: SIZE}
    types = dict[bytes, Definition]()
    pieces: dict[bytes, list[bytes]] = {}
    place = lost = 0
    while place < len(data):
        head = data[place : place + len(DEFINITION)]
        end = place + sizes.get(head, 0)
        # a message counts only if another follows it, so that no shifted row is made up
        # of lost bytes
        if end == place or (end != len(data) and not data.startswith(MAGIC, end)):
            # -1 is the end of the data
            end = data.find(MAGIC, place + 1) % (len(data) + 1)
            lost += end - place
        elif head != DEFINITION:
            pieces.setdefault(head, []).append(data[place + len(head) : end])
        elif found := _definition(data[place + len(head) : end]):
            kind = types.setdefault(found[0], found)
            sizes[found[0]] = kind[2].itemsize + len(head)
        place = end
    if not types:
        raise ValueError(
            "messages: none defines a type (FMT); telemetry (.tlog) is too slow: read"
            " the .bin of its flight"
        )
    if lost:
        notes.append(f"file: {lost} bytes belong to no whole message and are left out.")
    rows = dict[str, dict[str, AnyArray]]()
    # of two types of one name the first with messages counts
    for head, name, row, units in types.values():
        if head in pieces and row.names and name not in rows:
            values = np.frombuffer(b"".join(pieces[head]), row)
            rows[name] = {
                field: values[field] * units[field] if field in units else values[field]
                for field in row.names
            }
    return rows


def _definition(body: bytes) -> Definition | None:
    """Type that a message FMT defines; None if it is damaged, or the type of these
    messages themselves.
    """
    number, size, *texts = struct.unpack("<cB4s16s64s", body)
    name, letters, names = (each.rstrip(b"\0").decode("latin-1") for each in texts)
    # of a damaged definition names and letters may differ in number; the length of the
    # row then refuses it
    fields = dict(zip(names.split(","), letters, strict=False))
    if MAGIC + number == DEFINITION or not set(letters) <= set(LETTERS):
        return None
    row = np.dtype(
        [(field, f"<{OTHERS.get(letter, letter)}") for field, letter in fields.items()]
    )
    units = {
        field: UNITS[letter] for field, letter in fields.items() if letter in UNITS
    }
    if name == "CURR" and fields.get("Volt") == "h":
        units["Volt"] = 0.01  # of ArduPilot before 2016
    return (
        (MAGIC + number, name, row, units)
        if row.itemsize + len(DEFINITION) == size
        else None
    )


def _texts(rows: Messages, name: str, field: str) -> list[str]:
    """Texts of a field in all messages of a type."""
    values = rows.get(name, {}).get(field, np.zeros(0)).astype("S64")
    return list(map(str, np.char.decode(values, "latin-1")))


def _tables(rows: Messages) -> Iterator[tuple[str, RawTable]]:
    """Yield name and numbers of each type of messages that have times, one for each of
    its instances.
    """
    for name, fields in rows.items():
        numbers = {
            field: values
            for field, values in fields.items()
            if values.dtype.kind in "iuf"
        }
        stamp = next((each for each in STAMPS if each in numbers), "")
        counted = [
            numbers[each]
            for each in INSTANCES
            if each in numbers and numbers[each].dtype == np.uint8
        ]
        for place, instance in enumerate(np.unique(counted[0]) if counted else (0,)):
            chosen = counted[0] == instance if counted else slice(None)
            with np.errstate(invalid="ignore"):  # NaNs of a damaged file that signal
                columns = {
                    field: values[chosen].astype(float)
                    for field, values in numbers.items()
                }
            if stamp:
                time = columns[stamp] * STAMPS[stamp]
                yield (
                    f"{name}[{instance}]" if place else name,
                    RawTable(columns=columns, time=time),
                )


def _shares(
    outputs: RawTable, parameters: Mapping[str, float], notes: list[str]
) -> RawTable | None:
    """Signals of the rotors as fractions (0 to 1) of their range; None if the number of
    rotors is unknown.
    """
    places = _motor_outputs(outputs, parameters, notes)
    if not places:
        return None
    throttle = f"RC{parameters.get('RCMAP_THROTTLE', 3.0):g}"
    motors = next((each for each in LIMITS if f"{each}_MAX" in parameters), LIMITS[0])
    # a copter whose own range is 0 takes that of the throttle's channel (AP_Motors)
    limits = [
        (parameters.get(f"{each}_MIN", 0.0), parameters.get(f"{each}_MAX", 0.0))
        for each in (motors, throttle)
    ]
    stated = [each for each in limits if each[1] > each[0] > 0.0]
    kind = parameters.get(f"{motors}_TYPE", 0.0)
    if kind in (RANGE, ANGLE):
        columns = {
            f"output {each}": _scaled_share(outputs, each, parameters, kind == ANGLE)
            for each in places
        }
        return replace(outputs, columns=columns)
    if kind in DIGITAL:
        stated = [USUAL_LIMITS]
    low, high = [*stated, USUAL_LIMITS][0]
    if not stated:
        notes.append(
            f"rotor_commands: limits of {low:g} and {high:g} us are assumed; no"
            " parameter states them."
        )
    return shares_of(outputs, places, low, high)


def _scaled_share(
    outputs: RawTable, name: str, parameters: Mapping[str, float], is_angle: bool
) -> Array:
    """Signal (0 to 1) of an output on the scale of its own SERVOn_MIN, TRIM and MAX."""
    servo = f"SERVO{re.sub(r'[^0-9]', '', name)}"
    low, middle, high = (
        parameters.get(f"{servo}_{each}", usual) for each, usual in SERVO.items()
    )
    ends = [low, middle if is_angle else 0.5 * (low + high), high]
    share = np.interp(outputs.numbers(name), ends, [0.0, 0.5, 1.0])
    return 1.0 - share if parameters.get(f"{servo}_REVERSED", 0.0) else share


def _motor_outputs(
    outputs: RawTable, parameters: Mapping[str, float], notes: list[str]
) -> list[str]:
    """Columns of the outputs that drive the rotors, in their order, by parameters or
    else by equal least outputs.
    """
    # logs that are timed in ms name them Ch1, ..., later ones C1, ...
    every = [name for name in outputs.columns if re.fullmatch(r"C(h)?\d+", name)]
    # later entries win, so outputs run backwards: the first one of a function counts
    driven = {
        parameters.get(f"SERVO{k + 1}_FUNCTION", 0.0): name
        for k, name in reversed([*enumerate(every)])
    }
    stated = {
        value
        for name, value in parameters.items()
        if re.fullmatch(r"SERVO\d+_FUNCTION", name)
    }
    frame = parameters.get("FRAME_CLASS", parameters.get("Q_FRAME_CLASS", 0.0))
    rotors = [each for each in ROTORS.get(frame, FUNCTIONS) if each in stated]
    if lost := [f"{each}" for each in rotors if each not in driven]:
        notes.append(
            "rotor_commands: are left out, as no output of RCOU has the"
            f" SERVOn_FUNCTION {', '.join(lost)} of rotors."
        )
        return []
    if rotors:
        return [driven[each] for each in rotors]
    return alike_outputs(outputs, every, notes)


DATAFLASH = FlightFormat(
    # tlog is telemetry, which is named only to be refused with its cure
    read_dataflash,
    suffixes=("bin", "px4log", "tlog"),
    begins=(MAGIC,),
    several=True,
)
