"""The integrators against SciPy's DOP853 on equations written a second time, and their
measured orders.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from independent_flight import Flight

from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics.actuators import Command
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.interface import Truth, flat
from skyarm.plant.mujoco import MujocoPlant
from skyarm.plant.rigid_body import coupled_euler, coupled_rk4
from skyarm.records.leaves import leaves
from support.engines import jax_doubles
from support.one_vehicle import after_step
from support.vehicles import (
    HOVER,
    WIND,
    MujocoTwin,
    RandomState,
    hovering,
    hummingbird_arm,
    random_flyer,
    random_vehicle,
    steady_wind,
    tumbling,
)

G = 9.8
SPEEDS = (HOVER + 60.0, HOVER - 150.0, HOVER - 20.0, 900.0)
"""Rotors that rise, fall and meet their limit: the lag matters in every step."""


def flown(plant, x, command, dt, seconds):
    wind = leaves(WIND)
    for _ in range(round(seconds / dt)):
        x = plant.advance(x, command, wind, dt)
    return np.array(x)


def order(errors):
    """Slope of log error over log step for steps that halve."""
    return np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


def problem(vehicle):
    efforts = tuple(0.05 * (-1) ** i for i in range(vehicle.n))
    x = flat(tumbling(vehicle))
    return (
        Truth(vehicle=vehicle, gravity=G),
        x,
        (*SPEEDS, *efforts),
        Flight(vehicle, G, WIND).fly(x, SPEEDS, efforts, 0.16),
    )


@pytest.fixture(scope="module", params=["hummingbird_arm", "random3"])
def tumbled(request):
    return problem(
        hummingbird_arm() if request.param == "hummingbird_arm" else random_flyer(3, 3)
    )


def test_runge_kutta_is_of_fourth_order_while_rotors_lag(tumbled):
    world, x, command, end = tumbled
    plant = RigidBodyPlant(world, WIND, "rk4")
    errors = [
        np.abs(flown(plant, x, command, dt, 0.16) - end).max()
        for dt in (0.008, 0.004, 0.002, 0.001)
    ]
    # above the reference's own error, or the slope would mean nothing
    assert errors[-1] > 1e-11
    assert order(errors)[-1] == pytest.approx(4.0, abs=0.2)


@pytest.mark.parametrize("made", [RigidBodyPlant, MujocoPlant])
def test_semi_implicit_euler_is_of_first_order(tumbled_rough, made):
    world, x, command, end = tumbled_rough
    errors = []
    for dt in (0.002, 0.001, 0.0005, 0.00025):
        plant = made(world, WIND, "euler", physics_step=dt)
        errors.append(
            np.abs(np.array(plant.advance(x, command, leaves(WIND), 0.16)) - end).max()
        )
    assert order(errors)[-1] == pytest.approx(1.0, abs=0.2)


def test_runge_kutta_of_mujoco_under_held_forces_has_first_order_and_the_same_limit(
    tumbled,
):
    world, x, command, end = tumbled
    errors = []
    for dt in (0.002, 0.001, 0.0005, 0.00025):
        plant = MujocoPlant(world, WIND, "rk4", physics_step=dt)
        errors.append(
            np.abs(np.array(plant.advance(x, command, leaves(WIND), 0.16)) - end).max()
        )
    assert order(errors)[-1] == pytest.approx(1.0, abs=0.2)


def rough(vehicle):
    """The vehicle with joints of viscous and dry friction, the dry part smooth enough
    for the steps below.
    """
    return vehicle.with_joints(damping=0.002, coulomb=0.004, coulomb_rate=1.0)


@pytest.fixture(
    scope="module",
    params=[
        "hummingbird_arm",
        "random3",
        "hummingbird_arm, friction",
        "random3, friction",
    ],
)
def tumbled_rough(request):
    name, _, friction = request.param.partition(", ")
    vehicle = hummingbird_arm() if name == "hummingbird_arm" else random_flyer(3, 3)
    return problem(rough(vehicle) if friction else vehicle)


def test_mujocos_bodies_with_loads_at_each_stage_fly_to_fourth_order(tumbled_rough):
    """Wind, drag, lagging rotors and joint friction, against DOP853 on equations of
    their own.
    """
    world, x, command, end = tumbled_rough
    errors = []
    for dt in (0.008, 0.004, 0.002, 0.001):
        plant = MujocoPlant(world, WIND, "rk4_staged", physics_step=dt)
        errors.append(
            np.abs(np.array(plant.advance(x, command, leaves(WIND), 0.16)) - end).max()
        )
    assert errors[-1] > 1e-11
    assert order(errors)[-1] == pytest.approx(4.0, abs=0.2)


def test_the_attitude_of_a_body_that_spins_fast_is_of_fourth_order():
    """25 rad/s about no principal axis, nothing pushing: the rotation vector's double
    product counts.
    """
    vehicle = replace(random_vehicle(np.random.default_rng([5, 0]), 0), rotors=())
    world = Truth(vehicle=vehicle, gravity=0.0)
    x = flat(replace(tumbling(vehicle), rate=Vec3(20.0, -9.0, 12.0)))
    end = Flight(vehicle, 0.0, steady_wind()).fly(x, (), (), 0.16)
    errors = []
    for dt in (0.004, 0.002, 0.001):
        plant = MujocoPlant(world, steady_wind(), "rk4_staged", physics_step=dt)
        errors.append(np.abs(np.array(plant.advance(x, (), (), 0.16)) - end)[3:7].max())
    assert order(errors)[-1] == pytest.approx(4.0, abs=0.2)


@pytest.mark.parametrize(
    ("steps", "pose", "rates"), [(1, 2e-8, 3e-5), (16, 1e-11, 1e-9)]
)
def test_control_periods_of_a_flight_are_those_of_dop853(steps, pose, rates):
    """Ten periods of 5 ms with changing commands: one Runge-Kutta step a period as in
    use, and sixteen (measured errors 1.2e-8 and 1.8e-5, 1.9e-13 and 2.9e-10; the
    largest is that of the outer joint's rate).
    """
    vehicle = hummingbird_arm()
    world, flight = Truth(vehicle=vehicle, gravity=G), Flight(vehicle, G, WIND)
    plant = RigidBodyPlant(world, WIND, "rk4")
    x = flat(hovering(vehicle))
    reference = np.array(x)
    rng = np.random.default_rng(9)
    for _ in range(10):
        speeds = tuple((HOVER + rng.normal(scale=30.0, size=4)).tolist())
        efforts = tuple(rng.normal(scale=0.02, size=2).tolist())
        reference = flight.fly(reference, speeds, efforts, 0.005)
        for _ in range(steps):
            x = plant.advance(x, (*speeds, *efforts), leaves(WIND), 0.005 / steps)
    np.testing.assert_allclose(x[:7], reference[:7], rtol=0.0, atol=pose)
    np.testing.assert_allclose(x[:-4], reference[:-4], rtol=0.0, atol=rates)
    # the rotor speeds are solved exactly
    np.testing.assert_allclose(x[-4:], reference[-4:], rtol=1e-11)


def test_rotor_speeds_do_not_depend_on_the_step():
    vehicle = hummingbird_arm()
    plant = RigidBodyPlant(Truth(vehicle=vehicle, gravity=G), WIND, "rk4")
    x, command = flat(tumbling(vehicle)), (*SPEEDS, 0.0, 0.0)
    coarse, fine = (
        flown(plant, x, command, 0.01, 0.05),
        flown(plant, x, command, 0.001, 0.05),
    )
    np.testing.assert_allclose(coarse[-4:], fine[-4:], rtol=1e-13)


def test_the_quaternion_stays_of_unit_length():
    vehicle = random_flyer(1, 3)
    for kind in (RigidBodyPlant, MujocoPlant):
        for integrator in ("rk4", "euler", "rk4_staged"):
            plant = kind(Truth(vehicle=vehicle, gravity=G), WIND, integrator)
            x = flat(tumbling(vehicle))
            for _ in range(100):
                x = plant.advance(x, (HOVER,) * 4 + (0.0,) * 3, leaves(WIND), 0.005)
                # one normalisation: a few units in the last place
                assert abs(np.linalg.norm(x[3:7]) - 1.0) < 1e-15


def _random_state(x, n):
    x = np.array(x)
    return RandomState(
        x[:3], x[3:7], x[13 : 13 + n], np.concatenate([x[7:13], x[13 + n : 13 + 2 * n]])
    )


@pytest.mark.parametrize(
    ("kind", "dt"), [(RigidBodyPlant, 0.001), (MujocoPlant, 0.001)]
)
@pytest.mark.parametrize("joints", [0, 2, 4])
def test_free_fall_in_vacuum_keeps_energy_and_momentum(kind, dt, joints):
    """No rotors, air or friction; energy and momentum are MuJoCo's. Runge-Kutta errs by
    about (rate dt)^4 a second.
    """
    vehicle = random_vehicle(np.random.default_rng([5, joints]), joints)
    plant, twin = (
        kind(Truth(vehicle=vehicle, gravity=G), steady_wind(), "rk4"),
        MujocoTwin(vehicle),
    )
    x = flat(tumbling(vehicle, seed=2))
    before = _random_state(x, joints)
    energy, momentum = twin.energy(before, G), twin.momentum(before)
    seconds = 0.5
    for _ in range(round(seconds / dt)):
        x = plant.advance(x, (0.0,) * joints, (), dt)
    after = _random_state(x, joints)
    weight = np.array(
        [
            0.0,
            0.0,
            -sum(float(b.mass) for b in vehicle.bodies) * G * seconds,
            0.0,
            0.0,
            0.0,
        ]
    )
    error = 1e-7
    assert twin.energy(after, G) == pytest.approx(energy, abs=error)
    np.testing.assert_allclose(
        twin.momentum(after), momentum + weight, rtol=0.0, atol=error
    )
    assert np.abs(np.subtract(x[3:7], before.quaternion)).max() > 0.2  # it did turn


def test_joint_damping_takes_energy():
    """In free fall, with damped joints and nothing else, energy falls from step to
    step.
    """
    vehicle = random_vehicle(
        np.random.default_rng([5, 3]), 3, prismatic=False
    ).with_joints(damping=0.05, coulomb=0.02, coulomb_rate=0.1)
    twin = MujocoTwin(vehicle)
    for kind in (RigidBodyPlant, MujocoPlant):
        plant, x, energies = (
            kind(Truth(vehicle=vehicle, gravity=G), steady_wind()),
            flat(tumbling(vehicle)),
            [],
        )
        for _ in range(50):
            energies.append(twin.energy(_random_state(x, 3), G))
            x = plant.advance(x, (0.0,) * 3, (), 0.005)
        assert np.all(np.diff(energies) < 0.0)


@pytest.mark.thorough
def test_both_steps_have_gradients_where_nothing_moves():
    jax = pytest.importorskip("jax")
    vehicle, dt = hummingbird_arm(), 0.001
    # falling freely with rotors at rest: neither a rate nor an angular acceleration, so
    # the step's turn is zero
    still = replace(
        hovering(vehicle),
        joint_rates=(0.0, 0.0),
        rotor_speeds=(0.0,) * 4,
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
    )
    command, world = (
        Command(rotor_speeds=(0.0,) * 4, efforts=(0.0, 0.0)),
        Truth(vehicle=vehicle, gravity=G),
    )
    for law in (coupled_euler, coupled_rk4):

        def turned(rate, law=law):
            moved, _ = after_step(
                law, world, replace(still, rate=Vec3(*rate)), command, steady_wind(), dt
            )
            return jax.numpy.stack([*moved.quaternion])

        with jax_doubles():
            gradient = np.array(jax.jacobian(turned)(np.zeros(3)))
        # half the angle of a turn by w dt; the arm's own motion bends it by no more
        # than dt^2
        assert np.allclose(
            gradient, 0.5 * dt * np.eye(4)[:, 1:], rtol=0.0, atol=1e-12
        ), law.__name__
