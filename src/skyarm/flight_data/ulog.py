"""Reader of PX4's logs in the format ULog.

Axes of the file are forward, right, down of the base and north, east, down of the world; they become ours, forward,
left, up and north, west, up. The signal of a rotor is the output of its channel between the parameters of least and
largest output.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np

from skyarm.flight_data.columns_file import Columns, Signal
from skyarm.flight_data.flight_data import FlightData, FlightFormat
from skyarm.flight_data.raw_tables import Table, flight_of
from skyarm.flight_data.ulog_messages import MAGIC, Messages, read_messages
from skyarm.records.arrays import Array

Parameters: TypeAlias = Mapping[str, float]

SECOND = 1e-6
"""Unit of the stamps, s."""

LATEST = 0.1
"""Largest delay from a sample to its message, s, for which the sample's own stamp counts."""

NUMBER_OF_ROTORS = {2: 4, 13: 6, 14: 8, 15: 3, 29: 12, 35: 10}
"""MAVLink's type of the vehicle (parameter MAV_TYPE) -> rotors."""

FIRST_MOTOR, MOST_ROTORS = 101, 12
"""Function of an output channel that drives the first motor; motors that PX4 counts."""

BANKS = "MAIN", "AUX"
"""Names of the groups of outputs: instances of ``actuator_outputs``."""

LEAST, LARGEST = 1000.0, 2000.0
"""Outputs of no and of full signal where no parameter states others, us."""

KEPT = re.compile(r"(SYS_AUTOSTART|MAV_TYPE|THR_MDL_FAC|CA_ROTOR.*|PWM_(MAIN_|AUX_)?(MIN|MAX|FUNC)\d*)")
"""Parameters that are facts of a flight."""

SHARES = "rotor signals"
"""Table of the rotors' signals as shares, made from outputs and parameters."""


def _xyz(topic: str, *columns: str, time: str = "") -> Signal:
    return Signal(columns=columns, topic=topic, frame="FRD", time=time)


def _local(*columns: str) -> Signal:
    return Signal(columns=columns, topic="vehicle_local_position", world="NED")


USUAL: Mapping[str, tuple[Signal, ...]] = {
    "gyro": (
        _xyz("sensor_combined", *(f"gyro_rad[{k}]" for k in range(3))),
        _xyz("vehicle_angular_velocity", *(f"xyz[{k}]" for k in range(3))),
    ),
    "accelerometer": (
        _xyz("sensor_combined", *(f"accelerometer_m_s2[{k}]" for k in range(3)), time="accelerometer_time"),
        _xyz("vehicle_acceleration", *(f"xyz[{k}]" for k in range(3))),
    ),
    "position": (_local("x", "y", "z"),),
    "velocity": (_local("vx", "vy", "vz"),),
    "quaternion": (
        Signal(columns=tuple(f"q[{k}]" for k in range(4)), topic="vehicle_attitude", frame="FRD", world="NED"),
    ),
    "voltage": (Signal(columns=("voltage_v",), topic="battery_status"),),
}
"""Topics of PX4 that are quantities of a flight. Rates before the filters of the controller come first."""


def read_ulog(path: Path, columns: Columns | None) -> FlightData:
    """Read a PX4 log.

    Raises:
        ValueError: one line: it is no such file. OSError: it cannot be read.
    """
    log = read_messages(path.read_bytes())
    tables = dict(
        filter(None, (_table(name, instance, rows, log.start) for (name, instance), rows in log.rows.items()))
    )
    if not tables:
        raise ValueError("file: holds no topic with numbers")
    parameters, notes = log.parameters, _losses(log)
    usual: dict[str, Sequence[Signal]] = dict(USUAL)
    own = {} if columns is None else columns.signals
    count = _number_of_rotors(parameters)
    if "rotor_commands" not in own:
        usual["rotor_commands"] = _rotor_commands(tables, parameters, count, notes)
    if count and "rotor_speeds" not in own:
        speeds = tuple(f"esc[{k}].esc_rpm" for k in range(count))
        usual["rotor_speeds"] = (Signal(columns=speeds, topic="esc_status", unit="rpm"),)
    facts: dict[str, str | float] = {"vehicle": "PX4"}
    told = {"sys_name": "firmware", "ver_hw": "hardware", "ver_sw": "version", "ver_sw_branch": "branch"}
    facts |= {word: log.texts[key] for key, word in told.items() if key in log.texts}
    facts |= {f"parameter {name}": value for name, value in parameters.items() if KEPT.fullmatch(name)}
    return flight_of(path, tables, usual, columns, origin=log.start * SECOND, facts=facts, notes=notes)


def _table(name: str, instance: int, rows: Mapping[str, Array], start: int) -> tuple[str, Table] | None:
    """Topic by its name, with the instance if it is not the first, and its table; None for one without times."""
    if "timestamp" not in rows:
        return None
    given, stamps = dict(rows), rows["timestamp"]
    if "timestamp_sample" in given and name.startswith("vehicle_"):
        late = (stamps - given["timestamp_sample"]) * SECOND
        if ((late >= 0.0) & (late <= LATEST)).all():
            stamps = given["timestamp_sample"]
    time = (stamps - start) * SECOND
    if name == "sensor_combined":
        after = given.get("accelerometer_timestamp_relative", np.zeros_like(time)) * SECOND
        given["accelerometer_time"] = np.where(np.abs(after) <= LATEST, time + after, np.nan)
    return f"{name}[{instance}]" if instance else name, Table(columns=given, time=time)


