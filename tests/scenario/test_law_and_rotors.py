"""Laws that do not fit the rotors and joints of a vehicle."""

import dataclasses

import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.control.catalogue import make_controller
from skyarm.control.laws.centroidal.make import make_centroidal
from skyarm.control.model import Model
from skyarm.scenario.controller_table import on_actuators
from skyarm.scenario.scenario_checks import check_scenario

BIRD = skyarm.load_vehicle("hummingbird")
PUSHER = dataclasses.replace(
    BIRD.rotors[0],
    name="pusher",
    position=Vec3(-0.2, 0.0, 0.0),
    axis=Vec3(1.0, 0.0, 0.0),
)
PUSHED = dataclasses.replace(BIRD, name="pushed", rotors=(*BIRD.rotors, PUSHER))


def test_rotors_that_allow_no_priorities_are_cut_alike():
    assert make_centroidal(Model(vehicle=PUSHED)).par.mixer.policy == "clip"
    assert make_centroidal(Model(vehicle=BIRD)).par.mixer.policy == "thrust_before_yaw"


@pytest.mark.parametrize(
    ("field", "values"), [("stiffness", (1.0,)), ("damping", (1.0, 1.0, 1.0))]
)
def test_gains_for_fewer_or_more_joints_than_there_are_are_refused(field, values):
    planned = skyarm.load_scenario("case1")
    par = planned.controller.par
    gains = dataclasses.replace(par.joint_gains, **{field: values})
    law = dataclasses.replace(
        planned.controller, par=dataclasses.replace(par, joint_gains=gains)
    )
    words = rf"controller\.joint_gains\.{field}: {len(values)} values, must be 2"
    with pytest.raises(skyarm.ScenarioError, match=words):
        check_scenario(dataclasses.replace(planned, controller=law))


def test_a_law_of_torques_gets_servos_once_and_none_where_there_are_none():
    model = Model(vehicle=skyarm.load_vehicle("hexarotor12_arm5"))
    torques = make_controller("decoupled_pd", model)
    law = on_actuators(torques, model, 0.005, servos=True)
    assert len(law.memory.drives) == 5
    assert on_actuators(law, model, 0.005, servos=True) is law
    bare = Model(vehicle=BIRD)
    free = make_controller("decoupled_pd", bare)
    assert on_actuators(free, bare, 0.005, servos=False) is free
