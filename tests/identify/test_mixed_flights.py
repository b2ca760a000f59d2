"""Flights that hold different channels, few samples or channels that end early, and
rare kinds of vehicles.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.flight_data.flight_data import Channel
from skyarm.identify.design import DesignLimits
from skyarm.identify.held_out import predict_held_out
from skyarm.identify.identified_numbers import Identified
from skyarm.identify.identified_parts import IdentifiedSurroundings
from skyarm.identify.identify_windows import (
    SearchOptions,
    distinct_flights,
    identify_by_windows,
    search_of,
)
from skyarm.identify.isolate_fault import find_faults
from skyarm.identify.loop_lags import Estimated
from skyarm.identify.required_flight import required_flight
from skyarm.identify.unknowns import unknowns_of
from skyarm.identify.window_errors import in_halves
from skyarm.identify.windows import ClockedWindows, on_clock
from skyarm.vehicle.thrust_table import ThrustTable
from support.flights import ONE, QUAD, STEP, flown, measured

pytest.importorskip("scipy", reason="needs the extra 'identify'")

DELAY = 0.006


def flight_of(name="flight", without=(), vehicle=QUAD, **options):
    made = measured(
        flown(vehicle, 2.4, DELAY), without=("velocity", *without), noise=1.0, **options
    )
    return dataclasses.replace(made, name=name)


def cut(flight, quantity, seconds):
    """The flight with a channel that ends early."""
    channel = flight[quantity]
    inside = channel.time <= seconds
    return flight.with_channels(
        {
            quantity: Channel(
                time=channel.time[inside], values=channel.values[inside], source="cut"
            )
        }
    )


def few_known(searched=("rotors.thrust_coefficient",)):
    """All numbers of the quadrotor as known, but for some."""
    every = unknowns_of(
        QUAD,
        curve=False,
        velocity=True,
        voltage=False,
        driven=[],
        servoed=[],
        others=["other"],
    )
    known = {each.name: each.start for each in every if each.name not in searched}
    return known | {"delay": DELAY}


def test_a_flight_without_attitude_is_fitted_beside_one_with_it():
    flights = [flight_of(), flight_of("other", without=("quaternion", "position"))]
    search = search_of(flights, QUAD, SearchOptions(known=few_known()))
    errors = search.errors(search.first)
    states = errors.first_states()
    own = errors.windows.owners == 1
    assert own.any()
    assert states.parts["quaternion"][own] == pytest.approx(
        np.tile([1.0, 0.0, 0.0, 0.0], (own.sum(), 1))
    )
    found = identify_by_windows(flights, QUAD, SearchOptions(known=few_known()))
    assert found["rotors.thrust_coefficient"].value == pytest.approx(
        QUAD.rotors[0].thrust_coefficient, rel=5e-3
    )


def test_accelerometers_of_two_rates_are_averaged_each_over_its_own_period():
    """A tenth of the samples of one: what is left of both is their noise."""
    slow = flight_of("other")
    felt = slow["accelerometer"]
    # the mean of ten readings, at the end of their period
    means = felt.values[: len(felt.values) // 10 * 10].reshape(-1, 10, 3).mean(axis=1)
    made = slow.with_channels(
        {
            "accelerometer": Channel(
                time=felt.time[9::10][: len(means)] + 0.5 * STEP - 5 * STEP,
                values=means,
                source="",
            )
        }
    )
    search = search_of([flight_of(), made], QUAD, SearchOptions(known=few_known()))
    errors = search.errors(search.whole)
    assert errors.averaged.tolist() == [1, 10]
    found = identify_by_windows(
        [flight_of(), made], QUAD, SearchOptions(known=few_known())
    )
    assert found["rotors.thrust_coefficient"].value == pytest.approx(
        QUAD.rotors[0].thrust_coefficient, rel=3e-3
    )
    assert found.deviation["specific_force.z"] < 1.3 * 0.02


@pytest.mark.parametrize("quantity", ["position", "voltage"])
@pytest.mark.parametrize("left", [0.0, 0.002])
def test_a_channel_of_a_few_samples_is_not_used(quantity, left):
    flight = flight_of()
    volts = Channel(
        time=flight["gyro"].time,
        values=np.full((len(flight["gyro"].time), 1), 11.0),
        source="volts",
    )
    flight = flight.with_channels({"voltage": volts})
    (kept,) = distinct_flights([cut(flight, quantity, flight.start + left - 1e-6)])
    assert quantity not in kept
    assert {"gyro", "quaternion"} <= set(kept)


def test_what_some_flights_hold_and_others_do_not_is_refused_in_one_line():
    flights = [
        flight_of(vehicle=ONE),
        flight_of("other", without=("joint_efforts",), vehicle=ONE),
    ]
    with pytest.raises(
        ValueError,
        match=(
            r"^other: joint_efforts: is not in this flight, and is in flight: identify"
        ),
    ):
        identify_by_windows(flights, ONE)


def prediction(vehicle=QUAD, name="flight", **searched):
    return Identified(
        numbers=(),
        correlation=np.zeros((0, 0)),
        vehicle=vehicle,
        surroundings=IdentifiedSurroundings(delay=DELAY),
        explained={},
        deviation={},
        settled=True,
        seconds=1.0,
        searched=searched,
    )


def test_sensors_that_end_before_the_commands_are_predicted_until_then():
    """Of the last period there is no reading: nothing is read beyond it."""
    flight = flight_of()
    for quantity in ("gyro", "accelerometer", "position", "quaternion"):
        flight = cut(flight, quantity, flight.start + 1.6)
    found = predict_held_out(prediction(), QUAD, [flight], horizons=(0.01, 0.1))
    whole = predict_held_out(prediction(), QUAD, [flight_of()], horizons=(0.01, 0.1))
    assert found.errors["identified"][1].begins > 3
    ended, all_along = found.one_step["identified"], whole.one_step["identified"]
    assert ended.specific_force == pytest.approx(all_along.specific_force, rel=0.2)
    assert ended.angular_acceleration == pytest.approx(
        all_along.angular_acceleration, rel=0.2
    )


def test_a_held_out_flight_has_not_the_thrust_of_a_fitted_one_of_its_name():
    """Which was found for that flight's battery."""
    weak = prediction(**{"thrust.flight": 0.5})
    found, plain = (
        predict_held_out(
            each,
            QUAD,
            [flight_of()],
            seen=[flight_of("first"), flight_of()],
            horizons=(0.01, 0.1),
        )
        for each in (weak, prediction())
    )
    assert found.errors["identified"] == plain.errors["identified"]


