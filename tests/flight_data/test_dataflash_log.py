"""DataFlash logs of ArduPilot, written byte by byte and read beside pymavlink."""

from __future__ import annotations

import re
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skyarm.flight_data.columns_file import columns_from
from skyarm.flight_data.flight_data import FlightData, load_flight

DFReader = pytest.importorskip("pymavlink.DFReader")

CODES = dict(
    zip(
        "BhHiIfQcCnNZL",
        ["B", "h", "H", "i", "I", "f", "Q", "h", "H", "4s", "16s", "64s", "i"],
        strict=True,
    )
)
AXES = ("GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ")
OUTPUTS = {
    **{f"SERVO{k}_FUNCTION": 32.0 + k for k in range(1, 5)},
    "MOT_PWM_MIN": 1100.0,
    "MOT_PWM_MAX": 1900.0,
}


class Writer:
    """Bytes of a DataFlash log: types are defined as they come."""

    def __init__(self, **types: tuple[str, str]) -> None:
        self.types = {
            name: (128 + k, *each)
            for k, (name, each) in enumerate({"FMT": ("BBnNZ", ""), **types}.items())
        }
        self.data = b"".join(
            b"\xa3\x95\x80"
            + struct.pack(
                "<BB4s16s64s",
                number,
                3 + self.size(letters),
                name.encode(),
                letters.encode(),
                fields.encode(),
            )
            for name, (number, letters, fields) in self.types.items()
        )

    def size(self, letters: str) -> int:
        return struct.calcsize("<" + "".join(CODES[each] for each in letters))

    def put(self, name: str, *values: Any) -> None:
        number, letters, _ = self.types[name]
        self.data += b"\xa3\x95" + struct.pack(
            "<B" + "".join(CODES[each] for each in letters), number, *values
        )


def recent(
    parameters: dict[str, float],
    outputs: tuple[int, ...] = (1500, 1100, 1900, 1300, 0, 0),
) -> bytes:
    """Log of ArduPilot 4: stamps in us, two inertial units in one message."""
    noise = np.random.default_rng(0)
    log = Writer(
        MSG=("QZ", "TimeUS,Message"),
        PARM=("QNf", "TimeUS,Name,Value"),
        STRT=("", ""),
        IMU=("QBffffff", f"TimeUS,I,{','.join(AXES)}"),
        RCOU=("QHHHHHH", "TimeUS,C1,C2,C3,C4,C5,C6"),
        XKQ=("QBffff", "TimeUS,C,Q1,Q2,Q3,Q4"),
        XKF1=("QBffffff", "TimeUS,C,VN,VE,VD,PN,PE,PD"),
        BAT=("QBf", "TimeUS,Inst,Volt"),
        PIDR=("Qf", "TimeUS,I"),
    )
    log.put("MSG", 0, b"ArduCopter V4.5.0 (0)")
    for name, value in parameters.items():
        log.put("PARM", 0, name.encode(), value)
    log.put("STRT")
    for k in range(60):
        stamp = 61_500_000 + 10_000 * k
        for unit in range(2):
            log.put("IMU", stamp, unit, *noise.normal(size=6))
        log.put("RCOU", stamp + 100, *(each + k if each else 0 for each in outputs))
        log.put("XKQ", stamp + 200, 0, *noise.normal(size=4))
        log.put("XKQ", stamp + 200, 1, 1, 0, 0, 0)
        log.put("XKF1", stamp + 300, 0, *noise.normal(size=6))
        log.put("BAT", stamp + 400, 0, 12.5)
        log.put("PIDR", stamp + 500, noise.normal())
    return log.data


def old(
    parameters: dict[str, float],
    outputs: tuple[int, ...] = (1500, 1500, 1500, 1500, -3),
) -> bytes:
    """Log of ArduPilot 3: stamps in ms, a message for each inertial unit, angles in
    hundredths of a degree.
    """
    noise = np.random.default_rng(1)
    log = Writer(
        PARM=("Nf", "Name,Value"),
        IMU=("Iffffff", f"TimeMS,{','.join(AXES)}"),
        IMU2=("Iffffff", f"TimeMS,{','.join(AXES)}"),
        RCOU=("Ihhhhh", "TimeMS,Ch1,Ch2,Ch3,Ch4,Ch5"),
        ATT=("IccC", "TimeMS,Roll,Pitch,Yaw"),
        CURR=("Ih", "TimeMS,Volt"),
    )
    for name, value in parameters.items():
        log.put("PARM", name.encode(), value)
    for k in range(60):
        for unit in ("IMU", "IMU2"):
            log.put(unit, 61_500 + 20 * k, *noise.normal(size=6))
        log.put("RCOU", 61_501 + 20 * k, *(each + 5 * (k % 3) for each in outputs))
        log.put("ATT", 61_502 + 20 * k, 1000, -2000, 30000)
        log.put("CURR", 61_503 + 20 * k, 1245)
    return log.data


