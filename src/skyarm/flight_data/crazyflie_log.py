"""Reader of the binary logs that a Crazyflie writes on its memory card.

The file is little-endian: a byte 0xBC, the version (two bytes, 1 or 2), the number of event types, then of each its
number, its name, and the names and types of its variables; names end with a zero byte. Events follow: number, time
(version 1: four bytes, ms; version 2: eight bytes, us), variables. The last four bytes are the CRC-32 of all others.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from skyarm.flight_data.columns_file import Columns, Signal
from skyarm.flight_data.flight_data import FlightData, FlightFormat
from skyarm.flight_data.raw_tables import Table, flight_of
from skyarm.records.files import shown
from skyarm.records.immutable import immutable

MAGIC, VERSIONS = 0xBC, (1, 2)

TYPES: Mapping[str, str] = {
    "B": "u1",
    "b": "i1",
    "H": "<u2",
    "h": "<i2",
    "I": "<u4",
    "i": "<i4",
    "f": "<f4",
    "e": "<f2",
}
"""Letter of a variable's type -> its type in NumPy."""

CHECK = 4
"""Bytes of the check sum."""


def _signals(unit: str, *columns: str, high: float = 1.0) -> tuple[Signal, ...]:
    return (Signal(columns=columns, unit=unit, high=high),)


def _xyz(group: str, begin: str = "") -> list[str]:
    return [f"{group}.{begin}{axis}" for axis in "xyz"]


USUAL: Mapping[str, tuple[Signal, ...]] = {
    "gyro": _signals("deg/s", *_xyz("gyro")),
    "accelerometer": _signals("g", *_xyz("acc")),
    "position": (
        *_signals("m", *_xyz("locSrv")),
        *_signals("m", *_xyz("stateEstimate")),
        *_signals("m", *_xyz("kalman", "state")),
    ),
    "velocity": _signals("m/s", *_xyz("stateEstimate", "v")),
    "quaternion": _signals("", *(f"stateEstimate.q{axis}" for axis in "wxyz")),
    "rotor_commands": _signals("", *(f"motor.m{k}" for k in (1, 2, 3, 4)), high=65535.0),
    "rotor_speeds": _signals("rpm", *(f"rpm.m{k}" for k in (1, 2, 3, 4))),
    "voltage": (*_signals("V", "pm.vbat"), *_signals("mV", "pm.vbatMV")),
}
"""Variables of the firmware that are quantities of a flight. Its axes are ours: x forward, y left, z up."""


@immutable(kw_only=False)
class _Event:
    """Type of event: name, names of the variables, and a row as a type of NumPy."""

    name: str
    variables: tuple[str, ...]
    row: np.dtype[np.void]


def read_crazyflie(path: Path, columns: Columns | None) -> FlightData:
    """Read a log of a Crazyflie's memory card.

    Raises:
        ValueError: one line: it is no such file, or its head is damaged. OSError: it cannot be read.
    """
    data = path.read_bytes()
    notes: list[str] = []
    version, events, begin = _head(data)
    rows, end = _rows(data, version, events, begin)
    if end + CHECK != len(data):
        number = int.from_bytes(data[end : end + 2], "little")
        known = number in events or len(data) - end < CHECK
        why = "the file is cut off" if known else f"an event of the unknown number {number} follows"
        notes.append(f"file: {len(data) - end} bytes after the last whole event are left out; {why}.")
    elif struct.unpack_from("<I", data, end)[0] != zlib.crc32(memoryview(data)[:end]):
        notes.append("file: its check sum does not fit, so that some of its numbers are damaged.")
    unit = 1e-3 if version == 1 else 1e-6
    stamps = [int(found["time"][0]) for found in rows.values()]
    origin = min(stamps, default=0)
    with np.errstate(invalid="ignore"):  # NaNs of a damaged file that signal
        tables = {
            events[number].name: Table(
                columns={name: found[f"v{k}"].astype(float) for k, name in enumerate(events[number].variables)},
                time=(found["time"].astype(float) - origin) * unit,
            )
            for number, found in rows.items()
        }
    facts: dict[str, str | float] = {"vehicle": "Crazyflie", "version of the file": float(version)}
    return flight_of(path, tables, USUAL, columns, origin=origin * unit, facts=facts, notes=notes)


