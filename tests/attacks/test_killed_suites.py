"""Comparisons that are killed at random times, in processes and on threads: the folder
ends with the same bytes.
"""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from support.studies import files_of

pytest.importorskip("pyarrow")
pytestmark = [
    pytest.mark.attack,
    pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals"),
]

SUITE = [
    "envelope-suite",
    "--quick",
    "--only",
    "circle,step,swing,push_x",
    "--laws",
    "paper_pd,paper_ct",
    "-q",
]

WRITTEN = (
    "rows/*.parquet",
    "envelope.json",
    "report.html",
    "envelope.png",
    "flights.parquet",
)
"""What may be there at the moment of a kill; of rows some."""


def begun(folder: Path, on: str) -> subprocess.Popen[bytes]:
    command = [
        sys.executable,
        "-m",
        "skyarm",
        "compare",
        *SUITE,
        "--out",
        str(folder),
        "--workers",
        "2",
        "--on",
        on,
    ]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


def flown(folder: Path, on: str) -> float:
    """Fly a suite to its end; returns how many seconds it took."""
    begin = time.monotonic()
    with begun(folder, on) as process:
        error = process.stderr.read() if process.stderr else b""
    assert (process.returncode, error) == (0, b"")
    return time.monotonic() - begin


def killed(folder: Path, on: str, dice: random.Random, longest: float) -> bool:
    """Kill a suite at a random time, or shortly after a file has come; True if it was
    alive.
    """
    wanted, count = dice.choice(WRITTEN), dice.randrange(1, 8)
    enough = 1 if "*" not in wanted else count
    end = time.monotonic() + dice.uniform(0.0, longest) if dice.random() < 0.5 else None
    with begun(folder, on) as process:
        while process.poll() is None and not (
            len(list(folder.glob(wanted))) >= enough
            if end is None
            else time.monotonic() >= end
        ):
            time.sleep(0.002)
        time.sleep(dice.uniform(0.0, 0.02))
        process.send_signal(signal.SIGKILL)
    return process.returncode == -signal.SIGKILL


@pytest.mark.parametrize("on", ["local", "processes"])
@pytest.mark.parametrize("kills", [12])
def test_kills_at_random_times_leave_the_bytes_of_an_uninterrupted_suite(
    tmp_path: Path, kills: int, on: str
) -> None:
    longest = flown(tmp_path / "whole", on)
    right, dice, done, round_ = files_of(tmp_path / "whole"), random.Random(kills), 0, 0
    assert sum(name.startswith("rows/") for name in right) == 8
    while done < kills:
        folder = tmp_path / str(round_)
        for _ in range(dice.randrange(1, 4)):
            done += killed(folder, on, dice, longest)
        flown(folder, on)
        assert files_of(folder) == right
        round_ += 1
