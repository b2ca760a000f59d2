"""A check of a scenario flies its push: a force that the loop does not hold is a fault
with its cause.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Force, Vec3
from skyarm.control.catalogue import preset
from skyarm.dynamics import forward_dynamics
from skyarm.dynamics.kinematics import frame_pose, jacobian_columns
from skyarm.scenario.numbers import with_numbers
from skyarm.studies.assess import pressing_flights as flights
from skyarm.studies.assess.finding import FAULT, NOTE, OK
from skyarm.studies.assess.pressing_flights import (
    base_recoil,
    contact_steps,
    pressing_flights,
    reach_left,
    tip_mass,
)
from skyarm.studies.assess.push_limits import largest_push
from support import worlds


def before_a_wall(name, joints, force, duration=5.0, **law):
    """A vehicle that presses with gains for small forces."""
    usual = {"interaction": [0.3 * min(force, 1.0), 0.1 * min(force, 1.0)]}
    return worlds.before_a_wall(name, joints, force, duration, **(usual | law))


def said_of(name, joints, force, **more):
    (found,) = pressing_flights(before_a_wall(name, joints, force, **more))
    return found


def test_an_arm_that_is_nearly_straight_holds_no_more_than_the_recoil_allows():
    found = said_of("voliro_like", (-0.5, -0.9), 13.0)
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
    found = said_of(
        "octo_coaxial_two_arms", (0.0, -0.8, 0.03, 0.0, 0.03), 5.8, duration=10.0
    )
    assert found.level == FAULT
    assert "of yaw torque; 4.35 N are held" in found.text


@pytest.mark.thorough
def test_a_geared_arm_that_is_stretched_bounces():
    found = said_of("hexarotor12_arm5", (0.0, -1.0, -0.4, -0.2, 0.0), 1.7)
    assert found.level == FAULT
    assert "the tip weighs 3.6 kg along the normal and bounces" in found.text


def test_a_tip_too_light_for_the_steps_of_contact_is_a_fault_that_the_remedy_mends():
    scenario = before_a_wall("crazyflie_arm1", (-0.6,), 0.023)
    (found,) = pressing_flights(scenario)
    assert (found.question, found.level) == ("steps of the contact", FAULT)
    softer = with_numbers(
        scenario,
        {"world.surfaces.wall.material.stiffness": float(found.remedy.split()[-2])},
    )
    assert [each.level for each in pressing_flights(softer)] == [OK]


def test_the_inertia_of_the_tip_is_that_of_a_push_on_it():
    """Against the articulated-body algorithm: acceleration of the tip under 1 N on
    it.
    """
    vehicle, joints = (
        skyarm.load_vehicle("hexarotor_arm6"),
        (
            0.3,
            -0.6,
            -0.97,
            0.2,
            -0.8,
            0.1,
        ),
    )
    n = Vec3(0.6, 0.0, -0.8)
    tip, columns = (
        frame_pose(vehicle, vehicle.frame(), joints).p,
        jacobian_columns(vehicle, vehicle.frame(), joints),
    )
    still = (0.0,) * vehicle.n
    efforts = [column.linear.dot(n) for column in columns]
    base, qdd = forward_dynamics(
        vehicle, joints, Vec3(0, 0, 0), still, Force(tip.cross(n), n), efforts
    )
    moved = base.linear + base.angular.cross(tip)
    for column, rate in zip(columns, qdd, strict=True):
        moved = moved + column.linear * rate
    assert tip_mass(vehicle, joints, np.array([*n])) == pytest.approx(
        1.0 / float(moved.dot(n)), rel=1e-9
    )


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
    (found,) = pressing_flights(
        dataclasses.replace(
            scenario, world=dataclasses.replace(scenario.world, surfaces=(away,))
        )
    )
    assert (found.level, found.text) == (
        NOTE,
        "not known: 0.8 N meet nothing, or for too short a time",
    )


def test_without_force_control_or_a_push_nothing_is_flown():
    scenario = before_a_wall("pelican_arm2", (-0.45, -0.9), 0.8)
    other = preset("centroidal_tip", scenario.controller.par.model, {})
    assert pressing_flights(dataclasses.replace(scenario, controller=other)) == []
    assert pressing_flights(skyarm.load_scenario("case3")) == []


def judged(monkeypatch, off, ended=(), limited=0.0):
    """Findings for flights whose errors are such shares of the force, eight noises
    each; ``ended``: (share, noise).
    """
    status = np.full((4, 8), "completed", dtype=object)
    for at in ended:
        status[at] = "diverged"
    mean = (
        1.2
        * np.array([0.25, 0.5, 0.75, 1.0])[:, None]
        * np.broadcast_to(np.array(off).reshape(4, -1), (4, 8))
    )
    monkeypatch.setattr(
        flights,
        "fly_shares",
        lambda scenario, force: (mean, status, np.full((4, 8), limited)),
    )
    (found,) = pressing_flights(before_a_wall("pelican_arm2", (-0.45, -0.9), 1.2))
    return found


def test_a_force_is_held_within_a_twentieth_in_all_flights_or_the_largest_is_named(
    monkeypatch,
):
    one_bad = np.full((4, 8), 0.02)
    one_bad[3, 0] = np.nan
    assert [
        judged(monkeypatch, [0.01, 0.01, 0.01, last]).level for last in (0.049, 0.051)
    ] == [OK, FAULT]
    # a flight that meets nothing holds nothing
    assert judged(monkeypatch, one_bad).level == FAULT
    early = judged(monkeypatch, [0.01] * 4, [(3, 5)])
    assert early.level == FAULT
    assert early.text.startswith(
        "1.2 N are 1 % off in flights with 8 noises, of which 1 end early"
    )
    assert early.text.endswith("0.9 N are held")
    assert judged(monkeypatch, [0.01, 0.2, 0.2, 0.2]).text.endswith("0.3 N are held")
    assert judged(monkeypatch, [0.2] * 4).text.endswith("nor is a quarter of it")


def test_rotors_at_their_limit_for_a_twentieth_of_the_time_hold_nothing_for_long(
    monkeypatch,
):
    assert judged(monkeypatch, [0.01] * 4, limited=0.049).level == OK
    assert judged(monkeypatch, [0.01] * 4, limited=0.051).level == FAULT
    found = judged(monkeypatch, [0.01] * 4, limited=0.15)
    assert found.level == FAULT
    assert "noises, with a rotor at its limit 15 % of the time: " in found.text


@pytest.mark.thorough
def test_a_force_that_strains_the_rotors_is_a_fault_where_no_short_flight_is_lost():
    pose = (0.0, -0.8, 0.03, 0.0, 0.03)
    found = [
        said_of("octo_coaxial_two_arms", pose, force, duration=10.0)
        for force in (4.5, 5.8)
    ]
    assert [each.level for each in found] == [OK, FAULT]
    assert "with a rotor at its limit" in found[1].text


def test_causes_are_named_by_yaw_then_reach_then_inertia(monkeypatch):
    """Yaw above half of what rotors have, recoil above half of what is left of the arm,
    5 m/s^2 of the tip.
    """
    scenario = before_a_wall("pelican_arm2", (-0.45, -0.9), 1.2)

    def cause(turning, left, mass):
        monkeypatch.setattr(flights, "yaw_room", lambda *told: 1.0)
        monkeypatch.setattr(flights, "yaw_torques", lambda *told: (turning, 0.0))
        monkeypatch.setattr(flights, "reach_left", lambda *told: left)
        monkeypatch.setattr(flights, "tip_mass", lambda *told: mass)
        return flights.cause_of(scenario, largest_push(scenario))[0].split()[:2]

    recoil = 0.5 * 0.15**2 * 1.2 / float(scenario.plant.vehicle.mass)
    assert base_recoil(scenario, 1.2) == pytest.approx(recoil)
    far, light = 1.0, 0.23
    assert cause(0.51, far, light) == ["the", "push"]
    assert cause(0.49, far, light) == ["no", "single"]
    assert cause(0.49, 1.98 * recoil, light) == ["the", "base"]
    assert cause(0.49, 2.02 * recoil, light) == ["no", "single"]
    assert cause(0.49, far, 0.25) == ["the", "tip"]


def test_steps_of_a_contact_are_stable_up_to_twice_the_inverse_frequency(monkeypatch):
    """The product of step and frequency goes with the root of the tip's inertia."""
    scenario = before_a_wall("crazyflie_arm1", (-0.6,), 0.023)
    at = largest_push(scenario)
    (fault,) = contact_steps(scenario, at)
    mass = tip_mass(scenario.plant.vehicle, (-0.6,), np.array([-1.0, 0.0, 0.0]))
    for phase, faults in ((1.99, 0), (2.01, 1)):
        monkeypatch.setattr(
            flights,
            "tip_mass",
            lambda *told, phase=phase: mass * (fault.value / phase) ** 2,
        )
        assert len(contact_steps(scenario, at)) == faults


def test_a_rotor_at_the_wall_is_the_cause_and_one_link_is_not_stretched() -> None:
    short = before_a_wall("crazyflie_arm1", (-0.6,), 0.023)
    at = largest_push(short)
    assert flights.reach_left(short.plant.vehicle, (-0.6,)) == math.inf
    assert "recoil" not in flights.cause_of(short, at)[0]
    cause, remedy = flights.cause_of(short, at, {"completed", "rotor_contact"})
    assert cause == "a rotor touches a surface"
    assert "ahead of the rotors" in remedy


def test_the_warning_of_a_flight_that_a_rotor_ended_says_so() -> None:
    scenario = before_a_wall("crazyflie_arm1", (-0.6,), 0.023, duration=1.5)
    flown = skyarm.run(scenario)
    log = dataclasses.replace(flown, info=flown.info | {"status": "rotor_contact"})
    (line,) = flights.lost_force(scenario, log)
    assert (
        "a rotor touches a surface; a pose with the tip further ahead of the rotors"
        in line
    )
