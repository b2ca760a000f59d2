"""Measure what a tuning gains: the table of docs/data/tuning.md.

    python tests/studies/tune/measure_tuning.py [--small]

Gains of ``centroidal_tip`` for Case 3 before and after a search of the default effort,
on plants and along a path by which nothing was chosen.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[2]))

import skyarm
from skyarm.studies.tune.subject import SearchSizes
from support.measured_tables import print_table, progress


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--small", action="store_true", help="a search of seconds")
    effort = {"candidates": 132, "plants": 4} if parser.parse_args().small else {}
    found = skyarm.tune(
        "case3",
        "centroidal_tip",
        progress=lambda *words: progress(" ".join(map(str, words))),
        **effort,
    )
    after, before = (
        found.aside["pick"],
        next(each for name, each in found.aside.items() if name != "pick"),
    )
    rows = [
        (
            "tip error, 90 % quantile, mm",
            *(f"{1e3 * each.tip:.3g}" for each in (before, after)),
        ),
        ("rotor jitter, rad/s", *(f"{each.jitter:.2g}" for each in (before, after))),
        (
            "lost plants",
            *(f"{SearchSizes().aside * each.lost:.0f}" for each in (before, after)),
        ),
    ]
    print_table(("quantity", ">before", ">after"), rows)


if __name__ == "__main__":
    main()
