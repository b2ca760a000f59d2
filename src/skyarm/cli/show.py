"""What the commands print."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from skyarm.actuation.hover import highest_thrust, hover_trim
from skyarm.cli.lines import printable
from skyarm.control.presets import PRESETS
from skyarm.control.registry import LAWS
from skyarm.dynamics.arrays import center_of_mass
from skyarm.dynamics.workspace import reach, static_torques
from skyarm.experiments.paper import first_plant
from skyarm.experiments.published import printed
from skyarm.experiments.table import difference, number
from skyarm.simulate import Log
from skyarm.simulate.scenario import PLANTS
from skyarm.simulate.scenario_file import list_scenarios, load_scenario
from skyarm.vehicle.files import list_vehicles, load_vehicle
from skyarm.vehicle.records import BASE, Vehicle

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


NOTHING = 1e-12
"""Numbers below this are rounding and are shown as 0."""


def _table(*columns: str, left: int = 1) -> Table:
    """An open table whose first ``left`` columns hold words and whose others hold numbers."""
    table = Table(box=None, pad_edge=False, show_header=any(columns), header_style="dim")
    for i, column in enumerate(columns):
        table.add_column(Text(column), justify="left" if i < left else "right", overflow="fold")
    return table


def _rows(table: Table, *cells: str) -> None:
    """Add a row of plain text: rich would read [s] in a cell as markup."""
    table.add_row(*(Text(printable(cell)) for cell in cells))


def _titled(title: str, table: Table) -> RenderableType:
    """A title as a line of its own: rich's would wrap at the width of the table."""
    return Group(Text(printable(title), style="bold"), table)


def shown(value: float, digits: int = 3) -> str:
    """Significant digits; rounding errors of zero as 0."""
    return "0" if abs(value) < NOTHING else f"{value:.{digits}g}"


def headline(results: Mapping[str, Any]) -> RenderableType:
    """A dozen numbers of the paper beside ours."""
    table = _table("case", "", "metric", "paper", *PLANTS, "difference", left=3)
    plant = first_plant(results)
    for case, controller, metric in HEADLINE:
        cell = results["experiments"][case][controller][metric]
        ours = (number(cell[each]) for each in PLANTS)
        _rows(table, case, controller, metric, printed(case, controller, metric) or "-", *ours, difference(cell, plant))
    return _titled("paper and ours (m, rad)", table)


def episode(log: Log) -> RenderableType:
    """How an episode ended, and its errors against the continuous reference."""
    import numpy as np

    name, status, end = log.info["scenario"], log.status, log.info["end_time"]
    title = f"{name}: {status} at {end:g} s" + (f": {log.info['cause']}" if log.info["cause"] else "")
    if not log.time.size:
        return Text(printable(title), style="bold")
    last = log.time >= 2.0 / 3.0 * log.time[-1]
    pairs = [("position, m", log.position - log.position_reference)]
    if log.joints.shape[1]:
        pairs.append(("joints, rad or m", log.joints - log.joints_reference))
    if not np.array_equal(log.tool, log.position):
        pairs.append(("end effector, m", log.tool - log.tool_reference))
    table = _table("error", "mean, last third", "max, last third", "max, whole flight")
    for label, error in pairs:
        norm = np.linalg.norm(error, axis=1)
        _rows(table, label, *(shown(float(value), 4) for value in (norm[last].mean(), norm[last].max(), norm.max())))
    return _titled(title, table)


def library() -> RenderableType:
    """Vehicles, scenarios, studies and controllers there are."""
    from skyarm.sweep.study_file import LIBRARY as STUDIES
    from skyarm.sweep.study_file import list_studies

    vehicles = _table("vehicle", "mass, kg", "rotors", "joints")
    for name in list_vehicles():
        v = load_vehicle(name)
        kind = " (model only)" if v.planar else ""
        _rows(vehicles, name + kind, f"{float(v.mass):.3f}", str(len(v.rotors)), str(v.n))
    scenarios = _table("scenario", "what", left=2)
    for name in list_scenarios():
        _rows(scenarios, name, load_scenario(name).title)
    studies = _table("study (skyarm sweep NAME)", "what", left=2)
    for name in list_studies():
        # its title alone: reading the study would read its scenario, too
        _rows(studies, name, str(tomllib.loads((STUDIES / f"{name}.toml").read_text("utf-8")).get("title", "")))
    presets, laws = _table("controller preset (published gains)"), _table("control law", "what", left=2)
    for name in sorted(PRESETS):
        _rows(presets, name)
    for name, entry in LAWS.items():
        _rows(laws, name, entry.title)
    gap = Text("")
    return Group(vehicles, gap, scenarios, gap, studies, gap, presets, gap, laws)


