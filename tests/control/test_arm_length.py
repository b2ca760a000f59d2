"""The damping of the tip's task goes with the arm of the vehicle, in the preset adaptive alone."""

import dataclasses

import pytest

import skyarm
from skyarm.control.laws.centroidal.make import make_centroidal
from skyarm.control.laws.centroidal.presets import arm_length
from skyarm.control.model import Model
from skyarm.dynamics.workspace import reach


def damping(vehicle, **options):
    return make_centroidal(Model(vehicle=vehicle), mode="tip", **options).par.tip.damping


@pytest.mark.parametrize("name", ["crazyflie_arm1", "pelican_arm2", "hexarotor_arm6"])
def test_the_length_of_an_arm_that_is_straight_at_zero_is_how_far_it_reaches(name):
    """Of arms whose first joint sits at the base's origin, against a search over all postures."""
    assert arm_length(skyarm.load_vehicle(name)) == pytest.approx(reach(skyarm.load_vehicle(name)), rel=1e-6)


def test_where_the_first_joint_sits_does_not_count_and_an_arm_of_no_length_is_flown():
    vehicle = skyarm.load_vehicle("crazyflie_arm1")
    (link,), (tip,) = vehicle.links, [each for each in vehicle.frames if each.name == vehicle.end_effector]
    moved = dataclasses.replace(link, joint=dataclasses.replace(link.joint, position=(0.5, 0.0, 0.0)))
    assert arm_length(dataclasses.replace(vehicle, links=(moved,))) == arm_length(vehicle)
    none = dataclasses.replace(vehicle, frames=(dataclasses.replace(tip, position=(0.0, 0.0, 0.0)),))
    assert (arm_length(none), damping(none, preset="adaptive") > 0.0) == (0.0, True)


def test_only_adaptive_asks_for_the_arm_and_a_number_that_is_given_is_kept():
    paper, small = skyarm.load_vehicle("hummingbird_arm2"), skyarm.load_vehicle("crazyflie_arm1")
    assert damping(paper, preset="adaptive") == damping(paper, preset="robust") == 0.03
    assert damping(small, preset="adaptive") == pytest.approx(0.03 * (0.06 / 0.3) ** 0.5)
    assert damping(small, preset="robust") == 0.03
    assert damping(small, preset="adaptive", damping=0.02) == 0.02
