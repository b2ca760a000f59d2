"""Poses of a measured flight at a stretch's instants, and what is predicted of flights without poses."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from test_motion_model import ABOUT, log_of, stretch_of, vehicle

from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.studies.identify.disturbances import AxisNoise, DisturbanceModel
from skyarm.studies.identify.held_out import (
    HOLD,
    IDENTIFIED,
    PAST,
    START,
    held_out_period,
    one_step_errors,
    poses_of,
    predict_held_out,
    spread_of,
)
from skyarm.studies.identify.identified_numbers import Identified
from skyarm.studies.identify.open_loop import hold, predict_ahead

RUN_IN = 200
"""Periods after which the rotors' speeds at the begin are forgotten."""

NOISES = DisturbanceModel((AxisNoise(measured=0.02, white=0.01, process=1.5, time_constant=0.3, walk=0.1),) * 6)

SPEED = np.array([0.4, -0.2, 0.1])


@pytest.fixture(scope="module")
def stretch():
    made = stretch_of(log_of(1.4))
    used = np.arange(made.size) >= RUN_IN
    return dataclasses.replace(made, used=used)


def channel(time, values):
    return Channel(time=time, values=values, source="made")


def flight_of(stretch, names, rate=200.0, noise=0.0):
    """A flight on a parabola that turns evenly about z through half a turn, where a quaternion changes its sign."""
    time = np.arange(stretch.start - 0.2, stretch.start + stretch.seconds + 0.2, 1.0 / rate)
    yaw = math.pi + 0.8 * (time - time.mean())
    turned = np.stack([np.cos(0.5 * yaw), 0.0 * yaw, 0.0 * yaw, np.sin(0.5 * yaw)], axis=1)
    draw = np.random.default_rng(1).normal(scale=noise, size=(len(time), 3)) if noise else 0.0
    channels = {
        "gyro": channel(time, np.zeros((len(time), 3))),
        "position": channel(time, SPEED * time[:, None] - 0.5 * time[:, None] ** 2 + draw),
        "velocity": channel(time, SPEED - time[:, None] + np.zeros(3)),
        "quaternion": channel(time, np.where(turned[:, :1] < 0.0, -turned, turned)),
    }
    return FlightData(name="made", file="made.csv", channels={name: channels[name] for name in names})


def instants(stretch):
    return stretch.start + stretch.period * np.arange(stretch.size + 1)[:, None]


@pytest.mark.parametrize(
    ("names", "noise", "off"),
    [
        (("position", "velocity", "quaternion"), 0.0, 1e-9),
        (("position", "quaternion"), 0.0, 1e-9),  # a parabola's slope is exact
        (("position", "quaternion"), 1e-3, 0.05),  # of 10 ms alone a noise of 1 mm would be 0.14 m/s
        (("velocity", "quaternion"), 0.0, 1e-9),
    ],
)
def test_velocity_and_position_come_from_each_other_where_one_is_not_measured(stretch, names, noise, off):
    poses, time = poses_of(flight_of(stretch, names, noise=noise), stretch), instants(stretch)
    np.testing.assert_allclose(poses.velocity, SPEED - time, atol=max(off, 1e-9))
    moved = SPEED * (time - time[0]) - 0.5 * (time**2 - time[0] ** 2)
    np.testing.assert_allclose(poses.position - poses.position[0], moved, atol=max(10.0 * noise, 1e-5))


@pytest.mark.parametrize("noises", [None, NOISES], ids=["commands alone", "with past"])
def test_nothing_that_is_measured_after_a_begin_enters_its_prediction(stretch, noises):
    """Positions that jump after the begin change what is compared, and no bit of what is foretold."""
    made = flight_of(stretch, ("position", "quaternion"), rate=1.0 / stretch.period)
    position, row = made["position"], 600
    begin = stretch.start + row * stretch.period
    jumped = position.values + np.where(position.time[:, None] > begin + 1e-6, 0.02, 0.0)
    other = made.with_channels({"position": channel(position.time, jumped)})
    first, second = poses_of(made, stretch), poses_of(other, stretch)
    assert np.abs(first.velocity[row] - second.velocity[row]).max() > 0.1
    ends = [
        predict_ahead(vehicle(), ABOUT, stretch, each, [row], 20, disturbances=noises)[-1] for each in (first, second)
    ]
    held = [hold(stretch, each, [row], 0.1) for each in (first, second)]
    for one, two in (ends, held):
        np.testing.assert_allclose(one.position, two.position, atol=1e-9)
        np.testing.assert_allclose(one.velocity, two.velocity, atol=1e-9)


