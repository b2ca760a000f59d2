"""Times of batches, first and repeated commands, many vehicles and long flights, each
beside its peer or an older tree.

python tests/studies/bench/measure_speed.py [--beside OLD_TREE] [--only WORD ...]
[--rounds N] [--list] [--small]

A contender is a process of its own, which stays; in a round each measures once, in
turn, so that a busy machine slows all alike. Times are of the processor, user and
system. Of a row with a peer the column is the ratio to the peer.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[2]))

# what is measured may be of an older tree, and is imported where it is used
from support.measured_tables import print_table, progress

ROOT = Path(__file__).resolve().parents[3]
Once = Callable[[], float]
"""Measurement of a contender: processor time, memory or a share."""


@dataclass(frozen=True)
class Row:
    """A measured quantity.

    Attributes:
        make: prepares the measurement. peer: the same of what it is compared with; None
            without one.
        unit: of the first; less is better. beside: measure an older tree, too.
    """

    make: Callable[[], Once]
    peer: Callable[[], Once] | None = None
    unit: str = "s"
    beside: bool = True


SMALL = bool(os.environ.get("BENCH_SMALL"))
"""True for flights that are as short as they can be, whose numbers mean nothing."""

FIRST = (
    "carry_in_wind",
    "open_door",
    "peg_in_hole",
    "perch_on_shelf",
    "pick_and_carry",
    "pull_door",
    "push_button",
    "three_on_a_triangle",
    "turn_valve",
    "two_carry_a_bar",
    "two_hold_a_bar",
    "insert_a_peg",
    "land_on_skids",
    "pick_and_place_box",
    "push_a_button",
    "push_a_door",
)
"""Flights of contact and of teams, which are dear to compile."""


def scenario_of(name: str) -> str:
    """Shipped name or path of an example's file."""
    example = ROOT / "examples" / f"{name}.toml"
    return str(example) if example.is_file() else name


def spent(who: int = resource.RUSAGE_SELF) -> float:
    """Processor time (s) of this process or of its children up to now."""
    found = resource.getrusage(who)
    return found.ru_utime + found.ru_stime


def command(*words: str, cache: str = "") -> float:
    """Processor time (s) of a command in a new process."""
    before = spent(resource.RUSAGE_CHILDREN)
    environment = os.environ | ({"SKYARM_CACHE": cache} if cache else {})
    subprocess.run(
        [sys.executable, *words], env=environment, check=True, stdout=subprocess.DEVNULL
    )
    return spent(resource.RUSAGE_CHILDREN) - before


def run_words(name: str, folder: str, seconds: float | None = None) -> list[str]:
    """Words of ``skyarm run``."""
    duration = 0.1 if SMALL else seconds
    return [
        "-m",
        "skyarm",
        "run",
        scenario_of(name),
        "--out",
        folder,
        *(["--duration", f"{duration:g}"] if duration else []),
    ]


def timed(work: Callable[[], object]) -> float:
    """Processor time (s) of a function."""
    begin = spent()
    work()
    return spent() - begin


def ready(work: Callable[[], object]) -> Once:
    """Processor time (s) of a function that has run once already."""
    work()
    return lambda: timed(work)


def batch(name: str, seconds: float, flights: int = 64) -> Once:
    """A batch in f64, its code compiled before, on one thread."""
    from skyarm import load_scenario
    from skyarm.simulate.batch import Batch

    made, episodes = (
        Batch(load_scenario(scenario_of(name), duration=0.1 if SMALL else seconds)),
        np.arange(flights),
    )
    return ready(lambda: made.fly({}, episodes=episodes))


def skids(kind: str) -> Once:
    """A simulated second of the paper's vehicle on four skids, of MuJoCo's plant or of
    the closed loop.
    """
    from contact_speed import standing_contenders

    contenders = standing_contenders(0.1 if SMALL else 3.0, 1, 8)
    run = next(each.run for each in contenders if each.name.startswith(kind))

    simulated = run()
    return lambda: timed(run) / simulated


def first(name: str) -> Once:
    """A command of 10 s of flight that finds nothing stored."""

    def once() -> float:
        with tempfile.TemporaryDirectory() as folder:
            return command(*run_words(name, folder, 10.0), cache=f"{folder}/cache")

    return once


def third(name: str) -> Once:
    """A command that finds what two runs and the compilation behind them have
    stored.
    """
    folder = tempfile.mkdtemp()
    repeat = partial(command, *run_words(name, folder), cache=f"{folder}/cache")
    for _ in range(2):
        repeat()
    stored, end = (
        len([*Path(folder, "cache").rglob("*")]),
        time.time() + (0.0 if SMALL else 60.0),
    )
    while time.time() < end and len([*Path(folder, "cache").rglob("*")]) == stored:
        time.sleep(0.5)
    return repeat


def numpy_alone() -> Once:
    """A process that imports NumPy."""
    return lambda: command("-c", "import numpy")


