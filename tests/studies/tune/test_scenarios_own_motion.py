"""The scenario's own motion among those of a search: which plants fly it, what their
flights say, where it counts.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import skyarm
from skyarm.log.metrics.windows import Window, Windows
from skyarm.records.leaves import parts
from skyarm.reference import Constant
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_file import load_scenario
from skyarm.studies.flights import WorkRunner
from skyarm.studies.tune import candidate_flights
from skyarm.studies.tune.candidate_flights import (
    OWN,
    CandidateFlights,
    CandidateResults,
    of_drawn,
    shorten,
    with_own,
)
from skyarm.studies.tune.excitation import (
    KINDS,
    draw_plants,
    of_vehicle,
    sine_from_rest,
    tuning_flight,
)
from skyarm.studies.tune.gain_search import Effort
from skyarm.studies.tune.law_knobs import find_knobs
from skyarm.studies.tune.subject import SearchSizes, Subject
from skyarm.studies.tune.tuning import Tuner, TuningPlan
from skyarm.vehicle.vehicle_files import load_vehicle


@pytest.fixture(scope="module")
def short():
    """A second of drawn motion with a gust's window, and one of an own motion, of a
    vehicle without an arm.
    """
    scenario = of_vehicle(load_vehicle("hummingbird"), "decoupled_pd")
    path = dataclasses.replace(
        scenario.reference, x=sine_from_rest(8.0, 1.0), z=Constant(5.0)
    )
    own = tuning_flight(
        dataclasses.replace(scenario, reference=path, duration=1.0), own_motion=True
    )
    windows = Windows(steady=Window(0.2, 0.5), gust=Window(0.5, 1.0))
    return dataclasses.replace(
        tuning_flight(scenario), duration=1.0, windows=windows
    ), shorten(own)


@pytest.mark.parametrize(
    ("duration", "steady", "flown", "window"),
    [
        (30.0, (10.0, 20.0), 15.0, (10.0, 15.0)),
        (30.0, (3.0, 20.0), 8.0, (3.0, 8.0)),
        (90.0, (40.0, 90.0), 15.0, (10.0, 15.0)),
        (30.0, (9.0, 12.0), 12.0, (9.0, 12.0)),
        (6.0, None, 6.0, (2.0, 6.0)),
        # a third of it is no whole number of control periods
        (16.0, None, 10.335, (16.0 / 3.0, 16.0 / 3.0 + 5.0)),
        (30.0, (9.0, 12.002), 12.005, (9.0, 12.002)),
    ],
)
def test_a_search_flies_the_own_motion_until_enough_of_it_was_looked_at(
    duration, steady, flown, window
):
    windows = Windows(steady=steady and Window(*steady), transient=Window(0.0, 6.0))
    case = tuning_flight(load_scenario("case3"), own_motion=True)
    found = shorten(dataclasses.replace(case, duration=duration, windows=windows))
    assert (found.duration, found.windows.steady) == (flown, Window(*window))
    assert found.reference == case.reference


def test_saturation_is_the_share_of_periods_with_a_rotor_at_its_limit():
    vehicle = load_vehicle("hummingbird")
    hover = math.sqrt(
        float(vehicle.mass)
        * 9.81
        / sum(float(r.thrust_coefficient) for r in vehicle.rotors)
    )
    weak = tuple(dataclasses.replace(r, max_speed=1.05 * hover) for r in vehicle.rotors)
    flight = tuning_flight(
        of_vehicle(dataclasses.replace(vehicle, rotors=weak), "decoupled_pd")
    )
    flight = dataclasses.replace(
        flight, duration=1.0, windows=Windows(steady=Window(0.2, 1.0))
    )
    plants = draw_plants(flight, 3, seed=1)
    found = (
        CandidateFlights(flight, (), plants, WorkRunner(), saturation=True)
        .fly("few", np.zeros((1, 0)))
        .saturated[0]
    )
    for i, share in enumerate(found):
        log = skyarm.run(
            with_numbers(
                flight, {path: column[i] for path, column in plants.values.items()}
            )
        )
        limited = (log.rotor_commands <= 0.0) | (
            log.rotor_commands >= (1.0 - 1e-6) * 1.05 * hover
        )
        # of single precision
        assert share == pytest.approx(
            limited[log.time >= 0.2].any(axis=1).mean(), abs=0.02
        )
    assert 0.02 < found.mean() < 0.98


def test_every_fourth_plant_flies_the_own_motion_and_the_other_kinds_stay_balanced(
    short,
):
    drawn = draw_plants(short[0], 24, seed=3, mixed=True)
    plants = with_own(drawn)
    assert np.flatnonzero(plants.kinds == OWN).tolist() == [3, 7, 11, 15, 19, 23]
    assert np.bincount(plants.kinds).tolist() == [6] * (len(KINDS) + 1)
    assert (
        with_own(draw_plants(short[0], 7, seed=3, mixed=True)).kinds.tolist()
        == plants.kinds[:7].tolist()
    )
    assert drawn.kinds.max() < OWN


@pytest.mark.thorough
def test_plants_fly_the_motion_of_their_kind_in_as_many_flights(short, monkeypatch):
    """Each column is that of the same plant where one batch flies one motion, and the
    table is in the plants' order.
    """
    flight, own = short
    knobs = find_knobs(flight.controller, "decoupled_pd")
    drawn = draw_plants(flight, 12, seed=3, mixed=True)
    plants, logs = with_own(drawn), np.array([[0.0] * len(knobs), [0.3] * len(knobs)])
    crew, works = WorkRunner(), []
    real = crew.rows
    monkeypatch.setattr(crew, "rows", lambda asked: works.append(asked) or real(asked))
    flights = CandidateFlights(flight, knobs, plants, crew, own=own, seed=4, gust=True)
    found, first = flights.fly("all", logs), flights.fly("few", logs, 7)
    # more lanes than there are plants would be more flights
    assert [[work.count for work in asked] for asked in works] == [[18, 6], [12, 2]]
    labels = [work.label for asked in works for work in asked]
    assert labels == ["all.1", "all.own.1", "few.1", "few.own.1"]
    still = drawn.select(np.flatnonzero(plants.kinds != OWN))
    alone = CandidateFlights(flight, knobs, drawn, WorkRunner(), seed=4, gust=True).fly(
        "all", logs, others=still
    )
    mine = candidate_flights._without_motions(drawn)
    own_alone = CandidateFlights(own, knobs, mine, WorkRunner(), seed=4)
    for name, table in parts(
        own_alone.fly("own", logs, others=mine.select(np.array([3, 7, 11])))
    ).items():
        np.testing.assert_array_equal(
            getattr(found, name)[..., [3, 7, 11]], table if name != "kinds" else OWN
        )
    for name, table in parts(found).items():
        np.testing.assert_array_equal(
            table[..., plants.kinds != OWN], getattr(alone, name)
        )
        np.testing.assert_array_equal(
            getattr(of_drawn(found), name), getattr(alone, name)
        )
        # the first plants do not depend on how many fly
        np.testing.assert_array_equal(table[..., :7], getattr(first, name))
    # there is a gust along drawn motions, whose window counts as much as the first one
    assert ((found.error == found.base) == (plants.kinds == OWN)).all()
    # an own motion of 8 m at 1 Hz that no drawn one comes near
    assert (
        found.base[:, plants.kinds == OWN].min()
        > 2.0 * found.base[:, plants.kinds != OWN].max()
    )
    # no plant may be left of a kind
    np.testing.assert_array_equal(
        flights.fly("none", logs, others=plants.select(np.arange(3))).error,
        found.error[:, :3],
    )


class NoMargins:
    """Of a loop that cannot be linearised."""

    def __init__(self, *_):
        pass

    def costs(self, logs):
        return np.zeros(len(logs))


class FixedErrors:
    """In place of flights: errors of 1 mm along drawn motions, 16 mm along the
    scenario's own.
    """

    # (stage, asked, plants), cleared by the test
    flown: list[tuple[str, int, int]] = []  # noqa: RUF012

    def __init__(self, flight, knobs, plants, crew, *, own, seed, gust):
        self.plants = plants

    def fly(self, stage, logs, plants=None, others=None):
        kinds = (others or self.plants).kinds[:plants]
        self.flown.append((stage, len(logs), len(kinds)))
        table = np.ones((len(logs), len(kinds)))
        error = 1e-3 * np.where(kinds == OWN, 16.0, 1.0) * table
        rest = dict.fromkeys(("base", "pull", "jitter", "effort", "saturated"), table)
        return CandidateResults(
            error=error, tip=error, lost=table < 0.0, kinds=kinds, **rest
        )


def test_the_own_motion_is_one_kind_of_four_from_the_first_round_to_the_finalists(
    short, monkeypatch
):
    flight, own = short
    monkeypatch.setattr(Subject, "flights", FixedErrors)
    monkeypatch.setattr(Subject, "margins", NoMargins)
    FixedErrors.flown.clear()
    knobs, effort = find_knobs(flight.controller, "decoupled_pd"), Effort().scale(64, 8)
    plan = TuningPlan(
        flight=flight,
        check=own,
        aside=flight,
        own=own,
        knobs=knobs,
        effort=effort,
        seed=0,
        label="decoupled_pd",
    )
    asked = np.zeros((5 * effort.population, len(knobs)))

    flies = Tuner(plan, WorkRunner(), lambda *_: None)
    first = [
        flies.judge(0, asked, 4),
        flies.judge(1, asked, 8),
        *flies.again(asked[:6]),
    ]
    # the geometric mean of the kinds' quantiles; the finalists' error in the front is
    # of drawn motions
    assert [each.error[0] for each in first] == pytest.approx([2e-3, 2e-3, 2e-3, 1e-3])
    last = ("again", 6, SearchSizes().further)
    stages = [
        ("round_000", 50, 4),
        ("pool", 1, 8 * SearchSizes().pool),
        ("round_001", 50, 8),
        last,
    ]
    assert FixedErrors.flown == stages
    assert plan.facts()["motions"] == [*KINDS, "own"]