def test_attitude_passes_half_a_turn_evenly(stretch):
    flight = flight_of(stretch, ("position", "quaternion"))
    q, time = poses_of(flight, stretch).quaternion, instants(stretch)[:, 0]
    middle = flight["quaternion"].time.mean()
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0)
    yaw = np.unwrap(2.0 * np.arctan2(q[:, 3], q[:, 0]), period=2.0 * math.pi)
    np.testing.assert_allclose(np.diff(yaw), 0.8 * np.diff(time), atol=1e-5)
    assert np.exp(1j * yaw[0]) == pytest.approx(np.exp(1j * (math.pi + 0.8 * (time[0] - middle))), abs=1e-5)


def identified(**changes):
    nothing = {"numbers": (), "correlation": np.zeros((0, 0)), "explained": {}, "deviation": {}, "settled": True}
    return Identified(vehicle=vehicle(), surroundings=ABOUT, seconds=3.0, **nothing, **changes)


def test_a_flight_without_poses_shows_rates_and_accelerations_only(stretch):
    heavy = dataclasses.replace(vehicle(), base=dataclasses.replace(vehicle().base, mass=1.3 * vehicle().base.mass))
    found = predict_held_out(identified(), heavy, [(flight_of(stretch, ("gyro",)), [stretch])], horizons=(0.03,))
    assert not found.has_poses
    assert found.notes[0] == "made: no quaternion is measured: rate and specific force are predicted, and no pose"
    for errors in found.errors.values():
        assert all(math.isnan(each.position) and math.isnan(each.attitude) for each in errors)
    assert found.errors[IDENTIFIED][0].rate < 0.3 * found.errors[HOLD][0].rate  # without the drag of its speed
    assert found.one_step[IDENTIFIED].specific_force < 0.02 * found.one_step[START].specific_force


def test_one_step_of_the_true_vehicle_leaves_little_and_rows_that_do_not_count_are_left_out(stretch):
    good, spread = one_step_errors([stretch], vehicle(), ABOUT), spread_of([stretch])
    assert good.specific_force < 0.02 * spread.specific_force
    assert good.angular_acceleration < 0.02 * spread.angular_acceleration
    wild = stretch.specific_force.copy()
    wild[RUN_IN + 50] += 1000.0
    used = stretch.used.copy()
    used[RUN_IN + 50] = False
    assert one_step_errors([dataclasses.replace(stretch, specific_force=wild)], vehicle(), ABOUT).specific_force > 10.0
    left_out = dataclasses.replace(stretch, specific_force=wild, used=used)
    assert one_step_errors([left_out], vehicle(), ABOUT).specific_force == pytest.approx(good.specific_force, rel=0.1)


@pytest.mark.parametrize(("fitted", "period"), [(0.02, 0.01), (0.01, 0.01), (0.008, 0.005), (0.0011, 0.001)])
def test_horizons_are_whole_periods(fitted, period):
    assert held_out_period(fitted) == pytest.approx(period)


def test_a_flight_that_is_too_short_is_refused(stretch):
    flight = flight_of(stretch, ("gyro",))
    with pytest.raises(ValueError, match=r"^made: no stretch is long enough for a prediction$"):
        predict_held_out(identified(), vehicle(), [(flight, [stretch])], horizons=(60.0,))


@pytest.mark.thorough
def test_the_past_of_a_flight_helps_where_the_model_lacks_a_torque():
    """Fit and prediction on flights of the simulator; the model has a torque and a force too much."""
    log = log_of(2.4)
    whole = stretch_of(log)
    time = whole.start + whole.period * np.arange(whole.size + 1)
    channels = {name: channel(time, getattr(log, name)) for name in ("position", "velocity", "quaternion")}
    flight = FlightData(name="made", file="made.csv", channels=channels)
    wrong = dataclasses.replace(ABOUT, torque=(0.004, -0.003, 0.001))
    found = dataclasses.replace(identified(), surroundings=wrong)
    pairs = [(flight, [whole])]
    plain = predict_held_out(found, vehicle(), pairs, horizons=(0.1,))
    assert PAST not in plain.errors
    after = predict_held_out(found, vehicle(), pairs, seen=pairs, horizons=(0.1,))
    assert list(after.errors) == [IDENTIFIED, PAST, START, HOLD]
    assert len({errors[0].begins for errors in after.errors.values()}) == 1
    assert after.errors[PAST][0].attitude < 0.3 * plain.errors[IDENTIFIED][0].attitude
    assert after.errors[PAST][0].attitude < 0.3 * after.errors[HOLD][0].attitude
    rates_only = FlightData(name="made", file="made.csv", channels={"gyro": channel(time, log.rate)})
    assert PAST not in predict_held_out(found, vehicle(), pairs, seen=[(rates_only, [whole])], horizons=(0.1,)).errors
