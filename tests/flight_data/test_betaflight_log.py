"""Blackbox logs of Betaflight, written byte by byte with known numbers."""

from __future__ import annotations

import csv
import io
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skyarm.flight_data.columns_file import columns_from
from skyarm.flight_data.flight_data import FlightData, load_flight

SIGNED = (
    "gyroADC[0]",
    "gyroADC[1]",
    "gyroADC[2]",
    "accSmooth[0]",
    "accSmooth[1]",
    "accSmooth[2]",
)
COUNTED = (
    "loopIteration",
    "time",
    "motor[0]",
    "motor[1]",
    "motor[2]",
    "motor[3]",
    "vbatLatest",
)
HEAD = {
    "Firmware type": "Cleanflight",
    "Firmware revision": "Betaflight 4.4.2 (0) STM32F405",
    "minthrottle": "1070",
    "maxthrottle": "2000",
    "gyro_scale": "0x3f800000",  # 1.0 as a float
    "acc_1G": "2048",
    "motorOutput": "158,2047",
    "vbatcellvoltage": "330,350,430",
    "motor_poles": "12",
    "motor_pwm_protocol": "7",
    "gyro_lpf1_static_hz": "0",
}
UNFILTERED = {f"gyroUnfilt[{k}]": 30 - 50 * k for k in range(3)}
DEBUG = {f"debug[{k}]": 7 + 11 * k for k in range(4)}
SCALE = "rotor_commands: outputs from 48 to 2047 (DShot) are signals from 0 to 1."


def number(value: int) -> bytes:
    """Whole number in groups of seven bits, the lowest first."""
    out = b""
    while value > 127:
        out, value = out + bytes([value & 127 | 128]), value >> 7
    return out + bytes([value])


def log(rows: list[dict[str, int]], **changed: str | None) -> bytes:
    """Log of intraframes only: numbers without prediction, signed ones in zigzag
    order.
    """
    usual = [*COUNTED[:2], *SIGNED, *COUNTED[2:]]
    names = [*usual, *(name for name in (rows[0] if rows else ()) if name not in usual)]
    signs = [
        int(name in SIGNED or name.startswith(("gyroUnfilt", "debug")))
        for name in names
    ]
    plain = ["0"] * len(names)
    coded = [str(1 - sign) for sign in signs]
    lines = {
        "Product": "Blackbox flight data recorder by Nicholas Sherlock",
        "Data version": "2",
        "I interval": "1",
        "P interval": "1",
        "Field I name": ",".join(names),
        "Field I signed": ",".join(map(str, signs)),
        **{f"Field {frame} predictor": ",".join(plain) for frame in "IP"},
        **{f"Field {frame} encoding": ",".join(coded) for frame in "IP"},
        **{
            **HEAD,
            **{name.replace("_of_", " "): text for name, text in changed.items()},
        },
    }
    head = "".join(
        f"H {name}:{text}\n" for name, text in lines.items() if text is not None
    ).encode()
    frames = (
        b"I"
        + b"".join(
            number((v << 1) ^ (v >> 31) if sign else v)
            for v, sign in zip(row.values(), signs, strict=True)
        )
        for row in ({name: each[name] for name in names} for each in rows)
    )
    return head + b"".join(frames) + b"E\xffEnd of log\0"


def rows(count: int = 50, begin: int = 40_000_000, **more: int) -> list[dict[str, int]]:
    """Rows at 500 Hz whose numbers differ from row to row and from column to column."""
    return [
        {"loopIteration": k, "time": begin + 2000 * k}
        | {name: (-1) ** i * (100 * i + k) for i, name in enumerate(SIGNED)}
        | {f"motor[{i}]": 200 + 300 * i + k for i in range(4)}
        | {"vbatLatest": 1650 - k // 10, **more}
        for k in range(count)
    ]


def read(folder: Path, data: bytes, name: str = "flight.bbl") -> FlightData:
    (folder / name).write_bytes(data)
    return load_flight(folder / name)


def test_a_missing_decoder_is_named_with_two_cures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "betaflight_chirp_core", None)
    with pytest.raises(
        ValueError,
        match=(
            r"is missing; .*extra 'blackbox'.*or decode it by blackbox_decode to \.csv"
        ),
    ):
        # the first bytes decide, not the suffix
        read(tmp_path, log(rows()), "flight.txt")


