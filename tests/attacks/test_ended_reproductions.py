"""Reproductions of the paper that are killed at random times, then repeated: every file
has the same bytes.
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
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")

PROGRAM = """
import sys, threading
from functools import partial
from skyarm.paper import reproduce as room
room.run_campaign = partial(room.run_campaign, sensitivity=False, inferred=False)
room.DPI = 30
room.reproduce(sys.argv[1], plants=("rigid_body",), workers=int(sys.argv[2]))
"""
"""Ten of the paper's flights in place of all, in small pictures: seconds in place of
half a minute."""

KILLS = 20


def _command(folder: Path, workers: int) -> list[str]:
    return [sys.executable, "-c", PROGRAM, str(folder), str(workers)]


def _whole(folder: Path, workers: int) -> dict[str, bytes]:
    """Files of a reproduction that nobody kills."""
    done = subprocess.run(
        _command(folder, workers), capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return files_of(folder)


@pytest.mark.attack
def test_twenty_kills_at_random_leave_the_bytes_of_an_uninterrupted_reproduction(
    tmp_path: Path,
) -> None:
    begin = time.monotonic()
    right = _whole(tmp_path / "whole", 1)
    longest = time.monotonic() - begin
    assert sum(name.startswith("rows/") for name in right) == 10
    dice, kills, round_ = random.Random(20), 0, 0
    while kills < KILLS:
        folder = tmp_path / str(round_)
        for k in range(8):
            process = subprocess.Popen(
                _command(folder, 1 + k % 2), stderr=subprocess.DEVNULL
            )
            try:
                process.wait(dice.uniform(0.1, 1.0) * longest)
                break
            except subprocess.TimeoutExpired:
                process.kill()
                kills += process.wait() == -signal.SIGKILL
        found = _whole(folder, 2)
        assert sorted(found) == sorted(right)
        assert [name for name in right if found[name] != right[name]] == []
        round_ += 1
