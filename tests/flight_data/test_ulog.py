"""Logs of PX4: files that are packed here by hand, and pyulog's own numbers of a
published one.
"""

from __future__ import annotations

import math
import struct
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from skyarm.flight_data.clocks import align_poses, clock_offset
from skyarm.flight_data.flight_data import load_flight
from skyarm.flight_data.ulog import NUMBER_OF_ROTORS

pyulog = pytest.importorskip("pyulog", reason="needs the extra 'flights'")

CUT = (
    Path(__file__).parents[1] / "data" / "flights" / "px4" / "sample_px4_events_cut.ulg"
)
MAGIC = b"ULog\x01\x12\x35\x01"

FORMATS = {
    "sensor_combined": (
        "uint64_t timestamp;float[3] gyro_rad;int32_t accelerometer_timestamp_relative;"
        "float[3] accelerometer_m_s2"
    ),
    "vehicle_angular_velocity": (
        "uint64_t timestamp;uint64_t timestamp_sample;float[3] xyz"
    ),
    "vehicle_attitude": "uint64_t timestamp;float[4] q;uint8_t quat_reset_counter",
    "vehicle_local_position": (
        "uint64_t timestamp;float x;float y;float z;float vx;float vy;float vz;"
        "bool xy_valid;bool z_valid;bool v_xy_valid;bool v_z_valid"
    ),
    "actuator_outputs": "uint64_t timestamp;uint32_t noutputs;float[8] output",
    "actuator_motors": "uint64_t timestamp;float[4] control",
    "battery_status": "uint64_t timestamp;float voltage_v",
    "esc_report": "float esc_rpm;uint8_t actuator_function",
    "esc_status": "uint64_t timestamp;uint8_t esc_count;esc_report[4] esc",
}
PACKED = {
    "sensor_combined": "<Q3fi3f",
    "vehicle_angular_velocity": "<QQ3f",
    "vehicle_attitude": "<Q4fB",
    "vehicle_local_position": "<Q6f4?",
    "actuator_outputs": "<QI8f",
    "actuator_motors": "<Q4f",
    "battery_status": "<Qf",
    "esc_status": "<QBfBfBfBfB",
}
PARAMETERS = {"MAV_TYPE": 2, "PWM_MIN": 1100, "PWM_MAX": 1900}


def message(letter: str, body: bytes) -> bytes:
    return struct.pack("<H", len(body)) + letter.encode() + body


def keyed(kind: str, name: str, value: bytes) -> bytes:
    key = f"{kind} {name}".encode()
    return bytes([len(key)]) + key + value


def packed(
    rows: Iterable[tuple[str, tuple[float, ...]]],
    parameters: dict[str, float] = PARAMETERS,
    more: bytes = b"",
) -> bytes:
    """A log with rows of topics; ``name:1`` is the second instance of a topic."""
    rows = list(rows)
    data = MAGIC + struct.pack("<Q", 1_000_000) + message("B", bytes(40))
    data += message("I", keyed("char[3]", "sys_name", b"PX4"))
    for name, fields in FORMATS.items():
        data += message("F", f"{name}:{fields};".encode())
    for name, value in parameters.items():
        whole = isinstance(value, int)
        text = keyed(
            "int32_t" if whole else "float",
            name,
            struct.pack("<i" if whole else "<f", value),
        )
        data += message("P", text)
    numbers = {
        name: k for k, name in enumerate(dict.fromkeys(name for name, _ in rows))
    }
    for name, k in numbers.items():
        topic, _, instance = name.partition(":")
        data += message("A", struct.pack("<BH", int(instance or 0), k) + topic.encode())
    for name, values in rows:
        data += message(
            "D",
            struct.pack("<H", numbers[name])
            + struct.pack(PACKED[name.partition(":")[0]], *values),
        )
    return data + more


def written(folder: Path, data: bytes) -> Path:
    path = folder / "flight.ulg"
    path.write_bytes(data)
    return path


def combined(
    stamp: int,
    rate: tuple[float, ...] = (1, 2, 3),
    force: tuple[float, ...] = (0, 0, -9.5),
):
    return "sensor_combined", (stamp, *rate, 2000, *force)


def outputs(stamp: int, *values: float, instance: int = 0):
    return f"actuator_outputs{':1' if instance else ''}", (
        stamp,
        8,
        *values,
        *[900.0] * (8 - len(values)),
    )


def test_axes_units_and_clocks_of_px4_become_ours(tmp_path: Path) -> None:
    half = 0.5**0.5
    rows = [
        combined(1_500_000),
        ("vehicle_attitude", (1_500_000, half, 0.0, 0.0, half, 0)),
        ("vehicle_local_position", (1_510_000, 1, 2, 3, 4, 5, 6, 1, 1, 1, 1)),
        ("battery_status", (1_520_000, 15.5)),
        ("esc_status", (1_530_000, 4, 3000.0, 0, 6000.0, 0, 0.0, 0, 60.0, 0)),
        outputs(1_540_000, 1100, 1500, 1900, 900, 1700),
    ]
    flight = load_flight(written(tmp_path, packed(rows)))
    np.testing.assert_allclose(flight["gyro"].values, [[1, -2, -3]])
    np.testing.assert_allclose(flight["accelerometer"].values, [[0, 0, 9.5]])
    np.testing.assert_allclose(flight["accelerometer"].time, [0.002], atol=1e-12)
    # a turn to the east about down is one to the right about up
    np.testing.assert_allclose(
        flight["quaternion"].values, [[half, 0, 0, -half]], atol=1e-7
    )
    np.testing.assert_allclose(flight["position"].values, [[1, -2, -3]])
    np.testing.assert_allclose(flight["velocity"].values, [[4, -5, -6]])
    np.testing.assert_allclose(flight["voltage"].values, [[15.5]])
    np.testing.assert_allclose(
        flight["rotor_speeds"].values, [[100 * np.pi, 200 * np.pi, 0, 2 * np.pi]]
    )
    np.testing.assert_allclose(flight["rotor_commands"].values, [[0, 0.5, 1, 0]])
    np.testing.assert_allclose(flight["rotor_commands"].time, [0.04], atol=1e-12)
    assert flight.facts["start"] == pytest.approx(1.5)
    assert flight.facts["parameter PWM_MIN"] == 1100
    assert (flight.facts["vehicle"], flight.facts["firmware"]) == ("PX4", "PX4")
    assert flight.notes == ()


