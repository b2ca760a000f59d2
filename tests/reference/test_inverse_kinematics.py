"""Inverse kinematics against SciPy's least squares, and what redundancy, limits and
singularities do.
"""

import dataclasses
import math

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Mat3, Vec3
from skyarm.dynamics.array_front import frame_pose_world
from skyarm.reference.tip_plan import (
    TipChoices,
    follow,
    rotation_vector,
    solve_pose,
    task_of,
)
from support.cases import sampled

ARM2, ARM6 = (
    skyarm.load_vehicle(name) for name in ("hummingbird_arm2_rotors", "hexarotor_arm6")
)
POSTURE = (0.1, 0.6, -1.0, 0.2, 0.5, 0.1)
TASK2 = task_of(ARM2, (0, 1), TipChoices(posture=(0.4, -0.8)))
TASK6 = task_of(ARM6, tuple(range(6)), TipChoices(posture=POSTURE))


def tip(vehicle, q):
    p, R = frame_pose_world(
        vehicle, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.array(q)
    )
    return np.asarray(p), np.asarray(R)


def solve(task, position=None, orientation=None, start=None):
    goal = None if position is None else Vec3(*map(float, position))
    turn = (
        None
        if orientation is None
        else Mat3.columns(*(Vec3(*map(float, c)) for c in orientation.T))
    )
    return np.array(
        solve_pose(task, goal, turn, start or task.posture, task.lower, task.upper)
    )


def test_a_reachable_pose_is_reached():
    wanted = np.add(POSTURE, [0.3, -0.2, 0.25, -0.3, 0.2, 0.4])
    p, R = tip(ARM6, wanted)
    found = solve(TASK6, p, R)
    at, turned = tip(ARM6, found)
    # the posture pulls where the wrist is nearly singular
    np.testing.assert_allclose(at, p, atol=2e-5)
    np.testing.assert_allclose(turned, R, atol=1e-4)


def test_the_redundant_joints_are_nearest_to_the_posture():
    p, _ = tip(ARM6, np.add(POSTURE, [0.3, -0.2, 0.25, 0.0, 0.0, 0.0]))
    found = solve(TASK6, p)
    np.testing.assert_allclose(tip(ARM6, found)[0], p, atol=1e-6)

    def away(q):
        return np.concatenate([1e4 * (tip(ARM6, q)[0] - p), q - np.array(POSTURE)])

    best = least_squares(away, found + 0.05, xtol=1e-14, ftol=1e-14, gtol=1e-12)
    assert np.linalg.norm(found - POSTURE) == pytest.approx(
        np.linalg.norm(best.x - POSTURE), rel=1e-3
    )


def test_what_is_out_of_reach_is_approached_and_the_step_stays_calm():
    start = [0.4, -0.8]
    found = solve(TASK2, (0.5, 0.0, -0.5))
    direction = tip(ARM2, found)[0] / 0.3
    np.testing.assert_allclose(
        direction, np.array([1.0, 0.0, -1.0]) / math.sqrt(2.0), atol=2e-3
    )
    for _ in range(20):  # stretched: singular
        start = list(
            solve_pose(
                TASK2, Vec3(0.5, 0.0, -0.5), None, start, TASK2.lower, TASK2.upper, 1
            )
        )
        assert np.isfinite(start).all()


def test_limits_hold_and_the_other_joints_do_what_is_left():
    held = dataclasses.replace(TASK6, upper=(3.0, 0.61, 2.4, 3.0, 2.0, 3.0))
    p, _ = tip(ARM6, np.add(POSTURE, [0.0, 0.4, 0.1, 0.0, 0.0, 0.0]))
    assert solve(TASK6, p)[1] > 0.61
    found = solve(held, p)
    assert (found <= np.array(held.upper)).all()
    assert (found >= np.array(held.lower)).all()
    np.testing.assert_allclose(tip(ARM6, found)[0], p, atol=1e-5)


def test_no_joint_moves_faster_than_it_may_from_instant_to_instant():
    slow = dataclasses.replace(TASK2, rates=(0.5, 0.5))
    path = [Vec3(0.05, 0.0, -0.25)] * 3 + [Vec3(-0.1, 0.0, -0.2)] * 30
    steps = np.diff(follow(slow, path, None, 0.1), axis=0)
    assert np.abs(steps).max() == pytest.approx(0.05, rel=1e-9)
    np.testing.assert_allclose(
        tip(ARM2, follow(slow, path, None, 0.1)[-1])[0], [-0.1, 0.0, -0.2], atol=1e-5
    )


def test_the_rotation_vector_is_scipys():
    for vector in (
        [0.3, -0.2, 0.5],
        [0.0, 0.0, 1e-8],
        [3.0, 0.5, -0.2],
        [math.pi, 0.0, 0.0],
        [0.0, 0.0, 0.0],
    ):
        R = Rotation.from_rotvec(vector).as_matrix()
        found = rotation_vector(Mat3.columns(*(Vec3(*map(float, c)) for c in R.T)))
        np.testing.assert_allclose(
            Rotation.from_rotvec([*found]).as_matrix(), R, atol=1e-12
        )


@pytest.mark.parametrize(
    ("beside", "exact"),
    sampled([(0.1, True), (0.0, False), (0.0, True), (0.1, False)], 2),
)
def test_a_goal_of_even_motion_moves_joints_evenly_to_the_stretched_arm_and_beyond(
    beside, exact
):
    """A planar arm cannot follow sideways, and a stretched one no further: neither may
    make it chatter.
    """
    task = dataclasses.replace(
        task_of(ARM2, (0, 1), TipChoices(posture=(0.3, -0.6)), exact=exact),
        rates=(2.0, 2.0),
    )
    path = [
        Vec3(0.02 + 0.001 * k, beside * k / 60, -0.27 - 0.001 * k) for k in range(60)
    ]
    joints = np.array(follow(task, path, None, 0.1))
    steps = np.diff(joints, axis=0)[3:]
    turns = np.sum(
        np.diff(np.sign(np.where(np.abs(steps) < 1e-6, 0.0, steps)), axis=0) != 0.0,
        axis=0,
    )
    assert turns.max() <= 3, steps
    assert np.abs(np.diff(steps, axis=0)).max() < 0.2
    still = np.array(follow(task, [path[-1]] * 12, None, 0.1))
    np.testing.assert_allclose(still[-4:], still[-5:-1], atol=1e-5)


def test_a_tip_in_the_world_asks_for_no_violent_arm():
    """Sideways motion of a planar arm, most of it the base's: joint accelerations stay
    those of the path.
    """
    from skyarm.reference import Constant
    from skyarm.reference.signals import Ramp
    from skyarm.reference.tip_motion import TipMotion, arm_of
    from skyarm.reference.tip_plan import plan

    choices = TipChoices(posture=(0.3, -0.6), base_share=0.8, arm_range=0.08)
    path = TipMotion(
        arm=arm_of(ARM2),
        x=Ramp(start=1.0, duration=2.0, height=0.6, shape="quintic"),
        y=Ramp(start=1.0, duration=2.0, height=0.2, shape="quintic"),
        z=Constant(1.0),
    )
    joints = plan(ARM2, path, Constant(0.0), choices, 5.0)
    times = np.arange(0.0, 5.0, 0.02)
    fastest = [
        max(abs(float(joint.derivatives(float(t))[2])) for t in times)
        for joint in joints
    ]
    assert max(fastest) < 12.0, fastest
    late = [[float(joint.derivatives(t)[2]) for t in (4.0, 4.5)] for joint in joints]
    np.testing.assert_allclose(late, 0.0, atol=0.05)
