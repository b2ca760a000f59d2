"""Processes that fly end with what asked for them, whatever they are doing; a killed
one costs only what it flew.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from skyarm.records.files.user_code import OwnCodeError
from skyarm.records.travel import luggage
from skyarm.studies.flights.processes import MOST_TRIES, serve
from support.flights import elsewhere, processes

CUT_OFF = """
import os, struct, sys, time
from pathlib import Path
from skyarm.records.travel import luggage
from skyarm.studies.flights.processes import Processes

def half_a_result(flag):
    frame = sys._getframe()
    while "result_queue" not in frame.f_locals:
        frame = frame.f_back
    # the length of a message, and nothing of it
    os.write(frame.f_locals["result_queue"]._writer.fileno(), struct.pack("!i", 1000))
    Path(flag).touch()
    time.sleep(60.0)

if __name__ == "__main__":
    pool = Processes(2)
    try:
        pool.submit("half", half_a_result, "flag")
        while not Path("flag").exists():
            time.sleep(0.05)
        raise KeyboardInterrupt
    except KeyboardInterrupt:
        pool.close(abandon=True)
        print("over")
"""


def test_an_interrupt_while_a_process_sends_a_result_ends_at_once(
    tmp_path: Path,
) -> None:
    (tmp_path / "cut_off.py").write_text(CUT_OFF)
    command = [sys.executable, "cut_off.py"]
    ended = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=45.0, check=False
    )
    assert (ended.returncode, ended.stdout) == (0, "over\n"), ended.stderr


def test_what_is_handed_over_comes_back() -> None:
    with processes(2) as pool:
        for k in (3, 5):
            pool.submit(k, divmod, 17, k)
        assert pool.flying == 2
        assert dict(pool.collect() for _ in range(2)) == {3: (5, 2), 5: (3, 2)}
        assert pool.flying == 0


def test_an_error_in_a_process_is_the_parents() -> None:
    with pytest.raises(ZeroDivisionError):
        elsewhere(divmod, 1, 0)


def killed_until(flag: str, times: int) -> int:
    """Kill the own process some times; returns the number of the try that is let
    live.
    """
    with open(flag, "ab") as file:
        file.write(b"x")
    count = Path(flag).stat().st_size
    if count <= times:
        os.kill(os.getpid(), signal.SIGKILL)
    return count


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_a_killed_process_costs_its_calls_alone(tmp_path: Path) -> None:
    """Those that are done stay; the one that dies, and what flew beside it, begins
    again.
    """
    with processes(2) as pool:
        pool.submit("before", divmod, 7, 2)
        assert pool.collect() == ("before", (3, 1))
        pool.submit("dies", killed_until, str(tmp_path / "tries"), 1)
        pool.submit("beside", divmod, 9, 2)
        assert dict(pool.collect() for _ in range(2)) == {"dies": 2, "beside": (4, 1)}


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_what_kills_every_process_is_one_line(tmp_path: Path) -> None:
    line = f"workers = 1: a process ended unexpectedly, {MOST_TRIES} times"
    with processes(1) as pool:
        pool.submit("dies", killed_until, str(tmp_path / "tries"), 99)
        with pytest.raises(OSError, match=line):
            pool.collect()
    assert (tmp_path / "tries").stat().st_size == MOST_TRIES


def raises_value() -> None:
    raise ValueError("gain must be positive")


def raises_exit() -> None:
    sys.exit(7)


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (raises_value, "ValueError: gain must be positive"),
        (raises_exit, "SystemExit: 7"),
    ],
)
def test_what_own_code_raises_in_a_process_comes_back_with_file_and_line(
    function, words
) -> None:
    line = function.__code__.co_firstlineno + 1
    with pytest.raises(OwnCodeError) as caught:
        elsewhere(function)
    assert str(caught.value) == f"{__file__}:{line}: {words}"


def test_a_process_watches_its_parent_from_its_start(monkeypatch) -> None:
    watched, daemons, usual = threading.Event(), [], signal.getsignal(signal.SIGINT)

    def watch() -> None:
        daemons.append(threading.current_thread().daemon)
        watched.set()

    monkeypatch.setattr("skyarm.studies.flights.processes._end_with_parent", watch)
    try:
        serve(luggage(), ())
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, usual)
    assert watched.wait(10.0)
    assert daemons == [True]
