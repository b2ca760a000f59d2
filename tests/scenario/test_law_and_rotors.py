"""Rotors that allow no priorities."""

import dataclasses

import skyarm
from skyarm.algebra import Vec3
from skyarm.control.laws.centroidal.make import make_centroidal
from skyarm.control.model import Model

BIRD = skyarm.load_vehicle("hummingbird")
PUSHER = dataclasses.replace(BIRD.rotors[0], name="pusher", position=Vec3(-0.2, 0.0, 0.0), axis=Vec3(1.0, 0.0, 0.0))
PUSHED = dataclasses.replace(BIRD, name="pushed", rotors=(*BIRD.rotors, PUSHER))


def test_rotors_that_allow_no_priorities_are_cut_alike():
    assert make_centroidal(Model(vehicle=PUSHED)).par.mixer.policy == "clip"
    assert make_centroidal(Model(vehicle=BIRD)).par.mixer.policy == "thrust_before_yaw"
