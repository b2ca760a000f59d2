"""A sweep that is killed, changed or damaged: the folder ends as if nothing had
happened, or the change is refused.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from skyarm.records.files.writing import LOCK, TakenError
from skyarm.studies.sweep import StudyError, run_sweep
from skyarm.studies.sweep.manifest import MANIFEST
from support.cases import sampled
from support.studies import (
    MASS,
    document,
    files_of,
    read,
    rows_file,
    small_study,
    write_manifest,
)

pytest.importorskip("pyarrow")

PROGRAM = """
import json, sys
from pathlib import Path
from skyarm.studies.sweep import run_sweep, study_from
study, folder = study_from(json.loads(sys.argv[1])), Path(sys.argv[2])
run_sweep(study, folder, progress=lambda done, total: print(done, flush=True))
"""


def manifest_of(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / MANIFEST).read_text())
    return found


LONG = {"episodes": 480, "chunk": 8, "duration": 2.0}


def started(folder: Path) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", PROGRAM, json.dumps(document(**LONG)), str(folder)]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGKILL")
def test_a_sweep_killed_again_and_again_ends_with_the_files_of_an_uninterrupted_one(
    tmp_path: Path,
) -> None:
    run_sweep(small_study(**LONG), tmp_path / "whole")
    killed, chunks_before = 0, 0
    for attempt in range(3):
        process = started(tmp_path / "killed")
        assert process.stdout is not None
        # killed at moments that have nothing to do with the chunks' ends
        told = [process.stdout.readline() for _ in range(2 + attempt)]
        time.sleep(0.003 * attempt)
        process.send_signal(signal.SIGKILL)
        told += process.stdout.readlines()
        process.wait()
        process.stdout.close()
        assert process.stderr is not None
        process.stderr.close()
        killed += process.returncode == -signal.SIGKILL
        done = [int(line) for line in told if line.strip().isdigit()]
        chunks = sorted((tmp_path / "killed" / "rows").glob("chunk_*.parquet"))
        assert done[0] == 8 * chunks_before // 2, "what was whole before is kept"
        assert 4 * len(chunks) >= done[-1], "at most the running files are lost"
        chunks_before = len(chunks)
    assert killed >= 2
    assert 0 < chunks_before < 120
    summary = run_sweep(small_study(**LONG), tmp_path / "killed")
    assert summary.found == 8 * chunks_before // 2
    assert files_of(tmp_path / "killed") == files_of(tmp_path / "whole")
    for rows in read(tmp_path / "killed").values():
        assert rows["episode"].tolist() == list(range(480)), (
            "no row is lost, none is there twice"
        )


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGKILL")
def test_a_second_sweep_at_the_same_time_is_refused_and_a_killed_one_holds_nobody_up(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "out"
    process = started(folder)
    try:
        assert process.stdout is not None
        process.stdout.readline()
        before = sorted(path.name for path in folder.rglob("*.parquet"))
        words = (
            rf"^folder = '{folder}': must be written by one process at a time; another"
            rf" one \(process {process.pid}\)"
        )
        with pytest.raises(TakenError, match=words) as error:
            run_sweep(small_study(**LONG), folder)
        assert "\n" not in str(error.value)
        assert f"(process {process.pid})" in str(error.value)
        assert (
            sorted(path.name for path in folder.rglob("*.parquet"))[: len(before)]
            == before
        )
    finally:
        process.kill()
        process.communicate()
    assert (folder / LOCK).is_file(), "what a killed process leaves"
    assert run_sweep(small_study(**LONG), folder).rows == 960
    assert not (folder / LOCK).exists()


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole") / "out"
    run_sweep(small_study(), folder)
    return folder


@pytest.fixture
def done(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "out"))


def test_a_finished_sweep_flies_nothing_again(done: Path) -> None:
    before = files_of(done)
    times = {path: path.stat().st_mtime_ns for path in (done / "rows").iterdir()}
    told: list[tuple[int, int]] = []
    summary = run_sweep(small_study(), done, progress=lambda *each: told.append(each))
    assert (summary.flown, summary.found, summary.rows) == (0, 50, 100)
    assert told[-1] == (50, 50)
    assert not [each for each in told if each[0] > 50]
    assert files_of(done) == before
    assert times == {
        path: path.stat().st_mtime_ns for path in (done / "rows").iterdir()
    }


def _cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-9])


def _flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[200] ^= 1  # of a page
    path.write_bytes(bytes(content))


def _empty(path: Path) -> None:
    path.write_bytes(b"")


@pytest.mark.parametrize("damage", sampled([_flip, Path.unlink, _cut, _empty], 2))
@pytest.mark.parametrize("manifest", ["there", "lost"])
def test_a_lost_or_damaged_chunk_is_flown_again(
    done: Path, damage: Any, manifest: str
) -> None:
    before = files_of(done)
    if manifest == "lost":
        (done / MANIFEST).unlink()
    damage(rows_file(done, 1))
    says = (
        nullcontext()
        if damage is Path.unlink
        else pytest.warns(UserWarning, match="damaged, and flown again")
    )
    with says:
        summary = run_sweep(small_study(), done)
    assert (summary.found, summary.flown) == (42, 8)
    assert files_of(done) == before


def test_a_chunk_of_another_study_is_not_taken_for_one_of_this(
    done: Path, tmp_path: Path
) -> None:
    run_sweep(small_study(seed=4), tmp_path / "other")
    before = files_of(done)
    theirs = rows_file(tmp_path / "other", 0)
    rows_file(done, 0).unlink()
    os.replace(theirs, done / "rows" / theirs.name)
    # another chunk's rows under the name of this one
    digest = rows_file(done, 2).name.split(".")[-2]
    os.replace(
        rows_file(done, 2),
        rows_file(done, 1).with_name(f"chunk_0000001.paper_ct.{digest}.parquet"),
    )
    assert len(list((done / "rows").glob("chunk_0000001.paper_ct.*"))) == 2
    rows_file(done, 1, "paper_pd").unlink()
    summary = run_sweep(small_study(), done)
    assert (summary.found, summary.flown) == (26, 24)
    assert files_of(done) == before


CHANGES: list[tuple[dict[str, Any], str]] = [
    ({"episodes": 51}, "episodes = 51: must be 50"),
    ({"seed": 4}, "seed = 4: must be 3"),
    ({"chunk": 17}, "chunk = 17: must be 16"),
    ({"precision": "single"}, "precision = 'single': must be 'double'"),
    ({"design": "sobol"}, "design = 'sobol': must be 'random'"),
    ({"duration": 1.1}, "duration = 1.1: must be 1.0"),
    (
        {"controllers": ["paper_pd", "paper_ct"]},
        "controllers = ['paper_pd', 'paper_ct']",
    ),
    ({"scenario": "case3"}, "scenario = 'case3': must be 'case3_wind'"),
    (
        {"vary": {MASS: {"uniform": [0.4, 6.0]}}},
        "vary.\"environment.wind.force_W.x\" = None: must be {'normal'",
    ),
    ({"windows": {"steady": [0.2, 1.0]}}, "windows = "),
    ({"name": "other"}, "name = 'other': must be 'small'"),
]


def test_a_changed_study_is_refused_by_name_and_nothing_is_touched(done: Path) -> None:
    before, missed = files_of(done), []
    for given, words in CHANGES:
        change = dict(given)
        if "scenario" in change:
            change["vary"] = {
                k: v for k, v in document()["vary"].items() if "wind" not in k
            }
        with pytest.raises(StudyError, match="choose another --out") as caught:
            run_sweep(small_study(**change), done)
        if words not in str(caught.value) or "\n" in str(caught.value):
            missed.append((words, str(caught.value)))
    assert missed == []
    assert files_of(done) == before


def test_the_same_numbers_in_another_order_are_refused(done: Path) -> None:
    turned = dict(reversed(document()["vary"].items()))
    with pytest.raises(StudyError, match=r"vary = \['sensors\.position'"):
        run_sweep(small_study(vary=turned), done)


def test_a_changed_scenario_file_is_refused(tmp_path: Path) -> None:
    from skyarm.scenario.scenario_file import LIBRARY

    path = tmp_path / "flight.toml"
    text = (LIBRARY / "case3_wind.toml").read_text("utf-8")
    path.write_text(text)
    run_sweep(small_study(scenario=str(path)), tmp_path / "out")
    path.write_text(
        "# a comment changes nothing\n"
        + text.replace("Case 3 in constant wind", "another title")
    )
    assert run_sweep(small_study(scenario=str(path)), tmp_path / "out").flown == 0
    path.write_text(text.replace("radius = 0.3 ", "radius = 0.31"))
    with pytest.raises(StudyError, match="scenario of 'paper_ct'"):
        run_sweep(small_study(scenario=str(path)), tmp_path / "out")


def test_a_change_of_success_flies_nothing_and_is_kept(done: Path) -> None:
    assert run_sweep(small_study(success={"peak_pitch": 0.5}), done).flown == 0
    assert manifest_of(done)["success"] == {"peak_pitch": 0.5}


def test_rows_of_another_version_are_refused(done: Path) -> None:
    manifest = manifest_of(done)
    manifest["versions"]["skyarm"] = "0.0.1"
    write_manifest(done, manifest)
    with pytest.raises(
        StudyError, match=r"version of skyarm = '.*': must be '0\.0\.1'"
    ):
        run_sweep(small_study(), done)


@pytest.mark.parametrize("text", [None, "", "{", '{"schema": 1, "na', "\xff"])
def test_a_manifest_that_is_lost_or_cut_off_is_made_anew(
    done: Path, text: str | None
) -> None:
    before = files_of(done)
    if text is None:
        (done / MANIFEST).unlink()
    else:
        (done / MANIFEST).write_bytes(text.encode("latin-1"))
    assert run_sweep(small_study(), done).flown == 0
    assert files_of(done) == before


def test_rows_of_another_study_are_known_without_a_manifest(done: Path) -> None:
    (done / MANIFEST).unlink()
    before = files_of(done)
    with pytest.raises(
        StudyError,
        match=(
            r"holds rows of another study"
            r" \(chunk_0000000\.paper_ct\.[0-9a-f]{64}\.parquet\) without a manifest"
        ),
    ):
        run_sweep(small_study(seed=4), done)
    assert files_of(done) == before


WRONG = [
    ("[]", "must be as 'skyarm sweep' wrote it"),
    ('{"schema": 4}', "schema = 4: must be 3"),
    ('{"schema": 3}', "its content does not fit its sha256: it is damaged"),
    ("NaN", "delete it, and it is made anew"),
]


@pytest.mark.parametrize(("text", "words"), WRONG)
def test_what_is_no_manifest_is_refused_in_one_line(
    done: Path, text: str, words: str
) -> None:
    (done / MANIFEST).write_text(text)
    with pytest.raises(StudyError, match=r"manifest\.json: ") as caught:
        run_sweep(small_study(), done)
    assert words in str(caught.value)


def test_the_manifest_says_what_the_rows_are(done: Path) -> None:
    manifest = manifest_of(done)
    assert manifest["study"] == json.loads(json.dumps(dict(small_study().document)))
    assert (manifest["schema"], manifest["complete"], manifest["rows"]) == (
        3,
        True,
        100,
    )
    assert manifest["chunks"] == {"done": 4, "of": 4}
    assert set(manifest["versions"]) == {"skyarm", "numpy", "llvmlite", "code"}
