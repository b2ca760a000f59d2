"""Series at other times: straight lines, means that leave vibration out, attitudes, and
what is said of the rates.
"""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.algebra.frames import continuous
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.series import (
    attitude_at,
    columns_at,
    means_of,
    measured_at,
    rates_note,
    thin_samples,
)


def channel(time: np.ndarray, *columns: np.ndarray) -> Channel:
    return Channel(time=time, values=np.stack(columns, axis=1), source="made")


def test_a_slower_measurement_is_interpolated_and_stays_beyond_its_ends() -> None:
    slow, time = np.arange(0, 2.001, 0.1), np.arange(-0.5, 2.5, 0.004)
    found = measured_at(channel(slow, slow**2, -slow), time, 0.004)
    np.testing.assert_allclose(found[:, 0], np.interp(time, slow, slow**2), atol=1e-12)
    np.testing.assert_array_equal(
        found, columns_at(time, slow, np.stack([slow**2, -slow], axis=1))
    )


def test_a_faster_measurement_is_averaged_against_vibration_as_slow_motion() -> None:
    time, clock = np.arange(0, 4, 1e-3), np.arange(0.0, 3.999, 0.01)
    shake = np.sin(2 * np.pi * 101.0 * time)  # aliases to 1 Hz at 100 Hz
    found = measured_at(channel(time, time + shake), clock, 0.01)
    assert np.abs(found[1:-1, 0] - clock[1:-1]).max() < 0.03
    late = measured_at(channel(time, time), np.array([-1.0, 9.0]), 0.01)
    np.testing.assert_allclose(late[:, 0], [0.0025, 3.999 - 0.0025], atol=1e-9)


def test_means_are_those_of_straight_lines_between_uneven_samples() -> None:
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(5e-4, 1.5e-3, 300))
    values = rng.standard_normal((300, 2))
    begins = rng.uniform(time[0], time[-1] - 0.02, 50)
    ends = begins + rng.uniform(1e-4, 0.02, 50)
    found = means_of(time, values)(begins, ends)
    for row, begin, end in zip(found, begins, ends, strict=True):
        corners = np.concatenate([[begin], time[(time > begin) & (time < end)], [end]])
        for mean, column in zip(row, values.T, strict=True):
            heights = np.interp(corners, time, column)
            area = np.sum(0.5 * (heights[1:] + heights[:-1]) * np.diff(corners))
            assert mean == pytest.approx(area / (end - begin), abs=1e-9)


def test_an_attitude_whose_sign_jumps_turns_as_one_whose_does_not() -> None:
    time = np.arange(0, 3, 0.1)
    turn = np.stack([np.cos(time), np.sin(time), 0 * time, 0 * time], axis=1)
    jumps = turn * np.where(np.arange(time.size) % 3 == 1, -1.0, 1.0)[:, None]
    np.testing.assert_array_equal(continuous(jumps), turn)
    assert continuous(turn[:0]).shape == (0, 4)
    found = attitude_at(
        Channel(time=time, values=2.0 * jumps, source="made"), np.array([0.55, 1.0])
    )
    np.testing.assert_allclose(
        found, [[np.cos(a), np.sin(a), 0, 0] for a in (0.55, 1.0)], atol=1e-12
    )


@pytest.mark.parametrize(("step", "every"), [(0.5, 5), (0.26, 3), (0.1, 1), (0.04, 1)])
def test_samples_are_thinned_to_about_a_step_and_none_is_made(
    step: float, every: int
) -> None:
    time = 3.0 + np.arange(41) / 10.0
    given = channel(time, time**2)
    found, values = thin_samples(given, step)
    np.testing.assert_array_equal(found, time[::every])
    np.testing.assert_array_equal(values[:, 0], found**2)
    assert given.duration == pytest.approx(4.0)
    assert given.section(9.0, 10.0).duration == 0.0


def test_what_is_averaged_is_said() -> None:
    fast, slow, same = (np.arange(0, 2, step) for step in (0.001, 0.1, 0.005))
    given = {
        "gyro": channel(same, same, same, same),
        "accelerometer": channel(fast, fast, fast, fast),
        "voltage": channel(slow, slow),
        "rotor_commands": channel(slow, slow),
    }
    flight = FlightData(name="flight", file="", channels=given)
    assert (
        rates_note(flight, 0.005)
        == "flight: accelerometer (1000 Hz) averaged to 200 Hz"
    )
    assert (
        rates_note(
            FlightData(name="flight", file="", channels={"gyro": given["gyro"]}), 0.005
        )
        == ""
    )
