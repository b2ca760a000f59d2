"""Points of a vehicle, how fast they move, and what a wrench there means for base and
joints: J v and J^T w.
"""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics import State
from skyarm.dynamics.point_motion import PointMotion
from support.vehicles import TWINS, random_state, random_vehicle

TOLERANCE = 1e-11
"""Relative to the largest entry: products of up to six rotations."""


@pytest.fixture(params=sorted(TWINS))
def twin_of(request):
    pytest.importorskip(request.param)
    return TWINS[request.param]


def record(state):
    position, quaternion, joints, velocity = state.all
    return State(
        position=Vec3(*position.tolist()),
        quaternion=Quaternion(*quaternion.tolist()),
        velocity=Vec3(*velocity[:3].tolist()),
        rate=Vec3(*velocity[3:6].tolist()),
        joints=tuple(joints.tolist()),
        joint_rates=tuple(velocity[6:].tolist()),
        rotor_speeds=(),
    )


def close(ours, theirs):
    ours, theirs = np.array([float(c) for c in ours]), np.asarray(theirs)
    assert ours.shape == theirs.shape
    assert np.abs(ours - theirs).max(initial=0.0) <= TOLERANCE * max(
        1.0, np.abs(theirs).max(initial=0.0)
    )


CASES = [(n, seed) for n in (0, 1, 2, 4, 6) for seed in range(3)]


@pytest.mark.parametrize(("n", "seed"), CASES)
def test_points_are_and_move_as_the_oracles_frames(n, seed, twin_of):
    rng = np.random.default_rng([77, n, seed])
    vehicle = random_vehicle(rng, n)
    twin, state = twin_of(vehicle), random_state(rng, n)
    motion = PointMotion(vehicle, record(state))
    for frame in vehicle.frames:
        position, _, jacobian = twin.frame(state, frame.name)
        point, body = motion.frame(frame.name)
        close(motion.position(point, body), position)
        close(motion.velocity(point, body), jacobian[:3] @ state.velocity)


@pytest.mark.parametrize(("n", "seed"), CASES)
def test_a_wrench_on_a_body_is_what_the_transposed_jacobian_makes_of_it(
    n, seed, twin_of
):
    rng = np.random.default_rng([78, n, seed])
    vehicle = random_vehicle(rng, n)
    twin, state = twin_of(vehicle), random_state(rng, n)
    motion = PointMotion(vehicle, record(state))
    for frame in vehicle.frames:
        wrench = 5.0 * rng.normal(size=6)
        force, torque = Vec3(*wrench[:3].tolist()), Vec3(*wrench[3:].tolist())
        total, efforts = motion.generalized_force(
            force, torque, frame.position, frame.link
        )
        _, _, jacobian = twin.frame(state, frame.name)
        # our generalized force: on the base in world axes, about its origin in base
        # axes, along the joints
        ours = [*motion.rotation.apply(total.force), *total.torque, *efforts]
        close(ours, jacobian.T @ wrench)


@pytest.mark.parametrize("seed", range(5))
def test_a_force_does_the_work_that_its_generalized_force_does(seed):
    rng = np.random.default_rng([79, seed])
    vehicle = random_vehicle(rng, 4)
    state = record(random_state(rng, 4))
    motion = PointMotion(vehicle, state)
    for body in range(-1, 4):
        force, point = (
            Vec3(*rng.normal(size=3).tolist()),
            Vec3(*rng.normal(size=3).tolist()),
        )
        total, efforts = motion.generalized_force(
            force, Vec3(0.0, 0.0, 0.0), point, body
        )
        there = force.dot(motion.velocity(point, body))
        velocity_B = motion.rotation.apply_T(state.velocity)
        work = total.force.dot(velocity_B) + total.torque.dot(state.rate)
        work += sum(
            float(u) * qd for u, qd in zip(efforts, state.joint_rates, strict=True)
        )
        assert work == pytest.approx(there, rel=1e-12, abs=1e-12)


def test_a_point_moves_as_its_position_does():
    """Against differences of positions along the motion: nothing but positions is
    asked.
    """
    rng = np.random.default_rng(80)
    vehicle = random_vehicle(rng, 3)
    state = record(random_state(rng, 3))
    dt = 1e-6

    def moved(side):
        step = side * dt
        return State(
            position=state.position + state.velocity * step,
            quaternion=state.quaternion
            * Quaternion.of_rotation_vector(state.rate * step),
            velocity=state.velocity,
            rate=state.rate,
            joints=tuple(
                q + qd * step
                for q, qd in zip(state.joints, state.joint_rates, strict=True)
            ),
            joint_rates=state.joint_rates,
            rotor_speeds=(),
        )

    ahead, behind = PointMotion(vehicle, moved(1.0)), PointMotion(vehicle, moved(-1.0))
    point = Vec3(0.1, -0.3, 0.2)
    for body in range(-1, 3):
        slope = (ahead.position(point, body) - behind.position(point, body)) * (
            0.5 / dt
        )
        found = PointMotion(vehicle, state).velocity(point, body)
        # rounding of positions of about 1 m over 2e-6 s
        assert list(found) == pytest.approx(list(slope), abs=2e-8)
