"""Measure from which delay of the commands on a vehicle swings in hover: a table of
docs/data/margins.md.

    python tests/studies/stability/measure_delays_that_swing.py [--small]

Next to the margin of the worse linearisation and the delay that the nominal one
predicts.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[2]))

import numpy as np
from swinging_flights import TABLE, hover, swings_from

import skyarm
from skyarm.studies.stability.hover_delay import hover_delay
from support.measured_tables import print_table


def rows(table: Sequence[tuple[str, str, tuple[float, ...]]]) -> Iterator[list[str]]:
    """A vehicle under a law a row."""
    for vehicle, law, joints in table:
        scenario = hover(vehicle, law, joints)
        found = hover_delay(scenario)
        flown = swings_from(scenario, found.swings * np.arange(0.7, 1.35, 0.05))
        title = (
            f"{vehicle} (servos, battery)"
            if skyarm.load_vehicle(vehicle).drives
            else vehicle
        )
        yield [
            title,
            law,
            *(f"{1e3 * each:#.3g}" for each in (found.margin, found.swings, flown)),
        ]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--small", action="store_true", help="one row")
    small = parser.parse_args().small
    heads = (
        "vehicle",
        "law",
        ">margin (the worse), ms",
        ">predicted, ms",
        ">flown, ms",
    )
    print_table(heads, rows(TABLE[1:2] if small else TABLE))


if __name__ == "__main__":
    main()
