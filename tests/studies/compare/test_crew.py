"""Flights one by one in processes: the numbers and the order of one process; how
many.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from skyarm.log.metrics.windows import Windows
from skyarm.simulate import Window
from skyarm.studies.compare import cell_flights
from skyarm.studies.compare.cell_flights import (
    SUCCESS_METRIC,
    Cell,
    CellFlights,
    summary,
)
from skyarm.studies.compare.comparison import plants_rows
from skyarm.studies.compare.entrants import ENTRANTS
from skyarm.studies.compare.perturbed_plants import Spread
from skyarm.studies.compare.suite import Case, Condition
from skyarm.studies.flights import WorkRunner
from skyarm.studies.flights.executor import PROCESSES
from support.studies import cell_of

EARLY = Windows(steady=Window(0.1, 0.4), gust=Window(0.1, 0.4), last=0.1)


@dataclasses.dataclass(frozen=True, kw_only=True)
class ShortCase(Case):
    """The beginning of a case."""

    def build(self):
        return dataclasses.replace(Case.build(self), duration=0.4)


SHORT = ShortCase(
    name="case3_wind", title="0.4 s", scenario="case3_wind", windows=EARLY
)
WRONG = Condition(
    name="plants_noisy",
    title="wrong",
    noisy=True,
    episodes=4,
    cases=("case3_wind",),
    spread=Spread(),
)
NOISY = Condition(
    name="noisy", title="noise", noisy=True, episodes=2, cases=("case3_wind",)
)


def flights(condition=NOISY, law="nmpc", **changes):
    return CellFlights(
        entrant=ENTRANTS[law], case=SHORT, condition=condition, seed=5, **changes
    )


def same(one: Cell, other: Cell) -> bool:
    return list(one.status) == list(other.status) and all(
        np.array_equal(one.metrics[name], other.metrics[name], equal_nan=True)
        for name in one.metrics
    )


def test_flights_in_processes_are_those_of_one_process_in_order():
    """Single flights of a law that is called with floats and of MuJoCo's plant, and a
    whole batch.
    """
    todo = [
        each.work()
        for each in (
            flights(),
            flights(law="paper_ct", plant="mujoco"),
            flights(WRONG, "paper_ct"),
        )
    ]
    with WorkRunner(PROCESSES, 2) as crew:
        found = [
            Cell.of_rows(work, rows)
            for work, rows in zip(todo, crew.rows(todo), strict=True)
        ]
    assert crew.flights == 8
    assert [len(cell.status) for cell in found] == [2, 2, 4]
    for work, cell in zip(todo, found, strict=True):
        assert same(cell, cell_of(work)), work.label
    assert (
        len({float(value) for value in found[0].metrics["ee_error_mean_continuous"]})
        == 2
    )


def test_of_wrong_plants_a_law_that_flies_alone_meets_some_and_of_noise_all(
    monkeypatch,
):
    monkeypatch.setattr(cell_flights, "ONE_BY_ONE", 2)

    def count(planned):
        return planned.episodes(planned.scenario())

    assert count(flights()) == NOISY.episodes
    assert count(flights(WRONG)) == 2
    assert count(flights(WRONG, law="paper_ct")) == WRONG.episodes
    assert count(flights(WRONG, law="paper_ct", plant="mujoco")) == 2


def test_a_share_of_fewer_flights_than_others_flew_says_of_how_many():
    def flown(count):
        return summary(
            Cell({SUCCESS_METRIC: np.full(count, 0.001)}, np.full(count, "completed"))
        )

    found = {"case3_wind": {"paper_ct": flown(50), "nmpc": flown(20)}}
    rows = {row[0]: row[1] for row in plants_rows(found, ENTRANTS, ["case3_wind"])}
    assert rows["nmpc"].endswith("] of 20")
    assert rows["paper_ct"].endswith("]")
