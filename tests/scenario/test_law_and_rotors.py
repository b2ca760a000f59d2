"""Rotors that allow no priorities: told of where a preset flies them, refused where their use was asked for."""

import dataclasses

import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.control.actuator_layer import with_actuators
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal.make import make_centroidal
from skyarm.control.model import Model
from skyarm.control.safety import with_safety_layer
from skyarm.dynamics.actuators.servo import PositionServo
from skyarm.plant.interface import Truth
from skyarm.reference import hover
from skyarm.scenario.scenario_record import Scenario
from skyarm.scenario.unlikely_numbers import law_without_priorities, unlikely_numbers
from skyarm.vehicle.vehicle_records import MountedDrive

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
    world = dataclasses.replace(scenario.plant, vehicle=PUSHED)
    initial = dataclasses.replace(scenario.initial, rotor_speeds=(400.0,) * 5) if scenario.initial else None
    (line,) = [
        each
        for each in unlikely_numbers(dataclasses.replace(scenario, plant=world, controller=law, initial=initial))
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


VOLIRO = skyarm.load_vehicle("voliro_like")
SERVO = PositionServo(stiffness=9.0, damping=0.2, inertia=0.01)
LIMITS = {"stiffness": 8.0, "damping": 4.0}
DRIVES = tuple(MountedDrive(name=link.joint.name, drive=SERVO) for link in VOLIRO.links)


def lines(law):
    """What is said of a law's rotors, in hover."""
    trajectory = hover((0.0, 0.0, 2.0), joints=(0.0,) * law.par.model.vehicle.n)
    world = Truth(vehicle=law.par.model.vehicle)
    return list(
        law_without_priorities(Scenario(name="hover", duration=0.1, plant=world, controller=law, reference=trajectory))
    )


@pytest.mark.parametrize("sideways", [0.0, 0.9])
def test_layers_around_a_law_do_not_hide_its_mixer(sideways):
    law = make_centroidal(Model(vehicle=VOLIRO), sideways=sideways)
    carrying = Model(vehicle=dataclasses.replace(VOLIRO, drives=DRIVES))
    guarded = with_safety_layer(law, LIMITS)
    for made in (law, guarded, with_actuators(law, carrying, 0.005), with_actuators(guarded, carrying, 0.005)):
        assert lines(made) == []


def test_a_preset_without_priorities_says_so_under_a_safety_layer_too():
    (line,) = lines(with_safety_layer(make_centroidal(Model(vehicle=PUSHED)), LIMITS))
    assert "rotors[pusher]" in line
    assert line.endswith("where all rotors lift")
