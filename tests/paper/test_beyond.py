"""The report's sections beyond the paper: numbers are those of flights, and of the comparison, which joins if asked."""

from __future__ import annotations

import dataclasses
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.compare import comparison as results_room
from skyarm.compare import run_suite
from skyarm.compare.cells import Cell
from skyarm.compare.comparison import Comparison
from skyarm.compare.comparison_report import BASE, JOINT, TOOL
from skyarm.compare.entrants import ENTRANTS
from skyarm.compare.suite import conditions
from skyarm.compare.summary import SUCCESS_METRIC, table
from skyarm.paper import campaign as campaign_room
from skyarm.paper import reproduce as room
from skyarm.paper.beyond import NAMES, beyond_section, errors, hints
from skyarm.paper.campaign import COLUMNS, HARDER, LAWS, Campaign, Job, beyond_jobs, perform, run_campaign
from skyarm.paper.flights import Flight
from skyarm.paper.published import TITLES
from skyarm.scenario.scenario_file import load_scenario
from skyarm.simulate import run


def job(condition: str, name: str) -> Job:
    return Job(Flight("case3_wind", name, "rigid_body"), condition=condition)


JOBS = [job(condition, name) for condition in COLUMNS for name in ("paper_ct", "centroidal_tip")]
JOBS += [Job(Flight("case3_wind", f"centroidal_{mode}_stiff", "rigid_body")) for mode in ("joint", "tip")]
FAST = {
    name: dataclasses.replace(each, cases=("case3_wind",))
    for name, each in conditions(plants=2, seeds=2).items()
    if name in ("perfect", "plants_noisy")
}
TINY = Comparison(
    entrants={name: ENTRANTS[name] for name in ("paper_ct", "ct_ladder 3", "centroidal_tip")}, conditions=FAST
)


