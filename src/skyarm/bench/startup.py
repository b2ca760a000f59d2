"""From a new process to its first finished episode."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

SCENARIO = "case2_gust"

PROGRAM = f"""
from skyarm import load_scenario, run

run(load_scenario("{SCENARIO}"))
"""


def start(rounds: int) -> dict[str, float]:
    """Seconds from the start of a process to its end: medians.

    ``empty_cache`` and ``warm_cache`` fly a scenario of 30 s and hold its log; ``command``... are ``skyarm run``, which
    writes the log as npz and CSV and prints a table.
    """
    found: dict[str, list[float]] = {}
    for _ in range(rounds):
        for name, words in (("", ("-c", PROGRAM)), ("command_", ("-m", "skyarm", "run", SCENARIO, "--out", "out"))):
            with tempfile.TemporaryDirectory() as folder:
                for cache in ("empty_cache", "warm_cache"):
                    found.setdefault(f"{name}{cache}", []).append(_timed(words, Path(folder)))
        found.setdefault("python_alone", []).append(_timed(("-c", "import numpy"), Path()))
    return {name: statistics.median(values) for name, values in found.items()}


def _timed(words: Sequence[str], folder: Path) -> float:
    environment = {**os.environ, "SKYARM_CACHE": str(folder.absolute() / "cache")}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # an installed library has its bytecode
    begin = time.perf_counter()
    subprocess.run([sys.executable, *words], env=environment, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - begin