def test_resets_of_the_estimator_are_steps_across_which_nothing_is_compared(
    tmp_path: Path,
) -> None:
    rows = [
        (
            "vehicle_attitude",
            (1_500_000 + 40_000 * k, 1, 0, 0, 0, (254 + (k > 2) + (k > 5)) % 256),
        )
        for k in range(9)
    ]
    flight = load_flight(written(tmp_path, packed([combined(1_400_000), *rows])))
    assert np.array(flight.jumps) == pytest.approx(
        np.array([(0.18, 0.22), (0.3, 0.34)]), abs=1e-9
    )
    assert flight.notes == (
        (
            "pose: the estimator reset it at 0.22, 0.34 s; nothing is compared across"
            " that."
        ),
    )
    assert flight.section(0.0, 0.2).jumps == flight.jumps


def test_the_place_of_the_inertial_unit_is_that_of_px4_s_parameters(
    tmp_path: Path,
) -> None:
    """Front, right, down of PX4; what nobody set is zero and states nothing."""
    rows = [combined(1_000_000 + 5_000 * k) for k in range(5)]
    names = [f"EKF2_IMU_POS_{axis}" for axis in "XYZ"]
    places = {
        values: PARAMETERS | dict(zip(names, values, strict=True))
        for values in ((0.05, 0.02, -0.03), (0.0,) * 3)
    }
    stated, unset = (
        load_flight(written(tmp_path, packed(rows, each))).place
        for each in places.values()
    )
    assert stated == pytest.approx({"place.x": 0.05, "place.y": -0.02, "place.z": 0.03})
    assert unset == {}


@pytest.mark.parametrize(
    ("valid", "position", "velocity"),
    [
        ((0, 1, 0, 1), 10, 10),
        ((1, 0, 1, 1), 10, 20),
        ((1, 1, 1, 0), 20, 10),
        ((1, 1, 0, 1), 20, 10),
    ],
)
def test_rows_that_px4_states_to_be_invalid_are_left_out(
    tmp_path: Path, valid: tuple[int, ...], position: int, velocity: int
) -> None:
    """Flags of xy, z, v_xy, v_z of the first ten of twenty rows; pyulog reads the same
    ones.
    """
    rows = [combined(1_000_000 + 10_000 * k) for k in range(20)]
    for k in range(20):
        flags = valid if k < 10 else (1, 1, 1, 1)
        rows.append(
            (
                "vehicle_local_position",
                (1_000_000 + 10_000 * k, k, 2, 3, 4, 5, k, *flags),
            )
        )
    path = written(tmp_path, packed(rows))
    flight = load_flight(path)
    given = next(
        each
        for each in pyulog.ULog(str(path)).data_list
        if each.name == "vehicle_local_position"
    ).data
    is_place = (given["xy_valid"] & given["z_valid"]).astype(bool)
    is_speed = (given["v_xy_valid"] & given["v_z_valid"]).astype(bool)
    assert (is_place.sum(), is_speed.sum()) == (position, velocity)
    np.testing.assert_array_equal(flight["position"].values[:, 0], given["x"][is_place])
    np.testing.assert_array_equal(
        flight["velocity"].values[:, 2], -given["vz"][is_speed]
    )
    names = [
        name
        for name, each in zip(
            ("xy_valid", "z_valid", "v_xy_valid", "v_z_valid"), valid, strict=True
        )
        if not each
    ]
    counted = ", ".join(f"{name} in 10" for name in names)
    assert (
        f"vehicle_local_position: is not valid by {counted} of 20 rows, which are left"
        " out." in flight.notes
    )


def test_a_position_that_is_never_valid_is_left_out_and_said(tmp_path: Path) -> None:
    rows = [
        combined(1_500_000),
        ("vehicle_local_position", (1_500_000, 1, 2, 3, 4, 5, 6, 0, 1, 1, 1)),
    ]
    flight = load_flight(written(tmp_path, packed(rows)))
    assert set(flight) == {"gyro", "accelerometer", "velocity"}
    assert flight.notes == (
        (
            "vehicle_local_position: is not valid by xy_valid in 1 of 1 rows, which are"
            " left out."
        ),
        (
            "position: no row of vehicle_local_position: x, y, z holds numbers, so that"
            " the channel is left out."
        ),
    )


@pytest.mark.parametrize(
    ("period", "taken"),
    [(4000, "sensor_combined"), (20_000, "vehicle_angular_velocity")],
)
def test_the_rate_before_the_filter_is_taken_unless_it_is_far_too_slow(
    tmp_path: Path, period: int, taken: str
) -> None:
    def rates(every: int) -> list[tuple[str, tuple[float, ...]]]:
        rows = [
            combined(1_000_000 + 4000 * k)
            for k in range(1, 50)
            if 4000 * k % period == 0
        ]
        filtered = [
            (
                "vehicle_angular_velocity",
                (1_000_100 + 4000 * k + 4 * k % 7 * 100, 1_000_000 + 4000 * k, 7, 7, 7),
            )
            for k in np.arange(1, 50, 1 / every)
        ]
        return sorted(
            rows + [(name, tuple(map(int, values))) for name, values in filtered],
            key=lambda row: row[1][0],
        )

    flight = load_flight(written(tmp_path, packed(rates(4))))
    assert flight["gyro"].source.startswith(taken)
    said = (
        "gyro: vehicle_angular_velocity is behind PX4's filters, whose lag counts as"
        " one of the rotors."
    )
    assert flight.notes == ((said,) if taken.startswith("vehicle") else ())
    if said in flight.notes:  # stamps of the samples, not of the messages
        np.testing.assert_allclose(np.diff(flight["gyro"].time), 0.001, atol=1e-9)


