"""The inferred column: flown live from the settings that ship, counted by one rule, as
good as it must be.
"""

from __future__ import annotations

import dataclasses
import html
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from infer import infer
from inference.candidates import Candidates
from inference.checks import checked_study
from skyarm.paper import inference_tables as shown
from skyarm.paper.counted_cells import (
    counts,
    in_group,
    inferred_value,
    published_cells,
    sentence,
    stated_value,
)
from skyarm.paper.flights import PaperFlight, results, scenario, settings
from skyarm.paper.inferred_settings import (
    INFERRED,
    LIBRARY,
    PREDICTED,
    STUDY,
    inferred_scenario,
    is_of_this_study,
    settings_in,
    shipped_evidence,
    unstated_study,
)
from skyarm.paper.published import PRINTED
from skyarm.paper.report_pages import inferred_section, report_pages
from skyarm.paper.report_pages import markdown_tables as markdown
from skyarm.paper.report_text import OPEN
from skyarm.paper.reproduce import Campaign
from skyarm.paper.verdict_sentences import verdict
from skyarm.simulate import run

PLANTS = ("rigid_body", "mujoco")


pytestmark = pytest.mark.thorough
"""They fly the paper's campaign a second time; `make reproduce` prints the same
column."""


@pytest.fixture(scope="module")
def table(campaign: Campaign) -> dict[str, Any]:
    facts = settings(campaign.all_logs()) | shown.inferred_facts(shipped_evidence())
    return results(campaign.found["stated"], facts, campaign.found[INFERRED])


@pytest.fixture(scope="module")
def predicted(campaign: Campaign) -> dict[str, Any]:
    found: dict[str, Any] = results(
        campaign.found["stated"], {}, campaign.found[PREDICTED]
    )["experiments"]
    return found


def test_the_study_s_cells_are_the_paper_s() -> None:
    study = unstated_study()
    printed = {
        (f"{case} {law}", name): text
        for case, laws in PRINTED.items()
        for law, cells in laws.items()
        for name, text in cells.items()
        if not name.startswith("settling_time")
    }
    written = {
        (flight["name"], name): cell["measured"] if isinstance(cell, dict) else cell
        for flight in unstated_study()["flights"]
        for name, cell in flight["cells"].items()
    }
    assert written == printed
    study = checked_study((LIBRARY / STUDY).read_bytes(), Path(), STUDY)
    assert [len(study.among(law)) for law in ("", "PD", "CT")] == [103, 52, 51]
    assert {(c.flight, c.name): (c.measured, c.half) for c in study.cells} == {
        (c.flight, c.name): (c.measured, c.half) for c in published_cells()
    }


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize(
    ("case", "law"), [("case1", "CT"), ("case3", "PD"), ("case2_gust", "CT")]
)
def test_without_settings_the_study_flies_what_is_stated(
    case: str, law: str, plant: str
) -> None:
    flight = PaperFlight(case, law, plant)
    short = [
        dataclasses.replace(
            each, duration=7.0, windows=dataclasses.replace(each.windows, last=1.0)
        )
        for each in (scenario(flight), inferred_scenario(flight, {}))
    ]
    logs = [run(each) for each in short]
    for name in (
        "position",
        "joints",
        "rotor_commands",
        "position_held",
        "joints_held",
    ):
        assert np.allclose(
            getattr(logs[0], name), getattr(logs[1], name), rtol=0.0, atol=1e-9
        ), name


