"""Margins are of a loop in which only the law and joint drives remember; what else does is named by its field."""

from __future__ import annotations

import dataclasses

import pytest

import added_components as own
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import NamedSensor, ScenarioError
from skyarm.stability.open_loop import Differentiator

CASE3 = load_scenario("case3")


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"air": (own.Turbulence(sigma=0.5),)}, r"environment.air\[0\] = Turbulence: "),
        ({"instruments": (NamedSensor(name="gps", sensor=own.Fix()),)}, "sensors.gps = Fix: "),
        ({"estimator": own.Blend(), "instruments": ()}, "estimator = Blend: "),
    ],
)
def test_what_remembers_is_named_by_its_field(changes, told) -> None:
    with pytest.raises(
        ScenarioError, match=f"{told}must be left out of margins, whose loop has no memory but the law's and drives'"
    ):
        Differentiator(dataclasses.replace(CASE3, **changes))
