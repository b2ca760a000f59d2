"""Cells whose flights fly one by one, shared out to processes flight by flight."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from skyarm.compare.cells import Cell, Flights
from skyarm.compare.one_by_one import collected, fly_single, numbers_of
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.workers import packed, workers

Done = Callable[[Flights, Cell], None]
Flown = tuple[dict[str, Any], str]


def fly_in_processes(todo: Sequence[Flights], processes: int, done: Done) -> None:
    """Fly cells in order; ``done`` is called in the caller's process as each is whole.

    Args:
        todo: cells of laws or plants that fly one by one.
        processes: how many; the numbers do not depend on it.
        done: takes a cell and what it is of.

    Raises:
        OSError: a process ended unexpectedly.
    """
    if not todo:
        return
    with workers(processes) as submit:
        begun: list[list[Callable[[], Flown]]] = []
        for flights in todo:
            scenario = flights.scenario()
            values, windows = flights.values(scenario), flights.case.windows
            more, count = flights.further_metrics, flights.episodes(scenario)
            whole = [(scenario, numbers_of(values, k), k, windows, more) for k in range(count)]
            if _can_travel(scenario):
                begun.append([submit(fly_single, *each).result for each in whole])
            else:
                begun.append([partial(fly_single, *each) for each in whole])
        for flights, results in zip(todo, begun, strict=True):
            done(flights, Cell(*collected([result() for result in results])))


def _can_travel(scenario: Scenario) -> bool:
    """Whether another process can be given a scenario; one that holds what cannot be written down flies here."""
    try:
        packed(scenario)
    except ValueError:
        return False
    return True
