"""Simulation and metrics of the five cases of Barakou et al. 2026 with both
controllers.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from functools import cache, partial
from itertools import chain, product

import numpy as np

from skyarm.log.flight_log import Log
from skyarm.log.metrics.metric_catalogue import REFERRED
from skyarm.log.metrics.score import score, settling_time
from skyarm.log.metrics.windows import Window, Windows
from skyarm.paper.published import CASES, CONTINUOUS, CONTROLLERS, PAPER, Record
from skyarm.records.files import shipped_tables
from skyarm.records.immutable import positional
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import PLANTS, Scenario
from skyarm.studies.flights import Work
from skyarm.view.pages import Facts

# half-open, on the scenario's clock (READING of the report says how the paper counts)
STEADY, TRANSIENT, GUST = Window(10.0, 20.0), Window(0.0, 8.0), Window(5.0, 20.0)
WINDOWS: Mapping[str, Window] = {
    # the gust comes at 7.5 s, so its window begins before it
    case: GUST if case == "case2_gust" else STEADY
    for case in CASES
}
"""Case -> window of its metrics."""
# the end of the hover: motions begin at 6 s
HOVER = Window(4.0, 5.9)
HOLDS = (Window(9.0, 12.0), Window(16.0, 19.0))
"""Case 1: the last 3 s of each hold of 5 s (7-12 s and 14-19 s)."""

_TABLES = shipped_tables(__file__)
"""Metrics of each case, and the catalogue's names for those of another name."""

Metrics = dict[str, float | None]


@positional
class PaperFlight:
    """One flight of Barakou et al. 2026: a case, a controller ("CT", "PD" or a preset),
    a plant.
    """

    case: str
    controller: str
    plant: str


def flights(plants: Sequence[str] = PLANTS) -> list[PaperFlight]:
    """All flights of Barakou et al. 2026 for the given kinds of simulated plant."""
    return [
        PaperFlight(case, controller, plant)
        for plant, case, controller in product(plants, CASES, CONTROLLERS)
    ]


@cache
def scenario(flight: PaperFlight) -> Scenario:
    """Scenario of one flight: the shipped case with the flight's plant and
    controller.
    """
    return load_scenario(
        flight.case,
        plant=flight.plant,
        controller=CONTROLLERS.get(flight.controller, flight.controller),
    )


STATED = "stated"
"""Name of the settings that the paper states; logs of their flights are kept."""


def work_of(
    flight: PaperFlight,
    planned: Scenario,
    settings: str = STATED,
    holds: tuple[Window, ...] = HOLDS,
) -> Work:
    """Work item of one flight of Barakou et al. 2026, with the metrics of its case.

    Args:
        flight: case, controller and plant.
        planned: scenario of the flight.
        settings: "stated", "inferred", "predicted", or the name of a variation.
        holds: windows in which Case 1 holds its arm.
    """
    return Work(
        label=f"{flight.case} {flight.controller} {flight.plant} ({settings})",
        scenario=planned,
        seed=planned.seed,
        episodes=np.array([planned.episode]),
        fixed={**dataclasses.asdict(flight), "settings": settings},
        alone=True,
        measure=partial(metrics, flight.case, holds=holds),
        keeps_log=settings == STATED,
    )


def metrics(case: str, log: Log, holds: tuple[Window, ...] = HOLDS) -> Metrics:
    """Metrics of a case against the sampled-and-held reference and (suffix
    ``_continuous``) the continuous one.

    ``holds`` are the windows in which Case 1 holds its arm.

    Null where a metric is not defined; all are null for an episode that ended early,
    whose windows are cut.
    """
    measured = {
        name + suffix: _with_suffix(metric, suffix)
        for suffix in ("", CONTINUOUS)
        for name, metric in _metrics_by_name(case).items()
    }
    # a settling time is counted over the whole flight: it is computed by itself below
    names = [m for m in measured.values() if not m.startswith("settling_time")]
    windows = Windows(
        steady=WINDOWS[case], transient=TRANSIENT, gust=GUST, hover=HOVER, holds=holds
    )
    scored = score(log, [*dict.fromkeys(names)], windows)
    if "settling_time" in measured.values():
        scored |= {
            f"settling_time{s}": settling_time(log, STEADY, continuous=bool(s))
            for s in ("", CONTINUOUS)
        }
    # means over cut windows would not compare with those of whole flights
    whole = log.status == "completed"
    return {
        name: scored[metric] if whole and math.isfinite(scored[metric]) else None
        for name, metric in measured.items()
    }