def test_the_settings_reach_every_flight() -> None:
    found = settings_in(shipped_evidence(), INFERRED)
    for case, law in (
        ("case2", "CT"),
        ("case3", "PD"),
        ("case1", "PD"),
        ("case3_wind", "CT"),
    ):
        planned = inferred_scenario(PaperFlight(case, law, "mujoco"), found)
        believed = planned.controller.par
        assert planned.kind == "mujoco"
        assert planned.plant.vehicle.links[0].joint.damping == found["friction_1"]
        assert planned.plant.vehicle.links[1].joint.damping == 0.001
        assert believed.friction_compensation == (
            (1.0, 1.0) if law == "CT" else (0.0, 0.0)
        )
        assert (planned.delays.rotors, planned.delays.joints) == (
            found["rotors_late"],
            0,
        )
        assert planned.delays.longest_command is None
        joined = {
            "case1 PD": "pd_joins_case1",
            "case2 CT": "ct_joins",
            "case3 PD": "pd_joins",
        }.get(f"{case} {law}")
        assert planned.tracking_start == (found[joined] if joined else 0)
    case1 = inferred_scenario(
        PaperFlight("case1", "PD", "rigid_body"), found
    ).reference.joints[0]
    at = [
        case1.derivatives(t)[0]
        for t in (
            0.0,
            0.02,
            found["pd_joins_case1"] + 5.98,
            found["pd_joins_case1"] + 6.0,
        )
    ]
    assert at == pytest.approx([0.0, 0.3, 0.3, 0.0])
    # a step is published with the rate of a hold
    assert case1.derivatives(found["pd_joins_case1"] + 6.0)[1] == 0.0


def test_the_evidence_that_ships_is_of_this_study() -> None:
    assert is_of_this_study(shipped_evidence()), (
        "run research/infer.py and ship what it writes"
    )
    assert not is_of_this_study({"study_digest": "another"})


@pytest.mark.parametrize("plant", PLANTS)
def test_the_inferred_column_is_as_near_as_it_must_be(
    table: dict[str, Any], plant: str
) -> None:
    by_law = {
        law: counts(
            table["experiments"],
            inferred_value(plant),
            lambda cell, law=law: cell.flight.endswith(law),
        )
        for law in ("PD", "CT")
    }
    assert by_law["PD"]["cells"] == 52
    assert by_law["PD"]["within_25%"] >= 47
    assert by_law["CT"]["cells"] == 51
    assert by_law["CT"]["within_25%"] >= 37
    before, after = (
        counts(table["experiments"], each(plant))
        for each in (stated_value, inferred_value)
    )
    assert after["loss"] < 0.35 * before["loss"]


NAMED = {("case1 CT", "tau1_rms"), ("case1 CT", "tau2_rms")}
"""Cells that agree within 10 % as stated and leave 25 %: the price of the steps in Case
1, which decision 005 names."""


@pytest.mark.parametrize("plant", PLANTS)
def test_no_cell_that_agrees_is_lost_but_those_that_are_named(
    table: dict[str, Any], plant: str
) -> None:
    lost = set()
    for cell in published_cells():
        one = {
            which: counts(
                table["experiments"], column(plant), lambda c, cell=cell: c == cell
            )
            for which, column in (
                ("stated", stated_value),
                ("inferred", inferred_value),
            )
        }
        if one["stated"]["within_10%"] and not one["inferred"]["within_25%"]:
            lost.add((cell.flight, cell.name))
    assert lost <= NAMED


def test_the_search_s_single_precision_is_the_flights(table: dict[str, Any]) -> None:
    evidence = shipped_evidence()
    live = counts(table["experiments"], inferred_value("rigid_body"))
    fit = evidence["stages"]["fit"]
    assert live["loss"] == pytest.approx(fit["loss"], rel=0.02)
    assert abs(live["within_25%"] - fit["within_25%"]) <= 1
    assert evidence["stages"]["ladder"]["rungs"][-1]["loss"] == fit["loss"]
    assert counts(table["experiments"], stated_value("rigid_body"))[
        "loss"
    ] == pytest.approx(evidence["stages"]["stated"]["loss"], rel=0.02)


def test_it_predicts_what_it_has_not_seen(
    table: dict[str, Any], predicted: dict[str, Any]
) -> None:
    """Found on Cases 2 and 3 alone, the settings bring the gust nearer and leave the
    wind as it is.
    """
    columns = (
        (table["experiments"], stated_value("rigid_body")),
        (
            predicted,
            inferred_value("rigid_body"),
        ),
    )
    gust = [counts(*each, in_group("gust"))["loss"] for each in columns]
    wind = [counts(*each, in_group("wind"))["loss"] for each in columns]
    assert gust[1] < 0.5 * gust[0]
    assert wind[1] < wind[0] + 1.5


