"""Reader of PX4 logs in the ULog format.

Axes of the file are forward, right, down of the base and north, east, down of the world; they become ours, forward,
left, up and north, west, up. The signal of a rotor is the output of its channel between the parameters of least and
largest output.
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from skyarm.algebra.frames import to_our_axes
from skyarm.flight_data.columns_file import SOURCES, Columns, QuantitySource, usual_signals
from skyarm.flight_data.flight_data import PLACE, FlightData, FlightFormat
from skyarm.flight_data.raw_tables import RawTable, flight_of
from skyarm.flight_data.ulog_recovery import MAGIC, WholeMessages
from skyarm.records.arrays import AnyArray, Array
from skyarm.records.files import needs_extra

Parameters = Mapping[str, float]

SECOND = 1e-6
"""Unit (s) of the stamps."""

LATEST = 0.1
"""Largest delay (s) from a sample to its message for which the sample's own stamp counts."""

NUMBER_OF_ROTORS = {2: 4, 13: 6, 14: 8, 15: 3, 29: 12, 35: 10}
"""MAVLink's type of the vehicle (parameter MAV_TYPE) -> number of rotors."""

FIRST_MOTOR, MOST_ROTORS = 101, 12
"""Function of an output channel that drives the first motor; largest number of motors of PX4."""

USUAL_LIMITS = {"MIN": 1000.0, "MAX": 2000.0}
"""Default outputs (us) of zero and of full signal."""

KEPT = re.compile(r"(SYS_AUTOSTART|MAV_TYPE|THR_MDL_FAC|CA_ROTOR.*|PWM_(MAIN_|AUX_)?(MIN|MAX|FUNC)\d*)")
"""Pattern of parameters that are facts of a flight."""

RESETS = {"vehicle_attitude": ("quat",), "vehicle_local_position": ("xy", "z", "vxy", "vz")}
"""Topic -> quantities whose resets by the estimator it counts."""

SHARES = "rotor signals"
"""Name of the table of rotor signals as fractions, made from outputs and parameters."""


def read_ulog(path: Path, columns: Columns | None) -> FlightData:
    """Read a PX4 log.

    Raises:
        ValueError: one line: pyulog is missing, or it is no such file. OSError: it cannot be read.
    """
    whole = WholeMessages(path.read_bytes())
    try:
        from pyulog import ULog
    except ImportError:
        raise ValueError(f"pyulog: is missing; a log of PX4 {needs_extra('flights')}") from None
    log = ULog(io.BytesIO(whole.found))
    start = int(log.start_timestamp)
    tables = {
        f"{each.name}[{each.multi_id}]" if each.multi_id else each.name: _table(each.name, each.data, start)
        for each in log.data_list
    }
    if not tables:
        raise ValueError("file: holds no topic with numbers")
    parameters = {name: float(value) for name, value in log.initial_parameters.items()}
    notes = _losses(whole, [each.duration for each in log.dropouts])
    usual: dict[str, Sequence[QuantitySource]] = dict(usual_signals(SOURCES["px4"]))
    own = {} if columns is None else columns.signals
    count = _number_of_rotors(parameters)
    if "rotor_commands" not in own:
        usual["rotor_commands"] = _rotor_commands(tables, parameters, count, notes)
    if count and "rotor_speeds" not in own:
        speeds = tuple(f"esc[{k}].esc_rpm" for k in range(count))
        usual["rotor_speeds"] = (QuantitySource(columns=speeds, topic="esc_status", unit="rpm"),)
    facts: dict[str, str | float] = {"vehicle": "PX4"}
    names = {"sys_name": "firmware", "ver_hw": "hardware", "ver_sw": "version", "ver_sw_branch": "branch"}
    facts |= {word: log.msg_info_dict[key] for key, word in names.items() if key in log.msg_info_dict}
    facts |= _place(parameters)
    facts |= {f"parameter {name}": value for name, value in parameters.items() if KEPT.fullmatch(name)}
    flight = flight_of(path, tables, usual, columns, origin=start * SECOND, facts=facts, notes=notes)
    return _with_resets(flight, tables, float(flight.facts["start"]) - start * SECOND)


def _with_resets(flight: FlightData, tables: Mapping[str, RawTable], begin: float) -> FlightData:
    """Flight with the steps in which the estimator reset attitude, position or velocity; its time 0 is at ``begin``."""
    spans = set[tuple[float, float]]()
    for topic, names in RESETS.items():
        for column in (f"{name}_reset_counter" for name in names):
            if topic in tables and tables[topic].has(column):
                time = tables[topic].time - begin
                spans |= {(time[row], time[row + 1]) for row in np.flatnonzero(np.diff(tables[topic].numbers(column)))}
    if not spans:
        return flight
    when = ", ".join(f"{end:.2f}" for _, end in sorted(spans))
    words = f"pose: the estimator reset it at {when} s; nothing is compared across that."
    return replace(flight, jumps=tuple(sorted(spans)), notes=(*flight.notes, words))


def _table(name: str, rows: Mapping[str, AnyArray], start: int) -> RawTable:
    """Numeric table of a PX4 topic, with the sampling times of its messages if they state plausible ones."""
    with np.errstate(invalid="ignore"):  # NaNs of a damaged file that signal
        columns = {field: numbers.astype(float) for field, numbers in rows.items()}
    stamps = columns["timestamp"]
    if "timestamp_sample" in columns and name.startswith("vehicle_"):
        late = (stamps - columns["timestamp_sample"]) * SECOND
        if ((late >= 0.0) & (late <= LATEST)).all():
            stamps = columns["timestamp_sample"]
    time = (stamps - start) * SECOND
    if name == "sensor_combined":
        after = columns.get("accelerometer_timestamp_relative", np.zeros_like(time)) * SECOND
        columns["accelerometer_time"] = np.where(np.abs(after) <= LATEST, time + after, np.nan)
    return RawTable(columns=columns, time=time)


