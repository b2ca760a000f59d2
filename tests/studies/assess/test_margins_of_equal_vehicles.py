"""The delay margin of hover is computed once for vehicles that are alike, wherever they
hover.
"""

from __future__ import annotations

import dataclasses

import pytest

import skyarm
from skyarm.reference.signals import Constant
from skyarm.scenario.scenario_record import with_words
from skyarm.studies.assess import assessment
from skyarm.studies.stability.hover_delay import hover_delay, hover_digest
from skyarm.world.disturbance_signals import Disturbance

CASE = skyarm.load_scenario("case3")
GROUP = """schema = 1
name = "group"
duration = 1.0
[plant]
vehicle = "dragonfly"
[controller]
preset = "centroidal_joint"
[agents.a.reference]
base = { kind = "hover", position = [0.0, 0.0, 1.0] }
[agents.b.reference]
base = { kind = "hover", position = [0.0, 3.0, 1.7] }
tracking_start = 0.3
[agents.c]
controller = { law = "centroidal", bandwidth = 0.5 }
[agents.c.reference]
base = { kind = "hover", position = [3.0, 0.0, 1.0] }
"""


def moved(scenario: skyarm.Scenario) -> skyarm.Scenario:
    there = dataclasses.replace(
        scenario.agent.reference, x=Constant(7.0), y=Constant(-3.0), z=Constant(60.0)
    )
    return with_words(scenario, reference=there)


def settles_later(scenario: skyarm.Scenario) -> skyarm.Scenario:
    """Scenario that differs from another by what a hover in calm air does not see."""
    noise = dataclasses.replace(scenario.agent.noise, position=0.01)
    return with_words(
        scenario, tracking_start=2.0, noise=noise, ground=not scenario.ground
    )


def of_the_users(*inputs):
    """A law that may read the place."""
    return CASE.agent.controller.law(*inputs)


def test_equal_vehicles_share_a_margin_and_others_have_their_own(
    tmp_path, monkeypatch
) -> None:
    (tmp_path / "group.toml").write_text(GROUP)
    asked = []
    monkeypatch.setattr(assessment, "delay_margin", lambda one: asked.append(one) or [])
    vehicles = []
    judged = assessment.assess_vehicle
    monkeypatch.setattr(
        assessment,
        "assess_vehicle",
        lambda *a, **k: vehicles.append(a) or judged(*a, **k),
    )
    found = skyarm.check(skyarm.load_scenario(tmp_path / "group.toml"), poses=8)
    assert [next(iter(one.agents)) for one in asked] == ["a", "c"]
    assert len(vehicles) == 1
    assert [each.name for each in found.agents.values()] == ["a", "b", "c"]


def test_a_margin_does_not_depend_on_the_place_and_its_digest_on_all_else() -> None:
    here, there = CASE, moved(settles_later(CASE))
    assert hover_digest(here) == hover_digest(there)
    assert hover_delay(there).margin == pytest.approx(
        hover_delay(here).margin, rel=1e-6
    )
    others = [
        with_words(here, delays=dataclasses.replace(here.agent.delays, command=0.01)),
        skyarm.load_scenario("case3", controller="paper_pd"),
        skyarm.with_numbers(here, {"plant.vehicle.base.mass": 0.8}),
        skyarm.with_numbers(here, {"model.vehicle.base.mass": 0.8}),
    ]
    assert len({hover_digest(each) for each in (here, *others)}) == 5
    pushed = [with_words(each, forces=(Disturbance(),)) for each in (here, there)]
    assert hover_digest(pushed[0]) != hover_digest(pushed[1]), (
        "a force may depend on the place"
    )
    law = dataclasses.replace(here.agent.controller, law=of_the_users)
    own = [each.with_controller(law) for each in (here, there)]
    assert hover_digest(own[0]) != hover_digest(own[1]), (
        "a law of the user's may depend on the place"
    )
