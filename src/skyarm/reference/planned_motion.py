"""Reference of a whole-body plan: signals from its file, with the centre of mass and
the tip where the plan has them.

A base reference alone says where a level vehicle's centre of mass is. In a plan through
large tilt it is elsewhere, and so is the tip; ``[reference.planned]`` says where, as
signals that the reader makes of a plan's file::

    [reference]
    kind = "plan"
    file = "eagle_catch.npz"     # of ``skyarm plan``
    start = 1.0                  # s, when the plan begins; left out: 0
"""

from __future__ import annotations

import io
import struct
import zipfile
import zlib
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from skyarm.algebra import Quaternion, Scalar, Scalars
from skyarm.algebra.frames import continuous
from skyarm.records.arrays import Array, lengths, stack_values
from skyarm.records.field_rules import checked
from skyarm.records.files import Fields, require_file, shown
from skyarm.records.files.toml import Entry
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit
from skyarm.reference.signals import Signal
from skyarm.reference.splines import minimum_snap

FORMAT = 1
"""Format number of a plan's file."""


@immutable
@checked("planned")
class PlannedBody:
    """Planned motion of centre of mass, tip, attitude and rotors: three, three, four
    and one for each rotor.

    Efforts of the joints and force on the tip tell a check what the plan asks and
    counts on; no law reads them.
    """

    center: Annotated[
        tuple[Signal, ...],
        Unit("m", "planned position of the centre of mass, world axes"),
    ]
    tip: Annotated[
        tuple[Signal, ...],
        Unit("m", "planned position of the tip, world axes; empty: no tip"),
    ] = ()
    attitude: Annotated[
        tuple[Signal, ...], Unit("", "planned attitude, a quaternion; empty: unknown")
    ] = ()
    rotors: Annotated[
        tuple[Signal, ...], Unit("rad/s", "planned speeds of the rotors")
    ] = ()
    times: Annotated[Scalars, Unit("s", "nodes of the plan")] = ()
    efforts: Annotated[
        tuple[Scalars, ...],
        Unit("N m or N", "planned efforts of each joint at the nodes; empty: unknown"),
    ] = ()
    force: Annotated[
        tuple[Scalars, ...],
        Unit("N", "planned force on the tip at the nodes, world axes"),
    ] = ()

    def center_at(self, t: Scalar) -> Scalars:
        """Position (m) of the centre of mass at time t and its first four derivatives,
        fifteen numbers.
        """
        rows = [signal.derivatives(t) for signal in self.center]
        return tuple(row[k] for k in range(5) for row in rows)

    def turning_at(self, t: Scalar) -> Scalars:
        """Quaternion and rotor speeds (rad/s) at time t, then their derivatives."""
        rows = [signal.derivatives(t) for signal in (*self.attitude, *self.rotors)]
        return tuple(row[k] for k in range(2) for row in rows)

    def actuation_at(self, t: Array) -> tuple[Array, Array, Array]:
        """Attitudes R_WB (3, 3, K), rotor speeds (rotors, K; rad/s) and joint efforts
        (n or 0, K) at K times (s).
        """
        attitude, rotors = (
            stack_values(len(t), [signal.derivatives(t)[0] for signal in each])
            for each in (self.attitude, self.rotors)
        )
        # straight between the nodes: they jump where a contact begins or ends
        efforts = stack_values(
            len(t), [np.interp(t, *np.array([self.times, row])) for row in self.efforts]
        )
        return (
            np.array(
                [[*row] for row in Quaternion(*attitude).normalized().rotation().rows]
            ),
            rotors,
            efforts,
        )


