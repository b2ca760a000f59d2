"""Battery drain during a flight: its charge and voltage are memory of the loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.algebra.scalars import data
from skyarm.dynamics.state import State
from skyarm.vehicle.battery import Battery
from skyarm.vehicle.vehicle_records import Rotor
from skyarm.world.component import Component


@dataclass(frozen=True, kw_only=True, slots=True)
class BatteryDrain(Component):
    """The rotors' load on the battery, once per control period at the speeds at its beginning."""

    battery: Battery
    rotors: tuple[Rotor, ...]

    def start(self, period: float, draws: Sequence[Any]) -> tuple[Any, Any]:
        """Charge (share of the capacity) and voltage (V) without a load."""
        charge = data(self.battery.charge)
        return charge, self.battery.voltage(charge, 0.0)

    def advance(self, memory: Any, t: Any, dt: float, state: State, draws: Sequence[Any]) -> tuple[Any, Any]:
        """Charge after the period; the voltage under its load."""
        power = self.battery.power(self.rotors, state.rotor_speeds)
        return self.battery.discharge(memory[0], power, dt), self.battery.voltage(memory[0], power)
