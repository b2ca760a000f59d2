"""Binary logs of a Crazyflie's memory card, against files that are packed here by
hand.
"""

from __future__ import annotations

import re
import struct
import time
import zlib
from pathlib import Path

import numpy as np
import pytest

from skyarm.flight_data import crazyflie_log
from skyarm.flight_data.flight_data import load_flight

CUT = (
    Path(__file__).parents[1]
    / "data"
    / "flights"
    / "crazyflie"
    / "log15_from_20_to_23_s"
)
GYRO, POWER = (
    ("fixedFrequency", ("gyro.x(f)", "gyro.y(f)", "gyro.z(f)")),
    (
        "power",
        ("pm.vbatMV(H)",),
    ),
)


def packed(
    version: int,
    events: dict[int, tuple[str, tuple[str, ...]]],
    rows: list[tuple[int, int, bytes]],
) -> bytes:
    """A log as the firmware writes it."""
    data = struct.pack("<BHH", 0xBC, version, len(events))
    for number, (name, variables) in events.items():
        data += (
            struct.pack("<H", number)
            + name.encode()
            + b"\0"
            + struct.pack("<H", len(variables))
        )
        data += b"".join(each.encode() + b"\0" for each in variables)
    for number, stamp, numbers in rows:
        data += struct.pack("<HI" if version == 1 else "<HQ", number, stamp) + numbers
    return data + struct.pack("<I", zlib.crc32(data))


def written(folder: Path, data: bytes) -> Path:
    path = folder / "log07"
    path.write_bytes(data)
    return path


@pytest.mark.parametrize(("version", "tick"), [(1, 1e-3), (2, 1e-6)])
def test_events_of_several_types_are_told_apart_in_both_versions(
    tmp_path: Path, version: int, tick: float
) -> None:
    rows = [
        (0xFFFF, 5000, struct.pack("<3f", 180.0, -90.0, 0.0)),
        (3, 5001, struct.pack("<H", 3700)),
        (0xFFFF, 5002, struct.pack("<3f", 0.0, 0.0, 360.0)),
    ]
    flight = load_flight(
        written(tmp_path, packed(version, {0xFFFF: GYRO, 3: POWER}, rows))
    )
    assert set(flight) == {"gyro", "voltage"}
    assert flight.notes == ()
    np.testing.assert_allclose(flight["gyro"].time, [0.0, 2 * tick], rtol=1e-12)
    np.testing.assert_allclose(
        flight["gyro"].values,
        np.array([[1.0, -0.5, 0.0], [0.0, 0.0, 2.0]]) * np.pi,
        rtol=1e-12,
    )
    np.testing.assert_allclose(flight["voltage"].time, [tick], rtol=1e-12)
    np.testing.assert_allclose(flight["voltage"].values, [[3.7]])
    assert flight.facts["start"] == pytest.approx(5000 * tick)


def test_reading_takes_a_time_in_proportion_to_the_events(tmp_path: Path) -> None:
    """Types that alternate: a reader that looks ahead for the end of each run of one
    type takes the square.
    """
    head = packed(2, {0xFFFF: GYRO, 3: POWER}, [])[:-4]
    pair = struct.pack("<HQ3f", 0xFFFF, 5000, 1.0, 2.0, 3.0) + struct.pack(
        "<HQH", 3, 5000, 3700
    )
    taken = []
    for pairs in (50_000, 200_000):
        data = head + pair * pairs
        path = written(tmp_path, data + struct.pack("<I", zlib.crc32(data)))
        begin = time.process_time()
        rows, _ = crazyflie_log._rows(path.read_bytes(), *crazyflie_log._head(data)[1:])
        taken.append(time.process_time() - begin)
        assert [len(rows[number]) for number in (0xFFFF, 3)] == [pairs, pairs]
    assert taken[1] < 8.0 * taken[0] + 0.2  # 4 in proportion, 16 by the square


def test_a_published_log_is_read_as_numpy_reads_its_bytes() -> None:
    flight, data = load_flight(CUT), CUT.read_bytes()
    kinds = [
        ("id", "<u2"),
        ("t", "<u8"),
        ("acc", "<f4", 3),
        ("gyro", "<f4", 3),
        ("motors", "<u4", 4),
    ]
    rows = np.frombuffer(data[data.index(b"motor.m4(I)\0") + 12 : -4], np.dtype(kinds))
    assert len(rows) > 3000
    np.testing.assert_allclose(
        flight["accelerometer"].values, rows["acc"] * 9.80665, rtol=1e-6
    )
    np.testing.assert_allclose(
        flight["gyro"].values, np.deg2rad(rows["gyro"]), rtol=1e-6
    )
    np.testing.assert_allclose(flight["rotor_commands"].values, rows["motors"] / 65535)
    np.testing.assert_allclose(
        flight["gyro"].time, (rows["t"] - rows["t"][0]) * 1e-6, atol=1e-9
    )
    assert flight["gyro"].rate == pytest.approx(1011, rel=0.01)


