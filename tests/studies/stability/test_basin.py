"""The basin of attraction: draws, single flights beside lanes, and that a guard makes it wider."""

from __future__ import annotations

import dataclasses
import importlib
import math

import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.contour import ContourSet
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.control.safety import with_safety_layer
from skyarm.scenario.scenario_record import ScenarioError, first_state
from skyarm.simulate import run
from skyarm.studies.stability.along import hovering
from skyarm.studies.stability.basin import PATHS, Basin, at_rest, basin, initial_states
from skyarm.view.figures.study_figures import basin_figure

ROOM = importlib.import_module("skyarm.studies.stability.basin")  # the room's own name is the function's, too
SCENARIO = skyarm.load_scenario("case3")


@pytest.fixture(scope="module")
def alone():
    return basin(SCENARIO, 400, seed=1)


@pytest.fixture(scope="module")
def under_guard():
    return basin(dataclasses.replace(SCENARIO, controller=with_safety_layer(SCENARIO.controller)), 400, seed=1)


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
    flight = hovering(dataclasses.replace(SCENARIO, controller=with_safety_layer(SCENARIO.controller)))
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
    title = ax.get_title().replace("\n", " ")
    assert title == f"hybrid_computed_torque in case3: {alone.caught.mean():.1%} of {len(alone.caught)} flights caught"
    words = figure.get_supxlabel().replace("\n", " ")
    assert words.startswith("Caught: 12 s after its start within 5 m")
    assert words.endswith("slower than 0.5 m/s and 1 rad/s, every joint slower than 1 rad/s (m/s).")


def many(flights):
    """A basin as flown, caught where the tilt is below 60 degrees."""
    rng = np.random.default_rng(0)
    tilt = rng.uniform(0.0, math.pi, flights)
    caught = tilt < math.radians(60.0)
    return Basin(
        **{"controller": "c", "scenario": "s", "seed": 0, "tilt": tilt, "rate": rng.uniform(0.0, 12.0, flights)},
        **{"offset": tilt, "speed": tilt, "caught": caught, "returned": caught, "status": caught},
        **{"rate_limit": 12.0, "offset_limit": 1.0, "speed_limit": 2.0},
    )


@pytest.mark.parametrize(("flights", "shades", "line"), [(1199, 0, 0), (1200, 24, 0), (10800, 216, 1)])
def test_few_flights_are_points_and_more_make_a_finer_map(flights, shades, line):
    figure = basin_figure(many(flights))
    ax = figure.axes[0]
    meshes = [each for each in ax.collections if isinstance(each, QuadMesh)]
    assert sum(mesh.get_array().size for mesh in meshes) == shades
    contours = [each for each in ax.collections if isinstance(each, ContourSet)]
    assert len(contours) == line
    for contour in contours:
        (path,) = [each for each in contour.get_paths() if len(each.vertices)]
        np.testing.assert_allclose(path.vertices[:, 0], 60.0, atol=1.0)
    points = [each for each in ax.lines if each.get_label() in ("caught", "not caught")]
    assert sum(len(each.get_xdata()) for each in points) == (0 if shades else flights)


@pytest.mark.parametrize("limit", ["POSITION", "TILT", "RATE", "SPEED", "JOINT_RATE"])
def test_a_flight_must_be_within_every_limit_to_be_caught(limit, monkeypatch):
    still = {"seed": 2, "rate": 0.5, "offset": 0.2, "speed": 0.2}
    assert basin(SCENARIO, 16, **still).caught.any()
    # no flight has settled so far; not zero, below which nothing at all is, not even what nobody looked at
    monkeypatch.setattr(ROOM, f"CAUGHT_{limit}", 1e-12)
    assert not basin(SCENARIO, 16, **still).caught.any()


def test_rates_offsets_and_speeds_are_those_asked_for_and_flown():
    limits = {"rate": 3.0, "offset": 0.5, "speed": 0.7}
    found = basin(SCENARIO, 200, seed=4, **limits)
    values = initial_states(SCENARIO, 200, 4, **limits)
    start = np.array([float(c) for c in first_state(SCENARIO).position])
    for name, first in (("rate", 4), ("offset", 7), ("speed", 10)):
        vectors = np.array([values[path] for path in PATHS[first : first + 3]]).T - (start if name == "offset" else 0.0)
        np.testing.assert_allclose(getattr(found, name), np.linalg.norm(vectors, axis=1), rtol=1e-12)
        assert 0.9 * limits[name] < getattr(found, name).max() <= limits[name]
        assert found.plain()["limits"][name] == limits[name]


def test_slow_starts_are_caught_where_fast_ones_are_not():
    slow = basin(SCENARIO, 200, seed=4, rate=0.0, offset=0.0, speed=0.0)
    fast = basin(SCENARIO, 200, seed=4, rate=0.0, offset=0.0, speed=100.0)
    assert fast.caught.mean() < slow.caught.mean() - 0.2


@pytest.mark.parametrize(
    ("count", "limits", "words"),
    [
        (0, {}, "flights = 0"),
        (10**9, {}, "flights = 1000000000: must be from 1 to 10000000"),
        (3, {"rate": -1.0}, "rate = -1.0"),
        (3, {"rate": 1e300}, "must be from 0 to 1000"),
        (3, {"speed": math.inf}, "speed = inf"),
        (3, {"offset": math.nan}, "offset = nan"),
    ],
)
def test_wrong_numbers_are_refused(count, limits, words):
    with pytest.raises(ScenarioError, match=words):
        basin(SCENARIO, count, **limits)
