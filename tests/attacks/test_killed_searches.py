"""Searches for gains that are killed at random times: the same command goes on, and
every file ends the same.
"""

from __future__ import annotations

import random
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("pyarrow")
pytest.importorskip("cmaes")
pytestmark = [
    pytest.mark.attack,
    pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals"),
]

WORDS = (
    "tune",
    "hummingbird",
    "--laws",
    "decoupled_pd",
    "--candidates",
    "132",
    "--plants",
    "4",
    "--out",
    "out",
)


def started(folder: Path, *words: str) -> subprocess.Popen[str]:
    folder.mkdir(exist_ok=True)
    command = [sys.executable, "-m", "skyarm", *WORDS, "--json", *words]
    return subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def files_of(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


@pytest.mark.parametrize(("place", "least"), [("local", 10), ("processes", 6)])
def test_a_search_killed_at_random_times_ends_with_the_same_files_and_the_same_words(
    place: str, least: int, tmp_path: Path
) -> None:
    dice, words = random.Random(len(place)), ("--on", place, "--workers", "2")
    begin = time.monotonic()
    said = started(tmp_path / "whole", *words).communicate()[0]
    usual = time.monotonic() - begin
    whole = files_of(tmp_path / "whole" / "out")
    assert {"tuned.toml", "tune.html", "front_1.toml"} < set(whole)
    kills, ends, replayed = 0, 0, 0
    while kills < least or not ends:
        folder, before = tmp_path / f"killed_{ends}", 0
        while True:
            process = started(folder, *words)
            try:
                told, errors = process.communicate(
                    timeout=dice.uniform(0.3 * usual, usual)
                )
                break
            except subprocess.TimeoutExpired:
                process.send_signal(
                    dice.choice([signal.SIGKILL, signal.SIGKILL, signal.SIGINT])
                )
                process.communicate()
            kills += 1
            rows = len(list(folder.glob("out/rows/*.parquet")))
            assert rows >= before, "no row is lost"
            replayed, before = replayed + before, rows
        # a search that takes long says how far it is
        wrong = [
            line
            for line in errors.splitlines()
            if not re.fullmatch(r"skyarm: .*: \d+ of \d+ .*", line)
        ]
        assert (process.returncode, wrong) == (0, [])
        assert told == said
        assert files_of(folder / "out") == whole
        ends += 1
    assert replayed > 0