def read(folder: Path, data: bytes) -> FlightData:
    (folder / "flight.BIN").write_bytes(data)
    return load_flight(folder / "flight.BIN")


def decoded(folder: Path, name: str, *fields: str, instance: int = 0) -> np.ndarray:
    """Time and numbers of a message's fields, as pymavlink reads them."""
    log, rows = DFReader.DFReader_binary(str(folder / "flight.BIN")), []
    while (message := log.recv_match(type=name)) is not None:
        row = message.to_dict()
        if row.get("I", row.get("C", instance)) == instance:
            stamp = row["TimeUS"] * 1e-6 if "TimeUS" in row else row["TimeMS"] * 1e-3
            rows.append([stamp, *(row[field] for field in fields)])
    log.data_map.close()
    log.filehandle.close()
    return np.array(rows)


TURN = np.array([1.0, -1.0, -1.0])
"""Factors from forward, right, down to forward, left, up."""


@pytest.mark.parametrize("make", [recent, old])
def test_the_readings_are_those_that_pymavlink_reads(tmp_path: Path, make: Any) -> None:
    found = read(tmp_path, make(OUTPUTS))
    start = found.facts["start"]
    for name, fields in (("gyro", AXES[:3]), ("accelerometer", AXES[3:])):
        rows = decoded(tmp_path, "IMU", *fields)
        np.testing.assert_allclose(found[name].time + start, rows[:, 0], atol=1e-9)
        np.testing.assert_array_equal(found[name].values, rows[:, 1:] * TURN)
    assert found["gyro"].rate == pytest.approx(100.0 if make is recent else 50.0)
    assert found["voltage"].values[0, 0] == pytest.approx(
        12.5 if make is recent else 12.45
    )


def test_the_pose_is_that_of_the_filter_and_outputs_are_shares_of_their_range(
    tmp_path: Path,
) -> None:
    found = read(
        tmp_path,
        recent(OUTPUTS | {"INS_POS1_X": 0.1, "INS_POS1_Y": 0.02, "INS_POS1_Z": -0.03}),
    )
    rows = decoded(tmp_path, "XKF1", "PN", "PE", "PD", "VN", "VE", "VD")
    np.testing.assert_array_equal(found["position"].values, rows[:, 1:4] * TURN)
    np.testing.assert_array_equal(found["velocity"].values, rows[:, 4:] * TURN)
    q = decoded(tmp_path, "XKQ", "Q1", "Q2", "Q3", "Q4")[:, 1:] * [1.0, 1.0, -1.0, -1.0]
    q /= np.linalg.norm(q, axis=1)[:, None]
    np.testing.assert_allclose(
        np.abs(np.sum(found["quaternion"].values * q, axis=1)), 1.0, atol=1e-12
    )
    rows = decoded(tmp_path, "RCOU", "C1", "C2", "C3", "C4")
    np.testing.assert_allclose(
        found["rotor_commands"].values, (rows[:, 1:] - 1100.0) / 800.0
    )
    assert found.place == {
        "place.x": pytest.approx(0.1),
        "place.y": pytest.approx(-0.02),
        "place.z": pytest.approx(0.03),
    }
    assert found.facts["firmware"] == "ArduCopter V4.5.0 (0)"


