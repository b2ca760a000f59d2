"""Benchmark of contact tasks with randomly perturbed surfaces, objects, winds and rotor
thrusts; tables of results.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import product

import numpy as np

from skyarm.control.controller import ControllerError
from skyarm.log.metrics.interaction import BAND
from skyarm.records.arrays import Columns, Mask
from skyarm.records.immutable import immutable
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.compare.cell_flights import Cell, CellFlights, Document, Record
from skyarm.studies.compare.contact_tasks import (
    FLAGSHIP,
    LAWS,
    TASKS,
    ContactTask,
    flies_its_own,
    scenario_of,
)
from skyarm.studies.compare.contact_worlds import Worlds, draw_worlds
from skyarm.studies.compare.entrants import Entrant
from skyarm.studies.compare.run_suite import Pngs, Refused, Suite
from skyarm.studies.compare.suite import Case, Condition
from skyarm.studies.sweep.expressions import read_expression
from skyarm.studies.trial.table import (
    COLUMNS,
    TableColumn,
    refusals,
    report_of,
    success_share,
)
from skyarm.view.pages import DASH, Report, Section, Table, table_of

CONTACT = "contact-suite"

WORLDS, QUICK = 200, 16
"""Number of perturbed worlds of each task, by default and with --quick."""


METRICS = ("contact", "phases_done")
"""Metrics in addition to those of every comparison."""

CONDITIONS = {"perfect": "perfect state", "noisy": "noisy measurements"}
"""Conditions of the suite, both in the same perturbed worlds, with an unmodelled delay
of up to 10 ms."""


@immutable(slots=False)
class ContactFlights(CellFlights):
    """Flights of one controller in one contact task with perturbed surroundings and
    plant.
    """

    further_metrics = METRICS

    meets_perturbed_plants = True

    @property
    def task(self) -> ContactTask:
        """Contact task that these flights perform."""
        return TASKS[self.case.name]

    def scenario(self) -> Scenario:
        """Unperturbed scenario of the contact task for this controller."""
        noisy = self.condition.noisy
        return scenario_of(
            self.task, self.entrant.law, noisy=noisy, plant=self.plant, seed=self.seed
        )

    def worlds(self) -> Worlds:
        """Perturbed surroundings and plants of the condition, the same for every
        controller.
        """
        return worlds_of(self.case.name, self.condition.episodes, self.seed)

    def values(self, scenario: Scenario) -> Columns:
        """Perturbed surroundings and plants of the flights: parameter path -> values
        (flights,).
        """
        count = self.episodes(scenario)
        return {path: column[:count] for path, column in self.worlds().values.items()}


# 64 is chosen: to draw 64 worlds costs 0.2 s (measured)
@lru_cache(maxsize=64)
def worlds_of(task: str, count: int, seed: int) -> Worlds:
    """Draw perturbed surroundings and plants of a contact task, around its shipped
    scenario.
    """
    # around the flagship's scenario, so that every law meets the same worlds
    worlds = draw_worlds(
        TASKS[task], scenario_of(TASKS[task], FLAGSHIP, noisy=False), count, seed=seed
    )
    for column in worlds.values.values():
        # the cache hands one array to all: nobody may write into it
        np.asarray(column).setflags(write=False)
    return worlds


@immutable
class ContactSuite(Suite[ContactFlights]):
    """Benchmark of several controllers on contact tasks, such as pressing or opening a
    door.

    Attributes:
        laws: names, in order. tasks: names, in order. worlds: number of worlds of each
            task.
        seed: seed of worlds and noise. plant: kind of plant.
    """

    laws: tuple[str, ...] = LAWS
    tasks: tuple[str, ...] = tuple(TASKS)
    worlds: int = WORLDS
    seed: int = 0
    plant: str = "rigid_body"

    name, file, folder = CONTACT, "contact", "out/contact"
    settings = ("worlds", "seed", "plant")

    def plan_cells(self) -> tuple[list[ContactFlights], Refused]:
        """All flights of the contact benchmark, and reasons why a controller is
        excluded from a task.

        They are grouped by task, controller and condition.
        """
        conditions = [
            Condition(name=name, noisy=name == "noisy", episodes=self.worlds)
            for name in CONDITIONS
        ]
        flown = list[ContactFlights]()
        refused = dict[str, str]()
        for task, law, condition in product(self.tasks, self.laws, conditions):
            if not flies_its_own(TASKS[task], law):
                continue
            cell = ContactFlights(
                entrant=Entrant(name=law, law=law),
                case=Case(name=task),
                condition=condition,
                plant=self.plant,
                seed=self.seed,
            )
            try:
                # refuses a law that does not fit
                cell.scenario()
                flown.append(cell)
            except ControllerError as error:
                refused[f"{law} in {task}"] = str(error)
        return flown, refused

    def judge(
        self, flown: Sequence[tuple[ContactFlights, Cell]], refused: Refused
    ) -> Document:
        """Evaluate flights of contact tasks: success rates, failure causes and errors,
        as plain data.
        """
        tasks: Document = {}
        for flights, cell in flown:
            condition, name, law = flights.name
            if name not in tasks:
                empty: Document = {each: {} for each in CONDITIONS}
                tasks[name] = {
                    "title": flights.task.title,
                    **flights.worlds().plain(),
                    "conditions": empty,
                }
            scenario = flights.scenario()
            tasks[name]["conditions"][condition][law] = cell_record(
                flights.task,
                cell,
                weight=float(scenario.agent.vehicle.mass)
                * float(scenario.agent.plant.gravity),
                phases=len(scenario.agent.reference.phases),
            )
        return {"laws": list(self.laws), "not_flown": dict(refused), "tasks": tasks}

    def report(self, found: Record, pictures: Pngs = None) -> Report:
        """Report of the contact benchmark with success rates and median errors."""
        return contact_report(found)


NUMBERS: Mapping[str, TableColumn] = {
    column.name: column for column in COLUMNS["contact"]
}
"""Columns by the key of a cell; each is a percentile over completed flights."""


def lacks(task: ContactTask, cell: Cell, weight: float, phases: int) -> dict[str, Mask]:
    """Unmet success criteria of a contact task: criterion -> True for each flight that
    fails it.

    Args:
        task: task with its success criteria.
        cell: flights of the task.
        weight: weight of the vehicle, N.
        phases: number of phases of the scenario that was flown; 0 where none waits.
    """
    m = cell.metrics
    late = cell.status == "phase_failed"
    # a phase that was late ends a flight that is not lost: it lacks its phases
    unmet = {"lost": ~(cell.tracked_to_end | (late & cell.upright))}
    # not "<": what was not measured counts as unmet
    unmet["phases"] = late | ~(m["phases_done"] >= phases)
    numbers: Document = {**m, "weight": weight}
    for word, text in task.success.items():
        unmet[word] = ~(
            read_expression(text, numbers, f"success.{word}").value(numbers) >= 0.0
        )
    return unmet


def cell_record(task: ContactTask, cell: Cell, weight: float, phases: int) -> Document:
    """Results of one controller in a contact task as plain data: success rate, failure
    causes, median errors.

    Args:
        task: task as of :func:`lacks`; a flight that lacks several things counts under
            the first.
        cell: flights of the task.
        weight: N, of the vehicle.
        phases: number of phases of the scenario.
    """
    bad = np.zeros(len(cell.status), dtype=bool)
    causes: Counter[str] = Counter()
    for word, flags in lacks(task, cell, weight, phases).items():
        for k in np.flatnonzero(flags & ~bad):
            ended = word == "lost" and not cell.completed[k]
            causes[str(cell.status[k]) if ended else word] += 1
        bad |= flags
    record: Document = {
        "flights": len(bad),
        "successes": int((~bad).sum()),
        **success_share(~bad),
    }
    record["causes"] = dict(causes.most_common())
    for name, column in NUMBERS.items():
        # of an unfinished task the time is that of an earlier phase
        counted = (
            cell.completed & (cell.metrics["phases_done"] >= phases)
            if name == "time"
            else cell.completed
        )
        record[name] = column.percentile_of(cell.metrics[column.metric][counted])
    if not phases:  # the plan says when it is over
        record["time"] = None
    return record


MEANING = (
    "A success is a flight that is not lost (it came to its end, tilted by at most 80"
    " degrees, the tip within 0.5 m of its reference in the mean of the last seconds),"
    " with all phases done in time; where a force is held it is within"
    f" {100.0 * BAND:g} % for 90 % of the time from 2 s after the first touch on; a box"
    " lies within 10 mm of its place, a door is open by 55 degrees, a valve by 80, a"
    " button has clicked, a peg is 90 % deep, a vehicle that landed carries a tenth of"
    " its weight on its skids, within 5 cm. A flight that lacks several counts under"
    " the first of them; names of endings are those of lost flights."
)

HOW = (
    "Every law meets the same worlds: stiffness 500 to 1e5 N/m, friction 0.1 to 0.8"
    " (0.28 where the tip slides sideways), the nominal normal off by up to 10 degrees,"
    " a hinge that is up to 6 % nearer or further, half to twice the friction, damping"
    " and closer behind a handle, half to twice the mass, thrust up to 10 % less, wind"
    " of up to 2 N and never more than half the push, commands up to 10 ms late. No"
    " model of a law contains any of it. The reference of a law that follows positions"
    " lies 1 cm behind the nominal surface."
)

MEDIANS = (
    "Medians over completed flights; the force error by its size. Of a handle the force"
    " along its true radius, and its lag behind the commanded angle."
)


def contact_report(found: Record) -> Report:
    """Build the report of the contact suite's results."""
    drawn = [
        f"{name} {task['discarded']} of {task['drawn']}"
        for name, task in found["tasks"].items()
    ]
    discarded = (
        "Worlds discarded, in which physics does not let the task be done:"
        f" {', '.join(drawn)}."
    )
    flown = [
        Section(
            name="What flew", notes=[MEANING, discarded, *refusals(found)], remark=HOW
        )
    ]
    numbers = []
    for name, title in CONDITIONS.items():
        cells = {
            task["title"]: task["conditions"][name] for task in found["tasks"].values()
        }
        laws = [
            law for law in found["laws"] if any(law in each for each in cells.values())
        ]
        if not laws:
            continue
        successes = [
            [task, *(_successes(each.get(law)) for law in laws)]
            for task, each in cells.items()
        ]
        flown.append(
            Section(
                title=f"Successes, {title}",
                tables=[table_of(["task", *laws], successes)],
            )
        )
        rows = [
            [
                task,
                law,
                _successes(cell),
                *(column.cell(cell[key]) for key, column in NUMBERS.items()),
                _causes(cell),
            ]
            for task, each in cells.items()
            for law, cell in each.items()
        ]
        heads = (f">{column.head}" for column in NUMBERS.values())
        table = Table(head=("task", "law", ">success", *heads, "lacked"), rows=rows)
        numbers.append(
            Section(title=f"Numbers, {title}", remark=MEDIANS, tables=[table])
        )
    return report_of(
        f"Tasks in contact, {found['worlds']} perturbed worlds each, on"
        f" {found['plant']}",
        f"{found['worlds']} worlds a task, seed {found['seed']}",
        [*flown, *numbers],
    )


def _successes(cell: Record | None) -> str:
    return DASH if cell is None else f"{cell['successes']} of {cell['flights']}"


def _causes(cell: Record) -> str:
    return (
        ", ".join(f"{word} {count}" for word, count in cell["causes"].items()) or DASH
    )