def million() -> Once:
    """A sweep of 2000 flights, in f32 on one thread, whose code is stored."""
    from measure_million import STUDY

    folder = tempfile.mkdtemp()
    study = Path(folder) / "million.toml"
    study.write_text(
        STUDY.format(episodes=10 if SMALL else 2000, precision="single"), "utf-8"
    )
    words, numbers = (
        [
            "-m",
            "skyarm",
            "sweep",
            str(study),
            "--workers",
            "1",
            "--out",
        ],
        iter(range(10**6)),
    )

    def once() -> float:
        return command(*words, f"{folder}/out{next(numbers)}", cache=f"{folder}/cache")

    once()  # compiles
    return once


def fleet(count: int, seconds: float) -> Any:
    """Scenario of hexarotors with the arm of the paper beside each other."""
    from skyarm import scenario_from

    def agent(i: int) -> dict[str, Any]:
        points = [[0.0, 2.0 * i, 0.3], [1.0, 2.0 * i, 1.3]]
        return {
            "reference": {
                "base": {"kind": "waypoints", "points": points, "times": [0.0, 2.0]}
            }
        }

    shared = {"schema": 1, "name": "fleet", "duration": 0.1 if SMALL else seconds}
    vehicles = {
        "plant": {"vehicle": "hummingbird_arm2_rotors"},
        "controller": {"preset": "centroidal_joint"},
    }
    return scenario_from(
        {**shared, **vehicles, "agents": {f"a{i}": agent(i) for i in range(count)}}
    )


def flown(count: int, seconds: float, *, fly: bool) -> Once:
    """Compilation of equal vehicles, nothing stored, with or without their flight."""
    from skyarm import run
    from skyarm.simulate.engine import EpisodeCode

    scenario = fleet(count, seconds)

    def once() -> float:
        with tempfile.TemporaryDirectory() as folder:
            os.environ["SKYARM_CACHE"] = folder
            return timed(
                lambda: run(scenario) if fly else EpisodeCode(scenario, commands=False)
            )

    return once


def alone(name: str) -> Once:
    """A single flight in optimised code."""
    from skyarm import load_scenario
    from skyarm.simulate.engine import Engine, EpisodeCode

    scenario = load_scenario(scenario_of(name), duration=0.1 if SMALL else None)
    code = EpisodeCode(scenario, commands=False, effort=2)

    def fly() -> None:
        engine = Engine(code)
        while engine.fly(scenario.steps):
            pass

    return ready(fly)


def memory(seconds: float) -> Once:
    """Largest memory (MB) of a command of case3."""

    def once() -> float:
        with tempfile.TemporaryDirectory() as folder:
            command(*run_words("case3", folder, seconds))
        return resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / (
            1e6 if sys.platform == "darwin" else 1e3
        )

    return once


CHAINS, LINKS = 12, 50
"""Independent chains of fused products and sums, and the length of one in a step:
enough of them to hide the delay."""


def chains(carry: Any, given: Any, *_: Any) -> Any:
    """A step of the chains."""
    for _each in range(LINKS):
        carry = tuple(x * given[0] + given[1] for x in carry)
    return carry, ()


def peak_flops() -> Once:
    """Time (s) of an operation in a loop of nothing but fused products and sums in
    registers: two operations each.
    """
    from skyarm.compile.llvm.kernel import Kernel, host_width
    from skyarm.compile.llvm.llvm_text import Lanes
    from skyarm.compile.tracing.program import trace_loop

    kernel = Kernel(
        trace_loop(chains, (0.5,) * CHAINS, (0.9, 0.1), ()),
        Lanes(host_width(), contract=True),
    )
    lanes, steps = 8 * host_width(), 100 if SMALL else 20_000
    given = (
        np.full((CHAINS, lanes), 0.5),
        np.full((2, lanes), 0.5),
        np.zeros((steps, 0)),
    )
    once = ready(lambda: kernel.run(*given))
    return lambda: once() / (2.0 * CHAINS * LINKS * lanes * steps)


def loop_flops() -> Once:
    """Time (s) of an operation of the closed loop of case3 in f64; a fused product and
    sum are two.
    """
    from bench_engines import Flight, steps_of

    from skyarm import load_scenario
    from skyarm.compile.llvm.kernel import Kernel, host_width
    from skyarm.compile.llvm.llvm_text import Lanes
    from skyarm.compile.tracing.lower import operations

    scenario = load_scenario("case3", duration=0.1 if SMALL else None)
    made, lanes = Flight.of(scenario, steps_of(scenario)), 8 * host_width()
    once = ready(
        made.runner(Kernel(made.loop, Lanes(host_width(), contract=True)), lanes, 1)
    )
    return lambda: (
        once() / (operations(made.loop.program.nodes) * lanes * scenario.steps)
    )