def test_a_source_without_any_whole_row_is_not_taken(tmp_path: Path) -> None:
    """Any column may be the empty one."""
    for empty in range(3):
        rate = tuple(math.nan if k == empty else 1.0 for k in range(3))
        rows: list[tuple[str, tuple[float, ...]]] = []
        for stamp in range(1_000_000, 1_200_000, 4000):
            rows += [
                combined(stamp, rate),
                ("vehicle_angular_velocity", (stamp + 100, stamp, 7, 7, 7)),
            ]
        flight = load_flight(written(tmp_path, packed(rows)))
        assert flight["gyro"].source.startswith("vehicle_angular_velocity")
        assert flight["accelerometer"].source.startswith("sensor_combined")
        assert [each.partition(" is")[0] for each in flight.notes] == [
            "gyro: vehicle_angular_velocity"
        ]


def test_outputs_belong_to_motors_by_their_functions_and_limits(tmp_path: Path) -> None:
    functions = {
        "CA_ROTOR_COUNT": 4,
        "PWM_MAIN_FUNC3": 101,
        "PWM_MAIN_FUNC1": 102,
        "PWM_MAIN_MAX1": 1500,
    }
    functions |= {"PWM_AUX_FUNC2": 103, "PWM_AUX_FUNC1": 104, "PWM_AUX_MIN1": 1200}
    rows = [
        outputs(1_500_000, 1250, 0, 1250, 0),
        outputs(1_500_500, 1600, 1800, instance=1),
        outputs(1_510_000, 1500, 0, 1000, 0),
        outputs(1_510_500, 2000, 1000, instance=1),
    ]
    flight = load_flight(written(tmp_path, packed(rows, functions)))
    np.testing.assert_allclose(
        flight["rotor_commands"].values, [[0.25, 0.5, 0.8, 0.5], [0.0, 1.0, 0.8, 0.5]]
    )
    assert flight["rotor_commands"].source.endswith(
        "output MAIN 3, output MAIN 1, output AUX 2, output AUX 1"
    )
    assert flight.notes == ()
    common = {
        **functions,
        "PWM_MIN": 900,
        "PWM_MAIN_MIN": 1100,
        "PWM_MAIN_FUNC7": 101,
    }  # of the first bank, the first of two
    shares = load_flight(written(tmp_path, packed(rows, common)))[
        "rotor_commands"
    ].values
    np.testing.assert_allclose(shares[0], [150 / 900, 150 / 400, 0.8, 0.5])


@pytest.mark.parametrize(
    ("parameters", "note", "width"),
    [
        ({"MAV_TYPE": 22}, "no parameter says how many rotors", 0),
        ({"MAV_TYPE": 2}, "limits of 1000 and 2000 us are assumed", 4),
        (
            {"MAV_TYPE": 2, "PWM_MIN": 1900, "PWM_MAX": 1100},
            "limits are 1900 and 1100",
            0,
        ),
        (
            {"MAV_TYPE": 2, "PWM_MIN": 1500, "PWM_MAX": 1500, "THR_MDL_FAC": 0.3},
            "limits are 1500 and 1500",
            0,
        ),
        ({"MAV_TYPE": 2, "CA_ROTOR_COUNT": 3}, "limits of 1000 and 2000 us", 3),
        ({"MAV_TYPE": 2, "CA_ROTOR_COUNT": 13}, "limits of 1000 and 2000 us", 4),
    ],
)
def test_what_is_unknown_of_the_rotors_is_said(
    tmp_path: Path, parameters: dict[str, float], note: str, width: int
) -> None:
    esc = "esc_status", (1_530_000, 4, 3000.0, 0, 6000.0, 0, 0.0, 0, 60.0, 0)
    flight = load_flight(
        written(
            tmp_path,
            packed([combined(1_500_000), outputs(1_500_000, 1500), esc], parameters),
        )
    )
    assert len(flight.notes) == 1
    assert note in flight.notes[0]
    assert (
        flight["rotor_commands"].values.shape[1] == width
        if width
        else "rotor_commands" not in flight
    )
    assert ("rotor_speeds" in flight) == (parameters["MAV_TYPE"] == 2)


def test_numbers_of_rotors_are_those_of_mavlink_s_types() -> None:
    mavlink = pytest.importorskip(
        "pymavlink.dialects.v20.common", reason="needs the extra 'test'"
    )
    rotors = {
        "TRICOPTER": 3,
        "QUADROTOR": 4,
        "HEXAROTOR": 6,
        "OCTOROTOR": 8,
        "DECAROTOR": 10,
        "DODECAROTOR": 12,
    }
    assert {
        getattr(mavlink, f"MAV_TYPE_{name}"): count for name, count in rotors.items()
    } == NUMBER_OF_ROTORS


def test_the_faster_topic_of_motors_is_taken_where_both_are_signals(
    tmp_path: Path,
) -> None:
    motors = [
        ("actuator_motors", (1_500_000 + 1000 * k, 0.1, 0.2, 0.3, 0.4))
        for k in range(50)
    ]
    rows = [*motors, *[outputs(1_500_000 + 10_000 * k, 1500) for k in range(5)]]
    rows.sort(key=lambda row: row[1][0])
    assert load_flight(written(tmp_path, packed(rows)))[
        "rotor_commands"
    ].source.startswith("actuator_motors")
    assert load_flight(written(tmp_path, packed(motors))).notes == ()


@pytest.mark.parametrize("volts", [0.0, 11.5])
def test_a_voltage_of_zero_is_that_of_no_battery_monitor(
    tmp_path: Path, volts: float
) -> None:
    rows = [
        combined(1_500_000),
        ("battery_status", (1_500_000, volts)),
        ("battery_status", (1_600_000, 0.0)),
    ]
    flight = load_flight(written(tmp_path, packed(rows)))
    assert ("voltage" in flight) == (volts > 0.0)
    said = ("voltage: is 0 throughout, as without a battery monitor, and is left out.",)
    assert flight.notes == (() if volts else said)


