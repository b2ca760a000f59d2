"""Servos that turn rotors: the lag against an integrator of its equation, wrench
against geometry and a fixed rotor.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics.actuators import Command, rotor_forces
from skyarm.dynamics.actuators.tilting import angle_after, turn_rotors, with_rest
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.interface import Truth, flat
from skyarm.plant.mujoco import MujocoPlant
from skyarm.records.leaves import leaves, rebuild
from skyarm.vehicle.tilt import Tilt
from support.one_vehicle import rate_of
from support.vehicles import steady_wind

VOLIRO = skyarm.load_vehicle("voliro_like")
SERVO = Tilt(axis=(1, 0, 0), lower=-1.0, upper=0.8, time_constant=0.05, max_rate=6.0)
ANGLES = (0.4, -0.3, 0.2, 0.7, -0.6, 0.1)
SPEEDS = (400.0, 450.0, 500.0, 520.0, 480.0, 430.0)


@pytest.mark.parametrize(
    ("start", "setpoint"),
    [(0.0, 0.2), (-0.9, 0.7), (0.8, -3.0), (0.3, 0.3), (-1.0, 5.0)],
)
def test_an_angle_follows_its_setpoint_as_the_equation_of_its_servo_says(
    start, setpoint
):
    goal = min(max(setpoint, SERVO.lower), SERVO.upper)

    def rate(_, a):
        return np.clip(
            (goal - a) / SERVO.time_constant, -SERVO.max_rate, SERVO.max_rate
        )

    for seconds in (0.003, 0.05, 0.4):
        found = solve_ivp(
            rate, (0.0, seconds), [start], rtol=1e-10, atol=1e-12, max_step=5e-3
        ).y[0, -1]
        assert angle_after(SERVO, start, setpoint, seconds) == pytest.approx(
            found, abs=1e-8
        )
        # a held setpoint in two pieces
        halfway = angle_after(SERVO, start, setpoint, 0.4 * seconds)
        assert angle_after(SERVO, halfway, setpoint, 0.6 * seconds) == pytest.approx(
            found, abs=1e-8
        )


def test_a_servo_without_a_largest_rate_is_a_first_order_lag():
    free = dataclasses.replace(SERVO, max_rate=float("inf"))
    assert angle_after(free, -1.0, 0.8, 0.05) == pytest.approx(
        0.8 - 1.8 * np.exp(-1.0), abs=1e-9
    )


def test_thrust_and_drag_torque_go_along_the_turned_axis():
    """The wrench from the axis that SciPy's rotation about the arm gives, written out
    with NumPy.
    """
    still = Vec3(0.0, 0.0, 0.0)
    found = rotor_forces(turn_rotors(VOLIRO, ANGLES).rotors, SPEEDS, still, still)
    force, torque = np.zeros(3), np.zeros(3)
    for rotor, speed, angle in zip(VOLIRO.rotors, SPEEDS, ANGLES, strict=True):
        at = np.array([float(c) for c in rotor.position])
        axis = Rotation.from_rotvec(angle * at / np.linalg.norm(at)).apply(
            [0.0, 0.0, 1.0]
        )
        thrust = rotor.thrust_coefficient * speed**2 * axis
        force, torque = force + thrust, torque + np.cross(at, thrust)
        torque = torque - rotor.direction * rotor.moment_coefficient * thrust
    np.testing.assert_allclose([*found.force], force, atol=1e-12)
    np.testing.assert_allclose([*found.torque], torque, atol=1e-12)


def state(vehicle):
    return skyarm.State(
        position=Vec3(0.0, 0.0, 2.0),
        quaternion=Quaternion.of_rotation_vector(Vec3(0.1, -0.2, 0.3)),
        velocity=Vec3(1.0, 0.5, -0.2),
        rate=Vec3(0.2, -0.1, 0.4),
        joints=(0.3, -0.4),
        joint_rates=(0.1, 0.2),
        rotor_speeds=SPEEDS,
        tilts=ANGLES if vehicle.tilts else (),
    )


def test_a_turned_rotor_moves_the_plant_as_one_that_is_mounted_so():
    fixed = turn_rotors(VOLIRO, ANGLES)
    assert not fixed.tilts
    calm, command = steady_wind(), Command(rotor_speeds=SPEEDS, efforts=(0.1, 0.0))
    rates = [
        rate_of(Truth(vehicle=v), state(v), command, calm) for v in (VOLIRO, fixed)
    ]
    np.testing.assert_allclose(leaves(rates[0]), leaves(rates[1]), atol=1e-12)


@pytest.mark.parametrize(
    "integrator", ["euler", pytest.param("rk4_staged", marks=pytest.mark.thorough)]
)
def test_both_plants_turn_their_rotors_alike(integrator):
    bare = dataclasses.replace(VOLIRO, links=(), frames=(), end_effector="")
    begun = dataclasses.replace(state(bare), joints=(), joint_rates=())
    command = Command(rotor_speeds=(470.0,) * 6, tilts=(-0.4, 0.5, 0.3, -2.0, 0.6, 0.2))
    world, around = Truth(vehicle=bare), steady_wind()
    found = [
        kind(world, around, integrator, 0.001).advance(
            flat(begun), leaves(command), leaves(around), 0.02
        )
        for kind in (RigidBodyPlant, MujocoPlant)
    ]
    # the same steps of 1 ms; of the method of fourth order ours takes one of 20 ms
    np.testing.assert_allclose(
        found[0], found[1], rtol=0.0, atol=1e-10 if integrator == "euler" else 2e-6
    )
    exact = [
        angle_after(t, a, u, 0.02)
        for t, a, u in zip(bare.tilts, ANGLES, command.tilts, strict=True)
    ]
    np.testing.assert_allclose(found[0][-6:], exact, atol=1e-12)


@pytest.mark.parametrize(
    ("kind", "integrator"),
    [(RigidBodyPlant, "euler"), (MujocoPlant, "euler"), (MujocoPlant, "rk4")],
)
def test_forces_that_are_held_for_a_step_have_the_mean_axes_of_turning_rotors(
    kind, integrator
):
    """Velocity after one step of 5 ms from rest, against SciPy's quadrature of the
    thrust along the turning axes.
    """
    bare = dataclasses.replace(VOLIRO, links=(), frames=(), end_effector="")
    goals, dt, gravity = (-0.4, 0.5, 0.9, 0.1, 0.4, 0.6), 0.005, 9.81
    still = Vec3(0.0, 0.0, 0.0)
    begun = dataclasses.replace(
        state(bare),
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=still,
        rate=still,
        joints=(),
        joint_rates=(),
    )
    command, around = Command(rotor_speeds=SPEEDS, tilts=goals), steady_wind()
    plant = kind(Truth(vehicle=bare, gravity=gravity), around, integrator, dt)
    after = rebuild(
        begun, iter(plant.advance(flat(begun), leaves(command), leaves(around), dt))
    )
    gained = np.zeros(3)
    for rotor, speed, angle, goal in zip(
        bare.rotors, SPEEDS, ANGLES, goals, strict=True
    ):
        at, servo = np.array([float(c) for c in rotor.position]), rotor.tilt
        at /= np.linalg.norm(at)

        def slope(
            _,
            x,
            at=at,
            servo=servo,
            goal=goal,
            push=rotor.thrust_coefficient * speed**2,
        ):
            """Rates of the tilt and of the momentum."""
            turn = np.clip(
                (goal - x[0]) / servo.time_constant, -servo.max_rate, servo.max_rate
            )
            return [
                turn,
                *(push * Rotation.from_rotvec(x[0] * at).apply([0.0, 0.0, 1.0])),
            ]

        gained += solve_ivp(
            slope, (0.0, dt), [angle, 0.0, 0.0, 0.0], rtol=1e-9, atol=1e-12
        ).y[1:, -1]
    right = gained / float(bare.mass) - np.array([0.0, 0.0, gravity * dt])
    np.testing.assert_allclose([*after.velocity], right, atol=1e-4 * dt * gravity)


def test_a_command_that_says_nothing_of_servos_leaves_them_at_rest():
    plain = Command(rotor_speeds=SPEEDS, efforts=(0.0, 0.0))
    assert with_rest(VOLIRO, plain).tilts == (0.0,) * 6
    told = dataclasses.replace(plain, tilts=ANGLES)
    assert with_rest(VOLIRO, told) is told
    flat_one = skyarm.load_vehicle("tilted_hexarotor")
    assert with_rest(flat_one, plain) is plain
    assert turn_rotors(flat_one, ()) is flat_one
