"""Measure how well the centroidal law presses: tables of
docs/data/results_contact.md, a batch a row or several.

    python tests/control/measure_pressing.py pushes|approaches
        [--seeds 20] [--seed 5] [--small]

``pushes``: completed flights, error and ripple of the force, and error of the tip
across the normal, mean and largest over the flights. ``approaches``: completed flights
at four speeds of approach.
"""

import sys
from pathlib import Path

import numpy as np

# the tests' own modules, when run as a program
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from measure_pressing_scenes import scene

import skyarm
from skyarm.simulate.batch import Batch
from support.measured_tables import mean_and_largest, print_part

FORCE, SPEED = "reference.push.force.value", "reference.push.speed"
SPEEDS = (0.1, 0.2, 0.3, 0.5)
"""m/s, of an approach."""


def fly(name, rows, seeds, seed, **about):
    """Every row in every seed, all in one batch: of each row the completed flights, and
    sizes of its metrics.
    """
    scenario = scene(name, **about)
    count = seeds if about.get("noisy", True) else 1
    paths = tuple(dict.fromkeys(path for row in rows for path in row))
    values = {path: np.repeat([row[path] for row in rows], count) for path in paths}
    batch = Batch(
        scenario,
        paths,
        metrics=("contact", "standard"),
        effort=0 if len(rows) * count < 40 else 2,
    )
    flown = batch.fly(values, seed=seed, episodes=np.tile(np.arange(count), len(rows)))
    for k in range(len(rows)):
        lanes = slice(k * count, (k + 1) * count)
        ended = int((np.asarray(flown.status)[lanes] == "completed").sum())
        yield (
            ended,
            count,
            {key: np.abs(column[lanes]) for key, column in flown.metrics.items()},
        )


def rows_of(title, name, rows, seeds, seed, **about):
    """Lines of the table of pushes."""
    for row, (ended, count, size) in zip(
        rows, fly(name, rows, seeds, seed, **about), strict=True
    ):
        force, ripple = size["contact_error_mean"], size["contact_ripple"]
        across = mean_and_largest(1e3 * size["contact_tip_mean"], 1)
        numbers = [*mean_and_largest(force, 3), *mean_and_largest(ripple, 3), *across]
        yield title, f"{row[FORCE]:g}", f"{ended} of {count}", *numbers


def weak_rotors():
    """Values of rotors that are 10 % weaker than nominal."""
    rotors = enumerate(skyarm.load_vehicle("hexarotor_arm6").rotors)
    return {
        f"plant.vehicle.rotors.{i}.thrust_coefficient": (
            0.9 * float(r.thrust_coefficient)
        )
        for i, r in rotors
    }


def pushes(seeds, seed):
    """Holding and sliding."""
    told, weak, turn = (seeds, seed), weak_rotors(), np.radians(10.0)
    hold, hard = [{FORCE: 1.0}, {FORCE: 2.0}], [{FORCE: 5.0}]
    yield from rows_of(
        "arm2, perfect state",
        "arm2",
        hold[:1],
        *told,
        noisy=False,
    )
    yield from rows_of("arm2, perfect state", "arm2", hold[1:], *told, noisy=False)
    yield from rows_of("arm2", "arm2", hold, *told)
    yield from rows_of(
        "arm6, rotors 10 % weaker than nominal",
        "arm6",
        [{FORCE: force, **weak} for force in (2.0, 5.0, 10.0)],
        *told,
    )
    yield from rows_of(
        "arm2 slides 0.5 m up at 0.1 m/s", "arm2", hold[:1], *told, slide=0.5
    )
    yield from rows_of(
        "arm6 slides 0.5 m up, friction 0.6",
        "arm6",
        hard,
        *told,
        friction=0.6,
        slide=0.5,
    )
    for side, y, z in (
        ("to the left", np.sin(turn), 0.0),
        ("downwards", 0.0, -np.sin(turn)),
    ):
        title = f"arm6 slides 0.3 m, normal 10 degrees off {side}"
        yield from rows_of(
            title, "arm6", hard, *told, slide=0.3, normal=(-np.cos(turn), y, z)
        )


def approaches(seeds, seed):
    """Completed flights, all speeds of a force together."""
    for name, forces in (("arm2", (1.0, 2.0)), ("arm6", (2.0, 5.0, 10.0))):
        for force in forces:
            hits = [{FORCE: force, SPEED: speed} for speed in SPEEDS]
            flown = list(fly(name, hits, seeds, seed, ahead=0.24, duration=7.0))
            ended, count = (sum(each[k] for each in flown) for k in (0, 1))
            yield (
                name,
                f"{force:g}",
                ", ".join(f"{speed:g}" for speed in SPEEDS),
                f"{ended} of {count}",
            )


TABLES = {
    "pushes": (
        (
            *(
                "case",
                "force, N",
                "completed",
                "mean error, N",
                "largest error",
                "ripple, N",
            ),
            *("largest ripple", "tip across, mm", "largest across"),
        ),
        pushes,
    ),
    "approaches": (("vehicle", "force, N", "approach, m/s", "completed"), approaches),
}

if __name__ == "__main__":
    print_part(__doc__, TABLES, seeds=20, seed=5)
