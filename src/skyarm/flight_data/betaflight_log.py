"""Reader of Betaflight's blackbox logs, decoded by the package betaflight-chirp-core (extra ``blackbox``).

Axes are forward, left, up. The signal of a rotor is its output between the numbers ``motorOutput`` of the head, or of
older versions between ``minthrottle`` and ``maxthrottle``. Rotors are in the order of the outputs: rear right, front
right, rear left, front left of a quadrotor as Betaflight ships it. A log holds no pose.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from skyarm.flight_data.columns_file import Columns, QuantitySource
from skyarm.flight_data.flight_data import FlightData, FlightFormat, choose_log
from skyarm.flight_data.raw_tables import RawTable, flight_of
from skyarm.records.files import needs_extra

BEGINNING = b"H Product:Blackbox"
"""First bytes of each log in a file."""

HIGH_RESOLUTION = 10.0
"""Factor on the rates of a log with blackbox_high_resolution."""

PER_MICROSECOND = 1e-3
"""Scale of the gyro (deg/s) below which it is one of rad/us."""

CENTIVOLTS = 100
"""Largest voltage of a cell in the head from which on voltages are in 0.01 V; in 0.1 V before."""


def read_betaflight(path: Path, columns: Columns | None) -> FlightData:
    """Read a blackbox log of Betaflight; of several in a file that of the mapping's number, else the longest.

    Raises:
        ValueError: one line: the decoder is missing, or it is no such file. OSError: it cannot be read.
    """
    data = path.read_bytes()
    try:
        from betaflight_chirp_core.decoder import FlightLogParser, split_sessions
    except ImportError:
        cure = f"{needs_extra('blackbox')}; or decode it by blackbox_decode to .csv, with a columns.toml"
        raise ValueError(f"betaflight-chirp-core: is missing; a log of Betaflight {cure}") from None
    notes = list[str]()
    logs = split_sessions(data) or [(0, len(data))]
    sizes = [end - begin for begin, end in logs]
    place, listed = choose_log([f"{each} bytes" for each in sizes], columns, sizes.index(max(sizes)), notes, "longest")
    log = FlightLogParser(data, *logs[place])
    try:
        log.parse_header()
        log.parse_data()
        head, names = log.sys_config, log.main_field_names
        rows = dict(zip(names, np.array(log.main_frames, float).reshape(-1, len(names)).T, strict=True))
        table = RawTable(columns=rows, time=rows["time"] * 1e-6)
        usual = {name: (each,) for name, each in _sources(table, head, notes).items()}
    except Exception as error:  # of a damaged file, in whichever of its parts
        raise ValueError(f"file: must be a whole blackbox log ({type(error).__name__}: {error})") from None
    if head["firmwareType"] == "inav":
        raise ValueError("firmware: is INAV; decode its log by its own blackbox_decode to .csv, with a columns.toml")
    lost = log.stats["total_corrupt_frames"] + sum(each["desync"] for each in log.stats["frame"].values())
    if lost:
        notes.append(
            f"file: {lost} of {lost + len(log.main_frames)} rows are damaged or follow damage; they are left out."
        )
    facts = {"vehicle": "Betaflight", "firmware": f"{head.get('Firmware revision', 'unknown')}"}
    return flight_of(path, {"": table}, usual, columns, facts={**facts, **listed}, notes=notes)


def _sources(table: RawTable, head: dict[str, Any], notes: list[str]) -> dict[str, QuantitySource]:
    """Sources of the quantities of a blackbox log, with scales by its head."""
    scale = head["gyroScale"] if head["gyroScale"] > PER_MICROSECOND else math.degrees(head["gyroScale"] * 1e6)
    scale /= HIGH_RESOLUTION if head.get("blackbox_high_resolution") else 1.0
    sources = {"gyro": QuantitySource(columns=_entries(table, "gyroADC"), unit="deg/s", scale=scale)}
    forces = _entries(table, "accSmooth")
    if forces and head["acc_1G"] and any(table.numbers(each).any() for each in forces):
        sources["accelerometer"] = QuantitySource(columns=forces, unit="g", scale=1.0 / head["acc_1G"])
    else:
        notes.append("accelerometer: is switched off; set acc_hardware = AUTO and log again.")
    low, high = head["motorOutput"]
    if outputs := _entries(table, "motor"):
        sources["rotor_commands"] = QuantitySource(columns=outputs, low=float(low), high=float(high))
    if speeds := _entries(table, "eRPM"):
        sources["rotor_speeds"] = QuantitySource(columns=speeds, unit="rpm", scale=200.0 / head["motor_poles"])
    if table.has("vbatLatest"):
        volts = 0.01 if head["vbatmaxcellvoltage"] >= CENTIVOLTS else 0.1
        sources["voltage"] = QuantitySource(columns=("vbatLatest",), scale=volts)
    return sources


def _entries(table: RawTable, name: str) -> tuple[str, ...]:
    """Columns of a list of the log: ``gyroADC[0]``, ``gyroADC[1]``, ..."""
    return tuple(each for each in table.columns if each.startswith(f"{name}["))


BETAFLIGHT = FlightFormat(read_betaflight, suffixes=("bbl", "bfl"), begins=(BEGINNING,), several=True)
