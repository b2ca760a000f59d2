"""Report of an identified vehicle: table of numbers with intervals, correlations and explained shares."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from rich.console import RenderableType

from skyarm.cli.output import aligned_lines, heading, shown_number
from skyarm.flight_data.flight_data import FlightData
from skyarm.records.files import printable
from skyarm.studies.identify.identify_vehicle import Identified, IdentifiedNumber
from skyarm.vehicle.vehicle_records import Vehicle

VEHICLE, IDENTIFIED = "vehicle.toml", "identified.json"
"""Names of the file of the vehicle and of that of all numbers."""

CLOSE, MOST = 0.9, 12
"""Correlation from which two numbers are named; lines of them at most."""

HEADS = ("", "value", "95 % interval", "start", "unit")


def report_lines(found: Identified, start: Vehicle, flights: Sequence[FlightData]) -> list[RenderableType]:
    """Heading, table and remarks of an identified vehicle."""
    names = ", ".join(each.name for each in flights)
    lines: list[RenderableType] = [heading(f"{start.name} from {names}: {found.seconds:.3g} s")]
    lines += aligned_lines([HEADS, *map(_row, found.numbers)])
    if not found.settled:
        lines.append("the search did not settle: neither these numbers nor their intervals can be relied on")
    shares = ", ".join(f"{row} {share:.0%}" for row, share in found.explained.items())
    lines.append(f"explained one step ahead: {shares}")
    pairs = correlated_pairs(found)
    lines += [f"hard to separate: {a} and {b}, correlation {r:+.3f}" for a, b, r in pairs[:MOST]]
    if len(pairs) > MOST:
        lines.append(f"and {len(pairs) - MOST} more pairs with a correlation beyond {CLOSE:g}")
    lines += [f"{each.name}: {note}" for each in flights for note in each.notes]
    return [printable(line) if isinstance(line, str) else line for line in lines]


def _row(number: IdentifiedNumber) -> tuple[str, ...]:
    start = shown_number(number.start, 4)
    if not number.is_known:
        return (number.name, number.reason, "", start, number.unit)
    low, high = shown_number(number.low, 4), shown_number(number.high, 4)
    return (number.name, shown_number(number.value, 4), f"{low} to {high}", start, number.unit)


def correlated_pairs(found: Identified) -> list[tuple[str, str, float]]:
    """Pairs of numbers, of which the flights show one at least, whose errors go together, the strongest first."""
    names, pairs = [each.name for each in found.numbers], list[tuple[str, str, float]]()
    for i, j in zip(*np.nonzero(np.triu(np.abs(found.correlation) > CLOSE, 1)), strict=True):
        if found.numbers[i].is_known or found.numbers[j].is_known:
            pairs.append((names[i], names[j], float(found.correlation[i, j])))
    return sorted(pairs, key=lambda each: -abs(each[2]))


def document_of(
    found: Identified, start: Vehicle, flights: Sequence[FlightData], known: Mapping[str, float]
) -> dict[str, Any]:
    """All numbers of an identification, for JSON; a value that the flights do not show is null."""
    numbers = []
    for each in found.numbers:
        shown = each.is_known
        numbers.append(
            {
                "name": each.name,
                "unit": each.unit,
                "value": each.value if shown else None,
                "low": each.low if shown else None,
                "high": each.high if shown else None,
                "start": each.start,
                "data_share": each.data_share,
                "reason": each.reason,
            }
        )
    return {
        "start": start.name,
        "flights": [{"name": each.name, "file": each.file, "notes": each.notes} for each in flights],
        "seconds": found.seconds,
        "settled": found.settled,
        "numbers": numbers,
        "known": known,
        "correlation": found.correlation,
        "surroundings": found.surroundings,
        "explained": found.explained,
        "deviation": found.deviation,
    }
