"""Flights that write their logs into one folder at the same time: none is lost, and
pairs belong together.
"""

from __future__ import annotations

import os
import sys
import threading
from pathlib import Path

import pytest

from skyarm.cli.run_command import save_logs
from skyarm.records.files import writing
from skyarm.records.files.earlier_files import NAMING, earlier_kept
from skyarm.records.files.own_inputs import inputs_kept, note_input
from skyarm.records.files.writing import TakenError, one_writer

pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="an open file cannot be removed there"
)


def save(files: list[Path], text: str) -> list[Path]:
    """Name and write the logs of one flight; returns the names of earlier ones."""
    with earlier_kept(files) as kept:
        for file in files:
            file.write_text(text)
    return kept


def test_a_flight_that_ends_while_another_is_between_look_and_write_waits_for_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files, waits = [tmp_path / "case1.npz", tmp_path / "case1.csv"], threading.Event()
    monkeypatch.setattr(
        writing.time,
        "sleep",
        lambda seconds: waits.set() or threading.Event().wait(seconds),
    )
    second = threading.Thread(target=save, args=(files, "second"))
    with earlier_kept(files) as kept:
        assert kept == []
        second.start()
        assert waits.wait(20.0), (
            "it names its logs although another flight has looked and not yet written"
        )
        for file in files:
            file.write_text("first")
    second.join()
    texts = {file.name: file.read_text() for file in tmp_path.iterdir()}
    assert texts == {
        "case1.npz": "second",
        "case1.csv": "second",
        "case1_1.npz": "first",
        "case1_1.csv": "first",
    }


def test_two_that_replace_leave_a_pair_of_one_flight(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("skyarm.records.files.earlier_files.PATIENCE", 0.0)
    with (
        earlier_kept([tmp_path / "a.npz"], replace=True),
        pytest.raises(TakenError, match="one process at a time"),
    ):
        save([tmp_path / "a.npz"], "other")
    assert list(tmp_path.iterdir()) == []


def test_a_flight_is_saved_although_another_process_holds_the_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("skyarm.records.files.earlier_files.PATIENCE", 0.0)
    monkeypatch.setattr(
        "skyarm.cli.run_command.save_log",
        lambda text, file: file.write_text(text) and file,
    )
    files = [tmp_path / "a.npz", tmp_path / "a.csv"]
    with earlier_kept(files):
        written, kept = save_logs("flown", files)
    assert written == [
        tmp_path / f"a_{os.getpid()}.npz",
        tmp_path / f"a_{os.getpid()}.csv",
    ]
    assert kept == []
    assert [file.read_text() for file in written] == ["flown", "flown"]
    assert "one process at a time" in capsys.readouterr().err


def test_an_earlier_flight_of_this_process_s_number_is_left_and_so_is_a_device(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("skyarm.records.files.earlier_files.PATIENCE", 0.0)
    monkeypatch.setattr(
        "skyarm.cli.run_command.save_log",
        lambda text, file: file.write_text(text) and file,
    )
    earlier, device = tmp_path / f"a_{os.getpid()}.npz", Path(os.devnull)
    earlier.write_text("earlier")
    with earlier_kept([tmp_path / "a.npz"]):
        written, _ = save_logs("flown", [tmp_path / "a.npz", device])
    assert written == [tmp_path / f"a_{os.getpid() + 1}.npz", device]
    assert earlier.read_text() == "earlier"


def test_a_flight_beside_the_log_it_read_gets_its_name_under_the_lock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another flight may take the number while this one waits."""

    def late(folder: Path, **more: object) -> object:
        (folder / "a_1.npz").write_text("another's")
        return one_writer(folder, **more)

    monkeypatch.setattr("skyarm.records.files.earlier_files.one_writer", late)
    monkeypatch.setattr(
        "skyarm.cli.run_command.save_log",
        lambda text, file: file.write_text(text) and file,
    )
    (tmp_path / "a.npz").write_text("read")
    with inputs_kept():
        note_input(tmp_path / "a.npz")
        assert save_logs("flown", [tmp_path / "a.npz"]) == ([tmp_path / "a_2.npz"], [])
    assert (tmp_path / "a_1.npz").read_text() == "another's"


def test_a_running_sweep_of_the_folder_keeps_no_flight_from_its_log(
    tmp_path: Path,
) -> None:
    with one_writer(tmp_path):
        save([tmp_path / "a.npz"], "flown")
    assert (tmp_path / "a.npz").read_text() == "flown"


def test_a_lock_that_another_user_s_process_left_is_no_hindrance(
    tmp_path: Path,
) -> None:
    (tmp_path / NAMING).touch(0o444)
    save([tmp_path / "a.npz"], "flown")
    assert (tmp_path / "a.npz").read_text() == "flown"


def test_a_folder_that_went_during_the_flight_is_made_again(tmp_path: Path) -> None:
    save([tmp_path / "gone" / "a.npz"], "flown")
    assert [file.name for file in (tmp_path / "gone").iterdir()] == ["a.npz"]


def test_files_of_two_folders_are_locked_in_one_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else two flights that name the folders in another order wait for each other."""
    order: list[str] = []
    usual = one_writer

    def noted(folder: Path, **more: object) -> object:
        order.append(folder.name)
        return usual(folder, **more)

    monkeypatch.setattr("skyarm.records.files.earlier_files.one_writer", noted)
    for names in (("a", "b"), ("b", "a")):
        save([tmp_path / name / f"x{i}" for i, name in enumerate(names)], "flown")
    assert order == ["a", "b", "a", "b"]
