"""Tables of a vehicle's joints, bodies and rotors, every number with its unit."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from rich.console import RenderableType

from skyarm.cli.terminal_tables import add, shown, table_of, titled
from skyarm.cli.vehicle_facts import record_facts
from skyarm.vehicle.battery import Battery
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle


def tables(vehicle: Vehicle) -> list[RenderableType]:
    """Joints, drives, bodies, rotors, their servos and battery, as far as there are any."""
    found = [_joints(vehicle)] if vehicle.links else []
    if vehicle.drives:
        found.append(_drives(vehicle))
    found.append(_bodies(vehicle))
    if vehicle.rotors:
        found.append(_rotors(vehicle))
    if vehicle.tilts:
        found.append(_tilts(vehicle))
    return found if vehicle.battery is None else [*found, _battery(vehicle.battery)]


def _joints(vehicle: Vehicle) -> RenderableType:
    table = table_of("joint", "moves", "axis", "limits", "effort", "damping", "Coulomb", left=3)
    for link in vehicle.links:
        joint = link.joint
        parent = "base" if link.parent == BASE else vehicle.links[link.parent].name
        turns = joint.kind == "revolute"
        length, effort = ("rad", "N m") if turns else ("m", "N")
        add(
            table,
            joint.name,
            f"{link.name} on {parent}",
            f"{'about' if turns else 'along'} {_numbers(joint.axis)}",
            _interval(float(joint.lower), float(joint.upper), length),
            "no limit" if math.isinf(joint.effort_limit) else f"{_number(joint.effort_limit)} {effort}",
            f"{_number(joint.damping)} {effort} s{'/rad' if turns else '/m'}",
            f"{_number(joint.coulomb)} {effort}",
        )
    return titled("joints", table)


def _drives(vehicle: Vehicle) -> RenderableType:
    table = table_of("joint", "drive", "numbers, SI units", left=3)
    for each in vehicle.drives:
        add(table, each.name, type(each.drive).__name__, _fields(record_facts(each.drive)))
    return titled("drives: what the joints take in place of a torque", table)


def _battery(battery: Battery) -> RenderableType:
    facts = record_facts(battery)
    cell = facts.pop("open_circuit")
    table = table_of("", "", left=2)
    add(table, "numbers: A h, ohm, V, W", _fields(facts))
    rows = zip(cell["charge"], cell["voltage"], strict=True)
    add(table, "a cell's voltage by its charge", ", ".join(f"{shown(v)} V at {q:.0%}" for q, v in rows))
    return titled("battery", table)


def _fields(facts: Mapping[str, Any]) -> str:
    """Names and numbers of a record; those without a limit are left out."""
    held = {name: value for name, value in facts.items() if not (isinstance(value, float) and math.isinf(value))}
    return ", ".join(f"{name} {value if isinstance(value, str) else _number(value)}" for name, value in held.items())


def _bodies(vehicle: Vehicle) -> RenderableType:
    table = table_of("body", "mass, kg", "centre of mass, m", "inertia xx yy zz, kg m^2", "xy xz yz, kg m^2")
    for name, body in zip(("base", *(link.name for link in vehicle.moving)), vehicle.bodies, strict=True):
        i = body.inertia
        across = _numbers((i.xy, i.xz, i.yz))
        add(table, name, _number(body.mass), _numbers(body.com), _numbers((i.xx, i.yy, i.zz)), across)
    return titled("bodies, inertia about the centre of mass in the axes of the link", table)


def _rotors(vehicle: Vehicle) -> RenderableType:
    table = table_of(
        "rotor", "turns", "position, m", "k_f, N s^2/rad^2", "k_m, m", "lag up, down, s", "fastest, rad/s", left=2
    )
    for rotor in vehicle.rotors:
        add(
            table,
            rotor.name,
            "ccw" if rotor.direction > 0 else "cw",
            _numbers(rotor.position),
            _number(rotor.thrust_coefficient, 6),
            _number(rotor.moment_coefficient),
            _numbers((rotor.time_constant_up, rotor.time_constant_down)),
            _number(rotor.max_speed),
        )
    return titled("rotors: thrust = k_f speed^2, drag torque = k_m thrust", table)


def _tilts(vehicle: Vehicle) -> RenderableType:
    table = table_of("rotor", "turned about", "range", "lag, s", "fastest, rad/s", left=2)
    for rotor in vehicle.rotors:
        if rotor.tilt is not None:
            tilt = rotor.tilt
            limits = _interval(float(tilt.lower), float(tilt.upper), "rad")
            add(table, rotor.name, _numbers(tilt.axis), limits, _number(tilt.time_constant), _number(tilt.max_rate))
    return titled("servos that turn rotors, at rest at 0 rad", table)


def _interval(lower: float, upper: float, unit: str) -> str:
    """Limits of a joint; "free" without any."""
    return "free" if math.isinf(lower) and math.isinf(upper) else f"{_number(lower)} ... {_number(upper)} {unit}"


def _numbers(values: Iterable[Any]) -> str:
    return " ".join(_number(value) for value in values)


def _number(value: Any, digits: int = 4) -> str:
    """A number; a limit that there is not is "none"."""
    held = float(value)
    return "none" if math.isinf(held) else shown(held, digits)
