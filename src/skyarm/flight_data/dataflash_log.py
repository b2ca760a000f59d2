"""Reader of ArduPilot's DataFlash logs.

The file is a sequence of messages: bytes A3 95, a type, a body of the type's length. Messages of type 128 (FMT) define
the others: type, length, name, a letter for each field, names of the fields. Axes are forward, right, down of the base
and north, east, down of the world. Messages with an instance field, as of several inertial units, are tables apart:
``IMU`` for instance 0, ``IMU[1]`` for the next. The signal of a rotor is its output between the least and the largest.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping
from itertools import takewhile
from pathlib import Path

import numpy as np

from skyarm.algebra.frames import to_our_axes
from skyarm.flight_data.columns_file import SOURCES, Columns, QuantitySource, usual_signals
from skyarm.flight_data.flight_data import PLACE, FlightData, FlightFormat
from skyarm.flight_data.raw_tables import RawTable, flight_of
from skyarm.records.arrays import AnyArray

MAGIC, HEAD, DEFINITION = b"\xa3\x95", 3, 128
"""First bytes of a message, length of its head, and type of the messages that define types."""

SIZE = 89
"""Length (bytes) of a message that defines a type."""

BEGINNING = MAGIC + struct.pack("<BBB4s", DEFINITION, DEFINITION, SIZE, b"FMT")
"""First bytes of a log: the definition of definitions."""

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

ROTORS_OF_CLASS = {1: 4, 2: 6, 3: 8, 4: 8, 5: 6, 7: 3, 12: 12, 14: 10}
"""FRAME_CLASS -> number of rotors."""

FUNCTIONS = (*range(33, 41), *range(82, 86))
"""SERVOn_FUNCTION of an output that drives the first motor, the second, ..."""

DIGITAL = range(4, 8)
"""MOT_PWM_TYPE of digital outputs, which are logged from 1000 to 2000."""

USUAL_LIMITS = 1000.0, 2000.0
"""Outputs (us) of zero and of full signal where no parameter states them."""

SHARES = "rotor signals"
"""Name of the table of rotor signals as fractions, made from outputs and parameters."""

KEPT = re.compile(r"FRAME\w*|MOT_(PWM|SPIN|THST)_\w*|SERVO\d+_FUNCTION|INS_POS1_\w")
"""Pattern of parameters that are facts of a flight."""


Definition = tuple[int, str, np.dtype[np.void], Mapping[str, float]]
"""Type of messages: number, name, NumPy type of the fields, units of those that are multiples of one."""

Messages = Mapping[str, Mapping[str, AnyArray]]
"""Name of a type -> field -> its values in all messages."""


def read_dataflash(path: Path, columns: Columns | None) -> FlightData:
    """Read a DataFlash log of ArduPilot; of several in a file, the longest.

    Raises:
        ValueError: one line: it is no such file, or of another autopilot. OSError: it cannot be read.
    """
    logs = [each for each in path.read_bytes().split(BEGINNING) if each]
    notes = [f"file: holds {len(logs)} logs; the longest is read."] if len(logs) > 1 else []
    rows = _rows(BEGINNING + max(logs, key=len, default=b""), notes)
    tables = dict(_tables(rows))
    if not tables:
        old = "PX4 before 2017 (.px4log): log as .ulg" if "TIME" in rows else "ArduPilot before 2014: log anew"
        raise ValueError(f"messages: have no times (TimeUS or TimeMS), as those of {old}, with a newer version")
    numbers = tables["PARM"].columns.get("Value", np.zeros(0)) if "PARM" in tables else np.zeros(0)
    values = dict(zip(_texts(rows, "PARM", "Name"), numbers.tolist(), strict=False))
    firmware = next(iter(_texts(rows, "MSG", "Message")), "unknown")
    facts: dict[str, str | float] = {"vehicle": "ArduPilot", "firmware": firmware}
    place = to_our_axes(*(values.get(f"INS_POS1_{axis}", 0.0) for axis in "XYZ"))
    facts |= dict(zip(PLACE, place, strict=True)) if any(place) else {}
    facts |= {f"parameter {name}": value for name, value in values.items() if KEPT.fullmatch(name)}
    usual = dict(usual_signals(SOURCES["dataflash"]))
    if "RCOU" in tables and (shares := _shares(tables["RCOU"], values, notes)):
        tables[SHARES] = shares
        usual["rotor_commands"] = (QuantitySource(columns=tuple(shares.columns), topic=SHARES),)
    return flight_of(path, tables, usual, columns, facts=facts, notes=notes)


def _rows(data: bytes, notes: list[str]) -> Messages:
    """Messages of each type in a DataFlash log; bytes that belong to none are noted.

    Raises:
        ValueError: one line: no type is defined.
    """
    sizes, types = {DEFINITION: SIZE}, dict[int, Definition]()
    pieces: dict[str, list[bytes]] = {}
    place, lost, damaged = 0, 0, 0

    def end_of(begin: int) -> int:
        """End offset of the message at a byte offset; 0 if it is of no known type, or if no message follows it."""
        known = data.startswith(MAGIC, begin) and begin + 2 < len(data) and data[begin + 2] in sizes
        end = begin + sizes[data[begin + 2]] if known else 0
        return end if end == len(data) or data.startswith(MAGIC, end) else 0

    while place < len(data):
        if end := end_of(place):
            number, body = data[place + 2], data[place + HEAD : end]
            if number != DEFINITION:
                pieces.setdefault(types[number][1], []).append(body)
            elif (found := _definition(body)) and found[1] not in (each[1] for each in types.values()):
                types[found[0]], sizes[found[0]] = found, found[2].itemsize + HEAD
            place = end
            continue
        after = data.find(MAGIC, place + 1)
        while after >= 0 and not end_of(after):
            after = data.find(MAGIC, after + 1)
        after = after if after >= 0 else len(data)
        lost, damaged, place = lost + after - place, damaged + 1, after
    if not types:
        raise ValueError("messages: none defines a type (FMT), as in a log of ArduPilot")
    if lost:
        notes.append(f"file: {lost} bytes at {damaged} places belong to no whole message and are left out.")
    rows = dict[str, dict[str, AnyArray]]()
    for _, name, row, units in (each for each in types.values() if each[1] in pieces and each[2].names):
        values = np.frombuffer(b"".join(pieces[name]), row)
        rows[name] = {
            field: values[field] * units[field] if field in units else values[field] for field in row.names or ()
        }
    return rows


def _definition(body: bytes) -> Definition | None:
    """Type that a message FMT defines; None if it is damaged, or the type of these messages themselves."""
    number, size, *texts = struct.unpack("<BB4s16s64s", body)
    name, letters, names = (each.rstrip(b"\0").decode("latin-1") for each in texts)
    fields = dict(zip(names.split(","), letters, strict=False))
    if number == DEFINITION or not set(letters) <= set(LETTERS) or not re.fullmatch(r"[A-Z]\w*", name):
        return None
    row = np.dtype([(field, f"<{OTHERS.get(letter, letter)}") for field, letter in fields.items() if field])
    units = {field: UNITS[letter] for field, letter in fields.items() if letter in UNITS}
    if name == "CURR" and fields.get("Volt") == "h":
        units["Volt"] = 0.01  # of ArduPilot before 2016
    return (number, name, row, units) if row.itemsize + HEAD == size else None


def _texts(rows: Messages, name: str, field: str) -> list[str]:
    """Texts of a field in all messages of a type; none if it holds no text."""
    values = rows.get(name, {}).get(field, np.zeros(0))
    return [each.decode("latin-1") for each in values.tolist()] if values.dtype.kind == "S" else []


def _tables(rows: Messages) -> Iterator[tuple[str, RawTable]]:
    """Yield name and numbers of each type of messages that have times, one for each of its instances."""
    for name, fields in rows.items():
        numbers = {field: values for field, values in fields.items() if values.dtype.kind in "iuf"}
        stamp = next((each for each in STAMPS if each in numbers), "")
        counted = [numbers[each] for each in INSTANCES if each in numbers and numbers[each].dtype == np.uint8]
        for instance in np.unique(counted[0]) if counted else (0,):
            chosen = counted[0] == instance if counted else slice(None)
            with np.errstate(invalid="ignore"):  # NaNs of a damaged file that signal
                columns = {field: values[chosen].astype(float) for field, values in numbers.items()}
            if stamp:
                time = columns[stamp] * STAMPS[stamp]
                yield f"{name}[{instance}]" if instance else name, RawTable(columns=columns, time=time)


def _shares(outputs: RawTable, parameters: Mapping[str, float], notes: list[str]) -> RawTable | None:
    """Signals of the rotors as fractions (0 to 1) of their range; None if the number of rotors is unknown."""
    places = _motor_outputs(outputs, parameters, notes)
    if not places:
        notes.append(
            "rotor_commands: are left out, as nothing says which outputs drive rotors; a columns.toml may do so."
        )
        return None
    throttle = f"RC{parameters.get('RCMAP_THROTTLE', 3.0):g}"
    pairs = [("MOT_PWM_MIN", "MOT_PWM_MAX"), (f"{throttle}_MIN", f"{throttle}_MAX")]
    limits = [(parameters.get(low, 0.0), parameters.get(high, 0.0)) for low, high in pairs]
    if parameters.get("MOT_PWM_TYPE", 0.0) in DIGITAL:
        limits = [USUAL_LIMITS]
    low, high = next((each for each in limits if each[1] > each[0] > 0.0), (0.0, 0.0))
    if not high:
        low, high = USUAL_LIMITS
        notes.append(f"rotor_commands: limits of {low:g} and {high:g} us are assumed; no parameter states them.")
    columns = {f"output {name}": np.maximum(0.0, (outputs.numbers(name) - low) / (high - low)) for name in places}
    return RawTable(columns=columns, time=outputs.time)


def _motor_outputs(outputs: RawTable, parameters: Mapping[str, float], notes: list[str]) -> list[str]:
    """Columns of the outputs that drive the rotors, in their order, by parameters or else by equal least outputs."""
    every = [name for name in outputs.columns if re.fullmatch(r"C(h)?\d+", name)]
    driven = {parameters.get(f"SERVO{k + 1}_FUNCTION", 0.0): name for k, name in reversed([*enumerate(every)])}
    if FUNCTIONS[0] in driven:
        return [driven[function] for function in takewhile(driven.__contains__, FUNCTIONS)]
    if count := ROTORS_OF_CLASS.get(int(parameters.get("FRAME_CLASS", 0.0)), 0):
        return every[:count]
    least = [outputs.columns[name].min() for name in every]
    alike = len([*takewhile(lambda value: value == least[0], least)])
    if alike not in ROTORS_OF_CLASS.values():
        return []
    notes.append(f"rotor_commands: {alike} rotors are assumed, as so many outputs have the same least value.")
    return every[:alike]


DATAFLASH = FlightFormat(read_dataflash, suffixes=("bin", "px4log"), begins=(MAGIC,))


def refuse_telemetry(path: Path, columns: Columns | None) -> FlightData:
    """Refuse a file of MAVLink telemetry, whose few rows a second identify nothing.

    Raises:
        ValueError: one line, always.
    """
    raise ValueError("telemetry: has a few rows a second; read the log of the vehicle's memory card, .bin or .ulg")


TELEMETRY = FlightFormat(refuse_telemetry, suffixes=("tlog",))
