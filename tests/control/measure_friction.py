"""Measure what the accelerometer costs on joints with friction that the model lacks: a
table of docs/data/results_laws.md.

    python tests/control/measure_friction.py [--small]

The trial ``circle`` of the envelope at 1 m/s, with viscous friction in the first joint;
mean error of the tip.
"""

import sys
from pathlib import Path

import numpy as np

# the tests' own modules, when run as a program
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from measure_parts import trial

import skyarm
from skyarm.scenario.numbers import with_numbers
from skyarm.studies.compare.envelope_axes import AXES
from skyarm.studies.trial.facts import PAPER
from support.measured_tables import print_part

FRICTION = 0.5
"""N m s/rad."""

CASE = (
    f"circle of 1 m/s, first joint with {FRICTION:g} N m s/rad of friction that the"
    " model lacks"
)
PARTS = {"with the accelerometer": "usual", "without the accelerometer": "velocities"}


def rows(_seeds, _seed):
    """A flight a row."""
    for part, law in PARTS.items():
        batch, numbers = trial("circle", 1.0, law, PAPER)
        path = "plant.vehicle.links.0.joint.damping"
        log = skyarm.run(with_numbers(batch.scenario, numbers | {path: FRICTION}))
        late = log.time >= AXES["circle"].start
        errors = np.linalg.norm(log.tip - log.tip_reference, axis=1)[late]
        yield CASE, part, f"{1e3 * errors.mean():.1f}"


if __name__ == "__main__":
    print_part(
        __doc__,
        {"friction": (("case", "part", ">tip error, mm"), rows)},
        seeds=1,
        seed=0,
    )
