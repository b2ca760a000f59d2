"""Runs that end at the same time in one folder, as processes: every finished flight
stays.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from skyarm.log.formats import load_log

pytestmark = [
    pytest.mark.attack,
    pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals"),
]

HELD = """
import sys, time
from pathlib import Path
from skyarm.cli import run_command
usual = run_command.save_log
def held(log, path):
    Path("looked").touch()
    while not Path("go").exists():
        time.sleep(0.01)
    return usual(log, path)
run_command.save_log = held
from skyarm.cli.main import main
sys.exit(main())
"""

WORDS = ("run", "case1", "--duration", "0.1", "--out", "logs", "--json")


def started(folder: Path, seed: int, *program: str) -> subprocess.Popen[str]:
    command = [
        sys.executable,
        *(program or ("-m", "skyarm")),
        *WORDS,
        "--seed",
        str(seed),
    ]
    return subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def seeds(folder: Path) -> list[int]:
    """Seeds of the flights whose logs are in a folder; each has its table."""
    logs = sorted(folder.glob("*.npz"))
    assert {file.with_suffix(".csv").name for file in logs} == {
        file.name for file in folder.glob("*.csv")
    }
    return sorted(load_log(file).info["seed"] for file in logs)


def ended(process: subprocess.Popen[str]) -> int:
    out, errors = process.communicate(timeout=120)
    assert errors == ""
    assert json.loads(out)["command"] == "run"
    return process.returncode


def test_a_process_is_held_between_its_look_and_its_write(tmp_path: Path) -> None:
    first = started(tmp_path, 1, "-c", HELD)
    while not (tmp_path / "looked").exists():
        assert first.poll() is None
        time.sleep(0.01)
    second = started(tmp_path, 2)
    with pytest.raises(subprocess.TimeoutExpired):
        second.wait(timeout=6.0)
    (tmp_path / "go").touch()
    assert (ended(first), ended(second)) == (0, 0)
    assert seeds(tmp_path / "logs") == [1, 2]
    assert len(list((tmp_path / "logs").iterdir())) == 4


def test_a_process_that_is_killed_there_holds_nobody_up(tmp_path: Path) -> None:
    first = started(tmp_path, 1, "-c", HELD)
    while not (tmp_path / "looked").exists():
        assert first.poll() is None
        time.sleep(0.01)
    first.send_signal(signal.SIGKILL)
    first.communicate()
    assert ended(started(tmp_path, 2)) == 0
    assert seeds(tmp_path / "logs") == [2]
    assert len(list((tmp_path / "logs").iterdir())) == 2


def test_twenty_rounds_of_six_at_once_lose_no_flight(tmp_path: Path) -> None:
    for round_ in range(20):
        folder = tmp_path / str(round_)
        folder.mkdir()
        running = [started(folder, seed) for seed in range(6)]
        assert [ended(process) for process in running] == [0] * 6
        assert seeds(folder / "logs") == list(range(6)), round_
