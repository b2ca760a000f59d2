"""The front and the pick from it, on points made by hand."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from skyarm.studies.tune.candidate_flights import Scores
from skyarm.studies.tune.front import (
    LoopMargins,
    Point,
    Required,
    finalists,
    front_of,
    pareto_front,
    pick,
)

REQUIRED = Required(delay=0.010, gain=1.5)
WIDE = LoopMargins(delay=0.02, rotors=(0.4, 3.0), joints=(0.0, math.inf))


def point(error, jitter, margins=WIDE, lost=0.0, saturated=0.0):
    return Point(
        logs=(0.0,),
        error=error,
        tip=error,
        jitter=jitter,
        effort=0.0,
        lost=lost,
        saturated=saturated,
        margins=margins,
    )


def test_the_front_goes_from_calm_to_stiff_without_points_that_another_beats():
    points = [
        point(3.0, 1.0),
        point(1.0, 5.0),
        point(2.0, 2.0),
        point(2.5, 3.0),
        point(0.5, 9.0, lost=0.1),
    ]
    assert [(each.error, each.jitter) for each in pareto_front(points)] == [
        (3.0, 1.0),
        (2.0, 2.0),
        (1.0, 5.0),
    ]


def test_the_best_of_the_gains_known_before_stays_where_none_found_is_better():
    found, worse = [point(3.0, 1.0), point(1.2, 5.0)], point(9.0, 0.2)
    assert front_of([worse, point(1.0, 4.0)], found, REQUIRED) == (
        [found[0], point(1.0, 4.0)],
        1,
    )
    # calm and nearly as good: what was found is still better
    assert front_of([worse, point(1.21, 0.5)], found, REQUIRED) == (found, 1)
    assert front_of([point(1.0, 4.0, lost=0.01), worse], found, REQUIRED) == (found, 1)
    # where nothing meets all, a start that is no worse than what was found is among
    # what is chosen from
    lost = [dataclasses.replace(each, lost=0.5) for each in found]
    assert front_of([point(1.3, 9.0, lost=0.1)], lost, REQUIRED) == (
        [point(1.3, 9.0, lost=0.1)],
        0,
    )


@pytest.mark.parametrize("start", [0.99, 1.02, 1.2])
def test_what_is_picked_is_never_worse_than_gains_known_before(start):
    """The calmest within 5 % would be at 1.04; a start that meets all constraints and
    is better forbids it.
    """
    found = [point(2.0, 1.0), point(1.04, 2.0), point(1.0, 3.0)]
    front, picked = front_of([point(5.0, 9.0), point(start, 2.5)], found, REQUIRED)
    assert front[picked].error == (
        start if start < 1.0 else 1.0 if start < 1.04 else 1.04
    )
    # one that does not meet them forbids nothing
    short = point(start, 2.5, dataclasses.replace(WIDE, delay=0.009))
    front, picked = front_of([short], found, REQUIRED)
    assert front[picked].error == 1.04


def test_the_pick_is_the_calmest_within_5_percent_of_the_least_error_that_meets_all():
    points = [point(1.2, 1.0), point(1.04, 2.0), point(1.0, 3.0)]
    assert pick(points, REQUIRED) == 1
    assert pick([point(1.2, 1.0), point(1.06, 2.0), point(1.0, 3.0)], REQUIRED) == 2


@pytest.mark.parametrize(("tip", "picked"), [(1.04, 0.8), (1.06, 0.95), (9.0, 0.95)])
def test_a_better_error_is_not_bought_with_the_tip_along_the_scenarios_motion(
    tip, picked
):
    """Two of one start's 1.0 and 1.0: the stiffer has less error, and its tip's is what
    is asked.
    """
    found = [
        point(3.0, 0.5),
        point(0.95, 2.0),
        dataclasses.replace(point(0.8, 3.0), tip=tip),
    ]
    front, number = front_of([point(1.0, 1.5)], found, REQUIRED)
    assert front[number].error == picked
    # the slider goes on to the stiff end
    assert front == found
    # nothing is left: the start is picked
    front, number = front_of(
        [point(1.0, 1.5)],
        [dataclasses.replace(each, tip=9.0) for each in found],
        REQUIRED,
    )
    assert front[number] == point(1.0, 1.5)
    assert [each.jitter for each in front] == [0.5, 1.5, 2.0, 3.0]


def test_a_pick_that_another_point_beats_stands_beside_it_on_the_front():
    """Calmer and of less error, but its tip's along the scenario's motion is what
    nobody wants.
    """
    found = [
        dataclasses.replace(point(0.8, 1.0), tip=9.0),
        point(0.9, 2.0),
        point(2.0, 0.5),
    ]
    stiff = dataclasses.replace(point(0.5, 3.0), tip=9.0)
    front, number = front_of([point(1.0, 1.5)], [*found, stiff], REQUIRED)
    assert front == [found[2], found[0], found[1], stiff]
    assert number == 2
    # as one does that does not meet the margins
    short = dataclasses.replace(
        found[0], tip=0.8, margins=dataclasses.replace(WIDE, delay=0.009)
    )
    front, number = front_of([point(5.0, 1.5, lost=0.1)], [short, *found[1:]], REQUIRED)
    assert (front, number) == ([found[2], short, found[1]], 2)


@pytest.mark.parametrize(
    "worse",
    [
        {"lost": 0.01},
        {"saturated": 0.06},
        {"margins": dataclasses.replace(WIDE, delay=0.009)},
        {"margins": dataclasses.replace(WIDE, rotors=(0.4, 1.49))},
        {"margins": dataclasses.replace(WIDE, rotors=(0.67, 3.0))},
        {"margins": dataclasses.replace(WIDE, joints=(0.0, 1.4))},
    ],
)
def test_what_misses_a_constraint_is_not_picked_though_its_error_is_least(worse):
    assert pick([point(2.0, 1.0), point(1.0, 2.0, **worse)], REQUIRED) == 0


def test_where_none_meets_the_margins_the_least_short_is_picked():
    near, far = (dataclasses.replace(WIDE, delay=delay) for delay in (0.009, 0.004))
    assert pick([point(2.0, 1.0, far), point(3.0, 2.0, near)], REQUIRED) == 1
    none = dataclasses.replace(WIDE, delay=0.0)
    assert (
        pick(
            [point(3.0, 1.0, none), point(2.0, 2.0, none), point(2.5, 3.0, none)],
            REQUIRED,
        )
        == 1
    )
    assert near.shortness(REQUIRED) == pytest.approx(10.0 / 9.0)
    assert dataclasses.replace(WIDE, rotors=(0.8, 3.0)).shortness(
        REQUIRED
    ) == pytest.approx(1.2)


def test_a_loop_without_margins_is_not_asked_for_any():
    none = LoopMargins(
        delay=0.0, rotors=(1.0, 1.0), joints=(1.0, 1.0), why_none="servos"
    )
    assert pick([point(1.0, 1.0, none)], REQUIRED) == 0
    assert none.meet(REQUIRED)


def test_finalists_hold_the_best_of_every_weight_and_no_loser():
    jitter = np.geomspace(1.0, 100.0, 30)
    none = np.zeros(30)
    lost = none.copy()
    lost[10] = 0.2
    found = Scores(
        error=1.0 / jitter,
        tip=none,
        pull=none,
        jitter=jitter,
        effort=none,
        lost=lost,
        short=none,
    )
    chosen = finalists([found], 9)
    # error times jitter is the same everywhere: below a weight of 1 the stiffest is
    # cheapest, above the calmest
    assert chosen[0] == 0
    assert chosen[-1] == 29
    assert len(chosen) == 9
    assert 10 not in chosen
    assert chosen == sorted(chosen)


def test_gains_known_before_that_miss_the_margins_too_are_chosen_from_at_equal_error():
    """As good as what was found in what is compared, and less short of the margins."""
    near, far = (
        point(1.0, 2.0, dataclasses.replace(WIDE, delay=delay))
        for delay in (0.009, 0.004)
    )
    front, picked = front_of([near], [far], REQUIRED)
    assert front[picked] == near
    # one of more error stays away however little it is short
    front, picked = front_of([dataclasses.replace(near, error=1.1)], [far], REQUIRED)
    assert front[picked] == far


def test_a_start_that_meets_the_constraints_is_the_measure_beside_a_better_one():
    narrow = LoopMargins(delay=0.001, rotors=(0.9, 1.1), joints=(0.0, math.inf))
    allowed, not_allowed = point(2.0, 1.0), point(1.0, 1.0, margins=narrow)
    worse = point(3.0, 0.5)
    front, number = front_of([not_allowed, allowed], [worse], REQUIRED)
    assert front[number] == allowed


def test_the_stiffest_weight_is_three_hundredths():
    """Of two candidates with activities apart by e^10, one is 10 times the weight of
    the logarithm of error better.
    """

    def scores(error, jitter):
        zeros = np.zeros(2)
        error = np.array(error)
        return Scores(
            error=error,
            tip=error,
            pull=zeros,
            jitter=np.array(jitter),
            effort=np.ones(2),
            lost=zeros,
            short=zeros,
        )

    for apart, both in ((0.3015, True), (0.2985, False)):
        found = finalists(
            [scores([1.0, math.exp(apart)], [math.exp(10.0), 1.0])], count=1
        )
        assert (0 in found) is both