def test_results_hold_the_column_and_what_it_depends_on(table: dict[str, Any]) -> None:
    cell = table["experiments"]["case2"]["PD"]["joint_error_mean"]
    assert set(cell) == {"paper", *PLANTS, "inferred"}
    assert set(cell["inferred"]) == set(PLANTS)
    assert abs(cell["inferred"]["rigid_body"] - 0.049) < 0.3 * abs(
        cell["rigid_body"] - 0.049
    )
    facts = table["settings"]["inferred"]
    study = unstated_study()
    assert (facts["numbers"], facts["choices"]) == (
        len(study["fit"]["free"]),
        len(study["fit"]["choices"]),
    )


def test_counts_come_in_a_sentence_before_any_verdict(table: dict[str, Any]) -> None:
    words = sentence(table)
    for column in (stated_value, inferred_value):
        first, second = (
            counts(table["experiments"], column(plant)) for plant in PLANTS
        )
        assert (
            f"{first['within_25%']} lie within 25 %, {first['within_10%']} within 10 %"
            in words
        )
        assert (
            f"(on mujoco {second['within_25%']}, {second['within_10%']} and"
            f" {second['within_5%']})" in words
        )
    assert "the paper's 103 numbers" in words
    assert f"{len(unstated_study()['fit']['free'])} numbers" in words
    text = markdown(table)
    assert text.index(words) < text.index("Metrics whose better law")
    page = report_pages(table, {}, {}, {})["report.html"]
    for said in verdict(table):
        assert page.index(html.escape(said).replace("&#x27;", "&#39;")) < page.index(
            "<table"
        )


def test_a_table_without_inferred_numbers_still_reads() -> None:
    bare = results({}, {})
    assert "No number of the paper" in sentence(bare)
    assert counts(bare["experiments"], stated_value("mujoco")) == {}


def test_the_section_says_what_stays_open(
    table: dict[str, Any], predicted: dict[str, Any]
) -> None:
    page = inferred_section(table, predicted, shipped_evidence(), "rigid_body")
    assert "3.0 times in the mean" in OPEN[0]
    for words in ("What stays open", "Ladder", "Out of sample", "Rivals"):
        assert words in page
    assert "another version of the study" not in page
    old = {**shipped_evidence(), "study_digest": ""}
    assert "another version of the study" in inferred_section(
        table, predicted, old, "rigid_body"
    )


def test_the_evidence_reads_as_tables() -> None:
    evidence = shipped_evidence()
    tables = shown.evidence_tables(evidence)
    assert all(len(row) == len(each.head) for each in tables for row in each.rows)
    ladder = next(each for each in tables if each.caption.startswith("Ladder"))
    assert len(ladder.rows) == 1 + len(unstated_study()["ladder"])
    rivals = next(each for each in tables if each.caption.startswith("Rivals"))
    assert len(rivals.rows) == len(unstated_study()["rivals"])
    assert shown.markdown_of(tables).count("\n## ") == len(tables)


def test_evidence_that_is_there_is_not_searched_for_again(
    tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from inference import identification

    def flown(*_: Any, **__: Any) -> None:
        raise AssertionError("flown")

    study = checked_study((LIBRARY / STUDY).read_bytes(), Path(), STUDY)
    monkeypatch.setattr(Candidates, "cells", flown)
    found = shipped_evidence()
    file = tmp_path / "unstated_settings.json"
    file.write_bytes(
        identification._json(
            study, identification.result_digest(study), found["stages"]
        )
    )
    told: list[str] = []
    again = infer(tmp_path, progress=lambda _done, _total, name: told.append(name))
    assert again["stages"] == found["stages"]
    assert told == [""]
