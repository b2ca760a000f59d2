"""A check of a scenario flies its push: a force that the loop does not hold is a fault with its cause."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
import standing_walls
from skyarm.algebra import Force, Vec3
from skyarm.control.catalogue import preset
from skyarm.dynamics import forward_dynamics
from skyarm.dynamics.kinematics import frame_pose, jacobian_columns
from skyarm.scenario.numbers import with_numbers
from skyarm.studies.assess.finding import FAULT, NOTE, OK
from skyarm.studies.assess.pressing_flights import pressing_flights, reach_left, tip_mass


def before_a_wall(name, joints, force, duration=5.0, **law):
    """A vehicle that presses with gains for small forces."""
    usual = {"interaction": [0.3 * min(force, 1.0), 0.1 * min(force, 1.0)]}
    return standing_walls.before_a_wall(name, joints, force, duration, **(usual | law))


def said_of(name, joints, force, **more):
    (found,) = pressing_flights(before_a_wall(name, joints, force, **more))
    return found


def test_an_arm_that_is_nearly_straight_holds_no_more_than_the_recoil_allows():
    found = said_of("voliro_like", (-0.5, -0.9), 9.2)
    assert (found.question, found.level) == ("force in flight", FAULT)
    assert "the arm is 38 mm from its full length" in found.text
    assert found.text.endswith(" N are held")
    assert found.joints == (-0.5, -0.9)


@pytest.mark.thorough
def test_the_same_force_with_a_bent_elbow_is_held():
    found = said_of("voliro_like", (-0.1, -1.4), 9.2)
    assert (found.level, found.remedy) == (OK, "")
    assert found.value < 0.5


@pytest.mark.thorough
def test_a_push_far_beside_the_middle_names_the_yaw_torque():
    found = said_of("octo_coaxial_two_arms", (0.0, -0.8, 0.03, 0.0, 0.03), 5.8, duration=10.0)
    assert found.level == FAULT
    assert "of yaw torque; 4.35 N are held" in found.text


@pytest.mark.thorough
def test_a_geared_arm_that_is_stretched_bounces():
    found = said_of("hexarotor12_arm5", (0.0, -1.0, -0.4, -0.2, 0.0), 1.7)
    assert found.level == FAULT
    assert "the tip weighs 3.6 kg along the normal and bounces" in found.text


def test_a_tip_too_light_for_the_steps_of_the_contact_is_a_fault_and_the_remedy_mends_it():
    scenario = before_a_wall("crazyflie_arm1", (-0.6,), 0.023)
    (found,) = pressing_flights(scenario)
    assert (found.question, found.level) == ("steps of the contact", FAULT)
    softer = with_numbers(scenario, {"world.surfaces.wall.material.stiffness": float(found.remedy.split()[-2])})
    assert [each.level for each in pressing_flights(softer)] == [OK]


def test_the_inertia_of_the_tip_is_that_of_a_push_on_it():
    """Against the articulated-body algorithm: acceleration of the tip under 1 N on it."""
    vehicle, joints = skyarm.load_vehicle("hexarotor_arm6"), (0.3, -0.6, -0.97, 0.2, -0.8, 0.1)
    n = Vec3(0.6, 0.0, -0.8)
    tip, columns = frame_pose(vehicle, vehicle.frame(), joints).p, jacobian_columns(vehicle, vehicle.frame(), joints)
    still = (0.0,) * vehicle.n
    efforts = [column.linear.dot(n) for column in columns]
    base, qdd = forward_dynamics(vehicle, joints, Vec3(0, 0, 0), still, Force(tip.cross(n), n), efforts)
    moved = base.linear + base.angular.cross(tip)
    for column, rate in zip(columns, qdd, strict=True):
        moved = moved + column.linear * rate
    assert tip_mass(vehicle, joints, np.array([*n])) == pytest.approx(1.0 / float(moved.dot(n)), rel=1e-9)


def test_the_reach_left_is_none_for_a_straight_arm():
    vehicle = skyarm.load_vehicle("pelican_arm2")
    assert reach_left(vehicle, (0.4, 0.0)) == pytest.approx(0.0, abs=1e-12)
    assert reach_left(vehicle, (0.4, -0.9)) == pytest.approx(
        0.23 - np.hypot(0.12 + 0.11 * np.cos(0.9), 0.11 * np.sin(0.9))
    )


def test_a_push_that_meets_nothing_is_said():
    scenario = before_a_wall("pelican_arm2", (-0.45, -0.9), 0.8)
    (wall,) = scenario.world.surfaces
    away = dataclasses.replace(wall, position=wall.position + Vec3(5.0, 0.0, 0.0))
    (found,) = pressing_flights(scenario.with_words(world=dataclasses.replace(scenario.world, surfaces=(away,))))
    assert (found.level, found.text) == (NOTE, "not known: 0.8 N meet nothing, or for too short a time")


def test_without_force_control_or_a_push_nothing_is_flown():
    scenario = before_a_wall("pelican_arm2", (-0.45, -0.9), 0.8)
    other = preset("centroidal_tip", scenario.controller.par.model, {})
    assert pressing_flights(dataclasses.replace(scenario, controller=other)) == []
    assert pressing_flights(skyarm.load_scenario("case3")) == []
