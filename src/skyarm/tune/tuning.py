"""Tuning of a law's gains for one vehicle and its loop, from a scenario to a front and a pick.

The search flies :func:`skyarm.tune.excitation.excited` through wrong plants; its best candidates from calm to stiff fly
further plants, and what is left of them then plants that none of it has seen, along the scenario's own motion where
there is one, and have their margins computed in hover. What is picked follows from :data:`skyarm.tune.front.RULE`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.files import versions
from skyarm.files.one_writer import one_writer
from skyarm.records.identity import identity
from skyarm.scenario.scenario_record import Scenario
from skyarm.tune.archive import Archive
from skyarm.tune.blas_threads import threadpool_limits
from skyarm.tune.candidate_flights import CandidateFlights, Flown
from skyarm.tune.front import POINTS, LoopMargins, Point, Required, finalists, front_of, is_allowed, pick
from skyarm.tune.gain_search import Effort, search, with_margins
from skyarm.tune.hover_margins import required
from skyarm.tune.known_gains import known_gains
from skyarm.tune.law_knobs import Knob
from skyarm.tune.margin_tests import MarginTests, NoMargins
from skyarm.tune.objective import WEIGHTS, Scores, scores
from skyarm.tune.plant_spread import Plants, draw_plants

Array = npt.NDArray[np.float64]

Progress = Callable[[int, int, str], object]
"""(flights done, flights in all, what is flown)."""

Margins = MarginTests | NoMargins

LEADERS = 3
"""Of the scatter, for each weight: candidates whose margins are looked at."""

SEMIFINALISTS, FURTHER = 32, 64
"""Candidates of the search that fly once more, and the plants that they do: a few plants flatter."""

UNSEEN = 100
"""Plants by which the front is judged: none of the search's."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What is tuned.

    Attributes:
        flight: that judges candidates. check: that judges the front; the same but for its motion.
        knobs: what may change. effort: how much is flown. seed: of plants, noise and search.
        label: of the law, as it was asked for.
    """

    flight: Scenario
    check: Scenario
    knobs: tuple[Knob, ...]
    effort: Effort
    seed: int
    label: str
    unseen: int = UNSEEN

    def facts(self) -> dict[str, Any]:
        """Plain values on which all scores depend."""
        return {
            **{name: text for name, text in versions("cmaes").items() if name != "python"},
            "law": self.label,
            "flight": identity(self.flight),
            "knobs": [knob.path for knob in self.knobs],
            "seed": self.seed,
            "scatter": self.effort.scatter,
            "rounds": self.effort.rounds,
            "population": self.effort.population,
            "plants": self.effort.plants,
        }


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """What tuning found.

    Attributes:
        plan: what was tuned. before: the beginning, flown as the front was. points: from calm to stiff.
        picked: number of the pick among them. required: margins. plants: by which the search judged.
    """

    plan: Plan
    before: Point
    points: tuple[Point, ...]
    picked: int
    required: Required
    plants: Plants

    @property
    def pick(self) -> Point:
        """The point that the rule picks."""
        return self.points[self.picked]

    @property
    def meets(self) -> bool:
        """Whether the pick meets all constraints."""
        return is_allowed(self.pick, self.required)


def tune(plan: Plan, folder: Path, *, threads: int = 1, progress: Progress | None = None) -> Tuning:
    """Tune, or go on with a search that the folder holds a part of.

    Args:
        plan: what is tuned.
        folder: of the archive; it is there.
        threads: results do not depend on it.
        progress: told of every round.

    Raises:
        ValueError: the folder holds a search of something else, or is written by another process.
    """
    with one_writer(folder), threadpool_limits(1, user_api="blas"):
        archive = Archive(folder, plan.facts())
        plants = draw_plants(plan.flight, plan.effort.plants, seed=plan.seed)
        conductor = _Conductor(plan, plants, archive, threads, progress or (lambda *_: None))
        try:
            known = known_gains(plan.flight, plan.knobs)
            logs, found = search(plan.knobs, plan.effort, conductor.judge, seed=plan.seed, known=known)
            # of the scatter nobody flew all plants; the beginning comes along
            best = len(found[0].error) + np.array(finalists(found[1:], SEMIFINALISTS))
            asked = logs[[0, *best]]
            again = conductor.again(asked)
            last = [0, *(1 + k for k in finalists([again.part(slice(1, None))]))]
            points = conductor.check(asked[last], again.part(last))
        finally:
            conductor.close()
    front = front_of(points[0], points[1:])
    wanted = required(plan.flight)
    return Tuning(
        plan=plan,
        before=points[0],
        points=tuple(front),
        picked=pick(front, wanted),
        required=wanted,
        plants=plants,
    )


class _Conductor:
    """Flies what the search asks for and the archive does not hold."""

    def __init__(self, plan: Plan, plants: Plants, archive: Archive, threads: int, progress: Progress) -> None:
        self._plan, self._plants, self._archive, self._threads = plan, plants, archive, threads
        self._progress, self._done = progress, 0
        self._flights: CandidateFlights | None = None
        self._tests: Margins | None = None
        effort = plan.effort
        rounds = effort.scatter * effort.first_plants
        rounds += (effort.candidates - effort.scatter) * effort.plants
        self._total = rounds + SEMIFINALISTS * FURTHER + POINTS * plan.unseen

    def judge(self, number: int, asked: Array, plants: int) -> Scores:
        """Scores of a round."""
        found = self._archive.get(number, asked)
        if found is None:
            if self._flights is None:
                self._progress(self._done, self._total, "making machine code")
                self._flights = self._flown_by(self._plants)
            flown, groups = scores(self._flights.fly(asked, plants)), self._groups(number, len(asked))
            found = with_margins(flown, asked, groups, self._margins().costs)
            self._archive.put(number, asked, found)
        self._done += len(asked) * plants
        self._progress(self._done, self._total, f"round {number} of {self._plan.effort.rounds}")
        return found

    def _flown_by(self, plants: Plants) -> CandidateFlights:
        plan = self._plan
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

    def again(self, asked: Array) -> Scores:
        """Scores of semifinalists on further plants, each with its margins."""
        number = self._plan.effort.rounds + 1
        found = self._archive.get(number, asked)
        if found is None:
            plants = draw_plants(self._plan.flight, FURTHER, seed=self._plan.seed + 2)
            self._progress(self._done, self._total, "the best once more")
            self._flights = self._flights or self._flown_by(self._plants)
            flown = scores(self._flights.fly(asked, others=plants))
            found = dataclasses.replace(flown, short=self._margins().costs(asked))
            self._archive.put(number, asked, found)
        self._done += len(asked) * FURTHER
        return found

    def check(self, rows: Array, again: Scores) -> list[Point]:
        """The beginning and the finalists on unseen plants, with margins."""
        plan = self._plan
        unseen = draw_plants(plan.check, plan.unseen, seed=plan.seed + 1)
        flights = CandidateFlights(
            plan.check, plan.knobs, unseen, threads=self._threads, seed=plan.seed + 1, saturation=True
        )
        try:
            flown = flights.fly(rows)
        finally:
            flights.close()
        self._progress(self._total, self._total, "margins")
        return _points(rows, again, flown, self._margins().measured(rows))

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
