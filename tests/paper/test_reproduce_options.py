"""``skyarm reproduce``, its ``--infer`` and ``--compare`` of few candidates, laws and axes: from command to report."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from test_reproduce import _few

from commanded import skyarm
from skyarm.paper import inferred_settings, reproduce
from skyarm.studies.compare import comparison, envelope
from skyarm.studies.compare.entrants import ENTRANTS
from skyarm.studies.compare.suite import conditions
from skyarm.studies.identify.identification import result_digest

LAWS = ("paper_pd", "paper_ct")


@pytest.mark.thorough
def test_the_paper_is_reproduced(tmp_path: Path) -> None:
    done = skyarm("reproduce", "--out", str(tmp_path))
    assert done.code == 0, done.err
    assert (tmp_path / "report.html").is_file()


@pytest.mark.thorough
def test_a_search_is_continued_and_shown_in_the_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All of the search's stages but the first are there; of minutes some seconds are left."""
    shipped = inferred_settings.shipped_evidence()
    stages = {name: found for name, found in shipped["stages"].items() if name != "stated"}
    there = {**shipped, "digest": result_digest(inferred_settings.unstated_study()), "stages": stages}
    file = tmp_path / inferred_settings.FOUND
    file.write_text(json.dumps(there), "utf-8")
    flown: list[Any] = []
    monkeypatch.setattr(reproduce, "run_campaign", lambda *a, evidence, **k: flown.append(evidence) or _few(*a, **k))
    done = skyarm("reproduce", "--infer", "--plant", "rigid_body", "--out", str(tmp_path))
    assert done.code == 0, done.err
    (evidence,) = flown
    assert evidence == json.loads(file.read_text("utf-8"))
    assert list(evidence["stages"]) == list(shipped["stages"])
    assert (tmp_path / "report.html").is_file()


@pytest.mark.thorough
def test_a_small_comparison_is_shown_in_the_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reproduce, "run_campaign", _few)
    entrants = {name: ENTRANTS[name] for name in LAWS}
    made = partial(comparison.Comparison, entrants=entrants, conditions={"perfect": conditions()["perfect"]})
    monkeypatch.setattr(comparison, "Comparison", made)
    small = partial(envelope.Envelope, laws=LAWS, axes=("circle",), quick=True)
    monkeypatch.setattr(envelope, "Envelope", small)
    done = skyarm("reproduce", "--compare", "--plant", "rigid_body", "--out", str(tmp_path))
    assert done.code == 0, done.err
    page = (tmp_path / "report.html").read_text("utf-8")
    assert "paper_pd against paper_ct" in page
    assert "The envelope" in page
    for name in ("compare", "envelope"):
        assert f'href="{name}/report.html"' in page
        assert (tmp_path / name / "report.html").is_file()


def test_without_a_choice_the_centroidal_law_flies_beside_the_paper_s() -> None:
    (suite,) = reproduce.usual_suites().values()
    assert isinstance(suite, comparison.Comparison)
    assert list(suite.entrants) == ["paper_pd", "paper_ct", "centroidal_joint", "centroidal_tip"]
    assert list(suite.conditions) == ["perfect", "noisy"]
