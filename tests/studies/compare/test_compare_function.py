"""Comparison of laws from Python: a scenario's record, name or path, and the suites."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import skyarm
from skyarm.records.identity import identity
from skyarm.studies.compare import compare_laws
from skyarm.studies.compare.comparison import Comparison
from skyarm.studies.compare.entrants import ENTRANTS
from skyarm.studies.compare.envelope import Envelope
from skyarm.view.pages import Report, Section, Table


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Suites that would have flown, in place of flying."""
    seen: list[Any] = []
    monkeypatch.setattr(
        compare_laws,
        "fly_suite",
        lambda suite, folder, **_: seen.append((suite, folder)) or {"a": 1},
    )
    table = Table(head=["law"], rows=[["<b>"]])
    report = Report(
        title="two laws", facts="", sections=[Section(name="all", tables=[table])]
    )
    for kind in (*compare_laws.SUITES.values(), compare_laws.OwnScenario):
        monkeypatch.setattr(kind, "report", lambda *_: report)
    return seen


def test_a_record_flies_what_its_name_flies(asked: list[Any], tmp_path: Path) -> None:
    record = skyarm.load_scenario("case1")
    found = [
        skyarm.compare(given, ["own", "centroidal_tip"], tmp_path / "out", seed=3)
        for given in (record, "case1")
    ]
    cells = [
        [identity(each.scenario()) for each in suite.plan_cells()[0]]
        for suite, _ in asked
    ]
    assert cells[0] == cells[1]
    flights = asked[0][0].plan_cells()[0]
    assert [each.entrant.name for each in flights] == ["own", "centroidal_tip"]
    assert [each.scenario().seed for each in flights] == [3, 3]
    laws = [
        record.controller,
        skyarm.load_scenario("case1", controller="centroidal_tip").controller,
    ]
    assert [identity(each.scenario().controller) for each in flights] == [
        identity(each) for each in laws
    ]
    assert laws[0] != laws[1]
    assert (
        {each.folder for each in found}
        == {tmp_path / "out"}
        == {folder for _, folder in asked}
    )
    assert found[0].document == {"a": 1}
    assert found[0].report.markdown().startswith("# two laws")
    assert "<h2>two laws</h2>" in found[0]._repr_html_()
    assert "&lt;b&gt;" in found[0]._repr_html_()
    assert len(repr(found[0])) <= 300


def test_laws_beside_a_scenario_are_those_of_the_command(
    asked: list[Any], tmp_path: Path
) -> None:
    skyarm.compare("case1", ["own", "paper_pd"], tmp_path)
    skyarm.compare("case1", str(tmp_path / "gains.toml"), tmp_path)
    assert [each.entrant.name for each in asked[0][0].plan_cells()[0]] == [
        "own",
        "paper_pd",
    ]
    assert asked[1][0].laws == (str(tmp_path / "gains.toml"),)


def test_suites_take_their_own_options(asked: list[Any], tmp_path: Path) -> None:
    skyarm.compare("envelope-suite", ["paper_ct"], tmp_path, quick=True)
    skyarm.compare("paper-suite", list(ENTRANTS)[1:3], tmp_path, plant="mujoco")
    skyarm.compare(out=tmp_path)
    envelope, paper, usual = (suite for suite, _ in asked)
    assert isinstance(envelope, Envelope)
    assert (envelope.laws, envelope.quick) == (("paper_ct",), True)
    assert isinstance(paper, Comparison)
    assert (list(paper.entrants), paper.plant) == (list(ENTRANTS)[1:3], "mujoco")
    assert list(usual.entrants) == list(ENTRANTS)


@pytest.mark.parametrize(
    ("given", "laws", "words"),
    [
        (
            "case1",
            ["paper_p"],
            r"^case1: controller = 'paper_p': did you mean 'paper_pd'\?",
        ),
        ("case1", ["paper_pd", "paper_pd"], r"^laws = .*must be a list of different"),
        ("cas3", ["paper_pd"], r"^scenario = 'cas3': did you mean 'case3'\?"),
        ("paper-suite", ["nothing"], r"^laws = 'nothing': must be one of "),
        (
            3,
            ["paper_pd"],
            r"^scenario = 3: must be a Scenario, or the name or path of one$",
        ),
    ],
)
def test_what_cannot_be_compared_is_one_line(
    given: Any, laws: list[str], words: str, tmp_path: Path
) -> None:
    with pytest.raises(ValueError, match=words):
        skyarm.compare(given, laws, tmp_path / "out")


@pytest.mark.thorough
def test_a_record_is_compared_as_its_file(tmp_path: Path) -> None:
    record = skyarm.load_scenario("case1", duration=2.0)
    file = skyarm.run(record).save_npz(tmp_path / "flight.npz")
    found = [
        skyarm.compare(given, ["own", "paper_pd"], tmp_path / name)
        for name, given in (("a", record), ("b", file))
    ]
    assert found[0].document["summaries"] == found[1].document["summaries"]
    assert "| own | 1 of 1 |" in found[0].report.markdown()


def test_a_name_of_no_law_is_refused_before_the_first_flight(tmp_path):
    with pytest.raises(ValueError, match="nope"):
        skyarm.compare("case1", ["paper_pd", "nope"], tmp_path / "out")
    assert not list(tmp_path.rglob("*.parquet"))
    with pytest.raises(ValueError, match="'nope'"):
        skyarm.compare("case1", "nope", tmp_path / "out")
