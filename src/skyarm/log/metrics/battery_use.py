"""Charge, voltage and current of the battery over a flight, from the rotor speeds of its log."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.log.flight_log import Log
from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.vehicle_records import Vehicle

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class BatteryUse:
    """Battery use of a flight, a number for each control instant.

    Attributes:
        charge: left, share of the capacity. voltage: V. current: A. power: W.
    """

    charge: Array
    voltage: Array
    current: Array
    power: Array


def battery_use(log: Log, vehicle: Vehicle) -> BatteryUse:
    """Charge, voltage, current and power at every control instant: the loop's own steps, with the logged speeds.

    Args:
        log: of a flight.
        vehicle: the true one, with its battery.

    Raises:
        VehicleError: a vehicle without a battery, or with another number of rotors.
    """
    battery: Any = vehicle.battery
    speeds = np.asarray(log.rotor_speeds)
    if battery is None or speeds.shape[1] != len(vehicle.rotors):
        raise VehicleError(f"vehicle '{vehicle.name}': must have a battery and the rotors of the log")
    charge, rows = float(battery.charge), []
    period = float(log.time[-1] - log.time[0]) / max(len(log.time) - 1, 1)
    for row in speeds:
        power = float(battery.power(vehicle.rotors, [float(w) for w in row]))
        voltage = float(battery.voltage(charge, power))
        rows.append((charge, voltage, power / voltage if voltage > 0.0 else 0.0, power))
        charge = float(battery.discharge(charge, power, period))
    return BatteryUse(*np.array(rows).reshape(len(rows), 4).T)
