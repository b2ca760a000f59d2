"""What a suite keeps: each cell once, all that is damaged flown again, one writer,
folders of before, no pyarrow.
"""

from __future__ import annotations

import contextlib
import hashlib
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import skyarm
from skyarm.records.files.writing import TakenError
from skyarm.studies.compare.own_scenario import OwnScenario
from skyarm.studies.compare.run_suite import fly_suite
from skyarm.studies.flights import Store, executor, store
from skyarm.studies.flights.store import KEY, files_by_label, pack_rows, unpack_rows
from skyarm.studies.sweep import run_sweep
from support.commands import refused
from support.commands import skyarm as typed
from support.studies import files_of, small_study

LABELS = ["given__case1__own", "given__case1__paper_pd", "given__case1__paper_ct"]


@pytest.fixture(scope="module")
def suite() -> OwnScenario:
    return OwnScenario(
        scenario=skyarm.load_scenario("case1", duration=0.1),
        laws=("own", "paper_pd", "paper_ct"),
        seeds=1,
    )


@pytest.fixture(scope="module")
def whole(suite: OwnScenario, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the suite, flown without an interruption."""
    pytest.importorskip("pyarrow")
    folder = tmp_path_factory.mktemp("suites") / "whole"
    fly_suite(suite, folder)
    return folder


@pytest.fixture
def again(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Labels of what flies from here on."""
    labels: list[str] = []
    honest = executor.fly
    monkeypatch.setattr(
        executor,
        "fly",
        lambda work, threads: labels.append(work.label) or honest(work, threads),
    )
    return labels


def row_file(folder: Path, label: str) -> Path:
    (path,) = files_by_label(folder / "rows")[label]
    return path


def renamed(path: Path, content: bytes) -> None:
    """Write other content under the name that it has to have."""
    path.unlink()
    label, *_ = path.name.rsplit(".", 2)
    path.with_name(
        f"{label}.{hashlib.sha256(content).hexdigest()}.parquet"
    ).write_bytes(content)


def flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 4
    path.write_bytes(bytes(content))


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-1])


def forge_key(path: Path) -> None:
    rows = {
        name: each.astype(str) if each.dtype == object else each
        for name, each in unpack_rows(path.read_bytes()).items()
    }
    renamed(path, pack_rows(rows, {KEY: b"0" * 64}))


def of_another(path: Path) -> None:
    renamed(
        path, next(each for each in path.parent.iterdir() if each != path).read_bytes()
    )


@pytest.mark.parametrize("harm", [Path.unlink, flip, cut, forge_key, of_another])
@pytest.mark.parametrize(
    "label", [LABELS[0], pytest.param(LABELS[1], marks=pytest.mark.thorough)]
)
def test_what_is_damaged_alone_is_flown_again_with_the_same_bytes(
    suite: OwnScenario,
    whole: Path,
    again: list[str],
    tmp_path: Path,
    harm: Callable[[Path], Any],
    label: str,
) -> None:
    folder = shutil.copytree(whole, tmp_path / "copy")
    fly_suite(suite, folder)
    assert again == []
    broken = row_file(folder, label)
    harm(broken)
    told = (
        pytest.warns(UserWarning, match=rf"damaged, and flown again: {label}\.")
        if harm in (flip, cut)
        else None
    )
    with contextlib.nullcontext() if told is None else told:
        fly_suite(suite, folder)
    assert again == [label]
    left, right = files_of(folder), files_of(whole)
    # rows of other works stay: a suite of these may come back
    if harm in (forge_key, of_another):
        assert len(left) == len(right) + 1
        assert right.items() <= left.items()
    else:
        assert left == right


def test_a_suite_that_was_interrupted_flies_the_rest(
    suite: OwnScenario, whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flown: list[str] = []
    honest = executor.fly

    def fly(work: Any, threads: int) -> Any:
        flown.append(work.label)
        if len(flown) == 2:
            raise KeyboardInterrupt
        return honest(work, threads)

    monkeypatch.setattr(executor, "fly", fly)
    with pytest.raises(KeyboardInterrupt):
        fly_suite(suite, tmp_path / "half")
    fly_suite(suite, tmp_path / "half")
    assert flown == [LABELS[0], LABELS[1], *LABELS[1:]]
    assert files_of(tmp_path / "half") == files_of(whole)


def test_a_folder_has_one_writer(suite: OwnScenario, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    with Store(tmp_path).alone():
        with pytest.raises(
            TakenError, match=r"must be written by one process at a time"
        ):
            fly_suite(suite, tmp_path)
        refused(
            typed("compare", "case1", "--out", str(tmp_path)),
            "must be written by one process at a time",
        )
    assert not list((tmp_path / "rows").iterdir())


def test_a_folder_of_before_is_flown_again_and_left_as_it_is(
    suite: OwnScenario, whole: Path, tmp_path: Path
) -> None:
    (tmp_path / "cells").mkdir()
    old = tmp_path / "cells" / "given__case1__own.cell"
    old.write_bytes(b"of 0.3")
    with pytest.warns(
        UserWarning,
        match=r"cells of skyarm 0\.3 do not count: what they hold is flown again",
    ):
        fly_suite(suite, tmp_path)
    fly_suite(suite, tmp_path)  # it says so once
    assert old.read_bytes() == b"of 0.3"
    old.unlink()
    assert files_of(tmp_path) == files_of(whole)


def test_without_pyarrow_it_flies_and_says_that_nothing_is_kept(
    suite: OwnScenario, whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store, "_parquet", lambda: None)
    with pytest.warns(
        UserWarning,
        match=(
            r"pyarrow: is missing: what has flown is not kept; needs the extra 'sweep'"
        ),
    ):
        fly_suite(suite, tmp_path)
    wanted = {
        name: content
        for name, content in files_of(whole).items()
        if not name.endswith(".parquet")
    }
    assert files_of(tmp_path) == wanted


def test_a_place_that_is_none_is_refused_before_anything_is_made(
    tmp_path: Path,
) -> None:
    refused(
        typed("compare", "case1", "--on", "cloud", "--out", str(tmp_path / "out")),
        "--on = 'cloud': must be",
    )
    with pytest.raises(
        ValueError,
        match=r"^on = 'cloud': must be local, processes, ray or ray:HOST:PORT$",
    ):
        skyarm.compare("case1", ["paper_pd"], tmp_path / "out", on="cloud")
    assert not (tmp_path / "out").exists()


@pytest.mark.thorough
def test_in_processes_the_bytes_are_the_same(
    suite: OwnScenario, whole: Path, tmp_path: Path
) -> None:
    fly_suite(suite, tmp_path, workers=2, on="processes")
    assert files_of(tmp_path) == files_of(whole)


def test_a_suite_and_a_sweep_keep_their_rows_apart(
    suite: OwnScenario, whole: Path, tmp_path: Path
) -> None:
    pytest.importorskip("pyarrow")
    run_sweep(small_study(episodes=2, chunk=1), tmp_path)
    there = files_of(tmp_path)
    with pytest.raises(ValueError, match="holds rows of a sweep; choose another --out"):
        fly_suite(suite, tmp_path)
    assert files_of(tmp_path) == there
    with pytest.raises(
        ValueError, match="holds rows of no sweep; choose another --out"
    ):
        run_sweep(small_study(episodes=2), whole)
