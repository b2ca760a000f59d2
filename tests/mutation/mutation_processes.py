"""Pytest in forked processes: the heavy libraries are imported once, skyarm and the
tests anew in each process.
"""

from __future__ import annotations

import importlib
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

HEAVY = (
    "numpy",
    "scipy.linalg",
    "scipy.optimize",
    "mujoco",
    "pinocchio",
    "llvmlite.binding",
    "hypothesis",
    "typer",
    "rich",
)
LATE = -1  # the exit status of a process that ran past its time
NONE_CHOSEN = 5  # pytest's, when no test was collected
TESTS = Path(__file__).resolve().parents[1]


def import_heavy() -> None:
    """Import what every test needs; a library that is not there is left out. (JAX does
    not bear a fork.)
    """
    import pytest  # noqa: F401

    for name in HEAVY:
        try:
            importlib.import_module(name)
        except ImportError:
            continue


def run_pytest(
    source: Path,
    arguments: Sequence[str],
    environment: dict[str, str],
    plugins: Callable[[], list[Any]],
) -> int:
    """Run pytest in this process on the package in `source` and return its exit
    status.
    """
    import pytest

    paths = [str(source), environment.pop("PYTHONPATH", "")]
    os.environ.update(environment, PYTHONPATH=os.pathsep.join(filter(None, paths)))
    sys.path.insert(0, str(source))
    os.chdir(TESTS.parent)
    common = [
        "-n0",
        "-W",
        "ignore::pytest.PytestAssertRewriteWarning",
        "-p",
        "no:cacheprovider",
        "--rootdir",
        str(TESTS.parent),
        "--no-header",
        "-p",
        "no:faulthandler",
    ]
    return int(pytest.main([*common, *arguments], plugins=plugins()))


def forked(work: Callable[[], int], output: Path) -> int:
    """Start `work` in a process group of its own, its output in a file; returns the
    process id.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    if pid := os.fork():
        return pid
    status = 70
    try:
        os.setsid()
        file = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
        nothing = os.open(os.devnull, os.O_RDONLY)
        for source, target in ((nothing, 0), (file, 1), (file, 2)):
            os.dup2(source, target)
        status = work()
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


def wait(pid: int, limit: float) -> int:
    """Return the exit status of a process, negative for a signal; LATE if it had to be
    ended after `limit` seconds.
    """
    end = time.monotonic() + limit
    while time.monotonic() < end:
        done, status = os.waitpid(pid, os.WNOHANG)
        if done:
            kill_group(pid)
            return (
                os.waitstatus_to_exitcode(status)
                if not os.WIFSIGNALED(status)
                else 128 + os.WTERMSIG(status)
            )
        time.sleep(0.02)
    kill_group(pid)
    os.waitpid(pid, 0)
    return LATE


def kill_group(pid: int) -> None:
    """End what a process left behind."""
    try:
        os.killpg(pid, signal.SIGKILL)
    except (ProcessLookupError, PermissionError):
        return
