"""Reader of PX4 logs in the ULog format.

Axes of the file are forward, right, down of the base and north, east, down of the
world; they become ours, forward, left, up and north, west, up. The signal of a rotor is
the output of its channel between the parameters of least and largest output, or what
PX4 makes of the thrust that it asks of the motor. Up to 1.13 outputs are those of DShot
where ``DSHOT_CONFIG`` is set; a note has their range. Rates before the filters
(``sensor_combined``) are read unless they come at less than 80 Hz.
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from skyarm.algebra.frames import to_our_axes
from skyarm.flight_data.columns_file import (
    SOURCES,
    Columns,
    QuantitySource,
    usual_signals,
)
from skyarm.flight_data.flight_data import PLACE, FlightData, FlightFormat
from skyarm.flight_data.px4_topics import (
    BOTH_WAYS,
    LATEST,
    by_attitude,
    is_reversible,
    middle_of_mean,
)
from skyarm.flight_data.raw_tables import RawTable, flight_of, rising_rows, valid_rows
from skyarm.flight_data.ulog_recovery import MAGIC, WholeMessages
from skyarm.records.arrays import AnyArray, Array
from skyarm.records.files import needs_extra

Parameters = Mapping[str, float]

SECOND = 1e-6
"""Unit (s) of the stamps."""

NUMBER_OF_ROTORS = {2: 4, 13: 6, 14: 8, 15: 3, 29: 12, 35: 10}
"""MAVLink's type of the vehicle (parameter MAV_TYPE) -> number of rotors."""

FIRST_MOTOR, MOST_ROTORS = 101, 12
"""Function of an output channel that drives the first motor; largest number of motors
of PX4."""

PWM = ("PWM_AUX", "PWM_MAIN")
"""Banks of outputs on the flight controller's own pins: pulse widths (us), or DShot
numbers where a timer says so."""

GAZEBO = "SIM_GZ_EC"
"""Bank of the rotors of a vehicle in Gazebo, in rad/s."""

LIMITS: Mapping[str, tuple[float, float]] = {
    GAZEBO: (0.0, 1000.0),
    "UAVCAN_EC": (1.0, 8191.0),
    **dict.fromkeys(PWM, (1000.0, 2000.0)),
}
"""Bank of outputs -> default outputs of no and of the full signal; where several drive
a motor the last one counts."""

DSHOT, DSHOT_TIMER = 1999, -2.0
"""Full output of DShot; largest ``PWM_*_TIM*`` of a timer that sends it."""

ORDERS: Mapping[float, tuple[int, ...]] = {1.0: (1, 2, 3, 0), 2.0: (0, 2, 3, 1)}
"""MOT_ORDERING (Betaflight, clockwise) of PX4 up to 1.13 -> outputs of its first four
motors."""

KEPT = re.compile(
    r"(SYS_AUTOSTART|MAV_TYPE|THR_MDL_FAC|DSHOT_(MIN|CONFIG)|CA_(ROTOR.*|R_REV)|MOT_ORDERING"
    r"|(PWM_(MAIN_|AUX_)?|UAVCAN_EC_|SIM_GZ_EC_)(MIN|MAX|FUNC|TIM)\d*)"
)
"""Pattern of parameters that are facts of a flight."""

RESETS = {
    "vehicle_attitude": ("quat",),
    "vehicle_local_position": ("xy", "z", "vxy", "vz"),
}
"""Topic -> quantities whose resets by the estimator it counts."""

PLACES = "vehicle_local_position"
"""Topic with flags of its validity."""

OUTPUTS, MOTORS, SHARES = "actuator_outputs", "actuator_motors", "rotor signals"
"""Topics of outputs and of shares of the motors' thrust; table of rotor signals as
fractions, made from outputs and parameters."""


