"""The first turbulence of a flight is drawn for its own control period, in machine code
as in the tables of Python.
"""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.scenario.scenario_file import scenario_from
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.loop import run, run_in_python
from skyarm.world import dryden
from support.flights import document

WIND = {
    "mode": "moving_air",
    "velocity": [4.0, 1.0, 0.0],
    "turbulence": {"altitude": 6.0, "wind_20ft": 7.7},
}


@pytest.mark.parametrize("seed", [0, 5])
def test_both_ways_of_flying_meet_the_same_air_from_the_first_period_on(seed):
    scenario = scenario_from(
        document("case2", duration=0.2, seed=seed, environment__wind=WIND), "test"
    )
    fast, slow = run(scenario), run_in_python(scenario)
    assert np.abs(fast.air_velocity - [4.0, 1.0, 0.0]).max() > 0.1
    np.testing.assert_allclose(
        fast.air_velocity, slow.air_velocity, rtol=0.0, atol=1e-12
    )


def test_a_first_turbulence_belongs_to_the_period_of_its_flight(monkeypatch):
    scenario = scenario_from(
        document("case2", duration=0.2, environment__wind=WIND), "test"
    )
    periods = []
    monkeypatch.setattr(
        dryden, "start", lambda first, second, dt, *, par: periods.append(dt)
    )
    first_loop_state(scenario)
    assert periods == [1.0 / scenario.rates.control]