def test_a_file_that_is_cut_off_or_damaged_is_read_as_far_as_it_goes_with_a_note(
    tmp_path: Path,
) -> None:
    data = CUT.read_bytes()
    whole = load_flight(CUT)["gyro"].time.size
    cut = load_flight(written(tmp_path, data[:-120]))
    assert whole - 4 <= cut["gyro"].time.size < whole
    assert re.search(r"cut off", cut.notes[0])
    damaged = bytearray(data)
    damaged[-30] ^= 1
    assert "check sum" in load_flight(written(tmp_path, bytes(damaged))).notes[0]
    damaged = bytearray(data)
    damaged[data.index(b"motor.m4(I)\0") + 12 + 50 * 100] ^= 1
    found = load_flight(written(tmp_path, bytes(damaged)))
    assert found["gyro"].time.size == 100
    assert "unknown number" in found.notes[0]


def test_the_position_of_the_filter_is_that_of_the_firmware_s_log_group(
    tmp_path: Path,
) -> None:
    """Crazyflie's firmware, estimator_kalman.c: LOG_GROUP kalman with stateX, stateY,
    stateZ.
    """
    event = {
        1: ("kalman", ("kalman.stateX(f)", "kalman.stateY(f)", "kalman.stateZ(f)"))
    }
    rows = [(1, 5000 + k, struct.pack("<3f", 1.0, 2.0, 3.0)) for k in range(3)]
    flight = load_flight(written(tmp_path, packed(2, event, rows)))
    np.testing.assert_array_equal(flight["position"].values, [[1, 2, 3]] * 3)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"\xbc\x03\x00\x01\x00", "format 'without suffix' is unknown"),
        (b"\xbc\x02\x00\x00\x00\0\0\0\0", "event types = 0"),
        (b"\xbc\x02\x00\x01\x00\xff\xff", "head: is cut off"),
        (b"\xbc\x02\x00\xff\xff" + b"a" * 40, "head: is cut off"),
        (packed(2, {1: ("e", ("gyro.x(q)",))}, []), r"variable = 'gyro.x\(q\)'"),
        (packed(2, {1: ("e", ("a(f)", "a(f)"))}, []), "variable"),
        (packed(2, {1: ("e", ("a(f]",))}, []), "variable"),
        (
            packed(2, {1: ("e", ("a(f)",)), 2: ("e", ("b(f)",))}, []),
            "is declared twice",
        ),
        (packed(2, {1: GYRO}, []), "must hold a quantity or more"),
        (
            packed(2, {1: POWER}, [(1, 5, b"\0\0"), (1, 4, b"\0\0"), (1, 3, b"\0\0")]),
            "rises in 1 of 3 rows",
        ),
    ],
)
def test_a_wrong_file_is_one_line(tmp_path: Path, data: bytes, words: str) -> None:
    with pytest.raises(ValueError, match=words) as error:
        load_flight(written(tmp_path, data))
    assert "\n" not in str(error.value)
    assert "log07" in str(error.value)


def test_speeds_of_brushless_motors_are_read_but_for_the_number_of_none(
    tmp_path: Path,
) -> None:
    names = tuple(f"motor.m{k}_rpm(H)" for k in (1, 2, 3, 4))
    rows = [
        (
            1,
            1000 * k,
            struct.pack("<4H", 15000, 15000, 6000, 65535 if k == 2 else 15000),
        )
        for k in range(5)
    ]
    flight = load_flight(written(tmp_path, packed(2, {1: ("motors", names)}, rows)))
    np.testing.assert_allclose(
        flight["rotor_speeds"].values,
        np.tile([500.0, 500.0, 200.0, 500.0], (4, 1)) * np.pi,
    )
    np.testing.assert_allclose(
        flight["rotor_speeds"].time, [0.0, 1e-3, 3e-3, 4e-3], atol=1e-12
    )
    assert flight.notes == (
        "rotor_speeds: 1 of 5 rows are without numbers and are left out.",
    )
