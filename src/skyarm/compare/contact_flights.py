"""Flights of the contact suite: a law meets the wrong worlds of a task, all in one batch where it can."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.compare.cells import Flights
from skyarm.compare.contact_laws import FLAGSHIP, flies_its_own, scenario_of
from skyarm.compare.contact_record import METRICS
from skyarm.compare.contact_tasks import TASKS, Task
from skyarm.compare.contact_worlds import Worlds, draw_worlds
from skyarm.compare.entrants import Entrant
from skyarm.compare.suite import Case, Condition
from skyarm.scenario.scenario_record import Scenario

Array = npt.NDArray[Any]

CONDITIONS = {"perfect": "perfect state", "noisy": "noisy measurements"}
"""Both in the same wrong worlds, with a delay of up to 10 ms that no law knows of."""


@dataclass(frozen=True, kw_only=True)
class ContactFlights(Flights):
    """Flights of a law in the wrong worlds of a task, a lane a world."""

    @property
    def task(self) -> Task:
        """What is done."""
        return TASKS[self.case.name]

    @property
    def label(self) -> str:
        """Name of its file; a law may be called by the path of a file."""
        return re.sub(r"[^\w.() -]+", "-", super().label)

    def scenario(self) -> Scenario:
        """The task as the law flies it."""
        noisy = self.condition.noisy
        return scenario_of(self.task, self.entrant.law, noisy=noisy, plant=self.plant, seed=self.seed)

    def worlds(self) -> Worlds:
        """Worlds of the whole condition, the same for every law."""
        return worlds_of(self.case.name, self.condition.episodes, self.seed)

    def values(self, scenario: Scenario) -> dict[str, Array]:
        """Numbers of every world, by path."""
        count = self.episodes(scenario)
        return {path: column[:count] for path, column in self.worlds().values.items()}

    def episodes(self, scenario: Scenario) -> int:
        """One for each world; the first ones of a law that flies one by one."""
        every = self.condition.episodes
        return min(self.one_by_one, every) if self.alone(scenario) else every

    def stiffest(self, values: Mapping[str, Array]) -> dict[str, float]:
        """The hardest surface, the stiffest friction and the lightest object: all ask for short steps.

        Stiffness k and friction mu ask by k and by k mu. With the largest k, the mu that makes the largest k mu of any
        world asks for the shortest step of all worlds, and for none that is shorter.
        """
        found = super().stiffest(values)
        for path, column in values.items():
            if path.endswith(".material.stiffness"):
                hardest = found[path] = float(column.max())
                rough = path.removesuffix("stiffness") + "friction"
                if rough in values:
                    found[rough] = float((column * values[rough]).max()) / hardest
            if re.fullmatch(r"world\.grippers\.\w+\.stiffness", path):
                found[path] = float(column.max())
            if re.fullmatch(r"world\.objects\.\w+\.mass", path):
                found[path] = float(column.min())
        return found

    @property
    def further_metrics(self) -> tuple[str, ...]:
        """Those of contact."""
        return METRICS

    def more(self) -> Mapping[str, Any]:
        """The worlds are a part of what fixes the cell."""
        found = {path: list(column) for path, column in self.values(self.scenario()).items()}
        return {"values": found, "further": self.further_metrics}


@lru_cache(maxsize=64)
def worlds_of(task: str, count: int, seed: int) -> Worlds:
    """Worlds of a task about the scenario as it is shipped."""
    found = draw_worlds(TASKS[task], scenario_of(TASKS[task], FLAGSHIP, noisy=False), count, seed=seed)
    for column in found.values.values():
        np.asarray(column).setflags(write=False)
    return found


def contact_flights(
    laws: tuple[str, ...], tasks: tuple[str, ...], worlds: int, *, seed: int = 0, plant: str = "rigid_body",
    one_by_one: int = 8,
) -> list[ContactFlights]:  # fmt: skip
    """Every cell, task by task."""
    whole = Condition(name="perfect", title=CONDITIONS["perfect"], noisy=False, episodes=worlds, cases=tasks)
    noisy = dataclasses.replace(whole, name="noisy", title=CONDITIONS["noisy"], noisy=True)
    return [
        ContactFlights(
            entrant=Entrant(name=law, group="own", law=law),
            case=Case(name=task, title=TASKS[task].title, scenario=task),
            condition=condition,
            plant=plant,
            seed=seed,
            one_by_one=one_by_one,
        )
        for task in tasks
        for law in laws
        for condition in (whole, noisy)
        if flies_its_own(TASKS[task], law)
    ]
