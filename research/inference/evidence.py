"""Evidence of a study: fit, ladder, choices, profiles, rivals, predictions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from inference.candidates import Candidates
from inference.search import compass, decode, differential_evolution, encode
from inference.study import IdentificationStudy, Parameter, Prediction, Rival, Settings
from skyarm.paper.unstated_study import PublishedNumber, tally

Array = npt.NDArray[np.float64]

Record = dict[str, Any]

Stage = Callable[[Mapping[str, Record]], Record]
"""What a stage finds, from what the stages before it found."""

GRID = 13
"""Points of a profile; those of a rival that is tried alone are twice as many."""


class Evidence:
    """The stages of a study, each a plain record.

    Args:
        study: what is asked. candidates: that fly it.
    """

    def __init__(self, study: IdentificationStudy, candidates: Candidates) -> None:
        self.study, self._candidates = study, candidates

    def stages(self) -> dict[str, Stage]:
        """Stage -> function of the results of the stages before it; in order."""
        study = self.study
        found: dict[str, Stage] = {
            "stated": lambda _: self._evaluate({}, study.cells),
            "fit": lambda _: self._fit(
                study.plan.fit.free, study.plan.fit.choices, study.cells
            ),
            "ladder": lambda done: self._ladder(_fitted_settings(done)),
        }
        of_rivals = {
            name for rival in study.plan.rivals for name in rival.choices
        } - set(study.plan.fit.choices)
        flipped = [
            choice.name for choice in study.plan.choices if choice.name not in of_rivals
        ]
        found |= {
            f"choice {name}": partial(self._try_options, name) for name in flipped
        }
        found |= {
            f"profile {name}": partial(self._profile, name)
            for name in study.plan.fit.free
        }
        found |= {
            f"rival {rival.name}": partial(self._rival, rival)
            for rival in study.plan.rivals
        }
        return found | {
            f"prediction {each.name}": partial(self._prediction, each)
            for each in study.plan.predictions
        }

    def _evaluate(self, settings: Settings, cells: Sequence[PublishedNumber]) -> Record:
        """Loss and counts of all these cells and of every group that lies among
        them.
        """
        study = self.study
        values = self._candidates.cells(cells, settings)[0]
        place = {cell: i for i, cell in enumerate(cells)}
        found: Record = {"loss": self._loss(cells, settings)} | tally(values, cells)
        found["groups"] = {}
        for group in study.groups:
            among = study.among(group)
            if set(among) <= set(cells):
                own = tally(values[[place[cell] for cell in among]], among)
                found["groups"][group] = {"loss": self._loss(among, settings)} | own
        return found

    def _loss(self, cells: Sequence[PublishedNumber], settings: Settings) -> float:
        return round(float(self._candidates.loss(cells, settings)[0]), 3)

    def _cost(
        self,
        parameters: Sequence[Parameter],
        fixed: Settings,
        cells: Sequence[PublishedNumber],
    ) -> Callable[[Array], Array]:
        def cost(points: Array) -> Array:
            return self._candidates.loss(cells, fixed, decode(parameters, points))

        return cost

    def _parameters(self, names: Sequence[str]) -> list[Parameter]:
        return [self.study.parameter(name) for name in names]

    def _search(
        self,
        parameters: Sequence[Parameter],
        fixed: Settings,
        cells: Sequence[PublishedNumber],
    ) -> dict[str, Any]:
        """The best numbers next to fixed settings, by differential evolution and a
        compass search from its end.
        """
        plan, cost = self.study.plan, self._cost(parameters, fixed, cells)
        begun = differential_evolution(
            cost,
            len(parameters),
            population=plan.search.population,
            generations=plan.search.generations,
            seed=plan.seed,
        )
        point, _ = compass(cost, begun[None, :])
        return dict(fixed) | _plain(decode(parameters, point))

    def _fit(
        self,
        free: Sequence[str],
        family: Mapping[str, str],
        cells: Sequence[PublishedNumber],
    ) -> Record:
        """The best numbers of a family."""
        settings = self._search(self._parameters(free), family, cells)
        return {
            "settings": settings,
            "free": len(free),
            "choices": len(family),
        } | self._evaluate(settings, cells)

    def _ladder(self, fitted: Settings) -> Record:
        """The identified settings set one after the other, not fitted again."""
        settings: dict[str, Any] = {}
        first: Record = {"name": "as stated", "numbers": 0, "choices": 0}
        rungs = [first | self._evaluate({}, self.study.cells)]
        for rung in self.study.plan.ladder:
            settings |= {name: fitted[name] for name in rung.adds}
            numbers = sum(not isinstance(value, str) for value in settings.values())
            row: Record = {
                "name": rung.name,
                "numbers": numbers,
                "choices": len(settings) - numbers,
            }
            rungs.append(row | self._evaluate(settings, self.study.cells))
        return {"rungs": rungs}

    def _try_options(self, name: str, done: Mapping[str, Record]) -> Record:
        """Each option of a choice, the numbers fitted again from where they were."""
        study, parameters, fitted = (
            self.study,
            self._parameters(self.study.plan.fit.free),
            _fitted_settings(done),
        )
        rows: list[Record] = []
        start = encode(parameters, [fitted[each] for each in study.plan.fit.free])
        for option in study.choice(name).options:
            fixed = {
                **{k: v for k, v in fitted.items() if k not in study.plan.fit.free},
                name: option.name,
            }
            point, _ = compass(
                self._cost(parameters, fixed, study.cells), start[None, :]
            )
            settings = fixed | _plain(decode(parameters, point))
            taken = fitted.get(name, study.choice(name).options[0].name) == option.name
            numbers = {each: settings[each] for each in study.plan.fit.free}
            row: Record = {
                "option": option.name,
                "words": option.words,
                "taken": taken,
                "numbers": numbers,
            }
            rows.append(row | self._evaluate(settings, study.cells))
        return {"words": study.choice(name).words, "options": rows}

    def _profile(self, name: str, done: Mapping[str, Record]) -> Record:
        """Loss over one number, the others held, and fitted again."""
        study, parameters, fitted = (
            self.study,
            self._parameters(self.study.plan.fit.free),
            _fitted_settings(done),
        )
        place = study.plan.fit.free.index(name)
        best = encode(parameters, [fitted[each] for each in study.plan.fit.free])
        points = np.repeat(best[None, :], GRID, axis=0)
        points[:, place] = np.linspace(0.0, 1.0, GRID)
        points = np.vstack([points, best])
        points = points[np.argsort(points[:, place], kind="stable")]
        cost = self._cost(parameters, study.plan.fit.choices, study.cells)
        held = np.zeros_like(points, dtype=bool)
        held[:, place] = True
        _, refitted = compass(cost, points, held)
        values = decode(parameters, points)[name]
        return {
            "value": values.tolist(),
            "held": [round(float(x), 3) for x in cost(points)],
            "refitted": [round(float(x), 3) for x in refitted],
            "within_1": _range(values, refitted),
        }

    def _rival(self, rival: Rival, done: Mapping[str, Record]) -> Record:
        """An alternative explanation: alone, on each group of cells separately, and on
        top of the fit.
        """
        study, fitted = self.study, _fitted_settings(done)
        parameters = self._parameters(rival.adds)
        alone = {}
        for group in study.plan.rival_cells:
            cells = study.among(group)
            settings = self._line(parameters, dict(rival.choices), cells)
            numbers = {name: settings[name] for name in rival.adds}
            counted = tally(self._candidates.cells(cells, settings)[0], cells)
            before = self._loss(cells, {})
            alone[group] = {
                "stated": before,
                "loss": self._loss(cells, settings),
                "numbers": numbers,
            } | counted
        kept = {
            name: value for name, value in fitted.items() if name not in rival.without
        } | dict(rival.choices)
        own = [each for each in parameters if each.name not in kept]
        on_top = self._line(own, kept, study.cells)
        found: Record = {"words": rival.words, "alone": alone}
        if on_top != dict(fitted):
            numbers = {name: on_top[name] for name in rival.adds}
            found["on_top"] = {"numbers": numbers} | self._evaluate(on_top, study.cells)
        return found

    def _line(
        self,
        parameters: Sequence[Parameter],
        fixed: Settings,
        cells: Sequence[PublishedNumber],
    ) -> dict[str, Any]:
        """The best of a rival's numbers: of one on a grid and a finer one around its
        best, of several by a fit.
        """
        if not parameters:
            return dict(fixed)
        if len(parameters) > 1:
            return self._search(parameters, fixed, cells)
        cost = self._cost(parameters, fixed, cells)
        grid = np.linspace(0.0, 1.0, 2 * GRID + 1)
        best = grid[int(cost(grid[:, None]).argmin())]
        finer = np.clip(
            best + np.linspace(-1.0, 1.0, 2 * GRID + 1) / (2 * GRID), 0.0, 1.0
        )
        point = finer[[int(cost(finer[:, None]).argmin())]]
        return dict(fixed) | _plain(decode(parameters, point[:, None]))

    def _prediction(self, asked: Prediction, done: Mapping[str, Record]) -> Record:
        """Numbers fitted to some cells only, and their prediction of cells that the
        search has not used.
        """
        del done
        study = self.study
        found = self._fit(asked.free, asked.choices, study.among(asked.seen))
        judged = {
            group: self._evaluate(found["settings"], study.among(group))
            for group in asked.unseen
        }
        stated = {
            group: self._evaluate({}, study.among(group))
            for group in (asked.seen, *asked.unseen)
        }
        return found | {
            "seen": asked.seen,
            "predicted": _without_groups(judged),
            "stated": _without_groups(stated),
        }


def _fitted_settings(done: Mapping[str, Record]) -> Settings:
    settings: Settings = done["fit"]["settings"]
    return settings


def _without_groups(judged: Mapping[str, Record]) -> dict[str, Record]:
    return {
        name: {k: v for k, v in each.items() if k != "groups"}
        for name, each in judged.items()
    }


def _plain(values: Mapping[str, Array]) -> dict[str, float]:
    return {name: float(column[0]) for name, column in values.items()}


def _range(values: Array, losses: Array) -> list[float]:
    """Smallest and largest value whose loss is within 1 of the least."""
    near = values[losses <= losses.min() + 1.0]
    return [float(near.min()), float(near.max())]
