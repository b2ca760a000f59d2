"""Our rigid bodies and MuJoCo's, open loop: the same integrator must give the same
flight.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from skyarm import dynamics
from skyarm.algebra import Force, Quaternion, Vec3
from skyarm.compile import trace
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.drive import TORQUE_DRIVE
from skyarm.dynamics.actuators.rotor import equivalent_speed_and_lag
from skyarm.dynamics.actuators.servo import PositionServo
from skyarm.dynamics.state import coordinate_acceleration
from skyarm.plant.compiled import RigidBodyPlant, example_state
from skyarm.plant.interface import Truth, flat
from skyarm.plant.loads import applied_force, with_lag
from skyarm.plant.mujoco import MujocoPlant
from skyarm.plant.surroundings import Surroundings
from skyarm.records.leaves import leaves, shaped_like
from skyarm.vehicle.vehicle_files import load_vehicle
from support.cases import sampled
from support.one_vehicle import motion_of
from support.vehicles import (
    HOVER,
    WIND,
    hovering,
    hummingbird_arm,
    random_flyer,
    steady_wind,
    tumbling,
)

# rounding of 2000 steps grows along a whirling arm; measured 4e-11 at worst
TOLERANCE = 1e-9
G = 9.8
FLYERS = {"hummingbird_arm": hummingbird_arm()} | {
    f"random{joints}-{seed}": random_flyer(seed, joints)
    for seed, joints in ((0, 3), (1, 4), (2, 5), (3, 3), (4, 5))
}
STARTS = {"hovering": hovering, "tumbling": tumbling}


def command_for(vehicle):
    return (
        HOVER + 10.0,
        HOVER,
        HOVER - 20.0,
        HOVER + 5.0,
        *(0.1 - 0.15 * (i % 2) for i in range(vehicle.n)),
    )


@pytest.mark.parametrize("start", sorted(STARTS))
@pytest.mark.parametrize("name", sorted(FLYERS))
def test_semi_implicit_euler_is_that_of_mujoco(name, start):
    vehicle = FLYERS[name]
    world, x = Truth(vehicle=vehicle, gravity=G), flat(STARTS[start](vehicle))
    arguments = (command_for(vehicle), leaves(WIND), 2.0)
    ours = RigidBodyPlant(world, WIND, "euler").advance(x, *arguments)
    theirs = MujocoPlant(world, WIND, "euler").advance(x, *arguments)
    np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=TOLERANCE)
    # the flight must be worth comparing
    moved = np.abs(np.subtract(ours, x))[: 13 + vehicle.n]
    assert moved[:3].max() > 0.5
    assert moved[13:].max() > 0.2


def mixed(weights, vectors):
    """Weighted sum of vectors or of tuples."""
    if isinstance(vectors[0], tuple):
        return tuple(
            sum(w * value for w, value in zip(weights, column, strict=True))
            for column in zip(*vectors, strict=True)
        )
    total = vectors[0] * weights[0]
    for w, v in zip(weights[1:], vectors[1:], strict=True):
        total = total + v * w
    return total


class ManifoldRungeKutta:
    """MuJoCo's RK4 on our derivative, with the generalised forces of the step's
    beginning held.

    The attitude is the first one times the exponential of a rotation vector u, and it
    is u that the Runge-Kutta method integrates: du/dt = w + 1/2 u x w + 1/12 u x (u x
    w).
    Source: Munthe-Kaas 1999, Runge-Kutta methods on Lie groups.
    """

    def __init__(self, vehicle, wind, dt):
        self.vehicle, self.dt = vehicle, dt
        command = Command(
            rotor_speeds=(0.0,) * len(vehicle.rotors), efforts=(0.0,) * vehicle.n
        )
        self.flat = trace(
            self.step, example_state(vehicle.n, len(vehicle.rotors)), command, wind
        ).flat

    def slope(self, x, u, force_W, torque_B, torques):
        """Rates of position, u, joints, and of the velocities."""
        R = x.quaternion.rotation()
        applied = Force(torque_B, R.apply_T(force_W))
        base, joints = dynamics.forward_dynamics(
            self.vehicle, x.joints, x.rate, x.joint_rates, applied, torques
        )
        linear, angular = coordinate_acceleration(R, base, G)
        c = u.cross(x.rate)
        turning = x.rate + c * 0.5 + u.cross(c) * (1.0 / 12.0)
        return x.velocity, turning, x.joint_rates, linear, angular, joints

    def moved(self, x, weights, slopes):
        """The first state moved by weighted slopes, and its u."""
        change = [
            mixed([w * self.dt for w in weights], column)
            for column in zip(*slopes, strict=True)
        ]
        plus = [
            tuple(a + b for a, b in zip(start, more, strict=True))
            for start, more in ((x.joints, change[2]), (x.joint_rates, change[5]))
        ]
        state = State(
            position=x.position + change[0],
            quaternion=(
                x.quaternion * Quaternion.of_rotation_vector(change[1])
            ).normalized(),
            velocity=x.velocity + change[3],
            rate=x.rate + change[4],
            joints=plus[0],
            joint_rates=plus[1],
            rotor_speeds=x.rotor_speeds,
        )
        return state, change[1]

    def step(self, x, command, wind):
        # held loads have the rotors' mean thrust of the step
        rows = zip(
            self.vehicle.rotors, x.rotor_speeds, command.rotor_speeds, strict=True
        )
        felt = replace(
            x,
            rotor_speeds=tuple(
                equivalent_speed_and_lag(*row, self.dt)[0] for row in rows
            ),
        )
        force, torques = applied_force(
            motion_of(Truth(vehicle=self.vehicle), felt, wind),
            Command(efforts=command.efforts),
            wind,
        )
        held = (x.quaternion.rotation().apply(force.force), force.torque, torques)
        slopes = [self.slope(x, Vec3(0, 0, 0), *held)]
        for weight in (0.5, 0.5, 1.0):
            slopes.append(self.slope(*self.moved(x, [weight], slopes[-1:]), *held))
        end, _ = self.moved(x, [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0], slopes)
        return with_lag(self.vehicle, end, command, self.dt, wind)


@pytest.mark.parametrize(
    ("name", "start"),
    [
        ("hummingbird_arm", "hovering"),
        ("hummingbird_arm", "tumbling"),
        ("random3-0", "tumbling"),
    ],
)
def test_a_twin_of_mujocos_runge_kutta_on_our_derivative_flies_the_same(name, start):
    vehicle = FLYERS[name]
    x = begin = flat(STARTS[start](vehicle))
    inputs = (*command_for(vehicle), *leaves(WIND))
    twin = ManifoldRungeKutta(vehicle, WIND, 0.001)
    for _ in range(1000):
        x = twin.flat((*x, *inputs))
    world = Truth(vehicle=vehicle, gravity=G)
    theirs = MujocoPlant(world, WIND, "rk4").advance(
        begin, command_for(vehicle), leaves(WIND), 1.0
    )
    np.testing.assert_allclose(x, theirs, rtol=0.0, atol=TOLERANCE)


def stepped(plant, x, command, dt, seconds=0.25):
    for _ in range(round(seconds / dt)):
        x = plant.advance(x, command, leaves(WIND), dt)
    return np.array(x)


@pytest.mark.parametrize("start", sorted(STARTS))
@pytest.mark.parametrize("name", sampled(sorted(FLYERS), 6))
def test_with_loads_at_each_stage_the_plants_differ_by_their_own_errors(name, start):
    """Half a step changes 15 sixteenths of an error of fourth order; the flights differ
    by both errors at most.
    """
    vehicle = FLYERS[name]
    world, x, command, dt = (
        Truth(vehicle=vehicle, gravity=G),
        flat(STARTS[start](vehicle)),
        command_for(vehicle),
        5e-4,
    )
    ours = RigidBodyPlant(world, WIND, "rk4")
    rigid, finer = stepped(ours, x, command, dt), stepped(ours, x, command, 0.5 * dt)
    staged, fine = (
        np.array(
            MujocoPlant(world, WIND, "rk4_staged", step).advance(
                x, command, leaves(WIND), 0.25
            )
        )
        for step in (dt, 0.5 * dt)
    )
    errors = 16.0 / 15.0 * (np.abs(rigid - finer).max() + np.abs(staged - fine).max())
    assert np.abs(rigid - staged).max() < errors + 0.1 * TOLERANCE
    assert errors < 1e-6


@pytest.mark.parametrize("name", sorted(FLYERS))
def test_both_plants_feel_the_same_specific_force(name):
    vehicle = FLYERS[name]
    world = Truth(vehicle=vehicle, gravity=G)
    ours, theirs = RigidBodyPlant(world, WIND), MujocoPlant(world, WIND)
    for seed in range(5):
        arguments = (flat(tumbling(vehicle, seed)), command_for(vehicle), leaves(WIND))
        # tens of m/s^2, one solution of the mass matrix
        np.testing.assert_allclose(
            ours.specific_force(*arguments),
            theirs.specific_force(*arguments),
            rtol=0.0,
            atol=1e-11,
        )


@pytest.mark.parametrize("kind", [RigidBodyPlant, MujocoPlant])
def test_an_accelerometer_in_hover_reads_g_along_z(kind):
    vehicle = hummingbird_arm()
    still = State(
        position=Vec3(0.0, 0.0, 1.0),
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=Vec3(0.0, 0.0, 0.0),
        rate=Vec3(0.0, 0.0, 0.0),
        joints=(0.0, 0.0),
        joint_rates=(0.0, 0.0),
        rotor_speeds=((0.82103 * G / (4.0 * 8.54858e-6)) ** 0.5,) * 4,
    )
    plant = kind(Truth(vehicle=vehicle, gravity=G), steady_wind())
    reading = plant.specific_force(flat(still), (0.0,) * 6, ())
    assert reading == pytest.approx((0.0, 0.0, G), abs=1e-12)
    # and nothing in free fall: commands do not matter, only the rotors' present speeds
    falling = State(
        **{
            name: getattr(still, name)
            for name in ("position", "quaternion", "velocity", "rate")
        },
        joints=(0.0, 0.0),
        joint_rates=(0.0, 0.0),
        rotor_speeds=(0.0,) * 4,
    )
    assert plant.specific_force(
        flat(falling), (800.0,) * 4 + (0.0,) * 2, ()
    ) == pytest.approx((0.0,) * 3, abs=1e-12)


@pytest.mark.parametrize("integrator", ["rk4", "euler", "rk4_staged"])
@pytest.mark.parametrize("kind", [RigidBodyPlant, MujocoPlant])
def test_a_plant_is_a_function_of_its_arguments(kind, integrator):
    """Bit for bit: the same from the same state, whatever was flown in between, on this
    object or a new one.
    """
    vehicle = FLYERS["random4-1"]
    plant = kind(Truth(vehicle=vehicle, gravity=G), WIND, integrator)
    a, b = flat(hovering(vehicle)), flat(tumbling(vehicle))
    rest = (command_for(vehicle), leaves(WIND), 0.02)
    first = plant.advance(a, *rest)
    plant.advance(b, *rest)
    plant.specific_force(b, *rest[:2])
    assert plant.advance(a, *rest) == first
    assert (
        kind(Truth(vehicle=vehicle, gravity=G), WIND, integrator).advance(a, *rest)
        == first
    )
    assert flat(hovering(vehicle)) == a


@pytest.mark.parametrize("kind", [RigidBodyPlant, MujocoPlant])
def test_many_short_calls_are_one_long_call(kind):
    vehicle = hummingbird_arm()
    plant = kind(Truth(vehicle=vehicle, gravity=G), WIND, "euler")
    x = flat(tumbling(vehicle))
    whole = plant.advance(x, command_for(vehicle), leaves(WIND), 0.1)
    for _ in range(20):
        x = plant.advance(x, command_for(vehicle), leaves(WIND), 0.005)
    assert x == whole


@pytest.mark.parametrize("kind", [RigidBodyPlant, MujocoPlant])
def test_the_joint_drive_of_a_plant_is_limited(kind):
    """A command of 50 N m on a drive of 0.2 N m flies like one of 0.2 N m, to the last
    bit.
    """
    vehicle = hummingbird_arm(effort_limit=0.2)
    plant = kind(Truth(vehicle=vehicle, gravity=G), WIND, "euler")
    x, speeds = flat(hovering(vehicle)), (HOVER,) * 4
    strong = plant.advance(x, (*speeds, 50.0, -50.0), leaves(WIND), 0.05)
    assert strong == plant.advance(x, (*speeds, 0.2, -0.2), leaves(WIND), 0.05)
    assert strong != plant.advance(x, (*speeds, 0.1, -0.2), leaves(WIND), 0.05)


def test_shapes_of_flat_states_agree():
    vehicle = FLYERS["random5-2"]
    state = tumbling(vehicle)
    assert shaped_like(state, flat(state)) == state


def test_a_lightly_damped_servo_rings_alike_on_both_plants():
    """With its torque held for steps of Runge-Kutta, fourteen times as much was left on
    MuJoCo's.
    """
    vehicle = load_vehicle("pelican_arm2")
    n, J, w, ratio = vehicle.n, 3.5e-5, 450.0, 0.1
    servo = PositionServo(stiffness=J * w**2, damping=2.0 * ratio * w * J, inertia=J)
    memories = ((),) * (n - 1) + (servo.begin(0.0, 0.0, 0.005),)
    around = Surroundings(
        drives=(TORQUE_DRIVE,) * (n - 1) + (servo,), drive_memories=memories
    )
    start = replace(
        example_state(n, 4), joints=(0.0,) * (n - 1) + (0.05,), rotor_speeds=(0.0,) * 4
    )
    left = []
    for kind in (RigidBodyPlant, MujocoPlant):
        plant, x = (
            kind(Truth(vehicle=vehicle, gravity=0.0), around, "rk4", 0.001),
            flat(start),
        )
        swings = []
        for _ in range(24):
            x = plant.advance(x, (0.0,) * (4 + n), leaves(around), 0.005)
            swings.append(abs(x[12 + n]))
        left.append(max(swings[-5:]))
    assert left[0] == pytest.approx(0.05 * math.exp(-ratio * w * 0.1), rel=0.5)
    assert left[1] == pytest.approx(left[0], rel=1e-2)
