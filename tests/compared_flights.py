"""Cells of a comparison flown here, in no folder."""

from __future__ import annotations

from skyarm.studies.compare.cell_flights import Cell, CellFlights
from skyarm.studies.flights import Work
from skyarm.studies.flights.fly import fly


def cell_of(flown: CellFlights | Work) -> Cell:
    """What a comparison judges of some flights."""
    work = flown.work() if isinstance(flown, CellFlights) else flown
    return Cell.of_rows(work, fly(work))
