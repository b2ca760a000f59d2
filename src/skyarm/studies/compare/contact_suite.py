"""Benchmark of contact tasks, each with many perturbed surfaces, objects, winds and rotor thrusts."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from skyarm.control.controller import ControllerError
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.immutable import immutable
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.compare.cells import Cell, Flights
from skyarm.studies.compare.contact_report import CONDITIONS, METRICS, cell_record, contact_report
from skyarm.studies.compare.contact_tasks import FLAGSHIP, LAWS, TASKS, Task, flies_its_own, scenario_of
from skyarm.studies.compare.contact_worlds import Worlds, draw_worlds
from skyarm.studies.compare.entrants import Entrant
from skyarm.studies.compare.run_suite import Document, Record, Refused, Suite
from skyarm.studies.compare.suite import Case, Condition
from skyarm.view.pages import Report

CONTACT = "contact-suite"

WORLDS, QUICK = 200, 16
"""Perturbed worlds of each task; where it is to be quick."""


@immutable(slots=False)
class ContactFlights(Flights):
    """Flights of one controller in one contact task with perturbed surroundings and plant."""

    further_metrics = METRICS

    meets_perturbed_plants = True

    @property
    def task(self) -> Task:
        """Contact task that these flights perform."""
        return TASKS[self.case.name]

    def scenario(self) -> Scenario:
        """Unperturbed scenario of the contact task for this controller."""
        noisy = self.condition.noisy
        return scenario_of(self.task, self.entrant.law, noisy=noisy, plant=self.plant, seed=self.seed)

    def worlds(self) -> Worlds:
        """Perturbed surroundings and plants of the condition, the same for every controller."""
        return worlds_of(self.case.name, self.condition.episodes, self.seed)

    def values(self, scenario: Scenario) -> dict[str, Array]:
        """Perturbed surroundings and plants of the flights: parameter path -> values (flights,)."""
        count = self.episodes(scenario)
        return {path: column[:count] for path, column in self.worlds().values.items()}

    def stiffest(self, values: Mapping[str, Array]) -> dict[str, float]:
        """Parameter values that require the shortest integration steps, such as the hardest surface.

        Stiffness k and friction mu need steps by k and by k mu. With the largest k, the mu that makes the largest k mu
        of any world needs the shortest step of all worlds, and none that is shorter.
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


@lru_cache(maxsize=64)
def worlds_of(task: str, count: int, seed: int) -> Worlds:
    """Draw perturbed surroundings and plants of a contact task, around its shipped scenario."""
    found = draw_worlds(TASKS[task], scenario_of(TASKS[task], FLAGSHIP, noisy=False), count, seed=seed)
    for column in found.values.values():
        np.asarray(column).setflags(write=False)
    return found


@immutable
class ContactSuite(Suite[ContactFlights]):
    """Benchmark of several controllers on contact tasks, such as pressing or opening a door.

    Attributes:
        laws: names, in order. tasks: names, in order. worlds: of each task. seed: of worlds and noise. plant: that
            flies.
    """

    laws: tuple[str, ...] = LAWS
    tasks: tuple[str, ...] = tuple(TASKS)
    worlds: int = WORLDS
    seed: int = 0
    plant: str = "rigid_body"

    name, file = CONTACT, "contact"

    @property
    def options(self) -> Document:
        """Settings of the benchmark as plain data: perturbed scenarios per task, seed and plant."""
        return {"worlds": self.worlds, "seed": self.seed, "plant": self.plant}

    def flights(self) -> list[ContactFlights]:
        """All flights of the contact benchmark, grouped by task, controller and condition."""
        conditions = [
            Condition(name=name, title=title, noisy=name == "noisy", episodes=self.worlds, cases=self.tasks)
            for name, title in CONDITIONS.items()
        ]
        return [
            ContactFlights(
                entrant=Entrant(name=law, group="own", law=law),
                case=Case(name=task, title=TASKS[task].title, scenario=task),
                condition=condition,
                plant=self.plant,
                seed=self.seed,
            )
            for task in self.tasks
            for law in self.laws
            for condition in conditions
            if flies_its_own(TASKS[task], law)
        ]

    def plan_cells(self) -> tuple[list[ContactFlights], dict[str, str]]:
        """All flights of the contact benchmark, and reasons why a controller is excluded from a task."""
        flown, refused = list[ContactFlights](), dict[str, str]()
        for each in self.flights():
            try:
                each.scenario()
                flown.append(each)
            except ControllerError as error:
                refused[f"{each.entrant.name} in {each.case.name}"] = str(error)
        return flown, refused

    def judge(self, todo: Sequence[ContactFlights], cells: Sequence[Cell], refused: Refused) -> Document:
        """Evaluate flights of contact tasks: success rates, failure causes and errors, as plain data."""
        tasks: Document = {}
        for flights, cell in zip(todo, cells, strict=True):
            condition, name, law = flights.name
            if name not in tasks:
                empty: Document = {each: {} for each in CONDITIONS}
                tasks[name] = {"title": flights.task.title, **flights.worlds().plain(), "conditions": empty}
            scenario = flights.scenario()
            tasks[name]["conditions"][condition][law] = cell_record(
                flights.task,
                cell,
                weight=float(scenario.plant.vehicle.mass) * float(scenario.plant.gravity),
                phases=len(scenario.reference.phases),
            )
        return {"laws": list(self.laws), "not_flown": dict(refused), "tasks": tasks}

    def report(self, found: Record, pictures: Mapping[str, bytes] | None = None) -> Report:
        """Report of the contact benchmark with success rates and median errors."""
        return contact_report(found)
