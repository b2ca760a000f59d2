"""Measure how many true numbers of planted vehicles lie outside their 95 % intervals,
and how wide these are.

    python tests/identify/measure_coverage.py OUT.jsonl [--only arm2,low]
        [--every K] [--workers N] [--small]

Every vehicle is identified from a flight of a minute at low and at high noise, each
with some channels left out. Each result is appended to the file as it comes; a run that
was stopped goes on with what is missing, and one of which all is there prints the
tables alone: those of docs/data/results_identification.md, and all groups on the
standard error.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import re
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

# the tests' own vehicles, when this is run as a program
sys.path.append(str(Path(__file__).parents[1]))

import numpy as np
from planted_flights import KINDS, LANES, POSES, measured, planted

import skyarm
from support.measured_tables import print_table, progress

CHANNELS: Mapping[str, tuple[str, ...]] = {
    "all": (),
    "no velocity": ("velocity",),
    "no pose": POSES,
    "no efforts": ("joint_efforts",),
}
"""Sets of channels: which are left out."""

CLASSES: Mapping[str, tuple[str, ...]] = {
    "thrust, torque": ("thrust_coefficient", "moment_coefficient"),
    "lags, delays": ("time_constant", "delay"),
    "rotor inertia": ("rotors.inertia",),
    "air drag": ("drag_coefficient", "drag.area"),
    "base inertia": ("base.inertia",),
    "base com": ("base.com",),
    "joint friction": (".joint.",),
    "link bodies": ("links.",),
    "IMU place": ("place.",),
    "offsets, trim": ("offset.", "torque.", "drift"),
}
"""Kinds of numbers, by parts of their names; the first that fits counts."""

Row = dict[str, Any]


def cases(vehicles: int = LANES) -> list[tuple[str, int, str, str]]:
    """Kind, seed, noise and set of channels of every identification: two of each
    vehicle.
    """
    found = []
    for kind in KINDS:
        sets = [name for name in CHANNELS if kind != "quad" or name != "no efforts"]
        for seed in range(vehicles):
            found += [
                (kind, seed, "low", sets[seed % len(sets)]),
                (kind, seed, "high", sets[(seed + 1) % len(sets)]),
            ]
    return found


def identify(case: tuple[str, int, str, str]) -> Row:
    """One identification: the known numbers with their intervals and truths, and what
    was said of the flight.

    Every second vehicle measures no rates of its joints.
    """
    kind, seed, noise, channels = case
    vehicle = planted(kind, seed)
    without = (*CHANNELS[channels], *(("joint_rates",) if seed % 4 >= 2 else ()))
    flight, begin = measured(vehicle, noise, without), time.process_time()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        found = skyarm.identify_flights([flight], vehicle.start, despite_faults=True)
    numbers = [
        [each.name, each.value, each.low, each.high, vehicle.truth[each.name]]
        for each in found.numbers
        if each.is_known and each.name in vehicle.truth
    ]
    return {
        "kind": kind,
        "seed": seed,
        "noise": noise,
        "channels": channels,
        "rates": "joint rates" if "joint_rates" in flight else "no joint rates",
        "seconds": time.process_time() - begin,
        "told": [
            str(each.message) for each in told if issubclass(each.category, UserWarning)
        ],
        "numbers": numbers,
    }


def class_of(name: str) -> str:
    """Kind of a number."""
    return next(
        label for label, parts in CLASSES.items() if any(part in name for part in parts)
    )


def outside(numbers: Iterable[Sequence[Any]]) -> list[bool]:
    """Of each number whether its truth is outside of its interval."""
    return [not low <= truth <= high for _, _, low, high, truth in numbers]


def groups(rows: Sequence[Row]) -> dict[str, list[Sequence[Any]]]:
    """Numbers by what they have in common; all of them first."""
    found: dict[str, list[Sequence[Any]]] = {"all": []}
    for row in rows:
        for each in row["numbers"]:
            labels = [
                row["kind"],
                f"{row['noise']} noise",
                f"channels: {row['channels']}",
                class_of(each[0]),
            ]
            labels += [row["rates"]] if row["kind"] != "quad" else []
            for label in ("all", *labels):
                found.setdefault(label, []).append(each)
    return found


def table(rows: Sequence[Row]) -> str:
    """Table of all groups: numbers, those outside, their share, and the median width
    over the size of the truth.
    """
    lines = [f"{'group':24} {'numbers':>8} {'outside':>8} {'share':>8} {'width':>9}"]
    for label, numbers in groups(rows).items():
        wrong = outside(numbers)
        widths = [
            (high - low) / abs(truth) for _, _, low, high, truth in numbers if truth
        ]
        share, width = (
            float(np.mean(wrong)),
            (float(np.median(widths)) if widths else float("nan")),
        )
        lines.append(
            f"{label:24} {len(wrong):8} {sum(wrong):8} {100 * share:6.1f} %"
            f" {100 * width:7.2f} %"
        )
    seconds = sum(row["seconds"] for row in rows)
    told = sum(bool(row["told"]) for row in rows)
    lines.append(
        f"{len(rows)} identifications, {seconds:.0f} s; of {told} flights a fault was"
        " told"
    )
    return "\n".join(lines)


GROUPS = {
    "all": "all",
    "low noise": "good sensors",
    "high noise": "poor sensors",
    "channels: no efforts": "without joint efforts",
}
"""Groups of the page, and their words there."""

ACCURACY = {
    r"^base\.inertia\.(xx|yy|zz)": "moments of inertia of the base, %",
    r"^rotors\.thrust_coefficient": "thrust coefficient, %",
    r"^rotors\.moment_coefficient": "torque coefficient, %",
    r"^rotors\.time_constant": "time constants of the motors, %",
    r"^base\.com": "centre of mass of the base, mm",
    r"^place\.": "place of the inertial unit, mm",
    r"^links\..*\.com\.[xy]": "centre of mass of a link across it, mm",
    r"^links\..*\.com\.z": "centre of mass of a link along it, mm",
    r"^links\..*\.mass": "mass of a link, %",
    r"^links\..*\.joint\.(damping|coulomb)$": (
        "damping and Coulomb friction of a joint, %"
    ),
}
"""Patterns of the names of numbers, and their words in the page."""

FLOWN = {
    "8 quadrotors, good sensors": ("quad", "low", 8),
    "8 quadrotors, poor sensors": ("quad", "high", 8),
    "4 with two joints, good": ("arm2", "low", 4),
    "4 with two joints, poor": ("arm2", "high", 4),
}
"""Columns of the table of accuracy: kind, noise, and how many vehicles; four have one
of each set of channels."""

VEHICLES = {"quad": "quadrotor", "arm2": "with two joints", "arm3": "with three joints"}


def accuracy(
    rows: Sequence[Row], names: str, title: str, kind: str, noise: str, most: int
) -> str:
    """Median absolute error of numbers of one kind of vehicle and sensors, in the unit
    of the title; empty if none.
    """
    size, absolute = (1e3, True) if title.endswith("mm") else (100.0, False)
    errors = [
        size * abs(value - truth) / (1.0 if absolute else abs(truth))
        for row in rows
        if (row["kind"], row["noise"]) == (kind, noise) and row["seed"] < most
        for name, value, _, _, truth in row["numbers"]
        if re.search(names, name) and truth
    ]
    return f"{np.median(errors):.2g}" if errors else ""


def print_tables(rows: Sequence[Row]) -> None:
    """Print the tables of the page."""
    found = groups(rows)
    lines = []
    for label, title in GROUPS.items():
        wrong = outside(found.get(label, ()))
        lines.append(
            (
                f"{title} {len(wrong)}" if label == "all" else title,
                f"{100 * np.mean(wrong):.1f}" if wrong else "",
            )
        )
    print_table(("group", ">values outside of their 95 % interval, %"), lines)
    lines = [
        (title, *(accuracy(rows, names, title, *of) for of in FLOWN.values()))
        for names, title in ACCURACY.items()
    ]
    print_table(
        ("median of the absolute errors", *(f">{title}" for title in FLOWN)), lines
    )
    times = {
        kind: [row["seconds"] for row in rows if row["kind"] == kind]
        for kind in VEHICLES
    }
    lines = [
        (title, f"{np.median(times[kind]):.0f}" if times[kind] else "")
        for kind, title in VEHICLES.items()
    ]
    print_table(("flight of one minute at 500 Hz", ">time on one core, s"), lines)


def run(
    wanted: Sequence[tuple[str, int, str, str]],
    out: Path,
    workers: int,
    tell: Callable[[str], None] = print,
) -> list[Row]:
    """Identify what the file does not hold yet, and return all that was wanted."""
    rows = (
        [json.loads(line) for line in out.read_text("utf-8").splitlines()]
        if out.is_file()
        else []
    )
    done = {
        (row["kind"], row["seed"], row["noise"], row["channels"]): row for row in rows
    }
    left = [case for case in wanted if case not in done]
    # a fork of a process with JAX in it may never end
    alone = multiprocessing.get_context("spawn")
    with (
        ProcessPoolExecutor(workers, alone) as pool,
        out.open("a", encoding="utf-8") as file,
    ):
        futures = {pool.submit(identify, case): case for case in left}
        for future in as_completed(futures):
            row = done[futures[future]] = future.result()
            file.write(json.dumps(row) + "\n")
            file.flush()
            missed = sum(outside(row["numbers"]))
            tell(
                f"{futures[future]}: {missed} of {len(row['numbers'])} outside,"
                f" {row['seconds']:.0f} s"
            )
    return [done[case] for case in wanted]


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path, help="file of the results, a line each")
    parser.add_argument(
        "--only",
        default="",
        help="words of kind, noise and channels that must all be there",
    )
    parser.add_argument(
        "--every", type=int, default=1, help="take every so many of the identifications"
    )
    parser.add_argument("--vehicles", type=int, default=LANES, help="of each kind")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument(
        "--small", action="store_true", help="one quadrotor, into a new file"
    )
    given = parser.parse_args()
    if given.small:
        given.only, given.vehicles, given.workers = "quad,low", 1, 1
        given.out.unlink(missing_ok=True)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    words = {word for word in given.only.split(",") if word}
    wanted = [
        case for case in cases(given.vehicles) if words <= {str(part) for part in case}
    ][:: given.every]
    rows = run(wanted, given.out, given.workers, tell=progress)
    progress(table(rows))
    print_tables(rows)


if __name__ == "__main__":
    main()
