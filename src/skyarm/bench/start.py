"""From a new process to its first finished episode."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PROGRAM = """
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.native import fly
from skyarm.simulate.scenario_file import load_scenario

scenario = load_scenario("case2_gust")
fly(scenario, episode_inputs(scenario))
"""


def start(rounds: int) -> dict[str, float]:
    """Seconds from the start of a process to the end of its first 30 s episode: medians."""
    found: dict[str, list[float]] = {"python_alone": [], "empty_cache": [], "warm_cache": []}
    for _ in range(rounds):
        with tempfile.TemporaryDirectory() as folder:
            for name, program in (("python_alone", "import numpy"), ("empty_cache", PROGRAM), ("warm_cache", PROGRAM)):
                found[name].append(_timed(program, Path(folder)))
    return {name: statistics.median(values) for name, values in found.items()}


def _timed(program: str, cache: Path) -> float:
    environment = {**os.environ, "SKYARM_CACHE": str(cache)}
    begin = time.perf_counter()
    subprocess.run([sys.executable, "-c", program], env=environment, check=True)
    return time.perf_counter() - begin
