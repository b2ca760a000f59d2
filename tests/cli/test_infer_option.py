"""skyarm reproduce --infer: searches first, prints what it found, and hands it to the reproduction."""

from __future__ import annotations

import contextlib
import io
import sys
from pathlib import Path
from typing import Any

import pytest

from skyarm.cli.main import main
from skyarm.paper.flights import results
from skyarm.paper.inferred_settings import shipped_evidence, unstated_study


def skyarm(*arguments: str) -> tuple[int, str, str]:
    out, err, before = io.StringIO(), io.StringIO(), sys.argv
    sys.argv = ["skyarm", *arguments]
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), pytest.raises(SystemExit) as stop:
            main()
    finally:
        sys.argv = before
    return int(stop.value.code or 0), out.getvalue(), err.getvalue()


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, Any]]:
    found: list[tuple[str, Any]] = []

    def search(out: str, *, threads: int, progress: Any) -> dict[str, Any]:
        found.append(("infer", threads))
        return shipped_evidence()

    def perform(_out: str, **options: Any) -> dict[str, Any]:
        found.append(("reproduce", options["evidence"]))
        return results({}, {})

    monkeypatch.setattr("skyarm.paper.inferred_settings.infer", search)
    monkeypatch.setattr("skyarm.paper.reproduce.reproduce", perform)
    monkeypatch.setattr("skyarm.cli.reproduce_command._headline", lambda _table: "")
    return found


def test_what_is_found_is_printed_and_flown(calls: list[tuple[str, Any]], tmp_path: Path) -> None:
    code, out, _ = skyarm("reproduce", "--infer", "--workers", "2", "--out", str(tmp_path))
    assert code == 0
    assert calls == [("infer", 2), ("reproduce", shipped_evidence())]
    for title in ("Inferred settings", "Ladder", "Choices", "Loss over: viscous friction", "Rivals"):
        assert title in out
    for rival in unstated_study().rivals:
        assert rival.words.split(",")[0][:12] in out


def test_without_it_nothing_is_searched(calls: list[tuple[str, Any]], tmp_path: Path) -> None:
    code, out, _ = skyarm("reproduce", "--out", str(tmp_path), "--workers", "1")
    assert code == 0
    assert calls == [("reproduce", None)]
    assert "Ladder" not in out


def test_a_folder_that_cannot_be_written_is_refused_before_the_search(
    calls: list[tuple[str, Any]], tmp_path: Path
) -> None:
    (tmp_path / "figures").write_text("in the way")
    code, _, err = skyarm("reproduce", "--infer", "--out", str(tmp_path))
    assert code == 2
    assert "must be writable" in err
    assert not calls
