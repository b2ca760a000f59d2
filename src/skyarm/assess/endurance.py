"""The time that a vehicle can stay aloft on its battery."""

from __future__ import annotations

from skyarm.actuation import AllocationError
from skyarm.actuation.hover import hover_trim
from skyarm.actuation.time_aloft import time_aloft as hover_time
from skyarm.assess.finding import FAULT, NOTE, OK, WARNING, Finding
from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.vehicle_records import Vehicle

SHORTEST = 120.0
"""s: hardly a take-off and a landing."""


def time_aloft(vehicle: Vehicle, gravity: float, held: str = "") -> list[Finding]:
    """Time in a level hover, arm at zero; a note where the vehicle's file describes no battery."""
    question = f"time aloft{held}"
    if vehicle.battery is None:
        text = "not known: the vehicle's file describes no battery"
        return [Finding(question=question, level=NOTE, text=text, field="battery")]
    if not _hovers(vehicle, gravity):
        text = "none: the rotors hold no level hover with the arm at zero, at any voltage"
        return [Finding(question=question, level=NOTE, text=text, field="rotors")]
    remedy = "more capacity, more cells, or less mass"
    try:
        found = hover_time(vehicle, gravity)
    except VehicleError as error:
        text = str(error).rpartition(": ")[2]
        field = "battery.charge"
        return [Finding(question=question, level=FAULT, text=text, field=field, remedy=remedy)]
    level = OK if found.seconds >= SHORTEST else WARNING
    left = f", {found.charge:.0%} of the charge left" if found.charge > 0.01 else ""
    return [
        Finding(
            question=question,
            level=level,
            text=f"{found.seconds / 60.0:.3g} min of hover at {found.power:.3g} W{left}",
            field="battery.capacity",
            value=found.seconds,
            limit=SHORTEST,
            unit="s",
            remedy="" if level == OK else remedy,
        )
    ]


def _hovers(vehicle: Vehicle, gravity: float) -> bool:
    """Whether the rotors hold the vehicle level on the voltage of their highest speed; other findings say why not."""
    try:
        trim = hover_trim(vehicle, (0.0,) * vehicle.n, gravity)
    except AllocationError:
        return False
    if any(float(squared) < 0.0 for squared in trim.squared):
        return False
    return all(float(w) <= float(rotor.max_speed) for w, rotor in zip(trim.speeds, vehicle.rotors, strict=True))
