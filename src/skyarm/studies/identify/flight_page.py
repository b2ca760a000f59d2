"""Page of a measured flight: its channels, notes, clock, and the vehicle parameters that it can identify."""

from __future__ import annotations

from pathlib import Path

from skyarm.cli.output import bar, give, tell
from skyarm.flight_data.flight_data import load_flight
from skyarm.studies.identify.excitation_report import excitation_facts, excitation_lines, excited_numbers, fault_line
from skyarm.studies.identify.flight_sheet import flight_facts, flight_sheet
from skyarm.studies.identify.isolate_fault import find_faults
from skyarm.studies.identify.measured_motion import joints_in_order
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.view.pages import heading


def show_flight(name: str, columns: str | None, vehicle: str | None) -> None:
    """Print the page of a measured flight, with its faults and excitation for a start vehicle.

    Args:
        name: path of the flight.
        columns: path of the mapping of its columns.
        vehicle: file or name of the start vehicle.

    Raises:
        ValueError: one line, after the channels: of what is too short, or does not fit the vehicle, none is excited.
    """
    start = None if vehicle is None else load_vehicle(vehicle)
    with bar(Path(name).name) as advance:
        advance(last="read")
        flight = load_flight(name, columns)
        facts = flight_facts(flight)
        if start is not None:
            advance(last="look for faults")
            flight = joints_in_order(flight, start)
            faults = find_faults(flight, start)
    give(facts)
    for part in flight_sheet(facts):
        tell(part, "")
    if start is None:
        return
    for fault in faults:
        tell(fault_line(fault), "")
    with bar(Path(name).name) as advance:
        advance(last="excitation")
        numbers = excited_numbers(flight, start, faults)
    give(excitation_facts(start, faults, numbers))
    if numbers:
        tell(heading(f"excitation of {start.name}: expected 95 % intervals"), "")
        tell("\n".join(excitation_lines(numbers)), "")
    else:
        tell("excitation: is shown of a flight without refused faults", "")
