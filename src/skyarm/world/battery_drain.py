"""Battery discharge in flight: charge, voltage, and the rotor speeds that the voltage
allows.
"""

from __future__ import annotations

from collections.abc import Sequence

from skyarm.algebra import Scalar, Scalars
from skyarm.algebra.scalars import (
    clip,
    data,
    divide,
    logical_and,
    logical_or,
    maximum,
    minimum,
    where,
)
from skyarm.compile.tracing.lower import repeat
from skyarm.dynamics.actuators import speeds_after
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.records.immutable import immutable
from skyarm.vehicle import Rotor
from skyarm.vehicle.battery import Battery
from skyarm.world.component import Column, Component

HALVINGS, NEAR = 24, 1e-6
"""Halvings of the voltage's interval, from half to all of that without a load, and
share of it in a difference. The halvings leave 3e-8 of the voltage without a load."""

SETTLED = 3600.0
"""Time (s) after which rotors have followed their commands: far more than any lag."""


@immutable
class BatteryDrain(Component[tuple[Scalar, Scalar]]):
    """Battery model: discharge by the rotors' power, updated once per control
    period.
    """

    battery: Battery
    rotors: tuple[Rotor, ...]

    def start(self, period: float, draws: Sequence[Scalar]) -> tuple[Scalar, Scalar]:
        """Initial battery charge (fraction of the capacity) and open-circuit voltage
        (V).
        """
        charge = data(self.battery.charge)
        return charge, self.battery.voltage(charge, 0.0)

    def supply(
        self,
        memory: tuple[Scalar, Scalar],
        dt: float,
        state: State,
        commands: Sequence[Scalar],
    ) -> tuple[Scalar, Scalar]:
        """Battery charge after the control period, and its voltage under the rotors'
        load.

        The voltage is that at the speeds which the rotors reach with it by the end of
        the period (implicit Euler): one at their speeds before would alternate near the
        peak power, where a volt moves the load by more than itself. The pack is
        overloaded from where these speeds ask for more than its peak power until their
        commands do not: below half of the idle voltage the speeds that follow it take
        less, and would end it in each second period.
        """
        battery = self.battery
        charge, before = memory
        rotors = self.rotors
        idle = battery.open_circuit_voltage(charge)

        def load(voltage: Scalar, seconds: float = dt) -> Scalar:
            """Power (W) of the rotors after they have followed their commands at a
            voltage (V).
            """
            # of the memory only the voltage enters here: the charge may be any number
            received = self.rotor_commands((1.0, voltage), rotors, commands)
            power: Scalar = battery.power(
                rotors, speeds_after(rotors, state.rotor_speeds, received, seconds)
            )
            return power

        def surplus(voltage: Scalar) -> Scalar:
            """Power that the pack gives beyond the load, times its resistance (V^2); it
            falls with the voltage.
            """
            return voltage * (idle - voltage) - battery.resistance * load(voltage)

        def halve(bounds: tuple[Scalar, Scalar]) -> tuple[Scalar, Scalar]:
            """Bounds (V) of the voltage, half as far apart."""
            middle = 0.5 * (bounds[0] + bounds[1])
            enough = surplus(middle) > 0.0
            return where(enough, middle, bounds[0]), where(enough, bounds[1], middle)

        # bisection: it finds the voltage though the surplus has no derivative at limits
        near, _ = repeat(HALVINGS, halve, (0.5 * idle, idle))
        # a step of Newton's, by which a linearisation knows how the voltage follows the
        # rotors
        left = surplus(near)
        aside = NEAR * idle
        # at most -NEAR: the surplus falls with the voltage, its rounded slope might not
        falls = minimum(divide(surplus(near + aside) - left, aside), -NEAR)
        voltage = where(
            # below half of the idle voltage more current would give less power
            charge > 0.0,
            maximum(near - divide(left, falls), 0.5 * idle),
            0.0,
        )
        over, sagged, current = battery.overload(
            charge, before, lambda at: load(at, SETTLED)
        )
        # a step of the throttle is no overload yet, while the rotors have not followed
        # it
        reached = logical_or(before <= 0.5 * idle, surplus(0.5 * idle) < 0.0)
        over = logical_and(logical_and(over, reached), charge > 0.0)
        after = battery.drain(charge, sagged, current, dt)
        return where(over, after, battery.discharge(charge, load(voltage), dt)), where(
            over, sagged, voltage
        )

    def rotor_commands(
        self,
        memory: tuple[Scalar, Scalar],
        rotors: Sequence[Rotor],
        commands: Sequence[Scalar],
    ) -> Sequence[Scalar]:
        """Rotor speed commands (rad/s) at the battery voltage: limited under
        closed-loop speed control, else scaled.
        """
        supply = memory[1] / self.battery.reference_voltage
        pairs = zip(commands, rotors, strict=True)
        if self.battery.esc == "open":
            scaled = [
                (minimum(each, rotor.max_speed) * supply, rotor)
                for each, rotor in pairs
            ]
            # above the reference voltage a rotor stays within its speeds: forwards by
            # its lag, backwards by this
            return [
                maximum(each, rotor.min_speed) if rotor.reversible else each
                for each, rotor in scaled
            ]
        return [
            clip(each, rotor.min_speed * supply, rotor.max_speed * supply)
            for each, rotor in pairs
        ]

    @property
    def columns(self) -> tuple[Column, ...]:  # type: ignore[override]
        """Log columns of battery charge and voltage."""
        charge = Column(
            "battery_charge", "", "", "share of the capacity after the period"
        )
        return charge, Column("battery_voltage", "", "V", "under load")

    def logged(self, memory: tuple[Scalar, Scalar], motion: PointMotion) -> Scalars:
        """Battery charge and voltage as logged values."""
        return memory
