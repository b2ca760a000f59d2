"""Numbers of servos, batteries and rotors' inertias that are allowed and hardly meant."""

from __future__ import annotations

import math
from collections.abc import Iterator

from skyarm.actuation.servo import Servo
from skyarm.vehicle.battery import Battery
from skyarm.vehicle.vehicle_records import Rotor, Vehicle

FASTEST = {"revolute": 500.0, "prismatic": 50.0}
"""rad/s or m/s of a joint without load: servos turn at 2 to 15 rad/s, motors without a gear at some hundred."""

SLOWEST_GOAL = {"revolute": 0.05, "prismatic": 5e-4}
"""rad/s or m/s: slower ones take a minute for half a turn, or for 30 mm."""

BEYOND = 2.0
"""Speed limit over the speed of the motor without load, which it cannot reach."""

MAINS = 1000.0
"""V: a supply of 12 V in millivolts has more."""

SHARE_OF_BASE = 0.5
"""Of the base's largest moment of inertia, of which that of a rotor is a part: propellers have a thousandth."""

DENSEST = 500.0
"""W h for each kg of the vehicle: lithium cells hold 100 to 270, and are a third of a vehicle at most."""

NOMINAL = 3.7
"""V of a lithium cell."""

FEWEST_C = 2.0
"""Current of a short circuit over the capacity, 1/h: packs for flight have some hundred."""

CELL_VOLTAGE = 0.5, 1.5
"""Reference voltage of a cell over its empty and its full open-circuit voltage."""

WORST = 20.0
"""Electrical power over the power of the drag torque: motors have 1.2 to 3."""


def unlikely_in_drives(vehicle: Vehicle) -> Iterator[str]:
    """Lines about a vehicle's servos."""
    kinds = {link.joint.name: link.joint.kind for link in vehicle.links}
    for each in vehicle.drives:
        if isinstance(each.drive, Servo):
            yield from _servo(f"drives.{each.name}", each.drive, kinds[each.name])


def no_load_speed(servo: Servo) -> float:
    """Speed (rad/s or m/s) of a joint at which the motor's counter-voltage is the supply's; infinite without one."""
    return float(servo.voltage) / (float(servo.gear) * float(servo.torque_constant))


def _servo(name: str, servo: Servo, kind: str) -> Iterator[str]:
    unit = "rad/s" if kind == "revolute" else "m/s"
    top, limit = no_load_speed(servo), float(servo.speed_limit)
    if MAINS < float(servo.voltage) < math.inf:
        yield f"{name}.voltage = {float(servo.voltage):g} V: is that of the mains; V, not mV?"
    elif FASTEST[kind] < top < math.inf:
        torque = f"{float(servo.largest_effort()):.3g} {'N m' if kind == 'revolute' else 'N'}"
        yield (
            f"{name}.gear = {float(servo.gear):g}: without load {float(servo.voltage):g} V turn it at {top:.4g} {unit} "
            f"with {torque} at rest; a gear's ratio left out, or its inverse?"
        )
    elif BEYOND * top < limit < math.inf:
        yield (
            f"{name}.torque_constant = {float(servo.torque_constant):g} N m/A: the motor turns no faster than "
            f"{top:.3g} {unit} behind a gear of {float(servo.gear):g}, and speed_limit is {limit:g}; N m/A?"
        )
    if limit < SLOWEST_GOAL[kind]:
        yield f"{name}.speed_limit = {limit:g} {unit}: a move by 1 takes {1.0 / max(limit, 1e-300):.3g} s; {unit}?"


def unlikely_in_supply(vehicle: Vehicle) -> Iterator[str]:
    """Lines about what turns in the rotors and about the battery."""
    i = vehicle.base.inertia
    own = max(float(i.xx), float(i.yy), float(i.zz))
    heavy = [rotor for rotor in vehicle.rotors if float(rotor.inertia) > SHARE_OF_BASE * own]
    if heavy:
        name, value = f"rotors[{heavy[0].name}].inertia", float(heavy[0].inertia)
        yield f"{name} = {value:g} kg m^2: is a part of the base's, which has {own:g}; kg m^2, not g cm^2?"
    if vehicle.battery is not None:
        yield from _battery(vehicle.battery, float(vehicle.mass))
        tables = [rotor for rotor in vehicle.rotors if rotor.table is not None and rotor.table.current]
        yield from _current(vehicle.battery, tables)


def _battery(battery: Battery, mass: float) -> Iterator[str]:
    capacity, resistance = float(battery.capacity), float(battery.resistance)
    energy = battery.cells * NOMINAL * capacity
    full = battery.cells * float(battery.open_circuit.voltage[-1])
    if energy > DENSEST * mass:
        yield (
            f"battery.capacity = {capacity:g} A h: is {energy:.3g} W h in {mass:.3g} kg of vehicle, and lithium cells "
            f"hold 270 a kg; A h, not mA h?"
        )
    elif resistance * FEWEST_C * capacity > full:
        yield (
            f"battery.resistance = {resistance:g} ohm: lets {full / resistance:.3g} A through in a short circuit; "
            f"ohm, not mohm?"
        )
    cell = float(battery.reference_voltage) / battery.cells
    low, high = float(battery.open_circuit.voltage[0]), float(battery.open_circuit.voltage[-1])
    if not CELL_VOLTAGE[0] * low <= cell <= CELL_VOLTAGE[1] * high:
        stated = f"reference_voltage = {float(battery.reference_voltage):g} V"
        yield (
            f"battery.cells = {battery.cells}: {stated} is {cell:.3g} V a cell, "
            f"and a cell has {low:g} to {high:g}; cells in series, volts of the whole pack?"
        )


def _current(battery: Battery, rotors: list[Rotor]) -> Iterator[str]:
    """The table's last row: electrical power against that of the drag torque."""
    for rotor in rotors:
        table = rotor.table
        assert table is not None
        torque = table.torque[-1] if table.torque else float(rotor.moment_coefficient) * table.thrust[-1]
        electrical, turning = table.current[-1] * float(battery.reference_voltage), torque * table.speed[-1]
        if electrical > WORST * turning > 0.0:
            yield (
                f"rotors[{rotor.name}].thrust_table.current = {table.current[-1]:g} A in its last row: is "
                f"{electrical:.3g} W for {turning:.3g} W of the drag torque; A, not mA?"
            )
            return
