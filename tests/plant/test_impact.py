"""Grasps and joints that get stuck: momentum is kept, energy is lost, and MuJoCo's mass
matrix says the same.
"""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
import pytest

from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics.state import State
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.interface import Truth, flat
from skyarm.plant.loads import loaded_vehicle
from skyarm.plant.mujoco import MujocoPlant
from skyarm.plant.mujoco_model import build_spec, joint_addresses
from skyarm.plant.surroundings import Surroundings
from skyarm.vehicle.attach import Mimic, couple
from skyarm.vehicle.linkage import Body, Joint, Link
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.vehicle.vehicle_records import BodyDrag, Frame
from skyarm.world import Effectiveness, PayloadMemory, TimedPayload

LOADS = (
    TimedPayload(mass=0.3, inertia=[1e-3, 2e-3, 2.5e-3], com=[0.03, -0.02, -0.05]),
    TimedPayload(
        mass=0.1, inertia=[4e-3, 2e-3, 3e-3], com=[0.0, 0.05, 0.02], frame="hook"
    ),
)


@pytest.fixture(scope="module")
def vehicle():
    found = load_vehicle("hexarotor_arm6")
    turned = Quaternion(0.8, 0.36, 0.48, 0.0).rotation()
    return dataclasses.replace(
        found,
        frames=(
            *found.frames,
            Frame(
                name="hook", link=-1, position=Vec3(0.1, 0.05, -0.1), rotation=turned
            ),
        ),
    )


def moving(vehicle, seed=3):
    rng = np.random.default_rng(seed)
    q = rng.normal(size=4)
    return State(
        position=Vec3(*rng.normal(size=3)),
        quaternion=Quaternion(*(q / np.linalg.norm(q))),
        velocity=Vec3(*rng.normal(size=3)),
        rate=Vec3(*rng.normal(size=3)),
        joints=tuple(rng.uniform(-0.5, 0.5, vehicle.n)),
        joint_rates=tuple(rng.normal(size=vehicle.n)),
        rotor_speeds=(400.0,) * len(vehicle.rotors),
    )


def around(caught=(0.0, 0.0), held=(1.0, 1.0), stuck=None, n=6, rotors=6):
    memories = tuple(
        PayloadMemory(held=h, caught=c, gone=0.0, place=Vec3(0.0, 0.0, 0.0))
        for h, c in zip(held, caught, strict=True)
    )
    left = None if stuck is None else Effectiveness((1,) * rotors, (1,) * n, stuck)
    return Surroundings(components=LOADS, memories=memories, effectiveness=left)


def flat_of(record):
    from skyarm.records.leaves import leaves

    return tuple(map(float, leaves(record)))


def in_mujoco(vehicle, state):
    """(linear momentum, angular momentum about the world's origin, kinetic energy) of a
    vehicle as MuJoCo has it.
    """
    model = build_spec(vehicle, 9.81).compile()
    data = mujoco.MjData(model)
    q, v = joint_addresses(vehicle, model)
    data.qpos[:7], data.qpos[q] = (*state.position, *state.quaternion), state.joints
    data.qvel[:6], data.qvel[v] = (*state.velocity, *state.rate), state.joint_rates
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    mujoco.mj_energyVel(model, data)
    linear = model.body_subtreemass[1] * data.subtree_linvel[1]
    return (
        linear,
        data.subtree_angmom[1] + np.cross(data.subtree_com[1], linear),
        data.energy[1],
    )


def after(plant, state, told):
    found = np.array(plant.after_impact(flat(state), flat_of(told)))
    n = len(state.joints)
    return dataclasses.replace(
        state,
        velocity=Vec3(*found[7:10]),
        rate=Vec3(*found[10:13]),
        joint_rates=tuple(found[13 + n : 13 + 2 * n]),
    )


