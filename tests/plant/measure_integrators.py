"""Error of the integrators in closed-loop flights: a table of docs/mathematics.md.

python tests/plant/measure_integrators.py            print the table
python tests/plant/measure_integrators.py --small    two rows, flights of 2 s

Largest difference of a whole flight from the same flight with Runge-Kutta steps of
0.125 ms.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np

sys.path += [
    str(Path(__file__).parents[1]),
    str(Path(__file__).parents[1] / "studies" / "bench"),
]

from bench_engines import REFERENCE_STEP, Flight

import skyarm
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.plant.compiled import Steps
from skyarm.records.arrays import Array
from support.measured_tables import print_table

CASES = ("case3", "case2_gust")
ROWS = (
    ("rigid_body", "rk4", 5.0),
    ("rigid_body", "rk4", 2.5),
    ("rigid_body", "rk4", 1.0),
    ("rigid_body", "euler", 1.0),
    ("mujoco", "rk4", 1.0),
    ("mujoco", "rk4_staged", 1.0),
)
"""Plant, integrator and step, ms; the first is the default."""

FIRST_JOINT = 3 + 4 + 3 + 3
"""Numbers of a state before its joints: position, quaternion, velocity and rate."""

Positions = tuple[Array, Array]
"""Of the base, m, and of the joints, rad, at every control period."""


def stepped(scenario: skyarm.Scenario, step: float) -> Positions:
    """Flight of the rigid body with Runge-Kutta steps of ``step`` seconds."""
    flight = Flight.of(scenario, lambda seconds: Steps(round(seconds / step)))
    _, log = Kernel(flight.loop, Lanes(1), logging=True).run(
        flight.carry[:, None], flight.parameters[:, None], flight.rows
    )
    return (
        log[:, :3, 0],
        log[:, FIRST_JOINT : FIRST_JOINT + scenario.plant.vehicle.n, 0],
    )


def flown(
    plant: str, integrator: str, step: float, scenario: skyarm.Scenario
) -> Positions:
    """Flight of a row."""
    if (plant, integrator) == ("rigid_body", "rk4"):
        return stepped(scenario, 1e-3 * step)
    log = skyarm.run(dataclasses.replace(scenario, kind=plant, integrator=integrator))
    return log.position, log.joints


def rows(seconds: float | None) -> Iterator[list[str]]:
    """A row for each integrator: largest differences of base, mm, and joints, mrad, in
    every case.
    """
    scenarios = [
        skyarm.load_scenario(case, controller="paper_ct", duration=seconds)
        for case in CASES
    ]
    exact = [stepped(scenario, REFERENCE_STEP) for scenario in scenarios]
    for plant, integrator, step in ROWS:
        cells = []
        for scenario, finest in zip(scenarios, exact, strict=True):
            for mine, theirs in zip(
                flown(plant, integrator, step, scenario), finest, strict=True
            ):
                farthest = float(
                    np.linalg.norm(mine[: len(theirs)] - theirs, axis=1).max()
                )
                cells.append(f"{1e3 * farthest:.1g}")
        yield [f"`{plant}`", f"`{integrator}`", f"{step:g}", *cells]


HEADS = (
    "plant",
    "integrator",
    ">step, ms",
    *(f">`{case}`: {what}" for case in CASES for what in ("base, mm", "joints, mrad")),
)

if __name__ == "__main__":
    small = "--small" in sys.argv[1:]
    print_table(HEADS, islice(rows(2.0 if small else None), 2 if small else None))
