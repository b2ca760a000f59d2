"""Hover trim, highest thrust, and time aloft on a battery."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from skyarm import dynamics
from skyarm.algebra import E_Z, ZERO3, Motion
from skyarm.algebra.scalars import Scalar
from skyarm.dynamics.actuators.mixer import make_mixer, mix
from skyarm.dynamics.actuators.rotor import push, speed_of_push
from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.vehicle_records import Vehicle


@dataclass(frozen=True, slots=True)
class HoverTrim:
    """A level hover.

    Attributes:
        speeds: rad/s, one per rotor. squared: the squared speeds the mixer asks for; negative means no such hover.
        thrust: N, the vehicle's weight. efforts: joint torques that hold the arm.
    """

    speeds: tuple[Scalar, ...]
    squared: tuple[Scalar, ...]
    thrust: Scalar
    efforts: tuple[Scalar, ...]


def hover_trim(vehicle: Vehicle, joints: tuple[Scalar, ...], gravity: Scalar) -> HoverTrim:
    """Rotor speeds and joint torques of a level, motionless vehicle with its arm at ``joints``."""
    still = (0.0,) * vehicle.n
    level = Motion(ZERO3, E_Z * gravity)
    force, efforts = dynamics.inverse_dynamics(vehicle, joints, ZERO3, still, level, still)
    speeds, squared = mix(make_mixer(vehicle), force.torque, force.force.z)
    if any(rotor.table is not None for rotor in vehicle.rotors):
        speeds = tuple(speed_of_push(rotor, value) for rotor, value in zip(vehicle.rotors, squared, strict=True))
    return HoverTrim(speeds, squared, force.force.z, efforts)


def highest_thrust(vehicle: Vehicle) -> Any:
    """Thrust along body z with every rotor at its highest speed, N."""
    return sum(r.axis.z * r.thrust_coefficient * push(r, r.max_speed) for r in vehicle.rotors)


STEPS = 2000
"""Of the charge between full and empty."""


@dataclass(frozen=True, slots=True)
class TimeAloft:
    """Endurance: a hover down to the battery's limit.

    Attributes:
        seconds: until then. power: W, of the hover.
        charge: share of the capacity that is left: above 0 where the voltage ends it.
        voltage: V, at that time under the load.
    """

    seconds: float
    power: float
    charge: float
    voltage: float


def time_aloft(vehicle: Vehicle, gravity: float = 9.81, joints: Sequence[Scalar] = ()) -> TimeAloft:
    """Endurance of a level, motionless vehicle in hover on its battery with its arm at ``joints`` (zero if left out).

    The load is constant power P, so that the charge q falls by dq/dt = -P / (V(q) capacity); it is summed over the
    charge by the midpoint rule, until the battery is empty, cannot give P (V_0^2 < 4 R P), or its voltage lets a rotor
    turn no faster than the hover takes.

    Raises:
        VehicleError: no battery, or no hover at a full one.
    """
    battery = vehicle.battery
    if battery is None:
        raise VehicleError(f"vehicle '{vehicle.name}': battery = (missing): must be a table for a time aloft")
    trim = hover_trim(vehicle, tuple(joints) or (0.0,) * vehicle.n, gravity)
    power = float(battery.power(vehicle.rotors, trim.speeds))
    share = max(float(w) / float(r.max_speed) for w, r in zip(trim.speeds, vehicle.rotors, strict=True))
    least = share * float(battery.reference_voltage)

    def voltage_at(charge: float) -> float | None:
        """Voltage at a charge; None where the battery cannot hold the hover."""
        voltage, idle = float(battery.voltage(charge, power)), float(battery.open_circuit_voltage(charge))
        gives = idle * idle >= 4.0 * float(battery.resistance) * power
        return voltage if charge > 0.0 and gives and voltage >= least else None

    start = float(battery.charge)
    voltage = voltage_at(start)
    if min(trim.squared) < 0.0 or voltage is None:
        raise VehicleError(f"vehicle '{vehicle.name}': battery.charge = {start:g}: must be enough for a level hover")
    seconds, charge, width = 0.0, start, start / STEPS
    for i in range(STEPS):
        middle = voltage_at(start - (i + 0.5) * width)
        if middle is None:
            break
        voltage, charge = middle, start - (i + 1) * width
        seconds += 3600.0 * float(battery.capacity) * width * middle / power
    return TimeAloft(seconds, power, max(charge, 0.0), voltage)
