"""Compare the predictions of held-out flights by two checkouts of the library, flight
by flight.

    python tests/identify/measure_predictions.py OLD/src [NEW/src] [--only WORDS]

Root mean square errors of position over half a second and a second, m, by the
identified vehicle alone and with what it learns from the flight's past; and the ratio
of the second checkout's to the first's. Each checkout runs in a process of its own, on
the same flights.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

# the tests' own vehicles, when this is run as a program
sys.path.append(str(Path(__file__).parents[1]))

from judged_flights import unpacked
from planted_flights import measured, planted

import skyarm
from support.vehicles import crazyflie, iris

HORIZONS, PREDICTORS = (0.5, 1.0), ("identified", "with past")
SPLIT = 40.0
"""s, of a planted flight that are fitted; the rest is predicted."""

Pair = tuple[Any, Any, Any, Mapping[str, Any]]
"""Flight of the fit, flight that is predicted, start vehicle, and options of the
identification."""


def split(kind: str, noise: str, *without: str) -> Callable[[], Pair]:
    def made() -> Pair:
        case = planted(kind, 1)
        flight = measured(case, noise, without)
        return flight.section(0.0, SPLIT), flight.section(SPLIT, 60.0), case.start, {}

    return made


def of_iris() -> Pair:
    flight = unpacked("gazebo_iris", "quadrotor_model")
    middle = flight.start + 0.6 * flight.duration
    return (
        flight.section(flight.start, middle),
        flight.section(middle, flight.end),
        iris(),
        {},
    )


def of_nanobench(fitted: str, unseen: str) -> Callable[[], Pair]:
    options = {"full_voltage": 4.2, "drag_height": True}
    return lambda: (
        unpacked("nanobench", fitted),
        unpacked("nanobench", unseen),
        crazyflie(),
        options,
    )


PAIRS: Mapping[str, Callable[[], Pair]] = {
    "NanoBench's star, first": of_nanobench("B8_star_fast_rep2", "B8_star_fast_rep1"),
    "NanoBench's star, second": of_nanobench("B8_star_fast_rep1", "B8_star_fast_rep2"),
    "Gazebo's Iris": of_iris,
    "quadrotor, low noise": split("quad", "low"),
    "quadrotor, high noise": split("quad", "high"),
    "two joints, low noise": split("arm2", "low"),
    "two joints, high noise": split("arm2", "high"),
    "three joints, low noise": split("arm3", "low"),
    "three joints, high noise": split("arm3", "high"),
    "three joints, no efforts": split("arm3", "low", "joint_efforts"),
}
"""Flights by name."""


def errors(name: str) -> dict[str, float | str]:
    """Errors of position (m) by predictor and horizon of one flight, by the library
    that is imported here.
    """
    seen, unseen, start, options = PAIRS[name]()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            found = skyarm.identify_flights(
                [seen], start, held_out=[unseen], despite_faults=True, **options
            )
        except ValueError as error:
            return {"refused": str(error)}
    rows = found.held_out.errors
    return {
        f"{each}, {horizon:g} s": row.position
        for each in PREDICTORS
        if each in rows
        for horizon in HORIZONS
        for row in rows[each]
        if abs(row.horizon - horizon) < 1e-9
    }


def main() -> None:
    """Compare, and print the table; or print one checkout's errors of one flight."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "checkouts", nargs="*", help="one or two folders that hold the package"
    )
    parser.add_argument("--only", default="", help="part of the flights' names")
    parser.add_argument("--flight", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.flight:
        print(json.dumps(errors(given.flight)))
        return
    if len(given.checkouts) not in {1, 2}:
        parser.error("one folder, or two that are compared")
    names = [name for name in PAIRS if given.only in name]
    print(f"{'flight':28} {'predictor':18} {'first':>9} {'second':>9} {'ratio':>7}")
    for name in names:
        found = [_elsewhere(name, folder) for folder in given.checkouts]
        for key in dict.fromkeys(key for each in found for key in each):
            first, second = (
                found[0].get(key, float("nan")),
                found[-1].get(key, float("nan")),
            )
            if key == "refused":
                print(f"{name:28} refused: {first} | {second}", flush=True)
            else:
                print(
                    f"{name:28} {key:18} {first:9.4f} {second:9.4f}"
                    f" {second / first:7.2f}",
                    flush=True,
                )


def _elsewhere(name: str, folder: str) -> dict[str, Any]:
    """Errors by a checkout, in a process of its own."""
    source = Path(folder).resolve()
    if not (source / "skyarm").is_dir():
        raise SystemExit(f"{folder}: must be a folder that holds the package skyarm")
    command = [sys.executable, __file__, "--flight", name]
    done = subprocess.run(
        command,
        env={**os.environ, "PYTHONPATH": str(source)},
        capture_output=True,
        check=False,
    )
    if done.returncode:
        return {"refused": done.stderr.decode().strip().splitlines()[-1]}
    found: dict[str, Any] = json.loads(done.stdout.decode().splitlines()[-1])
    return found


if __name__ == "__main__":
    main()
