"""Margins are of a loop in which only the law remembers; what else does is named by its field."""

from __future__ import annotations

import dataclasses

import pytest

import added_components as own
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import JointDrive, NamedSensor, ScenarioError
from skyarm.stability.open_loop import Differentiator

CASE3 = load_scenario("case3")
JOINT = CASE3.world.vehicle.links[1].joint.name


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"air": (own.Turbulence(sigma=0.5),)}, r"environment.air\[0\] = Turbulence: "),
        ({"drives": (JointDrive(joint=JOINT, drive=own.Lag()),)}, f"plant.drives.{JOINT} = Lag: "),
        ({"instruments": (NamedSensor(name="gps", sensor=own.Fix()),)}, "sensors.gps = Fix: "),
        ({"estimator": own.Blend(), "instruments": ()}, "estimator = Blend: "),
    ],
)
def test_what_remembers_is_named_by_its_field(changes, told) -> None:
    with pytest.raises(
        ScenarioError, match=f"{told}must be left out of margins, whose loop has no memory but the law's"
    ):
        Differentiator(dataclasses.replace(CASE3, **changes))
