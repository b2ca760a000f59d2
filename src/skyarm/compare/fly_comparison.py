"""Fly a comparison: every entrant, every condition, every case; what is there already is not flown again."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from skyarm.bench.latency import flown_latency, latency
from skyarm.compare.cells import ONE_BY_ONE, Cell, Cells, Flights, chosen, fly
from skyarm.compare.entrants import Entrant
from skyarm.compare.processes import fly_in_processes
from skyarm.compare.suite import CASES, Condition

Progress = Callable[[int, int, str], None]

CALLS = 20_000
"""Control steps timed for each law that compiles."""

SECONDS = 30.0
"""Flight in which the steps of any other law are timed."""


def perform(
    entrants: Mapping[str, Entrant],
    conditions: Mapping[str, Condition],
    folder: Path,
    *,
    seed: int = 0,
    plant: str = "rigid_body",
    one_by_one: int = ONE_BY_ONE,
    threads: int = 1,
    progress: Progress | None = None,
) -> dict[tuple[str, str, str], Cell]:
    """Cells by (condition, case, entrant).

    Args:
        entrants: what flies, in order.
        conditions: under what.
        folder: of the cells; an interrupted comparison goes on where it stopped.
        seed: of plants and noise.
        plant: "rigid_body", or "mujoco", on which every law flies one episode after the other.
        one_by_one: wrong plants that a law meets whose flights fly one by one.
        threads: of the batches, and processes for flights one by one; results do not depend on it.
        progress: called after every cell.
    """
    todo = chosen(entrants, conditions, seed=seed, plant=plant, one_by_one=one_by_one)
    return fly_all(todo, folder, threads=threads, progress=progress)


def fly_all(
    todo: Sequence[Flights], folder: Path, *, threads: int = 1, progress: Progress | None = None
) -> dict[tuple[str, str, str], Cell]:
    """Cells by (condition, case, entrant); those that the folder holds are not flown again."""
    cells, found = Cells(folder), {}

    def note(flights: Flights, cell: Cell) -> None:
        found[name_of(flights)] = cell
        if progress is not None:
            progress(len(found), len(todo), flights.label.replace("__", " "))

    def keep(flights: Flights, cell: Cell) -> None:
        cells.put(flights, cell)
        note(flights, cell)

    later = []
    for flights in todo:
        cell = cells.get(flights)
        if cell is not None:
            note(flights, cell)
        elif threads > 1 and flights.alone(flights.scenario()):
            later.append(flights)
        else:
            keep(flights, fly(flights, threads))
    fly_in_processes(later, threads, keep)
    return {name_of(flights): found[name_of(flights)] for flights in todo}


def name_of(flights: Flights) -> tuple[str, str, str]:
    """Condition, case, entrant."""
    return flights.condition.name, flights.case.name, flights.entrant.name


def step_times(
    entrants: Mapping[str, Entrant], condition: Condition, calls: int = CALLS, seconds: float = SECONDS
) -> dict[str, Any]:
    """Microseconds of one control step of each law: median and 99th percentile.

    A law that does not compile is timed in a flight; ``solving`` says the same of the steps in which it solves a
    problem.
    """
    found: dict[str, Any] = {}
    for name, entrant in entrants.items():
        scenario = Flights(entrant=entrant, case=CASES["case3_wind"], condition=condition).scenario()
        if scenario.controller.compiled:
            found[name] = latency(scenario, calls)["compiled"]
        else:
            found[name] = flown_latency(dataclasses.replace(scenario, duration=seconds))
    return found