def read_ulog(path: Path, columns: Columns | None) -> FlightData:
    """Read a PX4 log.

    Raises:
        ValueError: one line: pyulog is missing, or it is no such file. OSError: it
            cannot be read.
    """
    whole = WholeMessages(path.read_bytes())
    try:
        from pyulog import ULog
    except ImportError:
        raise ValueError(
            f"pyulog: is missing; a log of PX4 {needs_extra('flights')}"
        ) from None
    # pyulog does not return from some damaged files, so it gets the intact messages
    log = ULog(io.BytesIO(whole.found))
    start = int(log.start_timestamp)
    tables = {
        f"{each.name}[{each.multi_id}]" if each.multi_id else each.name: _table(
            each.name, each.data, start
        )
        for each in log.data_list
    }
    if {"sensor_combined", "vehicle_attitude"} <= set(tables):
        tables["sensor_combined"] = by_attitude(
            tables["sensor_combined"], tables["vehicle_attitude"]
        )
    if not tables:
        raise ValueError(
            "file: holds no topic with numbers; nothing was logged, or it is cut off"
        )
    parameters = {name: float(value) for name, value in log.initial_parameters.items()}
    notes = _losses(whole, [each.duration for each in log.dropouts])
    if PLACES in tables:
        tables[PLACES] = valid_rows(PLACES, tables[PLACES], notes)
    usual: dict[str, Sequence[QuantitySource]] = dict(usual_signals(SOURCES["px4"]))
    own = (columns or Columns()).signals
    count = _number_of_rotors(parameters)
    if "rotor_commands" not in own:
        usual["rotor_commands"] = _rotor_commands(tables, parameters, count, notes)
    if count and "rotor_speeds" not in own:
        usual["rotor_speeds"] = _rotor_speeds(tables, parameters, count)
    facts: dict[str, str | float] = {"vehicle": "PX4"}
    names = {
        "sys_name": "firmware",
        "ver_hw": "hardware",
        "ver_sw": "version",
        "ver_sw_branch": "branch",
    }
    facts |= {
        fact: log.msg_info_dict[key]
        for key, fact in names.items()
        if key in log.msg_info_dict
    }
    facts |= _place(parameters)
    facts |= {
        f"parameter {name}": value
        for name, value in parameters.items()
        if KEPT.fullmatch(name)
    }
    flight = flight_of(
        path, tables, usual, columns, origin=start * SECOND, facts=facts, notes=notes
    )
    return _with_resets(flight, tables, float(flight.facts["start"]) - start * SECOND)


def _with_resets(
    flight: FlightData, tables: Mapping[str, RawTable], begin: float
) -> FlightData:
    """Flight with the steps in which the estimator reset attitude, position or
    velocity; its time 0 is at ``begin``.
    """
    spans = set[tuple[float, float]]()
    for topic, names in RESETS.items():
        for column in (f"{name}_reset_counter" for name in names):
            if topic in tables and tables[topic].has(column):
                time = tables[topic].time - begin
                spans |= {
                    (time[row], time[row + 1])
                    for row in np.flatnonzero(np.diff(tables[topic].numbers(column)))
                }
    return flight.with_jumps(spans) if spans else flight


def _table(name: str, rows: Mapping[str, AnyArray], start: int) -> RawTable:
    """Numeric table of a PX4 topic, with the sampling times of its messages if they
    state plausible ones.
    """
    with np.errstate(invalid="ignore"):  # NaNs of a damaged file that signal
        columns = {field: numbers.astype(float) for field, numbers in rows.items()}
    stamps = columns["timestamp"]
    if "timestamp_sample" in columns and name.startswith("vehicle_"):
        late = (stamps - columns["timestamp_sample"]) * SECOND
        if ((late >= 0.0) & (late <= LATEST)).all():
            stamps = columns["timestamp_sample"]
    if name == "sensor_combined":
        columns["accelerometer_time"] = (
            stamps + middle_of_mean(columns, "accelerometer")
        ) * SECOND
        # a sample without a span stays at its stamp
        stamps = stamps + np.nan_to_num(middle_of_mean(columns, "gyro"))
    return RawTable(
        columns=columns, time=(stamps - start) * SECOND, origin=start * SECOND
    )


def _place(parameters: Parameters) -> dict[str, float]:
    """Place (m) of the inertial unit by the parameters EKF2_IMU_POS_X, Y, Z (front,
    right, down), unless all are 0.
    """
    x, y, z = (parameters.get(f"EKF2_IMU_POS_{axis}", 0.0) for axis in "XYZ")
    return dict(zip(PLACE, to_our_axes(x, y, z), strict=True)) if x or y or z else {}


def _number_of_rotors(parameters: Parameters) -> int:
    """Number of rotors from PX4's parameters (control allocation, outputs or vehicle
    type); 0 if unknown.
    """
    count = int(parameters.get("CA_ROTOR_COUNT", 0.0))
    if not 0 < count <= MOST_ROTORS:
        count = len(_motor_channels(parameters))
    return count or NUMBER_OF_ROTORS.get(int(parameters.get("MAV_TYPE", 0.0)), 0)


def _motor_channels(parameters: Parameters) -> dict[int, tuple[str, int]]:
    """Output bank and channel of each motor, from PX4's output-function parameters; the
    first if there are several.
    """
    # later entries of the dict below win, so channels run backwards
    places = [(bank, channel) for bank in LIMITS for channel in reversed(range(16))]
    motors = [
        int(parameters.get(f"{bank}_FUNC{channel + 1}", 0.0)) - FIRST_MOTOR
        for bank, channel in places
    ]
    return {
        motor: place
        for motor, place in zip(motors, places, strict=True)
        if 0 <= motor < MOST_ROTORS
    }


