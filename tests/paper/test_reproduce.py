"""One call writes everything; nothing is flown that cannot be written."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import pytest
from small_reports import draw_small, few, made_once

import skyarm
from skyarm.paper import reproduce as room
from skyarm.paper.flights import metrics, results, settings
from skyarm.paper.published import CASES, PRINTED, digits
from skyarm.paper.reproduce import Campaign
from skyarm.records.files.writing import TakenError, one_writer
from skyarm.scenario.scenario_file import load_scenario
from skyarm.simulate import Log, run
from support.commands import skyarm as command


@pytest.fixture(scope="module")
def written(
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[Path, dict[str, Any], list[str]]:
    def make() -> tuple[Path, dict[str, Any], list[str]]:
        folder = tmp_path_factory.mktemp("paper") / "made" / "here"
        notes: list[str] = []
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(room, "run_campaign", few)
            draw_small(patch, room)
            table = skyarm.reproduce(folder, plants=("rigid_body",), note=notes.append)
        return folder, table, notes

    return made_once(tmp_path_factory, "reproduction", make)


def _no_constant(name: str) -> float:
    raise AssertionError(f"{name} is not JSON")


def test_every_promised_file_is_there_and_nothing_else(
    written: tuple[Path, dict[str, Any], list[str]],
) -> None:
    folder, _, notes = written
    wanted = {
        "results.json",
        "sensitivity.json",
        "table2.md",
        "inference.md",
        "report.html",
    }
    wanted |= {f"{case}.html" for case in CASES}
    wanted |= {f"figures/figure_{i:02d}.png" for i in range(3, 19)} | {
        "figures/overview.png"
    }
    wanted |= {
        f"logs/rigid_body/{case}_{controller}.npz"
        for case in CASES
        for controller in ("CT", "PD")
    }
    there = {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()}
    assert {name for name in there if not name.startswith("rows/")} == wanted
    assert all((folder / name).stat().st_size > 0 for name in wanted)
    assert len(notes) == 3


def test_the_report_opens_with_a_picture_of_its_flights(
    written: tuple[Path, dict[str, Any], list[str]],
) -> None:
    page = (written[0] / "report.html").read_text(encoding="utf-8")
    assert (
        page.index("<table")
        < page.index('class="single opening"')
        < page.index("<main")
    )


def test_results_json_is_what_the_call_returns_and_strict(
    written: tuple[Path, dict[str, Any], list[str]],
) -> None:
    folder, table, _ = written
    read = json.loads(
        (folder / "results.json").read_text(encoding="utf-8"),
        parse_constant=_no_constant,
    )
    assert read == table
    assert read["schema"] == 1
    cell = read["experiments"]["case2"]["CT"]["position_error_mean"]
    assert cell["mujoco"] is None, "a plant that was not flown is null"
    assert math.isfinite(cell["rigid_body"])
    assert math.isfinite(cell["inferred"]["rigid_body"])
    assert cell["inferred"]["rigid_body"] != cell["rigid_body"], (
        "flown with settings of their own"
    )


def test_the_markdown_holds_every_published_cell(
    written: tuple[Path, dict[str, Any], list[str]],
) -> None:
    folder, table, _ = written
    text = (folder / "table2.md").read_text(encoding="utf-8")
    for case, controllers in table["experiments"].items():
        for controller, cells in controllers.items():
            for metric, cell in cells.items():
                if cell["paper"] is not None:
                    assert (
                        f"| {controller} | {PRINTED[case][controller][metric]} |"
                        f" {digits(cell['rigid_body'])} |" in text
                    )


def test_logs_are_the_flights(written: tuple[Path, dict[str, Any], list[str]]) -> None:
    folder, _, _ = written
    log = Log.load_npz(folder / "logs" / "rigid_body" / "case3_wind_PD.npz")
    assert (log.info["scenario"], log.info["controller"]) == (
        "case3_wind",
        "decoupled_pd",
    )
    assert log.time.size == 6000


def _nothing_flown(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """Campaigns that were asked for in place of flown."""
    asked: list[dict[str, Any]] = []
    monkeypatch.setattr(
        room,
        "run_campaign",
        lambda _plants, **options: asked.append(options) or Campaign(),
    )
    monkeypatch.setattr(room, "_write", lambda *_: {"written": True})
    return asked


def test_a_second_command_into_the_folder_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = _nothing_flown(monkeypatch)
    with (
        one_writer(tmp_path),
        pytest.raises(
            TakenError, match=r"^folder = .*: must be written by one pro"
        ) as caught,
    ):
        skyarm.reproduce(tmp_path)
    assert "\n" not in str(caught.value)
    assert not asked
    assert skyarm.reproduce(tmp_path) == {"written": True}


def test_without_pyarrow_flights_are_not_kept_which_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked, notes = _nothing_flown(monkeypatch), list[str]()
    monkeypatch.setattr("skyarm.studies.flights.store._parquet", lambda: None)
    skyarm.reproduce(tmp_path, note=notes.append)
    assert asked[0]["store"] is None
    (line,) = notes
    assert line.startswith("pyarrow is missing, flights are not kept; ")
    assert not (tmp_path / "rows").exists()


def test_nowhere_is_no_place_to_fly(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = _nothing_flown(monkeypatch)
    for on in ("", "moon", 3):
        with pytest.raises(
            ValueError,
            match=r"^on = .*: must be local, processes, ray or ray:HOST:PORT$",
        ):
            skyarm.reproduce(tmp_path / "out", on=on)  # type: ignore[arg-type]
    done = command("reproduce", "--on", "moon", "--out", str(tmp_path / "out"))
    assert (done.code, asked) == (2, [])
    assert "--on = 'moon'" in done.err
    assert not (tmp_path / "out").exists()


def test_nothing_is_flown_for_an_unknown_plant(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def flown(*_: Any, **__: Any) -> None:
        raise AssertionError("flown")

    monkeypatch.setattr(room, "run_campaign", flown)
    for plants in (("gazebo",), ("rigid_body", "x"), ()):
        with pytest.raises(ValueError, match="rigid_body, mujoco"):
            skyarm.reproduce(tmp_path / "out", plants=plants)
    assert not (tmp_path / "out").exists()


def test_a_flight_that_diverged_is_null_and_named() -> None:
    """A campaign with one short episode still makes a whole table."""
    log = run(load_scenario("case2", duration=1.0))
    ended = {
        "status": "diverged",
        "cause": "rate.x passed 10000",
        "duration": load_scenario("case2").duration,
    }
    log = dataclasses.replace(log, info=log.info | ended)
    table = results(
        {("case2", "CT", "rigid_body"): metrics("case2", log)}, settings([log])
    )
    json.dumps(table, allow_nan=False)
    assert (
        table["experiments"]["case2"]["CT"]["position_error_mean"]["rigid_body"] is None
    )
    assert table["settings"]["not_completed"] == [
        "case2 hybrid_computed_torque rigid_body: diverged, rate.x passed 10000"
    ]
