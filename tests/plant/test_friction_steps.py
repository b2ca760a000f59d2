"""Joint friction far stiffer than an explicit step bears, on a wheel of its own axis:
closed forms, both plants.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from skyarm.algebra import Sym3, Vec3
from skyarm.compile.tracing.program import trace_loop
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.state import example_state
from skyarm.plant.compiled import RigidBodyPlant, hold
from skyarm.plant.interface import Truth, flat
from skyarm.plant.largest_step import VERLET_FRICTION_STEP
from skyarm.plant.mujoco import MujocoPlant
from skyarm.plant.rigid_body import coupled_rk4, coupled_verlet
from skyarm.plant.surroundings import Together
from skyarm.records.leaves import leaves
from skyarm.vehicle import BASE, Body, Joint, Link, Vehicle
from support.vehicles import HOVER, hummingbird_arm, steady_wind, tumbling

INERTIA, STEP, SPUN = 2e-4, 1e-3, 10.0
AIR = steady_wind()


def wheel(**friction):
    """A wheel about its own axis on a base so heavy that it stays."""
    body = Body(mass=0.2, inertia=Sym3(INERTIA, INERTIA, INERTIA))
    joint = Joint(name="j", axis=Vec3(0, 0, 1), effort_limit=1.0, **friction)
    heavy = Body(mass=1e6, inertia=Sym3(1e6, 1e6, 1e6))
    vehicle = Vehicle(
        name="wheel",
        base=heavy,
        links=(Link(name="l", parent=BASE, body=body, joint=joint),),
    )
    return Truth(vehicle=vehicle, gravity=0.0)


def rates(made, step=STEP, effort=0.0, steps=50, **friction):
    """Rates (rad/s) of the wheel after each step, from 10 rad/s."""
    plant = made(wheel(**friction), AIR, "euler", physics_step=step)
    x = flat(replace(example_state(1, 0), joint_rates=(SPUN,)))
    found = []
    for _ in range(steps):
        x = plant.advance(x, (effort,), leaves(AIR), step)
        found.append(x[-1])
    return np.array(found)


@pytest.mark.parametrize("made", [RigidBodyPlant, MujocoPlant])
@pytest.mark.parametrize("decay", [0.1, 2.5, 9.9])
def test_a_damped_wheel_slows_down_by_implicit_euler_at_any_rate(made, decay):
    found = rates(made, damping=decay * INERTIA / STEP)
    assert found == pytest.approx(
        SPUN * (1.0 + decay) ** -np.arange(1.0, 51.0), rel=1e-6, abs=1e-7
    )


@pytest.mark.parametrize("made", [RigidBodyPlant, MujocoPlant])
def test_dry_friction_stops_a_wheel_and_never_turns_it_round(made):
    found = rates(made, coulomb=0.05, coulomb_rate=0.03)
    assert (found > -1e-9).all()
    assert (np.diff(found) < 1e-9).all()
    assert found[-1] < 1e-6
    # c / I is 250 rad/s^2, and the method lags by the sum of 0.25^2 / rate
    assert found[:30] == pytest.approx(
        SPUN - 0.25 * np.arange(1.0, 31.0), abs=0.25 * math.log(4.0)
    )


@pytest.mark.parametrize("made", [RigidBodyPlant, MujocoPlant])
def test_a_drive_below_dry_friction_creeps_as_the_law_says(made):
    found = rates(made, effort=0.025, steps=200, coulomb=0.05, coulomb_rate=0.03)
    assert found[-1] == pytest.approx(0.03 * math.atanh(0.5), rel=1e-5)


def test_friction_of_a_verlet_step_is_of_second_order():
    world, start = (
        wheel(damping=250.0 * INERTIA),
        replace(example_state(1, 0), joint_rates=(SPUN,)),
    )
    errors = []
    for steps in (1, 2, 4):
        states = (start,)
        for _ in range(steps):
            step = VERLET_FRICTION_STEP / 250.0 / steps
            states, _ = coupled_verlet(
                (world,),
                states,
                (Command(rotor_speeds=(), efforts=(0.0,)),),
                Together((AIR,)),
                step,
            )
        errors.append(
            abs(states[0].joint_rates[0] / SPUN - math.exp(-VERLET_FRICTION_STEP))
        )
    assert 0.005 < errors[0] < 0.01
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.15)


def test_steps_that_halve_halve_the_error():
    errors = []
    for halved in (1, 2, 4, 8):
        found = rates(RigidBodyPlant, STEP / halved, steps=4 * halved, damping=0.05)
        errors.append(abs(found[-1] - SPUN * math.exp(-0.05 * 4 * STEP / INERTIA)))
    assert np.log2(errors[-2] / errors[-1]) == pytest.approx(1.0, abs=0.1)


def arm(damping):
    return hummingbird_arm().with_joints(damping=damping)


@pytest.mark.parametrize("hit", [1, 3])
@pytest.mark.parametrize("damping", [1e-4, 8e-3, 0.05])
def test_a_flight_takes_the_steps_of_its_own_friction_beside_a_stiffer_one(
    damping, hit, monkeypatch
):
    """A program made for the stiffest flight of a sweep: each takes as many steps as
    alone, at most twice as many.

    In a hit it takes as many times more as alone.
    """
    monkeypatch.setattr(Together, "hurry", lambda *_: ((), float(hit)))
    around, command, period = (
        Together((AIR,)),
        Command(rotor_speeds=(HOVER,) * 4, efforts=(0.01, -0.02)),
        0.005,
    )
    plants = [
        RigidBodyPlant(Truth(vehicle=arm(each), gravity=9.8), AIR)
        for each in (damping, 0.05)
    ]
    own, count = (each.substeps(period)._replace(most=hit) for each in plants)
    start, world = tumbling(arm(damping)), Truth(vehicle=arm(damping), gravity=9.8)

    def interval(_, __, given, ___):
        worlds = (Truth(vehicle=arm(given), gravity=9.8),)
        return (), hold(
            worlds, "rk4", count, ((start,), ()), (command,), around, period
        )

    together = np.array(
        trace_loop(interval, (), (), damping, loops=True).stepper()((damping,))
    )
    found = []
    for steps in range(1, hit * count.near + 1):
        states = (start,)
        for _ in range(steps):
            states, _ = coupled_rk4(
                (world,), states, (command,), around, period / steps
            )
        found += [steps] if np.abs(together - leaves(states)).max() < 1e-13 else []
    assert len(found) == 1, "another number of steps is seen"
    assert hit * own.near <= found[0] <= 2 * hit * own.near
    assert count.near > 4
    assert (found[0] == hit * count.near) is (damping == 0.05)
