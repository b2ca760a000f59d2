"""The tables of mean errors of docs/data/results_laws.md, flown as the comparison flies
the laws, with perfect state.

python tests/website/law_envelopes.py case3              flies every law and prints the
                                                         table of a case
python tests/website/law_envelopes.py case3 --small      flies two laws
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).resolve().parents[1]))

from skyarm.control.catalogue import tuned_factors
from skyarm.studies.compare.cell_flights import JITTER, LIMITED, CellFlights
from skyarm.studies.compare.entrants import ENTRANTS, Entrant
from skyarm.studies.compare.suite import CASES, conditions
from skyarm.studies.flights.fly import fly
from support.measured_tables import print_table

PAGE = Path(__file__).resolve().parents[2] / "docs" / "data" / "results_laws.md"
CASES_SHOWN = ("case3", "case3_wind")
HEADS = (
    "law",
    ">base, mm",
    ">joints, mrad",
    ">tip, mm",
    ">rotor jitter, rad/s a period",
)
HEAD = (
    "| law | base, mm | joints, mrad | tip, mm | rotor jitter, rad/s a period"
    " |\n|-|-:|-:|-:|-:|\n"
)
KINDS = ("position", "joint", "ee")


def entrant(name: str) -> Entrant:
    """Who flies under a name: an entrant of the comparison, or a preset or a law with
    tuned gains that is none.
    """
    return ENTRANTS.get(name) or Entrant(
        name=name, group="paper", law=name, tuned=name in tuned_factors()
    )


def flown(name: str, cases: tuple[str, ...] = CASES_SHOWN) -> list[float]:
    """Mean errors in Case 3 and in the wind: base, mm; joints, mrad; tip, mm; rotor
    jitter, rad/s.

    Raises:
        AssertionError: a rotor is at its limit, which the page says of none.
    """
    perfect = conditions()["perfect"]
    found = []
    for case in cases:
        metrics = fly(
            CellFlights(
                entrant=entrant(name), case=CASES[case], condition=perfect
            ).work()
        )
        found += [
            1e3 * metrics[f"{kind}_error_mean_continuous"][0] for kind in KINDS
        ] + [metrics[JITTER][0]]
        assert metrics[LIMITED][0] == 0.0, (
            f"{name} in {case}: rotors at a limit in {metrics[LIMITED][0]:.2%}"
        )
    return found


def shown(value: float) -> str:
    """A number with three digits, at most two of them behind the point."""
    return (
        f"{value:.2f}"
        if value < 9.995
        else f"{value:.1f}"
        if value < 99.95
        else f"{value:.0f}"
    )


def marks(case: str) -> re.Pattern[str]:
    """The table of a case, between its marks."""
    return re.compile(rf"<!-- laws in {case} -->\n(.*?)<!-- /laws -->", re.S)


def rows() -> dict[str, list[str]]:
    """Entrant -> its numbers in the tables of the page, one case after the other."""
    page, found = PAGE.read_text("utf-8"), dict[str, list[str]]()
    for case in CASES_SHOWN:
        (table,) = marks(case).findall(page)
        assert table.startswith(HEAD), case
        for line in table.strip().splitlines()[2:]:
            first, *numbers = (cell.strip() for cell in line.strip("|").split("|"))
            found.setdefault(first.strip("`"), []).extend(numbers)
    return found


def cells(case: str) -> Iterator[list[str]]:
    """Rows of the table of a case, each as it is flown."""
    for name in rows():
        yield [f"`{name}`", *map(shown, flown(name, (case,)))]


def main() -> None:
    """Print the table of a case between its marks."""
    parser = argparse.ArgumentParser(
        description="Fly every law of docs/data/results_laws.md in a case."
    )
    parser.add_argument("case", choices=CASES_SHOWN)
    parser.add_argument("--small", action="store_true", help="two laws")
    given = parser.parse_args()
    print_table(HEADS, islice(cells(given.case), 2 if given.small else None))


if __name__ == "__main__":
    main()
