"""The belief that a predictive controller moves, and what it wants of it, against Pinocchio and SciPy."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import skyarm
from flown import vec
from law_flights import scalars
from skyarm.algebra import Quaternion
from skyarm.compile import leaves
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.laws.predictive.cost import Goal, Weights, input_residuals, state_residuals
from skyarm.control.laws.predictive.prediction import Inputs, accelerations, advance
from skyarm.control.model import Model
from skyarm.dynamics import State
from vehicles_random import PinocchioTwin, RandomState, random_state, random_vehicle, rotation_matrix

pytest.importorskip("pinocchio")

GRAVITY = 9.81
ROTORS = skyarm.load_vehicle("hummingbird_arm2_rotors").rotors

WEIGHTS = Weights(
    position=2.0,
    velocity=3.0,
    heading=5.0,
    rate=7.0,
    joints=11.0,
    joint_rates=13.0,
    joint_accelerations=17.0,
    tool=19.0,
    rotor_accelerations=23.0,
    final=29.0,
)
"""No two alike, so that the weight of another residual shows."""


def belief(seed, joints=3):
    """Any arm with damped and dry joints under rotors that drag."""
    rng = np.random.default_rng(seed)
    vehicle = random_vehicle(rng, joints=joints)

    def rough(joint):
        damping, coulomb = float(rng.uniform(0.1, 0.5)), float(rng.uniform(0.1, 0.5))
        return dataclasses.replace(joint, damping=damping, coulomb=coulomb, coulomb_rate=0.7)

    links = tuple(dataclasses.replace(link, joint=rough(link.joint)) for link in vehicle.links)
    return Model(vehicle=dataclasses.replace(vehicle, links=links, rotors=ROTORS), gravity=GRAVITY)


def drawn(seed, joints=3):
    rng = np.random.default_rng(seed + 50)
    r = random_state(rng, joints)
    state = State(
        position=vec(r.position),
        quaternion=Quaternion(*r.quaternion.tolist()),
        velocity=vec(r.velocity[:3]),
        rate=vec(r.velocity[3:6]),
        joints=tuple(r.joints.tolist()),
        joint_rates=tuple(r.velocity[6:].tolist()),
        rotor_speeds=tuple(rng.uniform(300.0, 700.0, len(ROTORS)).tolist()),
    )
    efforts = tuple(rng.normal(size=joints).tolist())
    unknown = Disturbance(
        force=vec(rng.normal(size=3)),
        torque=vec(rng.normal(size=3)),
        efforts=tuple(rng.normal(size=joints).tolist()),
    )
    return r, state, efforts, unknown


def rotor_wrench(speeds, v_B, w_B):
    """Force and torque about the base origin, rotor by rotor: thrust, drag torque, hub drag and rolling moment."""
    force, torque = np.zeros(3), np.zeros(3)
    for rotor, speed in zip(ROTORS, speeds, strict=True):
        place, axis = scalars(rotor.position), scalars(rotor.axis)
        wind = v_B + np.cross(w_B, place)
        across = wind - axis * (axis @ wind)
        thrust = float(rotor.thrust_coefficient) * speed**2 * axis
        pull = thrust - float(rotor.drag_coefficient) * speed * across
        torque += np.cross(place, pull) - rotor.direction * float(rotor.moment_coefficient) * thrust
        torque -= float(rotor.rolling_moment_coefficient) * speed * across
        force += pull
    return force, torque


def true_accelerations(model, r, speeds, efforts, unknown, dry_rates=None):
    R = rotation_matrix(r.quaternion)
    force, torque = rotor_wrench(speeds, R.T @ r.velocity[:3], r.velocity[3:6])
    damping = np.array([float(link.joint.damping) for link in model.vehicle.links])
    dry = np.array([float(link.joint.coulomb) for link in model.vehicle.links])
    dry = dry * np.tanh((r.velocity[6:] if dry_rates is None else np.array(dry_rates)) / 0.7)
    pulled = np.array(efforts) - damping * r.velocity[6:] - dry + np.array(unknown.efforts)
    applied = np.concatenate([R @ force + scalars(unknown.force), torque + scalars(unknown.torque), pulled])
    return PinocchioTwin(model.vehicle).forward_dynamics(r, applied)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("dry_rates", [None, (0.4, -0.9, 0.1)])
def test_accelerations_of_the_belief_are_pinocchios_with_drag_friction_and_what_is_unknown(seed, dry_rates):
    model, (r, state, efforts, unknown) = belief(seed), drawn(seed)
    expected = true_accelerations(model, r, state.rotor_speeds, efforts, unknown, dry_rates)
    linear, angular, joints = accelerations(model, state, efforts, unknown, dry_rates)
    scale = 1.0 + np.abs(expected).max()
    np.testing.assert_allclose(scalars(linear), expected[:3], atol=1e-10 * scale)
    np.testing.assert_allclose(scalars(angular), expected[3:6], atol=1e-10 * scale)
    np.testing.assert_allclose(scalars(joints), expected[6:], atol=1e-10 * scale)


def test_the_belief_has_all_that_is_compared():
    assert min(float(rotor.drag_coefficient) for rotor in ROTORS) > 0.0
    assert min(float(link.joint.damping) for link in belief(0).vehicle.links) > 0.1
    assert min(float(link.joint.coulomb) for link in belief(0).vehicle.links) > 0.1


@pytest.mark.parametrize("seed", range(3))
def test_a_step_is_of_fourth_order_to_scipys_solution(seed):
    """Half the step leaves a sixteenth of the error of each, a 32nd of one step's; 20 tells it from third order."""
    model, (_, state, efforts, unknown) = belief(seed), drawn(seed)
    inputs = Inputs(rotor_accelerations=(900.0, -700.0, 500.0, -300.0), efforts=efforts)

    def slope(_t, y):
        q = y[3:7] / np.linalg.norm(y[3:7])
        velocity = np.concatenate([y[7:13], y[16:19]])
        r = RandomState(position=y[:3], quaternion=q, joints=y[13:16], velocity=velocity)
        a = true_accelerations(model, r, y[19:], efforts, unknown)
        w, x, y_, z = y[3:7]
        E = np.array([[-x, -y_, -z], [w, -z, y_], [z, w, -x], [-y_, x, w]])
        return np.concatenate([y[7:10], 0.5 * E @ y[10:13], a[:6], y[16:19], a[6:], inputs.rotor_accelerations])

    start, found = np.array(leaves(state), dtype=float), []
    for h in (4e-3, 2e-3):
        exact = solve_ivp(slope, (0.0, h), start, method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
        exact[3:7] /= np.linalg.norm(exact[3:7])
        found.append(np.abs(np.array(leaves(advance(model, state, inputs, unknown, h))) - exact).max())
    assert found[0] > 20.0 * found[1]
    assert found[0] < 1e-3


def test_after_a_long_step_a_quaternion_is_of_unit_length():
    """Turning at some rad/s for 0.1 s the method alone would leave it 1e-5 long or short."""
    model, (_, state, efforts, unknown) = belief(1), drawn(1)
    after = advance(model, state, Inputs(rotor_accelerations=(0.0,) * 4, efforts=efforts), unknown, 0.1)
    assert np.linalg.norm(scalars(after.quaternion)) == pytest.approx(1.0, abs=1e-14)


def goal_of(seed, joints):
    rng = np.random.default_rng(seed + 90)
    return Goal(
        position=vec(rng.normal(size=3)),
        velocity=vec(rng.normal(size=3)),
        yaw=float(rng.uniform(-3.0, 3.0)),
        joints=tuple(rng.normal(size=joints).tolist()),
        joint_rates=tuple(rng.normal(size=joints).tolist()),
        joint_accelerations=tuple(rng.normal(size=joints).tolist()),
        shift=vec(rng.normal(size=3)),
    )


def plain_residuals(r, goal):
    """Those that are in every mode but for the joints."""
    R = rotation_matrix(r.quaternion)
    nose = R[:, 0]
    side = -np.sin(goal.yaw) * nose[0] + np.cos(goal.yaw) * nose[1]
    return np.concatenate(
        [
            2.0 * (r.position - scalars(goal.position) - scalars(goal.shift)),
            3.0 * (r.velocity[:3] - scalars(goal.velocity)),
            [5.0 * side],
            7.0 * r.velocity[3:6],
        ]
    )


@pytest.mark.parametrize("tip", ["", "tip1"])
@pytest.mark.parametrize("mode", ["tool", "joints"])
@pytest.mark.parametrize("seed", range(5))
def test_what_is_wanted_of_a_state_is_its_errors_and_in_tool_mode_the_tips(seed, mode, tip):
    """With and without a tip: its error is there in mode "tool" of a vehicle that has one, and nowhere else."""
    model = belief(seed)
    vehicle = dataclasses.replace(model.vehicle, end_effector=tip)
    model = dataclasses.replace(model, vehicle=vehicle)
    (r, state, *_), goal = drawn(seed), goal_of(seed, 3)
    found = scalars(state_residuals(model, WEIGHTS, state, goal, mode))
    errors = r.joints - np.array(goal.joints)
    R = rotation_matrix(r.quaternion)
    if mode == "tool":
        up = R.T @ [0.0, 0.0, 1.0]
        for i, link in enumerate(vehicle.links):
            if link.parent == -1 and link.joint.kind == "revolute":
                axis = np.array([scalars(row) for row in link.joint.rotation.rows]) @ scalars(link.joint.axis)
                errors[i] += axis @ [up[1], -up[0], 0.0]
    rates = r.velocity[6:] - np.array(goal.joint_rates)
    expected = [plain_residuals(r, goal), 11.0 * errors, 13.0 * rates]
    if mode == "tool" and tip:
        twin = PinocchioTwin(vehicle)
        half = 0.5 * goal.yaw
        level = RandomState(
            position=scalars(goal.position),
            quaternion=np.array([np.cos(half), 0.0, 0.0, np.sin(half)]),
            joints=np.array(goal.joints),
            velocity=np.zeros(9),
        )
        expected.append(19.0 * (twin.frame(r, tip)[0] - twin.frame(level, tip)[0]))
    np.testing.assert_allclose(found, np.concatenate(expected), atol=1e-11)


def test_the_beliefs_have_joints_of_both_kinds_next_to_the_base():
    kinds = {link.joint.kind for seed in range(5) for link in belief(seed).vehicle.links if link.parent == -1}
    assert kinds == {"revolute", "prismatic"}
    assert any(link.parent != -1 for seed in range(5) for link in belief(seed).vehicle.links)


@pytest.mark.parametrize("seed", range(4))
def test_what_is_wanted_of_inputs_is_the_joints_accelerations_and_slow_rotors(seed):
    model, (r, state, efforts, unknown), goal = belief(seed), drawn(seed), goal_of(seed, 3)
    inputs = Inputs(rotor_accelerations=(9.0, -7.0, 5.0, -3.0), efforts=efforts)
    found = scalars(input_residuals(model, WEIGHTS, state, inputs, unknown, goal))
    # a plan takes dry friction at the rates that are wanted
    qdd = true_accelerations(model, r, state.rotor_speeds, efforts, unknown, goal.joint_rates)[6:]
    expected = [*(17.0 * (qdd - np.array(goal.joint_accelerations))), *(23.0 * np.array([9.0, -7.0, 5.0, -3.0]))]
    np.testing.assert_allclose(found, expected, atol=1e-8 * (1.0 + np.abs(qdd).max()))
