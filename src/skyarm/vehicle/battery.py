"""Battery model: cells in series with open-circuit voltage and resistance, and the
power that rotors draw.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, Any, Protocol

from skyarm.algebra import Scalar, Scalars
from skyarm.algebra.monotone_curve import curve
from skyarm.algebra.scalars import (
    absolute,
    add,
    divide,
    maximum,
    minimum,
    mul,
    sqrt,
    where,
)
from skyarm.records.coerce import concrete
from skyarm.records.field_rules import accept_fields
from skyarm.records.immutable import immutable
from skyarm.records.units import nonnegative, positive
from skyarm.vehicle.check import VehicleError, refuse, rising
from skyarm.vehicle.thrust_table import ThrustTable

ESC = ("governed", "open")

NO_RESISTANCE, NO_POWER = 1e-12, 1e-12
"""Least resistance (ohm) and power (W) in a denominator: far below those of any pack,
they keep a stated 0 from dividing by 0."""

LEAST = 1e-3
"""Least voltage of an overloaded pack, as a fraction of the voltage without a load: at
zero its iteration would stay for ever."""

HOUR = 3600.0
"""Seconds of an hour."""


@immutable
class CellCurve:
    """Open-circuit voltage of one cell against its charge, by monotone cubic
    interpolation.
    """

    charge: Annotated[
        Scalars,
        nonnegative(
            "", "charge of the cell, as a fraction of the capacity, rising", high=1.0
        ),
    ]
    voltage: Annotated[
        Scalars, nonnegative("V", "open-circuit voltage of one cell at each charge")
    ]

    def __post_init__(self) -> None:
        accept_fields(self, "battery.open_circuit", VehicleError)
        for name in ("charge", "voltage"):
            column = getattr(self, name)
            if len(column) < 2 or len(column) != len(self.charge):
                refuse(
                    f"battery.open_circuit.{name}",
                    column,
                    "must be at least two numbers, as many of both columns",
                )
            rising(f"battery.open_circuit.{name}", column)


class PoweredRotor(Protocol):
    """Interface of a rotor as an electrical load of a battery, such as a
    :class:`skyarm.vehicle.Rotor`.
    """

    @property
    def table(self) -> ThrustTable | None:
        """Measured thrust, drag torque and current against rotor speed; None without
        measurements.
        """

    @property
    def thrust_coefficient(self) -> Scalar:
        """Thrust divided by the square of the rotor speed, N s^2/rad^2."""

    @property
    def moment_coefficient(self) -> Scalar:
        """Drag torque over thrust, m."""


@immutable
class Battery:
    """Battery pack: cells in series with one internal resistance.

    Attributes:
        cells: cells in series. capacity: charge from full to empty. resistance:
            resistance of pack and wires.
        open_circuit: open-circuit voltage of one cell.
        reference_voltage: voltage at which the rotors' highest speeds and thrust tables
            hold. Above it they turn no faster: state the voltage of a full pack with
            its highest speeds if those are known.
        charge: charge at the start, as a share of the capacity.
        standing_power: power of all but the rotors.
        efficiency: mechanical over electrical power of rotors whose table has no
            current.
        esc: "governed": a speed controller holds its speed as long as the voltage
            allows; "open": it holds a throttle, whose speed is proportional to the
            voltage.
    """

    cells: int
    capacity: Annotated[
        Scalar, positive("A h", "charge from full to empty", usual=1000.0)
    ]
    resistance: Annotated[
        Scalar,
        nonnegative(
            "ohm",
            "internal resistance of the whole pack and its wires",
            usual=5.0,
            effect="higher values make the voltage sag more under load",
        ),
    ]
    open_circuit: CellCurve
    reference_voltage: Annotated[
        Scalar,
        positive(
            "V",
            "voltage of the pack for which highest speeds and thrust tables are stated",
        ),
    ]
    charge: Annotated[
        Scalar,
        nonnegative(
            "",
            "charge at the start, as a fraction of the capacity",
            high=1.0,
            begins=True,
        ),
    ] = 1.0
    standing_power: Annotated[
        Scalar,
        nonnegative("W", "power of all consumers except the rotors, such as servos"),
    ] = 0.0
    efficiency: Annotated[
        Scalar,
        nonnegative(
            "",
            "mechanical over electrical power of motors and speed controllers",
            high=1.0,
        ),
    ] = 0.7
    esc: str = "governed"

    def __post_init__(self) -> None:
        accept_fields(self, "battery", VehicleError)
        if self.cells < 1:
            refuse("battery.cells", self.cells, "must be at least 1")
        if self.esc not in ESC:
            refuse("battery.esc", self.esc, f"must be one of {', '.join(ESC)}")
        if concrete(self.efficiency) and not self.efficiency > 0.0:
            refuse(
                "battery.efficiency", self.efficiency, "must be above 0 and at most 1"
            )

    def open_circuit_voltage(self, charge: Scalar) -> Scalar:
        """Voltage of the pack without a load, V."""
        return mul(
            float(self.cells),
            curve(charge, self.open_circuit.charge, self.open_circuit.voltage),
        )

    def power(self, rotors: Sequence[PoweredRotor], speeds: Sequence[Any]) -> Any:
        """Electrical power of the rotors at given speeds (rad/s) and of all other
        loads, W.

        A table's current is that at the reference voltage; without one the drag
        torque's power over the efficiency.
        """
        return rotor_power(
            rotors, speeds, self.efficiency, self.reference_voltage, self.standing_power
        )

    def voltage(self, charge: Scalar, power: Scalar) -> Scalar:
        """Voltage of the pack under a load P (W), V: solution of V = V_0 - R P / V,
        limited to peak power.

        Zero for an empty battery, which is cut off.
        """
        idle = self.open_circuit_voltage(charge)
        # the larger root, on which a light load barely sags; beyond peak power V_0 / 2
        # is left
        under_load = 0.5 * (
            idle + sqrt(maximum(idle * idle - 4.0 * self.resistance * power, 0.0))
        )
        return where(charge > 0.0, under_load, 0.0)

    def discharge(self, charge: Scalar, power: Scalar, seconds: Scalar) -> Scalar:
        """State of charge after supplying a load (W), or the most that the pack gives,
        for a time (s).
        """
        voltage = self.voltage(charge, power)
        # peak power is at half the voltage, where the current is V_0 / 2 R
        most = divide(
            0.5 * self.open_circuit_voltage(charge),
            maximum(self.resistance, NO_RESISTANCE),
        )
        # any positive divisor will do for an empty pack, whose charge is zero anyway
        current = minimum(divide(power, where(voltage > 0.0, voltage, 1.0)), most)
        return self.drain(charge, voltage, current, seconds)

    def drain(
        self, charge: Scalar, voltage: Scalar, current: Scalar, seconds: Scalar
    ) -> Scalar:
        """State of charge after a current (A) has flowed for a time (s); empty at a
        voltage (V) of 0.
        """
        spent = divide(current * seconds, HOUR * self.capacity)
        return maximum(where(voltage > 0.0, charge - spent, 0.0), 0.0)

    def overload(
        self, charge: Scalar, before: Scalar, load: Callable[[Scalar], Scalar]
    ) -> tuple[Scalar, Scalar, Scalar]:
        """Overload of a pack, with its voltage (V) and current (A) then.

        It is overloaded where settled rotors would draw more than its peak power
        V_0^2 / 4 R at half of V_0. What they draw falls with the voltage, as P(V): the
        pack then holds V (V_0 - V) = R P(V) at a voltage below half of V_0. Each call
        takes one step V <- V + V (V (V_0 - V) - R P) / (3 R P): Newton's for P as V^3
        without the slope V_0 - 2 V of the left side, hence shorter, and near from
        above.

        Args:
            charge: fraction of the capacity.
            before: voltage of the period before, V.
            load: power (W) that the rotors draw when they have followed a voltage (V).

        Returns:
            True where settled rotors overload it; voltage and current, which mean
            nothing elsewhere.
        """
        idle = self.open_circuit_voltage(charge)
        half = 0.5 * idle
        # the stable root of the falling load is below V_0 / 2
        now = minimum(before, half)
        resistance = maximum(self.resistance, NO_RESISTANCE)
        asked = resistance * maximum(load(now), NO_POWER)
        voltage = maximum(
            now + now * divide(now * (idle - now) - asked, 3.0 * asked), LEAST * idle
        )
        over: Scalar = self.resistance * load(half) > half * half
        return over, voltage, divide(idle - voltage, resistance)


def rotor_power(
    rotors: Sequence[PoweredRotor],
    speeds: Sequence[Any],
    efficiency: Any,
    voltage: Any,
    standing: Any = 0.0,
) -> Any:
    """Electrical power of rotors at given speeds, plus all other loads, W.

    Args:
        rotors: rotors of a vehicle.
        speeds: their speeds, rad/s.
        efficiency: mechanical over electrical power of motor and ESC, for rotors
            without a table of currents.
        voltage: V, at which such a table was measured.
        standing: power of all other loads, W.
    """
    total = standing
    for rotor, speed in zip(rotors, speeds, strict=True):
        if rotor.table is not None and rotor.table.current:
            total = add(total, rotor.table.current_at(speed) * voltage)
            continue
        # torque of the table without a current: the drag torque's power over the
        # efficiency
        square = speed * speed if rotor.table is None else rotor.table.twist(speed)
        torque = mul(mul(rotor.thrust_coefficient, rotor.moment_coefficient), square)
        total = add(total, divide(mul(torque, absolute(speed)), efficiency))
    return total