def test_angles_of_an_old_log_are_those_of_its_hundredths_of_a_degree(
    tmp_path: Path,
) -> None:
    """Roll 10, pitch -20, yaw 300 degrees of forward, right, down in north, east, down:
    pitch and yaw turn about.
    """
    rotation = pytest.importorskip("scipy.spatial.transform").Rotation
    found = read(tmp_path, old({}))["quaternion"].values[0]
    wanted = rotation.from_euler("ZYX", [-300.0, 20.0, 10.0], degrees=True).as_quat()
    assert abs(found @ wanted[[3, 0, 1, 2]]) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(
    ("parameters", "first", "count", "note"),
    [
        ({"RC3_MIN": 1000.0, "RC3_MAX": 1800.0}, 0.625, 4, "4 rotors are assumed"),
        (
            {
                "RC3_MIN": 1000.0,
                "RC3_MAX": 1800.0,
                "MOT_PWM_MIN": 0.0,
                "MOT_PWM_MAX": 0.0,
            },
            0.625,
            4,
            "4 rotors",
        ),
        (
            {
                "RCMAP_THROTTLE": 2.0,
                "RC3_MIN": 1.0,
                "RC3_MAX": 2.0,
                "RC2_MIN": 1300.0,
                "RC2_MAX": 1700.0,
            },
            0.5,
            4,
            "4 ro",
        ),
        (OUTPUTS | {"MOT_PWM_TYPE": 6.0, "MOT_PWM_MIN": 1200.0}, 0.5, 4, ""),
        (
            OUTPUTS
            | {
                f"SERVO{k}_FUNCTION": f
                for k, f in ((1, 34.0), (2, 33.0), (3, 70.0), (4, 0.0))
            },
            0.5,
            2,
            "",
        ),
        (
            OUTPUTS
            | {
                "FRAME_CLASS": 7.0,
                "SERVO3_FUNCTION": 36.0,
                "SERVO4_FUNCTION": 39.0,
            },
            0.5,
            3,
            "",
        ),
        (
            OUTPUTS
            | {
                "Q_FRAME_CLASS": 7.0,
                "SERVO3_FUNCTION": 36.0,
                "SERVO4_FUNCTION": 39.0,
            },
            0.5,
            3,
            "",
        ),
        (
            OUTPUTS
            | {
                "FRAME_CLASS": 9.0,
                "SERVO1_FUNCTION": 38.0,
                "SERVO2_FUNCTION": 37.0,
            },
            0.5,
            2,
            "",
        ),
        (
            {k: v for k, v in OUTPUTS.items() if "PWM" not in k}
            | {
                "Q_M_PWM_MIN": 1000.0,
                "Q_M_PWM_MAX": 1800.0,
                "RC3_MIN": 1100.0,
                "RC3_MAX": 1900.0,
            },
            0.625,
            4,
            "",
        ),
        ({"RC3_MIN": 1600.0, "RC3_MAX": 1900.0}, 0.0, 4, ""),
        ({}, 0.5, 4, "limits of 1000 and 2000 us are assumed"),
    ],
)
def test_outputs_and_their_limits_are_those_of_the_parameters(
    tmp_path: Path, parameters: dict[str, float], first: float, count: int, note: str
) -> None:
    found = read(tmp_path, old(parameters))
    assert found["rotor_commands"].values.shape[1] == count
    assert found["rotor_commands"].values[0, 0] == pytest.approx(first)
    assert note in " ".join(found.notes)
    if count == 2:
        assert found["rotor_commands"].source == "rotor signals: output Ch2, output Ch1"


def test_outputs_of_no_known_rotors_are_left_out_with_a_note(tmp_path: Path) -> None:
    found = read(tmp_path, old({}, (1500, 1400, 1300, 1200, 0)))
    assert "rotor_commands" not in found
    assert (
        "rotor_commands: are left out, as nothing says which outputs drive rotors"
        in found.notes[-1]
    )
    elsewhere = read(
        tmp_path, old(OUTPUTS | {"SERVO3_FUNCTION": 0.0, "SERVO15_FUNCTION": 35.0})
    )
    assert "rotor_commands" not in elsewhere
    assert (
        "no output of RCOU has the SERVOn_FUNCTION 35 of rotors" in elsewhere.notes[-1]
    )


def test_a_second_unit_and_whole_number_fields_are_tables_apart(tmp_path: Path) -> None:
    gyro = {"topic": "IMU[1]", "columns": list(AXES[:3]), "frame": "FRD"}
    data = recent(OUTPUTS)
    assert "PIDR" in read(tmp_path, data).unused  # its I is no instance
    second = load_flight(tmp_path / "flight.BIN", columns_from({"gyro": gyro}))[
        "gyro"
    ].values
    np.testing.assert_array_equal(
        second, decoded(tmp_path, "IMU", *AXES[:3], instance=1)[:, 1:] * TURN
    )


def test_of_instances_that_do_not_begin_with_zero_the_least_is_read(
    tmp_path: Path,
) -> None:
    log = Writer(
        IMU=("QBffffff", f"TimeUS,I,{','.join(AXES)}"), BAT=("QBf", "TimeUS,Inst,Volt")
    )
    for k in range(60):
        log.put("IMU", 10_000 * k, 0, *range(6))
        log.put("BAT", 10_000 * k, 2, 11.0)
        log.put("BAT", 10_000 * k, 1, 12.5)
    found = read(tmp_path, log.data)
    np.testing.assert_array_equal(found["voltage"].values, np.full((60, 1), 12.5))
    assert found.unused == ("BAT[2]",)