def test_shares_of_thrust_become_signals_and_a_stopped_motor_has_none(
    tmp_path: Path,
) -> None:
    """The factor weighs the square of a signal in its thrust; PX4 marks a stopped motor
    by NaN.
    """
    shares = (0.1, 0.55, 1.0, math.nan)
    for factor in (0.3, 1.0):
        rows = [combined(1_500_000), ("actuator_motors", (1_500_000, *shares))]
        flight = load_flight(
            written(tmp_path, packed(rows, {**PARAMETERS, "THR_MDL_FAC": factor}))
        )
        signal = flight["rotor_commands"].values[0]
        np.testing.assert_allclose(
            factor * signal**2 + (1.0 - factor) * signal,
            [0.1, 0.55, 1.0, 0.0],
            atol=1e-7,
        )
        assert flight.notes == ()


KINDS: dict[str, tuple[dict[str, float], int, tuple[float, ...]]] = {
    # PX4's drivers: int(0.06 x 1999) to 1999 with DSHOT_MIN of 0.06, whatever MIN and
    # MAX say; the rest as stated
    "DShot": (
        {
            "PWM_AUX_TIM1": -4,
            "DSHOT_MIN": 0.06,
            "PWM_AUX_MIN1": 1000,
            "PWM_AUX_MAX1": 2000,
        },
        1,
        (119.0, 1999.0),
    ),
    "OneShot": (
        {"PWM_AUX_TIM1": -1, "PWM_AUX_MIN1": 1200, "PWM_AUX_MAX1": 2000},
        1,
        (1200.0, 2000.0),
    ),
    "UAVCAN": ({"UAVCAN_EC_MIN1": 100, "UAVCAN_EC_MAX1": 8000}, 1, (100.0, 8000.0)),
    "Gazebo": ({"SIM_GZ_EC_MIN1": 150, "SIM_GZ_EC_MAX1": 1000}, 0, (150.0, 1000.0)),
    "Gazebo, second": (
        {"SIM_GZ_EC_MIN1": 150, "SIM_GZ_EC_MAX1": 1000},
        1,
        (150.0, 1000.0),
    ),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("motors", [False, True])
def test_outputs_of_each_driver_are_shares_of_its_own_range(
    tmp_path: Path, kind: str, motors: bool
) -> None:
    """Output 1 drives motor 2 and so on; the other instance of outputs belongs to
    servos.
    """
    parameters, instance, (low, high) = KINDS[kind]
    bank = next(name for name in parameters if name.endswith("MIN1")).removesuffix(
        "_MIN1"
    )
    every = {"CA_ROTOR_COUNT": 3, **parameters}
    every |= {f"{bank}_FUNC{k + 1}": motor for k, motor in enumerate((102, 103, 101))}
    every |= {
        f"{bank}_{end}{k}": parameters[f"{bank}_{end}1"]
        for end in ("MIN", "MAX")
        for k in (2, 3)
    }
    sent = [low + share * (high - low) for share in (0.5, 0.25, 0.75)]
    rows = [
        outputs(1_500_000, *sent, instance=instance),
        outputs(1_500_000, 1, 2, 3, instance=1 - instance),
    ]
    rows += [("actuator_motors", (1_500_000, 0.75, 0.5, 0.25, math.nan))] * motors
    flight = load_flight(written(tmp_path, packed([combined(1_500_000), *rows], every)))
    np.testing.assert_allclose(
        flight["rotor_commands"].values, [[0.75, 0.5, 0.25]], atol=1e-6
    )
    assert flight["rotor_commands"].source.startswith("actuator_motors") == (
        motors and kind != "OneShot"
    )
    assert flight.notes == ()


@pytest.mark.parametrize(
    "more",
    [
        {"PWM_MAIN_MIN": 1000, "PWM_MAIN_MAX": 2000},
        {"PWM_MIN": 1000},
        {"SYS_USE_IO": 1},
    ],
)
def test_outputs_of_dshot_before_functions_of_outputs_have_its_range(
    tmp_path: Path, more: dict[str, float]
) -> None:
    """int(0.06 x 1999) to 1999, as of PX4's driver up to 1.13, where DSHOT_CONFIG alone
    states it.
    """
    sent, parameters = (
        np.array([850.0, 900.0, 1000.0, 1300.0]),
        {
            "MAV_TYPE": 2,
            "DSHOT_MIN": 0.06,
            **more,
        },
    )
    rows = [combined(1_500_000), outputs(1_500_000, *sent)]
    flight = load_flight(
        written(tmp_path, packed(rows, {**parameters, "DSHOT_CONFIG": 600}))
    )
    np.testing.assert_allclose(
        flight["rotor_commands"].values, [(sent - 119.0) / (1999.0 - 119.0)], atol=1e-6
    )
    said = (
        "rotor_commands: outputs of 119 to 1999 are assumed, of DShot, as DSHOT_CONFIG"
        " states it."
    )
    assert flight.notes == (said,)
    pulses = load_flight(
        written(tmp_path, packed(rows, {**parameters, "DSHOT_CONFIG": 0}))
    )
    np.testing.assert_allclose(
        pulses["rotor_commands"].values, [[0.0, 0.0, 0.0, 0.3]], atol=1e-6
    )


def test_beside_outputs_of_dshot_those_of_an_io_chip_are_pulses(tmp_path: Path) -> None:
    rows = [
        combined(1_500_000),
        outputs(1_500_000, 1250),
        outputs(1_500_000, 500, instance=1),
    ]
    parameters = {
        "MAV_TYPE": 2,
        "DSHOT_CONFIG": 600,
        "SYS_USE_IO": 1,
        "PWM_MIN": 1000,
        "PWM_MAX": 2000,
    }
    assert (
        load_flight(written(tmp_path, packed(rows, parameters)))[
            "rotor_commands"
        ].values[0, 0]
        == 0.25
    )


def test_speeds_are_those_of_the_motor_that_a_controller_drives(tmp_path: Path) -> None:
    given = "esc_status", (1_500_000, 4, 700.0, 103, 500.0, 101, 800.0, 104, 600.0, 102)
    speeds = np.array([[500.0, 600.0, 700.0, 800.0]])
    flight = load_flight(written(tmp_path, packed([combined(1_500_000), given])))
    np.testing.assert_allclose(flight["rotor_speeds"].values, speeds * np.pi / 30.0)
    # whose plugin puts rad/s there
    gazebo = {"CA_ROTOR_COUNT": 4, "SIM_GZ_EC_FUNC1": 101}
    flight = load_flight(
        written(tmp_path, packed([combined(1_500_000), given], gazebo))
    )
    np.testing.assert_allclose(flight["rotor_speeds"].values, speeds)
    silent = "esc_status", (1_500_000, 0, *(0.0, 0) * 4)
    assert "rotor_speeds" not in load_flight(
        written(tmp_path, packed([combined(1_500_000), silent]))
    )


@pytest.mark.parametrize(
    ("motors", "outputs_", "taken"),
    [
        ((10, 1000), (30, 10_000), "actuator_motors"),
        ((30, 10_000), (10, 1000), "rotor signals"),
        ((10, 10_000), (30, 10_000), "rotor signals"),  # as fast as the first choice
        ((1, 1), (30, 10_000), "rotor signals"),
    ],
)
def test_of_two_topics_the_one_of_the_higher_rate_is_taken_and_not_that_of_more_rows(
    tmp_path: Path, motors: tuple[int, int], outputs_: tuple[int, int], taken: str
) -> None:
    """Rows and us between them; a log begins hours after the computer did."""
    start = 10**10
    rows = [
        ("actuator_motors", (start + motors[1] * k, 0.1, 0.2, 0.3, 0.4))
        for k in range(motors[0])
    ]
    rows += [outputs(start + outputs_[1] * k, 1500) for k in range(outputs_[0])]
    rows.sort(key=lambda row: row[1][0])
    assert load_flight(written(tmp_path, packed(rows)))[
        "rotor_commands"
    ].source.startswith(taken)


def test_a_mapping_takes_any_topic_and_instance(tmp_path: Path) -> None:
    (tmp_path / "columns.toml").write_text(
        '[rotor_commands]\ntopic = "actuator_outputs[1]"\ncolumns = ["output[1]"]\nlow'
        " = 1000\nhigh = 2000\n"
    )
    rows = [
        combined(1_500_000),
        outputs(1_500_000, 1, 2),
        outputs(1_500_000, 1, 1750, instance=1),
    ]
    flight = load_flight(
        written(tmp_path, packed(rows, {"MAV_TYPE": 22})), tmp_path / "columns.toml"
    )
    assert flight.notes == ()
    np.testing.assert_allclose(flight["rotor_commands"].values, [[0.75]])
    assert "gyro" in flight


def test_losses_are_named(tmp_path: Path) -> None:
    rows = [combined(1_500_000 + 4000 * k) for k in range(20)]
    dropout = message("O", struct.pack("<H", 120))
    flight = load_flight(written(tmp_path, packed(rows, more=dropout + dropout)))
    assert flight.notes == (
        "file: the logger lost messages 2 times, for 240 ms in all.",
    )
    flight = load_flight(written(tmp_path, packed(rows)[:-5]))
    assert flight["gyro"].time.size == 19
    assert flight.notes == ("file: ends within a message; it is cut off.",)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"nonsense", "first bytes = 6e6f6e73656e73: must be 554c6f67011235"),
        (MAGIC, "first bytes = 554c6f67011235: must be"),
        (packed([]), "file: holds no topic with numbers"),
        (
            packed([]).replace(bytes(40), bytes(8) + b"\2" + bytes(31)),
            "flags = 0200000000000000: must be",
        ),
        (
            packed([]).replace(bytes(40), bytes(15) + b"\1" + bytes(24)),
            "flags = 0000000000000001: must be",
        ),
        (packed([("battery_status", (1, 2))])[:-1], "file: holds no topic"),
    ],
)
def test_a_wrong_file_is_one_line(tmp_path: Path, data: bytes, words: str) -> None:
    with pytest.raises(ValueError, match=words) as error:
        load_flight(written(tmp_path, data))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        # rows are shorter than the format
        (b"float[3] gyro_rad", b"float[9] gyro_rad"),
        (b"float[3] gyro_rad", b"flaat[3] gyro_rad"),
        (b"float[3] gyro_rad", b"sensor_combined g"),
        (b"float[3] gyro_rad", b"float[99999] rads"),
        (b"esc_report[4] esc", b"esc_status[4] esc"),
        (b"uint64_t timestamp;float voltage_v", b"uint64_t timestamp;float timestamp"),
    ],
)
def test_a_damaged_format_loses_its_topic_only(
    tmp_path: Path, before: bytes, after: bytes
) -> None:
    rows = [
        row
        for k in range(9)
        for row in (combined(10**6 + k), ("battery_status", (10**6 + k, 15.0)))
    ]
    rows += [("vehicle_attitude", (10**6 + k, 1, 0, 0, 0, 0)) for k in range(9)]
    data = packed(rows)
    assert data.count(before) == 1
    flight = load_flight(written(tmp_path, data.replace(before, after)))
    lost = (
        {"gyro", "accelerometer"}
        if b"gyro" in before
        else {"voltage"}
        if b"voltage" in before
        else set()
    )
    assert set(flight) == {"gyro", "accelerometer", "voltage", "quaternion"} - lost
    assert bool(flight.notes) == bool(lost)


