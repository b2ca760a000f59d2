"""Rotors that allow no priorities: told of where a preset flies them, refused where their use was asked for."""

import dataclasses

import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal.make import make_centroidal
from skyarm.control.model import Model
from skyarm.scenario.unlikely_numbers import unlikely_numbers

BIRD = skyarm.load_vehicle("hummingbird")
PUSHER = dataclasses.replace(BIRD.rotors[0], name="pusher", position=Vec3(-0.2, 0.0, 0.0), axis=Vec3(1.0, 0.0, 0.0))
PUSHED = dataclasses.replace(BIRD, name="pushed", rotors=(*BIRD.rotors, PUSHER))
HOVER = {
    "name": "hover",
    "duration": 0.1,
    "plant": {"vehicle": "hummingbird"},
    "controller": {"law": "centroidal"},
    "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 2.0]}},
}


@pytest.mark.parametrize("preset", ["robust", "adaptive"])
def test_a_preset_flies_rotors_without_priorities_and_says_so(preset):
    scenario = skyarm.scenario_from(HOVER)
    law = make_centroidal(Model(vehicle=PUSHED), preset=preset)
    assert law.par.mixer.policy == "clip"
    world = dataclasses.replace(scenario.world, vehicle=PUSHED)
    initial = dataclasses.replace(scenario.initial, rotor_speeds=(400.0,) * 5) if scenario.initial else None
    (line,) = [
        each
        for each in unlikely_numbers(dataclasses.replace(scenario, world=world, controller=law, initial=initial))
        if each.startswith("controller")
    ]
    assert "has no yaw_slack" in line
    assert "rotors[pusher]" in line
    assert not [each for each in unlikely_numbers(scenario) if each.startswith("controller")]


def test_a_slack_that_was_asked_for_is_refused_there():
    with pytest.raises(ControllerError, match=r"controller\.yaw_slack = 5\.0: must be 0 here: .*rotors\[pusher\]"):
        make_centroidal(Model(vehicle=PUSHED), yaw_slack=5.0)
    assert make_centroidal(Model(vehicle=PUSHED), preset="adaptive", yaw_slack=0.0).par.mixer.policy == "clip"
    assert make_centroidal(Model(vehicle=BIRD), yaw_slack=5.0).par.mixer.policy == "thrust_before_yaw"
