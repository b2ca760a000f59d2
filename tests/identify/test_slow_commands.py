"""Rarely logged rotor commands: the turns of a body under their torque, in closed
form.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.identify.log_checks import check_log
from skyarm.identify.slow_commands import LOGGING, explained_rotation, slow_commands
from support.flights import QUAD

HOVER = (
    9.81 * float(QUAD.mass) / 4.0 / float(QUAD.rotors[0].thrust_coefficient)
) ** 0.5
SPAN = [(0.0, 20.0)]


def turning(
    tones: tuple[float, ...],
    every: float = 0.1,
    late: float = 0.05,
    axis: int = 0,
    noise: float = 0.002,
):
    """Rotors on one side of an axis push up as those on the other push down, by sines
    of these frequencies (Hz).
    """
    time, rng = np.arange(0.0, 20.0, 0.004), np.random.default_rng(2)
    stamps = np.arange(0.0, 20.0, every)
    places = np.array([[*map(float, each.position)] for each in QUAD.rotors])
    sides = np.sign(places[:, 1] if axis == 0 else -places[:, 0])

    def share(when: np.ndarray) -> np.ndarray:
        return sum(np.sin(2.0 * np.pi * each * when) for each in tones) / len(tones)

    def turned(when: np.ndarray) -> np.ndarray:  # integral of the share
        return sum(
            -np.cos(2.0 * np.pi * each * when) / (2.0 * np.pi * each) for each in tones
        ) / len(tones)

    gyro = noise * rng.normal(size=(time.size, 3))
    gyro[:, axis] += 5.0 * turned(time - late)
    speeds = HOVER * np.sqrt(1.0 + 0.1 * share(stamps)[:, None] * sides)
    channels = {
        "gyro": Channel(time=time, values=gyro, source=""),
        "accelerometer": Channel(
            time=time,
            values=rng.normal([0.0, 0.0, 9.81], 0.1, (time.size, 3)),
            source="",
        ),
        "rotor_speed_commands": Channel(time=stamps, values=speeds, source=""),
    }
    return FlightData(name="flight", file="flight.ulg", channels=channels)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_motion_slower_than_the_log_is_explained_whatever_the_lag(axis):
    for late in (0.0, 0.12):
        assert (
            explained_rotation(
                turning((0.3, 0.7, 1.1), late=late, axis=axis), QUAD, SPAN, 0.1
            )
            > 0.9
        )


def test_a_motion_between_the_samples_is_not_explained():
    """Tones of 10.2 Hz and more look like slow ones in samples of 10 Hz."""
    assert explained_rotation(turning((10.23, 12.7, 13.9)), QUAD, SPAN, 0.1) < 0.05
    assert (
        explained_rotation(turning((10.23, 12.7, 13.9), every=0.004), QUAD, SPAN, 0.02)
        > 0.5
    )


@pytest.mark.parametrize(
    ("axes", "signs"),
    [((1, 0), (1, 1)), ((1, 0), (1, -1)), ((1, 0), (-1, 1)), ((0, 1), (-1, -1))],
)
def test_of_a_gyroscope_with_exchanged_or_turned_axes_the_commands_are_not_accused(
    axes, signs
):
    """That fault is looked for later, as one of the gyroscope."""

    def about_both(*tones):
        roll, pitch = (turning(each, axis=axis) for axis, each in enumerate(tones))
        gyro, other = roll["gyro"], pitch["gyro"]
        speeds, more = (each["rotor_speed_commands"] for each in (roll, pitch))
        both = np.sqrt(speeds.values**2 + more.values**2 - HOVER**2)
        turned = (gyro.values + other.values)[:, [*axes, 2]] * [*signs, 1.0]
        channels = {"gyro": (gyro, turned), "rotor_speed_commands": (speeds, both)}
        return roll.with_channels(
            {
                name: dataclasses.replace(a, values=b)
                for name, (a, b) in channels.items()
            }
        )

    assert (
        explained_rotation(
            about_both((0.3, 0.7, 1.1), (0.4, 0.9, 1.3)), QUAD, SPAN, 0.1
        )
        > 0.7
    )
    assert (
        explained_rotation(
            about_both((10.23, 12.7, 13.9), (11.1, 13.3, 14.6)), QUAD, SPAN, 0.1
        )
        < 0.05
    )


def test_of_a_torque_that_is_constant_or_a_short_flight_nothing_is_said():
    still = turning((1.0,))
    speeds = dataclasses.replace(
        still["rotor_speed_commands"], values=np.full((200, 4), HOVER)
    )
    assert (
        explained_rotation(
            still.with_channels({"rotor_speed_commands": speeds}), QUAD, SPAN, 0.1
        )
        < 1e-9
    )
    assert explained_rotation(still, QUAD, [(3.0, 4.1)], 0.1) == 1.0


@pytest.mark.parametrize(
    ("vehicle", "remedy"), [*LOGGING.items(), ("", "log them at 50 Hz or more")]
)
def test_a_flight_that_no_search_can_explain_is_refused_at_once(vehicle, remedy):
    flight = dataclasses.replace(
        turning((10.23, 12.7, 13.9)), facts={"vehicle": vehicle}
    )
    refused = [each for each in check_log(flight, QUAD) if each.severity == "refused"]
    assert [(each.channel, each.remedy) for each in refused] == [
        ("rotor_commands", remedy)
    ]
    assert refused[0].finding.startswith("at 10 Hz explain ")
    assert not list(slow_commands(turning((0.3, 0.7, 1.1)), QUAD, SPAN))
    assert not list(slow_commands(turning((10.23, 12.7, 13.9), every=0.02), QUAD, SPAN))
