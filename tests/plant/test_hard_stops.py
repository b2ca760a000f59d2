"""Hard stops of joints: their force, their energy, both plants, and what ends a
flight.
"""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from skyarm.algebra import Sym3, Vec3
from skyarm.dynamics import kinetic_energy
from skyarm.dynamics.actuators import stop_force
from skyarm.plant.compiled import RigidBodyPlant, example_state
from skyarm.plant.interface import Truth, flat
from skyarm.plant.joint_rate import STOP_STEP, joint_rate, stop_frequency
from skyarm.plant.largest_step import FRICTION_STEP, INTEGRATORS
from skyarm.plant.mujoco import MujocoPlant
from skyarm.records.leaves import rebuild
from skyarm.scenario.scenario_record import trimmed_state
from skyarm.vehicle import VehicleError
from skyarm.vehicle.linkage import BASE, Body, Joint, Link
from skyarm.vehicle.stops import STIFFEST, with_stops
from skyarm.vehicle.vehicle_files import load_vehicle
from support.cases import sampled
from support.vehicles import steady_wind

TRUTH = load_vehicle("hummingbird_arm2_rotors")
STILL = steady_wind()


def limited(low=-0.5, high=0.6, **fields):
    """The shipped arm with limits and stops of both joints."""
    return TRUTH.with_joints(
        lower=low, upper=high, **{"stop_stiffness": 3.0, "stop_damping": 0.4, **fields}
    )


JOINT = Joint(name="j", lower=-0.5, upper=0.6, stop_stiffness=20.0, stop_damping=0.3)


@pytest.mark.parametrize(
    ("position", "rate", "force"),
    [
        (0.6, 5.0, 0.0),
        (-0.5, -5.0, 0.0),
        (0.7, 0.0, -2.0),
        (0.7, 2.0, -3.2),
        (0.7, -2.0, -0.8),
        (0.7, -4.0, 0.0),
        (-0.6, 0.0, 2.0),
        (-0.6, -2.0, 3.2),
        (-0.6, 4.0, 0.0),
    ],
)
def test_a_stop_pushes_back_by_depth_and_speed_and_never_pulls(position, rate, force):
    assert float(stop_force(JOINT, position, rate)) == pytest.approx(force, abs=1e-12)


def test_a_joint_without_stops_costs_nothing_and_one_limit_suffices():
    free = dataclasses.replace(JOINT, stop_stiffness=0)
    assert stop_force(free, 7.0, 1.0) == 0
    assert type(stop_force(free, 7.0, 1.0)) is int
    half = dataclasses.replace(JOINT, lower=-math.inf)
    assert float(stop_force(half, -1e3, 2.0)) == 0.0


def test_a_mass_thrown_against_a_stop_comes_back_as_solve_ivp_says_and_slower():
    inertia, speed = 0.02, 3.0

    def slope(_t, x):
        depth = max(x[0] - 0.6, 0.0)
        return [x[1], -20.0 * depth * max(1.0 + 0.3 * x[1], 0.0) / inertia]

    exact = solve_ivp(slope, (0.0, 0.3), [0.5, speed], rtol=1e-10, atol=1e-12).y[:, -1]
    x, v, dt = 0.5, speed, 1e-5
    for _ in range(30000):
        a = float(stop_force(JOINT, x + 0.5 * dt * v, v)) / inertia
        x, v = x + dt * (v + 0.5 * dt * a), v + dt * a
    assert [x, v] == pytest.approx(exact, abs=1e-3)
    assert -speed < v < -0.3 * speed


def thrown(plant, vehicle, dt, seconds):
    """A hover from which both joints run into their stops."""
    start = trimmed_state(Truth(vehicle=vehicle), (0.0, 0.0, 10.0), 0.0, (0.3, -0.2))
    start = dataclasses.replace(start, joint_rates=(4.0, -3.0))
    x, states = flat(start), []
    for _ in range(round(seconds / dt)):
        x = plant.advance(x, [*start.rotor_speeds, 0.05, -0.02], (), dt)
        states.append(x)
    return np.array(states)


def test_both_plants_agree_through_touches_and_the_joints_stay_near_their_limits():
    vehicle = limited()
    world = Truth(vehicle=vehicle)
    ours = thrown(RigidBodyPlant(world, STILL, "rk4", 0.001), vehicle, 0.001, 0.5)
    theirs = thrown(MujocoPlant(world, STILL, "rk4_staged", 0.001), vehicle, 0.001, 0.5)
    joints = ours[:, 13:15]
    touched = (joints > 0.6) | (joints < -0.5)
    assert touched.any(axis=0).all(), "both joints must meet a stop"
    assert (joints < 0.6 + 0.15).all()
    assert (joints > -0.5 - 0.15).all()
    np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=2e-6)


