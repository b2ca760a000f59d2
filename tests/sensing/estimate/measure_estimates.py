"""Measure the tip error in Case 3 on estimates: the table *Measured* of
docs/sensors.md.

    python tests/sensing/estimate/measure_estimates.py [--seeds 20] [--seed 4711]
        [--small]

Mean over 10 to 20 s and the seeds, from the held reference; with perfect state one
flight.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[2]))

from case3_on_estimates import CASE3, SLOW, tip_errors

import skyarm
from support.flights import estimated
from support.measured_tables import print_part


def rows(seeds: int, seed: int) -> Iterator[list[str]]:
    """Sources of the force a row, sensors a column."""
    for force in ("measured", "modelled"):
        flown = (
            estimated(**CASE3, **slow, estimator__force=force) for slow in ({}, SLOW)
        )
        yield [
            f'`force = "{force}"`',
            *(f"{1e3 * tip_errors(each, seeds, seed).mean():.1f}" for each in flown),
        ]
    log = skyarm.run(
        skyarm.load_scenario("case3", controller="centroidal_tip", duration=20.0)
    )
    perfect = f"{1e3 * skyarm.score(log, ['ee_error_mean'])['ee_error_mean']:.1f}"
    yield ["perfect state", perfect, perfect]


HEADS = (
    "mean tip error",
    "pose at 50 Hz, none lost, mm",
    "pose at 10 Hz, a fifth lost in runs of 200 ms, mm",
)

if __name__ == "__main__":
    print_part(__doc__, {"tip": (HEADS, rows)}, seeds=20, seed=4711)
