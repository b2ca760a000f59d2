"""What a fault does to the plants: force and torque by hand, falls and joints by
mechanics, both plants alike.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.algebra import ZERO3, Quaternion, Vec3
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.rotor import rotor_forces
from skyarm.plant.interface import Truth
from skyarm.plant.loads import applied_force
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.simulate import run
from skyarm.world import Effectiveness, Fault
from skyarm.world.aerodynamic_forces import GroundEffect, RotorDrag
from support.flights import fly
from support.one_vehicle import motion_of
from support.vehicles import steady_wind

ARM2 = skyarm.load_vehicle("hummingbird_arm2")

STATE = State(
    position=Vec3(0.0, 0.0, 1.0),
    quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
    velocity=Vec3(0.3, 0.1, -0.2),
    rate=Vec3(0.0, 0.0, 0.0),
    joints=(0.1, -0.2),
    joint_rates=(0.5, -1.0),
    rotor_speeds=(400.0, 500.0, 450.0, 520.0),
)


def loads(effectiveness=None):
    """Loads on the vehicle without hub drag."""
    sample = steady_wind(effectiveness=effectiveness)
    plain = tuple(
        dataclasses.replace(each, drag_coefficient=0, rolling_moment_coefficient=0)
        for each in ARM2.rotors
    )
    motion = motion_of(
        Truth(vehicle=dataclasses.replace(ARM2, rotors=plain)), STATE, sample
    )
    force, torques = applied_force(motion, Command(efforts=(0.2, -0.1)), sample)
    return np.array([*force.force]), np.array([*force.torque]), np.array(torques)


def test_a_rotor_loses_its_share_of_thrust_and_of_drag_torque():
    whole, less = loads(), loads(Effectiveness((1, 0.7, 1, 1), (1, 1)))
    rotor = ARM2.rotors[1]
    lost = 0.3 * rotor.thrust_coefficient * 500.0**2 * np.array([0.0, 0.0, 1.0])
    moment = (
        np.cross(np.array([float(c) for c in rotor.position]), lost)
        - rotor.direction * rotor.moment_coefficient * lost
    )
    # rounding of forces of a few newtons
    np.testing.assert_allclose(whole[0] - less[0], lost, atol=1e-14)
    np.testing.assert_allclose(whole[1] - less[1], moment, atol=1e-14)


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_a_fault_leaves_its_share_of_all_that_the_air_does_to_a_rotor(share):
    """Hub drag -c_d w v, rolling moment -c_r w v, inflow, translational lift, and
    ground effect.
    """
    rotor = dataclasses.replace(
        ARM2.rotors[0], drag_coefficient=2e-4, rolling_moment_coefficient=1e-6
    )
    left = rotor_forces((rotor,), (400.0,), Vec3(2.0, 0.0, 0.0), ZERO3, (share,))
    assert left.force.x == pytest.approx(-share * 2e-4 * 400.0 * 2.0, rel=1e-12)
    rolling = (
        left.torque.x
        - rotor.position.y * left.force.z
        + rotor.position.z * left.force.y
    )
    assert rolling == pytest.approx(-share * 1e-6 * 400.0 * 2.0, rel=1e-9)
    models = (RotorDrag(inflow=1e-4, lift=0.01), GroundEffect(radius=0.1))
    wind = steady_wind(effectiveness=Effectiveness((share, 1, 1, 1), (1, 1)))
    whole, less = (
        motion_of(Truth(vehicle=ARM2), STATE, each) for each in (steady_wind(), wind)
    )
    for model in models:
        pairs = (
            model.wrenches((), 0.0, motion, STATE.rotor_speeds)
            for motion in (whole, less)
        )
        for k, (before, after) in enumerate(zip(*pairs, strict=True)):
            expected = [(share if k == 0 else 1.0) * c for c in before.force_W]
            assert [*after.force_W] == pytest.approx(expected, rel=1e-12)
            assert any(before.force_W)


def test_a_drive_loses_its_share_of_the_limited_effort_and_keeps_its_friction():
    vehicle = ARM2.with_joints(damping=0.01, effort_limit=0.15)
    sample = steady_wind(effectiveness=Effectiveness((1, 1, 1, 1), (0.4, 1)))
    _, torques = applied_force(
        motion_of(Truth(vehicle=vehicle), STATE, sample),
        Command(efforts=(0.2, -0.1)),
        sample,
    )
    assert torques == pytest.approx(
        [0.4 * 0.15 - 0.01 * 0.5, -0.1 + 0.01 * 1.0], rel=1e-14
    )


def faulty(*faults, plant="rigid_body", duration=1.5, **fields):
    return dataclasses.replace(
        skyarm.load_scenario("case1", plant=plant, duration=duration),
        faults=faults,
        **fields,
    )


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_without_any_rotor_the_vehicle_falls_as_galileo_says(plant):
    dead = [Fault(rotor=r.name, effectiveness=0.0, start=1.0) for r in ARM2.rotors]
    log = run(faulty(*dead, plant=plant, duration=1.3, ground=False))
    before, after = np.searchsorted(log.time, 1.0), len(log.time) - 1
    fall = 9.8 * (log.time[after] - log.time[before])
    # hub drag at a few metres per second, below 1 % of the weight
    assert log.velocity[before, 2] - log.velocity[after, 2] == pytest.approx(
        fall, rel=0.01
    )


def test_both_plants_suffer_the_same_fault():
    faults = (
        Fault(rotor="left", effectiveness=0.7, start=0.5),
        Fault(joint="joint2", effectiveness=0.3, start=0.6),
    )
    ours, theirs = (
        run(faulty(*faults, plant=plant)) for plant in ("rigid_body", "mujoco")
    )
    assert ours.status == theirs.status == "completed"
    # MuJoCo holds forces for 1 ms; without faults the two differ as much
    np.testing.assert_allclose(ours.position, theirs.position, atol=1e-3)
    np.testing.assert_allclose(ours.joints, theirs.joints, atol=2e-3)
    unhurt = run(faulty())
    assert np.abs(ours.position - unhurt.position).max() > 0.02


def test_machine_code_has_the_bits_of_the_loop_in_python():
    scenario = faulty(
        Fault(rotor="left", effectiveness=0.7, start=0.1),
        Fault(joint="joint1", effectiveness=0.5, start=0.2),
        duration=0.4,
    )
    assert np.array_equal(fly(scenario).rows, fly(scenario, python=True).rows)
    np.testing.assert_array_equal(fly(scenario).rows[:, 1:4], run(scenario).position)


def test_a_fault_is_in_the_log():
    log = run(faulty(Fault(rotor="left", effectiveness=0.7, start=0.1), duration=0.05))
    (fault,) = log.info["scenario_record"]["agent"]["faults"]
    assert (fault["rotor"], fault["effectiveness"], fault["start"]) == (
        "left",
        0.7,
        0.1,
    )


def test_an_unknown_actuator_is_refused():
    with pytest.raises(
        ScenarioError,
        match=(
            r"environment.faults\[0\].rotor = 'top': must be one of front, left, back"
        ),
    ):
        run(faulty(Fault(rotor="top", effectiveness=0.7, start=0.1)))
    with pytest.raises(
        ScenarioError,
        match=r"environment.faults\[0\].joint = 'front': must be one of joint1, joint2",
    ):
        run(faulty(Fault(joint="front", effectiveness=0.7, start=0.1)))
