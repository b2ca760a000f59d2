"""A flight in plain Python tells its progress about a hundred times, however short it
is.
"""

from __future__ import annotations

import pytest

from skyarm.scenario.scenario_file import load_scenario
from skyarm.simulate.loop import run_in_python


@pytest.mark.parametrize(("seconds", "calls"), [(0.05, 11), (0.5, 101), (1.5, 101)])
def test_steps_told_are_even_and_no_more_than_a_hundred_and_one(seconds, calls):
    reports: list[tuple[int, int]] = []
    scenario = load_scenario("case1", duration=seconds)
    run_in_python(scenario, lambda done, total: reports.append((done, total)))
    steps = scenario.steps
    assert len(reports) == calls
    assert reports == [(k * steps // (calls - 1), steps) for k in range(calls)]
