"""Battery discharge in flight: charge, voltage, and the rotor speeds that the voltage allows."""

from __future__ import annotations

from collections.abc import Sequence

from skyarm.algebra import Scalar, Scalars
from skyarm.algebra.scalars import data, logical_and, minimum, where
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.records.immutable import immutable
from skyarm.vehicle import Rotor
from skyarm.vehicle.battery import Battery
from skyarm.world.component import Column, Component


@immutable
class BatteryDrain(Component[tuple[Scalar, Scalar]]):
    """Battery model: discharge by the rotors' power, updated once per control period."""

    battery: Battery
    rotors: tuple[Rotor, ...]

    def start(self, period: float, draws: Sequence[Scalar]) -> tuple[Scalar, Scalar]:
        """Initial battery charge (fraction of the capacity) and open-circuit voltage (V)."""
        charge = data(self.battery.charge)
        return charge, self.battery.voltage(charge, 0.0)

    def supply(
        self, memory: tuple[Scalar, Scalar], dt: float, state: State, commands: Sequence[Scalar]
    ) -> tuple[Scalar, Scalar]:
        """Battery charge after the control period, and its voltage under the rotors' load."""
        battery, (charge, before) = self.battery, memory
        power = battery.power(self.rotors, state.rotor_speeds)
        voltage = battery.voltage(charge, power)
        over, sagged, current = battery.overload(charge, before, lambda at: self._power_at(at, commands))
        over = logical_and(over, charge > 0.0)
        after = battery.drain(charge, sagged, current, dt)
        return where(over, after, battery.discharge(charge, power, dt)), where(over, sagged, voltage)

    def _power_at(self, voltage: Scalar, commands: Sequence[Scalar]) -> Scalar:
        """Power (W) at a voltage (V) of the rotors as fast as they turn under commands, and of all other loads."""
        power: Scalar = self.battery.power(self.rotors, self.rotor_commands((1.0, voltage), self.rotors, commands))
        return power

    def rotor_commands(
        self, memory: tuple[Scalar, Scalar], rotors: Sequence[Rotor], commands: Sequence[Scalar]
    ) -> Sequence[Scalar]:
        """Rotor speed commands (rad/s) at the battery voltage: limited under closed-loop speed control, else scaled."""
        supply = memory[1] / self.battery.reference_voltage
        pairs = zip(commands, rotors, strict=True)
        if self.battery.esc == "open":
            return [minimum(each, rotor.max_speed) * supply for each, rotor in pairs]
        return [minimum(each, rotor.max_speed * supply) for each, rotor in pairs]

    @property
    def columns(self) -> tuple[Column, ...]:  # type: ignore[override]
        """Log columns of battery charge and voltage."""
        charge = Column("battery_charge", "", "", "share of the capacity after the period")
        return charge, Column("battery_voltage", "", "V", "under load")

    def logged(self, memory: tuple[Scalar, Scalar], motion: PointMotion) -> Scalars:
        """Battery charge and voltage as logged values."""
        return memory