@pytest.mark.parametrize("kind", [RigidBodyPlant, MujocoPlant])
def test_a_load_at_rest_that_is_grasped_keeps_the_momentum_of_the_whole(vehicle, kind):
    told, state = around(caught=(1.0, 1.0)), moving(vehicle)
    later = after(kind(Truth(vehicle=vehicle), told), state, told)
    whole = vehicle
    for load in LOADS:
        whole = whole.with_body(*load.body(vehicle))
    before, behind = in_mujoco(vehicle, state), in_mujoco(whole, later)
    assert np.allclose(behind[0], before[0], rtol=0, atol=1e-10)
    assert np.allclose(behind[1], before[1], rtol=0, atol=1e-10)
    assert behind[2] < 0.98 * before[2]


@pytest.mark.parametrize("caught", [(1.0, 0.0), (0.0, 1.0), (0.0, 0.0)])
def test_both_plants_find_the_same_velocities(vehicle, caught):
    told, state = around(caught=caught, stuck=(0, 0.0, 1.0, 0, 1.0, 0)), moving(vehicle)
    ours, theirs = (
        after(kind(Truth(vehicle=vehicle), told), state, told)
        for kind in (RigidBodyPlant, MujocoPlant)
    )
    assert np.allclose(flat(ours), flat(theirs), rtol=0, atol=1e-9)
    assert np.abs(np.array(ours.joint_rates)[[2, 4]]).max() < 1e-11
    assert (
        np.abs(
            np.array(ours.joint_rates)[[0, 1, 3, 5]]
            - np.array(state.joint_rates)[[0, 1, 3, 5]]
        ).max()
        > 1e-2
    )
    linear, angular, energy = in_mujoco(loaded_vehicle(vehicle, around()), state)
    if caught == (0.0, 0.0):  # the brakes are inside: momentum stays, energy does not
        found = in_mujoco(loaded_vehicle(vehicle, around()), ours)
        assert np.allclose(found[0], linear, rtol=0, atol=1e-10)
        assert np.allclose(found[1], angular, rtol=0, atol=1e-10)
        assert found[2] < energy


def test_nothing_that_is_grasped_changes_nothing(vehicle):
    told, state = around(), moving(vehicle)
    for kind in (RigidBodyPlant, MujocoPlant):
        assert after(kind(Truth(vehicle=vehicle), told), state, told) == state


def test_mujoco_carries_what_a_model_with_the_load_in_it_carries(vehicle):
    """The bodies that get a mass move as a model that was made with it, and as ours;
    without mass as if not there.
    """
    state = moving(vehicle)
    command = (450.0,) * 6 + (0.1,) * 6
    plants = [
        kind(Truth(vehicle=vehicle), around(), "rk4_staged", 0.001)
        for kind in (MujocoPlant, RigidBodyPlant)
    ]
    for held in ((1.0, 1.0), (0.0, 1.0), (0.0, 0.0)):
        told = around(held=held)
        made = vehicle
        for load, share in zip(LOADS, held, strict=True):
            made = made.with_body(*load.body(vehicle)) if share else made
        alone = MujocoPlant(Truth(vehicle=made), Surroundings(), "rk4_staged")
        wanted = alone.advance(flat(state), command, (0.0,), 0.001)
        for plant in plants:
            found = plant.advance(flat(state), command, flat_of(told), 0.001)
            assert np.allclose(found, wanted, rtol=0, atol=1e-9)
            assert plant.specific_force(
                flat(state), command, flat_of(told)
            ) == pytest.approx(
                alone.specific_force(flat(state), command, (0.0,)), abs=1e-9
            )


