"""Logs of simulated flights as measured flights: sensor readings if logged, else the
true state.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from skyarm.algebra.frames import of_euler_angles, turn_vectors
from skyarm.flight_data.columns_file import Columns
from skyarm.flight_data.flight_data import PLACE, Channel, FlightData, FlightFormat
from skyarm.flight_data.quantities import QUANTITIES
from skyarm.flight_data.raw_tables import rising_rows
from skyarm.log.flight_log import Log
from skyarm.log.flown_scenario import written_at
from skyarm.log.formats import load_log
from skyarm.log.log_columns import setpoints_of
from skyarm.log.sensor_data import COMPONENTS, ESTIMATE, Source, sources_of
from skyarm.records.arrays import Array

FIELDS: Mapping[str, str] = {
    "rate": "gyro",
    "specific_force": "accelerometer",
    "position": "position",
    "velocity": "velocity",
    "quaternion": "quaternion",
    "joints": "joint_positions",
    "joint_rates": "joint_rates",
}
"""Field of a reading -> quantity."""

COMMANDED: Mapping[str, str] = {
    "rotor_speed_commands": "rotor_commands",
    "rotor_speeds": "rotor_speeds",
}
"""Quantity -> array of the log that is not a sensor reading."""

STATED: Mapping[str, str] = {
    **{
        quantity: field
        for field, quantity in FIELDS.items()
        if quantity != "accelerometer"
    },
    **COMMANDED,
}
"""Quantity -> array of the log with its true value, for states and commands; a log has
no true specific force."""

SETPOINTS: Mapping[str, str] = {"": "joint_efforts", "rad or m": "joint_commands"}
"""Unit of the setpoints of all drives -> quantity."""

SIMULATED = "simulated"
"""Value of the fact ``vehicle`` of a simulated flight."""

TAIL = 1 << 16
"""Size (bytes) of the end of an MCAP file that contains its index."""


def is_own_mcap(path: Path) -> bool:
    """True if an MCAP file is the log of a simulated flight, by the names in its header
    and index.
    """
    with path.open("rb") as stream:
        # the header, which names the library that wrote the file
        head = stream.read(64)
        stream.seek(max(0, stream.seek(0, 2) - TAIL))
        return b"skyarm" in head and b"flight.npz" in stream.read(TAIL)


def read_own_log(path: Path, columns: Columns | None) -> FlightData:
    """Read the log of a simulated flight as a measured one.

    Raises:
        ValueError: one line: it is no such log, or a mapping is given. OSError: it
            cannot be read.
    """
    if columns is not None and columns.signals:
        raise ValueError(
            f"{columns.file}: must be left out for a log of skyarm, which names its own"
            " quantities"
        )
    return measured_flight(load_log(path), path)


def measured_flight(log: Log, path: Path) -> FlightData:
    """Convert the log of a simulated flight to a measured flight.

    Args:
        log: log of the flight.
        path: path of its file, for name and messages.

    Raises:
        ValueError: one line: it is of several vehicles.
    """
    require_one_vehicle(log)
    measured: dict[str, Channel] = {}
    place: dict[str, float] = {}
    for name, source in sources_of(log.info).items():
        # an estimate is no measurement, and knows the model that is to be found
        if name == ESTIMATE or name.startswith(COMPONENTS):
            continue
        for field, quantity in FIELDS.items():
            array = log.received.get(f"{name}.{field}")
            # of two sensors of a quantity the first: a flight has one channel of it
            if (
                array is not None
                and quantity not in measured
                and _fits(quantity, array)
            ):
                if source.mount and quantity in ("gyro", "accelerometer"):
                    array = turn_vectors(
                        np.array([[*of_euler_angles(*source.mount[3:])]]), array
                    )
                    place = dict(zip(PLACE, source.mount[:3], strict=True))
                channel = _reading(log, name, field, source, array)
                if channel.time.size:
                    measured[quantity] = channel
    stated = {
        name: each
        for name, each in STATED.items()
        if name not in measured and _fits(name, log[each])
    }
    measured |= {
        name: Channel(time=log.time, values=log[each], source=each)
        for name, each in stated.items()
    }
    notes = list[str]()
    if log.efforts.size:
        setpoints = list(setpoints_of(log.info).values())
        # joints without a drive take torques: one channel cannot hold both
        units = (
            set(setpoints)
            if len(setpoints) == log.efforts.shape[1]
            else {*setpoints, ""}
        )
        if len(units) == 1 and units <= set(SETPOINTS):
            measured[SETPOINTS[units.pop()]] = Channel(
                time=log.time, values=log.efforts, source="efforts"
            )
        else:
            notes.append(
                "joint_commands: are left out, as the joints' drives take setpoints of"
                " several units."
            )
    if true := [name for name in stated if name not in COMMANDED]:
        notes.append(
            f"{', '.join(true)}: are true values, as no sensor of the flight reads"
            " them."
        )
    facts: dict[str, str | float] = {"vehicle": SIMULATED}
    facts |= {
        key: str(log.info[key])
        for key in ("scenario", "status", "digest")
        if key in log.info
    }
    given = {
        "gravity": log.info.get("plant_gravity"),
        "command_delay": written_at(log.info, "delays.command"),
        "start": log.time[0] if log.time.size else 0.0,
    }
    facts |= {
        key: float(value)
        for key, value in given.items()
        if isinstance(value, (int, float))
    }
    facts |= place
    channels = {name: measured[name] for name in QUANTITIES if name in measured}
    return FlightData(
        name=path.stem,
        file=str(path),
        channels=channels,
        notes=tuple(notes),
        facts=facts,
    )


def require_one_vehicle(log: Log) -> None:
    """Raise an error for the log of several vehicles.

    Raises:
        ValueError: one line with their names and how the log of one is written.
    """
    # arrays of one vehicle have no names of vehicles, and one vehicle is identified
    if len(log.agents) > 1:
        cure = f"skyarm export LOG --vehicle {next(iter(log.agents))} -o NEW.npz"
        raise ValueError(
            f"vehicles = {', '.join(log.agents)}: must be one; the log of one is"
            f" written by: {cure}"
        )


def _fits(quantity: str, array: Array) -> bool:
    """True if an array has at least one row, and as many columns as a quantity."""
    width = QUANTITIES[quantity].width
    return (
        array.ndim == 2
        and len(array) > 0
        and (array.shape[1] == width if width else array.shape[1] > 0)
    )


def _reading(log: Log, name: str, field: str, source: Source, array: Array) -> Channel:
    """Time series of a logged sensor: one sample per reading, at its time of
    measurement.
    """
    stamps = log.received.get(f"{name}.time")
    if stamps is None:
        # rows before the delay has passed repeat the first reading
        rows = np.arange(source.late, log.time.size, source.every)
        time = log.time[rows] - source.late / float(log.info["rates_hz"]["control"])
    else:
        rows = np.arange(log.time.size)
        time = stamps.ravel()
    finite = np.isfinite(array[rows]).all(axis=1) & np.isfinite(time)
    rows, time = rows[finite], time[finite]
    rising = rising_rows(time)
    return Channel(
        time=time[rising], values=array[rows[rising]], source=f"{name}.{field}"
    )


OWN_LOG = FlightFormat(read_own_log, suffixes=("npz",), begins=(b"PK\x03\x04",))