def test_the_rows_behind_damage_are_read(tmp_path: Path) -> None:
    rows = [combined(1_500_000 + 4000 * k, (k, 0, 0)) for k in range(100)]
    data = bytearray(packed(rows))
    size = 3 + 2 + struct.calcsize(PACKED["sensor_combined"])
    data[-50 * size] ^= 0xFF  # the length of a message
    data[-20 * size + 2] = 0  # the type of another
    flight = load_flight(written(tmp_path, bytes(data)))
    assert sorted(
        set(range(100)) - set(flight["gyro"].values[:, 0].astype(int).tolist())
    ) == [50, 80]
    assert flight.notes == (
        "file: is damaged at 2 places; messages there are left out.",
    )


def test_a_file_cut_at_any_byte_of_its_last_message_is_called_cut_and_not_damaged(
    tmp_path: Path,
) -> None:
    data = packed([combined(1_500_000 + 4000 * k) for k in range(4)])
    size = 3 + 2 + struct.calcsize(PACKED["sensor_combined"])
    for left in range(1, size):
        flight = load_flight(written(tmp_path, data[: len(data) - size + left]))
        assert flight["gyro"].time.size == 3
        assert flight.notes == ("file: ends within a message; it is cut off.",), left
    whole = load_flight(written(tmp_path, data[:-size]))
    assert (whole["gyro"].time.size, whole.notes) == (3, ())


