"""What the commands print."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table

from skyarm.actuation.hover import highest_thrust, hover_trim
from skyarm.control.presets import PRESETS
from skyarm.control.registry import LAWS
from skyarm.dynamics.arrays import center_of_mass
from skyarm.dynamics.workspace import reach, static_torques
from skyarm.experiments.table import TITLES, difference, number
from skyarm.simulate import Log
from skyarm.simulate.scenario_file import list_scenarios, load_scenario
from skyarm.vehicle.files import list_vehicles, load_vehicle
from skyarm.vehicle.records import Vehicle

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


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for i, column in enumerate(columns):
        table.add_column(column, justify="left" if i == 0 else "right")
    return table


def headline(results: Mapping[str, Any]) -> RenderableType:
    """A dozen numbers of the paper beside ours."""
    table = _table("Paper and ours (m, rad)", "", "paper", "rigid_body", "mujoco", "difference")
    for case, controller, metric in HEADLINE:
        cell = results["experiments"][case][controller][metric]
        cells = (number(cell[key]) for key in ("paper", "rigid_body", "mujoco"))
        table.add_row(f"{TITLES[case]}: {controller} {metric}", *cells, difference(cell))
    return table


def episode(log: Log) -> RenderableType:
    """How an episode ended and its errors over the last third."""
    import numpy as np

    table = _table(f"{log.info['scenario']}: {log.status}", "", "mean", "max")
    if log.info["cause"]:
        table.title = f"{log.info['scenario']}: {log.status} at {log.info['end_time']:g} s: {log.info['cause']}"
    last = log.time >= 2.0 / 3.0 * log.info["duration"]
    if last.any():
        table.title = f"{table.title}; errors over the last third"
        pairs = (
            ("position, m", log.position - log.position_reference),
            ("joints, rad or m", log.joints - log.joints_reference),
            ("end effector, m", log.tool - log.tool_reference),
        )
        for name, error in pairs:
            norm = np.linalg.norm(error[last], axis=1)
            table.add_row(name, f"{norm.mean():.4g}", f"{norm.max():.4g}")
    return table


def library() -> RenderableType:
    """Vehicles, scenarios and controllers there are."""
    vehicles = _table("vehicles", "name", "mass kg", "rotors", "joints")
    for name in list_vehicles():
        v = load_vehicle(name)
        kind = " (model only)" if v.planar else ""
        vehicles.add_row(name + kind, f"{float(v.mass):.3f}", str(len(v.rotors)), str(v.n))
    scenarios = _table("\nscenarios", "name", "what")
    for name in list_scenarios():
        scenarios.add_row(name, load_scenario(name).title)
    controllers = _table("\ncontrollers", "preset (published gains)", "law")
    presets, laws = sorted(PRESETS), sorted(LAWS)
    for i in range(max(len(presets), len(laws))):
        controllers.add_row(presets[i] if i < len(presets) else "", laws[i] if i < len(laws) else "")
    return Group(vehicles, scenarios, controllers)


def vehicle_sheet(vehicle: Vehicle, gravity: float) -> RenderableType:
    """Mass, centre of mass, hover, reach and static torques of a vehicle."""
    zero = tuple(0.0 for _ in vehicle.links)
    com = center_of_mass(vehicle, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], zero)
    table = _table(f"{vehicle.name}, g = {gravity:g} m/s^2, arm at zero", "", "")
    table.add_row("mass", f"{float(vehicle.mass):.5g} kg")
    table.add_row("centre of mass from base origin", ", ".join(f"{1e3 * c:.3g}" for c in com) + " mm")
    if vehicle.planar:
        table.add_row("inertia", "planar model: may be believed by a controller, not flown")
    _hover_rows(table, vehicle, gravity)
    if vehicle.links:
        table.add_row("arm reach from its first joint", f"{reach(vehicle):.4g} m")
        for link, torque in zip(vehicle.links, static_torques(vehicle, gravity), strict=True):
            unit, limit = "N m" if link.joint.kind == "revolute" else "N", float(link.joint.effort_limit)
            margin = f", limit {limit:g}, margin {limit / torque:.3g}" if torque > 0.0 and limit < 1e300 else ""
            table.add_row(f"largest static effort of {link.joint.name}", f"{torque:.3g} {unit}{margin}")
    sources = _table("\nsources", "field", "from")
    sources.columns[1].justify = "left"
    for field, text in vehicle.sources:
        sources.add_row(field, text)
    return Group(table, sources) if vehicle.sources else table


def _hover_rows(table: Table, vehicle: Vehicle, gravity: float) -> None:
    if not vehicle.rotors:
        table.add_row("rotors", "none")
        return
    trim = hover_trim(vehicle, tuple(0.0 for _ in vehicle.links), gravity)
    speeds = sorted({round(float(w), 2) for w in trim.speeds})
    if min(float(square) for square in trim.squared) < 0.0:
        table.add_row("hover", "not possible level: a rotor would have to pull down")
        return
    table.add_row("hover rotor speed", " ... ".join(f"{w:g}" for w in speeds[:: max(1, len(speeds) - 1)]) + " rad/s")
    top = float(highest_thrust(vehicle))
    if top < 1e300:
        table.add_row("thrust margin", f"{top / float(trim.thrust):.3g} times its weight ({top:.4g} N)")
