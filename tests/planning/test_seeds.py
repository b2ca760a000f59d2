"""Ways of the base that plans begin from: free of obstacles by points on them, as short
as the scene allows.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from skyarm.planning.seeds import free_distance, ways_around
from skyarm.records.files import Fields
from skyarm.records.read_table import record_from
from skyarm.world.contact.surface import Surface
from support.plans import box

REACH = 0.4


def surface(table: dict) -> Surface:
    return record_from(Surface, Fields({"name": "box"} | table, ""))


def from_box(
    points: np.ndarray, place: list[float], size: list[float], turn: float = 0.0
) -> np.ndarray:
    """Distance of points from a box, turned about z, written anew."""
    c, s = np.cos(turn), np.sin(turn)
    own = (points - place) @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    out = np.abs(own) - 0.5 * np.array(size)
    return np.linalg.norm(np.maximum(out, 0.0), axis=-1) + np.minimum(
        out.max(axis=-1), 0.0
    )


def sampled(way: np.ndarray) -> np.ndarray:
    return np.vstack(
        [
            a + np.linspace(0.0, 1.0, 400)[:, None] * (b - a)
            for a, b in itertools.pairwise(way)
        ]
    )


def length(way: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())


START, GOAL = np.array([-2.0, 0.0, 1.0]), np.array([2.0, 0.0, 1.0])


def test_the_straight_way_is_the_only_one_where_it_is_free() -> None:
    far = surface(box([0.0, 0.0, -2.0], [1.0, 1.0, 1.0]))
    for obstacles in ((), (far,)):
        (way,) = ways_around(obstacles, START, GOAL, REACH)
        np.testing.assert_array_equal(way, [START, GOAL])
    inside = surface(box([0.0, 0.0, 1.0], [1.0, 1.0, 1.0]))
    (still,) = ways_around([inside], START, START, REACH)
    np.testing.assert_array_equal(still, [START, START])


@pytest.mark.parametrize(
    ("place", "size", "turn"),
    [
        ([0.0, 0.0, 1.0], [0.4, 4.0, 1.0], 0.0),
        ([0.3, -0.5, 0.5], [0.3, 2.0, 4.0], 0.5),
        ([0.0, 0.0, 1.0], [1.0, 1.0, 1.0], 0.3),
    ],
)
def test_ways_around_a_box_are_free_and_short(
    place: list[float], size: list[float], turn: float
) -> None:
    obstacle = surface(box(place, size, angles=[0.0, 0.0, turn]))
    straight, *around = ways_around([obstacle], START, GOAL, REACH)
    np.testing.assert_array_equal(straight, [START, GOAL])
    assert from_box(sampled(straight), place, size, turn).min() < 0.0
    # one for each of three balls, the widest way first
    assert len(around) == 3
    for share, way in zip((1.0, 0.6, 0.3), around, strict=True):
        np.testing.assert_array_equal(way[[0, -1]], [START, GOAL])
        assert from_box(sampled(way), place, size, turn).min() > share * REACH - 0.02
        assert length(way) < 8.0
        assert len(way) < 12
    lengths = [length(way) for way in around]
    assert lengths[2] < lengths[0]


def test_a_way_leads_through_a_window() -> None:
    """Four boxes leave a window of 0.9 m in a wall of 60 m."""
    walls = [
        ([0.0, 15.5 + 0.45 - 0.5, 1.0], [0.2, 30.0, 60.0]),
        ([0.0, -15.45, 1.0], [0.2, 30.0, 60.0]),
        ([0.0, 0.0, 1.0 + 15.45 + 1.0], [0.2, 1.0, 30.0]),
        ([0.0, 0.0, 1.0 - 15.45 + 1.0], [0.2, 1.0, 30.0]),
    ]
    obstacles = [
        surface(box(place, size, name=f"wall{k}"))
        for k, (place, size) in enumerate(walls)
    ]
    start, goal = np.array([-1.5, -0.8, 0.6]), np.array([1.5, 0.5, 0.4])
    _, *around = ways_around(obstacles, start, goal, REACH)
    assert around
    for way in around:
        points = sampled(way)
        assert min(from_box(points, *wall).min() for wall in walls) > 0.3 * REACH - 0.02
        crossing = points[np.abs(points[:, 0]) < 0.02]
        assert (np.abs(crossing[:, 1]) < 0.45).all()
        assert (np.abs(crossing[:, 2] - 2.0) < 0.45).all()


@pytest.mark.thorough
def test_a_wall_without_a_window_leaves_the_straight_way_alone() -> None:
    wall = surface(box([0.0, 0.0, 0.0], [0.3, 200.0, 200.0]))
    (way,) = ways_around([wall], START, GOAL, REACH)
    np.testing.assert_array_equal(way, [START, GOAL])


def test_distances_of_points_from_the_nearest_obstacle() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(-2.0, 2.0, size=(7, 50, 3))
    boxes = [
        ([0.5, 0.0, 0.2], [0.6, 1.0, 0.8], 0.4),
        ([-1.0, 1.0, 0.0], [1.0, 0.2, 2.0], 0.0),
    ]
    obstacles = [
        surface(box(p, s, angles=[0.0, 0.0, a], name=f"b{k}"))
        for k, (p, s, a) in enumerate(boxes)
    ]
    ball = surface(
        {"name": "ball", "shape": "sphere", "size": [0.5], "position": [0.0, -1.0, 0.0]}
    )
    expected = np.minimum.reduce(
        [
            *(from_box(points, *each) for each in boxes),
            np.linalg.norm(points - [0.0, -1.0, 0.0], axis=-1) - 0.5,
        ]
    )
    np.testing.assert_allclose(
        free_distance([*obstacles, ball], points), expected, atol=1e-9
    )
    assert (free_distance((), points) == np.inf).all()


def test_a_way_does_not_lead_through_a_wall_thinner_than_the_cells() -> None:
    place, size = [-0.5, 0.0, 1.0], [0.02, 9.0, 9.0]
    _, *around = ways_around([surface(box(place, size))], START, GOAL, 0.3)
    for way in around:
        assert from_box(sampled(way), place, size).min() > 0.07