def test_a_stuck_joint_moves_as_a_weld(vehicle):
    """Of a MuJoCo model from which the joint was deleted, with the link where the joint
    was.
    """
    told, state = around(held=(0.0, 0.0), stuck=(0, 0, 1.0, 0, 0, 0)), moving(vehicle)
    state = dataclasses.replace(
        state,
        joint_rates=tuple(
            0.0 if i == 2 else r for i, r in enumerate(state.joint_rates)
        ),
    )
    still = dataclasses.replace(state, rotor_speeds=(0.0,) * 6)
    spec = build_spec(vehicle, 9.81)
    link = vehicle.links[2]
    body, turned = spec.body(link.name), np.zeros(4)
    axis = np.zeros(4)
    mujoco.mju_axisAngle2Quat(
        axis, np.array([float(c) for c in link.joint.axis]), state.joints[2]
    )
    mujoco.mju_mulQuat(turned, body.quat, axis)
    body.quat = turned
    spec.delete(spec.joint(link.joint.name))
    model = spec.compile()
    data = mujoco.MjData(model)
    rest = [each.joint.name for i, each in enumerate(vehicle.links) if i != 2]
    data.qpos[:7], data.qvel[:6] = (
        (*still.position, *still.quaternion),
        (
            *still.velocity,
            *still.rate,
        ),
    )
    keep = [i for i in range(6) if i != 2]
    for name, i in zip(rest, keep, strict=True):
        (
            data.qpos[model.joint(name).qposadr[0]],
            data.qvel[model.joint(name).dofadr[0]],
        ) = (
            still.joints[i],
            still.joint_rates[i],
        )
    mujoco.mj_forward(model, data)
    free = vehicle.with_joints(damping=0, coulomb=0)
    bare = tuple(
        dataclasses.replace(r, drag_coefficient=0, rolling_moment_coefficient=0)
        for r in free.rotors
    )
    free = dataclasses.replace(free, drag=BodyDrag(), rotors=bare)
    for kind in (RigidBodyPlant, MujocoPlant):
        plant = kind(Truth(vehicle=free), told, "euler", 1e-5)
        found = np.array(plant.advance(flat(still), (0.0,) * 12, flat_of(told), 1e-5))
        start = np.array(flat(still))
        slope = (found - start) / 1e-5
        assert abs(slope[13 + 6 + 2]) < 1e-6
        assert np.allclose(slope[7:13], data.qacc[:6], rtol=1e-6, atol=1e-5)
        theirs = [data.qacc[model.joint(name).dofadr[0]] for name in rest]
        assert np.allclose(slope[[19 + i for i in keep]], theirs, rtol=1e-6, atol=1e-5)


def test_a_load_on_a_link_that_follows_moves_both_plants_alike():
    """A finger that follows joint 2 holds one load, the base the other; joint 1 is
    stuck.
    """
    truth = load_vehicle("hummingbird_arm2_rotors")
    joint = Joint(name="finger", axis=Vec3(1, 0, 0), position=Vec3(0.02, 0.0, -0.1))
    finger = Link(
        name="finger",
        parent=1,
        joint=joint,
        body=Body(mass=0.02, com=[0, 0, -0.03], inertia=[1e-5] * 3),
    )
    frames = (
        *truth.frames,
        Frame(name="hook", link=2, position=Vec3(0.0, 0.01, -0.05)),
    )
    links, followers, frames = couple(
        [*truth.links, finger], frames, {"finger": Mimic("joint2", ratio=-0.5)}
    )
    vehicle = dataclasses.replace(
        truth, links=links, followers=followers, frames=frames
    )
    assert vehicle.frame("hook").link >= vehicle.n
    state = moving(vehicle)
    told = around(caught=(0.0, 1.0), stuck=(1.0, 0), n=2, rotors=4)
    plants = [
        kind(Truth(vehicle=vehicle), told, "rk4_staged", 0.001)
        for kind in (RigidBodyPlant, MujocoPlant)
    ]
    ours, theirs = (after(plant, state, told) for plant in plants)
    assert np.allclose(flat(ours), flat(theirs), rtol=0, atol=1e-9)
    assert abs(ours.joint_rates[0]) < 1e-11
    assert np.abs(np.array(flat(ours)) - flat(state)).max() > 1e-2
    flown = [
        plant.advance(flat(ours), (450.0,) * 4 + (0.05,) * 2, flat_of(told), 0.001)
        for plant in plants
    ]
    assert np.allclose(*flown, rtol=0, atol=1e-8)
