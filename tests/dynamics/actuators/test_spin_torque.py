"""Rotors that turn faster or slower push the base: sign, conservation of angular
momentum, and both plants.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skyarm.algebra import ZERO3, Sym3, Vec3
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.rotor import spin_torque
from skyarm.plant.compiled import RigidBodyPlant, Steps, example_state
from skyarm.plant.interface import Truth, flat
from skyarm.plant.mujoco import MujocoPlant
from skyarm.plant.surroundings import Surroundings
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import first_state
from skyarm.simulate.plant_steps import RigidBodySteps
from skyarm.simulate.stages import Stages
from skyarm.vehicle.linkage import Body
from skyarm.vehicle.vehicle_records import Rotor, Vehicle
from support.one_vehicle import together

INERTIA = Sym3(0.02, 0.03, 0.04, 0.001, 0.0, 0.002)
SPIN = 3e-4
UP = Vec3(0, 0, 1)
TILTED = Vec3(0.6, 0.0, 0.8)


def rotor(direction: int, axis: Vec3 = UP) -> Rotor:
    """One that gives next to no thrust: what its spin does is alone."""
    return Rotor(
        name=f"r{direction}",
        position=Vec3(0.1, 0.2, 0.0),
        axis=axis,
        direction=direction,
        thrust_coefficient=1e-18,
        moment_coefficient=0.0,
        time_constant_up=0.05,
        time_constant_down=0.08,
        inertia=SPIN,
    )


def test_a_rotor_that_speeds_up_turns_the_base_against_its_spin():
    torque = spin_torque((rotor(1),), (300.0,), (400.0,), ZERO3)
    assert torque.z == pytest.approx(-SPIN * 100.0 / 0.05)
    assert spin_torque((rotor(-1),), (300.0,), (400.0,), ZERO3).z == pytest.approx(
        SPIN * 100.0 / 0.05
    )
    assert spin_torque((rotor(1),), (300.0,), (200.0,), ZERO3).z == pytest.approx(
        SPIN * 100.0 / 0.08
    )
    limited = dataclasses.replace(rotor(1), max_speed=350.0)
    assert spin_torque((limited,), (300.0,), (400.0,), ZERO3).z == pytest.approx(
        -SPIN * 50.0 / 0.05
    )


def test_turning_the_spin_takes_a_torque_that_does_no_work():
    rate = Vec3(0.5, -1.0, 2.0)
    torque = spin_torque((rotor(1, TILTED),), (500.0,), (), rate)
    expected = -np.cross([0.5, -1.0, 2.0], SPIN * 500.0 * np.array([0.6, 0.0, 0.8]))
    np.testing.assert_allclose([*torque], expected, rtol=1e-12)
    assert torque.dot(rate) == pytest.approx(0.0, abs=1e-15)


def test_without_inertia_it_is_structure():
    assert tuple(
        spin_torque(
            (dataclasses.replace(rotor(1), inertia=0),), (300.0,), (400.0,), ZERO3
        )
    ) == (0, 0, 0)
    assert all(
        type(c) is int
        for c in spin_torque(
            (dataclasses.replace(rotor(1), inertia=0),), (3.0,), (), ZERO3
        )
    )


def tumbling() -> tuple[Vehicle, State, Command]:
    vehicle = Vehicle(
        name="gyrostat",
        base=Body(mass=2.0, inertia=INERTIA),
        rotors=(rotor(1, TILTED), rotor(-1)),
    )
    state = dataclasses.replace(
        example_state(0, 2),
        rate=Vec3(0.5, -1.0, 2.0),
        rotor_speeds=(200.0, 700.0),
        position=Vec3(0.0, 0.0, 5.0),
    )
    return vehicle, state, Command(rotor_speeds=(900.0, 100.0))


def momentum(vehicle: Vehicle, x: tuple[float, ...]) -> np.ndarray:
    """Angular momentum of base and rotors in world axes, from its definition."""
    w, x_, y, z = x[3:7]
    R = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x_ * y - w * z), 2 * (x_ * z + w * y)],
            [2 * (x_ * y + w * z), 1 - 2 * (x_ * x_ + z * z), 2 * (y * z - w * x_)],
            [2 * (x_ * z - w * y), 2 * (y * z + w * x_), 1 - 2 * (x_ * x_ + y * y)],
        ]
    )
    total = (
        np.array([[0.02, 0.001, 0.0], [0.001, 0.03, 0.002], [0.0, 0.002, 0.04]])
        @ x[10:13]
    )
    for each, speed in zip(vehicle.rotors, x[13:], strict=True):
        total = total + SPIN * each.direction * speed * np.array(
            [*each.axis], dtype=float
        )
    return R @ total


@pytest.mark.parametrize("kind", [RigidBodyPlant, MujocoPlant])
def test_base_and_rotors_keep_their_angular_momentum(kind):
    """Also while one rotor runs up and the other down, and the base tumbles."""
    vehicle, state, command = tumbling()
    plant = kind(
        Truth(vehicle=vehicle, gravity=9.81), Surroundings(), "rk4_staged", 0.001
    )
    x = flat(state)
    first, inputs = momentum(vehicle, x), (*command.rotor_speeds,)
    for _ in range(300):
        x = plant.advance(x, inputs, (0.0,), 0.001)
    assert abs(x[13] - 200.0) > 600.0
    assert np.abs(np.array(x[10:13]) - [0.5, -1.0, 2.0]).max() > 1.0, (
        "the base was turned by them"
    )
    np.testing.assert_allclose(momentum(vehicle, x), first, rtol=0.0, atol=1e-8)


def test_every_accelerometer_feels_it():
    """The base origin beside the centre of mass: the turning that rotors cause moves
    it, on each way to ask a plant.
    """
    scenario = load_scenario("case1", duration=0.1)
    vehicle = scenario.plant.vehicle
    base = dataclasses.replace(vehicle.base, com=Vec3(0.1, -0.05, 0.02))
    rotors = tuple(dataclasses.replace(each, inertia=SPIN) for each in vehicle.rotors)
    world = dataclasses.replace(
        scenario.plant, vehicle=dataclasses.replace(vehicle, base=base, rotors=rotors)
    )
    scenario = dataclasses.replace(scenario, plant=world)
    state, command = (
        first_state(scenario),
        Command(rotor_speeds=(700.0, 300.0, 700.0, 300.0), efforts=(0.0, 0.0)),
    )
    around = Surroundings()
    numbers = (*flat(state),), (*command.rotor_speeds, *command.efforts), (0.0,)
    theirs = MujocoPlant(world, around).specific_force(*numbers)
    still = MujocoPlant(world, around).specific_force(
        numbers[0], (*state.rotor_speeds, 0.0, 0.0), (0.0,)
    )
    assert np.abs(np.subtract(theirs, still)).max() > 0.1
    np.testing.assert_allclose(
        RigidBodyPlant(world, around).specific_force(*numbers),
        theirs,
        rtol=0.0,
        atol=1e-9,
    )
    steps = RigidBodySteps(Stages(scenario), lambda seconds: Steps(1))
    (ours,) = steps.proper_accelerations((state,), (command,), together(around))
    np.testing.assert_allclose([*ours.linear], theirs, rtol=0.0, atol=1e-9)
