"""Words of a scenario that stand for a field of one of its groups."""

from __future__ import annotations

import skyarm
from skyarm.records.words import groups


def test_a_word_is_the_field_of_its_group() -> None:
    scenario = skyarm.load_scenario("case2_gust")
    assert scenario.wind is scenario.environment.wind
    assert scenario.plant is scenario.agent.plant


def test_the_class_has_its_words_too() -> None:
    assert {"environment", "agent", "solver"} == set(groups(skyarm.Scenario))
    for name in ("wind", "plant", "kind"):
        assert hasattr(skyarm.Scenario, name)
