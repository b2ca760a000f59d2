"""The force at the tip is the weighted least squares of the observed disturbance, by
levers that do the same work.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Mat3, Quaternion, Vec3
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.blocks.tip_force import ForceErrors, levers, tip_force
from skyarm.dynamics.kinematics import frame_pose

HUMMINGBIRD = skyarm.load_vehicle("hummingbird_arm2")
HEXAROTOR = skyarm.load_vehicle("hexarotor_arm6")
POSTURES = [
    (HUMMINGBIRD, (-0.45, -0.9)),
    (HEXAROTOR, (0.1, -0.6, -0.97, 0.2, -0.8, 0.3)),
]
ERRORS = ForceErrors(turning=0.01, sliding=0.02, base=0.1)


def tilted(seed):
    q = np.random.default_rng(seed).normal(size=4)
    return Quaternion(*(float(c) for c in q / np.linalg.norm(q))).rotation()


def array(matrix: Mat3):
    return np.array([list(row) for row in matrix.rows])


@pytest.mark.parametrize(("vehicle", "joints"), POSTURES)
def test_levers_do_the_work_of_the_force_at_the_tip(vehicle, joints):
    R, h = tilted(3), 1e-6
    at, force = levers(vehicle, R, joints), Vec3(0.7, -1.1, 0.4)
    d = at.disturbance(force)
    own = array(R).T @ np.array([*force])
    for i in range(vehicle.n):
        moved = [
            np.array(
                [
                    *frame_pose(
                        vehicle,
                        vehicle.frame(),
                        [q + s * h * (j == i) for j, q in enumerate(joints)],
                    ).p
                ]
            )
            for s in (1, -1)
        ]
        assert d.efforts[i] == pytest.approx(
            own @ (moved[0] - moved[1]) / (2.0 * h), abs=1e-8
        )
    assert np.allclose([*d.torque], np.cross([*at.tip], own), atol=1e-12)
    assert d.force == force


@pytest.mark.parametrize(("vehicle", "joints"), POSTURES)
def test_the_force_is_the_least_squares_solution_of_numpy(vehicle, joints):
    rng, R = np.random.default_rng(5), tilted(7)
    at = levers(vehicle, R, joints)
    d = Disturbance(
        force=Vec3(*(float(c) for c in rng.normal(size=3))),
        torque=Vec3(*(float(c) for c in rng.normal(size=3) * 0.1)),
        efforts=tuple(float(c) for c in rng.normal(size=vehicle.n) * 0.1),
    )
    J = np.array([[*column] for column in at.columns])
    x, y, z = at.tip
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rows = np.vstack([J / ERRORS.turning, cross / ERRORS.base, np.eye(3)])
    wanted = [
        *np.array(d.efforts) / ERRORS.turning,
        *np.array([*d.torque]) / ERRORS.base,
        *(array(R).T @ [*d.force]),
    ]
    expected = array(R) @ np.linalg.lstsq(rows, np.array(wanted), rcond=None)[0]
    assert np.allclose([*tip_force(ERRORS, at, d)], expected, rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize(("vehicle", "joints"), POSTURES)
def test_a_push_at_the_tip_is_found_beside_a_bias_and_wind_is_hardly_taken_for_one(
    vehicle, joints
):
    R, force = tilted(11), Vec3(-1.0, 0.3, 0.2)
    at = levers(vehicle, R, joints)
    bias = Disturbance(
        force=Vec3(0.5, 0.1, -2.0),
        torque=Vec3(0.02, 0.1, 0.0),
        efforts=(0.03,) * vehicle.n,
    )
    found = tip_force(ForceErrors(), at, at.disturbance(force) + bias - bias)
    assert np.allclose([*found], [*force], atol=1e-10)
    # 1 N of wind from the front, which no joint feels
    wind = Disturbance(
        force=R.apply(Vec3(1.0, 0.0, 0.0)),
        torque=Vec3(0.0, 0.0, 0.0),
        efforts=(0.0,) * vehicle.n,
    )
    assert R.apply_T(tip_force(ForceErrors(), at, wind)).x < 0.01


def test_a_sliding_joint_tells_by_its_own_length():
    link = HUMMINGBIRD.links[1]
    sliding = dataclasses.replace(
        link, joint=dataclasses.replace(link.joint, kind="prismatic")
    )
    vehicle = dataclasses.replace(HUMMINGBIRD, links=(HUMMINGBIRD.links[0], sliding))
    at = levers(vehicle, Mat3.identity(), (-0.4, 0.0))
    d = Disturbance(
        force=Vec3(0.0, 0.0, 0.0), torque=Vec3(0.0, 0.0, 0.0), efforts=(0.0, 1.0)
    )
    soft, stiff = (tip_force(ForceErrors(sliding=s), at, d) for s in (10.0, 0.01))
    assert np.linalg.norm([*soft]) < 0.1
    assert np.linalg.norm([*stiff]) > 0.5
