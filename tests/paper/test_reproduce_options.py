"""``skyarm reproduce``, its ``--infer`` and ``--compare`` of few candidates, laws and axes: from command to report."""

from __future__ import annotations

import dataclasses
import json
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from test_reproduce import _few

from commanded import skyarm
from skyarm.compare import comparison, envelope_suite
from skyarm.compare.entrants import ENTRANTS
from skyarm.compare.suite import conditions
from skyarm.identify.study_reader import read_identification
from skyarm.paper import inferred_settings, reproduce

LAWS = ("paper_pd", "paper_ct")


@pytest.mark.thorough
def test_the_paper_is_reproduced(tmp_path: Path) -> None:
    done = skyarm("reproduce", "--out", str(tmp_path))
    assert done.code == 0, done.err
    assert (tmp_path / "report.html").is_file()


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """The paper's five cases, without the variations and what flies beyond the paper."""
    monkeypatch.setattr(reproduce, "run_campaign", _few)


@pytest.mark.thorough
@pytest.mark.usefixtures("few")
def test_a_small_search_is_shown_in_the_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    study = (inferred_settings.LIBRARY / inferred_settings.STUDY).read_text("utf-8")
    whole = read_identification(study.encode(), Path(), inferred_settings.STUDY)
    few_of = {name: getattr(whole, name)[:1] for name in ("ladder", "rivals", "predictions")}
    made = dataclasses.replace(whole, population=4, generations=1, **few_of)
    monkeypatch.setattr("skyarm.paper.infer.unstated_study", lambda: made)
    found: list[Any] = []
    monkeypatch.setattr(reproduce, "run_campaign", lambda *a, evidence, **k: found.append(evidence) or _few(*a, **k))
    done = skyarm("reproduce", "--infer", "--plant", "rigid_body", "--out", str(tmp_path))
    assert done.code == 0, done.err
    assert found == [json.loads((tmp_path / inferred_settings.FOUND).read_text("utf-8"))]
    assert (tmp_path / "report.html").is_file()


@pytest.mark.thorough
@pytest.mark.usefixtures("few")
def test_a_small_comparison_is_shown_in_the_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    entrants = {name: ENTRANTS[name] for name in LAWS}
    made = partial(comparison.Comparison, entrants=entrants, conditions={"perfect": conditions()["perfect"]})
    monkeypatch.setattr(comparison, "Comparison", made)
    small = partial(envelope_suite.Envelope, laws=LAWS, axes=("circle",), quick=True)
    monkeypatch.setattr(envelope_suite, "Envelope", small)
    done = skyarm("reproduce", "--compare", "--plant", "rigid_body", "--out", str(tmp_path))
    assert done.code == 0, done.err
    page = (tmp_path / "report.html").read_text("utf-8")
    assert "All laws compared" in page
    assert "The envelope" in page
    assert (tmp_path / reproduce.COMPARED).is_dir()
    assert (tmp_path / reproduce.ENVELOPE_FOLDER).is_dir()
