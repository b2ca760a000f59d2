"""Mapping from columns or topics of a data file to physical quantities, by the tables
of ``columns.toml``.

A file has a table for each quantity of
:data:`skyarm.flight_data.quantities.QUANTITIES`, and one for the time::

    [time]
    column = "t"
    unit = "us"  # s, ms, us or ns; if left out, that whose rate can be true

    [gyro]
    columns = ["p", "q", "-r"]        # a minus before a name turns the sign
    unit = "deg/s"
    frame = "FRD"  # of the base: FLU (x forward, y left, z up), or forward, right, down

    [quaternion]
    columns = ["qx", "qy", "qz", "qw"]
    order = "xyzw"  # three columns are roll, pitch and yaw in a unit of "deg" or "rad"
    frame = "FRD"
    world = "NED"                     # of the world: "z up", or north, east, down

    [accelerometer]
    file = "accelerometer.csv"        # another table of text with the same clock
    columns = ["x", "y", "z"]
    scale = 0.001  # factor on the numbers of the file, before the unit

    [rotor_commands]
    topic = "actuator_outputs"        # of files that hold several tables
    columns = ["output[0]", "output[1]", "output[2]", "output[3]"]
    low = 1000.0                      # the numbers of no signal and of the full one
    high = 2000.0
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

from skyarm.algebra.frames import FRAMES, ORDERS, WORLDS
from skyarm.flight_data.quantities import ATTITUDE, BODY, QUANTITIES, WORLD, Quantity
from skyarm.records.files import (
    Fields,
    PathLike,
    must_be_one_of,
    read_toml,
    require_file,
    shown,
)
from skyarm.records.files.toml import Entry
from skyarm.records.immutable import immutable

TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Units of time -> seconds."""

ANGLES = {"rad": 1.0, "deg": math.pi / 180.0}
"""Units of Euler angles -> radians."""

STAMPS = "header", "receive"
"""Time stamps of a message: of its header, or of its arrival in the file."""


@immutable
class QuantitySource:
    """Source of a physical quantity in a data file: columns, unit and axes.

    Attributes:
        columns: names; a minus before one turns its sign.
        topic: table of the file that holds them; the only one, or the first that has
            them all, if empty.
        file: further file of the same clock that holds them, from the folder of the
            flight; the flight itself if empty.
        unit: unit of the numbers; the SI unit of the quantity if empty.
        scale: factor on the numbers of the file, such as units per count of a
            converter.
        frame: axes of the base, FLU or FRD; of a velocity "" for one in world axes.
        world: axes of the world, "z up" or "NED".
        order: order of a quaternion's columns.
        inverse: a quaternion turns world to base.
        low, high: numbers of no and of the full signal of rotor commands.
        time: column of the time of this quantity; that of the file if empty.
        stamp: time of a message, "header" or "receive".
        names: names of the joints whose columns they are, where the file has them.
    """

    columns: tuple[str, ...]
    topic: str = ""
    file: str = ""
    unit: str = ""
    scale: float = 1.0
    frame: str = ""
    world: str = "z up"
    order: str = "wxyz"
    inverse: bool = False
    low: float = 0.0
    high: float = 1.0
    time: str = ""
    stamp: str = "header"
    names: tuple[str, ...] = ()

    @property
    def source(self) -> str:
        """Topic and column names from which a quantity is read, as text."""
        listed = ", ".join(self.columns)
        return f"{self.topic}: {listed}" if self.topic else listed


@immutable
class Columns:
    """Mapping from the columns of a data file to physical quantities.

    Attributes:
        signals: sources by name of the quantity.
        time: column of the time; the format's own if empty.
        time_unit: s, ms, us or ns; by the steps of the times if empty.
        file: path that it was read from, for messages.
        log: number of the flight to read, of a file that holds several, from 1 on; 0
            for the usual one.
    """

    signals: Mapping[str, QuantitySource] = field(default_factory=dict)
    time: str = ""
    time_unit: str = ""
    file: str = "columns"
    log: int = 0


def read_columns(path: PathLike) -> Columns:
    """Read a column mapping from a TOML file.

    Raises:
        ValueError: one line with file, field, value and what is allowed.
    """
    file = os.fspath(path)
    require_file(path, f"columns = {shown(file)}")
    try:
        return columns_from(read_toml(Path(path).read_bytes()), file)
    except OSError as error:
        raise ValueError(
            f"columns = {shown(file)}: must be readable ({error.strerror})"
        ) from None
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None


