"""The basin of attraction: draws, single flights beside lanes, and that a guard makes it wider."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.control.safety import guarded
from skyarm.figures.basin import basin_figure
from skyarm.simulate import run
from skyarm.simulate.inputs import first_state
from skyarm.simulate.scenario import ScenarioError
from skyarm.stability.along import hovering
from skyarm.stability.basin import PATHS, at_rest, basin, initial_states

SCENARIO = skyarm.load_scenario("case3")


@pytest.fixture(scope="module")
def alone():
    return basin(SCENARIO, 400, seed=1)


@pytest.fixture(scope="module")
def under_guard():
    return basin(dataclasses.replace(SCENARIO, controller=guarded(SCENARIO.controller)), 400, seed=1)


def test_attitudes_are_drawn_evenly_over_the_tilt_up_to_upside_down():
    values = initial_states(SCENARIO, 20000, 3, rate=5.0, offset=1.0, speed=2.0)
    w, x, y, z = (values[path] for path in PATHS[:4])
    up = Rotation.from_quat(np.array([x, y, z, w]).T).as_matrix()[:, 2, 2]
    counts, _ = np.histogram(np.arccos(up), bins=np.linspace(0.0, math.pi, 11))
    # binomial, five sigma
    assert np.abs(counts - 2000).max() < 5.0 * math.sqrt(2000 * 0.9)
    for first, longest in ((4, 5.0), (10, 2.0)):
        length = np.linalg.norm([values[path] for path in PATHS[first : first + 3]], axis=0)
        assert 0.95 * longest < length.max() <= longest
        assert length.mean() == pytest.approx(0.5 * longest, rel=0.02)


def test_the_recorded_tilt_is_the_flown_one(alone):
    values = initial_states(SCENARIO, 400, 1, rate=12.0, offset=1.0, speed=2.0)
    w, x, y, z = (values[path] for path in PATHS[:4])
    R = Rotation.from_quat(np.array([x, y, z, w]).T).as_matrix()
    np.testing.assert_allclose(np.cos(alone.tilt), R[:, 2, 2], atol=1e-12)


def test_a_lane_is_caught_where_a_single_flight_is(under_guard):
    values = initial_states(SCENARIO, 400, 1, rate=12.0, offset=1.0, speed=2.0)
    flight = hovering(dataclasses.replace(SCENARIO, controller=guarded(SCENARIO.controller)))
    k = int(np.argmax(under_guard.tilt))
    at = [float(values[path][k]) for path in PATHS]
    state = dataclasses.replace(
        first_state(flight),
        quaternion=Quaternion(*at[:4]),
        rate=Vec3(*at[4:7]),
        position=Vec3(*at[7:10]),
        velocity=Vec3(*at[10:]),
    )
    log = run(dataclasses.replace(flight, initial=state, duration=5.0))
    assert under_guard.caught[k]
    assert log.status == "completed"
    assert 1.0 - 2.0 * (log.quaternion[-1, 1] ** 2 + log.quaternion[-1, 2] ** 2) > math.cos(math.radians(20.0))


def test_the_guard_catches_nearly_everything_and_far_more_than_the_law(alone, under_guard):
    upside_down = alone.tilt > 0.5 * math.pi
    assert under_guard.caught.mean() > 0.95
    assert under_guard.caught[upside_down].mean() > 0.9
    assert alone.caught.mean() < under_guard.caught.mean() - 0.1


def test_level_starts_at_rest_are_caught_by_the_law_alone():
    found = basin(SCENARIO, 60, seed=2, rate=0.5, offset=0.2, speed=0.2)
    level = found.tilt < math.radians(40.0)
    assert level.sum() > 5
    # but for a heading nearly opposite to the wanted one, which its attitude error hardly sees
    assert found.returned[level].mean() > 0.9


@pytest.mark.parametrize(
    ("rate", "speed", "joint", "expected"),
    [(0.9, 0.4, 0.9, True), (1.1, 0.0, 0.0, False), (0.0, 0.6, 0.0, False), (0.0, 0.0, 1.1, False)],
)
def test_a_flight_that_still_turns_drifts_or_swings_its_arm_is_not_caught(rate, speed, joint, expected):
    assert at_rest(np.array([rate]), np.array([speed]), np.array([joint])).tolist() == [expected]
    assert not at_rest(np.array([math.nan]), np.array([speed]), np.array([joint])).any()


def test_the_map_counts_every_flight_once(alone):
    plain = alone.plain()
    caught, flown = (np.array(plain[f"{word}_by_rate_and_tilt"]) for word in ("caught", "flown"))
    assert flown.sum() == plain["flights"] == 400
    assert caught.sum() == plain["caught"]
    assert (caught <= flown).all()


def test_the_figure_shows_the_map(alone):
    figure = basin_figure(alone)
    ax = figure.axes[0]
    assert ax.get_xlabel() == "initial tilt, degrees"
    assert f"of {len(alone.caught)} flights caught" in ax.get_title()


@pytest.mark.parametrize(("count", "limits", "words"), [(0, {}, "flights = 0"), (3, {"rate": -1.0}, "rate = -1.0")])
def test_wrong_numbers_are_refused(count, limits, words):
    with pytest.raises(ScenarioError, match=words):
        basin(SCENARIO, count, **limits)
