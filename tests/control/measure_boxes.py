"""Measure how well the hexarotor places boxes that it grips beside their middle: a table of docs/results_contact.md.

    python tests/control/measure_boxes.py [SEEDS [SEED [KINDS [BANDWIDTH [FRICTION [DWELL]]]]]]

Of each kind of gripper, mass and size: boxes that were picked, carried and stand within 10 mm, and how far they stand
from where they were to be (mean and largest, mm).

BANDWIDTH: option of the law, a factor of all gains. FRICTION: of a ball of 5 mm in its socket, under 60 N. DWELL: s, of
the place.
"""

import sys
from itertools import product

import numpy as np

from skyarm.scenario.scenario_file import scenario_from
from skyarm.simulate.batch import Batch

NOISE = {"position": 1e-3, "velocity": 1e-2, "attitude": 2e-3, "rate": 1e-2, "joints": 1e-3, "joint_rates": 1e-2}
FACE, START, WAY = 0.85, (0.3, -0.2), (0.5, 0.3)
"""m: height of the boxes' tops, where the tip grips, and how far it carries."""
OFF = (
    (0.0, 0.0), (0.01, 0.005), (-0.005, -0.01), (0.02, 0.0), (-0.02, 0.0), (0.0, 0.02), (0.0, -0.02), (-0.014, 0.014),
    (0.014, -0.014),
)  # fmt: skip
"""m, of the box's middle from the tip."""
BOX = "world.objects.box."


def scene(kind, bandwidth, size, mass, friction=0.5, dwell=1.0):
    """A pick and a place of a box on a table."""
    (x, y), (dx, dy) = START, WAY
    phase = {"gripper": "hand", "approach": [0.0, 0.0, 0.15], "dwell": 1.0}
    phases = [
        {"kind": "hold", "duration": 1.0},
        phase | {"kind": "pick", "position": [x, y, FACE - 0.001]},
        phase | {"kind": "place", "dwell": dwell, "position": [x + dx, y + dy, FACE - 0.001]},
        {"kind": "hold", "duration": 1.0},
    ]
    path = {"kind": "phases", "position": [0.2, 0.0, FACE + 0.2], "speed": 0.5, "acceleration": 0.5, "phases": phases}
    return scenario_from({
        "schema": 1, "name": "boxes", "duration": 12.0 + dwell, "plant": {"vehicle": "hexarotor_arm6"},
        "controller": {"law": "centroidal", "mode": "tip", "bandwidth": bandwidth, "load": 0.8},
        "sensors": NOISE, "delays": {"measurement": 0.005},
        "reference": {"tip": {"posture": [0.0, 0.6, -1.0, 0.0, 0.5, 0.0], "path": path}},
        "world": {
            "surfaces": [{"name": "table", "shape": "box", "size": [1.6, 1.6, 0.05], "material": {"friction": 0.5},
                          "position": [0.6, 0.1, FACE - size - 0.025]}],
            "objects": [{"name": "box", "size": [size] * 3, "mass": mass, "standing": True,
                         "position": [x, y, FACE - 0.5 * size + 0.001]}],
            "grippers": [{"name": "hand", "kind": kind, "force": 60.0, "torque": 2.0, "friction": friction}],
        },
    })  # fmt: skip


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
        BOX + "mass": mass, BOX + "position.0": START[0] + x, BOX + "position.1": START[1] + y,
        BOX + "position.2": FACE - 0.5 * size, "world.surfaces.table.position.2": FACE - size - 0.025,
    } | {f"{BOX}size.{axis}": size for axis in range(3)}  # fmt: skip
    large, small = (scene(kind, told[0], *box, *told[1:]) for box in ((0.1, 0.5), (0.04, 0.3)))
    batch = Boxes(large, tuple(values), stiffest=small)
    flown = batch.fly(values, seed=seed, episodes=np.array([row[3] for row in rows]))
    world = next(memory for memory in batch.last.components if hasattr(memory, "grips"))
    body, grip = world.carried[0], world.grips[0]
    away = 1e3 * np.hypot(body.position.x - START[0] - x - WAY[0], body.position.y - START[1] - y - WAY[1])
    stands = np.abs(body.position.z - FACE + 0.5 * size) < 3e-3
    placed = (flown.status == "completed") & stands & (away < 10.0) & (grip.lost < 0.5) & (grip.taken < 0.5)
    for m, s in product((0.3, 0.5), (0.04, 0.1)):
        here = (mass == m) & (size == s)
        ended = here & (flown.status == "completed")
        shown = f"{away[ended].mean():.1f} ({away[ended].max():.1f}) mm" if ended.any() else ""
        print(f"{kind} {1e3 * m:g} g {1e2 * s:g} cm: {placed[here].sum()} of {here.sum()}; {shown}", flush=True)


if __name__ == "__main__":
    words = [*sys.argv[1:], *("2", "211", "magnet,jaw,ball", "1", "0.5", "1")[len(sys.argv) - 1 :]]
    for each in words[2].split(","):
        measure(each, int(words[0]), int(words[1]), float(words[3]), float(words[4]), float(words[5]))
