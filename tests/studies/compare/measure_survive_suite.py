"""Measure the survive suite: the tables of docs/data/results_survive.md.

    python tests/studies/compare/measure_survive_suite.py [--vehicles] [--small]
        [--out out/survive_suite]

Without an option the suite on the paper's vehicle: lost flights and largest tip errors,
law beside law. ``--vehicles`` flies its quick form on further vehicles and counts lost
flights. What was flown is kept in the folder.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[2]))

from skyarm.studies.compare.compare_laws import compare
from skyarm.studies.compare.survive import LAWS, survive_rows, worse_conditions
from skyarm.studies.trial.facts import PAPER
from support.measured_tables import print_row, print_table, progress

VEHICLES = (
    *(
        PAPER,
        "pelican_arm2",
        "quadrotor_roll_arm2",
        "crazyflie_arm1",
        "octo_coaxial_two_arms",
    ),
    *("hexarotor_arm6", "hexarotor12_arm5"),
)


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--vehicles", action="store_true", help="the quick form on further vehicles"
    )
    parser.add_argument("--out", default="out/survive_suite")
    parser.add_argument("--small", action="store_true", help="two conditions: seconds")
    given = parser.parse_args()
    options = {"conditions": ("bump", "turn_round")} if given.small else {}
    with tempfile.TemporaryDirectory() as small:
        folder = Path(small if given.small else given.out)
        heads = [f">`{law}`" for law in LAWS]
        if given.vehicles:
            print_table(["vehicle", *heads, "`centroidal_tip` is lost more often in"])
        for vehicle in (
            VEHICLES[1 : 2 if given.small else None] if given.vehicles else VEHICLES[:1]
        ):
            progress(vehicle)
            out = folder / vehicle
            quick = given.vehicles or given.small
            found = compare(
                "survive-suite", LAWS, out, vehicle=vehicle, quick=quick, **options
            ).document
            if given.vehicles:
                lost = survive_rows(found)[-1][1:]
                print_row([f"`{vehicle}`", *lost, ", ".join(worse_conditions(found))])
            else:
                print_table(["condition", *heads], survive_rows(found))


if __name__ == "__main__":
    main()
