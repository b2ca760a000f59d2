"""Laws in Case 3 and in its wind with and without noise, and times of a control step:
tables of docs/data/results_laws.md.

    python tests/website/measured_cases.py noise|predictive|learned|control_step
        [--seeds 8] [--small]

Noisy flights are those of the comparison's condition ``noisy``. One seed flies
``nmpc``, whose plans take seconds.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from pathlib import Path

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).resolve().parents[1]))
sys.path.append(str(Path(__file__).resolve().parents[1] / "studies" / "bench"))

import numpy as np
from law_envelopes import entrant, shown
from step_times import flown_step_times

from skyarm.scenario.scenario_file import load_scenario
from skyarm.studies.compare.cell_flights import CellFlights
from skyarm.studies.compare.entrants import Entrant
from skyarm.studies.compare.suite import CASES, conditions
from skyarm.studies.flights.fly import fly
from support.measured_tables import print_table

CASE_NAMES = {"case3": "Case 3", "case3_wind": "Case 3 in wind"}
ERRORS = {"tip": "ee_error_mean_continuous", "base": "position_error_mean_continuous"}


def errors(flies: Entrant, case: str, seeds: int) -> dict[str, float]:
    """Mean errors of tip and base, mm; with perfect state for no seeds, else the mean
    over noisy flights.

    Raises:
        AssertionError: a flight was lost.
    """
    condition = conditions(seeds=max(seeds, 1))["noisy" if seeds else "perfect"]
    metrics = fly(
        CellFlights(entrant=flies, case=CASES[case], condition=condition).work()
    )
    assert set(metrics["status"]) == {"completed"}, (flies.name, case)
    return {what: 1e3 * float(np.mean(metrics[name])) for what, name in ERRORS.items()}


def noise(seeds: int) -> Iterator[list[str]]:
    """Laws in the wind, with perfect state and noisy."""
    for name in ("paper_pd", "paper_ct", "centroidal_joint", "centroidal_tip"):
        yield [
            f"`{name}`",
            *(
                shown(errors(entrant(name), "case3_wind", each)["tip"])
                for each in (0, seeds)
            ),
        ]


def in_both_cases(
    columns: Sequence[tuple[Entrant, int]], rows: Sequence[tuple[str, str]]
) -> Iterator[list[str]]:
    """Rows of case and error; columns of laws and seeds."""
    found: dict[str, list[dict[str, float]]] = {}
    for case, what in rows:
        if case not in found:
            found[case] = [errors(flies, case, seeds) for flies, seeds in columns]
        yield [CASE_NAMES[case], what, *(shown(each[what]) for each in found[case])]


def plain(law: str, *, tuned: bool = False) -> Entrant:
    """A law under its name, with its default or its tuned gains."""
    return Entrant(name=law, group="published", law=law, tuned=tuned)


def predictive(_: int) -> Iterator[list[str]]:
    """Predictive control."""
    columns = [
        (entrant("paper_ct"), 0),
        (plain("nmpc"), 0),
        (plain("nmpc"), 1),
        (plain("nmpc", tuned=True), 0),
    ]
    return in_both_cases(
        columns, (("case3", "tip"), ("case3_wind", "tip"), ("case3_wind", "base"))
    )


def learned(seeds: int) -> Iterator[list[str]]:
    """The learned compensator."""
    laws = [plain("learned_compensator", tuned=tuned) for tuned in (False, True)]
    columns = [(law, each) for law in laws for each in (0, seeds)]
    return in_both_cases(
        columns, [(case, what) for case in CASE_NAMES for what in ERRORS]
    )


def control_step(seeds: int) -> Iterator[list[str]]:
    """Times of a control step of ``nmpc``, which makes a plan in every second one."""
    spent = 1e3 * flown_step_times(
        load_scenario(
            "case3_wind", controller="nmpc", duration=1.0 if seeds == 2 else 20.0
        )
    )
    for k, name in enumerate(("with a new plan", "with the feedback of the last plan")):
        steps = spent[k::2][1:]  # the first makes machine code
        yield [name, f"{steps.mean():.2g}", f"{np.quantile(steps, 0.99):.2g}"]


TABLES: dict[str, tuple[tuple[str, ...], Callable[[int], Iterator[list[str]]]]] = {
    "noise": (("law", ">tip, perfect state, mm", ">tip, noisy, mm"), noise),
    "predictive": (
        (
            "case",
            "error",
            ">paper's law",
            ">`nmpc`",
            ">`nmpc`, noisy",
            ">`nmpc`, tuned",
        ),
        predictive,
    ),
    "learned": (
        (
            "case",
            "error",
            ">default gains",
            ">default gains, noisy",
            ">tuned gains",
            ">tuned gains, noisy",
        ),
        learned,
    ),
    "control_step": (("control step", ">mean, ms", ">99 % quantile, ms"), control_step),
}


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("table", choices=TABLES)
    parser.add_argument("--seeds", type=int, default=8, help="noisy flights of a cell")
    parser.add_argument(
        "--small", action="store_true", help="the first row, two seeds, short flights"
    )
    given = parser.parse_args()
    heads, rows = TABLES[given.table]
    print_table(
        heads,
        islice(rows(2 if given.small else given.seeds), 1 if given.small else None),
    )


if __name__ == "__main__":
    main()
