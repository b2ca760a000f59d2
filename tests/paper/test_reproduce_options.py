"""``skyarm reproduce --infer`` and ``--compare`` from the command to the report, of few candidates, laws and axes."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import pytest

from commanded import skyarm
from skyarm.compare import comparison, envelope_suite
from skyarm.compare.entrants import ENTRANTS
from skyarm.compare.suite import conditions
from skyarm.identify.study_reader import read_identification
from skyarm.paper import campaign, inferred_settings, reproduce

LAWS = ("paper_pd", "paper_ct")


@pytest.fixture(autouse=True)
def _plain_flights(monkeypatch: pytest.MonkeyPatch) -> None:
    """The paper's five cases alone, without variations."""
    monkeypatch.setattr(reproduce, "run_campaign", partial(campaign.run_campaign, sensitivity=False))


@pytest.mark.thorough
def test_a_small_search_is_shown_in_the_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    study = (inferred_settings.LIBRARY / inferred_settings.STUDY).read_text("utf-8")
    small = study.replace("population = 64\ngenerations = 40", "population = 4\ngenerations = 1")
    assert small != study
    made = read_identification(small.encode(), Path(), inferred_settings.STUDY)
    monkeypatch.setattr("skyarm.paper.infer.unstated_study", lambda: made)
    done = skyarm("reproduce", "--infer", "--plant", "rigid_body", "--out", str(tmp_path))
    assert done.code == 0, done.err
    evidence = json.loads((tmp_path / inferred_settings.FOUND).read_text("utf-8"))
    assert evidence["ladder"]
    assert "Inferred settings" in (tmp_path / "report.html").read_text("utf-8")


@pytest.mark.thorough
def test_a_small_comparison_is_shown_in_the_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    few = {name: ENTRANTS[name] for name in LAWS}
    perfect = {"perfect": conditions()["perfect"]}
    monkeypatch.setattr(comparison, "Comparison", partial(comparison.Comparison, entrants=few, conditions=perfect))
    small = partial(envelope_suite.Envelope, laws=LAWS, axes=("circle",), quick=True)
    monkeypatch.setattr(envelope_suite, "Envelope", small)
    done = skyarm("reproduce", "--compare", "--plant", "rigid_body", "--out", str(tmp_path))
    assert done.code == 0, done.err
    page = (tmp_path / "report.html").read_text("utf-8")
    assert "All laws compared" in page
    assert "The envelope" in page
    assert (tmp_path / reproduce.COMPARED).is_dir()
    assert (tmp_path / reproduce.ENVELOPE_FOLDER).is_dir()