def test_raw_samples_are_taken_at_their_own_times_where_they_are_logged(
    tmp_path: Path,
) -> None:
    fields = "TimeUS,I,SampleUS,GyrX,GyrY,GyrZ"
    log = Writer(IMU=("QBffffff", f"TimeUS,I,{','.join(AXES)}"), GYR=("QBQfff", fields))
    for k in range(40):
        log.put(
            "GYR",
            5_000_000 + 1000 * k,
            0,
            4_999_000 + 1000 * k + 7 * (k % 3),
            0.1 * k,
            0.0,
            -1.0,
        )
        if k % 20 == 0:
            log.put("IMU", 5_000_000 + 1000 * k, 0, 9.0, 9.0, 9.0, 0.0, 0.0, -9.8)
    found = read(tmp_path, log.data)
    assert found["gyro"].source == "GYR: GyrX, GyrY, GyrZ"
    stamps = 4.999 + 0.001 * np.arange(40) + 7e-6 * (np.arange(40) % 3)
    np.testing.assert_allclose(
        found["gyro"].time + float(found.facts["start"]), stamps, atol=1e-9
    )
    assert found["accelerometer"].values[0, 2] == pytest.approx(9.8)


def rows_of(flight: FlightData) -> set[tuple[Any, ...]]:
    """Readings with their times in the file, to the us."""
    start = float(flight.facts["start"])
    return {
        (name, round(start + time, 6), *row)
        for name in ("gyro", "accelerometer", "position", "voltage")
        if name in flight
        for time, row in zip(
            flight[name].time.tolist(), flight[name].values.tolist(), strict=True
        )
    }


def test_of_damaged_logs_rows_are_lost_with_a_note_and_none_is_invented(
    tmp_path: Path,
) -> None:
    draw, data = np.random.default_rng(0), recent(OUTPUTS)
    every, said = rows_of(read(tmp_path, data)), 0
    for k in range(200):
        begin = int(draw.integers(0, len(data) - 100))
        end = (
            len(data),
            begin + int(draw.integers(1, 14)),
            begin + int(draw.integers(1, 90)),
        )[k % 3]
        filling = (
            b"" if k % 3 < 2 else bytes(draw.integers(0, 256, end - begin, np.uint8))
        )
        try:
            found = read(tmp_path, data[:begin] + filling + data[end:])
        except ValueError as error:
            assert "\n" not in str(error)
            said += 1
            continue
        said += any("belong to no whole message" in note for note in found.notes)
        # no check sum: bytes replaced within a number are not seen, nor is a loss as
        # long as some messages
        assert len(rows_of(found) - every) <= (0 if k % 3 < 2 else 4)
    assert said > 150


def test_of_two_logs_in_a_file_the_longer_is_read(tmp_path: Path) -> None:
    data = recent(OUTPUTS)
    alone = rows_of(read(tmp_path, data))
    both = read(tmp_path, old({})[:3000] + data)
    assert rows_of(both) == alone
    assert re.match(
        r"file: holds flights of \d+ bytes, \d+ bytes; the longest is read, #2; ",
        both.notes[0],
    )
    assert rows_of(load_flight(tmp_path / "flight.BIN#2")) == alone
    (tmp_path / "first").mkdir()
    first = load_flight(tmp_path / "flight.BIN#1")
    assert first.notes == read(tmp_path / "first", old({})[:3000]).notes
    assert rows_of(first) == rows_of(read(tmp_path / "first", old({})[:3000]))
    # a file of that very name comes first
    (tmp_path / "flight.BIN#1").write_bytes(data)
    assert rows_of(load_flight(tmp_path / "flight.BIN#1")) == alone