TAILS = [
    b"\x02\x00?xy",
    b"\xff\xff?",
    b"\x00\x00D" + bytes(9),
    message("D", bytes([9, 9, 1])),
]


@pytest.mark.parametrize("tail", TAILS)
def test_bytes_that_begin_no_message_at_the_end_of_a_file_are_damage(
    tmp_path: Path, tail: bytes
) -> None:
    rows = [combined(1_500_000 + 4000 * k) for k in range(4)]
    flight = load_flight(written(tmp_path, packed(rows, more=tail)))
    assert flight["gyro"].time.size == 4
    assert flight.notes == (
        "file: is damaged at 1 places; messages there are left out.",
    )


def test_a_file_that_is_damaged_and_then_cut_is_said_to_be_both(tmp_path: Path) -> None:
    data = bytearray(packed([combined(1_500_000 + 4000 * k) for k in range(12)])[:-5])
    size = 3 + 2 + struct.calcsize(PACKED["sensor_combined"])
    # the length of a message, which is now beyond the end
    data[-7 * size + 1 + 5] = 0xFF
    flight = load_flight(written(tmp_path, bytes(data)))
    assert flight["gyro"].time.size == 10
    assert flight.notes == (
        "file: is damaged at 1 places; messages there are left out.",
        "file: ends within a message; it is cut off.",
    )


def test_data_that_were_appended_after_a_crash_are_read(tmp_path: Path) -> None:
    whole = packed([combined(1_500_000 + 4000 * k) for k in range(10)])
    later = message(
        "D",
        struct.pack("<H", 0)
        + struct.pack(PACKED["sensor_combined"], *combined(2_000_000)[1]),
    )
    cut = whole[:-7]
    flags = bytes(8) + b"\1" + bytes(7) + struct.pack("<3Q", len(cut), 0, 0)
    flight = load_flight(written(tmp_path, cut.replace(bytes(40), flags, 1) + later))
    assert flight["gyro"].time.size == 10
    assert flight["gyro"].time[-1] == pytest.approx(0.5)
    assert flight.notes == ()


def test_a_log_to_which_nothing_was_appended_after_its_crash_is_cut_off(
    tmp_path: Path,
) -> None:
    """Its flags have the place already, at the end of the file, where no data
    follow.
    """
    cut = packed([combined(1_500_000 + 4000 * k) for k in range(10)])[:-7]
    flags = bytes(8) + b"\1" + bytes(7) + struct.pack("<3Q", len(cut), 0, 0)
    flight = load_flight(written(tmp_path, cut.replace(bytes(40), flags, 1)))
    assert flight["gyro"].time.size == 9
    assert flight.notes == ("file: ends within a message; it is cut off.",)


def test_a_published_log_has_the_numbers_of_pyulog_and_stands_upright() -> None:
    flight, log = load_flight(CUT), pyulog.ULog(str(CUT))
    topics = {(each.name, each.multi_id): each.data for each in log.data_list}
    flip = np.array([1.0, -1.0, -1.0])
    for name, topic, field in (
        ("gyro", "sensor_combined", "gyro_rad"),
        ("accelerometer", "sensor_combined", "accelerometer_m_s2"),
    ):
        given = topics[topic, 0]
        table = np.stack([given[f"{field}[{k}]"] for k in range(3)], axis=1)
        np.testing.assert_array_equal(flight[name].values, table * flip)
        np.testing.assert_allclose(
            flight[name].time + flight.facts["start"],
            (given["timestamp"] - 0.5 * given[f"{name}_integral_dt"]) * 1e-6,
            rtol=0,
            atol=1e-6,
        )
    # the estimator's attitude has the clock of its samples; of the stamps alone it
    # seems to be 1.9 ms late
    assert abs(clock_offset(flight, "quaternion").offset) < 5e-4
    motors, given = topics["actuator_motors", 0], flight["rotor_commands"]
    rows = np.searchsorted(
        motors["timestamp"], topics["actuator_outputs", 0]["timestamp"]
    )
    wanted = np.stack([motors[f"control[{k}]"] for k in range(4)], axis=1)[
        np.clip(rows, 0, len(motors["timestamp"]) - 1)
    ]
    # an output is a whole number of microseconds
    assert np.abs(given.values - wanted).max() < 1e-3
    assert flight["accelerometer"].values[:, 2].mean() == pytest.approx(9.8, abs=0.3)
    rising = np.interp(
        flight["velocity"].time,
        flight["position"].time,
        flight["position"].values[:, 2],
    )
    assert (
        np.corrcoef(
            np.gradient(rising, flight["velocity"].time),
            flight["velocity"].values[:, 2],
        )[0, 1]
        > 0.9
    )


def test_without_pyulog_the_extra_that_has_it_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyulog", None)
    with pytest.raises(
        ValueError,
        match=r"pyulog: is missing; a log of PX4 needs the extra 'flights': ",
    ) as error:
        load_flight(written(tmp_path, packed([combined(1_500_000)])))
    assert "\n" not in str(error.value)


