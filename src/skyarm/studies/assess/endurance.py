"""The time that a vehicle can stay aloft on its battery."""

from __future__ import annotations

from skyarm.dynamics.actuators import AllocationError
from skyarm.dynamics.actuators.hover import hover_trim
from skyarm.dynamics.actuators.hover import time_aloft as hover_time
from skyarm.studies.assess.finding import FAULT, NOTE, Finding, at_least
from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.vehicle_records import Vehicle

SHORTEST = 120.0
"""s: hardly a take-off and a landing."""


def time_aloft(vehicle: Vehicle, gravity: float, held: str = "") -> list[Finding]:
    """Time in a level hover, arm at zero; a note where the vehicle's file describes no battery."""
    question = f"time aloft{held}"
    if vehicle.battery is None:
        return [Finding(question, NOTE, "not known: the vehicle's file describes no battery", "battery")]
    if not _hovers(vehicle, gravity):
        text = "none: the rotors hold no level hover with the arm at zero, at any voltage"
        return [Finding(question, NOTE, text, "rotors")]
    try:
        found = hover_time(vehicle, gravity)
    except VehicleError:
        text = "the battery holds no level hover: too little charge, voltage, or power through its resistance"
        remedy = "more cells or charge, or check battery.resistance (ohm) and rotors.thrust_table.current (A)"
        return [Finding(question, FAULT, text, "battery.charge, battery.cells, battery.resistance", remedy)]
    left = f", {found.charge:.0%} of the charge left" if found.charge > 0.01 else ""
    text = f"{found.seconds / 60.0:.3g} min of hover at {found.power:.3g} W{left}"
    words = (text, "battery.capacity", "more capacity, more cells, or less mass")
    return [at_least(question, found.seconds, *words, warning=SHORTEST, unit="s")]


def aloft_for(vehicle: Vehicle, gravity: float, duration: float) -> list[Finding]:
    """A fault where a flight takes longer than the battery holds a hover; nothing without a battery."""
    if vehicle.battery is None or not vehicle.rotors or not _hovers(vehicle, gravity):
        return []
    try:
        found = hover_time(vehicle, gravity)
    except VehicleError:  # said by time_aloft
        return []
    field = "battery.charge" if float(vehicle.battery.charge) < 1.0 else "battery.capacity"
    text = f"holds a hover for {found.seconds:.3g} s, and the flight takes {duration:g} s"
    words = (text, field, f"more of {field}, or a shorter duration")
    return [at_least("battery over the flight", found.seconds, *words, fault=duration, unit="s")]


def _hovers(vehicle: Vehicle, gravity: float) -> bool:
    """True if the rotors hold the vehicle level at the voltage of their highest speed; else other findings say why."""
    try:
        trim = hover_trim(vehicle, (0.0,) * vehicle.n, gravity)
    except AllocationError:
        return False
    if any(float(squared) < 0.0 for squared in trim.squared):
        return False
    return all(float(w) <= float(rotor.max_speed) for w, rotor in zip(trim.speeds, vehicle.rotors, strict=True))