ROWS = {
    "batch pick_and_carry": Row(partial(batch, "pick_and_carry", 3.0)),
    "batch push_button": Row(partial(batch, "push_button", 3.0)),
    "batch land_on_skids": Row(partial(batch, "land_on_skids", 6.0)),
    "batch three_on_a_triangle": Row(partial(batch, "three_on_a_triangle", 3.0)),
    "skids f64, beside mujoco.rollout": Row(
        partial(skids, "contact f64"), partial(skids, "mujoco")
    ),
    "skids f32, beside mujoco.rollout": Row(
        partial(skids, "contact f32"), partial(skids, "mujoco")
    ),
    "third run two_carry_a_bar": Row(partial(third, "two_carry_a_bar")),
    **{f"first run {name}": Row(partial(first, name)) for name in FIRST},
    "sweep of 2000 of the million": Row(million),
    "third run case3, beside import numpy": Row(partial(third, "case3"), numpy_alone),
    "compile eight, beside one": Row(
        partial(flown, 8, 20.0, fly=False), partial(flown, 1, 20.0, fly=False)
    ),
    "compile and fly eight": Row(partial(flown, 8, 20.0, fly=True)),
    **{
        f"flight {name}": Row(partial(alone, name))
        for name in ("case3", "case3_wind", "press_and_hold")
    },
    "memory case3, 30 s": Row(partial(memory, 30.0), unit="MB"),
    "memory case3, an hour": Row(partial(memory, 3600.0), unit="MB", beside=False),
    "operation of case3, beside the peak": Row(loop_flops, peak_flops),
}


class Contender:
    """Process that measures when it is asked.

    Args:
        name: of the row. peer: measure its peer. tree: its library.
    """

    def __init__(self, name: str, *, peer: bool = False, tree: Path = ROOT) -> None:
        rooms = [
            tree / "src",
            tree / "tests",
            tree / "tests" / "studies" / "bench",
            Path(__file__).parent,
        ]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, rooms))}
        # -P: where an older tree has a module of the bench, it is that one
        words = [
            sys.executable,
            "-P",
            __file__,
            "--serve",
            name,
            *(["--peer"] if peer else []),
        ]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(
            words, stdin=pipe, stdout=pipe, env=environment, text=True
        )

    def measure(self) -> float:
        """Measure once; NaN if the process has failed, whose error is on the standard
        error.
        """
        pipes = self._process.stdin, self._process.stdout
        assert pipes[0] is not None
        assert pipes[1] is not None
        try:
            print("go", file=pipes[0], flush=True)
        except BrokenPipeError:
            return float("nan")
        return float(pipes[1].readline() or "nan")

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def serve(once: Once) -> None:
    """Measure for every line of the standard input."""
    for _ in sys.stdin:
        print(repr(once()), flush=True)


def measured(name: str, beside: Path | None, rounds: int) -> list[str]:
    """Cells of a row: measured here, its share of the peer's, and of the older tree's
    in the same rounds.
    """
    row = ROWS[name]
    here = [Contender(name)]
    peers = [Contender(name, peer=True)] if row.peer else []
    olds = [Contender(name, tree=beside)] if beside and row.beside else []
    contenders = [*here, *peers, *olds]
    try:
        found = [[each.measure() for each in contenders] for _ in range(rounds)]
    finally:
        for each in contenders:
            each.close()

    def over(column: int) -> str:
        return f"{statistics.median(line[0] / line[column] for line in found):.3g}"

    return [
        name,
        f"{statistics.median(line[0] for line in found):.3g} {row.unit}",
        over(1) if peers else "",
        over(len(peers) + 1) if olds else "",
    ]


def main(words: Sequence[str] | None = None) -> None:
    """Print a row after the other."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--beside",
        type=Path,
        help="folder of an older tree, whose src is measured in the same rounds",
    )
    parser.add_argument(
        "--only",
        nargs="+",
        default=[""],
        help="rows with one of these words in their names",
    )
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--list", action="store_true", help="names of the rows")
    parser.add_argument(
        "--small",
        action="store_true",
        help="a round of flights of 0.1 s, whose numbers mean nothing",
    )
    parser.add_argument("--serve", choices=ROWS, help=argparse.SUPPRESS)
    parser.add_argument("--peer", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args(words)
    if given.serve:
        row = ROWS[given.serve]
        serve((row.peer if given.peer and row.peer else row.make)())
        return
    names = [name for name in ROWS if any(word in name for word in given.only)]
    if given.list:
        print(*names, sep="\n")
        return
    if given.beside and not (given.beside / "src" / "skyarm").is_dir():
        parser.exit(
            2,
            f"--beside = {given.beside}: must be the folder of a tree, with src/skyarm"
            " in it\n",
        )
    if given.small:
        os.environ["BENCH_SMALL"] = "1"
    from bench_timing import describe

    about = describe()
    machine = (
        f"{about['processor']}, {about['llvm_processor']}, {about['lanes_f64']}"
        " lanes f64"
    )
    progress(f"{machine}, load {about.get('load_before')}; {len(names)} rows")
    rows = (
        measured(name, given.beside, 1 if given.small else given.rounds)
        for name in names
    )
    heads = (
        f"less is better; {machine}",
        ">here",
        ">over the peer",
        ">over the older tree",
    )
    print_table(heads, rows)


if __name__ == "__main__":
    main()