def test_rows_lack_the_padding_at_the_end_of_their_format(tmp_path: Path) -> None:
    data = packed([("battery_status", (1_500_000 + k, 15.0 + k)) for k in range(4)])
    (size,) = struct.unpack("<H", data[data.index(b"battery_status:") - 3 :][:2])
    for padding in (
        b"uint8_t[4] _padding0;",
        b"uint8_t[3] _padding0;uint8_t _padding1;",
    ):
        head = struct.pack("<H", size + len(padding)) + b"F"
        own = data.replace(
            struct.pack("<H", size) + b"Fbattery_status:", head + b"battery_status:"
        )
        flight = load_flight(
            written(
                tmp_path,
                own.replace(b"float voltage_v;", b"float voltage_v;" + padding),
            )
        )
        np.testing.assert_allclose(flight["voltage"].values.ravel(), [15, 16, 17, 18])
        assert flight.notes == ()


@pytest.mark.parametrize(
    ("letter", "body"),
    [
        # changed in flight
        ("P", keyed("int32_t", "PWM_MIN", struct.pack("<i", 1234))),
        ("P", keyed("float", "PWM_MIN", b"12")),  # a value of two bytes
        ("O", b"1"),
        ("A", b"\0"),
        ("I", keyed("uint32_t", "ver_data_format", b"1")),
        ("A", struct.pack("<BH", 0, 7) + b"esc_report"),  # a topic without times
        ("F", b"sensor_combined:uint64_t timestamp;"),
        ("L", b"6" + bytes(8) + b"a text"),
    ],
)
def test_what_pyulog_would_stumble_over_does_not_end_the_rows(
    tmp_path: Path, letter: str, body: bytes
) -> None:
    rows = [combined(1_500_000 + 4000 * k) for k in range(4)]
    data = packed(rows)
    size = 3 + 2 + struct.calcsize(PACKED["sensor_combined"])
    first = data.index(b"A\0\0\0sensor") - 2
    for place in (first, len(data) - size):
        flight = load_flight(
            written(tmp_path, data[:place] + message(letter, body) + data[place:])
        )
        assert flight["gyro"].time.size == 4
        assert flight.facts["parameter PWM_MIN"] == (
            1234 if b"int32_t PWM" in body and place == first else 1100
        )
        assert flight.notes == ()


def test_a_number_that_is_taken_keeps_its_topic(tmp_path: Path) -> None:
    data = packed([combined(1_500_000 + 4000 * k) for k in range(4)])
    flight = load_flight(
        written(
            tmp_path, data + message("A", struct.pack("<BH", 0, 0) + b"battery_status")
        )
    )
    assert (flight["gyro"].time.size, flight.notes) == (4, ())


def test_stamps_of_a_recorder_that_takes_every_so_many_rows_stay() -> None:
    """PX4 stamps attitudes with the samples of the gyro, of which it logs every 12th or
    13th: an even line is worse.
    """
    flight = load_flight(CUT)
    # to whole microseconds, the gyro at the end of the 4 ms of its mean: the rows that
    # the attitude is stamped with
    late = {"gyro": 0.002, "quaternion": 0.0}
    stamped = {
        name: replace(flight[name], time=np.round(flight[name].time + late[name], 6))
        for name in late
    }
    assert np.isin(stamped["quaternion"].time, stamped["gyro"].time).all()
    aligned, clock = align_poses(flight.with_channels(stamped))
    assert clock is not None
    assert "straightened" not in " ".join(aligned.notes)


def test_the_time_of_a_mapping_is_on_the_clock_of_the_rest_of_the_file(
    tmp_path: Path,
) -> None:
    (tmp_path / "columns.toml").write_text(
        '[time]\ncolumn = "timestamp"\nunit = "ms"\n[voltage]\ntopic ='
        ' "battery_status"\ncolumns = ["voltage_v"]\n'
    )
    rows = [
        combined(1_500_000),
        ("battery_status", (1_700, 15.0)),
        ("battery_status", (1_800, 15.0)),
    ]
    flight = load_flight(written(tmp_path, packed(rows)), tmp_path / "columns.toml")
    np.testing.assert_allclose(flight["voltage"].time, [0.2, 0.3], atol=1e-9)
    np.testing.assert_allclose(flight["gyro"].time, [0.0], atol=1e-9)


def test_stamps_that_a_mapping_names_in_a_published_log_are_those_of_pyulog(
    tmp_path: Path,
) -> None:
    (tmp_path / "columns.toml").write_text(
        '[time]\nunit = "us"\n[gyro]\ntopic = "sensor_combined"\ntime = "timestamp"\n'
        'columns = ["gyro_rad[0]", "gyro_rad[1]", "gyro_rad[2]"]\n'
    )
    flight = load_flight(CUT, tmp_path / "columns.toml")
    given = next(
        each
        for each in pyulog.ULog(str(CUT)).data_list
        if each.name == "sensor_combined"
    ).data
    for name, late in (
        ("gyro", 0.0),
        ("accelerometer", 0.5e-6 * given["accelerometer_integral_dt"]),
    ):
        stamps = given["timestamp"] * 1e-6 - late
        np.testing.assert_allclose(
            flight[name].time + flight.facts["start"], stamps, rtol=0, atol=1e-6
        )


