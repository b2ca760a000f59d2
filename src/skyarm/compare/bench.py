"""Fly a bench: every entrant, every condition, every case; what is there already is not flown again."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from skyarm.bench.latency import latency
from skyarm.compare.cells import Cell, Cells, Flights, chosen, fly
from skyarm.compare.entrants import Entrant
from skyarm.compare.suite import CASES, Condition

Progress = Callable[[int, int, str], None]

CALLS = 20_000
"""Control steps timed for each law."""


def perform(
    entrants: Mapping[str, Entrant],
    conditions: Mapping[str, Condition],
    folder: Path,
    *,
    seed: int = 0,
    plant: str = "rigid_body",
    threads: int = 1,
    progress: Progress | None = None,
) -> dict[tuple[str, str, str], Cell]:
    """Cells by (condition, case, entrant).

    Args:
        entrants: what flies, in order.
        conditions: under what.
        folder: of the cells; an interrupted bench goes on where it stopped.
        seed: of plants and noise.
        plant: "rigid_body", or "mujoco", which flies one episode after the other.
        threads: of the batches; results do not depend on it.
        progress: called after every cell.
    """
    cells, found = Cells(folder), {}
    todo = chosen(entrants, conditions, seed=seed, plant=plant)
    for number, flights in enumerate(todo):
        cell = cells.get(flights)
        if cell is None:
            cell = fly(flights, threads)
            cells.put(flights, cell)
        found[flights.condition.name, flights.case.name, flights.entrant.name] = cell
        if progress is not None:
            progress(number + 1, len(todo), flights.label.replace("__", " "))
    return found


def step_times(entrants: Mapping[str, Entrant], condition: Condition, calls: int = CALLS) -> dict[str, Any]:
    """Microseconds of one control step of each law that compiles: median and 99th percentile."""
    found: dict[str, Any] = {}
    for name, entrant in entrants.items():
        scenario = Flights(entrant=entrant, case=CASES["case3_wind"], condition=condition).scenario()
        found[name] = latency(scenario, calls)["compiled"] if scenario.controller.compiled else None
    return found
