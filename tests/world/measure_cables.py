"""Measure bodies on cables: the tables of docs/data/results_cables.md.

    python tests/world/measure_cables.py beam|eight|recorded [--small]

``beam``: how fast a tilted bar between two constant forces turns, flown and by the
closed form. ``eight``: figure eights of Sun et al. ``recorded``: set points of flights
of col-trans.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[1]))

import skyarm
from support.cables import (
    BODY_NOISY,
    NOISY,
    beam,
    col_trans,
    figure_eight,
    rate_of_beam,
    recorded_paths,
    roll,
)
from support.measured_tables import print_table, progress

LOST = 0.5
"""Distance (m) of a load from its desired place at which it counts as lost."""


def flown(
    tables: Mapping[str, Any], *, noisy: bool = False, seconds: float | None = None
) -> Any:
    """Log of a flight, with noise of vehicles and body or without, cut short for a
    small table.
    """
    noise = {**NOISY, "team": {**tables["team"], **BODY_NOISY}} if noisy else {}
    cut = (
        {} if seconds is None else {"duration": min(seconds, float(tables["duration"]))}
    )
    return skyarm.run(skyarm.scenario_from({**tables, **noise, **cut}))


def beams(small: bool) -> Iterator[tuple[object, ...]]:
    """Rows: internal force, gain, height of the grasps, start, rate of the bar's turn
    by the closed form and flown.
    """
    rows = [
        (0.1, 0.5, 0.0, 0.3),
        (0.1, 1.0, 0.0, 0.3),
        (0.05, 0.5, 0.0, 0.3),
        (0.0, 0.5, 0.0, 0.3),
    ]
    rows += [
        (-0.05, 0.5, 0.0, 0.1),
        (-0.1, 0.5, 0.0, 0.1),
        (-0.02, 0.5, 0.0097, 0.3),
        (-0.05, 0.5, 0.0097, 0.1),
    ]
    for pull, gain, height, tilt in rows[:1] if small else rows:
        log = flown(beam(pull, gain, tilt, height, duration=3.0 if small else 8.0))
        during = (log.time > 2.0) & (log.time < 7.0)
        half = np.log(np.abs(np.tan(0.5 * roll(log)[during])))
        rate, angle = (
            np.polyfit(log.time[during], half, 1)[0],
            np.degrees(roll(log)[-1]),
        )
        numbers = (
            f"{pull:g}",
            f"{gain:g}",
            f"{1e3 * height:g}",
            f"{np.degrees(tilt):.1f}",
            f"{angle:.1f}",
        )
        yield *numbers, f"{rate_of_beam(pull, gain, height) + 0.0:.3f}", f"{rate:.3f}"


def root_mean_square(error: Any) -> str:
    """Root mean square of distances (m), in mm."""
    return f"{1e3 * float(np.sqrt((error**2).mean())):.1f}"


def judged(log: Any, begin: float) -> tuple[str, str]:
    """Root mean square and largest distance (mm) of a load from its desired place from
    a time (s) on; or its loss.
    """
    error = log.team_position_error[:, 0]
    gone = error > LOST
    if gone.any() or log.info["status"] != "completed":
        when = log.time[np.argmax(gone)] if gone.any() else log.time[-1]
        return f"lost at {when:.1f} s", ""
    late = error[log.time >= begin]
    return root_mean_square(late), f"{1e3 * late.max():.1f}"


BASELINES = {0.5: "32", 1.0: "135", 1.5: "lost", 2.5: "lost"}
"""Root mean square (mm) of the geometric law beside which Sun et al. stand, by rad/s;
from a third party's table."""


def planned_acceleration(scenario: Any) -> float:
    """Largest acceleration (m/s^2) of a vehicle's reference."""
    times = np.arange(0.0, scenario.duration, 0.02)
    return max(
        float(
            np.linalg.norm(
                [[*map(float, each.reference.at(t).acceleration)] for t in times],
                axis=1,
            ).max()
        )
        for each in scenario.agents.values()
    )


