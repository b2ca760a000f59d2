"""A search that is interrupted: finished rounds are taken from its folder, and it ends
as if nothing had happened.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from skyarm.cli.commands import program
from skyarm.records.arrays import Array
from skyarm.records.files.writing import TakenError
from skyarm.scenario.scenario_file import load_scenario
from skyarm.studies.flights import Rows, Store, Work, executor, fly, store
from skyarm.studies.tune import tuning
from skyarm.studies.tune.front import LoopMargins
from skyarm.studies.tune.gain_search import Effort
from skyarm.studies.tune.subject import SearchSizes, Subject
from skyarm.studies.tune.tuning import Tuning, TuningPlan, plan_of
from support.cases import sampled

pytest.importorskip("pyarrow")


class Sound:
    """Margins that all gains meet."""

    def __init__(self, *_: Any) -> None:
        pass

    def costs(self, logs: Array) -> Array:
        return np.zeros(len(logs))

    def measure(self, logs: Array) -> list[LoopMargins]:
        return [LoopMargins(delay=1.0, rotors=(0.1, 10.0), joints=(0.1, 10.0))] * len(
            logs
        )


def rows_of(work: Work) -> Rows:
    """Rows in place of flights: errors least at gains twice as large, which every plant
    shifts a little.
    """
    columns = {path: np.asarray(column) for path, column in work.columns.items()}
    gains = sum(
        np.log(1.0 + column)
        for path, column in columns.items()
        if path.startswith("controller.")
    )
    shift = sum(
        np.abs(column)
        for path, column in columns.items()
        if path.startswith("environment.")
    )
    away = 0.01 * (1.0 + (gains - 20.0) ** 2 + 0.1 * shift)
    numbers = {name: away * (1.0 + 0.1 * i) for i, name in enumerate(work.metrics)}
    status = np.where(shift > np.quantile(shift, 0.98), "crashed", "completed")
    return {
        **fly._leading_columns(work),
        **numbers,
        "tilt_max": 0.0 * away,
        "status": status,
        "end_time": 0.0 * away,
    }


@pytest.fixture
def flown(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Labels of the works that fly."""
    seen: list[str] = []

    def fly_together(works: Sequence[Work], threads: int) -> list[Rows]:
        seen.extend(work.label for work in works)
        return [rows_of(work) for work in works]

    monkeypatch.setattr(executor, "fly_together", fly_together)
    monkeypatch.setattr(Subject, "margins", Sound)
    return seen


def plan(seed: int = 0) -> TuningPlan:
    effort = dataclasses.replace(Effort().scale(240, 8), population=4, rounds=4)
    knobs = ("gains.position", "gains.rate")
    found = plan_of(
        load_scenario("case1", controller="paper_pd"),
        True,
        "paper_pd",
        knobs,
        effort,
        seed,
    )
    return dataclasses.replace(
        found, stages=SearchSizes(semifinalists=4, further=8, unseen=6, aside=6)
    )


def result_of(found: Tuning) -> Any:
    return found.before, found.points, found.picked, found.aside


def rows_in(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (folder / "rows").iterdir()}


def stop_at(words: str) -> Any:
    def progress(_done: int, _total: int, last: str) -> None:
        if last.startswith(words):
            raise KeyboardInterrupt

    return progress


@pytest.mark.parametrize(
    "stage", sampled(["round 2", "the best once more", "plants and a path"], 3)
)
def test_an_interrupted_search_flies_the_rest_and_ends_with_the_same_files(
    stage: str, flown: list[str], tmp_path: Path
) -> None:
    whole = tuning.tune_plan(plan(), folder=tmp_path / "whole")
    every = flown.copy()
    assert len(set(every)) == len(every), "a label is a file"
    flown.clear()
    with pytest.raises(KeyboardInterrupt):
        tuning.tune_plan(plan(), folder=tmp_path / "other", progress=stop_at(stage))
    before = flown.copy()
    assert before == every[: len(before)]
    assert "round_002.1" in before
    assert "aside.1" not in before
    flown.clear()
    found = tuning.tune_plan(plan(), folder=tmp_path / "other")
    assert flown == every[len(before) :]
    assert result_of(found) == result_of(whole) == result_of(tuning.tune_plan(plan()))
    assert rows_in(tmp_path / "other") == rows_in(tmp_path / "whole")


@pytest.mark.thorough
def test_another_search_takes_nothing_of_a_folder_and_leaves_it(
    flown: list[str], tmp_path: Path
) -> None:
    tuning.tune_plan(plan(), folder=tmp_path)
    there = rows_in(tmp_path)
    flown.clear()
    alone = tuning.tune_plan(plan(seed=1))
    every = flown.copy()
    flown.clear()
    assert result_of(tuning.tune_plan(plan(seed=1), folder=tmp_path)) == result_of(
        alone
    )
    assert flown == every
    assert len(rows_in(tmp_path)) == len(there) + len(every)
    assert there.items() <= rows_in(tmp_path).items()


@pytest.mark.thorough
def test_a_round_is_cut_by_its_size_alone_and_stages_have_their_names(
    flown: list[str],
) -> None:
    tuning.tune_plan(plan())
    assert {label.rpartition(".")[0] for label in flown} == {
        *(f"round_00{k}{own}" for k in range(5) for own in ("", ".own")),
        *("pool", "pool.own", "again", "again.own", "unseen", "aside"),
    }
    alone = flown.copy()
    flown.clear()
    tuning.tune_plan(plan(), workers=2)
    assert flown == alone


def test_two_searches_in_one_folder_are_refused_in_one_line(
    flown: list[str], tmp_path: Path
) -> None:
    words = r"^folder = .* must be written by one process at a time; .*$"
    with Store(tmp_path).alone(), pytest.raises(TakenError, match=words):
        tuning.tune_plan(plan(), folder=tmp_path)
    assert flown == []


def test_a_search_without_pyarrow_is_not_kept_and_says_so(
    flown: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = tuning.tune_plan(plan(), folder=tmp_path / "kept")
    monkeypatch.setattr(store, "_parquet", lambda: None)
    assert result_of(tuning.tune_plan(plan(), folder=tmp_path / "other")) == result_of(
        kept
    )
    assert not (tmp_path / "other").exists()

    def enough(*_: Any, **__: Any) -> Tuning:
        raise ValueError("enough")

    monkeypatch.setattr(tuning, "tune_plan", enough)
    words = ["tune", "hummingbird", "--out", str(tmp_path / "out")]
    said = CliRunner().invoke(program(words), words)
    assert str(said.exception) == "enough"
    assert "this search cannot be resumed: pyarrow: is missing" in said.stderr
    assert len(said.stderr.splitlines()) == 1
    assert not (tmp_path / "out").exists()
