"""Margins are of a loop in which only the law and joint drives remember: disturbances
are left out and named.
"""

from __future__ import annotations

import dataclasses

import pytest

import skyarm
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import NamedSensor, ScenarioError
from skyarm.studies.stability.frozen_scenario import disturbances, nominal
from skyarm.studies.stability.hover_delay import hover_delay
from skyarm.studies.stability.open_loop import Differentiator
from skyarm.world import Wrench
from support import components as own

CASE3 = load_scenario("case3", controller="paper_ct", duration=0.2)
GUSTY = dataclasses.replace(
    CASE3,
    air=(own.Shear(), own.Turbulence(sigma=0.5)),
    forces=(own.RandomPush(), own.Tether(anchor=skyarm.Vec3(0.0, 0.0, 0.0))),
)


def test_a_loop_is_that_of_the_scenario_without_weather_that_has_a_memory() -> None:
    calm = dataclasses.replace(GUSTY, air=GUSTY.air[:1], forces=GUSTY.forces[1:])
    assert nominal(GUSTY) == nominal(calm)
    assert disturbances(GUSTY) == (
        "environment.air[1] = Turbulence",
        "environment.forces[0] = RandomPush",
    )
    assert disturbances(calm) == ()


@pytest.mark.thorough
def test_weather_with_a_memory_is_left_out_and_named() -> None:
    """The margins along the flight are those of the same scenario without it; hover is
    in calm air.
    """
    calm = dataclasses.replace(GUSTY, air=GUSTY.air[:1], forces=GUSTY.forces[1:])
    found, wanted = skyarm.margins(GUSTY, 1), skyarm.margins(calm, 1)
    assert found.left_out == (
        "environment.air[1] = Turbulence",
        "environment.forces[0] = RandomPush",
    )
    assert wanted.left_out == ()
    assert [each.radius for each in found.instants] == [
        each.radius for each in wanted.instants
    ]
    assert [each.swings for each in found.instants] == [
        each.swings for each in wanted.instants
    ]
    assert (
        hover_delay(GUSTY).margin
        == hover_delay(dataclasses.replace(calm, air=())).margin
        > 0.0
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Swing(own.RandomPush):
    """Its memory moves with the plant."""

    coupled = True


@dataclasses.dataclass(frozen=True, kw_only=True)
class LaggedDrag(own.RandomPush):
    """Its memory follows the vehicle's velocity from one control period to the next."""

    gain: float = 0.0
    uniforms = 0

    def advance(self, memory, t, dt, state, draws):
        return (memory[0] + dt / 0.1 * (state.velocity.x - memory[0]),)

    def wrenches(self, memory, t, motion, rotor_speeds):
        return (Wrench(force_W=skyarm.Vec3(self.gain * memory[0], 0.0, 0.0)),)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (
            {"forces": (LaggedDrag(gain=30.0),)},
            r"environment.forces\[0\] = LaggedDrag: ",
        ),
        ({"forces": (own.RandomPush(), Swing())}, r"environment.forces\[1\] = Swing: "),
        (
            {"sensors": (NamedSensor(name="gps", sensor=own.Fix()),)},
            "sensors.gps = Fix: ",
        ),
        ({"estimator": own.Blend(), "sensors": ()}, "estimator = Blend: "),
    ],
)
def test_what_remembers_is_named_by_its_field(changes, told) -> None:
    with pytest.raises(
        ScenarioError,
        match=(
            f"{told}must be left out of margins, whose loop has no memory but the law's"
            " and drives'"
        ),
    ):
        Differentiator(dataclasses.replace(CASE3, **changes))
