"""Tuning from Python: what is flown for a record, a name and a vehicle, and the
controller of the result.
"""

from __future__ import annotations

from typing import Any

import pytest

import skyarm
from skyarm.records.identity import identity
from skyarm.studies.tune import tuning
from skyarm.studies.tune.law_knobs import numbers_at, with_constants
from skyarm.studies.tune.tuning import TuningPlan


@pytest.fixture
def planned(monkeypatch: pytest.MonkeyPatch) -> list[TuningPlan]:
    """Plans that would have been searched."""
    seen: list[TuningPlan] = []
    monkeypatch.setattr(tuning, "tune_plan", lambda plan, **_: seen.append(plan))
    return seen


def test_a_record_is_tuned_as_its_name_and_a_vehicle_without_a_motion_of_its_own(
    planned: list[TuningPlan],
) -> None:
    record, vehicle = (
        skyarm.load_scenario("case3"),
        skyarm.load_vehicle("hummingbird_arm2_rotors"),
    )
    for what in (record, "case3", vehicle):
        skyarm.tune(
            what, "paper_ct", candidates=132, plants=8, knobs=["gains.position"], seed=5
        )
    one, other, still = planned
    assert [identity(one.check), identity(one.own)] == [
        identity(other.check),
        identity(other.own),
    ]
    assert (still.own, still.check) == (None, still.flight)
    assert one.check != one.flight
    assert {(p.effort.plants, p.seed, p.label, len(p.knobs)) for p in planned} == {
        (8, 5, "paper_ct", 1)
    }


@pytest.mark.parametrize(
    ("what", "options", "words"),
    [
        ("case3", {"candidates": 3}, "^candidates = 3: must be from 132 to 100000$"),
        ("case3", {"plants": 1}, "^plants = 1: must be from 4 to 1000$"),
        ("case3", {"knobs": ["nothing"]}, "nothing"),
        (3, {}, "^vehicle = 3: must be a name or a path"),
    ],
)
def test_what_cannot_be_tuned_is_one_line(what: Any, options: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        skyarm.tune(what, **options)


@pytest.mark.thorough
def test_the_controller_of_a_result_flies_its_scenario() -> None:
    scenario = skyarm.load_scenario("case1", controller="paper_pd")
    found = skyarm.tune(scenario, candidates=132, plants=4, knobs=["gains.position"])
    assert len(repr(found)) <= 300
    plan, logs = found.plan, found.pick.logs
    picked = with_constants(plan.flight, numbers_at(plan.knobs, logs))
    assert found.controller == picked.controller
    assert skyarm.run(scenario.under(found.controller)).status == "completed"
