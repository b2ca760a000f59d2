"""One writer of a folder at a time: as long as it lives, no longer, and through nothing
that a stranger left.
"""

from __future__ import annotations

import errno
import os
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from skyarm.records.files import writing as module
from skyarm.records.files.earlier_files import naming
from skyarm.records.files.writing import LOCK, TakenError, one_writer


def test_a_second_writer_is_refused_until_the_first_is_done(tmp_path: Path) -> None:
    with one_writer(tmp_path):
        assert (tmp_path / LOCK).read_text() == str(os.getpid())
        with (
            pytest.raises(
                TakenError, match=rf"another one \(process {os.getpid()}\) does"
            ),
            one_writer(tmp_path),
        ):
            pass
        assert (tmp_path / LOCK).is_file(), "who was refused takes nothing away"
    assert list(tmp_path.iterdir()) == []
    with one_writer(tmp_path):
        pass


def test_a_patient_writer_waits_for_the_end_of_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, waits = one_writer(tmp_path), []
    first.__enter__()

    def sleep(seconds: float) -> None:
        waits.append(seconds)
        if len(waits) == 3:
            first.__exit__(None, None, None)

    monkeypatch.setattr(module.time, "sleep", sleep)
    with one_writer(tmp_path, patience=60.0):
        assert waits == [module.POLL] * 3


def test_another_process_may_name_files_for_a_minute_and_no_longer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    instants = [0.0]
    clock = SimpleNamespace(
        sleep=lambda seconds: instants.append(instants[-1] + seconds),
        monotonic=lambda: instants[-1],
    )
    with naming(tmp_path):
        monkeypatch.setattr(module, "time", clock)
        with pytest.raises(TakenError), naming(tmp_path):
            pass
    assert 60.0 <= instants[-1] < 60.1


def test_it_ends_with_an_error_too(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), one_writer(tmp_path):
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_only_left_behind_holds_nobody_up(tmp_path: Path) -> None:
    (tmp_path / LOCK).write_text("1")  # of a process that lives, and is no writer
    with one_writer(tmp_path):
        assert (tmp_path / LOCK).read_text() == str(os.getpid())


@pytest.mark.skipif(
    sys.platform == "win32", reason="an open file cannot be removed there"
)
def test_a_lock_on_a_file_that_its_holder_has_just_removed_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between opening the file and locking it the first writer ends, and a third
    begins.
    """
    usual, third = module._lock, one_writer(tmp_path)

    def late(handle: int) -> None:
        monkeypatch.setattr(module, "_lock", usual)
        (tmp_path / LOCK).unlink()
        third.__enter__()
        usual(handle)

    monkeypatch.setattr(module, "_lock", late)
    with pytest.raises(TakenError), one_writer(tmp_path):
        pass
    third.__exit__(None, None, None)
    assert list(tmp_path.iterdir()) == []


def test_on_a_file_system_without_locks_everyone_writes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none_here(_handle: int) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(module, "_lock", none_here)
    with one_writer(tmp_path), one_writer(tmp_path):
        pass


@pytest.mark.skipif(sys.platform == "win32", reason="links and pipes of POSIX")
@pytest.mark.parametrize("kind", ["link", "pipe", "folder"])
def test_something_else_of_the_lock_s_name_is_refused(
    kind: str, tmp_path: Path
) -> None:
    target = tmp_path / "kept"
    target.write_text("kept")
    if kind == "link":
        (tmp_path / LOCK).symlink_to(target)
    elif kind == "pipe":
        os.mkfifo(tmp_path / LOCK)
    else:
        (tmp_path / LOCK).mkdir()
    with (
        pytest.raises(OSError, match=rf"^file = '.*{LOCK}': must be writable \(.*\)$"),
        one_writer(tmp_path),
    ):
        pass
    assert target.read_text() == "kept"
    assert os.path.lexists(tmp_path / LOCK)
