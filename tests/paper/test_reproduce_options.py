"""``skyarm reproduce`` and its ``--infer`` of few candidates: from command to report."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from test_reproduce import _few

from commanded import skyarm
from skyarm.paper import inferred_settings, reproduce
from skyarm.studies.identify.identification import result_digest


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
