"""What a study's folder claims is what is on its disk, whatever vanishes, fails or is of an earlier version."""

from __future__ import annotations

import errno
import hashlib
import json
import os
from pathlib import Path
from typing import Any

import pytest

from skyarm.sweep import StudyError, run_sweep
from skyarm.sweep.manifest import MANIFEST
from skyarm.sweep.plan import prepare
from skyarm.sweep.rows_there import not_counted
from skyarm.sweep.seal import PLACE, is_whole, sealed
from skyarm.sweep.stats import Rows, statistics
from skyarm.sweep.store import Store
from skyarm.sweep.study_page import Pictures, page
from sweeps import files_of, small_study

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


def test_chunks_that_vanish_while_a_sweep_runs_are_flown_again(whole: Path, tmp_path: Path) -> None:
    taken: list[int] = []

    def progress(done: int, total: int) -> None:
        if done == 32 and not taken:
            taken.append(done)
            for path in chunks(tmp_path):
                path.unlink()

    summary = run_sweep(small_study(), tmp_path, progress=progress)
    assert (summary.rows, summary.flown) == (100, 82)
    assert files_of(tmp_path) == files_of(whole)


def test_a_chunk_that_is_changed_while_a_sweep_runs_is_flown_again(whole: Path, tmp_path: Path) -> None:
    def progress(done: int, total: int) -> None:
        if done == 48:
            content = bytearray(chunks(tmp_path)[0].read_bytes())
            content[100] ^= 1
            chunks(tmp_path)[0].write_bytes(content + b"more")

    assert run_sweep(small_study(), tmp_path, progress=progress).flown == 66
    assert files_of(tmp_path) == files_of(whole)


def test_chunks_that_vanish_again_and_again_are_an_error_and_the_folder_is_not_complete(tmp_path: Path) -> None:
    def progress(done: int, total: int) -> None:
        for path in chunks(tmp_path)[:1]:
            path.unlink()

    with pytest.raises(OSError, match="files of rows vanished or changed while the sweep ran") as caught:
        run_sweep(small_study(), tmp_path, progress=progress)
    assert "\n" not in str(caught.value)
    there = len(chunks(tmp_path))
    manifest = manifest_of(tmp_path)
    assert there < 4
    assert (manifest["complete"], manifest["chunks"]) == (False, {"done": there, "of": 4})


def test_a_touched_chunk_is_read_again_and_not_flown(whole: Path, tmp_path: Path) -> None:
    folder = copied(whole, tmp_path / "out")
    store = Store(folder, prepare(small_study()))
    os.utime(chunks(folder)[1], (1, 1))
    assert (store.verify(), store.verified) == (0, True)


