"""Friction, dry friction and grasps under semi-implicit Euler, and the steps that
damping and levers ask for.
"""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from skyarm.algebra import Vec3
from skyarm.dynamics.point_motion import PointMotion
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.interface import Truth
from skyarm.plant.largest_step import stated_step
from skyarm.plant.mujoco import MujocoPlant
from skyarm.plant.surroundings import Surroundings
from skyarm.records.leaves import leaves, rebuild
from skyarm.simulate.lane_numbers import _stable_step
from skyarm.world.contact import (
    Contact,
    ContactPoint,
    FreeObject,
    Gripper,
    Material,
    Mechanism,
    Surface,
)
from skyarm.world.contact.material import euler_step_of
from support.worlds import BIRD, Scene, at_rest, limp

ARM, REST = limp("hummingbird_arm2_rotors"), Vec3(0.0, 0.0, 0.0)


def growth(derivative_or_map, x, step=None):
    """Largest growth of a small deviation: of a Runge-Kutta step of a derivative, or of
    a map where none is given.
    """
    around = 1e-6 * np.eye(len(x))
    columns = [
        (derivative_or_map(x + e) - derivative_or_map(x - e)) / 2e-6 for e in around
    ]
    z = np.linalg.eigvals(np.stack(columns, axis=1))
    if step is not None:
        z = step * z
        z = 1.0 + z + z**2 / 2.0 + z**3 / 6.0 + z**4 / 24.0
    return np.abs(z).max()


def pushed(kind):
    """Places (N,) of a limp vehicle whose centre of mass sticks to the ground, after a
    push of 1 mm/s along it.
    """
    contact = Contact(
        surfaces=(Surface(name="ground", material=Material(friction=0.6)),),
        points=(ContactPoint(name="middle", body="base"),),
    )
    start = at_rest(BIRD, (0.0, 0.0, -float(BIRD.mass) * 9.8 / 5000.0))
    start = dataclasses.replace(start, velocity=Vec3(1e-3, 0.0, 0.0))
    return Scene(contact, state=start, kind=kind, integrator="euler").fly(contact, 0.5)[
        0
    ][:, 0]


def test_on_both_plants_a_point_that_sticks_does_not_chatter():
    """21 kN/m of a bristle in steps of 1 ms are more than its damping: by the velocity
    before a step it swings up.
    """
    ours, theirs = pushed(RigidBodyPlant), pushed(MujocoPlant)
    assert 4e-6 < np.ptp(ours[:20]) < 2e-5
    assert np.ptp(ours[-20:]) < 0.3 * np.ptp(ours[:20])
    assert theirs == pytest.approx(ours, abs=1e-12)


def turned(valve, step, seconds=0.5):
    """Coordinate after a constant torque of half the friction, by semi-implicit
    steps.
    """
    memory, torque = valve.start(), Vec3(0.0, 0.0, 0.1)
    for _ in range(math.ceil(seconds / step)):
        memory = valve.before_euler_step(
            memory, valve.slope(memory, REST, torque, 0.0), step
        )
        memory = valve.euler_step(memory, valve.slope(memory, REST, torque, 0.0), step)
    return memory.coordinate


def test_dry_friction_holds_a_mechanism():
    """It builds up over 2 mrad, so half of it bends 1 mrad and less than 2 with the
    swing.
    """
    valve = Mechanism(
        name="valve", kind="hinge", axis=(0, 0, 1), inertia=1e-4, friction=0.2
    )
    assert 1e-3 < turned(valve, float(valve.largest_euler_step)) < 2e-3
    assert turned(valve, float(valve.largest_step)) > 0.1, (
        "the step of Runge-Kutta's method is too long"
    )
    assert float(valve.largest_step) == pytest.approx(1.5e-3)


@pytest.mark.parametrize("ratio", [0.0, 0.5, 1.0, 1.3, 1.9, 2.0])
def test_a_grasp_of_any_damping_is_stable_in_its_step(ratio):
    """An oscillator of the masses that the step is asked for; beyond the bound of Euler
    it grows.
    """
    mass, hand = 0.02, Gripper(name="hand", damping_ratio=ratio)
    A = np.array([[0.0, 1.0], [-5000.0 / mass, -float(hand.damping(mass)) / mass]])
    assert (
        growth(lambda x: A @ x, np.zeros(2), float(hand.step_of(mass, mass)))
        < 1.0 + 1e-9
    )

    def euler(step):
        after = np.array([[1.0, 0.0], [0.0, 1.0]]) + step * A
        return np.array(
            [
                [1.0 + step * step * A[1, 0], step * after[1, 1]],
                [step * A[1, 0], after[1, 1]],
            ]
        )

    h = float(hand.step_of(mass, mass, euler=True))
    assert growth(lambda x: euler(h) @ x, np.zeros(2)) < 1.0 + 1e-9
    bound = float(euler_step_of(-A[1, 0], -A[1, 1])) / 0.75
    assert growth(lambda x: euler(1.001 * bound) @ x, np.zeros(2)) > 1.0
    assert float(hand.step_of(mass, mass)) <= 0.85 * math.sqrt(mass / 5000.0)


