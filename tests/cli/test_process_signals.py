"""Signals end a command with one line, whenever they come; a parent that is killed
takes its workers along.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from skyarm.log.formats import load_log
from support.cases import sampled

if sys.platform == "win32":
    pytest.skip("signals of POSIX", allow_module_level=True)

COMMAND = [sys.executable, "-W", "error", "-m", "skyarm"]
LONG_RUN = ["run", "case3", "--duration", "2000"]
REPRODUCE = ["reproduce", "--workers", "2"]
COMPARE = [
    "compare",
    "--laws",
    "nmpc",
    "--only",
    "noisy",
    "--workers",
    "2",
    "--out",
    "out",
]
INTERRUPTED = "skyarm: interrupted; finished files are whole\n"
PATIENCE = 60.0
"""s, on a busy machine."""


# what a shell in the foreground gives: `nohup make test &` leaves Ctrl-C and HUP
# ignored, which is inherited
USUAL = """
import os, signal, sys
for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
    signal.signal(each, signal.SIG_DFL)
os.execv(sys.argv[1], sys.argv[1:])
"""
UNDISTURBED = [sys.executable, "-c", USUAL]


def started(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    command = [*UNDISTURBED, *COMMAND, *arguments]
    pipe = subprocess.PIPE
    # a group of its own: a terminal sends the interrupt to every process of it, the
    # workers too
    return subprocess.Popen(
        command, cwd=folder, stderr=pipe, stdout=pipe, text=True, start_new_session=True
    )


def members(group: int) -> list[int]:
    """Processes of a group that still run."""
    listed = subprocess.run(
        ["ps", "-A", "-o", "pid=,pgid=,stat="],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    rows = [line.split() for line in listed.splitlines()]
    return [
        int(pid)
        for pid, own, state in rows
        if int(own) == group and not state.startswith("Z")
    ]


def wait_until(true: Callable[[], bool]) -> None:
    begun = time.monotonic()
    while not true():
        assert time.monotonic() - begun < PATIENCE, "waited in vain"
        time.sleep(0.05)


def flying(folder: Path, process: subprocess.Popen[str], processes: int) -> None:
    """Wait until all processes of a command are there, and some time, most of it that
    of flights.
    """
    wait_until(
        lambda: (folder / "out").exists() and len(members(process.pid)) >= processes
    )
    time.sleep(1.0)


def said(errors: str) -> str:
    """Standard error without its lines of progress."""
    return "".join(
        line
        for line in errors.splitlines(keepends=True)
        if not re.search(r": \d+ of \d+", line)
    )


@pytest.mark.parametrize(
    ("arguments", "processes"),
    sampled(
        [(["run", "case3", "--duration", "2000"], 1), (REPRODUCE, 3), (COMPARE, 3)], 3
    ),
)
def test_ctrl_c_is_one_line_and_leaves_no_part_of_a_file(
    tmp_path: Path, arguments: list[str], processes: int
) -> None:
    with started(tmp_path, *arguments) as process:
        flying(tmp_path, process, processes)
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    goes_on = "" if arguments[0] == "run" else "; the same command goes on"
    assert said(errors) == INTERRUPTED.replace("\n", f"{goes_on}\n")
    files = [path for path in (tmp_path / "out").rglob("*") if path.is_file()]
    if arguments[0] != "run":
        assert not files
        return
    # a flight keeps what has been flown
    assert sorted(path.name for path in files) == ["case3.csv", "case3.npz"]
    log = load_log(tmp_path / "out" / "run" / "case3.npz")
    assert (log.status, log.time.size) == ("running", round(200 * log.info["end_time"]))
    assert 0 < log.time.size < 400_000


@pytest.mark.parametrize("number", sampled([signal.SIGTERM, signal.SIGHUP], 2))
def test_term_and_hup_of_the_parent_are_one_line_and_end_its_workers(
    tmp_path: Path, number: signal.Signals
) -> None:
    with started(tmp_path, *REPRODUCE) as process:
        flying(tmp_path, process, 3)
        os.kill(process.pid, number)
        _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 128 + number
    assert said(errors).startswith("skyarm: ended")
    assert number.name in errors
    assert said(errors).count("\n") == 1
    wait_until(lambda: not members(process.pid))


@pytest.mark.thorough
def test_workers_of_a_parent_that_is_killed_end_with_it(tmp_path: Path) -> None:
    with started(tmp_path, *REPRODUCE) as process:
        try:
            flying(tmp_path, process, 3)
            os.kill(process.pid, signal.SIGKILL)
            process.wait(timeout=PATIENCE)
            killed = time.monotonic()
            # within 2 s; ten times that for a machine that has other work
            while members(process.pid) and time.monotonic() - killed < 20.0:
                time.sleep(0.1)
            assert not members(process.pid)
        finally:
            for each in members(process.pid):
                os.kill(each, signal.SIGKILL)


LOADING = """
import os, runpy, signal, sys

class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == moment:
            os.kill(os.getpid(), signal.SIGINT)

moment, sys.argv = sys.argv[1], ["skyarm", *sys.argv[2:]]
sys.meta_path.insert(0, Interrupting())
runpy.run_module("skyarm", run_name="__main__")
"""


@pytest.mark.parametrize(
    "library",
    ["typer", "rich.console", "skyarm.cli.commands", "numpy", "numpy.linalg", "mujoco"],
)
def test_ctrl_c_while_libraries_load_is_one_line(tmp_path: Path, library: str) -> None:
    flight = ["run", "case1", "--plant", "mujoco", "--duration", "0.1"]
    command = [*UNDISTURBED, sys.executable, "-c", LOADING, library, *flight]
    result = subprocess.run(
        command,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert (result.returncode, result.stderr) == (130, INTERRUPTED)