class Cells(HTMLParser):
    """Rows of every table of a page as lists of text."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.inside = False
        self.feed(source)

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        del attrs
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")
            self.inside = True

    def handle_endtag(self, tag: str) -> None:
        self.inside = self.inside and tag not in ("td", "th")

    def handle_data(self, data: str) -> None:
        if self.inside:
            self.rows[-1][-1] += data


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Campaign]:
    """A reproduction with four cells beyond the paper and a tiny comparison."""
    folder, kept = tmp_path_factory.mktemp("beyond"), []

    def few(plants: Any, **more: Any) -> Campaign:
        found = run_campaign(plants, sensitivity=False, inferred=False, **more)
        kept.append(found)
        return found

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(room, "run_campaign", few)
        patch.setattr(room, "reasons", lambda *_: {})
        patch.setattr(room, "paper_figures", lambda *_: {})
        patch.setattr(results_room, "step_times", lambda *_: {})
        patch.setattr(campaign_room, "beyond_jobs", lambda _plants: JOBS)
        skyarm.reproduce(folder, plants=("rigid_body",), comparison=TINY)
    return folder, kept[0]


def test_every_law_flies_every_case_with_perfect_state_and_with_noise() -> None:
    jobs = [each for each in beyond_jobs(["rigid_body", "mujoco"]) if each.condition]
    assert len(set(jobs)) == len(jobs) == len(COLUMNS) * len(HARDER) * len(LAWS) == 2 * 7 * 4


@pytest.mark.parametrize(("name", "preset"), [("paper_ct", "paper_ct"), ("centroidal_tip", "centroidal_tip_stiff")])
def test_a_cell_is_the_single_flight_of_its_preset(name: str, preset: str) -> None:
    cell = perform(job("perfect", name))
    assert isinstance(cell, Cell)
    log = run(load_scenario("case3_wind", controller=preset))
    for metric, value in errors(log).items():
        # the single flight is rounded once more an operation
        assert cell.metrics[metric][0] == pytest.approx(value, rel=1e-6)


def test_a_flight_that_ended_early_has_no_errors() -> None:
    log = run(load_scenario("case3_wind", controller="paper_ct", duration=1.0))
    ended = dataclasses.replace(log, info={**log.info, "status": "diverged"})
    assert set(errors(ended).values()) == {None}


def made() -> dict[str, Any]:
    """Summaries in which every number tells where it stands: condition, case, law, metric."""
    metrics = (BASE, JOINT, TOOL, "gust_peak_x_continuous", "gust_ee_peak_x_continuous", "rotor_jitter", "tilt_max")
    cells = {}
    for a, condition in enumerate(COLUMNS):
        for b, case in enumerate(HARDER):
            for c, name in enumerate(LAWS):
                numbers = {
                    metric: np.array([1.0 * (1 + a) + 0.1 * b + 0.01 * c + 0.001 * d])
                    for d, metric in enumerate(metrics)
                }
                cells[condition, case, name] = Cell(
                    {**numbers, SUCCESS_METRIC: np.array([1.0])}, np.array(["completed"])
                )
    return table(cells)


def test_every_number_stands_where_it_belongs() -> None:
    rows = Cells(beyond_section(made(), {}, b"")).rows
    at = rows.index(next(row for row in rows if row[0] == "Case 3 in constant wind"))
    assert rows[at + 1] == [NAMES["paper_pd"], "1400", "1401", "1402", "2400", "2401", "2402", "2.40"]
    assert rows[at + 4] == [NAMES["centroidal_tip"], "1430", "1431", "1432", "2430", "2431", "2432", "2.43"]
    gust = rows.index(next(row for row in rows if row[0] == TITLES["case2_gust"]))
    # millimetres; 1.2 + 0.003 and 0.004
    assert rows[gust + 1] == [NAMES["paper_pd"], "1203", "-", "1204", "2203", "-", "2204", "2.21"]


def test_the_hint_on_joint_mode_takes_its_numbers_from_the_flights() -> None:
    joint, tip, noise = hints(made())
    assert "1420 mm and the joints to 1421 mrad the tip is 1422 mm away" in joint
    assert "by 1431 mrad in the wind" in tip
    assert "1430 mm, or 1630 mm" in tip
    assert "mean tip error is 1432 mm (1632 mm)" in tip
    assert "CT 1010 and 2010 mm, PD 1000 and 2000 mm" in noise
    assert "1001 and 2001 mrad" in noise


def test_a_law_that_did_not_fly_is_a_dash() -> None:
    rows = Cells(beyond_section({}, {}, b"")).rows
    assert ["-"] * 7 in [row[1:] for row in rows]


@pytest.mark.thorough
def test_the_report_shows_the_flights_and_the_picture(flown: tuple[Path, Campaign]) -> None:
    folder, campaign = flown
    source = (folder / "report.html").read_text(encoding="utf-8")
    rows = Cells(source).rows
    cells = campaign.cells
    tip = [1e3 * cells[condition, "case3_wind", "centroidal_tip"].metrics[TOOL].mean() for condition in COLUMNS]
    shown = next(row for row in rows if row[0] == NAMES["centroidal_tip"] and row[3] == f"{tip[0]:.2f}")
    assert shown[6] == f"{tip[1]:.2f}"
    assert (folder / "figures" / "tip.png").read_bytes().startswith(b"\x89PNG")
    read = json.loads((folder / "beyond.json").read_text(encoding="utf-8"))
    assert read["summaries"]["noisy"]["case3_wind"]["centroidal_tip"]["metrics"][TOOL]["mean"] == pytest.approx(
        1e-3 * tip[1]
    )
    assert read["summaries"]["noisy"]["case3_wind"]["centroidal_tip"]["episodes"] == 8


@pytest.mark.thorough
def test_the_log_in_the_picture_is_the_flight_in_the_table(flown: tuple[Path, Campaign]) -> None:
    _, campaign = flown
    log = campaign.exact["rigid_body"]["centroidal_tip_stiff"]
    cell = campaign.cells["perfect", "case3_wind", "centroidal_tip"]
    assert errors(log)[TOOL] == pytest.approx(cell.metrics[TOOL][0], rel=1e-6)


@pytest.mark.thorough
def test_the_comparison_joins_the_report_and_has_its_own_page(flown: tuple[Path, Campaign]) -> None:
    folder, _ = flown
    source = (folder / "report.html").read_text(encoding="utf-8")
    without_scripts = re.sub(r"<script.*?</script>", "", source, flags=re.DOTALL)
    addresses = [found for found in re.findall(r'href="([^"]*)"', without_scripts) if not found.startswith("#")]
    assert addresses.pop() == "compare/report.html"
    assert len(addresses) == 10, "the page of each case, twice"
    assert all((folder / address).exists() for address in (*addresses, "compare/report.html"))
    found = json.loads((folder / "compare" / "results.json").read_text(encoding="utf-8"))
    rate = found["summaries"]["plants_noisy"]["case3_wind"]["centroidal_tip"]["success_rate"]
    rows = Cells(source[source.index("All laws compared</h2>") :]).rows
    ladder = next(row for row in rows if row[0] == "ct_ladder 3" and len(row) == 10)
    assert ladder[-1] == f"{found['summaries']['plants_noisy']['case3_wind']['ct_ladder 3']['success_rate']:.1%}"
    assert any(row[0] == "centroidal_tip" and row[1].startswith(f"{rate:.1%}") for row in rows)
    assert without_scripts.count("<table") == without_scripts.count("<caption")


@pytest.mark.thorough
def test_a_comparison_that_is_there_is_not_flown_again(
    flown: tuple[Path, Campaign], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, _ = flown

    def again(*_: Any) -> None:
        raise AssertionError("flown again")

    monkeypatch.setattr(run_suite, "fly", again)
    assert run_suite.fly_all(TINY.flights(), folder / "compare" / "cells")
