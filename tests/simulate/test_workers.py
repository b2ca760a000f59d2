"""Processes that fly end with what asked for them, whatever they are doing."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from skyarm.records.files.user_code import OwnCodeError
from skyarm.simulate.workers import _serve_parent, workers

CUT_OFF = """
import os, struct, sys, time
from pathlib import Path
from skyarm.simulate.workers import workers

def half_a_result(flag):
    frame = sys._getframe()
    while "result_queue" not in frame.f_locals:
        frame = frame.f_back
    # the length of a message, and nothing of it
    os.write(frame.f_locals["result_queue"]._writer.fileno(), struct.pack("!i", 1000))
    Path(flag).touch()
    time.sleep(60.0)

if __name__ == "__main__":
    try:
        with workers(2) as submit:
            submit(half_a_result, "flag")
            while not Path("flag").exists():
                time.sleep(0.05)
            raise KeyboardInterrupt
    except KeyboardInterrupt:
        print("over")
"""


def test_an_interrupt_while_a_process_sends_a_result_ends_at_once(tmp_path: Path) -> None:
    (tmp_path / "cut_off.py").write_text(CUT_OFF)
    command = [sys.executable, "cut_off.py"]
    ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=45.0, check=False)
    assert (ended.returncode, ended.stdout) == (0, "over\n"), ended.stderr


def test_what_is_handed_over_comes_back() -> None:
    with workers(2) as submit:
        assert [future.result() for future in [submit(divmod, 17, k) for k in (3, 5)]] == [(5, 2), (3, 2)]


def test_an_error_in_a_process_is_the_parents() -> None:
    with pytest.raises(ZeroDivisionError), workers(1) as submit:
        submit(divmod, 1, 0).result()


def raises_value() -> None:
    raise ValueError("gain must be positive")


def raises_exit() -> None:
    sys.exit(7)


@pytest.mark.parametrize(
    ("function", "words"), [(raises_value, "ValueError: gain must be positive"), (raises_exit, "SystemExit: 7")]
)
def test_what_own_code_raises_in_a_process_comes_back_with_file_and_line(function, words) -> None:
    line = function.__code__.co_firstlineno + 1
    with workers(1) as submit, pytest.raises(OwnCodeError) as caught:
        submit(function).result()
    assert str(caught.value) == f"{__file__}:{line}: {words}"


def test_a_process_watches_its_parent_from_its_start(monkeypatch) -> None:
    watched, daemons, usual = threading.Event(), [], signal.getsignal(signal.SIGINT)

    def watch() -> None:
        daemons.append(threading.current_thread().daemon)
        watched.set()

    monkeypatch.setattr("skyarm.simulate.workers._end_with_parent", watch)
    try:
        _serve_parent((), ())
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, usual)
    assert watched.wait(10.0)
    assert daemons == [True]
