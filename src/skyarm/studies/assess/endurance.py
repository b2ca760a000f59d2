"""The time that a vehicle can stay aloft on its battery."""

from __future__ import annotations

import math

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
        return [_too_little(vehicle, gravity, question)]
    left = f", {found.charge:.0%} of the charge left" if found.charge > 0.01 else ""
    text = f"{found.seconds / 60.0:.3g} min of hover at {found.power:.3g} W{left}"
    words = (text, "battery.capacity", "more capacity, more cells, or less mass")
    return [at_least(question, found.seconds, *words, warning=SHORTEST, unit="s")]


def _too_little(vehicle: Vehicle, gravity: float, question: str) -> Finding:
    """A battery that holds no hover: for want of charge, of power through its resistance, or of voltage."""
    battery, trim = vehicle.battery, hover_trim(vehicle, (0.0,) * vehicle.n, gravity)
    assert battery is not None
    power, charge = float(battery.power(vehicle.rotors, trim.speeds)), float(battery.charge)
    share = max(float(w) / float(r.max_speed) for w, r in zip(trim.speeds, vehicle.rotors, strict=True))
    least, idle = share * float(battery.reference_voltage), float(battery.open_circuit_voltage(1.0))
    most = idle * idle / (4.0 * float(battery.resistance)) if float(battery.resistance) > 0.0 else math.inf
    if most < power:
        through = f"gives at most {most:.3g} W through {float(battery.resistance):g} ohm"
        text, field = f"{through}, and a level hover takes {power:.3g} W", "battery.resistance, battery.cells"
        remedy = "more cells, or check battery.resistance (ohm, not mohm?), rotors.thrust_table.current (A, not mA?)"
    elif float(battery.voltage(1.0, power)) >= least:
        text = f"a charge of {charge:g} holds no level hover at {power:.3g} W, a full one does"
        field, remedy = "battery.charge", "a fuller battery"
    else:
        text = f"{battery.cells} cells give {float(battery.voltage(1.0, power)):.3g} V, and a level hover takes "
        text += f"{least:.3g} V of the reference_voltage of {float(battery.reference_voltage):g} V"
        field, remedy = "battery.cells", "more cells, or check battery.reference_voltage (V of the whole pack)"
    return Finding(question, FAULT, text, field, remedy)


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


def speed_share(vehicle: Vehicle, gravity: float) -> float:
    """Highest speed of the rotors on the battery at the start, under a hover's load, over that which they state."""
    battery = vehicle.battery
    if battery is None or not vehicle.rotors or not _hovers(vehicle, gravity):
        return 1.0
    trim = hover_trim(vehicle, (0.0,) * vehicle.n, gravity)
    power, idle = float(battery.power(vehicle.rotors, trim.speeds)), float(battery.open_circuit_voltage(battery.charge))
    if idle * idle < 4.0 * float(battery.resistance) * power:  # said by time_aloft
        return 1.0
    voltage = float(battery.voltage(battery.charge, power))
    return min(1.0, voltage / float(battery.reference_voltage))


def _hovers(vehicle: Vehicle, gravity: float) -> bool:
    """True if the rotors hold the vehicle level at the voltage of their highest speed; else other findings say why."""
    try:
        trim = hover_trim(vehicle, (0.0,) * vehicle.n, gravity)
    except AllocationError:
        return False
    if any(float(squared) < 0.0 for squared in trim.squared):
        return False
    return all(float(w) <= float(rotor.max_speed) for w, rotor in zip(trim.speeds, vehicle.rotors, strict=True))
