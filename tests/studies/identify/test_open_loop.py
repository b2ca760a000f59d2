"""Open-loop predictions against the simulator's own flight, and against what geometry says of holding."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from test_motion_model import ABOUT, PERIOD, log_of, stretch_of, vehicle

from skyarm.studies.identify.identified_parts import Surroundings
from skyarm.studies.identify.open_loop import (
    Poses,
    begins_of,
    errors_of,
    hold,
    predict_ahead,
    predict_flights,
)

HALF = round(0.5 / PERIOD)


@pytest.fixture(scope="module")
def flown():
    """Stretch and poses of three seconds, without noise."""
    log = log_of(3.0)
    return stretch_of(log), Poses(
        position=log.position, quaternion=log.quaternion, velocity=log.velocity, known_velocity=log.velocity
    )


def test_the_true_vehicle_foretells_the_flight(flown):
    ((model, held),) = predict_flights(vehicle(), ABOUT, [flown], [0.5])
    assert model.begins == held.begins == len(begins_of(flown[0], HALF, vehicle(), ABOUT))
    for name in ("position", "velocity", "attitude", "rate"):
        assert getattr(model, name) < 1e-3 * getattr(held, name), name


def test_another_vehicle_or_delay_foretells_it_worse(flown):
    heavy = dataclasses.replace(vehicle().base, mass=1.1 * float(vehicle().base.mass))
    late = dataclasses.replace(ABOUT, delay=ABOUT.delay + 0.004)
    ((true, _),) = predict_flights(vehicle(), ABOUT, [flown], [0.2])
    ((heavier, _),) = predict_flights(dataclasses.replace(vehicle(), base=heavy), ABOUT, [flown], [0.2])
    ((later, _),) = predict_flights(vehicle(), late, [flown], [0.2])
    assert heavier.position > 5.0 * true.position
    assert later.attitude > 5.0 * true.attitude


def test_over_one_period_the_error_is_that_of_the_midpoint_rule(flown):
    stretch, poses = flown
    begins = begins_of(stretch, 1, vehicle(), ABOUT)
    after = [k + 1 for k in begins]
    last = predict_ahead(vehicle(), ABOUT, stretch, poses, begins, 1)[-1]
    moved = np.linalg.norm(poses.position[after] - poses.position[begins], axis=1)
    assert (errors_of(last, stretch, poses, after)[0] < 5e-5 * moved.max()).all()


def test_many_begins_equal_one_at_a_time(flown):
    stretch, poses = flown
    together = predict_ahead(vehicle(), ABOUT, stretch, poses, [10, 300, 700], 50)[-1]
    for i, begin in enumerate((10, 300, 700)):
        alone = predict_ahead(vehicle(), ABOUT, stretch, poses, [begin], 50)[-1]
        np.testing.assert_allclose(together.position[i], alone.position[0], rtol=0, atol=1e-12)
        np.testing.assert_allclose(together.quaternion[i], alone.quaternion[0], rtol=0, atol=1e-12)


def test_many_horizons_equal_one_at_a_time(flown):
    stretch, poses = flown
    used = np.ones(stretch.size, dtype=bool)
    used[[400, 1200]] = False
    gappy = dataclasses.replace(stretch, used=used)
    together = predict_flights(vehicle(), ABOUT, [(gappy, poses)], [0.002, 0.05, 0.2])
    for horizon, pair in zip((0.002, 0.05, 0.2), together, strict=True):
        periods = round(horizon / PERIOD)
        begins = begins_of(gappy, periods, vehicle(), ABOUT)
        last = predict_ahead(vehicle(), ABOUT, gappy, poses, begins, periods)[-1]
        position, _, attitude, _ = errors_of(last, gappy, poses, [k + periods for k in begins])
        assert [each.begins for each in pair] == [len(begins)] * 2
        assert pair[0].position == pytest.approx(math.sqrt((position**2).mean()), rel=1e-12)
        assert pair[0].attitude == pytest.approx(math.sqrt((attitude**2).mean()), rel=1e-12)


def test_holding_goes_on_straight_and_turns_evenly(flown):
    stretch, poses = flown
    held = hold(stretch, poses, [100], 0.5)
    np.testing.assert_allclose(held.position[0], poses.position[100] + 0.5 * poses.velocity[100])
    np.testing.assert_array_equal(held.rate[0], stretch.rate[100])
    turned = abs(float(held.quaternion[0] @ poses.quaternion[100]))
    half = 0.5 * np.linalg.norm(stretch.rate[100])
    assert 2.0 * math.acos(min(turned, 1.0)) == pytest.approx(half, rel=1e-6)
    assert errors_of(held, stretch, poses, [100])[2][0] == pytest.approx(half, rel=1e-6)


def test_rows_that_do_not_count_are_in_no_horizon(flown):
    stretch, _ = flown
    used = np.ones(stretch.size, dtype=bool)
    used[500] = False
    begins = begins_of(dataclasses.replace(stretch, used=used), HALF, vehicle(), ABOUT)
    assert begins
    assert not any(k <= 500 < k + HALF for k in begins)
    assert predict_flights(vehicle(), Surroundings(), [(stretch, flown[1])], [60.0])[0][0].begins == 0


def test_predictions_begin_a_tenth_of_a_second_apart_once_rotor_speeds_are_known(flown):
    """Dead time 6 ms and eight of the longest time constants; periods of 2 ms."""
    longest = max(max(r.time_constant_up, r.time_constant_down) for r in vehicle().rotors)
    late = dataclasses.replace(ABOUT, delay=0.0065)
    begins = begins_of(flown[0], HALF, vehicle(), late)
    assert begins[0] * PERIOD >= 0.0065 + 8.0 * longest > (begins[0] - 1) * PERIOD
    assert set(np.diff(begins)) == {50}
    assert begins[-1] + HALF <= flown[0].size < begins[-1] + 50 + HALF


def test_an_attitude_and_its_negative_are_one(flown):
    stretch, poses = flown
    held = hold(stretch, poses, [100, 200], 0.0)
    turned = dataclasses.replace(held, quaternion=-held.quaternion)
    assert errors_of(turned, stretch, poses, [100, 200])[2] == pytest.approx([0.0, 0.0], abs=1e-6)
