"""Report of a measured flight for a start vehicle: logging faults, and the parameters that it can identify."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

from skyarm.flight_data.flight_data import FlightData
from skyarm.records.files import printable
from skyarm.studies.identify.information import ExpectedNumber, expected_numbers
from skyarm.studies.identify.log_checks import REFUSED, LogFault
from skyarm.vehicle import Vehicle
from skyarm.view.pages import Facts


def excited_numbers(flight: FlightData, start: Vehicle, faults: Sequence[LogFault]) -> Sequence[ExpectedNumber]:
    """Accuracy that a flight allows for each parameter of a vehicle; empty if a fault makes the flight unusable.

    Raises:
        ValueError: one line: a flight that is too short or does not fit the vehicle.
    """
    if any(each.severity == REFUSED for each in faults):
        return ()
    return expected_numbers([flight], start)


def excitation_facts(start: Vehicle, faults: Sequence[LogFault], numbers: Sequence[ExpectedNumber]) -> Facts:
    """Faults and excited parameters of a measured flight as plain data."""
    return {
        "start": start.name,
        "faults": [{**asdict(each), "words": each.words} for each in faults],
        "excitation": [
            {**asdict(each), "title": each.title, "excited": each.is_excited, "verdict": each.verdict}
            for each in numbers
        ],
    }


def fault_line(fault: LogFault) -> str:
    """Fault of a measured flight as one line of text, without its file."""
    return printable(f"{fault.severity}: {fault.channel}: {fault.finding}; {fault.remedy}")


def excitation_lines(numbers: Sequence[ExpectedNumber]) -> list[str]:
    """Text lines with the expected 95 % interval of each parameter."""
    titles = [f"{each.title}:" for each in numbers]
    widths = max(map(len, titles)), max(len(each.verdict) for each in numbers)
    rows = zip(titles, numbers, strict=True)
    return [f"{title:{widths[0]}} {each.verdict:{widths[1]}} {each.name}" for title, each in rows]
