"""Endurance: time in hover on the battery."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from skyarm.dynamics.actuators import AllocationError
from skyarm.dynamics.actuators.hover import hover_trim
from skyarm.records.immutable import positional
from skyarm.studies.assess.finding import FAULT, NOTE, Finding, at_least
from skyarm.studies.assess.flight_loads import FlightPart
from skyarm.vehicle import Vehicle, VehicleError

SHORTEST = 120.0
"""Flight time (s) that hardly allows take-off and landing."""


def time_aloft(vehicle: Vehicle, gravity: float, held: str = "") -> list[Finding]:
    """Check result for the hover endurance with the arm at zero; a note if the vehicle
    has no battery.
    """
    question = f"time aloft{held}"
    if vehicle.battery is None:
        return [
            Finding(
                question,
                NOTE,
                "not known: the vehicle's file describes no battery",
                "battery",
            )
        ]
    if not _hovers(vehicle, gravity):
        text = (
            "none: the rotors hold no level hover with the arm at zero, at any voltage"
        )
        return [Finding(question, NOTE, text, "rotors")]
    try:
        hover = hover_time(vehicle, gravity)
    except VehicleError:
        text = (
            "the battery holds no level hover: too little charge, voltage, or power"
            " through its resistance"
        )
        remedy = (
            "more cells or charge, or check battery.resistance (ohm) and"
            " rotors.thrust_table.current (A)"
        )
        return [
            Finding(
                question,
                FAULT,
                text,
                "battery.charge, battery.cells, battery.resistance",
                remedy,
            )
        ]
    # a percent or less counts as an empty battery
    left = f", {hover.charge:.0%} of the charge left" if hover.charge > 0.01 else ""
    text = f"{hover.seconds / 60.0:.3g} min of hover at {hover.power:.3g} W{left}"
    remedy = "more capacity, more cells, or less mass"
    return [
        at_least(
            question,
            hover.seconds,
            text,
            "battery.capacity",
            remedy,
            warning=SHORTEST,
            unit="s",
        )
    ]


def aloft_for(parts: Sequence[FlightPart], payload: float = 0.0) -> list[Finding]:
    """Check result for the battery: a fault if hover endurance with the flight's loads
    is below its duration.

    Args:
        parts: parts of the flight, each with its loads.
        payload: kg, a point mass at the tip in all of them.
    """
    battery = parts[0].vehicle.battery
    seconds = 0.0
    duration = parts[-1].stop
    if battery is None or not parts[0].vehicle.rotors:
        return []
    charge = float(battery.charge)
    for part in parts:
        vehicle = part.vehicle.with_payload(payload) if payload else part.vehicle
        gravity = float(part.scenario.agent.plant.gravity)
        lasts = part.stop - part.start
        if vehicle.battery is None or not _hovers(vehicle, gravity):
            return []  # a fault of the rotors, found elsewhere
        try:
            # the last load hovers until the battery ends, so that the reserve shows
            hover = hover_time(
                replace(vehicle, battery=replace(vehicle.battery, charge=charge)),
                gravity,
                math.inf if part is parts[-1] else lasts,
            )
        except VehicleError:
            if not seconds and not part.words:  # said by time_aloft
                return []
            break
        seconds += hover.seconds
        charge = hover.charge
        if hover.seconds < lasts:
            break
    # a battery that is not full is charged before a larger one is bought
    field = "battery.charge" if float(battery.charge) < 1.0 else "battery.capacity"
    loads = " with its loads" if payload or any(part.words for part in parts) else ""
    text = (
        f"holds a hover{loads} for {seconds:.3g} s, and the flight takes {duration:g} s"
    )
    remedy = f"more of {field}, or a shorter duration"
    return [
        at_least(
            "battery over the flight",
            seconds,
            text,
            field,
            remedy,
            fault=duration,
            unit="s",
        )
    ]


def _hovers(vehicle: Vehicle, gravity: float) -> bool:
    """True if a level hover is possible within the rotors' highest speeds."""
    try:
        trim = hover_trim(vehicle, vehicle.zeros, gravity)
    except AllocationError:
        return False
    if not trim.needs_no_pull:
        return False
    return all(
        float(w) <= float(rotor.max_speed)
        for w, rotor in zip(trim.speeds, vehicle.rotors, strict=True)
    )


STEPS = 2000
"""Number of charge levels between full and empty."""


@positional
class HoverTime:
    """Hover endurance on the battery: time, power, and remaining charge and voltage.

    Attributes:
        seconds: until then. power: W, of the hover.
        charge: share of the capacity that is left: above 0 where the voltage ends it.
        voltage: V, at that time under the load.
    """

    seconds: float
    power: float
    charge: float
    voltage: float


def hover_time(
    vehicle: Vehicle, gravity: float = 9.81, longest: float = math.inf
) -> HoverTime:
    """Endurance of a vehicle in level, motionless hover on its battery, arm at zero,
    until ``longest`` (s).

    The load is constant power P, so that the charge q falls by dq/dt = -P / (V(q)
    capacity); it is summed over the charge by the midpoint rule, until the battery is
    empty, cannot give P (V_0^2 < 4 R P), or its voltage lets a rotor turn no faster
    than the hover takes.

    Raises:
        VehicleError: no battery, or no hover at a full one.
    """
    battery = vehicle.battery
    if battery is None:
        raise VehicleError(
            f"vehicle '{vehicle.name}': battery = (missing): must be a table for a time"
            " aloft"
        )
    trim = hover_trim(vehicle, vehicle.zeros, gravity)
    power = float(battery.power(vehicle.rotors, trim.speeds))
    # a rotor's highest speed falls with the voltage, from that of max_speed
    share = max(
        float(w) / float(r.max_speed)
        for w, r in zip(trim.speeds, vehicle.rotors, strict=True)
    )
    least = share * float(battery.reference_voltage)

    def voltage_at(charge: float) -> float | None:
        """Battery voltage (V) in hover at a state of charge; None if the battery cannot
        supply the hover.
        """
        voltage = float(battery.voltage(charge, power))
        idle = float(battery.open_circuit_voltage(charge))
        gives = idle * idle >= 4.0 * float(battery.resistance) * power
        return voltage if charge > 0.0 and gives and voltage >= least else None

    start = float(battery.charge)
    voltage = voltage_at(start)
    if not trim.needs_no_pull or voltage is None:
        raise VehicleError(
            f"vehicle '{vehicle.name}': battery.charge = {start:g}: must be enough for"
            " a level hover"
        )
    seconds = 0.0
    charge = start
    width = start / STEPS
    for i in range(STEPS):
        middle = voltage_at(start - (i + 0.5) * width)
        if middle is None:
            break
        # a capacity is in A h, and an hour has 3600 s
        lasts = 3600.0 * float(battery.capacity) * width * middle / power
        part = min(1.0, (longest - seconds) / lasts)
        voltage = middle
        charge -= part * width
        seconds += part * lasts
        if part < 1.0:
            # without rounding: a sum below ``longest`` would mean that the battery
            # ended
            seconds = longest
            break
    # the last of many differences may be below 0 by rounding
    return HoverTime(seconds, power, max(charge, 0.0), voltage)