def _number_of_rotors(parameters: Parameters) -> int:
    """Number of rotors from the parameters of the control allocation, the outputs or the type; 0 if none states it."""
    count = int(parameters.get("CA_ROTOR_COUNT", 0.0))
    if not 0 < count <= MOST_ROTORS:
        count = len(_motor_channels(parameters))
    return count or NUMBER_OF_ROTORS.get(int(parameters.get("MAV_TYPE", 0.0)), 0)


def _motor_channels(parameters: Parameters) -> dict[int, tuple[str, int]]:
    """Bank and channel of each motor, from 0, of firmware whose outputs have functions."""
    found: dict[int, tuple[str, int]] = {}
    for bank in BANKS:
        for channel in range(16):
            motor = int(parameters.get(f"PWM_{bank}_FUNC{channel + 1}", 0.0)) - FIRST_MOTOR
            if 0 <= motor < MOST_ROTORS:
                found.setdefault(motor, (bank, channel))
    return found


def _limit(parameters: Parameters, bank: str, channel: int, which: str, usual: float) -> float | None:
    """Least or largest output of a channel; None where no parameter states it."""
    names = [f"PWM_{bank}_{which}{channel + 1}", f"PWM_{bank}_{which}"]
    if bank == "MAIN":
        names.append(f"PWM_{which}")
    for name in names:
        if parameters.get(name, -1.0) > 0.0:
            return parameters[name]
    return usual if f"PWM_{bank}_FUNC{channel + 1}" in parameters else None


def _rotor_commands(
    tables: dict[str, Table], parameters: Parameters, count: int, notes: list[str]
) -> tuple[Signal, ...]:
    """Signals of the rotors' commands; the table of their shares is added to the tables."""
    if not {"actuator_outputs", "actuator_motors"} & set(tables):
        return ()
    if not count:
        notes.append(
            "rotor_commands: are left out, as no parameter says how many rotors there are; a columns.toml may do so."
        )
        return ()
    found: list[Signal] = []
    channels = _motor_channels(parameters) or {k: ("MAIN", k) for k in range(count)}
    if set(range(count)) <= set(channels) and (shares := _shares(tables, parameters, channels, count, notes)):
        tables[SHARES] = shares
        found.append(Signal(columns=tuple(shares.columns), topic=SHARES))
    if parameters.get("THR_MDL_FAC", 0.0) == 0.0 or not found:
        motors = tuple(f"control[{k}]" for k in range(count))
        if not found and "actuator_motors" in tables and parameters.get("THR_MDL_FAC", 0.0):
            notes.append("rotor_commands: are shares of the thrust, not of the signal, as THR_MDL_FAC is not 0.")
        found.append(Signal(columns=motors, topic="actuator_motors"))
    return tuple(found)


def _shares(
    tables: Mapping[str, Table],
    parameters: Parameters,
    channels: Mapping[int, tuple[str, int]],
    count: int,
    notes: list[str],
) -> Table | None:
    """Table of the rotors' signals, 0 to 1, on the clock of the first rotor's output; None without outputs."""
    columns: dict[str, Array] = {}
    first: Table | None = None
    assumed = False
    for motor in range(count):
        bank, channel = channels[motor]
        topic = "actuator_outputs" if bank == BANKS[0] else "actuator_outputs[1]"
        table = tables.get(topic)
        given = None if table is None else table.column(f"output[{channel}]")
        if table is None or given is None:
            return None
        first = first or table
        low = _limit(parameters, bank, channel, "MIN", LEAST)
        high = _limit(parameters, bank, channel, "MAX", LARGEST)
        assumed |= low is None or high is None
        low, high = LEAST if low is None else low, LARGEST if high is None else high
        if high <= low:
            notes.append(f"rotor_commands: outputs are left out, as their limits are {low:g} and {high:g}.")
            return None
        share = np.maximum(0.0, (given - low) / (high - low))
        if table is not first:
            share = share[np.clip(np.searchsorted(table.time, first.time, "right") - 1, 0, None)]
        columns[f"output {bank} {channel + 1}"] = share
    if assumed:
        notes.append(f"rotor_commands: limits of {LEAST:g} and {LARGEST:g} us are assumed; no parameter states them.")
    return None if first is None else Table(columns=columns, time=first.time)


def _losses(log: Messages) -> list[str]:
    """Notes of what a file has lost."""
    notes = []
    if log.damaged:
        notes.append(f"file: is damaged at {log.damaged} places; messages there are left out.")
    if log.lost:
        notes.append(f"file: the logger lost messages {len(log.lost)} times, for {sum(log.lost)} ms in all.")
    if log.cut:
        notes.append("file: ends within a message; it is cut off.")
    return notes


ULOG = FlightFormat(read_ulog, suffixes=("ulg", "ulog"), begins=(MAGIC,))
