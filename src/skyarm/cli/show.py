"""What the commands print."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from skyarm.actuation.hover import highest_thrust, hover_trim
from skyarm.cli.terminal_tables import NOTHING, add, shown, table_of, titled
from skyarm.cli.vehicle_tables import tables
from skyarm.dynamics.array_front import center_of_mass
from skyarm.dynamics.workspace import reach, search_of, static_torques
from skyarm.paper.flights import first_plant
from skyarm.paper.published import digits, percent, said
from skyarm.scenario.scenario_record import PLANTS
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle

HEADLINE = (
    ("case1", "PD", "held_position_error"),
    ("case2", "CT", "position_error_mean"),
    ("case2", "PD", "position_error_mean"),
    ("case2", "PD", "pitch_rms"),
    ("case3", "CT", "ee_error_mean"),
    ("case3", "PD", "ee_error_mean"),
    ("case2_gust", "CT", "peak_x"),
    ("case2_gust", "PD", "peak_x"),
    ("case3_wind", "CT", "ee_error_mean"),
    ("case3_wind", "PD", "ee_error_mean"),
)
"""Cells of the short table that ``reproduce`` prints; all others are in table2.md."""


def headline(results: Mapping[str, Any]) -> RenderableType:
    """A dozen numbers of the paper beside ours."""
    columns = [f"{which}{each}" for which in ("", "inferred ") for each in PLANTS]
    table = table_of("case", "", "metric", "paper", *columns, "difference", left=3)
    plant = first_plant(results)
    for case, controller, metric in HEADLINE:
        cell = results["experiments"][case][controller][metric]
        ours = (digits(column.get(each)) for column in (cell, cell.get("inferred", {})) for each in PLANTS)
        add(
            table,
            case,
            controller,
            metric,
            said(case, controller, metric) or "-",
            *ours,
            percent(cell.get(plant), cell["paper"]),
        )
    return titled("paper and ours (m, rad)", table)


def vehicle_sheet(vehicle: Vehicle, gravity: float) -> RenderableType:
    """Mass, centre of mass, hover, reach and static torques of a vehicle; its joints, bodies, rotors and sources."""
    zero = tuple(0.0 for _ in vehicle.links)
    com = center_of_mass(vehicle, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], zero)
    table = table_of("", "", left=2)
    add(table, "mass", f"{shown(float(vehicle.mass), 5)} kg")
    millimetres = ", ".join("0" if abs(c) < NOTHING else shown(1e3 * float(c)) for c in com)
    add(table, "centre of mass from base origin", f"{millimetres} mm")
    if vehicle.planar:
        add(table, "inertia", "planar model: may be believed by a controller, not flown")
    add(table, "frames", ", ".join(_frame(vehicle, frame.name) for frame in vehicle.frames) or "none")
    _hover_rows(table, vehicle, gravity)
    if vehicle.links:
        add(table, "arm reach from its first joint", _reach(vehicle))
        for link, torque in zip(vehicle.links, static_torques(vehicle, gravity), strict=True):
            unit, limit = "N m" if link.joint.kind == "revolute" else "N", float(link.joint.effort_limit)
            margin = f", limit {limit:g} {unit}" if limit < math.inf else ""
            if margin and torque > NOTHING:
                margin += f", margin {limit / torque:.3g}"
            add(table, f"largest static effort of {link.joint.name}", f"{shown(torque)} {unit}{margin}")
        add(table, "static efforts", f"for a level base, over {_tried(vehicle.n, vehicle.n)}")
    sheet = titled(f"{vehicle.name}, g = {gravity:g} m/s^2, arm at zero", table)
    parts = [sheet, *tables(vehicle)]
    if vehicle.notes:
        parts.append(titled("notes: what its file says that was left out, or taken in another way", _notes(vehicle)))
    if vehicle.sources:
        sources = table_of("", "", left=2)
        for field, source in vehicle.sources:
            add(sources, field, source)
        parts.append(titled("sources", sources))
    return Group(*(line for part in parts for line in (part, Text(""))))


def _notes(vehicle: Vehicle) -> Table:
    notes = table_of("", left=1)
    for note in vehicle.notes:
        add(notes, note)
    return notes


def operations_sheet(vehicle: Vehicle, found: Mapping[str, int]) -> RenderableType:
    """Operations of a vehicle's equations and of a step of its plant."""
    table = table_of("", "operations")
    for what, count in found.items():
        add(table, what, str(count))
    return titled(f"{vehicle.name}: additions, products, comparisons ... of one evaluation in calm air", table)


def _reach(vehicle: Vehicle) -> str:
    """Reach of an arm in words."""
    if not vehicle.end_effector:
        return "unknown: no end effector"
    if vehicle.frame().link == BASE:
        return "none: the end effector is fixed to the base"
    least = "" if search_of(vehicle.n, 1).whole else f", the largest over {_tried(vehicle.n, 1)}"
    return f"{shown(reach(vehicle), 4)} m{least}"


def _tried(joints: int, quantities: int) -> str:
    """Over which joint values a largest value was sought, in words."""
    search = search_of(joints, quantities)
    if search.whole:
        return "all joint values"
    near = f", and {search.rounds} rounds of {search.around} near the best" if search.rounds else ""
    return f"{search.samples} random joint values{near} (shortened: {joints} joints)"


def _frame(vehicle: Vehicle, name: str) -> str:
    return f"{name} (end effector)" if name == vehicle.end_effector else name


def _hover_rows(table: Table, vehicle: Vehicle, gravity: float) -> None:
    if not vehicle.rotors:
        add(table, "rotors", "none")
        return
    add(table, "rotors", ", ".join(rotor.name for rotor in vehicle.rotors))
    trim = hover_trim(vehicle, tuple(0.0 for _ in vehicle.links), gravity)
    if min(float(square) for square in trim.squared) < 0.0:
        add(table, "hover", "not possible level: a rotor would have to pull down")
        return
    speeds = sorted({round(float(w), 2) for w in trim.speeds})
    limits = [float(rotor.max_speed) for rotor in vehicle.rotors]
    add(table, "hover rotor speed", " ... ".join(f"{w:g}" for w in dict.fromkeys((speeds[0], speeds[-1]))) + " rad/s")
    if any(float(w) > limit for w, limit in zip(trim.speeds, limits, strict=True)):
        add(table, "hover", "not possible: a rotor would have to turn faster than its limit")
    top = float(highest_thrust(vehicle))
    if top < math.inf:
        add(table, "thrust margin", f"{shown(top / float(trim.thrust))} times its weight ({shown(top, 4)} N)")
