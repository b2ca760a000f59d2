"""Reader of the binary logs that a Crazyflie writes on its memory card.

The file is little-endian: a byte 0xBC, the version (two bytes, 1 or 2), the number of
event types, then of each its number, its name, and the names and types of its
variables; names end with a zero byte. Events follow: number, time (version 1: four
bytes, ms; version 2: eight bytes, us), variables. The last four bytes are the CRC-32 of
all others.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from skyarm.flight_data.columns_file import SOURCES, Columns, usual_signals
from skyarm.flight_data.flight_data import FlightData, FlightFormat
from skyarm.flight_data.raw_tables import RawTable, flight_of
from skyarm.records.files import shown

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

SPEED, NO_SPEED = re.compile(r"motor\.m\d_rpm"), 65535.0
"""Pattern of the variables with the speed of a brushless motor, and their value while
it is unknown."""

CHECK = 4
"""Size (bytes) of the check sum."""

EVENT, VARIABLE = (
    re.compile(each, re.DOTALL) for each in (rb"(..)([^\0]*)\0(..)", rb"([^\0]*)\0")
)
"""Patterns: number, name and variable count of an event type; name and type of a
variable."""


Rows = np.ndarray[tuple[int], np.dtype[np.void]]

Events = Mapping[int, tuple[str, np.dtype[np.void]]]
"""Number of an event type -> its name, and the NumPy type of a row: number, time,
variables."""


def read_crazyflie(path: Path, columns: Columns | None) -> FlightData:
    """Read a log of a Crazyflie's memory card.

    Raises:
        ValueError: one line: it is no such file, or its head is damaged. OSError: it
            cannot be read.
    """
    data = path.read_bytes()
    notes: list[str] = []
    version, events, begin = _head(data)
    rows, end = _rows(data, events, begin)
    if end + CHECK != len(data):
        number = int.from_bytes(data[end : end + 2], "little")
        cut_off = number in events or len(data) - end < CHECK
        why = (
            "the file is cut off"
            if cut_off
            else f"an event of the unknown number {number} follows"
        )
        notes.append(
            f"file: {len(data) - end} bytes after the last whole event are left out;"
            f" {why}."
        )
    elif struct.unpack_from("<I", data, end)[0] != zlib.crc32(memoryview(data)[:end]):
        notes.append(
            "file: its check sum does not fit, so that some of its numbers are damaged."
        )
    # stamps of version 1 are in ms, later ones in us
    unit = 1e-3 if version == 1 else 1e-6
    origin = min((int(records["time"][0]) for records in rows.values()), default=0)
    tables: dict[str, RawTable] = {}
    with np.errstate(invalid="ignore"):  # NaNs of a damaged file that signal
        for number, records in rows.items():
            name, row = events[number]
            read = {each: records[each].astype(float) for each in row.names or ()}
            for each in filter(SPEED.fullmatch, read):
                read[each][read[each] == NO_SPEED] = np.nan
            tables[name] = RawTable(
                # without the number and the time of the event
                columns=dict(list(read.items())[2:]),
                time=(read["time"] - origin) * unit,
            )
    facts: dict[str, str | float] = {
        "vehicle": "Crazyflie",
        "version of the file": float(version),
    }
    return flight_of(
        path,
        tables,
        usual_signals(SOURCES["crazyflie"]),
        columns,
        origin=origin * unit,
        facts=facts,
        notes=notes,
    )


def _head(data: bytes) -> tuple[int, Events, int]:
    """Header of a Crazyflie log: version, event types by number, and byte offset of the
    first event.
    """
    if len(data) < 5 or data[0] != MAGIC:
        raise ValueError(
            f"first byte = {data[:1].hex() or 'none'}: must be bc, of a log that a"
            " Crazyflie wrote"
        )
    version, count = struct.unpack_from("<HH", data, 1)
    if version not in VERSIONS:
        raise ValueError(
            f"version = {version}: must be {' or '.join(map(str, VERSIONS))}"
        )
    events: dict[int, tuple[str, np.dtype[np.void]]] = {}
    place = 5
    for _ in range(count):
        match = _match_at(EVENT, data, place)
        number, variables = (int.from_bytes(match[k], "little") for k in (1, 3))
        name, place = match[2].decode("utf-8", "replace"), match.end()
        fields = {"number": "<u2", "time": "<u4" if version == 1 else "<u8"}
        for _ in range(variables):
            match = _match_at(VARIABLE, data, place)
            text, place = match[1].decode("utf-8", "replace"), match.end()
            if (
                text[-3:-2] != "("
                or text[-1:] != ")"
                or text[-2] not in TYPES
                or text[:-3] in fields
            ):
                raise ValueError(
                    f"variable = {shown(text)}: must be a new NAME(TYPE), TYPE one of"
                    f" {' '.join(TYPES)}"
                )
            fields[text[:-3]] = TYPES[text[-2]]
        if number in events or name in (each for each, _ in events.values()):
            raise ValueError(f"event = {number} {shown(name)}: is declared twice")
        events[number] = name, np.dtype([*fields.items()])
    if not events:
        raise ValueError("event types = 0: must be one or more")
    return version, events, place


def _match_at(pattern: re.Pattern[bytes], data: bytes, place: int) -> re.Match[bytes]:
    """Match a pattern at a byte offset of the header; raises an error if the header is
    cut off.
    """
    match = pattern.match(data, place)
    if match is None:
        raise ValueError("head: is cut off")
    return match


def _rows(data: bytes, events: Events, place: int) -> tuple[dict[int, Rows], int]:
    """Samples of each event type, and the byte offset after the last complete event of
    a known type.
    """
    pieces: dict[int, list[bytes]] = {}
    end = len(data) - CHECK
    sizes = {number: row.itemsize for number, (_, row) in events.items()}
    while place < end:
        number = int.from_bytes(data[place : place + 2], "little")
        # no event has a mark of its beginning: behind an unknown one none is found
        if number not in sizes or place + sizes[number] > end:
            break
        # joined once at the end, so that time is linear in the length of the log
        piece = data[place : place + sizes[number]]
        pieces.setdefault(number, []).append(piece)
        place += sizes[number]
    return {
        number: np.frombuffer(b"".join(rows), events[number][1])
        for number, rows in pieces.items()
    }, place


CRAZYFLIE = FlightFormat(
    read_crazyflie,
    begins=tuple(struct.pack("<BH", MAGIC, version) for version in VERSIONS),
)
