"""Measure how fingers hold a box of 50 g through 10 s of noisy flight.

    python tests/world/contact/measure_fingers.py rigid_body|mujoco [--seeds 20]

A flight of ``examples/pick_with_fingers.toml``: held is a box that is still between the
fingers at 15 s and has crept less than 1 mm, seen from the vehicle, since 5 s, at which
it hangs free. On the plant ``mujoco`` contacts are those of MuJoCo's geoms.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from pathlib import Path

import numpy as np

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[2]))

import skyarm
from skyarm.scenario.scenario_record import Solver
from skyarm.world.scene.vehicle_shapes import rotations_of
from support.measured_tables import print_table

EXAMPLE = Path(__file__).parents[3] / "examples" / "pick_with_fingers.toml"

SOLVERS = {
    "rigid_body": Solver(),
    "mujoco": Solver(kind="mujoco", contact="geoms"),
}

FREE, END = 5.0, 15.0
"""Times (s) between which the creep is measured."""

MOST = 1e-3
"""Creep (m) of a box that is held."""


def creep(plant: str, seed: int) -> float:
    """Way (m) of the box seen from the vehicle; infinite of one that is lost."""
    scenario = skyarm.load_scenario(EXAMPLE, duration=END, seed=seed)
    log = skyarm.run(dataclasses.replace(scenario, solver=SOLVERS[plant]))
    if log.status != "completed" or not np.all(log.collision_force[-1, -2:] > 0.0):
        return np.inf
    first = round(FREE * scenario.rates.control)
    ends = [first, len(log.position) - 1]
    way = (log.object_position - log.position)[ends]
    a, b = (rotations_of(log.quaternion[ends]).transpose(0, 2, 1) @ way[..., None])[
        ..., 0
    ]
    return float(np.linalg.norm(b - a))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("plant", choices=SOLVERS)
    parser.add_argument("--seeds", type=int, default=20)
    given = parser.parse_args()
    crept = [creep(given.plant, seed) for seed in range(given.seeds)]
    held = sum(each < MOST for each in crept)
    print_table(
        ("plant", ">held", ">median creep, mm", ">largest creep, mm"),
        [
            (
                given.plant,
                f"{held} of {len(crept)}",
                f"{1e3 * float(np.median(crept)):.4f}",
                f"{1e3 * max(crept):.4f}",
            )
        ],
    )


if __name__ == "__main__":
    main()
