"""Timing: contenders in turn (A B C A B C ...), so that a busy machine slows all alike;
new processes; the machine.
"""

from __future__ import annotations

import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from skyarm.compile.llvm.kernel import host_width
from skyarm.records.files.packages import ABSENT, versions


@dataclass(frozen=True, slots=True)
class Contender:
    """Something that simulates.

    Attributes:
        name: short. what: in words. run: does a fixed piece of work and returns the
            seconds it simulated.
    """

    name: str
    what: str
    run: Callable[[], float]


@dataclass(frozen=True, slots=True)
class Score:
    """Simulated seconds per second of wall time: median over the rounds, and the same
    against the baseline.

    Attributes:
        ratio: median of the ratios within each round. low, high: their smallest and
            largest.
        work_rate, work_ratio: the same per second of processor time of all threads,
            which other programs on the machine hardly disturb.
    """

    name: str
    what: str
    rate: float
    ratio: float
    low: float
    high: float
    work_rate: float
    work_ratio: float


def contest(
    contenders: Sequence[Contender],
    rounds: int,
    progress: Callable[[str], None] = lambda _: None,
) -> list[Score]:
    """Run the contenders in turn; the first is the baseline of the ratios. An uncounted
    first round warms up.
    """
    rates: list[list[float]] = [[] for _ in contenders]
    works: list[list[float]] = [[] for _ in contenders]
    for number in range(rounds + 1):
        for contender, rate, work in zip(contenders, rates, works, strict=True):
            progress(contender.name)
            begin, worked = time.perf_counter(), time.process_time()
            seconds = contender.run()
            spent, done = time.perf_counter() - begin, time.process_time() - worked
            if number:
                rate.append(seconds / spent)
                work.append(seconds / done)
    scores = []
    for contender, rate, work in zip(contenders, rates, works, strict=True):
        ratios = _against(rate, rates[0])
        score = Score(
            name=contender.name,
            what=contender.what,
            rate=statistics.median(rate),
            ratio=statistics.median(ratios),
            low=min(ratios),
            high=max(ratios),
            work_rate=statistics.median(work),
            work_ratio=statistics.median(_against(work, works[0])),
        )
        scores.append(score)
    return scores


def _against(rates: Sequence[float], baseline: Sequence[float]) -> list[float]:
    return [a / b for a, b in zip(rates, baseline, strict=True)]


def cores() -> int:
    """Cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def describe() -> dict[str, Any]:
    """Processor, cores, vector width, load before the measurement, versions."""
    import llvmlite.binding as llvm

    found: dict[str, Any] = {
        "processor": _model(),
        "llvm_processor": llvm.get_host_cpu_name(),
        "cores": cores(),
        "lanes_f64": host_width(),
        "system": f"{platform.system()} {platform.machine()}",
    }
    if hasattr(os, "getloadavg"):
        found["load_before"] = round(os.getloadavg()[0], 2)
    there = versions("numpy", "llvmlite", "mujoco-core", "jax", "pin")
    return found | {
        name: None if version == ABSENT else version for name, version in there.items()
    }


def _model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or "unknown"
    names = [
        line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")
    ]
    return names[0] if names else platform.processor() or "unknown"


STARTED = "case2_gust"

PROGRAM = f"""
from skyarm import load_scenario, run

run(load_scenario("{STARTED}"))
"""


def start(rounds: int) -> dict[str, float]:
    """Seconds from the start of a process to its end: medians.

    ``empty_cache`` and ``warm_cache`` fly a scenario of 30 s and hold its log;
    ``command``... are ``skyarm run``, which writes the log as npz and CSV and prints a
    table.
    """
    found: dict[str, list[float]] = {}
    for _ in range(rounds):
        for name, words in (
            ("", ("-c", PROGRAM)),
            ("command_", ("-m", "skyarm", "run", STARTED, "--out", "out")),
        ):
            with tempfile.TemporaryDirectory() as folder:
                for cache in ("empty_cache", "warm_cache"):
                    found.setdefault(f"{name}{cache}", []).append(
                        _wall_time(words, Path(folder))
                    )
        found.setdefault("python_alone", []).append(
            _wall_time(("-c", "import numpy"), Path())
        )
    return {name: statistics.median(values) for name, values in found.items()}


def _wall_time(words: Sequence[str], folder: Path) -> float:
    environment = {**os.environ, "SKYARM_CACHE": str(folder.absolute() / "cache")}
    # an installed library has its bytecode
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    begin = time.perf_counter()
    subprocess.run(
        [sys.executable, *words],
        env=environment,
        cwd=folder,
        check=True,
        stdout=subprocess.DEVNULL,
    )
    return time.perf_counter() - begin