class TestWithTheDecoder:
    @pytest.fixture(autouse=True)
    def _decoder(self) -> None:
        pytest.importorskip(
            "betaflight_chirp_core", reason="needs the extra 'blackbox'"
        )

    def test_numbers_are_those_that_were_written(self, tmp_path: Path) -> None:
        written = rows()
        found = read(tmp_path, log(written))
        table = {
            name: np.array([row[name] for row in written], float) for name in written[0]
        }
        stack = {
            name: np.stack([table[f"{name}[{k}]"] for k in range(3)], axis=1)
            for name in ("gyroADC", "accSmooth")
        }
        np.testing.assert_allclose(found["gyro"].time, 0.002 * np.arange(50), atol=1e-9)
        np.testing.assert_allclose(
            found["gyro"].values, np.deg2rad(stack["gyroADC"]), rtol=1e-12
        )
        np.testing.assert_allclose(
            found["accelerometer"].values,
            stack["accSmooth"] / 2048 * 9.80665,
            rtol=1e-12,
        )
        motors = np.stack([table[f"motor[{k}]"] for k in range(4)], axis=1)
        np.testing.assert_allclose(
            found["rotor_commands"].values, (motors - 48) / 1999, rtol=1e-12
        )
        np.testing.assert_allclose(
            found["voltage"].values[:, 0], 0.01 * table["vbatLatest"]
        )
        assert (found.notes, found.facts["firmware"]) == (
            (SCALE,),
            "Betaflight 4.4.2 (0) STM32F405",
        )
        assert found.facts["start"] == pytest.approx(40.0)

    def test_blackbox_decode_prints_the_same_numbers(self, tmp_path: Path) -> None:
        program = shutil.which("blackbox_decode")
        if program is None:
            pytest.skip("needs blackbox_decode on the path")
        found = read(tmp_path, log(rows()))
        done = subprocess.run(
            [program, "--stdout", tmp_path / "flight.bbl"],
            capture_output=True,
            text=True,
            check=True,
        )
        head, *cells = csv.reader(io.StringIO(done.stdout), skipinitialspace=True)
        printed = np.array(
            [
                [float(row[head.index(f"gyroADC[{k}]")]) for k in range(3)]
                for row in cells
            ]
        )
        np.testing.assert_allclose(
            found["gyro"].values, np.deg2rad(printed), rtol=1e-12
        )

    @pytest.mark.parametrize(
        ("changed", "name", "first"),
        [
            ({"blackbox_high_resolution": "1"}, "gyro", -np.deg2rad(10.0)),
            (
                {"gyro_scale": "0x3d79c190", "Firmware_of_revision": "bdaf8ec"},
                "gyro",
                -np.deg2rad(100 * 0.0609756),
            ),
            ({"acc_1G": "256"}, "accelerometer", 400 / 256 * 9.80665),
        ],
    )
    def test_scales_are_those_of_the_head(
        self, tmp_path: Path, changed: dict[str, str | None], name: str, first: float
    ) -> None:
        found = read(tmp_path, log(rows(), **changed))[name]
        assert found.values[0, min(1, found.values.shape[1] - 1)] == pytest.approx(
            first, rel=1e-6
        )

    @pytest.mark.parametrize(
        ("protocol", "output", "share"),
        [
            ("5", 0, 0.0),  # DSHOT_CMD_MOTOR_STOP
            ("6", 48, 0.0),  # DSHOT_MIN_THROTTLE
            # idle by dshotInitEndpoints: dshot_idle_value = 550 is 5.5 %
            ("7", 158, 0.055),
            ("8", 1367, 0.66),  # outputHigh of motor_output_limit = 66
            ("9", 2047, 1.0),  # DSHOT_MAX_THROTTLE
            ("0", 1070, 0.07),  # minthrottle
            ("3", 2000, 1.0),
            ("4", 1000, 0.0),  # mincommand
        ],
    )
    @pytest.mark.parametrize("ends", ["158,2047", "158,1367", None])
    def test_a_signal_is_a_share_of_the_protocol_not_of_idle_to_limit(
        self,
        tmp_path: Path,
        protocol: str | None,
        output: int,
        share: float,
        ends: str | None,
    ) -> None:
        found = read(
            tmp_path,
            log(
                rows(**{"motor[0]": output}),
                motor_pwm_protocol=protocol,
                motorOutput=ends,
            ),
        )
        # of outputs in whole numbers
        assert found["rotor_commands"].values[0, 0] == pytest.approx(share, abs=3e-4)
        scale = (
            "48 to 2047 (DShot)"
            if protocol and int(protocol) > 4
            else "1000 to 2000 (pulses in us)"
        )
        assert found.notes == (
            f"rotor_commands: outputs from {scale} are signals from 0 to 1.",
        )

    @pytest.mark.parametrize(
        ("ends", "output", "share", "scale"),
        [
            (
                "158,2047",
                158 + 1889 // 2,
                0.5,
                "158 to 2047 (motorOutput of a log that states no protocol)",
            ),
            ("1070,2000", 1500, 0.5, "1000 to 2000 (pulses in us)"),
            (None, 1500, 0.5, "1000 to 2000 (pulses in us)"),
        ],
    )
    def test_a_log_without_a_protocol_has_the_range_that_it_states_or_that_of_pulses(
        self, tmp_path: Path, ends: str | None, output: int, share: float, scale: str
    ) -> None:
        found = read(
            tmp_path,
            log(
                rows(**{"motor[0]": output}), motor_pwm_protocol=None, motorOutput=ends
            ),
        )
        assert found["rotor_commands"].values[0, 0] == pytest.approx(share, abs=3e-4)
        assert found.notes == (
            f"rotor_commands: outputs from {scale} are signals from 0 to 1.",
        )

    def test_motors_that_turn_both_ways_are_left_to_a_mapping(
        self, tmp_path: Path
    ) -> None:
        found = read(tmp_path, log(rows(), features="4096"))  # FEATURE_3D = 1 << 12
        assert "rotor_commands" not in found
        assert (
            "rotor_commands: are left out, as motors turn both ways (3D)"
            in found.notes[0]
        )
        assert "rotor_commands" in read(
            tmp_path, log(rows(), features=str(~4096 & 0x3FFFFFFF))
        )

    @pytest.mark.parametrize(
        ("revision", "volts"),
        [
            ("Betaflight 2025.12.1 (a) STM32F745", 16.5),
            ("Betaflight 4.0.0 (a) STM32F405", 16.5),
            ("Betaflight 3.5.7 (a) OMNIBUS", 165.0),
            ("Betaflight 3.1.0 (a) OMNIBUS", 165.0),
            ("Betaflight 3.0.1 (a) OMNIBUS", None),
            ("Cleanflight 2.0.0 (a) OMNIBUS", 165.0),
            ("Cleanflight 1.14.2 (a) NAZE", None),
            ("bdaf8ec", None),
        ],
    )
    def test_the_unit_of_the_voltage_is_by_the_version(
        self, tmp_path: Path, revision: str, volts: float | None
    ) -> None:
        """Before 3.1 counts of a 12-bit converter at 3.3 V, behind a divider of
        vbatscale / 10: 110 is 11 to 1.
        """
        found = read(
            tmp_path, log(rows(), Firmware_of_revision=revision, vbat_scale="110")
        )["voltage"]
        assert found.values[0, 0] == pytest.approx(
            volts or 1650 / 4095 * 3.3 * 11.0, rel=1e-12
        )

    @pytest.mark.parametrize("resolution", [1, 10])
    def test_the_gyro_before_its_filters_comes_first(
        self, tmp_path: Path, resolution: int
    ) -> None:
        changed = {
            "debug_mode": "6",
            "gyro_lpf1_static_hz": "250",
            "blackbox_high_resolution": str(resolution // 10),
        }
        found = read(tmp_path, log(rows(**UNFILTERED, **DEBUG), **changed))
        np.testing.assert_allclose(
            found["gyro"].values[0], np.deg2rad([30.0, -20.0, -70.0]) / resolution
        )
        # whole deg/s in both resolutions
        debug = read(tmp_path, log(rows(**DEBUG), **changed))
        np.testing.assert_allclose(
            debug["gyro"].values[0], np.deg2rad([7.0, 18.0, 29.0])
        )
        assert found.notes == debug.notes == (SCALE,)

    @pytest.mark.parametrize(
        ("version", "mode", "raw"),
        [
            ("3.0.1", "3", False),
            ("3.0.1", "6", False),
            ("3.1.7", "3", True),  # DEBUG_GYRO
            ("3.2.5", "8", True),  # DEBUG_GYRO_NOTCH
            ("3.2.5", "6", False),
            ("3.3.0", "6", True),  # DEBUG_GYRO_NOTCH
            ("4.5.1", "6", True),  # DEBUG_GYRO_SCALED
            ("4.5.1", "3", False),  # DEBUG_GYRO_FILTERED
            ("4.5.1", None, False),
            ("2025.12.1", "6", False),  # without DEBUG_GYRO_SCALED
        ],
    )
    def test_numbers_of_debug_modes_are_those_of_the_version(
        self, tmp_path: Path, version: str, mode: str | None, raw: bool
    ) -> None:
        changed = {
            "Firmware_of_revision": f"Betaflight {version} (a) X",
            "debug_mode": mode,
        }
        found = read(tmp_path, log(rows(**DEBUG), **changed, gyro_lpf1_static_hz="250"))
        assert found["gyro"].source.startswith("debug" if raw else "gyroADC")
        assert (
            "gyro: is filtered (gyro_lowpass_hz = 250) and late;" in found.notes[0]
        ) != raw

    def test_filters_of_a_log_are_named_unless_it_is_mapped(
        self, tmp_path: Path
    ) -> None:
        filters = {
            "gyro_lpf1_static_hz": "0",
            "gyro_lpf1_dyn_hz": "200,500",
            "gyro_notch_hz": "0,0",
            "acc_lpf_hz": "2500",
        }
        found = read(tmp_path, log(rows(), **filters))
        assert [note.partition(";")[0] for note in found.notes[:2]] == [
            "gyro: is filtered (gyro_lowpass_dyn_hz = [200, 500]) and late",
            "accelerometer: is filtered at 25 Hz and late",
        ]
        assert (
            "gyro: is filtered (unknown)"
            in read(tmp_path, log(rows(), gyro_lpf1_static_hz=None)).notes[0]
        )
        read(tmp_path, log(rows(), **filters, features="4096"))
        own = {
            "gyro": {"columns": [f"gyroADC[{k}]" for k in range(3)]},
            "accelerometer": {"columns": [f"accSmooth[{k}]" for k in range(3)]},
            "rotor_commands": {"columns": ["motor[0]"], "high": 2000.0},
        }
        assert load_flight(tmp_path / "flight.bbl", columns_from(own)).notes == ()

    @pytest.mark.parametrize("off", ["counts", "acc_1G"])
    def test_an_accelerometer_that_is_off_is_no_channel(
        self, tmp_path: Path, off: str
    ) -> None:
        written = rows(**(dict.fromkeys(SIGNED[3:], 0) if off == "counts" else {}))
        found = read(tmp_path, log(written, acc_1G="2048" if off == "counts" else "0"))
        assert "accelerometer" not in found
        assert found.notes == (
            "accelerometer: is switched off; set acc_hardware = AUTO and log again.",
            SCALE,
        )

    def test_speeds_of_rotors_are_by_the_poles_of_their_motors(
        self, tmp_path: Path
    ) -> None:
        """700 hundreds of electrical revolutions a minute at 12 poles, six of them to a
        turn.
        """
        found = read(tmp_path, log(rows(**{"eRPM[0]": 700})))["rotor_speeds"]
        assert found.values[0, 0] == pytest.approx(70_000 / 6 * 2 * np.pi / 60)

    def test_of_several_logs_in_a_file_the_longest_is_read(
        self, tmp_path: Path
    ) -> None:
        found = read(tmp_path, log(rows(4, 1000)) + log(rows(60)) + log(rows(5, 1000)))
        assert found["gyro"].time.size == 60
        note, _ = found.notes
        assert re.match(
            r"file: holds flights of \d+ bytes, .*; the longest is read, #2; write"
            r" FILE#1 ",
            note,
        )

    def test_any_log_of_a_file_is_read_by_its_number(self, tmp_path: Path) -> None:
        counts = (40, 60, 25)
        read(tmp_path, b"".join(log(rows(count)) for count in counts))
        for number, count in enumerate(counts, 1):
            found = load_flight(tmp_path / f"flight.bbl#{number}")
            assert (found.name, found["gyro"].time.size, found.notes) == (
                f"flight#{number}",
                count,
                (SCALE,),
            )
            assert [name for name in found.facts if name.startswith("flight #")] == [
                f"flight #{k}" for k in (1, 2, 3)
            ]
        with pytest.raises(
            ValueError,
            match=(
                r"flight\.bbl#4': flight #4: must be 1 to 3, the flights of this file$"
            ),
        ):
            load_flight(tmp_path / "flight.bbl#4")

    def test_a_log_of_inav_is_refused_with_what_to_do(self, tmp_path: Path) -> None:
        with pytest.raises(
            ValueError,
            match=(
                r"firmware: is INAV; decode its log by its own blackbox_decode to \.csv"
            ),
        ):
            read(tmp_path, log(rows(), Firmware_of_revision="INAV 7.1.0 (a) MATEKF405"))

    def test_a_mapping_replaces_what_the_head_says(self, tmp_path: Path) -> None:
        read(tmp_path, log(rows()))
        motors = {
            "columns": [f"motor[{k}]" for k in (3, 1, 2, 0)],
            "low": 0.0,
            "high": 2000.0,
        }
        found = load_flight(
            tmp_path / "flight.bbl", columns_from({"rotor_commands": motors})
        )
        assert found["rotor_commands"].values[0] == pytest.approx(
            [0.55, 0.25, 0.4, 0.1]
        )

    def test_of_damaged_logs_rows_are_lost_with_a_note_and_none_is_invented(
        self, tmp_path: Path
    ) -> None:
        draw, data = np.random.default_rng(0), log(rows(300))

        def found(data: bytes) -> tuple[set[tuple[float, ...]], tuple[str, ...]]:
            flight = read(tmp_path, data)
            stamps = (flight["gyro"].time + float(flight.facts["start"])).round(6)
            return {
                *map(tuple, np.column_stack([stamps, flight["gyro"].values]).tolist())
            }, flight.notes

        every, said, wrong = found(data)[0], 0, list[Any]()
        for k in range(100):
            begin = int(draw.integers(len(data) // 4, len(data) - 40))
            end = len(data) if k % 2 else begin + int(draw.integers(1, 12))
            try:
                left, notes = found(data[:begin] + data[end:])
            except ValueError as error:
                assert "\n" not in str(error)
                said += 1
                continue
            said += any("damaged or follow damage" in note for note in notes)
            wrong.append(len(left - every))
        # a frame has no check sum: one that lost bytes may take those of the next
        assert max(wrong) <= 2
        assert said > 40

    def test_of_a_damaged_head_a_flight_or_one_line_is_left(
        self, tmp_path: Path
    ) -> None:
        draw, data = np.random.default_rng(1), log(rows(20))
        begin = data.index(b"\nI") if b"\nI" in data else 900
        for _ in range(150):
            changed = bytearray(data)
            for place in draw.integers(20, begin, 3):
                changed[place] ^= 1 << int(draw.integers(0, 8))
            try:
                assert read(tmp_path, bytes(changed)).channels
            except ValueError as error:
                assert "\n" not in str(error)

    @pytest.mark.parametrize(
        "data", [b"", b"H Product:Blackbox", log([])[:400], log([]), bytes(3000)]
    )
    def test_files_that_hold_no_frame_are_one_line(
        self, tmp_path: Path, data: bytes
    ) -> None:
        with pytest.raises(ValueError, match="flight = ") as error:
            read(tmp_path, data)
        assert "\n" not in str(error.value)