def _head(data: bytes) -> tuple[int, dict[int, _Event], int]:
    """Version, event types by number, and place of the first event."""
    if len(data) < 5 or data[0] != MAGIC:
        raise ValueError(f"first byte = {data[:1].hex() or 'none'}: must be bc, of a log that a Crazyflie wrote")
    version, count = struct.unpack_from("<HH", data, 1)
    if version not in VERSIONS:
        raise ValueError(f"version = {version}: must be {' or '.join(map(str, VERSIONS))}")
    stamp = ("time", "<u4" if version == 1 else "<u8")
    events: dict[int, _Event] = {}
    place = 5
    for _ in range(count):
        number, place = _number(data, place)
        name, place = _text(data, place)
        variables, place = _number(data, place)
        names, types = list[str](), list[str]()
        for _ in range(variables):
            text, place = _text(data, place)
            if text[-3:-2] != "(" or text[-1:] != ")" or text[-2] not in TYPES or text[:-3] in names:
                raise ValueError(f"variable = {shown(text)}: must be a new NAME(TYPE), TYPE one of {' '.join(TYPES)}")
            names.append(text[:-3])
            types.append(TYPES[text[-2]])
        if number in events or name in (each.name for each in events.values()):
            raise ValueError(f"event = {number} {shown(name)}: is declared twice")
        fields = [("number", "<u2"), stamp, *((f"v{k}", kind) for k, kind in enumerate(types))]
        events[number] = _Event(name, tuple(names), np.dtype(fields))
    if not events:
        raise ValueError("event types = 0: must be one or more")
    return version, events, place


def _number(data: bytes, place: int) -> tuple[int, int]:
    """Number of two bytes, and the place after it."""
    if place + 2 > len(data):
        raise ValueError("head: is cut off")
    return int.from_bytes(data[place : place + 2], "little"), place + 2


def _text(data: bytes, place: int) -> tuple[str, int]:
    """Text up to a zero byte, and the place after that."""
    end = data.find(b"\0", place)
    if end < 0:
        raise ValueError("head: is cut off")
    return data[place:end].decode("utf-8", "replace"), end + 1


def _rows(
    data: bytes, version: int, events: Mapping[int, _Event], place: int
) -> tuple[dict[int, np.ndarray[tuple[int], np.dtype[np.void]]], int]:
    """Rows of each event type that occurs, and the place after the last whole event."""
    pieces: dict[int, list[np.ndarray[tuple[int], np.dtype[np.void]]]] = {}
    end = len(data) - CHECK
    for number, begin, count in _runs(data, events, place, end):
        place = begin + count * events[number].row.itemsize
        pieces.setdefault(number, []).append(np.frombuffer(data, events[number].row, count, begin))
    return {number: np.concatenate(found) for number, found in pieces.items()}, place


def _runs(data: bytes, events: Mapping[int, _Event], place: int, end: int) -> Iterator[tuple[int, int, int]]:
    """Yield event number, place and number of rows of each run of equal events; an unknown number ends them."""
    while place + 2 <= end:
        number = int.from_bytes(data[place : place + 2], "little")
        if number not in events:
            return
        row = events[number].row
        most = (end - place) // row.itemsize
        if not most:
            return
        same = np.frombuffer(data, row, most, place)["number"] == number
        count = most if same.all() else int(np.argmin(same))
        yield number, place, count
        place += count * row.itemsize


CRAZYFLIE = FlightFormat(read_crazyflie, begins=tuple(struct.pack("<BH", MAGIC, version) for version in VERSIONS))
