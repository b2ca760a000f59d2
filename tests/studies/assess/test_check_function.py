"""Feasibility checks from Python: of records, names and paths, with the findings of the
command.
"""

from __future__ import annotations

from typing import Any

import pytest

import skyarm
from skyarm.records.identity import identity
from skyarm.studies.assess import assessment
from skyarm.studies.assess.along_reference import met_at_start
from skyarm.studies.assess.finding import FAULT

NAME = "hummingbird_arm2_rotors"


def test_records_and_names_get_the_findings_of_the_command(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen: list[Any] = []
    for name in ("assess_vehicle", "assess_scenario"):
        monkeypatch.setattr(
            assessment,
            name,
            lambda record, name=name, **options: seen.append(
                (name, identity(record), options)
            ),
        )
    vehicle, scenario = skyarm.load_vehicle(NAME), skyarm.load_scenario("case1")
    for given in (vehicle, NAME, scenario, "case1"):
        skyarm.check(given, payload=0.02, poses=16)
    skyarm.check(vehicle, gravity=3.7, poses=16)
    options = {"payload": 0.02, "poses": 16}
    named = [
        (
            "assess_vehicle",
            identity(vehicle),
            {"gravity": 9.81, "file": file, **options},
        )
        for file in ("", NAME)
    ]
    assert seen == [
        *named,
        *[("assess_scenario", identity(scenario), options)] * 2,
        (
            "assess_vehicle",
            identity(vehicle),
            {"gravity": 3.7, "payload": 0.0, "poses": 16, "file": ""},
        ),
    ]


@pytest.mark.parametrize(
    ("given", "options", "words"),
    [
        (3, {}, "^vehicle = 3: must be a name or a path$"),
        ("humingbird", {}, r"^vehicle = 'humingbird': did you mean 'hummingbird'\?"),
        (
            "case1",
            {"gravity": 3.7},
            "^--gravity = 3.7: must be left out: the scenario states its own",
        ),
    ],
)
def test_what_cannot_be_checked_is_one_line(
    given: Any, options: Any, words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        skyarm.check(given, **options)


LOW = {
    "name": "low",
    "duration": 2.0,
    "plant": {"vehicle": NAME},
    "controller": {"preset": "centroidal_tip"},
}
"""A hover at the origin, where a flight ends at once: the links hang down by 0.3 m."""


@pytest.mark.parametrize(
    ("more", "found"),
    [
        ({}, {"reference": "ending 'ground' holds at 0 s: lowest point at z = -0.3 m"}),
        (
            {"initial": {"position": [0.0, 0.0, 0.1]}},
            {"initial": "ending 'ground' holds at 0 s: lowest point at z = -0.2 m"},
        ),
        ({"initial": {"position": [0.0, 0.0, 0.4]}}, {}),
        ({"environment": {"ground": False}}, {}),
    ],
)
def test_a_start_at_which_a_flight_ends_is_found(more: Any, found: Any) -> None:
    findings = met_at_start(skyarm.scenario_from(LOW | more))
    assert {each.field: each.text for each in findings} == found


def test_a_scenario_that_ends_at_its_start_does_not_pass() -> None:
    (found,) = skyarm.check(skyarm.scenario_from(LOW), poses=8).alarms()
    assert (found.question, found.level) == ("start of the flight", FAULT)