def lanes(
    primary: tuple[int, ...],
    parameters: dict[str, float],
    units: tuple[int, ...] = (0, 1, 2),
) -> bytes:
    """Log of ArduPilot 4 with two lanes of its filter and three inertial units."""
    noise = np.random.default_rng(4)
    log = Writer(
        PARM=("QNf", "TimeUS,Name,Value"),
        IMU=("QBffffff", f"TimeUS,I,{','.join(AXES)}"),
        XKQ=("QBffff", "TimeUS,C,Q1,Q2,Q3,Q4"),
        XKF1=("QBffffff", "TimeUS,C,VN,VE,VD,PN,PE,PD"),
        XKF4=("QBB", "TimeUS,C,PI"),
        BAT=("QBf", "TimeUS,Inst,Volt"),
    )
    for name, value in parameters.items():
        log.put("PARM", 0, name.encode(), value)
    for k, lane in enumerate(primary):
        stamp = 61_500_000 + 10_000 * k
        for unit in units:
            log.put("IMU", stamp, unit, *noise.normal(size=6))
        for core in (0, 1):
            log.put("XKQ", stamp + 200, core, *noise.normal(size=4))
            log.put("XKF1", stamp + 300, core, *noise.normal(size=6))
            log.put("XKF4", stamp + 400, core, lane)
            # a servo's is the second one
            log.put("BAT", stamp + 500, core, 12.5 - 5.0 * core)
    return log.data


@pytest.mark.parametrize(
    ("primary", "parameters", "lane", "unit"),
    [
        ((0,) * 60, {}, 0, 0),
        ((1,) * 60, {"EK3_IMU_MASK": 3.0}, 1, 1),
        ((1,) * 60, {"EK3_IMU_MASK": 6.0}, 1, 2),
        ((0,) * 60, {"EK3_IMU_MASK": 6.0}, 0, 1),
        ((0,) * 20 + (1,) * 40, {"EK3_IMU_MASK": 7.0}, 1, 1),
    ],
)
def test_unit_and_filter_are_those_of_the_lane_that_flew(
    tmp_path: Path,
    primary: tuple[int, ...],
    parameters: dict[str, float],
    lane: int,
    unit: int,
) -> None:
    places = {f"INS_POS{k}_{axis}": 0.1 * k for k in (1, 2, 3) for axis in "XYZ"}
    found = read(tmp_path, lanes(primary, parameters | places))
    for name, fields in (("gyro", AXES[:3]), ("accelerometer", AXES[3:])):
        np.testing.assert_array_equal(
            found[name].values,
            decoded(tmp_path, "IMU", *fields, instance=unit)[:, 1:] * TURN,
        )
    rows = decoded(tmp_path, "XKF1", "PN", "PE", "PD", instance=lane)[:, 1:]
    np.testing.assert_array_equal(found["position"].values, rows * TURN)
    q = decoded(tmp_path, "XKQ", "Q1", "Q2", "Q3", "Q4", instance=lane)[:, 1:] * [
        1.0,
        1.0,
        -1.0,
        -1.0,
    ]
    q /= np.linalg.norm(q, axis=1)[:, None]
    np.testing.assert_allclose(
        np.abs(np.sum(found["quaternion"].values * q, axis=1)), 1.0, atol=1e-12
    )
    assert found["voltage"].values[0, 0] == 12.5
    assert found.place["place.x"] == pytest.approx(0.1 * (unit + 1))
    assert (
        f"inertial unit {unit} is read, of the filter's lane {lane}; a columns.toml may"
        " name IMU" in found.notes[0]
    )
    assert ("the filter changed its lane 1 times" in found.notes[-1]) == (
        len(set(primary)) > 1
    )
    chosen = {
        name: {"topic": "IMU[2]", "columns": list(each)}
        for name, each in zip(
            ("gyro", "accelerometer"), (AXES[:3], AXES[3:]), strict=True
        )
    }
    assert load_flight(tmp_path / "flight.BIN", columns_from(chosen)).place[
        "place.x"
    ] == pytest.approx(0.3)


def test_of_an_old_log_the_second_lane_has_topics_of_its_own(tmp_path: Path) -> None:
    noise = np.random.default_rng(5)
    log = Writer(
        IMU=("Qffffff", f"TimeUS,{','.join(AXES)}"),
        IMU2=("Qffffff", f"TimeUS,{','.join(AXES)}"),
        NKF1=("Qfff", "TimeUS,PN,PE,PD"),
        NKF6=("Qfff", "TimeUS,PN,PE,PD"),
        NKQ1=("Qffff", "TimeUS,Q1,Q2,Q3,Q4"),
        NKQ2=("Qffff", "TimeUS,Q1,Q2,Q3,Q4"),
        NKF4=("QB", "TimeUS,PI"),
    )
    for k in range(60):
        for name, width in (
            ("IMU", 6),
            ("IMU2", 6),
            ("NKF1", 3),
            ("NKF6", 3),
            ("NKQ1", 4),
            ("NKQ2", 4),
        ):
            log.put(name, 10_000 * k, *noise.normal(size=width))
        log.put("NKF4", 10_000 * k, 1)
    found = read(tmp_path, log.data)
    assert [
        found[name].source.partition(":")[0]
        for name in ("gyro", "position", "quaternion")
    ] == [
        "IMU2",
        "NKF6",
        "NKQ2",
    ]
    np.testing.assert_array_equal(
        found["gyro"].values, decoded(tmp_path, "IMU2", *AXES[:3])[:, 1:] * TURN
    )
    np.testing.assert_array_equal(
        found["position"].values,
        decoded(tmp_path, "NKF6", "PN", "PE", "PD")[:, 1:] * TURN,
    )


