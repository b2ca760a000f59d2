"""Speed with each of several laws, of many flights at once, and of first flights:
tables of docs/data/performance.md.

python tests/studies/bench/measure_laws.py laws      print a table: laws, counts or
                                                     starts
python tests/studies/bench/measure_laws.py laws --small    every row once, whose number
                                                           means nothing

Processor time, not wall time: other programs on the machine hardly disturb it. The
ratios are medians within rounds.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[2]))

from bench_engines import Flight, steps_of
from bench_timing import Contender, contest

import skyarm
from skyarm.compile.llvm.kernel import Kernel, host_width
from skyarm.compile.llvm.llvm_text import Lanes
from support.measured_tables import print_table

ROOT = Path(__file__).resolve().parents[3]
CASE, MASS = "case3_wind", ("plant.vehicle.base.mass",)
LAWS = (
    "paper_ct",
    "paper_pd",
    "bulut2019",
    "indi",
    "l1_adaptive",
    "ct_ladder",
    "centroidal_joint",
    "centroidal_tip",
)
CALLED = ("nmpc",)
"""Laws that are called from Python, a flight at a time."""
COUNTS = (1, 8, 64, 512)
"""Flights at once."""


def flight(law: str, seconds: float) -> Flight:
    """Compiled loop of the case with a law, a mass of its own in every lane."""
    scenario = skyarm.load_scenario(CASE, controller=law, duration=seconds)
    return Flight.of(scenario, steps_of(scenario), paths=MASS)


def flown(scenario: skyarm.Scenario) -> float:
    """Simulated seconds of one flight whose law is called from Python."""
    skyarm.run(scenario)
    return scenario.duration


def runner(made: Flight, count: int, threads: int = 1) -> Contender:
    """Flights in machine code, f64."""
    width = min(host_width(), count)
    return Contender(
        "",
        "",
        made.runner(Kernel(made.loop, Lanes(width, contract=True)), count, threads),
    )


def rates(contenders: list[Contender], rounds: int) -> Iterator[tuple[float, float]]:
    """Simulated seconds per second of processor time, and the same over the first
    contender's.
    """
    for score in contest(contenders, rounds):
        yield score.work_rate, score.work_ratio


def shown(rate: float) -> str:
    """Two digits, without an exponent."""
    return f"{float(f'{rate:.2g}'):.0f}" if rate >= 10 else f"{rate:.2g}"


def of_laws(rounds: int, seconds: float) -> Iterator[list[str]]:
    """A law a row."""
    contenders = [runner(flight(law, seconds), 64) for law in LAWS]
    slow = [
        skyarm.load_scenario(CASE, controller=law, duration=min(seconds, 2.0))
        for law in CALLED
    ]
    contenders += [Contender("", "", partial(flown, each)) for each in slow]
    for law, (rate, ratio) in zip(
        (*LAWS, *CALLED), rates(contenders, rounds), strict=True
    ):
        yield [
            f"`{law}`",
            shown(rate),
            f"{1.0 / ratio:.2g}" if ratio > 0.1 else shown(1.0 / ratio),
        ]


def of_counts(rounds: int, seconds: float) -> Iterator[list[str]]:
    """A number of flights a row; the last on two threads."""
    made = flight(LAWS[0], seconds)
    cases = [*((count, 1) for count in COUNTS), (COUNTS[-1], 2)]
    contenders = [runner(made, count, threads) for count, threads in cases]
    for (count, threads), (rate, _) in zip(
        cases, rates(contenders, rounds), strict=True
    ):
        yield [str(count), str(threads), shown(rate)]


STARTED = {
    f"`{CASE}`, law `paper_ct`": (CASE, "--laws", "paper_ct"),
    f"`{CASE}`, law `centroidal_tip`": (CASE, "--laws", "centroidal_tip"),
    "`examples/press_and_slide.toml`": (
        str(ROOT / "examples" / "press_and_slide.toml"),
    ),
}
"""Flight -> words of ``skyarm run``."""


def spent(words: tuple[str, ...], folder: str) -> float:
    """Processor time of a command in a new process whose cache lies in ``folder``,
    s.
    """
    environment = {**os.environ, "SKYARM_CACHE": f"{folder}/cache"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "skyarm", "run", *words, "--out", f"{folder}/out"]
    subprocess.run(
        command, env=environment, cwd=folder, check=True, stdout=subprocess.DEVNULL
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def of_starts(rounds: int, seconds: float) -> Iterator[list[str]]:
    """A flight a row: medians of commands that find an empty cache, and of those that
    find the flight in it.
    """
    for name, words in STARTED.items():
        empty, filled = [], []
        for _ in range(rounds):
            with tempfile.TemporaryDirectory() as folder:
                empty.append(spent((*words, "--duration", f"{seconds:g}"), folder))
                filled.append(spent((*words, "--duration", f"{seconds:g}"), folder))
        yield [name, *(f"{statistics.median(each):.1f}" for each in (empty, filled))]


TABLES = {
    "laws": (
        (
            "law",
            ">simulated s per s of processor time",
            ">processor time over `paper_ct`",
        ),
        of_laws,
    ),
    "counts": (
        (">flights at once", ">threads", ">simulated s per s of processor time"),
        of_counts,
    ),
    "starts": (
        ("command `skyarm run` of", ">cold cache, s", ">warm cache, s"),
        of_starts,
    ),
}
"""Name -> heads, and rows of so many rounds and simulated seconds."""


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("table", choices=TABLES)
    parser.add_argument(
        "--small",
        action="store_true",
        help="every row once, whose number means nothing",
    )
    given = parser.parse_args()
    heads, rows = TABLES[given.table]
    print_table(heads, rows(*((1, 0.5) if given.small else (5, 10.0))))


if __name__ == "__main__":
    main()
