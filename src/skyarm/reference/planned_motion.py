"""Reference of a whole-body plan: signals from its file, with the centre of mass and the tip where the plan has them.

A base reference alone says where a level vehicle's centre of mass is. In a plan through large tilt it is elsewhere, and
so is the tip; ``[reference.planned]`` says where, as signals that the reader makes of a plan's file::

    [reference]
    kind = "plan"
    file = "eagle_catch.npz"     # of ``skyarm plan``
    start = 1.0                  # s, when the plan begins; left out: 0
"""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from skyarm.algebra import Scalar, Scalars
from skyarm.records.field_rules import checked
from skyarm.records.files import Fields, shown, unreadable
from skyarm.records.files.toml import Entry
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit
from skyarm.reference.signals import Signal

FORMAT = 1
"""Format number of a plan's file."""


@immutable
@checked("planned")
class PlannedBody:
    """Planned motion of centre of mass, tip, attitude and rotors: three, three, four and one for each rotor."""

    center: Annotated[tuple[Signal, ...], Unit("m", "planned position of the centre of mass, world axes")]
    tip: Annotated[tuple[Signal, ...], Unit("m", "planned position of the tip, world axes; empty: no tip")] = ()
    attitude: Annotated[tuple[Signal, ...], Unit("", "planned attitude, a quaternion; empty: unknown")] = ()
    rotors: Annotated[tuple[Signal, ...], Unit("rad/s", "planned speeds of the rotors")] = ()

    def center_at(self, t: Scalar) -> Scalars:
        """Position (m) of the centre of mass at time t and its first four derivatives, fifteen numbers."""
        rows = [signal.derivatives(t) for signal in self.center]
        return tuple(row[k] for k in range(5) for row in rows)

    def turning_at(self, t: Scalar) -> Scalars:
        """Quaternion and rotor speeds (rad/s) at time t, then their derivatives."""
        rows = [signal.derivatives(t) for signal in (*self.attitude, *self.rotors)]
        return tuple(row[k] for k in range(2) for row in rows)


def plan_tables(fields: Fields) -> dict[str, Entry]:
    """Reference table of signals that states the motion in a plan's file.

    Args:
        fields: table ``[reference]`` of kind "plan"; ``file`` is a path from where the process runs.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    fields.take("kind")
    file, at = fields.text("file"), fields.at("file")
    begin = fields.number("start", 0.0, low=0.0)
    rest = {name: value for name, value in fields.table.items() if name not in ("kind", "file", "start")}
    for name in ("base", "joints", "yaw", "tip", "planned"):
        if name in rest:
            raise ValueError(f"{fields.at(name)} = {shown(rest[name])}: must be left out beside a plan")
    arrays = read_plan_arrays(file, f"{at} = {shown(file)}")
    times = [begin + t for t in arrays["t"].tolist()]

    def spline(values: Any) -> Entry:
        return {"kind": "spline", "times": [*times], "values": np.asarray(values).tolist()}

    axes = {axis: spline(arrays["position"][:, k]) for k, axis in enumerate("xyz")}
    names = {"center": "center", "tip": "tip", "attitude": "quaternion", "rotors": "rotor_speeds"}
    planned: dict[str, Entry] = {
        name: [spline(column) for column in arrays[array].T] for name, array in names.items() if arrays[array].size
    }
    tables: dict[str, Entry] = {
        "base": {"kind": "signals", **axes},
        "yaw": spline(arrays["yaw"]),
        "joints": [spline(column) for column in arrays["joints"].T],
        "planned": planned,
    }
    return {**rest, **tables}


def read_plan_arrays(file: str, at: str) -> dict[str, Any]:
    """Arrays of a plan's file.

    Raises:
        ValueError: one line that begins with ``at``.
    """
    if reason := unreadable(Path(file)):
        raise ValueError(f"{at}: {reason}")
    try:
        with np.load(io.BytesIO(Path(file).read_bytes()), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except (OSError, ValueError, zipfile.BadZipFile, KeyError, EOFError):
        raise ValueError(f"{at}: must be a file of 'skyarm plan'") from None
    missing = {"format", "t", "position", "yaw", "joints", "center", "tip", "quaternion", "rotor_speeds"} - set(arrays)
    if missing or int(arrays["format"]) != FORMAT:
        raise ValueError(f"{at}: must be a file of 'skyarm plan' of this version")
    return arrays
