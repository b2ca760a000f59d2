"""``skyarm cache``: what it tells and what it removes."""

from __future__ import annotations

from pathlib import Path

import pytest

from commanded import refused, skyarm
from skyarm.compile.llvm import object_cache


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SKYARM_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("SKYARM_CACHE_SIZE", "12")
    return tmp_path / "cache"


def test_it_tells_folder_entries_size_and_limit(cache: Path) -> None:
    object_cache.store("a", bytes(1_500_000))
    object_cache.store("b", bytes(700_000))
    told = skyarm("cache")
    assert told.code == 0
    assert told.out.splitlines() == [
        f"folder: {cache}",
        "entries: 2",
        "size: 2.2 MB of at most 12 MB (SKYARM_CACHE_SIZE)",
    ]


def test_it_removes_all_entries(cache: Path) -> None:
    object_cache.store("a", bytes(1_500_000))
    told = skyarm("cache", "--clear")
    assert told.out.splitlines()[0] == "removed: 1 entries, 1.5 MB"
    assert "entries: 0" in told.out
    assert object_cache.load("a") is None


def test_it_tells_why_nothing_is_kept(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SKYARM_CACHE_SIZE", "0")
    assert skyarm("cache").out.splitlines()[-1] == "not in use: SKYARM_CACHE_SIZE is 0"
    monkeypatch.setenv("SKYARM_CACHE_SIZE", "12")
    cache.write_text("a file in place of the folder")
    told = skyarm("cache")
    assert told.code == 0
    assert "not in use: " in told.out.splitlines()[-1]


def test_a_limit_that_is_no_number_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SKYARM_CACHE_SIZE", "much")
    refused(skyarm("cache"), "SKYARM_CACHE_SIZE = 'much': must be a number of MB, at least 0")
    refused(skyarm("run", "case1", "--duration", "0.1", "--out", "/dev/null/x"), "/dev/null/x")


def test_a_flight_says_the_same_of_a_limit_that_is_no_number(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """And does not take it for a compiler that is missing."""
    monkeypatch.setenv("SKYARM_CACHE_SIZE", "much")
    found = skyarm("run", "case1", "--duration", "0.1", "--out", str(tmp_path))
    refused(found, "SKYARM_CACHE_SIZE = 'much': must be a number of MB, at least 0")
