"""Measure how well the hexarotor places boxes that it grips beside their middle: a
table of docs/data/results_contact.md.

    python tests/control/measure_boxes.py [--seeds 2] [--seed 211]
        [--grippers magnet jaw ball] [--bandwidths 1 0.7] [--friction 0.5] [--dwell 1]
        [--small]

Of each kind of gripper, mass and size: boxes that were picked, carried and stand within
10 mm, and how far they stand from where they were to be (mean and largest, mm).

Bandwidth: option of the law, a factor of all gains. Friction: of a ball of 5 mm in its
socket, under 60 N. Dwell: s, of the place.
"""

import argparse
import sys
from itertools import islice, product
from pathlib import Path

import numpy as np

# the tests' own modules, when run as a program
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from skyarm.scenario.scenario_file import scenario_from
from skyarm.simulate.batch import Batch
from support.measured_tables import print_table

NOISE = {
    "position": 1e-3,
    "velocity": 1e-2,
    "attitude": 2e-3,
    "rate": 1e-2,
    "joints": 1e-3,
    "joint_rates": 1e-2,
}
FACE, START, WAY = 0.85, (0.3, -0.2), (0.5, 0.3)
"""m: height of the boxes' tops, where the tip grips, and how far it carries."""
OFF = (
    (0.0, 0.0),
    (0.01, 0.005),
    (-0.005, -0.01),
    (0.02, 0.0),
    (-0.02, 0.0),
    (0.0, 0.02),
    (0.0, -0.02),
    (-0.014, 0.014),
    (0.014, -0.014),
)
"""m, of the box's middle from the tip."""
BOX = "world.objects.box."


def scene(kind, bandwidth, size, mass, friction=0.5, dwell=1.0):
    """A pick and a place of a box on a table."""
    (x, y), (dx, dy) = START, WAY
    phase = {"gripper": "hand", "approach": [0.0, 0.0, 0.15], "dwell": 1.0}
    phases = [
        {"kind": "hold", "duration": 1.0},
        phase | {"kind": "pick", "position": [x, y, FACE - 0.001]},
        phase
        | {
            "kind": "place",
            "dwell": dwell,
            "position": [x + dx, y + dy, FACE - 0.001],
        },
        {"kind": "hold", "duration": 1.0},
    ]
    path = {
        "kind": "phases",
        "position": [0.2, 0.0, FACE + 0.2],
        "speed": 0.5,
        "acceleration": 0.5,
        "phases": phases,
    }
    return scenario_from(
        {
            "schema": 1,
            "name": "boxes",
            "duration": 12.0 + dwell,
            "plant": {"vehicle": "hexarotor_arm6"},
            "controller": {
                "law": "centroidal",
                "mode": "tip",
                "bandwidth": bandwidth,
                "load": 0.8,
            },
            "sensors": NOISE,
            "delays": {"measurement": 0.005},
            "reference": {
                "tip": {"posture": [0.0, 0.6, -1.0, 0.0, 0.5, 0.0], "path": path}
            },
            "world": {
                "surfaces": [
                    {
                        "name": "table",
                        "shape": "box",
                        "size": [1.6, 1.6, 0.05],
                        "material": {"friction": 0.5},
                        "position": [0.6, 0.1, FACE - size - 0.025],
                    }
                ],
                "objects": [
                    {
                        "name": "box",
                        "size": [size] * 3,
                        "mass": mass,
                        "standing": True,
                        "position": [x, y, FACE - 0.5 * size + 0.001],
                    }
                ],
                "grippers": [
                    {
                        "name": "hand",
                        "kind": kind,
                        "force": 60.0,
                        "torque": 2.0,
                        "friction": friction,
                    }
                ],
            },
        }
    )


class Boxes(Batch):
    """A batch that keeps the last state of its worlds."""

    def _fly_legs(self, *told):
        ends, log = super()._fly_legs(*told)
        self.last = ends[-1][0]
        return ends, log


def measure(kind, seeds, seed, *told):
    """All boxes of one gripper in one batch."""
    rows = list(product((0.3, 0.5), (0.04, 0.1), OFF, range(seeds)))
    mass, size = np.transpose([row[:2] for row in rows])
    x, y = np.transpose([row[2] for row in rows])
    values = {
        BOX + "mass": mass,
        BOX + "position.0": START[0] + x,
        BOX + "position.1": START[1] + y,
        BOX + "position.2": FACE - 0.5 * size,
        "world.surfaces.table.position.2": FACE - size - 0.025,
    } | {f"{BOX}size.{axis}": size for axis in range(3)}
    large, small = (
        scene(kind, told[0], *box, *told[1:]) for box in ((0.1, 0.5), (0.04, 0.3))
    )
    batch = Boxes(large, tuple(values), stiffest=small)
    flown = batch.fly(values, seed=seed, episodes=np.array([row[3] for row in rows]))
    world = next(memory for memory in batch.last.components if hasattr(memory, "grips"))
    body, grip = world.carried[0], world.grips[0]
    away = 1e3 * np.hypot(
        body.position.x - START[0] - x - WAY[0], body.position.y - START[1] - y - WAY[1]
    )
    stands = np.abs(body.position.z - FACE + 0.5 * size) < 3e-3
    placed = (
        (flown.status == "completed")
        & stands
        & (away < 10.0)
        & (grip.lost < 0.5)
        & (grip.taken < 0.5)
    )
    for m, s in product((0.3, 0.5), (0.04, 0.1)):
        here = (mass == m) & (size == s)
        ended = here & (flown.status == "completed")
        sizes = (
            [float(each) for each in (away[ended].mean(), away[ended].max())]
            if ended.any()
            else []
        )
        shown = [
            f"{each:.0f}" if each > 99.95 else f"{each:.1f}" for each in sizes
        ] or ["", ""]
        yield (
            kind,
            f"{1e3 * m:g}",
            f"{1e2 * s:g}",
            f"{told[0]:g}",
            f"{placed[here].sum()} of {here.sum()}",
            *shown,
        )


HEADS = (
    "gripper",
    "mass, g",
    "size, cm",
    "`bandwidth`",
    "placed",
    "distance from the goal, mm",
    "largest, mm",
)


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--seed", type=int, default=211)
    parser.add_argument("--grippers", nargs="+", default=["magnet", "jaw", "ball"])
    parser.add_argument("--bandwidths", nargs="+", type=float, default=[1.0, 0.7])
    parser.add_argument("--friction", type=float, default=0.5)
    parser.add_argument("--dwell", type=float, default=1.0)
    parser.add_argument(
        "--small",
        action="store_true",
        help="one gripper, one flight of each box: seconds",
    )
    given = parser.parse_args()
    told = (1 if given.small else given.seeds, given.seed)
    ways = product(given.bandwidths, given.grippers)
    batches = (
        measure(kind, *told, bandwidth, given.friction, given.dwell)
        for bandwidth, kind in ways
    )
    print_table(
        HEADS,
        (row for batch in islice(batches, 1 if given.small else None) for row in batch),
    )


if __name__ == "__main__":
    main()
