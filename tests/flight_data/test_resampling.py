"""Flights on an even clock: holds, means, gaps, and what is said of them."""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.resampling import resample


def flight(**channels: tuple[np.ndarray, np.ndarray]) -> FlightData:
    made = {name: Channel(time=time, values=values, source=name) for name, (time, values) in channels.items()}
    return FlightData(name="flight", file="", channels=made, notes=("before.",))


def three(time: np.ndarray, of: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return time, np.stack([of, 2 * of, -of], axis=1)


def test_a_command_holds_and_a_measurement_is_interpolated() -> None:
    slow, fast = np.arange(0, 2.001, 0.1), np.arange(0, 2.0001, 0.004)
    commands = np.arange(slow.size, dtype=float)[:, None]
    given = flight(gyro=three(fast, np.sin(fast)), velocity=three(slow, slow**2), rotor_commands=(slow, commands))
    (found,) = resample(given)
    time = found["gyro"].time
    assert all(np.array_equal(found[name].time, time) for name in found)
    np.testing.assert_allclose(np.diff(time), 0.004, atol=1e-12)
    np.testing.assert_allclose(found["gyro"].values[:, 1], 2 * np.sin(time), atol=1e-12)
    np.testing.assert_array_equal(found["rotor_commands"].values[:, 0], np.floor(time / 0.1 + 1e-6))
    np.testing.assert_allclose(found["velocity"].values[:, 0], np.interp(time, slow, slow**2), atol=1e-12)
    assert found.notes == ("before.", "velocity (10 Hz): interpolated to 250 Hz.")


def test_a_faster_measurement_is_averaged_so_that_vibration_does_not_become_slow_motion() -> None:
    time = np.arange(0, 4, 1e-3)
    shake = np.sin(2 * np.pi * 101.0 * time)  # aliases to 1 Hz at 100 Hz
    (found,) = resample(flight(accelerometer=three(time, time + shake)), rate=100.0)
    inner = slice(1, -1)
    error = found["accelerometer"].values[inner, 0] - found["accelerometer"].time[inner]
    assert np.abs(error).max() < 0.03
    assert found.notes[-1] == "accelerometer (1000 Hz): averaged to 100 Hz."
    # the mean over a period of what is linear between samples, exactly
    rng = np.random.default_rng(1)
    uneven = np.cumsum(rng.uniform(5e-4, 1.5e-3, 3000))
    (found,) = resample(flight(gyro=three(uneven, 3.0 * uneven)), rate=50.0)
    np.testing.assert_allclose(found["gyro"].values[inner, 0], 3.0 * found["gyro"].time[inner], rtol=1e-9)


def test_a_gap_of_any_channel_cuts_the_flight_and_what_is_lost_is_said() -> None:
    time = np.arange(0, 10, 0.01)
    holed = time[(time < 3.0) | (time > 3.5)]
    slow = np.arange(0, 10, 0.1)
    gone = slow[(slow < 7.05) | (slow > 8.0)]
    found = resample(flight(gyro=three(holed, holed), rotor_commands=(time, time[:, None]), position=three(gone, gone)))
    assert [each.name for each in found] == ["flight (1 of 3)", "flight (2 of 3)", "flight (3 of 3)"]
    spans = [(float(each["gyro"].time[0]), float(each["gyro"].time[-1])) for each in found]
    np.testing.assert_allclose(spans, [(0.0, 2.99), (3.51, 7.0), (8.1, 9.9)], atol=0.011)
    for each in found:
        np.testing.assert_allclose(each["gyro"].values[:, 0], each["gyro"].time, atol=1e-9)
        np.testing.assert_allclose(each["position"].values[:, 0], each["gyro"].time, atol=1e-9)
    notes = " ".join(found[0].notes)
    assert "gyro: 1 gaps of over 4 periods, the longest of 0.52 s at 2.990 s." in notes
    assert "position: 1 gaps" in notes
    assert "flight: 3 stretches; 1.62 of 9.9 s are lost." in notes


def test_quaternions_stay_of_unit_length_and_edges_are_said() -> None:
    time = np.arange(0, 3, 0.1)
    turn = np.stack([np.cos(time), np.sin(time), 0 * time, 0 * time], axis=1)
    (found,) = resample(flight(quaternion=(time, turn), gyro=three(np.arange(0.5, 2, 0.01), np.arange(0.5, 2, 0.01))))
    np.testing.assert_allclose(np.linalg.norm(found["quaternion"].values, axis=1), 1.0, atol=1e-12)
    assert found.notes[1] == (
        "flight: 0.5 s before the first sample of gyro and 0.91 s after the last one of gyro are left out."
    )


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"rate": -1.0}, "rate = -1.0: must be at least 0"),
        ({"gap": 1.0}, "gap = 1.0: must be above 1"),
        ({"channels": ["voltage"]}, "flight: voltage: is not in this flight; there is gyro"),
        ({"shortest": 60.0}, "flight: stretches = none: must be one of at least 60 s"),
        ({"rate": 1e12}, "rows = .*: must be at most 20000000"),
    ],
)
def test_wrong_options_are_one_line(options: dict[str, object], words: str) -> None:
    time = np.arange(0, 3, 0.01)
    with pytest.raises(ValueError, match=words):
        resample(flight(gyro=three(time, time)), **options)  # type: ignore[arg-type]


def test_a_stamp_far_away_is_a_gap() -> None:
    time = np.append(np.arange(0, 3, 0.01), 1e12)
    (found,) = resample(flight(gyro=three(time, np.append(time[:-1], 0.0))))
    assert found["gyro"].time[-1] < 3.0
