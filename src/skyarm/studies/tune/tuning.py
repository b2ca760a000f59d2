"""Gain tuning for one vehicle and its loop, or for a team: from a scenario to a Pareto
front and the selected gains.

The search flies :func:`skyarm.studies.tune.excitation.tuning_flight` through perturbed
plants, each with its own motion, every fourth with the scenario's where there is one;
its best candidates from calm to stiff fly further plants, and the rest of them others
again, along the scenario's own motion, and have their margins computed in hover. The
given gains and those of the catalogue for this law go all that way with them. The pick
follows from :data:`skyarm.studies.tune.front.RULE`; at last it and all starts fly
plants and a path by which nothing was chosen. What a team flies instead is in
:mod:`skyarm.studies.tune.team_subject`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import cached_property

import numpy as np

from skyarm.control.controller import Controller
from skyarm.records.arrays import Array
from skyarm.records.files import PathLike, versions
from skyarm.records.immutable import immutable
from skyarm.scenario.scenario_file import as_scenario, is_scenario
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.flights import Store, WorkRunner
from skyarm.studies.flights.executor import LOCAL, Progress, require_place
from skyarm.studies.tune.candidate_flights import (
    WEIGHTS,
    CandidateFlights,
    CandidateResults,
    Scores,
    of_drawn,
    scores,
    with_own,
)
from skyarm.studies.tune.excitation import Plants, of_vehicle, with_lost
from skyarm.studies.tune.front import Point, Required, finalists, front_of, is_allowed
from skyarm.studies.tune.gain_search import Effort, search, with_margins
from skyarm.studies.tune.hover_margins import HoverMargins, one_blas_thread
from skyarm.studies.tune.law_knobs import Knobs, numbers_at
from skyarm.studies.tune.subject import VEHICLE, SearchSizes, Subject
from skyarm.studies.tune.team_subject import TeamSubject
from skyarm.vehicle import Vehicle
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.view.pages import Facts

LEADERS = 3
"""Number of leading candidates of the scatter, for each weight, whose margins are
evaluated: the first begins its search, the others may be points of the front. Three
are chosen: margins cost time."""

PICKED = "pick"
"""Name of the pick among the checked gains."""


@immutable(slots=False)
class TuningPlan:
    """Settings of a gain tuning: flights, tunable gains, size of the search, seed.

    Attributes:
        flight: scores candidates. check: scores the front, with another motion. aside:
            validates the result, along a path not used in tuning. own: scores
            candidates along the scenario's own motion, where it has one.
        knobs: tunable gains. effort: size of the search. seed: seed of plants, noise
            and search.
        label: name of the law as requested. subject: how the law is flown and scored.
            stages: sizes after its rounds.
    """

    flight: Scenario
    check: Scenario
    aside: Scenario
    knobs: Knobs
    effort: Effort
    seed: int
    label: str
    own: Scenario | None = None
    stages: SearchSizes = SearchSizes()
    subject: Subject = VEHICLE

    def facts(self) -> Facts:
        """Settings that determine a tuning's result besides scenario and controller, as
        plain data.
        """
        return {
            **{
                name: text
                for name, text in versions("cmaes").items()
                if name != "python"
            },
            "motions": [*self.subject.kinds, *(["own"] if self.own else [])],
            "seed": self.seed,
            "scatter": self.effort.scatter,
            "rounds": self.effort.rounds,
            "population": self.effort.population,
            "plants": self.effort.plants,
        }


@immutable
class Validation:
    """Scores of gains on validation plants and a reference path that are not used in
    tuning.

    Attributes:
        tip: m, 90 % quantile. pull: N, of a team, likewise. jitter: rad/s, median.
            lost: share.
        meets: whether the gains met all constraints where the front was judged.
    """

    tip: float
    jitter: float
    lost: float
    meets: bool
    pull: float = 0.0


@immutable(slots=False)
class Tuning:
    """Result of a gain tuning: Pareto front of gains, selected gains, validation
    scores.

    Attributes:
        plan: plan of the tuning, its knobs about the centre of the search.
        before: the given gains, flown as the front was. points: points of the front
            from calm to stiff.
        picked: index of the selected point. required: required margins. plants: plants
            of the search.
        aside: name -> validation scores of the selected point and of every initial set
            of gains.
    """

    plan: TuningPlan
    before: Point
    points: tuple[Point, ...]
    picked: int
    required: Required
    plants: Plants
    aside: dict[str, Validation]

    @property
    def pick(self) -> Point:
        """Selected set of gains of the Pareto front."""
        return self.points[self.picked]

    def under(self, scenario: Scenario, point: Point) -> Scenario:
        """Scenario with the gains of a point in place of its own."""
        return self.plan.subject.under(
            scenario, numbers_at(self.plan.knobs, point.logs)
        )

    @property
    def controller(self) -> Controller:
        """Controller with the selected gains; of a team there is none: :meth:`under`
        has its scenario.
        """
        return self.under(self.plan.flight, self.pick).agent.controller

    @property
    def meets(self) -> bool:
        """True if the selected gains meet all constraints."""
        return is_allowed(self.pick, self.required)


class Tuner:
    """Evaluator of gain candidates in all stages of a tuning, from search to
    validation.

    Args:
        plan: plan of the tuning. runner: flies candidates; results do not depend on it.
        progress: called after every round.

    Attributes:
        plants: plants of the search.
    """

    def __init__(
        self, plan: TuningPlan, runner: WorkRunner, progress: Progress
    ) -> None:
        self._plan, self._runner = plan, runner
        self.plants = self._drawn(plan.effort.plants, plan.seed)
        self._progress = progress
        self._done = 0
        self._first: tuple[Array, Scores] | None = None
        self._stages = sizes = plan.stages
        effort = plan.effort
        # after the scatter each leader of a weight flies the pool once
        later = effort.candidates - effort.scatter + len(WEIGHTS) * sizes.pool
        self._total = (
            effort.scatter * effort.first_plants
            + later * effort.plants
            + sizes.semifinalists * sizes.further
            + sizes.points * sizes.unseen
        )

    @cached_property
    def _flights(self) -> CandidateFlights:
        plan = self._plan
        self._progress(self._done, self._total, "making machine code")
        return plan.subject.flights(
            plan.flight,
            plan.knobs,
            self.plants,
            self._runner,
            own=plan.own,
            seed=plan.seed,
            gust=True,
        )

    @cached_property
    def _margins(self) -> HoverMargins:
        return self._plan.subject.margins(
            self._plan.flight, self._plan.knobs, self._runner.workers
        )

    def judge(self, number: int, asked: Array, plants: int) -> Scores:
        """Simulate and score the gain candidates of one search round."""
        others = self._search_plants if number else None
        flown = scores(self._flights.fly(f"round_{number:03d}", asked, plants, others))
        judged = with_margins(
            flown,
            asked,
            self._candidates_for_margins(number, len(asked)),
            self._margins.costs,
        )
        if number == 0:
            self._first = (asked, judged)
        self._done += len(asked) * plants
        self._progress(
            self._done, self._total, f"round {number} of {self._plan.effort.rounds}"
        )
        return judged

    @cached_property
    def _search_plants(self) -> Plants:
        """Plants of all search rounds after the first, some of which made the first
        round's best candidates crash.

        A search that loses one plant in fifty does not see it on two dozen.
        """
        assert self._first is not None
        asked, first_scores = self._first
        leaders = list(
            dict.fromkeys(int(first_scores.cost(weight).argmin()) for weight in WEIGHTS)
        )
        pool = self._drawn(self._stages.pool * self.plants.count, self._plan.seed)
        return with_lost(
            pool,
            self.plants.count,
            self._flights.fly("pool", asked[leaders], others=pool).lost,
        )

    def _drawn(self, count: int, seed: int) -> Plants:
        plants = self._plan.subject.draw(
            self._plan.flight, count, seed=seed, mixed=True
        )
        return with_own(plants) if self._plan.own else plants

    def _candidates_for_margins(
        self, number: int, count: int
    ) -> list[tuple[float, slice, int]]:
        """Groups of gain candidates whose stability margins are computed in a search
        round.
        """
        if number == 0:
            return [(weight, slice(0, count), LEADERS) for weight in WEIGHTS]
        each = self._plan.effort.population
        # the better half, to which alone CMA-ES moves its mean
        return [
            (weight, slice(i * each, (i + 1) * each), (each + 1) // 2)
            for i, weight in enumerate(WEIGHTS)
        ]

    def again(self, asked: Array) -> tuple[Scores, Scores]:
        """Scores of the best gain candidates on further plants: over all motions, and
        over random motions only.
        """
        self._progress(self._done, self._total, "the best once more")
        flown = self._flights.fly(
            "again",
            asked,
            others=self._drawn(self._stages.further, self._plan.seed + 2),
        )
        short = self._margins.costs(asked)
        every, drawn = (
            replace(scores(each), short=short) for each in (flown, of_drawn(flown))
        )
        self._done += len(asked) * self._stages.further
        return every, drawn

    def check(self, rows: Array, again: Scores) -> list[Point]:
        """Evaluate initial gains and the best candidates on unseen plants, with their
        stability margins.
        """
        plan = self._plan
        flown = self._flown_once(
            "unseen",
            plan.check,
            plan.stages.unseen,
            1,
            rows,
            # along the scenario's own motion no other is drawn
            mixed=plan.own is None,
            saturation=True,
        )
        self._progress(self._total, self._total, "margins")
        scored = scores(flown)
        margins = self._margins.measure(rows)
        return [
            Point(
                logs=tuple(row.tolist()),
                # the geometric mean of both flights, in which their ratios count alike
                error=math.sqrt(float(scored.error[i]) * float(again.error[i])),
                saturated=float(np.median(flown.saturated[i])),
                margins=margins[i],
                **scored.numbers(i, "tip", "pull", "jitter", "effort", "lost"),
            )
            for i, row in enumerate(rows)
        ]

    def fly_aside(self, points: dict[str, Point]) -> dict[str, Validation]:
        """Validate the selected and the initial gains on plants and a reference path
        not used in tuning.
        """
        required = self._plan.subject.required(self._plan.flight)
        self._progress(self._total, self._total, "plants and a path kept aside")
        rows = np.array([each.logs for each in points.values()])
        # 3: a seed of its own, apart from those of the search
        flown = scores(
            self._flown_once("aside", self._plan.aside, self._stages.aside, 3, rows)
        )
        return {
            name: Validation(
                meets=is_allowed(point, required),
                **flown.numbers(i, "tip", "pull", "jitter", "lost"),
            )
            for i, (name, point) in enumerate(points.items())
        }

    def _flown_once(
        self,
        stage: str,
        scenario: Scenario,
        count: int,
        further: int,
        rows: Array,
        *,
        mixed: bool = False,
        saturation: bool = False,
    ) -> CandidateResults:
        """Simulate some gain candidates on another scenario, with plants and noise not
        used in the search.
        """
        # apart from the search's, and from that of its best once more, which is 2
        # further
        seed = self._plan.seed + further
        subject = self._plan.subject
        plants = subject.draw(scenario, count, seed=seed, mixed=mixed)
        flights = subject.flights(
            scenario,
            self._plan.knobs,
            plants,
            self._runner,
            seed=seed,
            saturation=saturation,
        )
        return flights.fly(stage, rows)


TEAM = TeamSubject()


def subject_of(scenario: Scenario) -> Subject:
    """Subject of a search in a scenario: its team where it has one, else its vehicle.

    Raises:
        ValueError: one line: several vehicles without a team, or one of a team alone.
    """
    if scenario.team is not None and not scenario.others:
        return TEAM
    scenario.alone("a search for gains without [team]")
    return VEHICLE


BOUNDS = {
    # fewer are not flown
    "candidates": (Effort().scale(0, 0).candidates, 100_000),
    "plants": (4, 1000),
    "seed": (0, 2**31 - 1),
}
"""Option -> its smallest and largest value."""


def require_size(
    candidates: int | None, plants: int | None, seed: int, prefix: str = ""
) -> None:
    """Raise an error if the size of a search is out of bounds; ``prefix`` precedes the
    parameter's name.
    """
    for (name, (low, high)), value in zip(
        BOUNDS.items(), (candidates, plants, seed), strict=True
    ):
        if value is not None and not low <= value <= high:
            raise ValueError(f"{prefix}{name} = {value}: must be from {low} to {high}")


def effort_of(subject: Subject, candidates: int | None, plants: int | None) -> Effort:
    """Size of a search; None for the usual number of its subject."""
    usual = subject.stages
    return Effort().scale(candidates or usual.candidates, plants or usual.plants)


def tune(
    what: Vehicle | Scenario | PathLike,
    controller: str | None = None,
    *,
    candidates: int | None = None,
    plants: int | None = None,
    knobs: Sequence[str] | None = None,
    seed: int = 0,
    workers: int = 1,
    on: str = LOCAL,
    folder: PathLike | None = None,
    progress: Progress | None = None,
) -> Tuning:
    """Tune a law's gains, as ``skyarm tune`` does; ``controller`` of the result has the
    selected ones.

    Of a scenario with [team] the options of the team's law; ``under(scenario, pick)``
    of the result has them.

    Args:
        what: a scenario or a vehicle, or the name or path of one.
        controller: name of the vehicles' law, in place of the scenario's.
        candidates: sets of gains that are tried; 1640 if left out, of a team 234.
        plants: perturbed plants that each of them flies; 24 if left out, of a team 8.
        knobs: paths of the constants of the law that may change; all gains if left out.
        seed: seed of plants, noise and search.
        workers: threads or processes that fly; results do not depend on it.
        on: "local", "processes", "ray" or "ray:HOST:PORT".
        folder: keeps the rows of all flights where pyarrow is installed, so that an
            interrupted search goes on.
        progress: called with (done, all, stage).

    Raises:
        ValueError: one line: what cannot be read or tuned, a number out of bounds, or a
            folder that another search writes into.
        OSError: the folder cannot be written.
    """
    require_place(on)
    require_size(candidates, plants, seed)
    if isinstance(what, Vehicle) or not (
        isinstance(what, Scenario) or is_scenario(str(what))
    ):
        moves = False
        scenario = of_vehicle(
            what if isinstance(what, Vehicle) else load_vehicle(what), controller
        )
    else:
        moves = True
        scenario = as_scenario(what, controller)
    subject = subject_of(scenario)
    label = subject.label(scenario, controller)
    plan = plan_of(
        scenario, moves, label, knobs, effort_of(subject, candidates, plants), seed
    )
    return tune_plan(plan, workers=workers, on=on, folder=folder, progress=progress)


def plan_of(
    scenario: Scenario,
    moves: bool,
    label: str,
    knobs: Sequence[str] | None,
    effort: Effort,
    seed: int,
) -> TuningPlan:
    """Plan of a tuning for a scenario.

    Args:
        scenario: scenario whose law is tuned.
        moves: whether its own reference is flown, too.
        label: name of the law.
        knobs: paths of the constants that may change; all gains for None.
        effort: size of the search.
        seed: seed of plants, noise and search.
    """
    for each in scenario.agents.values():
        each.controller.require_compiled("skyarm tune")
    subject = subject_of(scenario)
    return TuningPlan(
        **subject.scenes(scenario, moves),
        knobs=subject.knobs(scenario, knobs),
        effort=effort,
        seed=seed,
        label=label,
        stages=subject.stages,
        subject=subject,
    )


def tune_plan(
    plan: TuningPlan,
    *,
    workers: int = 1,
    on: str = LOCAL,
    folder: PathLike | None = None,
    progress: Progress | None = None,
) -> Tuning:
    """Tune the gains of a controller; an interrupted search resumes from the results in
    its folder.

    Args:
        plan: plan of the tuning.
        workers: threads, or processes of ``on``; results do not depend on it.
        on: "local", "processes", "ray" or "ray:HOST:PORT".
        folder: keeps the rows of all flights, if pyarrow is there; None keeps none.
        progress: called after every round.

    Raises:
        TakenError: another search writes into the folder.
        OSError: the folder cannot be written, or a process ended unexpectedly.
    """
    store = None if folder is None else Store.if_kept(folder)
    with (
        store.alone() if store else nullcontext(),
        WorkRunner(on, workers, store) as runner,
        one_blas_thread(),
    ):
        return _tune(plan, runner, progress or (lambda *_: None))


def _tune(plan: TuningPlan, runner: WorkRunner, progress: Progress) -> Tuning:
    """Tune the gains of a controller, with a given runner for the simulations."""
    subject, sizes = plan.subject, plan.stages
    start = subject.centred(plan.flight, plan.knobs, plan.label)
    centre = numbers_at(start.knobs, (0.0,) * len(start.knobs))
    plan = replace(
        plan,
        flight=start.flight,
        check=subject.under(plan.check, centre),
        aside=subject.under(plan.aside, centre),
        own=subject.under(plan.own, centre) if plan.own else None,
        knobs=start.knobs,
    )
    tuner = Tuner(plan, runner, progress)
    logs, rounds = search(
        plan.knobs, plan.effort, tuner.judge, seed=plan.seed, starts=start.rows
    )
    # of the scatter nobody flew all plants; the starts come along
    best = len(rounds[0].error) + np.array(finalists(rounds[1:], sizes.semifinalists))
    count = len(start.starts)
    asked = logs[[*range(count), *best]]
    again, drawn = tuner.again(asked)
    last = [
        *range(count),
        *(count + k for k in finalists([again.part(slice(count, None))], sizes.points)),
    ]
    points = tuner.check(asked[last], drawn.part(last))
    required = subject.required(plan.flight)
    front, picked = front_of(points[:count], points[count:], required)
    # the starts are the first points
    starting = dict(zip(start.starts, points, strict=False))
    aside = tuner.fly_aside({**starting, PICKED: front[picked]})
    return Tuning(
        plan=plan,
        before=points[0],
        points=tuple(front),
        picked=picked,
        required=required,
        plants=tuner.plants,
        aside=aside,
    )