def eights(small: bool) -> Iterator[tuple[object, ...]]:
    """Rows: speed, rate and size of the path, accelerations; errors without and with
    noise, and of the baseline.
    """
    for rate, size in (
        [(1.0, 0.5)] if small else [*((rate, 2.0) for rate in BASELINES), (1.065, 3.32)]
    ):
        tables, begin = figure_eight(rate, size)
        scenario = skyarm.scenario_from(tables)
        desired = [
            scenario.team.motion.at(t)
            for t in np.arange(begin, tables["duration"], 0.02)
        ]
        speed, load = (
            max(float(getattr(each, name).norm()) for each in desired)
            for name in ("velocity", "acceleration")
        )
        found = flown(tables, seconds=1.0 if small else None)
        least = f"{found.grasp_force[found.time > 0.5].min():.2f}"
        path = (
            f"{speed:.1f}",
            f"{rate:g}",
            f"{size:g}",
            f"{load:.1f}",
            f"{planned_acceleration(scenario):.1f}",
        )
        noisy = ("",) if small else judged(flown(tables, noisy=True), begin)
        errors = judged(found, 0.5 if small else begin)
        yield *path, *errors, noisy[0], least, BASELINES.get(rate, "")


REAL = {
    "2 window opt": "62.2",
    "2 window geom": "76.4",
    "3 window opt": "93.4",
    "3 window geom": "137",
    "2 forest opt": "67.1",
    "2 forest geom": "109",
    "3 forest opt": "129",
}
"""Root mean square (mm) over all real flights of a row, decoded from its logs."""


def recorded(small: bool) -> Iterator[tuple[object, ...]]:
    """Rows: path, vehicles, errors without and with noise, smallest cable force, error
    of the real flights.
    """
    for row in [*recorded_paths()][: 1 if small else None]:
        tables, begin = col_trans(row)
        found = flown(tables, seconds=2.0 if small else None)
        noisy = ("", "") if small else judged(flown(tables, noisy=True), begin)
        least = f"{1e3 * found.grasp_force[found.time > 0.5].min():.0f}"
        yield row[2:], row[0], *judged(found, begin), *noisy, least, REAL[row]


TABLES = {
    "beam": (
        beams,
        (
            ">T, N",
            ">K, m/(N s)",
            ">h, mm",
            ">q_0, deg",
            ">q after 8 s, deg",
            ">r of the equation, 1/s",
            ">r flown, 1/s",
        ),
    ),
    "eight": (
        eights,
        (
            ">speed, m/s",
            ">w, rad/s",
            ">A, m",
            ">acceleration of the load, m/s^2",
            ">acceleration of a vehicle, m/s^2",
            ">error, mm",
            ">largest, mm",
            ">error with noise, mm",
            ">least cable force, N",
            ">baseline, mm",
        ),
    ),
    "recorded": (
        recorded,
        (
            "path",
            ">vehicles",
            ">error, mm",
            ">largest, mm",
            ">error with noise, mm",
            ">largest with noise, mm",
            ">least cable force, mN",
            ">real flights, mm",
        ),
    ),
}
"""Name of a table -> its rows and heads."""

PATHS = 5
"""First columns of the figure eights, which have a table of their own; the first one,
the speed, begins both."""


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("table", choices=TABLES)
    parser.add_argument(
        "--small", action="store_true", help="one short flight: seconds"
    )
    given = parser.parse_args()
    rows, heads = TABLES[given.table]
    progress(f"{given.table}:")
    if given.table != "eight":
        print_table(heads, rows(given.small))
        return
    found = list(rows(given.small))
    print_table(heads[:PATHS], (row[:PATHS] for row in found))
    print_table((heads[0], *heads[PATHS:]), ((row[0], *row[PATHS:]) for row in found))


if __name__ == "__main__":
    main()
