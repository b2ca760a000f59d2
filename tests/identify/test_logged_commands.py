"""Logged rotor commands: their own samples among rows that repeat them, the speeds they
mean, spans in the air.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.identify.logged_commands import (
    commanded_speeds,
    flying_spans,
    period_note,
    sampling_period,
    smooth_commands,
)

VEHICLE = skyarm.load_vehicle("hummingbird")
HOVER = (9.81 * VEHICLE.mass / 4.0 / VEHICLE.rotors[0].thrust_coefficient) ** 0.5
TIME = 3.0 + np.arange(3001) / 500.0


def commands(values):
    return Channel(time=TIME, values=np.asarray(values, dtype=float), source="made")


def flight(channel, kind="rotor_speed_commands"):
    return FlightData(name="made", file="made.csv", channels={kind: channel})


def swinging(time):
    """Commands whose sines are no whole parts of each other."""
    return HOVER + np.stack(
        [20.0 * np.sin(w * time) for w in (2.0, 3.1, 4.3, 5.7)], axis=1
    )


def sampled_up(every, straight):
    """Samples of the swinging commands, one in ``every`` rows, held or joined by
    straight lines.
    """
    seldom = TIME[::every]
    if straight:
        return np.stack(
            [np.interp(TIME, seldom, each) for each in swinging(seldom).T], axis=1
        )
    return np.repeat(swinging(seldom), every, axis=0)[: len(TIME)]


@pytest.mark.parametrize("straight", [True, False], ids=["straight", "held"])
@pytest.mark.parametrize(
    ("every", "period"), [(50, 0.1), (25, 0.05), (10, 0.0), (1, 0.0)]
)
def test_samples_are_found_among_rows_that_repeat_them(every, period, straight):
    """At 20 Hz and less; commands at 50 Hz may be those of an autopilot, which are
    held.
    """
    given = commands(sampled_up(every, straight))
    assert sampling_period(given) == pytest.approx(period)
    assert bool(period_note(flight(given), VEHICLE)) == (period > 0.0)
    if period:
        assert f"period = {period:g} s" in period_note(flight(given), VEHICLE)
        middles = TIME[200:-200] + 0.001
        np.testing.assert_allclose(
            smooth_commands(given, middles), swinging(middles), atol=0.1
        )


@pytest.mark.parametrize("every", [1, 5])
def test_the_rate_of_an_autopilot_s_commands_is_that_of_the_samples(every):
    given = dataclasses.replace(
        flight(commands(sampled_up(every, False))), facts={"vehicle": "ArduPilot"}
    )
    assert (
        period_note(given, VEHICLE)
        == f"made: rotor commands: a curve through samples of {500 // every} Hz, as the"
        " loop is faster"
    )


def test_samples_between_rows_are_found_where_lines_meet():
    """Each bends the lines at two rows; straight lines between the samples would be 0.8
    rad/s off.
    """
    seldom = 3.0137 + 0.1 * np.arange(60)
    given = commands(
        np.stack([np.interp(TIME, seldom, each) for each in swinging(seldom).T], axis=1)
    )
    assert sampling_period(given) == pytest.approx(0.1)
    inside = TIME[200:-300]
    np.testing.assert_allclose(
        smooth_commands(given, inside), swinging(inside), atol=0.05
    )
    # at both ends the first and the last row themselves, and beyond them as well
    for ends in (TIME[[0, -1]], np.array([0.0, 99.0])):
        np.testing.assert_allclose(
            smooth_commands(given, ends), given.values[[0, -1]], atol=1e-6
        )


@pytest.mark.parametrize("straight", [True, False], ids=["straight", "held"])
def test_samples_are_found_though_a_rotor_stays_at_its_limit(straight):
    rows = sampled_up(50, straight)
    rows[:, 3] = 838.0
    assert sampling_period(commands(rows)) == pytest.approx(0.1)


def test_samples_on_a_line_are_as_far_apart_as_others():
    """From 4 to 5 s nothing bends: a curve through the samples of the swing alone would
    leave the line.
    """
    seldom = TIME[::50]
    rows = np.where(((seldom < 4.0) | (seldom > 5.0))[:, None], swinging(seldom), HOVER)
    given = commands(
        np.stack([np.interp(TIME, seldom, each) for each in rows.T], axis=1)
    )
    inside = TIME[(TIME > 4.4) & (TIME < 4.6)]
    np.testing.assert_allclose(smooth_commands(given, inside), HOVER, atol=0.1)


def test_single_steps_are_no_slow_samples():
    steps = np.where((TIME % 1.7 < 0.5)[:, None], HOVER, 1.1 * HOVER) * np.ones(4)
    assert sampling_period(commands(steps)) == 0.0
    time = 3.0 + 0.1 * np.arange(61)
    assert sampling_period(
        Channel(time=time, values=swinging(time), source="made")
    ) == pytest.approx(0.1)


def test_signals_are_shares_of_the_full_speed():
    share = commands(np.full((len(TIME), 4), 0.4))
    speeds = commanded_speeds(flight(share, "rotor_commands"), VEHICLE)
    assert speeds.values == pytest.approx(0.4 * VEHICLE.rotors[0].max_speed)
    three = commands(np.full((len(TIME), 3), 0.4))
    assert commanded_speeds(flight(three, "rotor_commands"), VEHICLE) is three, (
        "of another vehicle"
    )
    endless = dataclasses.replace(
        VEHICLE,
        rotors=tuple(
            dataclasses.replace(each, max_speed=np.inf) for each in VEHICLE.rotors
        ),
    )
    with pytest.raises(
        ValueError,
        match=r"^rotors\.max_speed = inf: must be finite, the speed of the full signal",
    ):
        commanded_speeds(flight(share, "rotor_commands"), endless)


def test_a_vehicle_flies_where_its_rotors_lift_it():
    """Half a second inside of hover from 4 to 7 s, and of nothing at a third of the
    thrust.
    """
    share = np.where((TIME > 4.0) & (TIME < 7.0), 1.0, np.sqrt(1.0 / 3.0))
    (span,) = flying_spans(commands(HOVER * share[:, None] * np.ones(4)), VEHICLE)
    assert flying_spans(commands(np.full((len(TIME), 4), 0.1 * HOVER)), VEHICLE) == []
    assert span == pytest.approx((4.0 + 0.5 - 0.125, 7.0 - 0.5 + 0.125), abs=0.03)
