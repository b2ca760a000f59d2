"""Films and recordings from Python: logs and scenarios, as records, names and paths."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.view.film import film_flights
from skyarm.view.film.recording import Recording


@pytest.fixture(scope="module")
def log() -> skyarm.Log:
    return skyarm.run(
        skyarm.load_scenario("case1", controller="paper_pd", duration=0.05)
    )


@pytest.fixture
def filmed(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What would have been drawn."""
    seen: list[Any] = []

    def record(logs: Any, settings: Any, **options: Any) -> Recording:
        seen.append((logs, settings, options))
        return Recording(b"scene", 1.0, lambda: "page")

    def make_film(logs: Any, path: Path, settings: Any, **options: Any) -> Path:
        seen.append((logs, settings, options))
        return path

    monkeypatch.setattr(film_flights, "record", record)
    monkeypatch.setattr(film_flights, "make_film", make_film)
    return seen


def test_logs_and_scenarios_are_filmed_however_they_are_given(
    log: skyarm.Log, filmed: list[Any], tmp_path: Path
) -> None:
    file = log.save_npz(tmp_path / "flight.npz")
    given = [log, file, str(file), log.scenario]
    written = skyarm.film(
        given, tmp_path / "all.viser", labels=list("abcd"), fps=10, camera="tip"
    )
    assert written == tmp_path / "all.viser"
    assert written.read_bytes() == b"scene"
    ((logs, settings, options),) = filmed
    assert all(np.array_equal(each.position, log.position) for each in logs)
    assert (len(logs), settings.fps, settings.camera, settings.width) == (
        4,
        10,
        "tip",
        1280,
    )
    assert options["labels"] == ["a", "b", "c", "d"]


def test_one_flight_is_a_film_of_the_size_of_its_suffix(
    log: skyarm.Log, filmed: list[Any], tmp_path: Path
) -> None:
    assert skyarm.film(log, str(tmp_path / "a.webp"), speed=2.0) == tmp_path / "a.webp"
    ((logs, settings, _),) = filmed
    assert len(logs) == 1
    assert (settings.width, settings.height, settings.fps, settings.speed) == (
        800,
        450,
        15,
        2.0,
    )


@pytest.mark.parametrize(
    ("flight", "file", "settings", "words"),
    [
        (
            3,
            "a.viser",
            {},
            "^scenario = 3: must be a Scenario, or the name or path of one$",
        ),
        ("absent.npz", "a.viser", {}, "^log = 'absent.npz': no such file$"),
        ("cas1", "a.viser", {}, "^scenario = 'cas1': did you mean 'case1'"),
        ("case1", "a.gif", {}, "suffix 'gif': must be one of mp4, webp, viser, html$"),
        ("case1", "a.viser", {"fps": 0}, "^fps = 0: must be"),
    ],
)
def test_what_cannot_be_filmed_is_one_line_and_nothing_is_written(
    flight: Any,
    file: str,
    settings: Any,
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    flown: list[Any] = []
    monkeypatch.setattr(
        film_flights, "run", lambda given: flown.append(given) or skyarm.run(given)
    )
    with pytest.raises(ValueError, match=words):
        skyarm.film(flight, tmp_path / file, **settings)
    assert "case1" not in flown
    assert list(tmp_path.iterdir()) == []
