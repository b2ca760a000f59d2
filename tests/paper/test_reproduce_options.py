"""``skyarm reproduce`` and a search that is continued, of few candidates: from command
to report.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest
from small_reports import few

import infer
from inference.checks import checked_study
from inference.identification import result_digest
from skyarm.paper import inferred_settings, reproduce
from support.commands import skyarm


@pytest.mark.thorough
def test_the_paper_is_reproduced(tmp_path: Path) -> None:
    done = skyarm("reproduce", "--out", str(tmp_path))
    assert done.code == 0, done.err
    assert (tmp_path / "report.html").is_file()


@pytest.mark.thorough
def test_a_search_is_continued_and_shown_in_the_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All of the search's stages but the first are there; of minutes some seconds are
    left.
    """
    shipped = inferred_settings.shipped_evidence()
    study = checked_study(
        (inferred_settings.LIBRARY / inferred_settings.STUDY).read_bytes(),
        Path(),
        "study",
    )
    stages = {
        name: found for name, found in shipped["stages"].items() if name != "stated"
    }
    there = {**shipped, "digest": result_digest(study), "stages": stages}
    file = tmp_path / inferred_settings.FOUND
    file.write_text(json.dumps(there), "utf-8")
    flown: list[Any] = []
    monkeypatch.setattr(
        reproduce,
        "run_campaign",
        lambda *a, evidence, **k: flown.append(evidence) or few(*a, **k),
    )
    monkeypatch.setattr(
        sys, "argv", ["infer.py", "--plant", "rigid_body", "--out", str(tmp_path)]
    )
    infer.main()
    (evidence,) = flown
    assert evidence == json.loads(file.read_text("utf-8"))
    assert list(evidence["stages"]) == list(shipped["stages"])
    assert (tmp_path / "report.html").is_file()
