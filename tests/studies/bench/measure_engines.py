"""Benchmark of the engines: speed against MuJoCo, accuracy, latency, start and
operations, as a record and as text.

python tests/studies/bench/measure_engines.py [--quick] [--out FILE.json] [--table
speed|times]
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

# the tests' own vehicles, when this is run as a program
sys.path.append(str(Path(__file__).parents[2]))

import bench_engines as engines
from bench_counts import counts
from bench_timing import contest, cores, describe, start
from step_times import compiled_step_time, flown_step_time

from skyarm.compile.llvm.kernel import require_machine_code
from skyarm.records.files import output_file, write_atomically
from skyarm.scenario.scenario_file import load_scenario
from skyarm.vehicle.vehicle_files import load_vehicle
from support.measured_tables import print_table

SCENARIO, LONG_ARM = "case2_gust", "hexarotor_arm6"

Progress = Callable[[str], None]


def measure(
    *, quick: bool = False, progress: Progress = lambda _: None
) -> dict[str, Any]:
    """Run all benchmarks.

    Args:
        quick: fewer rounds and shorter flights; a minute in place of several.
        progress: called with the name of each measurement.

    Raises:
        NoMachineCodeError: it is what is measured.
    """
    require_machine_code()
    about, threads, rounds = describe(), cores(), 3 if quick else 9
    scenario = load_scenario(SCENARIO, duration=10.0 if quick else None)
    vehicle = scenario.plant.vehicle
    progress("compile")
    flown = engines.flights(scenario)
    contenders = [
        engines.mujoco_rollout(vehicle, threads),
        engines.mujoco_rollout(vehicle, threads, 200, "rk4"),
        engines.mujoco_step(vehicle),
        *engines.native(flown, threads, 16 * threads),
        *(engines.native({"rk4": flown["rk4"]}, 1, 16) if threads > 1 else []),
        engines.straight_line(flown["rk4"]),
    ]
    found: dict[str, Any] = {
        "schema": 2,
        "machine": about,
        "scenario": {
            "name": scenario.name,
            "seconds": scenario.duration,
            "rounds": rounds,
            "threads": threads,
        },
        "speed": [
            dataclasses.asdict(score) for score in contest(contenders, rounds, progress)
        ],
    }
    progress("accuracy")
    found["accuracy_m"] = engines.accuracy(scenario, 3.0 if quick else 30.0)
    progress("latency")
    calls, slow = (
        20_000 if quick else 200_000,
        load_scenario(SCENARIO, controller="nmpc", duration=1.0),
    )
    in_floats = flown_step_time(load_scenario(SCENARIO, duration=10.0))
    found["latency"] = {
        "paper_ct": compiled_step_time(scenario, calls),
        "paper_ct, floats": in_floats,
        "nmpc": flown_step_time(slow),
    }
    progress("start")
    found["start_s"] = start(1 if quick else 3)
    progress("operations")
    return found | {
        "operations": {
            name: counts(load_vehicle(name)) for name in (vehicle.name, LONG_ARM)
        }
    }


def text(found: Mapping[str, Any]) -> str:
    """The measurements as text, ratios first."""
    about, flown = found["machine"], found["scenario"]
    rates = (
        f"simulated seconds per second, {flown['name']},"
        f" medians of {flown['rounds']} rounds:\n  rate, against the first in each"
        " round (smallest ... largest), the same per second of processor time"
    )
    blocks = {
        rates: speed_lines(found["speed"]),
        "largest distance from RK4 at 0.125 ms, m": [
            f"  {n:<44} {v:.2e}" for n, v in found["accuracy_m"].items()
        ],
        "one control step, microseconds: median, 99th percentile": [
            f"  {name:<16} {v['p50_us']:8.2f} {v['p99_us']:8.2f}"
            for name, v in found["latency"].items()
        ],
        "first 30 s episode of a new process, s": [
            f"  {n:<20} {v:.2f}" for n, v in found["start_s"].items()
        ],
    } | {
        f"operations, {vehicle}": [
            f"  {name:<22} {value}" for name, value in table.items()
        ]
        for vehicle, table in found["operations"].items()
    }
    head = (
        f"{about['processor']} ({about['llvm_processor']}), {about['cores']} cores,"
        f" {about['lanes_f64']} lanes f64, load {about.get('load_before', 'unknown')},"
        f" Python {about['python']}, MuJoCo {about['mujoco-core']}"
    )
    return "\n\n".join(
        [head, *("\n".join([title, *lines]) for title, lines in blocks.items())]
    )


def speed_lines(scores: Sequence[Mapping[str, Any]]) -> list[str]:
    """One line for each contender."""
    return [
        f"  {s['name']:<26} {s['rate']:10.4g} {s['ratio']:8.4g}x ({s['low']:.3g} ..."
        f" {s['high']:.3g}) {s['work_ratio']:8.4g}x  {s['what']}"
        for s in scores
    ]


SPEEDS = {
    "mujoco.rollout": (
        "`mujoco.rollout`, Euler 1 ms",
        "f64",
        "mujoco euler, 1 ms, loads held a step",
    ),
    "mujoco.rollout rk4": (
        "`mujoco.rollout`, RK4 1 ms",
        "f64",
        "mujoco rk4, 1 ms, loads held a step",
    ),
    "python rk4": ("Python floats, RK4 5 ms, one core", "f64", "rk4 f64 exact"),
    "rk4 f64 exact": (
        "machine code, RK4 5 ms, bits of Python floats",
        "f64",
        "rk4 f64 exact",
    ),
    "rk4 f64": ("machine code, RK4 5 ms", "f64", "rk4 f64"),
    "rk4 f32": ("machine code, RK4 5 ms", "f32", "rk4 f32"),
    "euler f64": ("machine code, Euler 1 ms", "f64", "euler f64"),
    "euler f32": ("machine code, Euler 1 ms", "f32", "euler f32"),
    "noise f64": ("machine code, RK4 5 ms, noise on all 23 channels", "f64", ""),
    "noise f32": ("machine code, RK4 5 ms, noise on all 23 channels", "f32", ""),
}
"""Contender -> its words in docs/data/performance.md, its floats, and its flight in the
table of accuracy."""


def speed_table(found: Mapping[str, Any]) -> None:
    """Print the table of the engines of docs/data/performance.md."""
    ratios: dict[str, float] = {}
    for each in found["speed"]:
        # all threads come first
        ratios.setdefault(each["name"].partition(", ")[0], each["ratio"])
    rows = []
    for name, (title, floats, flight) in SPEEDS.items():
        if name in ratios:
            far = found["accuracy_m"].get(flight)
            deviation = "" if far is None else f"{far:.1e}".replace("e-0", "e-")
            rows.append(
                (
                    title,
                    floats,
                    (
                        f"{ratios[name]:.3g}"
                        if ratios[name] >= 1
                        else f"{ratios[name]:.2g}"
                    ),
                    deviation,
                )
            )
    print_table(("engine", "floats", "speed", "deviation, m"), rows)


def times_table(found: Mapping[str, Any]) -> None:
    """Print the table of times of docs/data/performance.md."""
    step, start_s = found["latency"], found["start_s"]
    rows = [
        (
            "one control step, compiled",
            f"{step['paper_ct']['p50_us']:.2f} microseconds",
        ),
        (
            "one control step, not compiled",
            f"{step['paper_ct, floats']['p50_us']:.0f} microseconds",
        ),
        *(
            (
                f"first 30 s episode of a new process, {words} cache",
                f"{start_s[name]:.2f} s",
            )
            for name, words in (("empty_cache", "cold"), ("warm_cache", "warm"))
            if name in start_s
        ),
        ('`python -c "import numpy"`, for scale', f"{start_s['python_alone']:.2f} s"),
    ]
    print_table(("what", "time"), rows)


def main(words: Sequence[str] | None = None) -> None:
    """Measure, print, and write the numbers where a file is named; exit code 2 where it
    cannot be written.
    """
    parser = argparse.ArgumentParser(description="Measure every engine beside MuJoCo.")
    parser.add_argument(
        "--quick",
        action="store_true",
        help="fewer rounds, shorter flights: about a minute",
    )
    parser.add_argument(
        "--table",
        choices=("speed", "times"),
        help="print a table of docs/data/performance.md alone",
    )
    parser.add_argument("--out", help="write the numbers there too, as JSON")
    options = parser.parse_args(words)
    try:
        file = options.out and output_file(options.out, "--out")
    except OSError as error:
        parser.exit(2, f"{error}\n")
    found = measure(
        quick=options.quick, progress=lambda name: print(name, file=sys.stderr)
    )
    tables = {
        "speed": speed_table,
        "times": times_table,
        None: lambda found: print(text(found)),
    }
    tables[options.table](found)
    if file:
        write_atomically(file, (json.dumps(found, indent=1) + "\n").encode())


if __name__ == "__main__":
    main()
