"""Scenarios and logs that functions of Python take by name or path, as the command line
does.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.records.identity import identity
from skyarm.studies.stability import flight_margins, hover_delay


@pytest.fixture(scope="module")
def log() -> skyarm.Log:
    return skyarm.run(
        skyarm.load_scenario("case1", controller="paper_pd", duration=0.01)
    )


@pytest.fixture
def file(log: skyarm.Log, tmp_path: Path) -> Path:
    return log.save_npz(tmp_path / "flight.npz")


def test_a_scenario_flies_by_the_path_of_its_file(log: skyarm.Log, file: Path) -> None:
    for given in (file, str(file)):
        again = skyarm.run(given)
        assert np.array_equal(again.position, log.position)
        assert again.info["digest"] == log.info["digest"]


def test_margins_and_delays_are_of_a_scenario_by_its_name(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen: list[Any] = []
    monkeypatch.setattr(
        flight_margins, "evidence", lambda scenario, *_: seen.append(scenario)
    )
    monkeypatch.setattr(hover_delay, "frozen_hover", lambda scenario: None)
    skyarm.margins("case3")
    assert [identity(each) for each in seen] == [
        identity(flight_margins.without_adaptation(skyarm.load_scenario("case3")))
    ]
    assert skyarm.hover_delay("case3") == skyarm.hover_delay(
        skyarm.load_scenario("case3")
    )


@pytest.mark.parametrize("function", [skyarm.run, skyarm.margins, skyarm.hover_delay])
@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("cas3", r"^scenario = 'cas3': did you mean 'case3'\?"),
        ("absent.npz", r"^absent\.npz: no such file"),
        (3, r"^scenario = 3: must be a Scenario, or the name or path of one$"),
    ],
)
def test_what_is_no_scenario_is_one_line(function: Any, given: Any, words: str) -> None:
    with pytest.raises(skyarm.ScenarioError, match=words):
        function(given)


def test_a_log_is_scored_by_the_path_of_its_file(log: skyarm.Log, file: Path) -> None:
    metrics = ["position_error_max", "rotor_jitter"]
    assert (
        skyarm.score(file, metrics)
        == skyarm.score(str(file), metrics)
        == skyarm.score(log, metrics)
    )
    with pytest.raises(ValueError, match=r"^log = 'absent\.npz': no such file$"):
        skyarm.score("absent.npz")
