"""Joint friction that is fast against the integration step."""

import dataclasses

import numpy as np
import pytest

from skyarm.compile import leaves
from skyarm.environment import WindSample
from skyarm.plant.compiled import RigidBodyPlant, example_command
from skyarm.plant.interface import World, flat
from skyarm.plant.mujoco import MujocoPlant
from skyarm.plant.stiffness import friction_rate
from skyarm.simulate.scenario import trimmed_state
from skyarm.vehicle import VehicleError
from skyarm.vehicle.files import load_vehicle

TRUTH = load_vehicle("hummingbird_arm2_rotors")


def flown(plant, vehicle, dt, seconds=0.2):
    start = trimmed_state(World(vehicle=vehicle), (0.0, 0.0, 10.0), 0.0, (0.4, -0.3))
    x, command = flat(start), [*start.rotor_speeds, 0.02, -0.01]
    assert len(command) == len(leaves(example_command(2, 4)))
    for _ in range(round(seconds / dt)):
        x = plant.advance(x, command, (), dt)
    return np.array(x)


def test_the_decay_rate_is_that_of_one_joint_on_a_heavy_base():
    first = TRUTH.links[0]
    alone = dataclasses.replace(
        TRUTH,
        base=dataclasses.replace(TRUTH.base, mass=1e6, inertia=(1e6, 1e6, 1e6)),
        links=(dataclasses.replace(first, joint=dataclasses.replace(first.joint, damping=0.03)),),
        frames=(),
        end_effector="",
    )
    # a rod of 40 g and 0.15 m about its end: m L^2 / 3
    assert friction_rate(alone) == pytest.approx(0.03 / (0.04 * 0.15**2 / 3.0), rel=1e-6)


def test_without_friction_there_is_no_rate():
    assert friction_rate(TRUTH.with_joints(damping=0)) == 0.0


@pytest.mark.parametrize("damping", [0.001, 0.02, 0.05])
def test_one_control_period_per_call_is_as_good_as_many_small_steps(damping):
    vehicle = TRUTH.with_joints(damping=damping)
    world = World(vehicle=vehicle)
    coarse = flown(RigidBodyPlant(world, WindSample()), vehicle, 0.005)
    fine = flown(RigidBodyPlant(world, WindSample()), vehicle, 0.00025)
    # 6e-4 of a mode that has decayed to a few thousandths of its start
    assert np.abs(coarse - fine)[:17].max() < 2e-5


def test_mujoco_holds_stiff_friction_for_short_steps_only():
    vehicle = TRUTH.with_joints(damping=0.05)
    world = World(vehicle=vehicle)
    ours = flown(RigidBodyPlant(world, WindSample()), vehicle, 0.005)
    theirs = flown(MujocoPlant(world, WindSample()), vehicle, 0.005)
    # first order in rate * step = 0.1, on angles of a tenth of a radian
    assert np.abs(ours - theirs)[13:15].max() < 2e-3


def test_friction_beyond_any_explicit_integrator_is_refused_by_vehicle():
    sticky = TRUTH.with_joints(coulomb=0.1, coulomb_rate=1e-4)
    with pytest.raises(VehicleError, match=r"joint friction decays at .* raise coulomb_rate"):
        RigidBodyPlant(World(vehicle=sticky), WindSample())
