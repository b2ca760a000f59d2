"""Time of a million episodes of Case 3 by ``skyarm sweep``, in both precisions: a table
of docs/data/performance.md.

python tests/studies/bench/measure_million.py [--episodes N] [--workers 2] [--small]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[2]))

from support.measured_tables import print_table

STUDY = """
schema = 1
name = "million"
scenario = "case3"
episodes = {episodes}
seed = 1
precision = "{precision}"
metrics = ["ee_error_mean"]
[vary]
"plant.vehicle.base.mass" = {{ uniform = [0.75, 0.85] }}
"plant.payload.mass" = {{ uniform = [0.0, 0.05] }}
"plant.vehicle.links.0.joint.damping" = {{ log_uniform = [0.0005, 0.01] }}
"plant.vehicle.links.1.joint.damping" = {{ log_uniform = [0.0005, 0.01] }}
"reference.base.radius" = {{ uniform = [0.2, 0.4] }}
"""
"""Five varied numbers; flights of 30 s."""

PRECISIONS = {"f32": "single", "f64": "double"}


def seconds_of(episodes: int, precision: str, workers: int) -> float:
    """Time of the command, with its compiler and its files."""
    with tempfile.TemporaryDirectory() as folder:
        study = Path(folder) / "million.toml"
        study.write_text(STUDY.format(episodes=episodes, precision=precision), "utf-8")
        command = [
            sys.executable,
            "-m",
            "skyarm",
            "sweep",
            str(study),
            "--workers",
            str(workers),
        ]
        begin = time.perf_counter()
        subprocess.run(
            [*command, "--out", f"{folder}/out"], check=True, stdout=subprocess.DEVNULL
        )
        return time.perf_counter() - begin


def rows(episodes: int, workers: int) -> Iterator[list[str]]:
    """A precision a row."""
    for floats, precision in PRECISIONS.items():
        yield [floats, f"{seconds_of(episodes, precision, workers):.1f}"]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--episodes", type=int, default=1_000_000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument(
        "--small",
        action="store_true",
        help="a hundred episodes, whose time means nothing",
    )
    given = parser.parse_args()
    print_table(
        ("a million episodes of 30 s", "time, s"),
        rows(100 if given.small else given.episodes, given.workers),
    )


if __name__ == "__main__":
    main()