def energies_after_a_touch(plant_of, integrator, vehicle, places):
    """Kinetic energy over that at the start, of a joint thrown from ``places`` (rad
    before a stop) in free fall.
    """
    rotors, upper = len(vehicle.rotors), vehicle.links[0].joint.upper
    plant, found = (
        plant_of(Truth(vehicle=vehicle, gravity=0.0), STILL, integrator, 0.001),
        [],
    )
    for before in places:
        thrown_at = {
            "joints": (upper - before,),
            "joint_rates": (5.0,),
            "rotor_speeds": (0.0,) * rotors,
        }
        start = dataclasses.replace(example_state(1, rotors), **thrown_at)
        x = flat(start)
        for _ in range(16):
            x = plant.advance(x, (0.0,) * (rotors + 1), (), 0.005)
        assert x[14] < 0.0, "it must have come back"
        found.append(
            kinetic_energy(vehicle, rebuild(start, iter(x)))
            / kinetic_energy(vehicle, start)
        )
    return found


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("damping", [0.0, None], ids=["elastic", "as shipped"])
def test_no_touch_of_a_stop_gives_energy_on_mujocos_plant(integrator, damping):
    """With loads held for its steps Runge-Kutta gave 29 % to a touch of an elastic stop
    of 200 rad/s.
    """
    vehicle = load_vehicle("crazyflie_arm1")
    if damping is not None:
        vehicle = vehicle.with_joints(stop_damping=damping)
    left = energies_after_a_touch(
        MujocoPlant, integrator, vehicle, [0.03 + k * 0.0009 for k in range(6)]
    )
    low, high = (0.98, 1.005) if damping is not None else (0.5, 0.9)
    assert low < min(left)
    assert max(left) < high


@pytest.mark.parametrize("plant_of", [RigidBodyPlant, MujocoPlant])
@pytest.mark.parametrize("frequency", [427.0, 877.0, 1223.0])
def test_a_stiff_elastic_stop_keeps_the_energy_of_a_touch(plant_of, frequency):
    """Where a step enters the stop is chance: twelve of them. At twice these steps up
    to 63 % were gained.
    """
    vehicle = load_vehicle("crazyflie_arm1")
    stiffer = (frequency / stop_frequency(vehicle)) ** 2 * vehicle.links[
        0
    ].joint.stop_stiffness
    vehicle = vehicle.with_joints(stop_stiffness=stiffer, stop_damping=0.0)
    left = energies_after_a_touch(
        plant_of, "rk4", vehicle, [0.03 + k * 0.0021 for k in range(12)]
    )
    assert min(left) > 0.9
    assert max(left) < 1.08


def drawn_stop(rng, made):
    """One joint on a heavy base with a drawn mass, force, speed and stop; ``made``: the
    stop that a file gets.
    """
    mass, effort, speed = (
        10.0 ** rng.uniform(-3.0, 0.5),
        10.0 ** rng.uniform(-1.5, 1.0),
        10.0 ** rng.uniform(-0.5, 1.3),
    )
    stiffness, damping = (
        mass * 10.0 ** rng.uniform(3.5, 6.5),
        10.0 ** rng.uniform(-2.0, 2.0) / speed,
    )
    own = {} if made else {"stop_stiffness": stiffness, "stop_damping": damping}
    kind = str(rng.choice(["prismatic", "revolute"]))
    joint = Joint(
        name="j",
        kind=kind,
        axis=Vec3(0, 0, 1),
        lower=-0.05,
        upper=0.05,
        effort_limit=effort,
        **own,
    )
    link = Link(
        name="l",
        parent=BASE,
        joint=joint,
        body=Body(mass=mass, inertia=Sym3(mass, mass, mass)),
    )
    heavy = Body(mass=1e4, inertia=Sym3(1e4, 1e4, 1e4))
    vehicle = with_stops(
        dataclasses.replace(
            TRUTH, base=heavy, links=(link,), frames=(), end_effector=""
        )
    )
    return (
        vehicle,
        speed,
        effort * rng.uniform(-1.0, 1.0),
        0.05 - speed * rng.uniform(0.001, 0.005),
    )


