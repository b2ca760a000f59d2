"""Works whose rows are asked for together: one batch flies them, and rows and files are
those of each by itself.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skyarm.log.metrics.windows import Window, Windows
from skyarm.scenario.scenario_file import load_scenario
from skyarm.studies.flights import Store, Work, WorkRunner, executor, fly

pytest.importorskip("pyarrow")

CASE = load_scenario("case1", controller="paper_pd", duration=0.1)
WINDOWS = Windows(steady=Window(0.02, 0.1))
"""Before half of the flights below are over."""


def work(label: str, begin: int, count: int, **options: Any) -> Work:
    episodes = np.arange(begin, begin + count)
    masses = {"plant.payload.mass": 0.01 * (1.0 + episodes)}
    return Work(
        **{
            "label": label,
            "scenario": CASE,
            "columns": masses,
            "episodes": episodes,
            "fixed": {"law": label},
            "metrics": ("position_error_mean", "rotor_jitter"),
            "windows": WINDOWS,
            "precision": "single",
            "effort": 0,
            **options,
        }
    )


def files_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (folder / "rows").iterdir()}


def test_works_of_one_program_fly_as_one_batch_and_their_files_are_those_of_each(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    works = [
        work("one", 0, 3),
        work("two", 3, 21),
        work("none", 0, 0),
        work("other", 0, 2, seed=1),
        work("four", 9, 1),
    ]
    batches: list[list[str]] = []

    def together(group: Any, threads: int) -> Any:
        batches.append([each.label for each in group])
        return fly.fly_together(group, threads)

    monkeypatch.setattr(executor, "fly_together", together)
    with WorkRunner(workers=2, store=Store(tmp_path / "together")) as crew:
        rows = crew.rows(works)
    assert batches == [["one", "two", "none", "four"], ["other"]]
    with WorkRunner(store=Store(tmp_path / "each")) as each:
        assert [label.label for label, _ in each.fly(works)] == [
            "one",
            "two",
            "none",
            "other",
            "four",
        ]
    assert files_of(tmp_path / "together") == files_of(tmp_path / "each")
    batches.clear()
    with WorkRunner(store=Store(tmp_path / "each")) as again:
        kept = again.rows(works)
    assert (batches, again.flights, crew.flights) == ([], 0, 27)
    for mine, theirs, alone in zip(rows, kept, map(fly.fly, works), strict=True):
        assert list(mine) == list(theirs) == list(alone)
        for name, column in mine.items():
            np.testing.assert_array_equal(column, theirs[name], strict=False)
            np.testing.assert_array_equal(column, alone[name])
    assert rows[1]["law"].tolist() == ["two"] * 21
    # heavier loads are flown worse: no row has another's metrics
    assert (np.diff(rows[1]["position_error_mean"]) != 0.0).all()
