"""What a study's folder claims is what is on its disk, whatever vanishes, fails or is
of an earlier version.
"""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path
from typing import Any

import pytest

from skyarm.studies.sweep import StudyError, run_sweep
from skyarm.studies.sweep.manifest import MANIFEST
from skyarm.studies.sweep.stats import Rows, statistics
from support.studies import files_of, rows_file, small_study

pytest.importorskip("pyarrow")


def chunks(folder: Path) -> list[Path]:
    return sorted((folder / "rows").glob("chunk_*.parquet"))


def manifest_of(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / MANIFEST).read_text())
    return found


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    run_sweep(small_study(), folder)
    return folder


def copied(whole: Path, folder: Path) -> Path:
    (folder / "rows").mkdir(parents=True)
    for name, content in files_of(whole).items():
        (folder / name).write_bytes(content)
    return folder


def test_chunks_that_vanish_in_a_sweep_do_not_count_and_the_command_completes_them(
    whole: Path, tmp_path: Path
) -> None:
    def progress(done: int, total: int) -> None:
        if done == 32:
            for path in chunks(tmp_path):
                path.unlink()

    run_sweep(small_study(), tmp_path, progress=progress)
    manifest = manifest_of(tmp_path)
    assert (manifest["complete"], manifest["chunks"]) == (False, {"done": 2, "of": 4})
    assert run_sweep(small_study(), tmp_path).flown == 32
    assert files_of(tmp_path) == files_of(whole)


def test_statistics_count_the_rows_that_are_there(whole: Path, tmp_path: Path) -> None:
    folder = copied(whole, tmp_path / "out")
    assert manifest_of(folder)["complete"] is True
    rows_file(folder, 1).unlink()
    damaged = rows_file(folder, 2, "paper_pd")
    damaged.write_bytes(damaged.read_bytes()[:-1])
    found = statistics(Rows(folder))
    assert (found["complete"], found["rows"], found["rows_planned"]) == (False, 36, 100)
    assert found["files_not_counted"] == [damaged.name]
    assert found["controllers"]["paper_ct"]["status"].keys() <= {
        "completed",
        "ground",
        "diverged",
    }
    whole_one = statistics(Rows(whole))
    assert (
        whole_one["complete"],
        whole_one["rows"],
        whole_one["files_not_counted"],
    ) == (True, 100, [])


def test_statistics_need_a_manifest(whole: Path, tmp_path: Path) -> None:
    folder = copied(whole, tmp_path / "out")
    (folder / MANIFEST).write_bytes(b"")
    with pytest.raises(StudyError, match=r"it has no whole manifest\.json"):
        Rows(folder)


def test_rows_of_another_study_do_not_count(whole: Path, tmp_path: Path) -> None:
    folder = copied(whole, tmp_path / "out")
    run_sweep(small_study(seed=4), tmp_path / "other")
    theirs = rows_file(tmp_path / "other", 3)
    rows_file(folder, 3).unlink()
    os.replace(theirs, folder / "rows" / theirs.name)
    assert Rows(folder).skipped == (theirs.name,)


def test_two_parts_in_turn_fly_the_whole(whole: Path, tmp_path: Path) -> None:
    first = run_sweep(small_study(), tmp_path, part="1/2")
    assert (first.flown, first.rows, manifest_of(tmp_path)["complete"]) == (
        32,
        64,
        False,
    )
    second = run_sweep(small_study(), tmp_path, part="2/2")
    assert (second.flown, second.found, second.rows) == (18, 32, 100)
    assert files_of(tmp_path) == files_of(whole)
    for text in ("0/2", "3/2", "2", "1/0", "a/b"):
        with pytest.raises(StudyError, match=r"--part = .*must be K/N"):
            run_sweep(small_study(), tmp_path, part=text)


def test_a_disk_that_fails_is_one_line_and_the_sweep_goes_on_when_it_works_again(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    state = {"full": False}
    usual = os.fsync

    def fsync(handle: int) -> None:
        if state["full"]:
            os.ftruncate(handle, 10)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        usual(handle)

    monkeypatch.setattr(os, "fsync", fsync)

    def progress(done: int, total: int) -> None:
        state["full"] = done >= 32

    with pytest.raises(OSError, match="No space left") as caught:
        run_sweep(small_study(), tmp_path, progress=progress)
    assert "\n" not in str(caught.value)
    left = files_of(tmp_path)
    assert len(left) == 5
    assert all(
        content == files_of(whole)[name]
        for name, content in left.items()
        if name != MANIFEST
    )
    state["full"] = False
    assert run_sweep(small_study(), tmp_path).found == 32
    assert files_of(tmp_path) == files_of(whole)