@pytest.mark.parametrize("plant_of", [RigidBodyPlant, MujocoPlant])
@pytest.mark.parametrize("drawn", sampled(range(100), 34, keep=[72]))
def test_a_joint_rebounds_from_a_drawn_stop_as_solve_ivp_says(plant_of, drawn):
    """Weak joints came back with 60 times the speed where the step did not follow the
    damping times speed.
    """
    vehicle, speed, push, start = drawn_stop(
        np.random.default_rng(drawn), made=drawn % 2 == 0
    )
    joint, mass = vehicle.links[0].joint, vehicle.links[0].body.mass

    def slope(_t, x):
        above, below = max(x[0] - 0.05, 0.0), max(-0.05 - x[0], 0.0)
        c = joint.stop_damping
        stop = above * max(1.0 + c * x[1], 0.0) - below * max(1.0 - c * x[1], 0.0)
        return [x[1], (push - joint.stop_stiffness * stop) / mass]

    def leaves_stop(_t, x):
        return x[0] - 0.05

    leaves_stop.direction = -1
    exact = solve_ivp(
        slope,
        (0.0, 0.2),
        [start, speed],
        "LSODA",
        rtol=1e-9,
        atol=1e-12,
        max_step=2e-4,
        events=leaves_stop,
        dense_output=True,
    )
    periods = math.ceil(min([*exact.t_events[0], 0.195]) / 0.005)
    plant = plant_of(Truth(vehicle=vehicle, gravity=0.0), STILL, "rk4", 0.001)
    still = (0.0,) * len(vehicle.rotors)
    first = dataclasses.replace(
        example_state(1, len(still)),
        joints=(start,),
        joint_rates=(speed,),
        rotor_speeds=still,
    )
    x = flat(first)
    for _ in range(periods):
        x = plant.advance(x, (*still, push), (), 0.005)
    assert x[14] == pytest.approx(exact.sol(0.005 * periods)[1], abs=0.05 * speed)


def test_the_step_follows_the_stiffest_stop_as_mujocos_mass_matrix_has_it():
    vehicle = limited(stop_stiffness=50.0, stop_damping=0)
    found = stop_frequency(vehicle)
    assert found > 100.0
    period = 2.0 * STOP_STEP / found * 0.999
    plant = RigidBodyPlant(Truth(vehicle=vehicle), STILL, "rk4", 0.001)
    assert [plant.substeps(share * period).near for share in (0.5, 1.0, 2.0, 2.01)] == [
        1,
        2,
        4,
        5,
    ]
    assert joint_rate(vehicle) == pytest.approx(FRICTION_STEP / STOP_STEP * found)
    assert stop_frequency(TRUTH) == 0.0


@pytest.mark.parametrize("field", ["stop_stiffness", "stop_damping"])
def test_a_stop_that_no_step_affords_is_refused_by_its_field(field):
    with pytest.raises(
        VehicleError,
        match=rf"joints\[joint[12]\].{field} = 1000000000.0: a stop this stiff",
    ) as told:
        stop_frequency(limited(**{field: 1e9}))
    assert "\n" not in str(told.value)


def test_stops_of_a_file_are_chosen_by_effort_and_inertia_between_two_frequencies():
    made = with_stops(TRUTH.with_joints(lower=-1.0, upper=1.0))
    depths = [
        link.joint.effort_limit / link.joint.stop_stiffness for link in made.links
    ]
    assert depths == pytest.approx([0.0253, 0.1], abs=1e-3)
    # a light wrist with a strong drive: as deep as it may press, and not at any
    # stiffness
    strong = with_stops(TRUTH.with_joints(lower=-1.0, upper=1.0, effort_limit=1e4))
    assert STIFFEST * 0.9 <= stop_frequency(strong) <= STIFFEST * 2.0
    assert with_stops(TRUTH) is TRUTH, "a joint without limits needs no stop"
    own = with_stops(
        TRUTH.with_joints(lower=-1.0, upper=1.0), [TRUTH.links[0].joint.name]
    )
    assert [link.joint.has_stops for link in own.links] == [False, True]


def test_armature_lets_a_light_joint_have_the_friction_of_a_servo():
    light = TRUTH.with_joints(coulomb=0.03, coulomb_rate=0.01)
    with pytest.raises(VehicleError, match="joint friction decays at"):
        joint_rate(light)
    assert joint_rate(light.with_joints(armature=0.005)) < 1e3
