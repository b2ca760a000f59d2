"""``skyarm doctor`` on the cache of machine code, and ``--clear``."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from skyarm.cli import doctor_command as doctor
from skyarm.compile.llvm import object_cache
from support.commands import refused, skyarm


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SKYARM_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("SKYARM_CACHE_SIZE", "12")
    monkeypatch.setattr(doctor, "TRIALS", {})
    return tmp_path / "cache"


def test_folder_entries_size_and_limit_are_told(cache: Path) -> None:
    object_cache.store("a", bytes(1_500_000))
    object_cache.store("b", bytes(700_000))
    told = skyarm("doctor", columns=300)
    assert told.code == 0
    (line,) = [line for line in told.out.splitlines() if "cache of code" in line]
    assert f"{cache}: 2 entries, 2.2 MB of at most 12 MB (SKYARM_CACHE_SIZE)" in line
    found = json.loads(skyarm("doctor", "--json").out)["cache"]
    assert (found["folder"], found["entries"], found["most_bytes"]) == (
        str(cache),
        2,
        12_000_000,
    )


def test_all_entries_are_removed() -> None:
    object_cache.store("a", bytes(1_500_000))
    assert skyarm("doctor", "--clear").out.startswith("removed: 1 entries, 1.5 MB\n")
    assert object_cache.load("a") is None


def test_why_nothing_is_kept_is_told(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SKYARM_CACHE_SIZE", "0")
    assert "SKYARM_CACHE_SIZE is 0" in skyarm("doctor").out
    monkeypatch.setenv("SKYARM_CACHE_SIZE", "12")
    cache.write_text("a file in place of the folder")
    told = skyarm("doctor", columns=300)
    assert told.code == 0
    assert "broken: cache of code, " in told.out


def test_a_limit_that_is_no_number_is_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Also by a flight, which does not take it for a compiler that is missing."""
    monkeypatch.setenv("SKYARM_CACHE_SIZE", "much")
    wrong = "SKYARM_CACHE_SIZE = 'much': must be a number of MB, at least 0"
    refused(skyarm("doctor"), wrong)
    refused(
        skyarm("run", "case1", "--duration", "0.1", "--out", "/dev/null/x"),
        "/dev/null/x",
    )
    refused(skyarm("run", "case1", "--duration", "0.1", "--out", str(tmp_path)), wrong)