def _limits(
    parameters: Parameters, bank: str, channel: int
) -> tuple[float, float, bool]:
    """Outputs of no and of the full signal of a PX4 output channel, and whether
    parameters state them.
    """
    if bank in PWM and any(
        name.startswith(f"{bank}_TIM") and timer <= DSHOT_TIMER
        for name, timer in parameters.items()
    ):
        # the least output is a whole number; 0.055 is PX4's own value where the log has
        # none
        return (
            float(int(DSHOT * parameters.get("DSHOT_MIN", 0.055))),
            float(DSHOT),
            True,
        )
    found = list[float]()
    stated = True
    for which, usual in zip(("MIN", "MAX"), LIMITS[bank], strict=True):
        # older versions of PX4 state one range for all main outputs
        every = [
            f"{bank}_{which}{channel + 1}",
            f"{bank}_{which}",
            *([f"PWM_{which}"] if bank == PWM[1] else []),
        ]
        # -1 and 0 stand for what the next parameter states
        given = next(
            (parameters[name] for name in every if parameters.get(name, -1.0) > 0.0),
            None,
        )
        stated &= given is not None or f"{bank}_FUNC{channel + 1}" in parameters
        found.append(usual if given is None else given)
    return found[0], found[1], stated


def _rotor_commands(
    tables: dict[str, RawTable], parameters: Parameters, count: int, notes: list[str]
) -> tuple[QuantitySource, ...]:
    """Sources of the rotor commands in a PX4 log; the rotors' signals (0 to 1) are
    added to ``tables``.

    Outputs on the controller's pins whose limits are stated are what the motors
    received. Else the shares of thrust come first, which need no limits:
    ``THR_MDL_FAC`` makes signals of them.
    """
    if not {OUTPUTS, MOTORS} & set(tables):
        return ()
    if not count:
        notes.append(
            "rotor_commands: are left out, as no parameter says how many rotors there"
            " are; a columns.toml may do so."
        )
        return ()
    signals = list[QuantitySource]()
    has_motors = MOTORS in tables
    if parameters.get("CA_R_REV", 0.0) or (
        has_motors and is_reversible(tables[MOTORS])
    ):
        notes.append(BOTH_WAYS)
        return ()
    if has_motors:
        topic, tables[topic] = _motor_signals(
            tables[MOTORS], parameters.get("THR_MDL_FAC", 0.0), count
        )
        signals.append(
            QuantitySource(
                columns=tuple(f"control[{k}]" for k in range(count)), topic=topic
            )
        )
    # why outputs do not count is news only where nothing else tells the commands
    shares, is_sure = _shares(tables, parameters, count, [] if has_motors else notes)
    if shares is not None:
        tables[SHARES] = shares
        signals.insert(
            0 if is_sure else 1,
            QuantitySource(columns=tuple(shares.columns), topic=SHARES),
        )
    return tuple(signals)


def _motor_signals(table: RawTable, factor: float, count: int) -> tuple[str, RawTable]:
    """Name and table of the signals whose thrusts are the given shares; a motor that is
    stopped has none.

    PX4 v1.17, output functions of motors: thrust = factor x signal^2 + (1 - factor) x
    signal.
    """
    columns = dict(table.columns)
    for name in (f"control[{k}]" for k in range(count)):
        share = np.maximum(
            np.nan_to_num(columns.get(name, np.full(table.time.size, np.nan))), 0.0
        )
        # the signal is the positive root of the equation above
        linear = 1.0 - factor
        columns[name] = (
            (np.sqrt(linear**2 + 4.0 * factor * share) - linear) / (2.0 * factor)
            if factor
            else share
        )
    return f"{MOTORS} by THR_MDL_FAC" if factor else MOTORS, replace(
        table, columns=columns
    )


def _rotor_speeds(
    tables: dict[str, RawTable], parameters: Parameters, count: int
) -> tuple[QuantitySource, ...]:
    """Sources of the speeds that the motor controllers report, in the order of the
    motors that they drive.
    """
    table = tables.get("esc_status")
    if table is None:
        return ()
    order = [*range(count)]
    functions = [f"esc[{k}].actuator_function" for k in range(MOST_ROTORS)]
    motors = [
        int(np.median(table.numbers(each))) - FIRST_MOTOR if table.has(each) else -1
        for each in functions
    ]
    if {*order} <= {*motors}:
        order = [motors.index(motor) for motor in order]
    columns = tuple(f"esc[{k}].esc_rpm" for k in order)
    if not table.has(*columns) or not any(
        np.nan_to_num(table.numbers(each)).any() for each in columns
    ):
        return ()  # no controller reports
    speeds = dict[str, Array]()
    for name in columns:
        # each report has a time of its own, or none: that of the message
        stamps = (
            table.columns.get(name.replace("esc_rpm", "timestamp"), np.zeros(1))
            * SECOND
            - table.origin
        )
        stamps = np.where(np.abs(table.time - stamps) <= LATEST, stamps, table.time)
        rows = rising_rows(stamps)
        speeds[name] = np.interp(table.time, stamps[rows], table.numbers(name)[rows])
    tables["esc_status"] = replace(table, columns={**table.columns, **speeds})
    in_gazebo = any(bank == GAZEBO for bank, _ in _motor_channels(parameters).values())
    return (
        QuantitySource(
            columns=columns, topic="esc_status", unit="rad/s" if in_gazebo else "rpm"
        ),
    )