def _place(parameters: Parameters) -> dict[str, float]:
    """Place (m) of the inertial unit by the parameters EKF2_IMU_POS_X, Y, Z (front, right, down), unless all are 0."""
    x, y, z = (parameters.get(f"EKF2_IMU_POS_{axis}", 0.0) for axis in "XYZ")
    return dict(zip(PLACE, to_our_axes(x, y, z), strict=True)) if x or y or z else {}


def _number_of_rotors(parameters: Parameters) -> int:
    """Number of rotors from PX4's parameters (control allocation, outputs or vehicle type); 0 if unknown."""
    count = int(parameters.get("CA_ROTOR_COUNT", 0.0))
    if not 0 < count <= MOST_ROTORS:
        count = len(_motor_channels(parameters))
    return count or NUMBER_OF_ROTORS.get(int(parameters.get("MAV_TYPE", 0.0)), 0)


def _motor_channels(parameters: Parameters) -> dict[int, tuple[str, int]]:
    """Output bank and channel of each motor, from PX4's output-function parameters; the first if there are several."""
    places = [(bank, channel) for bank in ("AUX", "MAIN") for channel in reversed(range(16))]
    motors = [int(parameters.get(f"PWM_{bank}_FUNC{channel + 1}", 0.0)) - FIRST_MOTOR for bank, channel in places]
    return {motor: place for motor, place in zip(motors, places, strict=True) if 0 <= motor < MOST_ROTORS}


def _limit(parameters: Parameters, bank: str, channel: int, which: str) -> float | None:
    """Minimum or maximum output of a PX4 output channel; None if no parameter states it."""
    every = [f"PWM_{bank}_{which}{channel + 1}", f"PWM_{bank}_{which}", *([f"PWM_{which}"] if bank == "MAIN" else [])]
    usual = USUAL_LIMITS[which] if f"PWM_{bank}_FUNC{channel + 1}" in parameters else None
    return next((parameters[name] for name in every if parameters.get(name, -1.0) > 0.0), usual)


def _rotor_commands(
    tables: dict[str, RawTable], parameters: Parameters, count: int, notes: list[str]
) -> tuple[QuantitySource, ...]:
    """Sources of the rotor commands in a PX4 log; the rotors' outputs (0 to 1) are added to ``tables``."""
    if not {"actuator_outputs", "actuator_motors"} & set(tables):
        return ()
    if not count:
        notes.append(
            "rotor_commands: are left out, as no parameter says how many rotors there are; a columns.toml may do so."
        )
        return ()
    signals: list[QuantitySource] = []
    if shares := _shares(tables, parameters, count, notes):
        tables[SHARES] = shares
        signals.append(QuantitySource(columns=tuple(shares.columns), topic=SHARES))
    of_thrust = parameters.get("THR_MDL_FAC", 0.0) != 0.0
    if not signals and of_thrust and "actuator_motors" in tables:
        notes.append("rotor_commands: are shares of the thrust, not of the signal, as THR_MDL_FAC is not 0.")
    if not signals or not of_thrust:
        signals.append(QuantitySource(columns=tuple(f"control[{k}]" for k in range(count)), topic="actuator_motors"))
    return tuple(signals)


def _shares(tables: Mapping[str, RawTable], parameters: Parameters, count: int, notes: list[str]) -> RawTable | None:
    """Table of rotor signals (0 to 1) on the clock of the first rotor's output; None without outputs."""
    channels = _motor_channels(parameters) or {k: ("MAIN", k) for k in range(count)}
    columns: dict[str, Array] = {}
    assumed, time = False, np.zeros(0)
    for motor in range(count):
        bank, channel = channels.get(motor, ("", 0))
        table = tables.get({"MAIN": "actuator_outputs", "AUX": "actuator_outputs[1]"}.get(bank, ""))
        if table is None or not table.has(f"output[{channel}]"):
            return None
        limits = [_limit(parameters, bank, channel, which) for which in USUAL_LIMITS]
        assumed |= None in limits
        low, high = (usual if each is None else each for each, usual in zip(limits, USUAL_LIMITS.values(), strict=True))
        if high <= low:
            notes.append(f"rotor_commands: outputs are left out, as their limits are {low:g} and {high:g}.")
            return None
        share = np.maximum(0.0, (table.numbers(f"output[{channel}]") - low) / (high - low))
        time = time if columns else table.time
        if table.time is not time:
            share = share[np.maximum(np.searchsorted(table.time, time, "right") - 1, 0)]
        columns[f"output {bank} {channel + 1}"] = share
    if assumed:
        low, high = USUAL_LIMITS.values()
        notes.append(f"rotor_commands: limits of {low:g} and {high:g} us are assumed; no parameter states them.")
    return RawTable(columns=columns, time=time)


def _losses(whole: WholeMessages, lost: Sequence[int]) -> list[str]:
    """Notes on the losses of a file: damage, messages dropped by the logger (ms), truncation."""
    notes = []
    if whole.damaged:
        notes.append(f"file: is damaged at {whole.damaged} places; messages there are left out.")
    if lost:
        notes.append(f"file: the logger lost messages {len(lost)} times, for {sum(lost)} ms in all.")
    if whole.cut:
        notes.append("file: ends within a message; it is cut off.")
    return notes


ULOG = FlightFormat(read_ulog, suffixes=("ulg", "ulog"), begins=(MAGIC,))
