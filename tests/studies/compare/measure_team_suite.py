"""Measure the team suite: the tables of docs/data/results_teams.md.

    python tests/studies/compare/measure_team_suite.py TABLE [--seeds 200] [--small]

Four tables are of the same flights: ``summary`` of a few conditions, ``errors`` of the
bar's place, direction and pull, ``goals`` of ``object_wrench``, and ``limits`` with
lost flights, rotor jitter, commands at a limit and shares of the load. ``others`` flies
other teams, ``gains`` four teams with other gains while they carry. What was flown is
kept in the folder of ``--out``; the same command, and the others of the same flights,
go on with it.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[2]))

import numpy as np

import skyarm
from skyarm.studies.compare.cell_flights import JITTER, LIMITED
from skyarm.studies.compare.compare_laws import compare
from skyarm.studies.compare.team_conditions import ROWS
from skyarm.studies.compare.team_suite import FLOWN, LAWS
from skyarm.studies.trial.table import values_of
from support.measured_tables import print_table, progress
from support.teams import TEAMS

DEGREES = 180.0 / np.pi

Summaries = Mapping[str, Mapping[str, Mapping[str, Any]]]
"""Condition -> law -> summary of its flights."""

Table = tuple[Sequence[str], Iterable[Sequence[object]]]
"""Heads and rows."""

POSITION, DIRECTION, PULL = (
    (
        ("mean error of position, mm", "team_position_mean"),
        ("largest error of position, mm", "team_position_max"),
        1e3,
    ),
    (
        ("mean error of direction, deg", "team_turn_mean"),
        ("largest error of direction, deg", "team_turn_max"),
        DEGREES,
    ),
    (
        ("RMS error of pull, N", "team_pull_rms"),
        ("largest error of pull, N", "team_pull_max"),
        1.0,
    ),
)
"""Of each error: head and metric over time, of which the mean over the flights is
shown; the same of the largest, of which the worst flight is shown; factor from SI to
the unit of the heads."""

CHOSEN = ("noisy", "misplaced", "wind", "all")
"""Conditions of the summary."""

SHIPPED = Path(skyarm.__file__).parent / "scenario" / "library" / "two_carry_a_bar.toml"

GOALS: Mapping[str, Sequence[tuple[float, float]]] = {
    "perfect": ((2.5, 10.0), (0.3, 1.2), (0.03, 0.15)),
    "noisy": ((4.0, 15.0), (0.4, 1.5), (0.05, 0.2)),
    "masses": ((6.0, 28.0), (0.5, 2.2), (0.05, 0.2)),
    "misplaced": ((8.0, 25.0), (0.3, 1.0), (0.12, 0.5)),
    "messages": ((4.0, 15.0), (0.4, 1.5), (0.05, 0.2)),
    "clock": ((9.0, 20.0), (0.8, 2.5), (0.15, 0.5)),
    "wind": ((10.0, 75.0), (0.3, 1.0), (0.05, 0.25)),
    "all": ((15.0, 75.0), (0.6, 2.5), (0.15, 0.5)),
    "fixed": ((4.0, 15.0), (0.7, 3.0), (0.1, 0.4)),
}
"""Condition -> largest acceptable errors of position (mm), direction (deg) and pull (N)
of ``object_wrench``, over time and largest; set before the flights."""


def value(
    summary: Mapping[str, Any], metric: str, how: str, factor: float = 1.0
) -> float | None:
    """Mean or largest value of a metric over the flights, of several vehicles the
    larger; None if no flight has it.
    """
    found = [
        factor * each[how] for each in values_of(summary["metrics"], metric) if each
    ]
    return max(found, default=None)


def shown(number: float | None) -> str:
    """Number of a cell with three digits."""
    return "" if number is None else f"{number:.3g}"


def placed(summary: Mapping[str, Any]) -> str:
    """Flights that placed the bar, of how many."""
    return f"{summary['success']} of {summary['episodes']}"


def by_law(
    flown: Summaries, head: str, cell: Callable[[Mapping[str, Any]], object]
) -> Table:
    """Table of one quantity: a condition a row, a law a column."""
    heads = (head, *(f">`{law}`" for law in LAWS))
    rows = (
        [ROWS[row]["title"], *(cell(of[law]) if law in of else "" for law in LAWS)]
        for row, of in flown.items()
    )
    return heads, rows


def number_by_law(
    flown: Summaries, head: str, metric: str, how: str, factor: float = 1.0
) -> Table:
    """Table of a metric."""
    return by_law(
        flown, head, lambda summary: shown(value(summary, metric, how, factor))
    )


def intervals(summaries: Iterable[Mapping[str, Any]]) -> Table:
    """Table of the intervals of all counts of placed flights."""
    several = [each for each in summaries if each["episodes"] > 1]
    found = {
        (each["success"], each["episodes"]): each["success_interval"]
        for each in several
    }
    counts = sorted(
        found.items(), key=lambda item: (item[0][1], item[0][0]), reverse=True
    )
    ends = (
        [f"{good} of {of}", *(f"{100.0 * end:.0f}" for end in found)]
        for (good, of), found in counts
    )
    return ("placed", ">interval of 95 %, from, %", ">to, %"), ends


def summary_tables(flown: Summaries) -> Iterator[Table]:
    """Flights that placed the bar, and errors over time, of a few conditions."""
    (position, _, to_mm), (pull, _, _) = POSITION, PULL
    yield (
        ("condition", "law", ">placed", *(f">{head}" for head, _ in (position, pull))),
        (
            [
                ROWS[row]["title"],
                f"`{law}`",
                placed(each),
                shown(value(each, position[1], "mean", to_mm)),
                shown(value(each, pull[1], "mean")),
            ]
            for row in CHOSEN
            if row in flown
            for law, each in flown[row].items()
        ),
    )


def error_tables(flown: Summaries) -> Iterator[Table]:
    """Flights that placed the bar, intervals of these counts, and errors of the bar."""
    yield by_law(flown, "placed", placed)
    yield intervals(each for of in flown.values() for each in of.values())
    for usual, largest, factor in (POSITION, DIRECTION, PULL):
        yield number_by_law(flown, *usual, "mean", factor)
        yield number_by_law(flown, *largest, "max", factor)


def goal_tables(flown: Summaries) -> Iterator[Table]:
    """Flights of ``object_wrench`` that placed the bar, then a table for each error:
    goals, and what was reached.
    """
    counts = {
        ROWS[row]["title"]: flown[row]["object_wrench"] for row in GOALS if row in flown
    }
    ends = {
        title: (
            [f"{100.0 * end:.0f}" for end in each["success_interval"]]
            if each["episodes"] > 1
            else ["", ""]
        )
        for title, each in counts.items()
    }
    heads = ("condition", ">placed", ">interval of 95 %, from, %", ">to, %")
    yield heads, ([title, placed(each), *ends[title]] for title, each in counts.items())

    def rows(which: int) -> Iterator[list[str]]:
        usual, largest, factor = (POSITION, DIRECTION, PULL)[which]
        for row, goals in GOALS.items():
            if row not in flown:
                continue
            of = flown[row]["object_wrench"]
            reached = (
                value(of, usual[1], "mean", factor),
                value(of, largest[1], "max", factor),
            )
            pairs = list(
                zip(
                    (usual[0].split()[0], "largest"), goals[which], reached, strict=True
                )
            )
            missed = [
                name for name, goal, found in pairs if found is None or found > goal
            ]
            numbers = [
                text for _, goal, found in pairs for text in (f"{goal:g}", shown(found))
            ]
            yield [ROWS[row]["title"], *numbers, " and ".join(missed)]

    for which, (usual, largest, _) in enumerate((POSITION, DIRECTION, PULL)):
        heads = (
            "condition",
            *(
                head
                for name, _ in (usual, largest)
                for head in (f">goal: {name}", ">reached")
            ),
        )
        yield (*heads, "missed"), rows(which)


def limit_tables(flown: Summaries) -> Iterator[Table]:
    """Lost flights and how flights ended, commands at limits, rotor jitter, and the
    larger share of the load.
    """
    yield by_law(
        flown,
        "flights that ended early",
        lambda each: each["episodes"] - each["endings"].get("completed", 0),
    )
    endings = {law: Counter[str]() for law in LAWS}
    for of in flown.values():
        for law, each in of.items():
            endings[law].update(each["endings"])
    ways = (
        [f"`{law}`", f"`{way}`", count]
        for law, found in endings.items()
        for way, count in found.most_common()
    )
    yield ("law", "ending", ">flights"), ways

    def at_limit(law: str, metric: str) -> str:
        found = [
            value(of[law], metric, "max", 100.0) for of in flown.values() if law in of
        ]
        return shown(max((each for each in found if each is not None), default=None))

    heads = (
        "law",
        ">a rotor at its limit, worst flight, %",
        ">a joint at its limit, worst flight, %",
    )
    yield (
        heads,
        (
            [f"`{law}`", at_limit(law, LIMITED), at_limit(law, "joint_saturation")]
            for law in LAWS
        ),
    )
    yield number_by_law(flown, "rotor jitter, mean, rad/s", JITTER, "mean")
    yield number_by_law(flown, "rotor jitter, worst flight, rad/s", JITTER, "max")
    yield number_by_law(
        flown, "larger mean share of the load, %", "load_share_mean", "mean", 100.0
    )
    yield number_by_law(
        flown, "largest share in a flight, %", "load_share_mean", "max", 100.0
    )


TABLES: Mapping[str, Callable[[Summaries], Iterator[Table]]] = {
    "summary": summary_tables,
    "errors": error_tables,
    "goals": goal_tables,
    "limits": limit_tables,
}


def measure(table: str, seeds: int, out: str, rows: Sequence[str]) -> None:
    """Fly what is not there yet, and print the tables of one name."""
    flown = compare(
        "team-suite",
        None,
        out,
        rows=tuple(rows),
        seeds=seeds,
        workers=os.cpu_count() or 1,
        progress=lambda done, of, last: progress(f"{done} of {of}: {last}"),
    )
    for heads, lines in TABLES[table](
        {row: cases[FLOWN] for row, cases in flown.document["summaries"].items()}
    ):
        print_table(heads, lines)


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
    "quadrotors_box": (
        "two quadrotors, box",
        ("perfect", "noisy", "masses", "misplaced", "wind", "all"),
    ),
}
"""File of a team in tests/data/teams -> its words in the table, and conditions that it
flies."""

SHOWN = ("leader_follower", "decentralised", "object_wrench")
"""Laws that other teams fly."""


def others(seeds: int, out: str, small: bool) -> None:
    """Fly the conditions on other teams, and print a table of each quantity: a
    condition a row, a law a column.
    """
    found = dict[tuple[str, str], Mapping[str, Any]]()
    for file, (words, rows) in list(OTHER_TEAMS.items())[: 1 if small else None]:
        flown = compare(
            "team-suite",
            SHOWN,
            f"{out}/{file}",
            rows=("noisy",) if small else rows,
            scenario=TEAMS / f"{file}.toml",
            seeds=2 if small else seeds,
            workers=os.cpu_count() or 1,
            progress=lambda done, of, last: progress(f"{done} of {of}: {last}"),
        )
        for row, cases in flown.document["summaries"].items():
            found[words, ROWS[row].get("own", ROWS[row]["title"])] = next(
                iter(cases.values())
            )

    def table(head: str, cell: Callable[[Mapping[str, Any]], str]) -> None:
        lines = (
            [*names, *(cell(of[law]) for law in SHOWN)] for names, of in found.items()
        )
        print_table(("team", head, *(f">`{law}`" for law in SHOWN)), lines)

    def number(
        metric: str, how: str, factor: float
    ) -> Callable[[Mapping[str, Any]], str]:
        return lambda summary: shown(value(summary, metric, how, factor))

    table("placed", placed)
    print_table(*intervals(each for of in found.values() for each in of.values()))
    for usual, largest, factor in (POSITION, DIRECTION, PULL):
        table(usual[0], number(usual[1], "mean", factor))
        table(largest[0], number(largest[1], "max", factor))


GAINS = ((0.7, 0.0), (0.6, 0.0), (0.6, 0.02), (0.6, 0.2))
"""Options ``carrying`` and ``carried_inertia`` of the vehicles' laws."""