def attitudes(*trims: float) -> bytes:
    """Log with the attitude of the inertial unit at 10 Hz (XKQ) and the one of the
    vehicle at 100 Hz (ATT).

    AP_AHRS_NavEKF: R_ATT = R_XKQ R_trim^T, from_euler(AHRS_TRIM_X, Y, Z) of R_trim.
    """
    rotation = pytest.importorskip("scipy.spatial.transform").Rotation
    log = Writer(
        PARM=("QNf", "TimeUS,Name,Value"),
        ATT=("Qfff", "TimeUS,Roll,Pitch,Yaw"),
        XKQ=("QBffff", "TimeUS,C,Q1,Q2,Q3,Q4"),
    )
    for axis, trim in zip("XYZ", trims, strict=False):
        log.put("PARM", 0, f"AHRS_TRIM_{axis}".encode(), trim)
    unit = rotation.from_euler("ZYX", [1.0, 0.3, -0.4]) * rotation.from_rotvec(
        np.linspace(0, 1, 200)[:, None] * [0.6, -0.5, 0.8]
    )
    vehicle = unit * rotation.from_euler("ZYX", [*trims, 0.0, 0.0, 0.0][2::-1]).inv()
    for k, (angles, q) in enumerate(
        zip(vehicle.as_euler("ZYX", degrees=True), unit.as_quat(), strict=True)
    ):
        log.put("ATT", 10_000 * k, *angles[::-1])
        if k % 10 == 0:
            log.put("XKQ", 10_000 * k, 0, *q[[3, 0, 1, 2]])
    return log.data


@pytest.mark.parametrize("trims", [(), (0.08, -0.12), (-0.1, 0.05, 0.02)])
def test_angles_of_the_vehicle_are_turned_back_to_its_unit(
    tmp_path: Path, trims: tuple[float, ...]
) -> None:
    found = read(tmp_path, attitudes(*trims))
    assert (found["quaternion"].source, found["quaternion"].rate) == (
        "ATT: Roll, Pitch, Yaw",
        pytest.approx(100.0),
    )
    q = decoded(tmp_path, "XKQ", "Q1", "Q2", "Q3", "Q4")[:, 1:] * [1.0, 1.0, -1.0, -1.0]
    np.testing.assert_allclose(
        np.abs(np.sum(found["quaternion"].values[::10] * q, axis=1)), 1.0, atol=1e-11
    )
    assert found.notes == (
        (
            (
                "quaternion: is turned back by the trims AHRS_TRIM_X, Y, Z, to the axes"
                " of the inertial unit."
            ),
        )
        if trims
        else ()
    )


def test_a_level_vehicle_with_a_trim_has_a_unit_rolled_by_that_trim(
    tmp_path: Path,
) -> None:
    """NavEKF3 getEulerAngles: angles of its quaternion less the trims are those of the
    vehicle.
    """
    log = Writer(
        PARM=("QNf", "TimeUS,Name,Value"), ATT=("Qfff", "TimeUS,Roll,Pitch,Yaw")
    )
    log.put("PARM", 0, b"AHRS_TRIM_X", 0.06)
    for k in range(30):
        log.put("ATT", 10_000 * k, 0.0, 0.0, 0.0)
    found = read(tmp_path, log.data)["quaternion"].values[0]
    np.testing.assert_allclose(found, [np.cos(0.03), np.sin(0.03), 0.0, 0.0], atol=1e-8)


