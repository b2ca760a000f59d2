"""Reader of Betaflight's blackbox logs, decoded by the package betaflight-chirp-core
(extra ``blackbox``).

Axes are forward, left, up. The signal of a rotor is its output on the scale of its
protocol: ``motorOutput`` of the head is idle and limit of the mixer, within that scale.
Rotors are in the order of the outputs: rear right, front right, rear left, front left
of a quadrotor as Betaflight ships it. A log holds no pose.

Source: Betaflight 2.9 to 2026.6, ``blackbox.c``, ``dshot.h``, ``debug.h``,
``pwm_output.h``; its Blackbox Explorer for voltages.
"""

from __future__ import annotations

import math
import re
from collections.abc import Container, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from skyarm.flight_data.columns_file import Columns, QuantitySource
from skyarm.flight_data.flight_data import FlightData, FlightFormat, choose_log
from skyarm.flight_data.raw_tables import RawTable, flight_of
from skyarm.records.arrays import Array
from skyarm.records.files import needs_extra

BEGINNING = b"H Product:Blackbox"
"""First bytes of each log in a file."""

HIGH_RESOLUTION = 10.0
"""Factor on the rates of a log with blackbox_high_resolution."""

PER_MICROSECOND = 1e-3
"""Scale of the gyro (deg/s) below which it is one of rad/us."""

DSHOT, DIGITAL, ANALOG = range(5, 10), (48.0, 2047.0), (1000.0, 2000.0)
"""``motor_pwm_protocol`` of digital outputs (DShot, ProShot); outputs of no and of full
signal there, and of pulses."""

REVERSIBLE = 1 << 12
"""Bit of ``features`` for motors that turn both ways (3D)."""

UNFILTERED: Mapping[tuple[int, ...], int] = {(3, 1): 3, (3, 2): 8}
"""Version -> ``debug_mode`` that logs the gyro before its filters (deg/s), if it is not
6 (GYRO_SCALED)."""

FILTERS = (
    "gyro_lowpass_hz",
    "gyro_lowpass_dyn_hz",
    "gyro_lowpass2_hz",
    "gyro_notch_hz",
    "gyro_rpm_notch_harmonics",
    "dyn_notch_count",
)
"""Filters of the gyro in the head, by the names that the decoder has for all
versions."""


def read_betaflight(path: Path, columns: Columns | None) -> FlightData:
    """Read a blackbox log of Betaflight; of several in a file that of the mapping's
    number, else the longest.

    Raises:
        ValueError: one line: the decoder is missing, or it is no such file. OSError: it
            cannot be read.
    """
    data = path.read_bytes()
    try:
        from betaflight_chirp_core.decoder import FlightLogParser, split_sessions
    except ImportError:
        cure = (
            f"{needs_extra('blackbox')}; or decode it by blackbox_decode to .csv, with"
            " a columns.toml"
        )
        raise ValueError(
            f"betaflight-chirp-core: is missing; a log of Betaflight {cure}"
        ) from None
    notes = list[str]()
    # without a session all bytes are parsed, so that the error says what is wrong
    logs = split_sessions(data) or [(0, len(data))]
    sizes = [end - begin for begin, end in logs]
    place, listed = choose_log(
        [f"{each} bytes" for each in sizes],
        columns,
        sizes.index(max(sizes)),
        notes,
        "longest",
    )
    log = FlightLogParser(data, *logs[place])
    try:
        log.parse_header()
        log.parse_data()
        head, names = log.sys_config, log.main_field_names
        rows = dict(
            zip(
                names,
                np.array(log.main_frames, float).reshape(-1, len(names)).T,
                strict=True,
            )
        )
        own = (columns or Columns()).signals
        usual = {
            name: (each,) for name, each in _sources(rows, head, own, notes).items()
        }
        table = RawTable(columns=rows, time=rows["time"] * 1e-6)
    except Exception as error:  # of a damaged file, in whichever of its parts
        raise ValueError(
            f"file: must be a whole blackbox log ({type(error).__name__}: {error})"
        ) from None
    if head["firmwareType"] == "inav":
        raise ValueError(
            "firmware: is INAV; decode its log by its own blackbox_decode to .csv, with"
            " a columns.toml"
        )
    lost = log.stats["total_corrupt_frames"] + sum(
        each["desync"] for each in log.stats["frame"].values()
    )
    if lost:
        notes.append(
            f"file: {lost} of {lost + len(log.main_frames)} rows are damaged or follow"
            " damage; they are left out."
        )
    facts = {
        "vehicle": "Betaflight",
        "firmware": f"{head.get('Firmware revision', 'unknown')}",
    }
    return flight_of(
        path, {"": table}, usual, columns, facts={**facts, **listed}, notes=notes
    )