OPTIONS = re.compile(r"^carrying = .*\ncarried_inertia = .*$", re.MULTILINE)
"""Lines of a team's file that have both."""


def gains(seeds: int, out: str, small: bool) -> None:
    """Fly noise and wind on four teams with other gains while they carry, and print a
    table.
    """
    files = {
        "two, bar": SHIPPED,
        **{words: TEAMS / f"{file}.toml" for file, (words, _) in OTHER_TEAMS.items()},
    }
    for unseen in ("long_bar", "quadrotors_box"):  # no option is chosen on these
        files.pop(OTHER_TEAMS[unseen][0])
    usual, largest, to_mm = POSITION
    lines: list[list[str]] = []
    for words, file in list(files.items())[: 1 if small else None]:
        for carrying, inertia in GAINS[: 1 if small else None]:
            folder = Path(out) / f"{file.stem}_{carrying:g}_{inertia:g}"
            folder.mkdir(parents=True, exist_ok=True)
            text, count = OPTIONS.subn(
                f"carrying = {carrying}\ncarried_inertia = {inertia}",
                file.read_text("utf-8"),
            )
            assert count == 1, file
            (folder / file.name).write_text(text, "utf-8")
            flown = compare(
                "team-suite",
                ("object_wrench",),
                folder / "flights",
                rows=("noisy", "wind"),
                scenario=folder / file.name,
                seeds=2 if small else seeds,
                workers=os.cpu_count() or 1,
                progress=lambda done, of, last: progress(f"{done} of {of}: {last}"),
            )
            noisy, wind = (
                next(iter(flown.document["summaries"][row].values()))
                for row in ("noisy", "wind")
            )
            cells = (
                value(noisy["object_wrench"], usual[1], "mean", to_mm),
                value(wind["object_wrench"], largest[1], "max", to_mm),
                value(noisy["object_wrench"], PULL[0][1], "mean"),
                value(noisy["object_wrench"], JITTER, "mean"),
            )
            lines.append([words, f"{carrying:g}", f"{inertia:g}", *map(shown, cells)])
    heads = (
        "mean error of position, mm",
        "largest in wind, mm",
        "RMS error of pull, N",
        "rotor jitter, rad/s",
    )
    print_table(
        ("team", ">`carrying`", ">`carried_inertia`", *(f">{head}" for head in heads)),
        lines,
    )


def main() -> None:
    """Measure."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("table", choices=(*TABLES, "others", "gains"))
    parser.add_argument(
        "--seeds", type=int, help="flights of a condition with noise: 200, of gains 16"
    )
    parser.add_argument("--out", default="out/team_suite")
    parser.add_argument(
        "--small", action="store_true", help="one condition, two flights of each law"
    )
    given = parser.parse_args()
    given.seeds = given.seeds or (16 if given.table == "gains" else 200)
    progress(
        f"{given.seeds} flights of each law in each condition with noise; one flight"
        " alone takes about 5 s"
    )
    if given.table in ("others", "gains"):
        fly = others if given.table == "others" else gains
        with tempfile.TemporaryDirectory() as spare:
            fly(
                given.seeds,
                spare if given.small else f"{given.out}_{given.table}",
                given.small,
            )
    elif given.small:
        with tempfile.TemporaryDirectory() as out:
            measure(given.table, 2, out, ("noisy",))
    else:
        measure(given.table, given.seeds, given.out, tuple(ROWS))


if __name__ == "__main__":
    main()