def raw(parameters: dict[str, float], rate: int = 1) -> bytes:
    """Log of messages IMU, and of raw ones GYR at a multiple of their rate."""
    fields = ",".join(AXES)
    log = Writer(
        PARM=("QNf", "TimeUS,Name,Value"),
        IMU=("QBffffff", f"TimeUS,I,{fields}"),
        GYR=("QBQfff", "TimeUS,I,SampleUS,GyrX,GyrY,GyrZ"),
    )
    for name, value in parameters.items():
        log.put("PARM", 0, name.encode(), value)
    for k in range(60 * max(1, rate)):
        if rate:
            log.put("GYR", 10_000 * k // rate, 0, 10_000 * k // rate, 1.0, 2.0, 3.0)
        if k % max(1, rate) == 0:
            log.put("IMU", 10_000 * k // max(1, rate), 0, *range(6))
    return log.data


def test_a_filtered_unit_is_noted_with_the_delay_of_its_filter(tmp_path: Path) -> None:
    signal = pytest.importorskip("scipy.signal")
    found = read(
        tmp_path, raw({"INS_GYRO_FILTER": 20.0, "INS_ACCEL_FILTER": 5.0}, rate=0)
    )
    for note, name, cut in zip(
        found.notes, ("gyro", "accelerometer"), (20.0, 5.0), strict=True
    ):
        word = {"gyro": "INS_GYRO_FILTER", "accelerometer": "INS_ACCEL_FILTER"}[name]
        _, response = signal.freqs(
            *signal.butter(2, 2 * np.pi * cut, analog=True), worN=[0.01]
        )
        late = -np.angle(response[0]) / 0.01
        assert (
            note
            == f"{name}: is filtered at {word} = {cut:g} Hz, {1e3 * late:.2g} ms late;"
            " log raw IMU (LOG_BITMASK)."
        )
    assert read(tmp_path, raw({"INS_GYRO_FILTER": 0.0}, rate=0)).notes == ()


@pytest.mark.parametrize("rate", [1, 3])
def test_raw_samples_come_before_filtered_ones(tmp_path: Path, rate: int) -> None:
    found = read(
        tmp_path, raw({"INS_GYRO_FILTER": 20.0, "INS_ACCEL_FILTER": 0.0}, rate)
    )
    assert found["gyro"].source == "GYR: GyrX, GyrY, GyrZ"
    assert found.notes == ()


@pytest.mark.parametrize(
    ("name", "number", "is_reset"),
    [
        ("EV", 62, True),
        ("EV", 60, True),
        ("EV", 10, False),
        ("ERR", 24, True),
        ("ERR", 16, False),
    ],
)
# 5 ms: a loop may stamp its start
@pytest.mark.parametrize(("late", "begin"), [(55_000, 4.2), (5_000, 4.1)])
def test_resets_of_the_filter_are_jumps(
    tmp_path: Path, name: str, number: int, is_reset: bool, late: int, begin: float
) -> None:
    log = Writer(
        XKF1=("Qffffff", "TimeUS,VN,VE,VD,PN,PE,PD"),
        ATT=("Qfff", "TimeUS,Roll,Pitch,Yaw"),
        EV=("QB", "TimeUS,Id"),
        ERR=("QBB", "TimeUS,Subsys,ECode"),
    )
    rest = (1,) if name == "ERR" else ()
    log.put(name, 1_000_000, number, *rest)  # before the pose
    for k in range(100):
        stamp = 2_000_000 + 100_000 * k
        log.put("XKF1", stamp, *range(6))
        for i in range(10):
            log.put("ATT", stamp + 10_000 * i, 0.0, 0.0, 30.0)
        if k == 42:
            log.put(name, stamp + late, number, *rest)
    found = read(tmp_path, log.data)
    assert found.jumps == ((pytest.approx(begin), pytest.approx(4.3)),) * is_reset
    note = "pose: the estimator reset it at 4.30 s; nothing is compared across that."
    assert (note in found.notes) == is_reset


@pytest.mark.parametrize(("kind", "trim"), [(8.0, 1200), (9.0, 1400)])
@pytest.mark.parametrize("reverse", [0.0, 1.0])
def test_scaled_outputs_are_shares_of_their_own_range(
    tmp_path: Path, kind: float, trim: int, reverse: float
) -> None:
    """AP_Motors::rc_write maps 1000 to 2000 us by pwm_from_range or pwm_from_angle of
    SRV_Channel.
    """
    shares, high = (0.2, 0.0, 0.8, 0.5), (1950, 1900, 1850, 1800)
    parameters = OUTPUTS | {"MOT_PWM_TYPE": kind, "SERVO3_REVERSED": reverse}
    parameters |= {
        f"SERVO{k}_{end}": v
        for k in range(2, 5)
        for end, v in (("TRIM", trim), ("MIN", 1050 + k), ("MAX", high[k - 1]))
    }
    sent = []
    for k, share in enumerate(shares, 1):
        low, middle, most = (
            parameters.get(f"SERVO{k}_{end}", v)
            for end, v in (("MIN", 1100), ("TRIM", 1500), ("MAX", 1900))
        )
        value = 1000.0 * (1.0 - share if k == 3 and reverse else share)
        if kind == 8.0:
            sent.append(low + int(value * (most - low) / 1000.0))
        elif value > 500.0:
            sent.append(middle + int((value - 500.0) * (most - middle) / 500.0))
        else:
            sent.append(middle - int((500.0 - value) * (middle - low) / 500.0))
    found = read(tmp_path, recent(parameters, (*map(int, sent), 0, 0)))[
        "rotor_commands"
    ]
    np.testing.assert_allclose(found.values[0], shares, atol=1.0 / 300.0)
    assert found.source == "rotor signals: output C1, output C2, output C3, output C4"


def test_logs_that_are_none_are_one_line_with_the_cause(tmp_path: Path) -> None:
    log = Writer(TIME=("Q", "StartTime"), IMU=("ff", "AccX,GyroX"))
    log.put("TIME", 1)
    log.put("IMU", 1.0, 2.0)
    for data, words in (
        (
            log.data,
            (
                r"messages: have no times .* PX4 before 2017 \(\.px4log\): log as"
                r" \.ulg, with a newer version"
            ),
        ),
        (
            Writer(IMU=("ff", "GyrX,AccX")).data,
            "messages: have no times .* ArduPilot before 2014",
        ),
        (b"", "messages: none defines a type"),
        (b"\xa3\x95", "messages: none defines a type"),
        (bytes(5000), "messages: none defines a type"),
    ):
        with pytest.raises(ValueError, match=words) as error:
            read(tmp_path, data)
        assert "\n" not in str(error.value)


def test_telemetry_is_refused_with_the_log_to_take_in_its_place(tmp_path: Path) -> None:
    (tmp_path / "flight.tlog").write_bytes(bytes(8) + b"\xfe\x09" + bytes(40))
    with pytest.raises(
        ValueError,
        match=r"telemetry \(\.tlog\) is too slow: read the \.bin of its flight$",
    ):
        load_flight(tmp_path / "flight.tlog")


@pytest.mark.parametrize(
    "lost", ["VELOCITY_HORIZ", "VELOCITY_VERT", "POS_HORIZ", "POS_VERT_ABS"]
)
@pytest.mark.parametrize("lane", [0, 1])
def test_rows_that_a_filter_states_to_be_invalid_are_left_out(
    tmp_path: Path, lost: str, lane: int
) -> None:
    """Bits of its status as MAVLink's EKF_STATUS_FLAGS; a horizontal position may be
    relative or absolute.
    """
    mavlink = pytest.importorskip(
        "pymavlink.dialects.v20.ardupilotmega", reason="needs the extra 'test'"
    )
    names = ("VELOCITY_HORIZ", "VELOCITY_VERT", "POS_HORIZ_REL", "POS_VERT_ABS")
    whole = sum(getattr(mavlink, f"EKF_{name}") for name in names)
    part = sum(
        getattr(mavlink, f"EKF_{name}") for name in names if not name.startswith(lost)
    )
    log = Writer(
        XKF1=("QBffffff", "TimeUS,C,VN,VE,VD,PN,PE,PD"), XKF4=("QBHB", "TimeUS,C,SS,PI")
    )
    for k in range(20):
        for core in range(2):
            log.put(
                "XKF1", 10_000 * k, core, *(100 * core + k + each for each in range(6))
            )
            log.put(
                "XKF4",
                10_000 * k,
                core,
                part if k < 8 and core == lane else whole,
                lane,
            )
    flight = read(tmp_path, log.data)
    first = {
        "position": 8 * lost.startswith("POS"),
        "velocity": 8 * lost.startswith("VEL"),
    }
    for name, begin in first.items():
        number = 100 * lane + np.arange(begin, 20) + (3 if name == "position" else 0)
        np.testing.assert_array_equal(flight[name].values[:, 0], number)
    said = next(each for each in flight.notes if "valid" in each)
    assert said.startswith(f"XKF1{'[1]' * lane}: is not valid by ")
    assert said.endswith(" in 8 of 20 rows, which are left out.")
