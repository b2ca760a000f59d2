"""The minimisers on functions whose minimum is known, the same points every time."""

from __future__ import annotations

import numpy as np
import pytest

from inference.search import compass, decode, differential_evolution, encode
from inference.study import Parameter


def rugged(points):
    """Rastrigin's function around (0.3, 0.7, 0.45), whose local minima are many."""
    x = 4.0 * (points - np.array([0.3, 0.7, 0.45]))
    return (x**2 - np.cos(2.0 * np.pi * x) + 1.0).sum(axis=1)


def test_differential_evolution_finds_the_lowest_of_many_minima():
    best = differential_evolution(rugged, 3, population=48, generations=80, seed=1)
    assert np.allclose(best, [0.3, 0.7, 0.45], atol=0.01)


def test_it_finds_a_minimum_at_the_edge_and_stays_inside():
    seen = []

    def cost(points):
        seen.append(points)
        return points.sum(axis=1)

    best = differential_evolution(cost, 2, population=16, generations=40, seed=3)
    assert best.max() < 0.01
    assert all(points.min() >= 0.0 and points.max() <= 1.0 for points in seen)


def test_the_same_seed_gives_the_same_points_and_another_others():
    runs = [
        differential_evolution(rugged, 3, population=12, generations=5, seed=seed)
        for seed in (5, 5, 6)
    ]
    assert np.array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])


def test_the_compass_ends_at_the_minimum_from_every_start():
    def bowl(points):
        return ((points - 0.4) ** 2 * np.array([1.0, 9.0])).sum(axis=1)

    starts = np.array([[0.0, 0.0], [1.0, 0.2], [0.4, 0.4]])
    points, costs = compass(bowl, starts)
    assert np.allclose(points, 0.4, atol=0.004)
    assert np.array_equal(costs, bowl(points))


def test_what_is_held_stays():
    def bowl(points):
        return ((points - 0.4) ** 2).sum(axis=1)

    starts = np.array([[0.9, 0.9], [0.1, 0.1]])
    points, _ = compass(bowl, starts, np.array([[True, False], [False, True]]))
    assert points[0, 0] == 0.9
    assert points[1, 1] == 0.1
    assert points[0, 1] == pytest.approx(0.4, abs=0.004)
    assert points[1, 0] == pytest.approx(0.4, abs=0.004)


def parameter(low, high, step, scale="linear"):
    return Parameter(
        name="p", words="", unit="", low=low, high=high, step=step, scale=scale
    )


def test_values_are_whole_steps_from_the_low_end_as_decimals():
    values = decode([parameter(0.0, 0.1, 0.001)], np.linspace(0.0, 1.0, 1001)[:, None])[
        "p"
    ]
    assert set(values.tolist()) == {round(0.001 * k, 5) for k in range(101)}
    assert 0.06 in values.tolist()
    assert decode([parameter(4.0, 9.0, 0.05)], np.array([[0.39]]))["p"].tolist() == [
        5.95
    ]


def test_a_log_scale_has_its_middle_at_the_geometric_mean():
    values = decode(
        [parameter(0.2, 5.0, 0.01, "log")],
        np.array([[0.0], [0.5], [1.0], [-3.0], [7.0]]),
    )["p"]
    assert values.tolist() == pytest.approx([0.2, 1.0, 5.0, 0.2, 5.0])


@pytest.mark.parametrize("scale", ["linear", "log"])
def test_a_value_comes_back_from_its_point(scale):
    one = parameter(0.5, 4.0, 0.25, scale)
    for value in (0.5, 0.75, 2.25, 4.0):
        assert decode([one], encode([one], [value])[None, :])["p"].tolist() == [value]


def trials_of(cost, **options):
    """Everything that differential evolution asks about, generation by generation."""
    asked = []

    def recorded(points):
        asked.append(points.copy())
        return cost(points)

    best = differential_evolution(
        recorded, 3, **{"population": 24, "generations": 12, "seed": 4} | options
    )
    return best, asked


def test_a_point_beyond_the_cube_is_reflected_and_not_pressed_against_it():
    _, asked = trials_of(lambda points: points.sum(axis=1))
    every = np.concatenate(asked)
    assert every.min() < 0.02
    assert not np.isin(every, (0.0, 1.0)).any()


def test_a_trial_as_good_as_its_parent_takes_its_place():
    """On a plain nothing stands still, else a search would not cross it."""
    best, asked = trials_of(lambda points: np.zeros(len(points)))
    assert not np.array_equal(best, asked[0][0])


def test_the_first_points_are_even_and_everyone_is_asked_about_once_a_generation():
    _, asked = trials_of(rugged, population=32, generations=3)
    assert [len(each) for each in asked] == [32] * 4
    for column in asked[0].T:
        counts = np.bincount((column * 8).astype(int), minlength=8)
        assert counts.min() >= 3, (
            "four in each eighth, but for the origin that is left out"
        )
        assert counts.max() <= 5


def test_half_of_the_steps_lead_towards_the_best():
    """A narrow valley that lies askew: steps elsewhere, or of one coordinate at a time,
    do not come to its end.
    """
    turn, _ = np.linalg.qr(
        np.array([[1.0, 2.0, -1.0], [0.5, -1.0, 3.0], [2.0, 0.3, 0.7]])
    )

    def valley(points):
        along = (points - np.array([0.3, 0.7, 0.45])) @ turn
        return (along**2 * np.array([1.0, 300.0, 10_000.0])).sum(axis=1)

    ends = [
        valley(
            differential_evolution(valley, 3, population=24, generations=60, seed=seed)[
                None, :
            ]
        )[0]
        for seed in range(8)
    ]
    assert np.median(ends) < 1e-7


def test_the_compass_halves_its_steps_from_an_eighth_to_a_512th():
    seen = []

    def plain(points):
        seen.append(points.copy())
        return np.zeros(len(points))

    compass(plain, np.full((1, 2), 0.5))
    steps = [float(np.abs(points - 0.5).max()) for points in seen[1:]]
    assert steps == [2.0**-k for k in range(3, 10)]
    assert all(len(points) == 4 for points in seen[1:]), "both ways along each axis"


@pytest.mark.parametrize("scale", ["linear", "log"])
def test_no_value_leaves_its_range_however_coarse_the_step(scale):
    points = np.linspace(0.0, 1.0, 201)[:, None]
    for low, high, step in (
        (0.0004, 0.26, 0.1),
        (0.12345, 1.0, 0.5),
        (5e-05, 0.005, 1e-05),
    ):
        values = decode([parameter(low, high, step, scale)], points)["p"]
        assert (values.min(), values.max()) == (low, high)


def test_the_compass_ends_on_the_edge_and_not_beyond_it():
    points, costs = compass(lambda at: -at.sum(axis=1), np.array([[0.95, 0.2]]))
    assert points.tolist() == [[1.0, 1.0]]
    assert costs.tolist() == [-2.0]
