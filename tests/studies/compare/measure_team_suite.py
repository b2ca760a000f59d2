"""Measure the team suite: the tables of docs/results_carrying.md.

    python tests/studies/compare/measure_team_suite.py errors|limits|others [--seeds 64] [--out out/team_suite]

Two tables are of the same flights: ``errors`` of the bar's place, direction and pull, and ``limits`` with rotor
jitter, commands at a limit and shares of the load. ``others`` is of other teams, with 16 flights. What was flown is
kept in the folder; the same command, and the other one of the bar, go on with it.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[2]))  # the tests' own modules, when this is run as a program

import numpy as np

from skyarm.studies.compare.cell_flights import JITTER, LIMITED, values_of
from skyarm.studies.compare.compare_laws import compare
from skyarm.studies.compare.team_conditions import ROWS
from skyarm.studies.compare.team_suite import FLOWN
from support.measured_tables import print_table, progress
from support.teams import TEAMS

DEGREES = 180.0 / np.pi


def pair(metrics: Mapping[str, Any], mean: str, most: str, factor: float = 1.0) -> str:
    """Mean of a metric over the flights, and largest value of another; of several vehicles the larger of each."""
    first, second = values_of(metrics, mean), values_of(metrics, most)
    if not all((*first, *second)):
        return ""
    return f"{factor * max(v['mean'] for v in first):.3g} / {factor * max(v['max'] for v in second):.3g}"


def errors(law: Mapping[str, Any]) -> list[str]:
    """Flights that placed the bar, with their interval, and errors of the bar."""
    low, high = (100.0 * end for end in law["success_interval"])
    found = law["metrics"]
    return [
        f"{law['success']} of {law['episodes']}",
        f"{low:.0f} to {high:.0f}" if law["episodes"] > 1 else "",
        pair(found, "team_position_mean", "team_position_max", 1e3),
        pair(found, "team_turn_mean", "team_turn_max", DEGREES),
        pair(found, "team_pull_rms", "team_pull_max"),
    ]


def limits(law: Mapping[str, Any]) -> list[str]:
    """Rotor jitter, commands at limits, and the share of the load of the vehicle that bears most."""
    ways = ", ".join(f"{name} {count}" for name, count in law["endings"].items() if name != "completed")
    found = law["metrics"]
    return [
        pair(found, JITTER, JITTER),
        pair(found, LIMITED, LIMITED, 100.0),
        pair(found, "joint_saturation", "joint_saturation", 100.0),
        pair(found, "load_share_mean", "load_share_mean", 100.0),
        ways,
    ]


TABLES: Mapping[str, tuple[Callable[[Mapping[str, Any]], list[str]], Sequence[str]]] = {
    "errors": (
        errors,
        (
            ">placed",
            ">interval of 95 %, %",
            ">position mean / max, mm",
            ">direction mean / max, deg",
            ">pull error RMS / max, N",
        ),
    ),
    "limits": (
        limits,
        (
            ">rotor jitter, rad/s",
            ">a rotor at its limit, %",
            ">a joint at its limit, %",
            ">share of the load, %",
            "lost",
        ),
    ),
}


def measure(table: str, seeds: int, out: str, rows: Sequence[str]) -> None:
    """Fly what is not there yet, and print a table: a law under a condition a row."""
    cells, heads = TABLES[table]
    flown = compare(
        "team-suite",
        None,
        out,
        rows=tuple(rows),
        seeds=seeds,
        workers=os.cpu_count() or 1,
        progress=lambda done, of, last: progress(f"{done} of {of}: {last}"),
    )

    def lines() -> Iterator[list[str]]:
        for row, cases in flown.document["summaries"].items():
            for law, each in cases[FLOWN].items():
                yield [ROWS[row]["title"], f"`{law}`", *cells(each)]

    print_table(("condition", "law", *heads), lines())


OTHER_TEAMS: Mapping[str, tuple[str, Sequence[str]]] = {
    "unequal_bar": (
        "quadrotor and hexarotor, bar",
        ("perfect", "noisy", "masses", "misplaced", "wind", "all"),
    ),
    "heavy_beam": (
        "two of 12 kg, beam",
        ("perfect", "noisy", "masses", "misplaced", "wind", "all"),
    ),
    "plate": (
        "three, plate",
        ("perfect", "noisy", "masses", "misplaced", "wind", "all", "lost"),
    ),
    "long_bar": ("three, bar", ("noisy", "lost")),
}
"""File of a team in tests/data/teams -> its words in the table, and conditions that it flies."""

OTHER_HEADS = (
    "team",
    "condition",
    "law",
    ">placed",
    ">position, mm",
    ">largest",
    ">direction, deg",
    ">largest",
    ">pull error, N",
    ">largest",
)


def others(seeds: int, out: str, small: bool) -> None:
    """Fly the conditions on other teams, and print a table: a law under a condition a row."""

    def lines() -> Iterator[list[str]]:
        for file, (words, rows) in list(OTHER_TEAMS.items())[: 1 if small else None]:
            flown = compare(
                "team-suite",
                ("object_wrench",) if small else ("leader_follower", "decentralised", "object_wrench"),
                f"{out}/{file}",
                rows=rows[:1] if small else rows,
                scenario=TEAMS / f"{file}.toml",
                seeds=seeds,
                workers=os.cpu_count() or 1,
                progress=lambda done, of, last: progress(f"{done} of {of}: {last}"),
            )
            for row, cases in flown.document["summaries"].items():
                for law, each in next(iter(cases.values())).items():
                    yield [words, ROWS[row].get("own", ROWS[row]["title"]), f"`{law}`", *single_values(each)]

    print_table(OTHER_HEADS, lines())


def single_values(law: Mapping[str, Any]) -> list[str]:
    """Flights that placed the body, and its errors, one value a cell."""
    cells = errors(law)
    return [cells[0], *(value for cell in cells[2:] for value in (cell.split(" / ") if cell else ("", "")))]


def main() -> None:
    """Measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", choices=(*TABLES, "others"))
    parser.add_argument("--seeds", type=int, help="flights of a condition with noise: 64, of other teams 16")
    parser.add_argument("--out", default="out/team_suite")
    parser.add_argument("--small", action="store_true", help="one condition, one flight of each law")
    given = parser.parse_args()
    given.seeds = given.seeds or (16 if given.table == "others" else 64)
    progress(f"{given.seeds} flights of each law in each condition with noise; one flight alone takes about 5 s")
    if given.table == "others":
        with tempfile.TemporaryDirectory() as spare:
            others(given.seeds, spare if given.small else f"{given.out}_others", given.small)
    elif given.small:
        with tempfile.TemporaryDirectory() as out:
            measure(given.table, 1, out, ("pull",))
    else:
        measure(given.table, given.seeds, given.out, tuple(ROWS))


if __name__ == "__main__":
    main()