def _metrics_by_name(case: str) -> dict[str, str]:
    """Metrics of a case: name in the published table -> name in skyarm."""
    measured = _TABLES["measured"].get(case, {})
    return {name: measured.get(name, name) for name in _TABLES["rows"][case]}


def _with_suffix(metric: str, suffix: str) -> str:
    """Metric name with a suffix such as ``_continuous``, if the metric depends on the
    reference's form.
    """
    return (
        metric + suffix if metric in REFERRED or metric == "settling_time" else metric
    )


Measured = Mapping[tuple[str, str, str], Metrics]
"""Metrics by (case, controller, plant)."""


def results(
    measured: Measured, settings: Facts, inferred: Measured | None = None
) -> Facts:
    """Published and simulated numbers by case, controller and metric; None if not
    simulated.

    Args:
        measured: metrics by (case, controller, plant).
        settings: settings that determine the numbers.
        inferred: metrics under the inferred settings, which each cell holds by plant.
    """
    experiments: Facts = {case: {} for case in CASES}
    for case, controller in product(CASES, CONTROLLERS):
        published = PAPER[case][controller]
        stated, settled = (
            {plant: each.get((case, controller, plant), {}) for plant in PLANTS}
            for each in (measured, inferred or {})
        )
        experiments[case][controller] = {
            name: {
                "paper": published.get(name),
                **{plant: each.get(name) for plant, each in stated.items()},
                "inferred": {plant: each.get(name) for plant, each in settled.items()},
            }
            for name in dict.fromkeys(chain(published, *stated.values()))
        }
    return {"schema": 1, "experiments": experiments, "settings": settings}


def first_plant(results: Record) -> str:
    """Kind of plant that was simulated first, which differences and figures refer
    to.
    """
    return str(results.get("settings", {}).get("plants", PLANTS)[0])


def settings(logs: Sequence[Log]) -> Facts:
    """Settings behind the results: rates, windows, vehicles, seeds, versions, and
    flights that ended early.
    """
    info = logs[0].info
    same = (
        "plant_vehicle",
        "plant_gravity",
        "model_vehicle",
        "model_gravity",
        "rates_hz",
        "duration",
        "seed",
    )
    windows = {"steady": STEADY, "transient": TRANSIENT, "gust": GUST, "hover": HOVER}
    # all cases fly one vehicle
    truth = load_scenario(CASES[0]).agent.vehicle
    return {
        "plants": list(dict.fromkeys(log.info["plant"] for log in logs)),
        **{name: info[name] for name in same},
        "integrators": {log.info["plant"]: log.info["integrator"] for log in logs},
        "physics_step_s": {
            # one Runge-Kutta step a control period; MuJoCo steps at the physics rate
            "rigid_body": 1.0 / info["rates_hz"]["control"],
            "mujoco": 1.0 / info["rates_hz"]["physics"],
        },
        "joint_damping": [float(joint.damping) for joint in truth.joints],
        "windows_s": {name: [w.start, w.stop] for name, w in windows.items()},
        "holds_s": [[w.start, w.stop] for w in HOLDS],
        "ramp_shape": "linear",
        "not_completed": [
            f"{end['scenario']} {end['controller']} {end['plant']}: {end['status']},"
            f" {end['cause']}"
            for end in (log.info for log in logs)
            if end["status"] != "completed"
        ],
        "versions": info["versions"],
    }


def with_damping(planned: Scenario, damping: float) -> Scenario:
    """Scenario with another viscous damping (N m s/rad) on every joint of the simulated
    vehicle.
    """
    world = dataclasses.replace(
        planned.agent.plant, vehicle=planned.agent.vehicle.with_joints(damping=damping)
    )
    return planned.with_plant(world)