def plan_tables(fields: Fields, vehicle: str | None = None) -> dict[str, Entry]:
    """Reference table of signals that states the motion in a plan's file.

    Args:
        fields: table ``[reference]`` of kind "plan"; ``file`` is a path from where the
            process runs.
        vehicle: name of the vehicle that flies the plan, which must be the plan's own;
            None: any.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    fields.take("kind")
    file, at = fields.text("file"), fields.at("file")
    begin = fields.number("start", 0.0, low=0.0)
    rest = {
        name: value
        for name, value in fields.table.items()
        if name not in ("kind", "file", "start")
    }
    for name in ("base", "joints", "yaw", "tip", "planned"):
        if name in rest:
            raise ValueError(
                f"{fields.at(name)} = {shown(rest[name])}: must be left out beside a"
                " plan"
            )
    arrays = read_plan_arrays(file, f"{at} = {shown(file)}")
    # a file of an earlier version does not name its vehicle
    own = str(arrays["vehicle"]) if "vehicle" in arrays else vehicle
    if vehicle is not None and own != vehicle:
        raise ValueError(
            f"{at} = {shown(file)}: is a plan of {shown(own)}; plant.vehicle is"
            f" {shown(vehicle)}"
        )
    times = [begin + t for t in arrays["t"].tolist()]

    # a plan without these arrays is one that rests
    moves = any(
        np.abs(arrays[name][-1]).max(initial=0.0) > MOVING
        for name in SPEEDS
        if name in arrays
    )

    def spline(values: Any) -> Any:
        numbers = np.asarray(values).tolist()
        # the spline of a file rests at its ends
        if moves:
            return minimum_snap(times, numbers, rests=False)
        return {"kind": "spline", "times": [*times], "values": numbers}

    axes = {axis: spline(arrays["position"][:, k]) for k, axis in enumerate("xyz")}
    names = {
        "center": "center",
        "tip": "tip",
        "attitude": "quaternion",
        "rotors": "rotor_speeds",
    }
    planned: dict[str, Entry] = {
        name: [spline(column) for column in arrays[array].T]
        for name, array in names.items()
        if arrays[array].size
    }
    # no splines: efforts and force jump where a contact begins or ends
    planned |= {
        "times": times,
        "efforts": arrays["torques"].T.tolist(),
        "force": arrays["force"].T.tolist(),
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
    require_file(file, at)
    try:
        # read whole: of a damaged archive NumPy leaves the file open
        with np.load(
            io.BytesIO(Path(file).read_bytes()), allow_pickle=False
        ) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except UNREADABLE:
        raise ValueError(f"{at}: must be a file of 'skyarm plan'") from None
    if {"format", "t", *SHAPES} - {*LATER, *UNREAD} - set(arrays) or not np.array_equal(
        arrays["format"], FORMAT
    ):
        raise ValueError(f"{at}: must be a file of 'skyarm plan' of this version")
    arrays = {
        name: np.zeros((np.size(arrays["t"]), columns))
        for name, columns in LATER.items()
    } | arrays
    _require_arrays(arrays, at)
    # an attitude is two quaternions; between nodes of different ones the way would lead
    # through zero
    return arrays | {"quaternion": continuous(arrays["quaternion"])}


UNREADABLE = (
    OSError,
    ValueError,
    TypeError,
    KeyError,
    EOFError,
    RuntimeError,
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
)
"""Errors of numpy and zipfile for a file that is no archive of arrays, or a damaged
one."""

ANY: tuple[int, ...] = ()

SHAPES: dict[str, tuple[tuple[int, ...], ...]] = {
    "position": ((3,),),
    "center": ((3,),),
    "tip": ((3, 0),),
    "quaternion": ((4,),),
    "yaw": (),
    "joints": (ANY,),
    "rotor_speeds": (ANY,),
    "torques": (),
    "force": ((3,),),
    "velocity": ((3,),),
    "rate": ((3,),),
    "joint_rates": (),
    "phase": (),
    "inputs": (ANY,),
    "gains": (ANY, ANY),
}
"""Allowed lengths of each further axis of each array of a plan, whose first is that of
the nodes."""

SPEEDS = ("velocity", "rate", "joint_rates")
"""Arrays of which the last row is zero where a plan ends at rest."""

MOVING = 1e-3
"""Speed (m/s, rad/s) at the last node above which a plan ends in motion; at rest it is
the solver's tolerance, a thousandth of this."""

UNREAD = (*SPEEDS, "phase", "inputs", "gains")
"""Arrays that no law reads and a file may lack."""

LATER = {"torques": 0, "force": 3}
"""Arrays that a file of an earlier version lacks, and the number of columns that stand
for them."""


def _require_arrays(arrays: dict[str, Any], at: str) -> None:
    """Refuse a plan with an array of another shape, of no numbers, or of numbers that
    are no motion.

    Raises:
        ValueError: one line that begins with ``at``.
    """
    # those that no law reads, too
    for name in (each for each in [*arrays] if each != "vehicle"):
        kind = np.asarray(arrays[name]).dtype
        if kind.kind not in "fiu":
            raise ValueError(
                f"{at}: {name} of type {kind}: must be an array of numbers"
            )
        # of whole numbers the least has no size
        arrays[name] = values = np.asarray(arrays[name], dtype=float)
        if not (np.abs(values) <= LARGEST).all():
            raise ValueError(
                f"{at}: {name}: must be finite numbers, from {-LARGEST:g} to"
                f" {LARGEST:g}"
            )
    t = arrays["t"]
    if t.ndim != 1 or len(t) < 2:
        raise ValueError(
            f"{at}: t of shape {t.shape}: must be a list of two times or more"
        )
    for name in (each for each in SHAPES if each in arrays):
        axes = (
            ((arrays["joints"].shape[1], 0),)
            if name in ("torques", "joint_rates")
            else SHAPES[name]
        )
        # between nodes
        first, *more = arrays[name].shape or (0,)
        rows = len(t) - (name in ("inputs", "gains"))
        if (
            first != rows
            or len(more) != len(axes)
            or any(x and k not in x for x, k in zip(axes, more, strict=True))
        ):
            columns = ",".join(
                f" {lengths[0]}" if lengths else " any number" for lengths in axes
            )
            raise ValueError(
                f"{at}: {name} of shape {arrays[name].shape}: must be"
                f" ({rows},{columns})"
            )
    if not (np.diff(t) > 0.0).all():
        raise ValueError(f"{at}: t: must increase from node to node")
    if not (lengths(arrays["quaternion"]) > SHORTEST).all():
        raise ValueError(f"{at}: quaternion: must be of length 1 at each node")
    if "vehicle" in arrays and (
        np.ndim(arrays["vehicle"]) or np.asarray(arrays["vehicle"]).dtype.kind != "U"
    ):
        raise ValueError(f"{at}: vehicle: must be a name")


LARGEST = 1e6
"""Largest number of a plan, as of every signal."""

SHORTEST = 1e-3
"""Length of a quaternion below which it is no attitude."""