def test_joints_that_switch_at_different_times_keep_mean_and_first_moment():
    before, after, late = (
        np.array([1.0, -2.0]),
        np.array([3.0, 5.0]),
        np.array([0.0005, 0.0]),
    )
    first, last, half = in_halves(before, after, late, STEP)
    assert half == pytest.approx(0.5 * STEP)
    impulse = before * late + after * (STEP - late)
    assert 0.5 * STEP * (first + last) == pytest.approx(impulse)
    moment = 0.5 * (before * late**2 + after * (STEP**2 - late**2))
    assert first * STEP**2 / 8.0 + last * 3.0 * STEP**2 / 8.0 == pytest.approx(moment)


def test_a_sound_flight_of_good_sensors_raises_no_alarm():
    """A fifth of the usual noise: averages over several samples left more than that."""
    made = measured(flown(QUAD, 12.0, DELAY), without=("velocity",), noise=0.2)
    assert find_faults(made, QUAD, isolate=False) == ()


def test_rotors_that_tilt_are_flown_as_if_they_did_not():
    """No log that is read holds their angles; the vehicle that is found has them."""
    tilting = skyarm.load_vehicle("voliro_like")
    time = np.arange(0.0, 2.4, 0.004)
    hover = np.sqrt(
        9.81 * tilting.mass / sum(float(r.thrust_coefficient) for r in tilting.rotors)
    )
    rows = {
        "gyro": np.random.default_rng(1).normal(scale=1e-3, size=(len(time), 3)),
        "accelerometer": (
            np.random.default_rng(2).normal([0.0, 0.0, 9.81], 0.01, (len(time), 3))
        ),
        "rotor_speed_commands": np.full((len(time), len(tilting.rotors)), hover),
        **({"joint_positions": np.zeros((len(time), tilting.n))} if tilting.n else {}),
    }
    channels = {
        name: Channel(time=time, values=values, source=name)
        for name, values in rows.items()
    }
    flight = dataclasses.replace(flight_of(), channels=channels)
    every = unknowns_of(
        tilting, curve=False, velocity=True, voltage=False, driven=[False] * tilting.n
    )
    known = {
        each.name: each.start
        for each in every
        if each.name != "rotors.thrust_coefficient"
    }
    known = {
        name: value for name, value in known.items() if not name.startswith("drag.")
    }
    found = identify_by_windows([flight], tilting, SearchOptions(known=known))
    assert found["rotors.thrust_coefficient"].is_known
    assert [each.tilt for each in found.vehicle.rotors] == [
        each.tilt for each in tilting.rotors
    ]


