"""Fly the paper's five experiments with both controllers and measure them as the paper does."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.experiments.published import CASES, CONTROLLERS, PAPER
from skyarm.simulate import Log, Scenario, Window, run
from skyarm.simulate import metrics as m
from skyarm.simulate.scenario import PLANTS
from skyarm.simulate.scenario_file import load_scenario

STEADY, TRANSIENT, GUST = Window(10.0, 20.0), Window(0.0, 8.0), Window(5.0, 20.0)
WINDOWS: Mapping[str, Window] = {case: GUST if case == "case2_gust" else STEADY for case in CASES}
"""Where each case is measured."""
HOVER = Window(4.0, 5.9)
HOLDS = (Window(9.0, 12.0), Window(16.0, 19.0))
"""Case 1: the last 3 s of each hold of 5 s (7-12 s and 14-19 s)."""

CONTINUOUS = "_continuous"
"""Suffix of a metric taken against the continuous reference in place of the held 50 Hz samples."""

Metrics = dict[str, float | None]


@dataclass(frozen=True, slots=True)
class Flight:
    """One episode of the paper: a case, a controller ("CT", "PD" or a preset), a plant."""

    case: str
    controller: str
    plant: str


def flights(plants: Sequence[str] = PLANTS) -> list[Flight]:
    """All episodes of the paper on the given plants."""
    return [Flight(case, controller, plant) for plant in plants for case in CASES for controller in CONTROLLERS]


def scenario(flight: Flight) -> Scenario:
    """The scenario of a flight; nothing but plant and controller is chosen here."""
    return load_scenario(
        flight.case, plant=flight.plant, controller=CONTROLLERS.get(flight.controller, flight.controller)
    )


def fly(flight: Flight, change: Callable[[Scenario], Scenario] | None = None) -> Log:
    """Fly it, optionally with a changed scenario."""
    planned = scenario(flight)
    return run(change(planned) if change else planned)


def metrics(case: str, log: Log) -> Metrics:
    """Metrics of a case, each against the held and (suffix ``_continuous``) the continuous reference.

    Null where a metric is not defined; all are null for an episode that ended early, whose windows are cut.
    """
    found: dict[str, float] = {}
    for suffix, errors in (("", m.Errors.held(log)), (CONTINUOUS, m.Errors.continuous(log))):
        found |= {name + suffix: value for name, value in _of_case(case, log, errors).items()}
    whole = log.status == "completed"
    return {name: value if whole and math.isfinite(value) else None for name, value in found.items()}


def _of_case(case: str, log: Log, errors: m.Errors) -> dict[str, float]:
    window = WINDOWS[case]
    found = m.motion(log, window) | {"hover_offset": m.hover_offset(log, HOVER)}
    if case == "case2_gust":
        return m.gust(log, errors, window) | found
    if case == "case3_wind":
        return m.constant_wind(log, errors, window, TRANSIENT) | found
    found |= m.steady_and_transient(log, errors, window, TRANSIENT)
    if case == "case1":
        found["held_position_error"] = m.held_position_error(log, errors, HOLDS)
        found["settling_time_upper_bound"] = found["settling_time"]
    return found


def results(measured: dict[tuple[str, str, str], Metrics], settings: dict[str, Any]) -> dict[str, Any]:
    """The table of all cells: paper, rigid_body, mujoco; a plant that was not flown is null.

    Args:
        measured: metrics by (case, controller, plant).
        settings: what the numbers depend on.
    """
    experiments: dict[str, Any] = {}
    for case in CASES:
        experiments[case] = {}
        for controller in CONTROLLERS:
            ours = {plant: measured.get((case, controller, plant), {}) for plant in PLANTS}
            names = list(PAPER[case][controller])
            names += [name for plant in PLANTS for name in ours[plant] if name not in names]
            experiments[case][controller] = {
                name: {"paper": PAPER[case][controller].get(name)} | {p: ours[p].get(name) for p in PLANTS}
                for name in dict.fromkeys(names)
            }
    return {"schema": 1, "experiments": experiments, "settings": settings}


def first_plant(results: Mapping[str, Any]) -> str:
    """The plant that flew first: the one that differences, reasons and figures speak of."""
    named = results.get("settings", {}).get("plants")
    if named:
        return str(named[0])
    cells = [cell for case in results.get("experiments", {}).values() for c in case.values() for cell in c.values()]
    return next((plant for plant in PLANTS if any(cell.get(plant) is not None for cell in cells)), PLANTS[0])


def settings(logs: Sequence[Log]) -> dict[str, Any]:
    """What the results depend on: rates, windows, vehicles, seeds, versions, how episodes ended."""
    info = logs[0].info
    same = ("plant_vehicle", "plant_gravity", "model_vehicle", "model_gravity", "rates_hz", "duration", "seed")
    windows = {"steady": STEADY, "transient": TRANSIENT, "gust": GUST, "hover": HOVER}
    truth = load_scenario(CASES[0]).world.vehicle
    return {
        "plants": list(dict.fromkeys(log.info["plant"] for log in logs)),
        **{name: info[name] for name in same},
        "integrators": {log.info["plant"]: log.info["integrator"] for log in logs},
        "physics_step_s": {
            "rigid_body": 1.0 / info["rates_hz"]["control"],
            "mujoco": 1.0 / info["rates_hz"]["physics"],
        },
        "joint_damping": [float(link.joint.damping) for link in truth.links],
        "windows_s": {name: [w.start, w.stop] for name, w in windows.items()},
        "holds_s": [[w.start, w.stop] for w in HOLDS],
        "ramp_shape": "linear",
        "not_completed": [
            f"{end['scenario']} {end['controller']} {end['plant']}: {end['status']}, {end['cause']}"
            for end in (log.info for log in logs)
            if end["status"] != "completed"
        ],
        "versions": info["versions"],
    }


def with_damping(planned: Scenario, damping: float) -> Scenario:
    """The scenario with another viscous damping (N m s/rad) on every joint of the truth."""
    world = dataclasses.replace(planned.world, vehicle=planned.world.vehicle.with_joints(damping=damping))
    return dataclasses.replace(planned, world=world)
