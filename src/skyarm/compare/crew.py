"""Cells whose flights fly one by one, shared out to processes flight by flight."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from skyarm.compare.cells import Cell, Flights
from skyarm.compare.single import collected, fly_single, numbers_of
from skyarm.simulate.workers import workers

Done = Callable[[Flights, Cell], None]


def fly_in_processes(todo: Sequence[Flights], count: int, done: Done) -> None:
    """Fly cells in order; ``done`` is called in the caller's process as each is whole.

    Args:
        todo: cells of laws or plants that fly one by one.
        count: processes; the numbers do not depend on it.
        done: takes a cell and what it is of.

    Raises:
        OSError: a process ended unexpectedly.
    """
    if not todo:
        return
    with workers(count) as submit:
        begun = []
        for flights in todo:
            scenario = flights.scenario()
            values, windows = flights.values(scenario), flights.case.windows
            each = range(flights.episodes(scenario))
            begun.append([submit(fly_single, scenario, numbers_of(values, k), k, windows) for k in each])
        for flights, futures in zip(todo, begun, strict=True):
            done(flights, Cell(*collected([future.result() for future in futures])))