def _shares(
    tables: Mapping[str, RawTable], parameters: Parameters, count: int, notes: list[str]
) -> tuple[RawTable | None, bool]:
    """Table of rotor signals (0 to 1) on the clock of the first rotor's output; None
    without outputs.

    It is sure if the outputs are pulse widths between stated limits.
    """
    channels = _motor_channels(parameters)
    # PX4 up to 1.13 knows no functions of outputs; beside outputs of the controller
    # those of an IO chip are pulses
    has_chip = parameters.get("SYS_USE_IO", 0.0) and f"{OUTPUTS}[1]" in tables
    if not channels and parameters.get("DSHOT_CONFIG", 0.0) > 0.0 and not has_chip:
        parameters = {**parameters, f"{PWM[1]}_TIM": DSHOT_TIMER}
        low, high, _ = _limits(parameters, PWM[1], 0)
        notes.append(
            f"rotor_commands: outputs of {low:g} to {high:g} are assumed, of DShot, as"
            " DSHOT_CONFIG states it."
        )
    order = ORDERS.get(parameters.get("MOT_ORDERING", 0.0), ())
    channels = channels or {k: (PWM[1], k) for k in range(count)} | {
        k: (PWM[1], at) for k, at in enumerate(order)
    }
    columns: dict[str, Array] = {}
    assumed = False
    is_sure = True
    time = np.zeros(0)
    for motor in range(count):
        # a motor without a channel gets one that no table has
        bank, channel = channels.get(motor, (PWM[1], MOST_ROTORS * 2))
        low, high, stated = _limits(parameters, bank, channel)
        table = _outputs(tables, bank, f"output[{channel}]", low, high, notes)
        if table is None:
            return None, False
        assumed |= not stated
        is_sure &= stated and bank in PWM and high != DSHOT
        if high <= low:
            notes.append(
                f"rotor_commands: outputs are left out, as their limits are {low:g} and"
                f" {high:g}."
            )
            return None, False
        share = np.maximum(
            0.0, (table.numbers(f"output[{channel}]") - low) / (high - low)
        )
        # outputs of another bank are taken as they were held at the first one's times
        time = time if columns else table.time
        if table.time is not time:
            share = share[np.maximum(np.searchsorted(table.time, time, "right") - 1, 0)]
        columns[f"output {bank.removeprefix('PWM_')} {channel + 1}"] = share
    if assumed:
        notes.append(
            f"rotor_commands: limits of {low:g} and {high:g} us are assumed; no"
            " parameter states them."
        )
    return RawTable(columns=columns, time=time), is_sure


def _outputs(
    tables: Mapping[str, RawTable],
    bank: str,
    column: str,
    low: float,
    high: float,
    notes: list[str],
) -> RawTable | None:
    """Table with the outputs of a bank: of a driver beside the pins' the only one
    within its limits.
    """
    if bank in PWM:
        table = tables.get(OUTPUTS if bank == PWM[1] else f"{OUTPUTS}[1]")
        return table if table is not None and table.has(column) else None
    found = dict[str, RawTable]()
    for name, each in tables.items():
        if name.startswith(OUTPUTS) and each.has(column):
            sent = each.numbers(column)[each.numbers(column) > 0.0]
            # within 1 of the limits, as outputs are whole numbers
            if sent.size and sent.min() >= low - 1.0 and sent.max() <= high + 1.0:
                found[name] = each
    if len(found) > 1:  # pulse widths lie within the limits of UAVCAN, too
        notes.append(
            f"rotor_commands: {' or '.join(found)} may be that of {bank}; a"
            " columns.toml may name one."
        )
        return None
    return next(iter(found.values()), None)


def _losses(whole: WholeMessages, lost: Sequence[int]) -> list[str]:
    """Notes on the losses of a file: damage, messages dropped by the logger (ms),
    truncation.
    """
    notes = []
    if whole.damaged:
        notes.append(
            f"file: is damaged at {whole.damaged} places; messages there are left out."
        )
    if lost:
        notes.append(
            f"file: the logger lost messages {len(lost)} times, for {sum(lost)} ms in"
            " all."
        )
    if whole.cut:
        notes.append("file: ends within a message; it is cut off.")
    return notes


ULOG = FlightFormat(read_ulog, suffixes=("ulg", "ulog"), begins=(MAGIC,))