def vehicle_sheet(vehicle: Vehicle, gravity: float) -> RenderableType:
    """Mass, centre of mass, hover, reach and static torques of a vehicle."""
    zero = tuple(0.0 for _ in vehicle.links)
    com = center_of_mass(vehicle, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], zero)
    table = _table("", "", left=2)
    _rows(table, "mass", f"{shown(float(vehicle.mass), 5)} kg")
    millimetres = ", ".join("0" if abs(c) < NOTHING else shown(1e3 * float(c)) for c in com)
    _rows(table, "centre of mass from base origin", f"{millimetres} mm")
    if vehicle.planar:
        _rows(table, "inertia", "planar model: may be believed by a controller, not flown")
    _hover_rows(table, vehicle, gravity)
    if vehicle.links:
        _rows(table, "arm reach from its first joint", _reach(vehicle))
        for link, torque in zip(vehicle.links, static_torques(vehicle, gravity), strict=True):
            unit, limit = "N m" if link.joint.kind == "revolute" else "N", float(link.joint.effort_limit)
            margin = f", limit {limit:g} {unit}" if limit < math.inf else ""
            if margin and torque > NOTHING:
                margin += f", margin {limit / torque:.3g}"
            _rows(table, f"largest static effort of {link.joint.name}", f"{shown(torque)} {unit}{margin}")
        _rows(table, "static efforts", "for a level base, over all joint values")
    sheet = _titled(f"{vehicle.name}, g = {gravity:g} m/s^2, arm at zero", table)
    if not vehicle.sources:
        return sheet
    sources = _table("", "", left=2)
    for field, source in vehicle.sources:
        _rows(sources, field, source)
    return Group(sheet, Text(""), _titled("sources", sources))


def operations_sheet(vehicle: Vehicle) -> RenderableType:
    """Operations of a vehicle's equations and of a step of its plant."""
    from skyarm.bench.counts import counts

    table = _table("", "operations")
    for what, count in counts(vehicle).items():
        _rows(table, what, str(count))
    return _titled(f"{vehicle.name}: additions, products, comparisons ... of one evaluation in calm air", table)


def _reach(vehicle: Vehicle) -> str:
    """Reach of an arm in words."""
    if not vehicle.end_effector:
        return "unknown: no end effector"
    if vehicle.frame().link == BASE:
        return "none: the end effector is fixed to the base"
    return f"{shown(reach(vehicle), 4)} m"


def _hover_rows(table: Table, vehicle: Vehicle, gravity: float) -> None:
    if not vehicle.rotors:
        _rows(table, "rotors", "none")
        return
    trim = hover_trim(vehicle, tuple(0.0 for _ in vehicle.links), gravity)
    if min(float(square) for square in trim.squared) < 0.0:
        _rows(table, "hover", "not possible level: a rotor would have to pull down")
        return
    speeds = sorted({round(float(w), 2) for w in trim.speeds})
    limits = [float(rotor.max_speed) for rotor in vehicle.rotors]
    _rows(table, "hover rotor speed", " ... ".join(f"{w:g}" for w in dict.fromkeys((speeds[0], speeds[-1]))) + " rad/s")
    if any(float(w) > limit for w, limit in zip(trim.speeds, limits, strict=True)):
        _rows(table, "hover", "not possible: a rotor would have to turn faster than its limit")
    top = float(highest_thrust(vehicle))
    if top < math.inf:
        _rows(table, "thrust margin", f"{shown(top / float(trim.thrust))} times its weight ({shown(top, 4)} N)")
