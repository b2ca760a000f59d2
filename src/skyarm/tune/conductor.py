"""Flies the candidates of a tuning: the rounds of the search, its best once more, the front, at last the starts."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from skyarm.tune.archive import Archive
from skyarm.tune.candidate_flights import CandidateFlights, Flown
from skyarm.tune.front import POINTS, LoopMargins, Point, is_allowed
from skyarm.tune.gain_search import with_margins
from skyarm.tune.hover_margins import required
from skyarm.tune.margin_tests import MarginTests, NoMargins
from skyarm.tune.objective import WEIGHTS, Scores, scores
from skyarm.tune.own_motion import FlightsWithOwn, of_drawn, with_own
from skyarm.tune.plant_spread import Plants, draw_plants, with_lost
from skyarm.tune.tuning_records import ASIDE, Aside, Plan

Array = npt.NDArray[np.float64]

Progress = Callable[[int, int, str], object]
"""(flights done, flights in all, what is flown)."""

Margins = MarginTests | NoMargins

LEADERS = 3
"""Of the scatter, for each weight: candidates whose margins are looked at."""

POOL = 8
"""Times the plants of the search: what the leaders of the scatter fly."""

SEMIFINALISTS, FURTHER = 32, 64
"""Candidates of the search that fly once more, and the plants that they do: a few plants flatter."""


class Conductor:
    """Flies what the search asks for and the archive does not hold.

    Args:
        plan: what is tuned. plants: of the search. archive: of its scores.
        threads: results do not depend on it. progress: told of every round.
    """

    def __init__(self, plan: Plan, plants: Plants, archive: Archive, threads: int, progress: Progress) -> None:
        self._plan, self._archive, self._threads = plan, archive, threads
        self._plants = with_own(plants) if plan.own else plants
        self._progress, self._done = progress, 0
        self._flights: CandidateFlights | FlightsWithOwn | None = None
        self._first: tuple[Array, Scores] | None = None
        self._searched: Plants | None = None
        self._tests: Margins | None = None
        effort = plan.effort
        rounds = effort.scatter * effort.first_plants
        rounds += (effort.candidates - effort.scatter) * effort.plants + len(WEIGHTS) * POOL * effort.plants
        self._total = rounds + SEMIFINALISTS * FURTHER + POINTS * plan.unseen

    def judge(self, number: int, asked: Array, plants: int) -> Scores:
        """Scores of a round."""
        found = self._archive.get(number, asked)
        if found is None:
            if self._flights is None:
                self._progress(self._done, self._total, "making machine code")
                self._flights = self._flown_by(self._plants)
            flown = scores(self._flights.fly(asked, plants, others=self._telling() if number else None))
            groups = self._groups(number, len(asked))
            found = with_margins(flown, asked, groups, self._margins().costs)
            self._archive.put(number, asked, found)
        if number == 0:
            self._first = (asked, found)
        self._done += len(asked) * plants
        self._progress(self._done, self._total, f"round {number} of {self._plan.effort.rounds}")
        return found

    def _telling(self) -> Plants:
        """The plants that all rounds but the first fly: its leaders fly more of them, and what they lose is taken in.

        A search that loses one plant in fifty does not see it on two dozen.
        """
        if self._searched is None:
            assert self._flights is not None
            assert self._first is not None
            asked, found = self._first
            leaders = list(dict.fromkeys(int(found.cost(weight).argmin()) for weight in WEIGHTS))
            pool = self._drawn(POOL * self._plants.count, self._plan.seed)
            lost = self._flights.fly(asked[leaders], others=pool).lost
            self._searched = with_lost(pool, self._plants.count, lost)
        return self._searched

    def _drawn(self, count: int, seed: int) -> Plants:
        plants = draw_plants(self._plan.flight, count, seed=seed, mixed=True)
        return with_own(plants) if self._plan.own else plants

    def _flown_by(self, plants: Plants) -> CandidateFlights | FlightsWithOwn:
        plan = self._plan
        if plan.own:
            return FlightsWithOwn(plan.flight, plan.own, plan.knobs, plants, threads=self._threads, seed=plan.seed)
        return CandidateFlights(plan.flight, plan.knobs, plants, threads=self._threads, seed=plan.seed, gust=True)

    def _margins(self) -> Margins:
        """What looks at margins; where a loop cannot be linearised nothing is asked of them."""
        if self._tests is None:
            plan = self._plan
            try:
                self._tests = MarginTests(plan.flight, plan.knobs, required(plan.flight), self._threads)
            except ValueError as error:
                self._tests = NoMargins(str(error))
        return self._tests

    def _groups(self, number: int, count: int) -> list[tuple[float, slice, int]]:
        """Whose margins count: the best of the scatter for each weight, later the better half of each strategy's."""
        if number == 0:
            return [(weight, slice(0, count), LEADERS) for weight in WEIGHTS]
        each = self._plan.effort.population
        return [(weight, slice(i * each, (i + 1) * each), (each + 1) // 2) for i, weight in enumerate(WEIGHTS)]

    def again(self, asked: Array) -> tuple[Scores, Scores]:
        """Scores of semifinalists on further plants, each with its margins: of all motions, and of those drawn."""
        numbers = [self._plan.effort.rounds + k for k in (1, 2)]
        kept = [self._archive.get(number, asked) for number in numbers]
        found = [each for each in kept if each is not None]
        if len(found) < len(numbers):
            plants = self._drawn(FURTHER, self._plan.seed + 2)
            self._progress(self._done, self._total, "the best once more")
            self._flights = self._flights or self._flown_by(self._plants)
            flown = self._flights.fly(asked, others=plants)
            short = self._margins().costs(asked)
            found = [dataclasses.replace(scores(each), short=short) for each in (flown, of_drawn(flown))]
            for number, each in zip(numbers, found, strict=True):
                self._archive.put(number, asked, each)
        self._done += len(asked) * FURTHER
        return found[0], found[1]

    def check(self, rows: Array, again: Scores) -> list[Point]:
        """The beginning and the finalists on unseen plants, with margins; ``again`` is of drawn motions."""
        plan = self._plan
        mixed = plan.check.trajectory == plan.flight.trajectory
        unseen = draw_plants(plan.check, plan.unseen, seed=plan.seed + 1, mixed=mixed)
        flights = CandidateFlights(
            plan.check, plan.knobs, unseen, threads=self._threads, seed=plan.seed + 1, saturation=True
        )
        try:
            flown = flights.fly(rows)
        finally:
            flights.close()
        self._progress(self._total, self._total, "margins")
        return _points(rows, again, flown, self._margins().measured(rows))

    def fly_aside(self, points: dict[str, Point]) -> dict[str, Aside]:
        """The pick and every start, by name, on plants and a path by which nothing was chosen."""
        plan = self._plan
        wanted = required(plan.flight)
        self._progress(self._total, self._total, "plants and a path kept aside")
        plants = draw_plants(plan.aside, ASIDE, seed=plan.seed + 3)
        flights = CandidateFlights(plan.aside, plan.knobs, plants, threads=self._threads, seed=plan.seed + 3)
        try:
            flown = scores(flights.fly(np.array([point.logs for point in points.values()])))
        finally:
            flights.close()
        return {
            name: Aside(
                tip=float(flown.tip[i]),
                jitter=float(flown.jitter[i]),
                lost=float(flown.lost[i]),
                meets=is_allowed(point, wanted),
            )
            for i, (name, point) in enumerate(points.items())
        }

    def close(self) -> None:
        """End the threads."""
        for each in (self._flights, self._tests):
            if each is not None:
                each.close()


def _points(rows: Array, again: Scores, flown: Flown, margins: list[LoopMargins]) -> list[Point]:
    scored = scores(flown)
    return [
        Point(
            logs=tuple(rows[i].tolist()),
            error=math.sqrt(float(scored.error[i]) * float(again.error[i])),
            tip=float(scored.tip[i]),
            jitter=float(scored.jitter[i]),
            effort=float(scored.effort[i]),
            lost=float(scored.lost[i]),
            saturated=float(np.median(flown.saturated[i])),
            margins=margins[i],
        )
        for i in range(len(rows))
    ]