def test_verification_reads_no_chunk_again(whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = Store(copied(whole, tmp_path / "out"), prepare(small_study()))
    monkeypatch.setattr(Path, "read_bytes", lambda path: pytest.fail(f"{path} is read again"))
    assert (store.verify(), store.verified) == (0, True)


def test_planning_opens_no_file_where_none_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    looked: list[str] = []
    exists = Path.exists
    monkeypatch.setattr(Path, "exists", lambda path, **how: looked.append(path.name) or exists(path, **how))
    store = Store(tmp_path, prepare(small_study(episodes=40_000, chunk=1)))
    assert [name for name in looked if name.startswith("chunk_")] == []
    assert next(store.todo) == 0
    assert (tmp_path / MANIFEST).stat().st_size < 10_000


def test_statistics_count_the_rows_that_are_there(whole: Path, tmp_path: Path) -> None:
    folder = copied(whole, tmp_path / "out")
    assert manifest_of(folder)["complete"] is True
    chunks(folder)[1].unlink()
    chunks(folder)[1].write_bytes(chunks(folder)[1].read_bytes()[:-1])
    found = statistics(Rows(folder))
    assert (found["complete"], found["rows"], found["rows_planned"]) == (False, 36, 100)
    assert found["files_not_counted"] == ["chunk_0000002.parquet"]
    assert found["controllers"]["paper_ct"]["status"].keys() <= {"completed", "ground", "diverged"}
    whole_one = statistics(Rows(whole))
    assert (whole_one["complete"], whole_one["rows"], whole_one["files_not_counted"]) == (True, 100, [])


def test_a_whole_file_beyond_the_last_is_told_from_a_damaged_one(whole: Path, tmp_path: Path) -> None:
    folder = copied(whole, tmp_path / "out")
    (folder / "rows" / "chunk_0000004.parquet").write_bytes(chunks(folder)[0].read_bytes())
    (folder / "rows" / "chunk_0000005.parquet").write_bytes(chunks(folder)[0].read_bytes()[:-1])
    found = statistics(Rows(folder))
    assert (found["complete"], found["rows"]) == (True, 100)
    assert found["files_not_counted"] == ["chunk_0000004.parquet", "chunk_0000005.parquet"]
    assert found["files_beyond_the_last"] == ["chunk_0000004.parquet"]
    assert not_counted(found["files_not_counted"], found["files_beyond_the_last"]) == [
        "not counted, since they are damaged: chunk_0000005.parquet",
        "not counted, since the study ends before them: chunk_0000004.parquet",
    ]
    said = page(found, Rows(folder).manifest, Pictures())
    assert "Not counted, since the study ends before them: chunk_0000004.parquet." in said
    assert not_counted([], []) == []
    for path in chunks(folder)[:4]:
        path.unlink()
    with pytest.raises(StudyError, match=r"has not finished a chunk \(not counted, since they are damaged: .*; not"):
        Rows(folder)


def test_statistics_need_no_manifest_and_say_so(whole: Path, tmp_path: Path) -> None:
    folder = copied(whole, tmp_path / "out")
    (folder / MANIFEST).write_bytes(b"")
    found, usual = statistics(Rows(folder)), statistics(Rows(whole))
    assert found.pop("manifest_rebuilt") is True
    assert usual.pop("manifest_rebuilt") is False
    assert found == usual


def test_statistics_refuse_rows_of_another_study(whole: Path, tmp_path: Path) -> None:
    folder = copied(whole, tmp_path / "out")
    run_sweep(small_study(seed=4), tmp_path / "other")
    os.replace(chunks(tmp_path / "other")[3], chunks(folder)[3])
    with pytest.raises(StudyError, match=r"chunk_0000003\.parquet: must hold chunk 3 of the study 'small'"):
        Rows(folder)


def old(folder: Path) -> Path:
    """The folder as it was before files carried their study: a list of checksums in the manifest."""
    import pyarrow.parquet as pq

    manifest, listed = manifest_of(folder), {}
    for index, path in enumerate(chunks(folder)):
        table = pq.read_table(path)
        mark = {b"skyarm": f"{manifest['digest']}/{index}".encode()}
        pq.write_table(table.replace_schema_metadata(mark), path, compression="zstd")
        listed[str(index)] = {"rows": table.num_rows, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
    (folder / MANIFEST).write_text(json.dumps(manifest | {"schema": 1, "chunks": listed}))
    return folder


def test_a_folder_of_schema_1_is_read_and_brought_up_to_date(whole: Path, tmp_path: Path) -> None:
    folder = old(copied(whole, tmp_path / "out"))
    found = statistics(Rows(folder))
    assert (found["complete"], found["rows"]) == (True, 100)
    summary = run_sweep(small_study(), folder)
    assert (summary.found, summary.flown) == (50, 0)
    assert files_of(folder) == files_of(whole)


def test_a_damaged_file_of_schema_1_is_flown_again(whole: Path, tmp_path: Path) -> None:
    folder = old(copied(whole, tmp_path / "out"))
    content = bytearray(chunks(folder)[0].read_bytes())
    content[50] ^= 1
    chunks(folder)[0].write_bytes(content)
    assert statistics(Rows(folder))["files_not_counted"] == ["chunk_0000000.parquet"]
    assert run_sweep(small_study(), folder).flown == 16
    assert files_of(folder) == files_of(whole)


def test_every_changed_byte_of_a_file_shows_in_its_seal(whole: Path) -> None:
    content = chunks(whole)[3].read_bytes()
    assert is_whole(content)
    for at in range(0, len(content), 7):
        changed = bytearray(content)
        changed[at] ^= 1
        assert not is_whole(bytes(changed)), at
    assert not is_whole(content[:-1])
    assert not is_whole(b"")
    assert not is_whole(PLACE)
    with pytest.raises(ValueError, match="must have a place for its checksum"):
        sealed(b"PAR1" + PLACE + b"PAR1")


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
    assert len(left) == 3
    assert all(content == files_of(whole)[name] for name, content in left.items() if name != MANIFEST)
    state["full"] = False
    assert run_sweep(small_study(), tmp_path).found == 32
    assert files_of(tmp_path) == files_of(whole)