def test_efforts_that_are_not_logged_may_be_as_large_as_the_vehicle_is_heavy():
    """A hundred times the weight: a hundred times the effort."""

    def loose(factor):
        rotors = tuple(
            dataclasses.replace(
                each, thrust_coefficient=factor * each.thrust_coefficient
            )
            for each in ONE.rotors
        )
        base = dataclasses.replace(ONE.base, mass=factor * ONE.base.mass)
        links = tuple(
            dataclasses.replace(
                each, body=dataclasses.replace(each.body, mass=factor * each.body.mass)
            )
            for each in ONE.links
        )
        heavy = dataclasses.replace(ONE, base=base, links=links, rotors=rotors)
        search = search_of([flight_of(without=("joint_efforts",), vehicle=ONE)], heavy)
        errors = search.errors(search.first)
        return errors.loose[[name == "hats" for name, _ in errors.free]]

    assert loose(100.0) == pytest.approx(100.0 * loose(1.0))


def test_a_thrust_table_lifts_what_a_hover_requires():
    full = float(QUAD.rotors[0].max_speed)
    speeds = tuple(share * full for share in (0.25, 0.5, 0.75, 1.0))
    square = [float(QUAD.rotors[0].thrust_coefficient) * speed**2 for speed in speeds]
    curve = ThrustTable(
        speed=speeds,
        thrust=(1.1 * square[0], square[1], 0.95 * square[2], 0.9 * square[3]),
    )
    rotors = tuple(
        dataclasses.replace(
            each, table=curve, thrust_coefficient=curve.thrust_coefficient
        )
        for each in QUAD.rotors
    )
    bent = dataclasses.replace(QUAD, rotors=rotors)
    flight = required_flight(bent, np.zeros((3, 4, 101)), 0.01)
    lift = sum(
        each.thrust_coefficient * each.table.push(w)
        for each, w in zip(rotors, flight.speeds[50].tolist(), strict=True)
    )
    assert lift == pytest.approx(9.81 * QUAD.mass, rel=1e-6)
    assert not DesignLimits().broken_by(bent, flight).any()


def test_no_interval_ends_below_its_begin():
    found = Estimated.of(-0.003, 0.001)
    assert (found.low, found.value, found.high) == (0.0, 0.0, 0.0)


def test_a_window_may_end_with_the_clock():
    flight = flight_of()
    clock = on_clock(flight, QUAD, STEP)
    windows = ClockedWindows([clock], QUAD, 0.1)
    assert (windows.begins + windows.length <= clock.size).all()