@pytest.mark.parametrize("away", [0.06, 0.6])
def test_a_body_that_is_held_far_from_its_skin_is_stable(away):
    """The lever turns a light box; the gripper stands still."""
    motion = PointMotion(ARM, at_rest(ARM, (0.0, 0.0, 0.0), (-0.45, -0.9)))
    at = motion.position(*motion.frame())
    box = FreeObject(
        name="box",
        size=(0.1, 0.1, 0.1),
        mass=0.1,
        position=Vec3(at.x, at.y, at.z - away),
    )
    hand = Gripper(name="hand", reach=away, force=1e9, torque=1e9)
    contact = Contact(objects=(box,), grippers=(hand,))
    memory = contact.act(contact.start(0.005, ()), 0.0, 0.005, motion)
    assert float(memory.grips[0].taken) == 1.0

    def there(x):
        return dataclasses.replace(
            memory, carried=(rebuild(memory.carried[0], iter(x.tolist())),)
        )

    def slope(x):
        return np.array(
            leaves(contact.slope(there(x), 0.0, motion, ()).carried[0]), dtype=float
        )

    def euler(x):
        before = contact.before_euler_step(
            there(x), contact.slope(there(x), 0.0, motion, ()), h
        )
        return np.array(
            leaves(
                contact.euler_step(
                    before, contact.slope(before, 0.0, motion, ()), h
                ).carried[0]
            )
        )

    first, h = (
        np.array(leaves(memory.carried[0]), dtype=float),
        float(contact.largest_euler_step),
    )
    assert growth(slope, first, float(contact.largest_step)) < 1.0 + 1e-5
    assert growth(euler, first) < 1.0 + 1e-5


def test_plants_and_sweeps_take_the_steps_of_their_method():
    """A grasp with its critical damping: more than 1 ms of one method, less of the
    other.
    """
    box = FreeObject(name="box", size=(0.06, 0.06, 0.06), mass=0.1)
    contact = Contact(
        objects=(box,), grippers=(Gripper(name="hand", damping_ratio=1.0),)
    )
    around = Surroundings(components=(contact,), memories=(contact.start(0.005, ()),))
    truth = Truth(vehicle=ARM, gravity=9.8)
    ours = {
        name: RigidBodyPlant(truth, around, name).substeps(0.005).near
        for name in ("rk4", "euler")
    }
    largest = {
        "rk4": float(contact.largest_step),
        "euler": float(contact.largest_euler_step),
    }
    assert 0.5e-3 < largest["euler"] < 1e-3 < largest["rk4"]
    assert MujocoPlant(truth, around, "euler").model.opt.timestep == pytest.approx(
        0.5e-3
    )
    verlet = float(contact.largest_verlet_step)
    assert verlet == pytest.approx(0.75 * largest["euler"])
    assert ours == {
        "rk4": math.ceil(0.005 / verlet),
        "euler": 5 * math.ceil(0.001 / largest["euler"]),
    }
    for name, step in largest.items():
        scenario = SimpleNamespace(
            agents={"main": SimpleNamespace(all_drives=())},
            own_components=lambda _: (),
            shared_components=(contact,),
            integrator=name,
        )
        assert stated_step(scenario) == step
        assert _stable_step(contact, {}, {}, name == "euler") == (
            step if name == "euler" else verlet
        ), "the shortest of all"


def test_a_level_door_falls_as_a_uniform_plate():
    """m g w/2 about the hinge by the inertia m (w^2/3 + t^2/12); where a file says that
    inertia, it says com, too.
    """
    numbers = {
        "name": "door",
        "kind": "door",
        "size": (0.8, 2.0, 0.04),
        "mass": 10.0,
        "angles": (math.pi / 2, 0, 0),
    }

    def falls(**more):
        door = Mechanism(**numbers, **more)
        return door.slope(door.start(), REST, REST, 9.81).rate

    assert falls() == pytest.approx(-9.81 * 0.4 / (0.64 / 3.0 + 0.0016 / 12.0))
    assert falls(com=(0.2, 0.0, 0.0)) == pytest.approx(0.5 * falls())
    assert falls(inertia=2.0) == pytest.approx(0.0, abs=1e-12)