def _sources(
    rows: dict[str, Array],
    head: Mapping[str, Any],
    own: Container[str],
    notes: list[str],
) -> dict[str, QuantitySource]:
    """Sources of the quantities of a blackbox log, with scales by its head.

    Args:
        rows: columns of the log; outputs of stopped motors are raised to those of no
            signal.
        head: its head.
        own: quantities that the user maps, which get no note.
        notes: list for sentences about the channels.
    """
    version = tuple(map(int, (head["firmwareVersion"] or "0.0").split(".")[:2]))
    scale = (
        head["gyroScale"]
        if head["gyroScale"] > PER_MICROSECOND
        else math.degrees(head["gyroScale"] * 1e6)
    )
    scale /= HIGH_RESOLUTION if head.get("blackbox_high_resolution") else 1.0
    # the gyro before its filters is not late, so it goes before all others
    rates = _entries(rows, "gyroUnfilt")
    debug = _entries(rows, "debug")[:3]
    if (
        not rates
        and (3, 1) <= version < (5, 0)
        and head.get("debug_mode") == UNFILTERED.get(version, 6)
    ):
        rates = debug
        scale = 1.0 if debug else scale
    filters = ", ".join(
        f"{each} = {head[each]}" for each in FILTERS if np.any(head.get(each, 0))
    )
    if not rates and "gyro" not in own and (filters or FILTERS[0] not in head):
        words = f"gyro: is filtered ({filters or 'unknown'}) and late"
        notes.append(f"{words}; log gyroUnfilt, or debug_mode = GYRO_SCALED.")
    sources = {
        "gyro": QuantitySource(
            columns=rates or _entries(rows, "gyroADC"), unit="deg/s", scale=scale
        )
    }
    forces = _entries(rows, "accSmooth")
    if forces and head["acc_1G"] and any(rows[each].any() for each in forces):
        sources["accelerometer"] = QuantitySource(
            columns=forces, unit="g", scale=1.0 / head["acc_1G"]
        )
        if head.get("acc_lpf_hz") and "accelerometer" not in own:
            notes.append(
                f"accelerometer: is filtered at {head['acc_lpf_hz'] / 100:g} Hz and"
                " late; raise acc_lpf_hz."
            )
    else:
        notes.append(
            "accelerometer: is switched off; set acc_hardware = AUTO and log again."
        )
    outputs = _entries(rows, "motor")
    if (
        outputs
        and "rotor_commands" not in own
        and int(head.get("features", 0)) & REVERSIBLE
    ):
        notes.append(
            "rotor_commands: are left out, as motors turn both ways (3D); a"
            " columns.toml may map them."
        )
    elif outputs and "rotor_commands" not in own:
        is_digital = head.get("fast_pwm_protocol", 0) in DSHOT
        low, high = DIGITAL if is_digital else ANALOG
        kind = "DShot" if is_digital else "pulses in us"
        stated = head.get("motorOutput") or ANALOG
        # no pulses: of other writers, which state no protocol
        if head.get("fast_pwm_protocol") is None and stated[0] < ANALOG[0]:
            low, high = map(float, stated)
            kind = "motorOutput of a log that states no protocol"
        # of DShot 0 stops a motor
        rows |= {each: np.maximum(rows[each], low) for each in outputs}
        sources["rotor_commands"] = QuantitySource(columns=outputs, low=low, high=high)
        notes.append(
            f"rotor_commands: outputs from {low:g} to {high:g} ({kind}) are signals"
            " from 0 to 1."
        )
    if speeds := _entries(rows, "eRPM"):
        sources["rotor_speeds"] = QuantitySource(
            # logged are hundreds of electrical turns a minute, poles / 2 of which are
            # one turn
            columns=speeds,
            unit="rpm",
            scale=200.0 / head["motor_poles"],
        )
    if "vbatLatest" in rows:
        first = (2, 0) if head["firmwareType"] == "cleanflight" else (3, 1)
        old = version < first and (
            head["firmwareType"]
            or re.fullmatch("[0-9a-f]*", head.get("Firmware revision", ""))
        )
        # hundredths of a volt since 4.0, tenths before, and counts of the converter
        # before 3.1
        volts = 0.01 if version >= (4, 0) else 0.1
        # 3.3 V at 4095 counts, times the divider of vbatscale tenths
        if old:
            volts = 0.33 / 4095 * head["vbatscale"]
        sources["voltage"] = QuantitySource(columns=("vbatLatest",), scale=volts)
    return sources


def _entries(rows: Mapping[str, Array], name: str) -> tuple[str, ...]:
    """Columns of a list of the log: ``gyroADC[0]``, ``gyroADC[1]``, ..."""
    return tuple(each for each in rows if each.startswith(f"{name}["))


BETAFLIGHT = FlightFormat(
    read_betaflight, suffixes=("bbl", "bfl"), begins=(BEGINNING,), several=True
)
