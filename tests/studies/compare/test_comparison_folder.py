"""A comparison's folder: every file is there, holds what was flown, and its own choices
reach the flights.
"""

from __future__ import annotations

import base64
import json

import numpy as np
import pytest

from skyarm.studies.compare import run_suite
from skyarm.studies.compare.cell_flights import SUCCESS_METRIC, Cell, table
from skyarm.studies.compare.comparison import Comparison
from skyarm.studies.compare.entrants import ENTRANTS
from skyarm.studies.compare.run_suite import fly_suite
from skyarm.studies.compare.suite import conditions
from skyarm.studies.flights import executor

EVERY = conditions(plants=2, seeds=2)
LAWS = {name: ENTRANTS[name] for name in ("paper_ct", "centroidal_tip")}
COLUMNS = {name: EVERY[name] for name in ("perfect", "plants_noisy")}


def flown():
    numbers = {
        "position_error_mean_continuous": 0.1,
        "ee_error_mean_continuous": 0.2,
        SUCCESS_METRIC: 0.01,
    }
    return {
        (condition.name, case, name): Cell(
            {
                metric: np.array([value, 2.0 * value + k])
                for metric, value in numbers.items()
            },
            np.array(["completed"] * 2),
        )
        for condition in COLUMNS.values()
        for case in condition.cases
        for k, name in enumerate(LAWS)
    }


@pytest.fixture
def asked(monkeypatch):
    """What the comparison asks for; nothing is flown."""
    works = []

    def fly(work, threads):
        works.append((work, threads))
        cell = flown()[tuple(work.fixed[name] for name in ("condition", "case", "law"))]
        return {
            **{
                name: np.full(2, word)
                for name, word in work.fixed.items()
                if name != "trial"
            },
            "trial": np.arange(2.0),
            **cell.metrics,
            "status": cell.status,
        }

    monkeypatch.setattr(executor, "fly", fly)
    return works


def test_every_file_of_a_comparison_holds_what_was_flown(tmp_path, asked):
    comparison = Comparison(entrants=LAWS, conditions=COLUMNS, seed=7, plant="mujoco")
    folder = tmp_path / "deep" / "comparison"
    told = []
    found = fly_suite(
        comparison,
        folder,
        workers=2,
        on="local",
        progress=lambda *heard: told.append(heard),
    )
    assert {
        tuple(work.fixed[name] for name in ("condition", "case", "law"))
        for work, _ in asked
    } == set(flown())
    assert {(work.seed, work.alone, threads) for work, threads in asked} == {
        (7, True, 2)
    }
    assert [each[:2] for each in told] == [
        (k + 1, len(flown())) for k in range(len(flown()))
    ]
    assert told[0][2] == "perfect case1 paper_ct_mujoco"
    assert sorted(path.name for path in folder.iterdir()) == [
        *(
            "flights.parquet",
            "laws.png",
            "report.html",
            "results.json",
            "rows",
            "tables.md",
        )
    ]
    assert json.loads((folder / "results.json").read_text()) == found
    assert (found["schema"], found["suite"], found["seed"], found["plant"]) == (
        1,
        "paper-suite",
        7,
        "mujoco",
    )
    assert found["summaries"] == table(flown())
    assert (folder / "tables.md").read_text() == comparison.report(found).markdown()
    picture = (folder / "laws.png").read_bytes()
    assert picture.startswith(b"\x89PNG\r\n\x1a\n")
    page = (folder / "report.html").read_text()
    assert base64.b64encode(picture).decode() in page
    assert all(name in page for name in LAWS)


def test_every_flight_is_a_row_of_one_table(tmp_path, asked):
    parquet = pytest.importorskip("pyarrow.parquet")
    fly_suite(Comparison(entrants=LAWS, conditions=COLUMNS), tmp_path)
    rows = parquet.read_table(tmp_path / "flights.parquet").to_pylist()
    assert len(rows) == sum(cell.status.size for cell in flown().values())
    wanted = flown()["plants_noisy", "case3_wind", "centroidal_tip"]
    found = [
        row
        for row in rows
        if (row["condition"], row["case"], row["law"])
        == ("plants_noisy", "case3_wind", "centroidal_tip")
    ]
    assert [row[SUCCESS_METRIC] for row in found] == list(
        wanted.metrics[SUCCESS_METRIC]
    )
    assert [(row["trial"], row["status"]) for row in found] == [
        (0.0, "completed"),
        (1.0, "completed"),
    ]


def test_a_number_that_json_does_not_know_is_not_written(tmp_path, asked, monkeypatch):
    monkeypatch.setattr(
        run_suite,
        "table",
        lambda _cells: {"plants_noisy": {"case3_wind": {}, "none": float("nan")}},
    )
    with pytest.raises(ValueError, match="not JSON compliant"):
        fly_suite(Comparison(entrants=LAWS, conditions=COLUMNS), tmp_path)
    assert not (tmp_path / "results.json").exists()