def columns_from(document: object, file: str = "columns") -> Columns:
    """Read a column mapping from a parsed TOML document.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    tables = Fields(document, "")
    time = tables.inner("time")
    column = time.text("column") if "column" in time.table else ""
    unit = time.choice("unit", tuple(TIMES)) if "unit" in time.table else ""
    time.done()
    signals = {}
    for name in tables.table:
        if name == "time":
            continue
        if name not in QUANTITIES:
            raise ValueError(f"{name}: {must_be_one_of(('time', *QUANTITIES), name)}")
        signals[name] = _signal(QUANTITIES[name], tables.inner(name))
    if not signals:
        raise ValueError(
            f"quantities = none: must be a table or more of {', '.join(QUANTITIES)}"
        )
    return Columns(signals=signals, time=column, time_unit=unit, file=file)


SOURCES: Mapping[str, Any] = read_toml(
    Path(__file__).with_name("usual_sources.toml").read_bytes()
)
"""Default sources of quantities: quantity -> tables, by file format and by ROS message
type."""


def usual_signals(tables: Mapping[str, Entry]) -> dict[str, tuple[QuantitySource, ...]]:
    """Default sources of each quantity, in order of preference, from tables of
    :data:`SOURCES`.
    """
    every = {name: Fields(tables, "").tables(name) for name in tables}
    return {
        name: tuple(_signal(QUANTITIES[name], each) for each in entries)
        for name, entries in every.items()
    }


def _signal(quantity: Quantity, fields: Fields) -> QuantitySource:
    """Read the source of a quantity from its table in the column mapping."""
    columns = _names(fields)
    euler = quantity.axes == ATTITUDE and len(columns) == 3
    if quantity.width and len(columns) != quantity.width and not euler:
        euler_words = (
            ", or 3 of roll, pitch and yaw" if quantity.axes == ATTITUDE else ""
        )
        raise ValueError(
            f"{fields.at('columns')} = {shown(list(columns))}: must be {quantity.width}"
            f" names{euler_words}; a column of lists must be split"
        )
    units = ANGLES if euler else quantity.units
    if "unit" in fields.table and not any(units):
        ranged = (
            ": low and high tell its range"
            if quantity is QUANTITIES["rotor_commands"]
            else ""
        )
        raise ValueError(
            f"{fields.at('unit')} = {shown(fields.table['unit'])}: must be left"
            f" out{ranged}"
        )
    given: dict[str, Any] = {
        "unit": fields.choice("unit", tuple(units), next(iter(units)))
    }
    # above 0, because a minus before a column's name turns its sign
    given["scale"] = fields.number("scale", 1.0, low=0.0, strict=True)
    if quantity.axes in (BODY, ATTITUDE):
        given["frame"] = fields.choice("frame", FRAMES, FRAMES[0])
    if quantity.axes in (WORLD, ATTITUDE):
        given["world"] = fields.choice("world", WORLDS, WORLDS[0])
    if quantity is QUANTITIES["velocity"] and "frame" in fields.table:
        given["frame"] = fields.choice("frame", FRAMES)
        if "world" in fields.table:
            raise ValueError(
                f"{fields.at('frame')} = {shown(given['frame'])}: must be left out"
                " beside 'world'"
            )
    if quantity.axes == ATTITUDE:
        given["inverse"] = fields.flag("inverse", False)
        given["order"] = (
            ORDERS[0] if euler else fields.choice("order", ORDERS, ORDERS[0])
        )
    if quantity is QUANTITIES["rotor_commands"]:
        given |= {"low": fields.number("low", 0.0), "high": fields.number("high", 1.0)}
        if given["high"] == given["low"]:
            raise ValueError(
                f"{fields.at('high')} = {given['high']:g}: must differ from low"
            )
    given |= {name: fields.text(name, "") for name in ("topic", "file", "time")}
    signal = QuantitySource(
        columns=columns, stamp=fields.choice("stamp", STAMPS, "header"), **given
    )
    fields.done()
    return signal


def _names(fields: Fields) -> tuple[str, ...]:
    """Read a list of column names, each of which may occur once."""
    values, at = fields.take("columns"), fields.at("columns")
    if isinstance(values, str):
        values = [values]
    if (
        not isinstance(values, list)
        or not values
        or not all(isinstance(each, str) and each for each in values)
    ):
        raise ValueError(f"{at} = {shown(values)}: must be a list of names")
    if len({each.removeprefix("-") for each in values}) != len(values):
        raise ValueError(f"{at} = {shown(values)}: must name each column once")
    return tuple(values)
