"""Rotors that allow no priorities: told of where a preset flies them, refused where their use was asked for."""

import dataclasses

import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal.make import make_centroidal
from skyarm.control.model import Model

BIRD = skyarm.load_vehicle("hummingbird")
PUSHER = dataclasses.replace(BIRD.rotors[0], name="pusher", position=Vec3(-0.2, 0.0, 0.0), axis=Vec3(1.0, 0.0, 0.0))
PUSHED = dataclasses.replace(BIRD, name="pushed", rotors=(*BIRD.rotors, PUSHER))


def test_a_slack_that_was_asked_for_is_refused_there():
    with pytest.raises(ControllerError, match=r"controller\.yaw_slack = 5\.0: must be 0 here: .*rotors\[pusher\]"):
        make_centroidal(Model(vehicle=PUSHED), yaw_slack=5.0)
    assert make_centroidal(Model(vehicle=PUSHED), preset="adaptive", yaw_slack=0.0).par.mixer.policy == "clip"
    assert make_centroidal(Model(vehicle=BIRD), yaw_slack=5.0).par.mixer.policy == "thrust_before_yaw"
