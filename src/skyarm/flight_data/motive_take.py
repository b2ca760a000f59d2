"""Reader of takes that Motive (OptiTrack) exports as CSV.

The first line has facts in pairs; lines with type and name of each column, its group
(Rotation, Position) and its axis follow, the last of which begins with ``Frame``. No
line states the axes: they are Motive's own, x, y up and z, unless the export was told
otherwise; ours are x, -z, y of them. The axes of a rigid body are those of the world
when it was defined: define it with its nose along x.
"""

from __future__ import annotations

import csv
from pathlib import Path

from skyarm.flight_data.columns_file import Columns, QuantitySource
from skyarm.flight_data.flight_data import FlightData, FlightFormat, choose_log
from skyarm.flight_data.raw_tables import RawTable, flight_of
from skyarm.flight_data.table_file import numbers_of_rows
from skyarm.records.files import shown

BEGINNING = b"Format Version,"
"""First bytes of a take, behind a byte order mark if there is one."""

BODY = "Rigid Body"
"""Type of the columns that are read."""

LENGTHS = {"Meters": 1.0, "Centimeters": 0.01, "Millimeters": 0.001}
"""Unit of lengths in the first line -> m."""


def read_motive(path: Path, columns: Columns | None) -> FlightData:
    """Read the pose of a rigid body from a take; of several that of the mapping's
    number, else the first.

    Raises:
        ValueError: one line: a damaged head, or no rigid body with rotations as
            quaternions. OSError: it cannot be read.
    """
    lines = path.read_bytes().decode("utf-8-sig", "replace").splitlines()
    begin = next((k for k, line in enumerate(lines) if line.startswith("Frame,")), 0)
    if begin < 2:
        raise ValueError(
            "head: must have a line that begins with Frame; export it anew"
        )
    first, *labels, groups, axes = csv.reader(lines[: begin + 1])
    # names and values by turns; a last name may have no value
    stated = dict(zip(first[::2], first[1::2], strict=False))
    scale = LENGTHS.get(stated.get("Length Units", ""))
    if scale is None or stated.get("Rotation Type") != "Quaternion":
        raise ValueError(
            f"head = {shown(stated)}: export it anew, with quaternions and lengths in"
            " m, cm or mm"
        )
    kinds, names = (
        next((row for row in labels if row[1:2] == [word]), [])
        for word in ("Type", "Name")
    )
    places, bodies = dict[str, int](), list[str]()
    # a line of the head may be short or missing: no body is then found, and refused
    for k, (kind, name, group, axis) in enumerate(
        zip(kinds, names, groups, axes, strict=False)
    ):
        if kind == BODY and axis:
            # of bodies of one name the first counts, as names alone tell them apart
            places.setdefault(f"{name}: {group} {axis}", k)
            bodies += [name] if name not in bodies else []
    if not bodies:
        raise ValueError(
            f"columns: none is of a {BODY}; define one in Motive, and export it"
        )
    notes = [
        "pose: y up is assumed, as the take states no axes; export one that has z up"
        " anew, with y up."
    ]
    place, listed = choose_log(bodies, columns, 0, notes, "first")
    body = bodies[place]
    # a row begins with the number of its frame, and then the time
    rows = numbers_of_rows(
        "\n".join(lines[begin + 1 :]), {"time": 1, **places}, ",", len(axes), notes
    )
    table = RawTable(
        columns=dict(zip(places, rows[:, 1:].T, strict=True)), time=rows[:, 0]
    )
    x, y, z = (f"{body}: Position {axis}" for axis in "XYZ")
    a, b, c, w = (f"{body}: Rotation {axis}" for axis in "XYZW")
    # a quarter turn about x, from y up to z up
    usual = {
        "position": (QuantitySource(columns=(x, f"-{z}", y), scale=scale),),
        "quaternion": (QuantitySource(columns=(w, a, f"-{c}", b)),),
    }
    return flight_of(
        path,
        {"": table},
        usual,
        columns,
        facts={"vehicle": body, **listed},
        notes=notes,
    )


MOTIVE = FlightFormat(
    read_motive, begins=(BEGINNING, b"\xef\xbb\xbf" + BEGINNING), several=True
)
