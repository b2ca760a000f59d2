"""Candidates flown: all flights of a study in batches, one lane each; the loss of their
cells.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from inference.study import Constant, IdentificationStudy, Settings, Target
from skyarm.paper.unstated_study import PublishedNumber, losses
from skyarm.plant.joint_rate import joint_rate
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.batch import Batch

Array = npt.NDArray[np.float64]

AT_ONCE = 8192
"""Lanes of one call."""


class Flown:
    """A flight whose numbers at some paths differ from candidate to candidate.

    Args:
        scenario: with its other numbers. paths: of these. metrics: wanted.
        stiffest: scenario that bounds the integration step.
        effort: of the compiler; 0 is worth it for few candidates.

    Attributes:
        base: path -> number of the scenario.
    """

    def __init__(
        self,
        scenario: Scenario,
        paths: Sequence[str],
        metrics: Sequence[str],
        stiffest: Scenario,
        effort: int,
    ) -> None:
        self._metrics, self._known = tuple(metrics), dict[bytes, Array]()
        self.base = {path: number_at(scenario, path) for path in paths}
        self._batch = Batch(
            scenario,
            paths,
            metrics=metrics,
            single=True,
            stiffest=stiffest,
            effort=effort,
        )

    def values(self, columns: Array, threads: int) -> Array:
        """(lanes, metrics) of (lanes, paths); a candidate that ended early has none."""
        rows = np.ascontiguousarray(columns, dtype=float)
        keys = [row.tobytes() for row in rows]
        fresh = {key: i for i, key in enumerate(keys) if key not in self._known}
        places = list(fresh.values())
        for first in range(0, len(places), AT_ONCE):
            some = rows[places[first : first + AT_ONCE]]
            lanes = dict(zip(self._batch.paths, some.T, strict=True))
            # every lane draws the same noise
            flown = self._batch.fly(
                lanes, episodes=np.zeros(len(some), dtype=int), threads=threads
            )
            found = np.stack(
                [flown.metrics[name] for name in self._metrics], axis=1
            ).astype(float)
            found[~flown.completed] = np.nan
            self._known |= {
                row.tobytes(): values for row, values in zip(some, found, strict=True)
            }
        return np.array([self._known[key] for key in keys]).reshape(
            len(keys), len(self._metrics)
        )


class Candidates:
    """Settings flown in batches.

    Args:
        study: whose flights and cells. threads: results do not depend on it.
    """

    def __init__(self, study: IdentificationStudy, threads: int = 1) -> None:
        self.study, self._threads = study, threads
        self._flights: dict[tuple[Any, ...], Flown] = {}
        self._bounds: dict[tuple[Any, ...], tuple[Scenario, Scenario, float]] = {}
        self._family = tuple(
            dict.fromkeys(
                [
                    *study.plan.fit.free,
                    *(name for each in study.plan.predictions for name in each.free),
                ]
            )
        )
        self._rivals = tuple(
            dict.fromkeys(name for rival in study.plan.rivals for name in rival.adds)
        )

    def cells(
        self,
        cells: Sequence[PublishedNumber],
        fixed: Settings,
        varied: Mapping[str, Array] | None = None,
    ) -> Array:
        """(lanes, cells): what each candidate makes of each cell.

        Args:
            cells: of the study.
            fixed: settings that all candidates share.
            varied: parameter -> (lanes,); one lane if left out.
        """
        columns = dict(varied or {})
        count = len(next(iter(columns.values()))) if columns else 1
        found = np.full((count, len(cells)), np.nan)
        for flight in dict.fromkeys(cell.flight for cell in cells):
            places = [i for i, cell in enumerate(cells) if cell.flight == flight]
            values = self._flight(flight, fixed, columns, count)
            metrics = self._metrics(flight)
            for i in places:
                found[:, i] = values[:, metrics.index(cells[i].metric)]
        return found

    def loss(
        self,
        cells: Sequence[PublishedNumber],
        fixed: Settings,
        varied: Mapping[str, Array] | None = None,
    ) -> Array:
        """(lanes,): summed loss of each candidate."""
        study = self.study
        summed: Array = losses(
            self.cells(cells, fixed, varied),
            cells,
            study.plan.loss.width,
            study.plan.loss.knee,
        ).sum(axis=1)
        return summed

    def _metrics(self, flight: str) -> tuple[str, ...]:
        return tuple(
            dict.fromkeys(
                cell.metric for cell in self.study.cells if cell.flight == flight
            )
        )

    def _flight(
        self, flight: str, fixed: Settings, columns: Mapping[str, Array], count: int
    ) -> Array:
        """(lanes, metrics) of a flight, whose machine code serves every setting of the
        study's own family.
        """
        numbers = self.study.numbers(flight, {**fixed, **columns})
        table = self.study.scenario_tables(flight, fixed)
        names = self._family
        # a rival's may be faster, and has code of its own
        if not set(numbers) <= self._paths(flight, names):
            names = tuple(
                dict.fromkeys(
                    [
                        *names,
                        *(name for name in (*fixed, *columns) if name in self._rivals),
                    ]
                )
            )
        paths = tuple(sorted({*self._paths(flight, names), *numbers}))
        effort = 2 if names == self._family else 0
        planned, stiffest, fastest = self._stiffest_scenario(
            flight, table, fixed, [*names, *fixed, *columns]
        )
        # all that the machine code is made of: who asks first, as after a stop, makes
        # no other one
        key = (flight, json.dumps(table, sort_keys=True), fastest, effort, *paths)
        if key not in self._flights:
            self._flights[key] = Flown(
                planned, paths, self._metrics(flight), stiffest, effort
            )
        flown = self._flights[key]
        rows = np.empty((count, len(paths)))
        for i, path in enumerate(paths):
            rows[:, i] = numbers.get(path, flown.base[path])
        return flown.values(rows, self._threads)

    def _stiffest_scenario(
        self, flight: str, table: Any, fixed: Settings, names: Sequence[str]
    ) -> tuple[Scenario, Scenario, float]:
        """The scenario of a flight, the stiffest that some parameters can make of it,
        and how fast that is, 1/s.

        Whatever numbers the settings have, they are within the parameters' ranges;
        their options count.
        """
        options = {
            name: value for name, value in fixed.items() if isinstance(value, str)
        }
        own = tuple(dict.fromkeys(name for name in names if name not in options))
        key = (flight, *sorted(options.items()), *own)
        if key not in self._bounds:
            planned = scenario_from(table, self.study.flight(flight).folder)
            ends = [*self._ends(flight, {}, own), *self._ends(flight, options, own)]
            self._bounds[key] = (planned, *_stiffest(planned, ends))
        return self._bounds[key]

    def _paths(self, flight: str, names: Sequence[str]) -> set[str]:
        """Paths of a flight that some parameters, and every choice, set."""
        targets: list[Target | Constant] = [
            t for name in names for t in self.study.parameter(name).targets
        ]
        targets += [
            target
            for choice in self.study.plan.choices
            for option in choice.options
            for target in option.sets
        ]
        return {str(target.path) for target in targets if target.flights.fit(flight)}

    def _ends(
        self, flight: str, fixed: Settings, names: Sequence[str]
    ) -> list[dict[str, Any]]:
        """Numbers of a flight with each varied parameter at its ends, and all of them
        at the upper one.
        """
        tops = {name: self.study.parameter(name).high for name in names}
        bottoms = {name: self.study.parameter(name).low for name in names}
        singles = [
            {**fixed, name: value}
            for each in (tops, bottoms)
            for name, value in each.items()
        ]
        return [
            self.study.numbers(flight, settings)
            for settings in (*singles, {**fixed, **tops})
        ]


def _stiffest(
    planned: Scenario, ends: Sequence[Mapping[str, Any]]
) -> tuple[Scenario, float]:
    """The scenario with the stiffest joint friction within the parameters' ranges, and
    how fast it is, 1/s.
    """
    worst, fastest = planned, joint_rate(planned.agent.plant.vehicle)
    for numbers in ends:
        try:
            changed = with_numbers(
                planned, {p: v for p, v in numbers.items() if p.startswith("plant.")}
            )
            rate = joint_rate(changed.agent.plant.vehicle)
        except ValueError:
            continue  # extremes of several need not come together
        if rate > fastest:
            worst, fastest = changed, rate
    return worst, fastest
