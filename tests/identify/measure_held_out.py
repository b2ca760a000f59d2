"""Predict a published flight from the fit of another: a table of
docs/data/results_identification.md.

python tests/identify/measure_held_out.py            print the table; a minute
python tests/identify/measure_held_out.py --small    after a fit of 3 s
python tests/identify/measure_held_out.py --unpack FOLDER    write flights and start
                                                             file into a folder

Both flights are of NanoBench's Crazyflie and lie in tests/data/flights.
"""

from __future__ import annotations

import argparse
import lzma
import shutil
import sys
import tempfile
import warnings
from collections.abc import Iterator
from pathlib import Path

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[1]))

import skyarm
from skyarm.flight_data.flight_data import load_flight
from skyarm.identify.held_out_errors import HOLD, IDENTIFIED, PAST, START
from skyarm.vehicle.vehicle_text import vehicle_text
from support.measured_tables import print_table
from support.vehicles import FLIGHTS, crazyflie

SEEN, UNSEEN = "B8_star_fast_rep2.csv", "B8_star_fast_rep1.csv"
WORDS = {
    PAST: "identified vehicle, with a constant force and torque added (*with past*)",
    HOLD: "velocity and body rate stay constant (*hold*)",
    IDENTIFIED: "identified vehicle alone (*identified*)",
    START: "start file alone (*start vehicle*)",
}
HORIZON = 0.5
"""s, from the begin of a prediction to the errors of the table."""


def unpack(folder: Path, lines: int | None = None) -> None:
    """Write both flights, the mapping of their columns and the start vehicle into a
    folder.
    """
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(FLIGHTS / "nanobench" / "columns.toml", folder)
    for name in (SEEN, UNSEEN):
        rows = lzma.decompress(
            (FLIGHTS / "nanobench" / f"{name}.xz").read_bytes()
        ).splitlines(keepends=True)
        (folder / name).write_bytes(b"".join(rows[:lines]))
    (folder / "crazyflie.toml").write_text(vehicle_text(crazyflie()), "utf-8")


def rows(lines: int | None) -> Iterator[list[str]]:
    """A predictor a row."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        unpack(Path(folder), lines)
        seen, unseen = (load_flight(Path(folder) / name) for name in (SEEN, UNSEEN))
        options = {
            "held_out": [unseen],
            "full_voltage": 4.2,
            "drag_height": True,
            "despite_faults": True,
        }
        found = skyarm.identify_flights([seen], crazyflie(), **options)
    for name, words in WORDS.items():
        (error,) = (
            each for each in found.held_out.errors[name] if each.horizon == HORIZON
        )
        yield [words, f"{error.position:.3f}", f"{error.attitude:.3f}"]


def main() -> None:
    """Print the table, or write the files."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--small", action="store_true", help="300 samples of each flight"
    )
    parser.add_argument(
        "--unpack",
        metavar="FOLDER",
        type=Path,
        help="write the files, and print no table",
    )
    given = parser.parse_args()
    if given.unpack:
        unpack(given.unpack)
        return
    heads = (
        "how the other flight is predicted",
        ">position after 0.5 s, m",
        ">attitude after 0.5 s, rad",
    )
    print_table(heads, rows(900 if given.small else None))


if __name__ == "__main__":
    main()
