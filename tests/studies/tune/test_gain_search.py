"""The search on costs that need no flight: it finds a known minimum, repeats, looks at
few margins.
"""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.cli.tune_command import tune
from skyarm.studies.sweep.sobol import DIMENSIONS
from skyarm.studies.tune.candidate_flights import WEIGHTS, Scores
from skyarm.studies.tune.gain_search import (
    BOX,
    Effort,
    costs,
    scatter,
    search,
    with_margins,
)
from skyarm.studies.tune.law_knobs import GainKnob
from skyarm.studies.tune.tuning import BOUNDS, TEAM, VEHICLE, effort_of

KNOBS = tuple(
    GainKnob(path=f"k{i}", unit=unit, numbers=(((f"k{i}",), 2.0),))
    for i, unit in enumerate(("1/s^2", "1/s", "rad/s", ""))
)
EFFORT = Effort(scatter=60, population=8, rounds=12, plants=4, first_plants=2)
BEST = np.array([0.7, -0.4, 0.2, 1.1])


def scores_of(logs):
    """Error a bowl about BEST, jitter grows with the first gain, lost beyond a wall."""
    away = np.sum((logs - BEST) ** 2, axis=1)
    none = np.zeros(len(logs))
    lost = np.where(logs[:, 1] > 1.0, 0.5, 0.0)
    return Scores(
        error=0.01 * np.exp(away),
        tip=none,
        pull=none,
        jitter=np.exp(logs[:, 0]),
        effort=none,
        lost=lost,
        short=none.copy(),
    )


def test_the_stiffest_strategy_finds_the_minimum_and_the_calmest_trades_error():
    logs, found = search(
        KNOBS, EFFORT, lambda _number, asked, _plants: scores_of(asked), seed=1
    )
    assert logs.shape == (EFFORT.candidates, len(KNOBS))
    stiff, calm = (
        logs[costs(found, weight).argmin()] for weight in (min(WEIGHTS), max(WEIGHTS))
    )
    # the minimum of |x - b|^2 + w x_0 is b_0 - w / 2
    assert stiff == pytest.approx(BEST - [0.5 * min(WEIGHTS), 0, 0, 0], abs=0.15)
    assert calm == pytest.approx(BEST - [0.5 * max(WEIGHTS), 0, 0, 0], abs=0.15)
    assert np.abs(logs).max() <= BOX + 1e-6


def test_a_search_asks_the_same_questions_again_and_other_ones_with_another_seed():
    asked = {}
    for name, seed in (("first", 3), ("again", 3), ("other", 4)):
        asked[name] = search(
            KNOBS, EFFORT, lambda _number, logs, _plants: scores_of(logs), seed=seed
        )[0]
    np.testing.assert_array_equal(asked["first"], asked["again"])
    assert not np.array_equal(asked["first"], asked["other"])


def test_the_scatter_begins_with_the_law_as_it_is_and_goes_along_one_bandwidth():
    points = scatter(KNOBS, 60, seed=0)
    np.testing.assert_array_equal(points[0], 0.0)
    # on the line a stiffness moves as the square of a damping, or all gains alike
    np.testing.assert_allclose(points[2:25:2, 0], 2.0 * points[2:25:2, 1], atol=1e-12)
    np.testing.assert_allclose(
        points[1:25:2], np.repeat(points[1:25:2, :1], len(KNOBS), axis=1), atol=1e-12
    )
    # gains three times too high or too low are near the right ones somewhere on it
    for off in (np.log(3.0), -np.log(3.0)):
        assert np.abs(points[1:25:2, 0] + off).min() < 0.2
    known = scatter(KNOBS, 60, seed=0, starts=np.array([[1.0] * 4, [0.0] * 4]))
    np.testing.assert_allclose(known[2:26, 0], 2.0 * known[2:26, 1], atol=1e-12)
    assert np.abs(points).max() <= BOX + 1e-6


def test_more_gains_than_a_sobol_sequence_has_dimensions_are_scattered():
    many = tuple(
        GainKnob(path=f"k{i}", unit="1/s", numbers=(((f"k{i}",), 2.0),))
        for i in range(DIMENSIONS + 4)
    )
    points, few = (
        scatter(knobs, 200, seed=3)[-150:] for knobs in (many, many[:DIMENSIONS])
    )
    np.testing.assert_array_equal(points[:, :DIMENSIONS], few)
    np.testing.assert_array_equal(points, scatter(many, 200, seed=3)[-150:])
    assert points[:, DIMENSIONS:].std(axis=0).min() > 0.5 * few.std(axis=0).min()
    assert np.abs(np.corrcoef(points.T)[DIMENSIONS:, :DIMENSIONS]).max() < 0.35


def test_a_share_of_one_never_grows_beyond_it():
    share = GainKnob(path="lag_share", unit="", numbers=((("lag_share",), 0.5),))
    assert np.exp(scatter((share,), 60, seed=0)).max() * 0.5 <= 1.0 + 1e-6


def test_margins_are_looked_at_only_where_they_change_who_leads():
    logs = np.random.default_rng(0).uniform(-1.0, 1.0, (40, 4))
    scored, looked = scores_of(logs), []
    truth = np.where(logs[:, 2] > 0.0, 4.0, 0.0)

    def short(asked):
        looked.extend(asked.tolist())
        return np.where(asked[:, 2] > 0.0, 4.0, 0.0)

    groups = [
        (weight, slice(20 * i, 20 * (i + 1)), 5) for i, weight in enumerate((0.1, 1.0))
    ]
    found = with_margins(scored, logs, groups, short)
    assert len(looked) < 40
    for weight, which, count in groups:
        wanted = (scored.cost(weight) + truth)[which].argsort(kind="stable")[:count]
        np.testing.assert_array_equal(
            found.cost(weight)[which].argsort(kind="stable")[:count], wanted
        )


def test_an_effort_flies_about_as_many_candidates_as_are_requested():
    each_round = Effort().population * len(WEIGHTS)
    for candidates in (200, 500, 1400, 5000):
        found = Effort().scale(candidates, 6)
        assert abs(found.candidates - candidates) <= each_round / 2
        assert (found.plants, found.first_plants, found.population) == (
            6,
            6,
            Effort().population,
        )
    assert Effort().scale(Effort().candidates, Effort().plants) == Effort()
    assert Effort().scale(10, 24).rounds == 2, (
        "the second round is the first that learns of another"
    )


def test_the_least_effort_that_may_be_asked_for_is_flown_and_said():
    least, _ = BOUNDS["candidates"]
    for subject in (TEAM, VEHICLE):
        assert effort_of(subject, least, None).candidates == least
        assert effort_of(subject, 1, None).candidates == least
    assert f" {least} or more;" in " ".join(tune.__doc__.split())