@pytest.mark.parametrize(
    ("kind", "letter", "unit"), [("uint32_t", "I", 1.0), ("float", "f", 1e-6)]
)
def test_a_mean_over_a_span_is_put_at_the_middle_of_the_span(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, letter: str, unit: float
) -> None:
    """PX4's VehicleIMU::Publish: imu.timestamp_sample = _gyro_timestamp_sample_last,
    delta_angle / delta_angle_dt.

    The span is in us (msg/SensorCombined.msg), up to PX4 1.10 in s.
    """
    fields = f"{kind} gyro_integral_dt;{kind} accelerometer_integral_dt"
    monkeypatch.setitem(
        FORMATS, "sensor_combined", f"{FORMATS['sensor_combined']};{fields}"
    )
    monkeypatch.setitem(
        PACKED, "sensor_combined", f"{PACKED['sensor_combined']}2{letter}"
    )
    spans = [value if unit == 1.0 else value * unit for value in (4000, 6000)]
    rows = [
        (name, (*values, *spans))
        for name, values in (combined(1_500_000 + 4000 * k) for k in range(5))
    ]
    flight = load_flight(
        written(tmp_path, packed([*rows, ("battery_status", (1_500_000, 15.0))]))
    )
    # of the accelerometer, 2 ms after the gyro's stamp
    start = 1.5 + 1e-6 * (2000 - 3000) - flight.facts["start"]
    np.testing.assert_allclose(
        flight["gyro"].time,
        1.498 - flight.facts["start"] + 0.004 * np.arange(5),
        atol=1e-8,
    )
    np.testing.assert_allclose(
        flight["accelerometer"].time, start + 0.004 * np.arange(5), atol=1e-8
    )
    np.testing.assert_allclose(flight["voltage"].time, [0.002], atol=1e-8)


@pytest.mark.parametrize(("parameter", "flags"), [(0, 0), (2, 0), (0, 2)])
def test_commands_of_motors_that_turn_both_ways_are_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, parameter: int, flags: int
) -> None:
    """PX4's FunctionMotors::updateValues remaps a share from [0, 1] to [-1, 1] only
    where the motor's bit is 0.
    """
    monkeypatch.setitem(
        FORMATS,
        "actuator_motors",
        "uint64_t timestamp;float[4] control;uint16_t reversible_flags",
    )
    monkeypatch.setitem(PACKED, "actuator_motors", "<Q4fH")
    rows = [
        combined(1_500_000),
        outputs(1_500_000, 1500),
        ("actuator_motors", (1_500_000, 0.5, 0, 0, 0, flags)),
    ]
    flight = load_flight(
        written(tmp_path, packed(rows, {**PARAMETERS, "CA_R_REV": parameter}))
    )
    assert ("rotor_commands" in flight) == (not (parameter or flags))
    assert ("motors turn both ways (CA_R_REV)" in " ".join(flight.notes)) == bool(
        parameter or flags
    )


@pytest.mark.parametrize("motors", [False, True])
def test_outputs_that_may_be_pulse_widths_of_servos_are_not_those_of_uavcan(
    tmp_path: Path, motors: bool
) -> None:
    """1..8191 of UAVCAN_EC_MIN, MAX by default; pulse widths of servos on the pins lie
    between.
    """
    every = {
        "CA_ROTOR_COUNT": 2,
        "UAVCAN_EC_FUNC1": 101,
        "UAVCAN_EC_FUNC2": 102,
        "PWM_MAIN_FUNC1": 201,
    }
    rows = [
        combined(1_500_000),
        outputs(1_500_000, 1500, 1500),
        outputs(1_500_000, 4096, 2048, instance=1),
    ]
    rows += [("actuator_motors", (1_500_000, 0.5, 0.25, math.nan, math.nan))] * motors
    flight = load_flight(written(tmp_path, packed(rows, every)))
    said = (
        "rotor_commands: actuator_outputs or actuator_outputs[1] may be that of"
        " UAVCAN_EC; a columns.toml may name one."
    )
    assert flight.notes == (() if motors else (said,))
    if motors:
        np.testing.assert_allclose(
            flight["rotor_commands"].values, [[0.5, 0.25]], atol=1e-6
        )
    else:
        assert "rotor_commands" not in flight


@pytest.mark.parametrize(
    ("ordering", "places"), [(0, (0, 1, 2, 3)), (1, (1, 2, 3, 0)), (2, (0, 2, 3, 1))]
)
def test_motors_of_px4_before_functions_have_the_order_of_its_parameter(
    tmp_path: Path, ordering: int, places: tuple[int, ...]
) -> None:
    """MixingOutput::reorderedMotorIndex of PX4 1.13: Betaflight 0..3 -> 1, 2, 3, 0;
    clockwise 0..3 -> 0, 2, 3, 1.
    """
    signals, sent = np.array([0.1, 0.2, 0.3, 0.4]), np.zeros(4)
    sent[[*places]] = 1100 + 800 * signals
    rows = [combined(1_500_000), outputs(1_500_000, *sent)]
    flight = load_flight(
        written(tmp_path, packed(rows, {**PARAMETERS, "MOT_ORDERING": ordering}))
    )
    np.testing.assert_allclose(flight["rotor_commands"].values, [signals], atol=1e-6)


def test_a_speed_that_a_controller_reports_has_the_time_of_its_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each esc[k].timestamp is its own (msg/EscReport.msg); speeds that rise evenly;
    the last one states no time.
    """
    monkeypatch.setitem(
        FORMATS,
        "esc_report",
        "uint64_t timestamp;float esc_rpm;uint8_t actuator_function",
    )
    monkeypatch.setitem(PACKED, "esc_status", "<QB" + 4 * "QfB")
    rows = [combined(1_500_000)]
    for stamp in range(1_500_000, 2_000_000, 50_000):
        reports = [
            (stamp - late, (stamp - late) / 1000, 0) for late in (0, 10_000, 45_000)
        ]
        rows.append(
            (
                "esc_status",
                (
                    stamp,
                    4,
                    *(each for report in reports for each in report),
                    0,
                    stamp / 1000,
                    0,
                ),
            )
        )
    flight = load_flight(written(tmp_path, packed(rows)))
    read, wanted = (
        flight["rotor_speeds"],
        np.arange(1500.0, 2000.0, 50.0)[:-1, None] * np.pi / 30,
    )
    np.testing.assert_allclose(read.time, 0.05 * np.arange(10), atol=1e-9)
    np.testing.assert_allclose(read.values[:-1], np.tile(wanted, 4), rtol=1e-6)
