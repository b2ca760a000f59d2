"""Gains of the tip's task go with the arm of the vehicle."""

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.control.laws.centroidal.make import make_centroidal
from skyarm.control.laws.centroidal.options import arm_length, tip_lightness
from skyarm.control.model import Model
from skyarm.dynamics.kinematics import frame_pose, link_poses
from skyarm.dynamics.workspace import reach


def damping(vehicle, **options):
    return make_centroidal(
        Model(vehicle=vehicle), mode="tip", **options
    ).par.tip.damping


@pytest.mark.parametrize("name", ["crazyflie_arm1", "pelican_arm2", "hexarotor_arm6"])
def test_the_length_of_an_arm_that_is_straight_at_zero_is_how_far_it_reaches(name):
    """Of arms whose first joint sits at the base's origin, against a search over all
    postures.
    """
    assert arm_length(skyarm.load_vehicle(name)) == pytest.approx(
        reach(skyarm.load_vehicle(name)), rel=1e-6
    )


def test_where_the_first_joint_sits_does_not_count_and_an_arm_of_no_length_is_flown():
    vehicle = skyarm.load_vehicle("crazyflie_arm1")
    (link,), (tip,) = (
        vehicle.links,
        [each for each in vehicle.frames if each.name == vehicle.end_effector],
    )
    moved = dataclasses.replace(
        link, joint=dataclasses.replace(link.joint, position=(0.5, 0.0, 0.0))
    )
    assert arm_length(dataclasses.replace(vehicle, links=(moved,))) == arm_length(
        vehicle
    )
    none = dataclasses.replace(
        vehicle, frames=(dataclasses.replace(tip, position=(0.0, 0.0, 0.0)),)
    )
    assert (arm_length(none), damping(none) > 0.0) == (0.0, True)


def test_damping_goes_with_the_root_of_the_arms_length_and_a_given_number_is_kept():
    paper, small = (
        skyarm.load_vehicle("hummingbird_arm2"),
        skyarm.load_vehicle("crazyflie_arm1"),
    )
    assert damping(paper) == 0.03
    assert damping(small) == pytest.approx(0.03 * (0.06 / 0.3) ** 0.5)
    assert damping(small, damping=0.02) == 0.02


def least_inertia(vehicle, h=1e-6):
    """Least kinetic energy of a unit tip velocity, twice: bodies' motion by differences
    of their poses.
    """

    def places(q):
        poses = link_poses(vehicle, q)
        points = [
            np.array(list(pose.p + pose.R.apply(link.body.com)))
            for pose, link in zip(poses, vehicle.links, strict=True)
        ]
        turned = [
            np.array([list(row) for row in pose.R.rows], dtype=float)
            for pose in poses[: vehicle.n]
        ]
        return np.array(list(frame_pose(vehicle, vehicle.frame(), q).p)), points, turned

    n, M, J = vehicle.n, np.zeros((vehicle.n, vehicle.n)), np.zeros((3, vehicle.n))
    sides = [
        [places(tuple(s * h if i == k else 0.0 for i in range(n))) for s in (1, -1)]
        for k in range(n)
    ]
    _, _, rest = places((0.0,) * n)
    for b, link in enumerate(vehicle.links):
        body, speeds, rates = link.body, [], []
        about = np.array(
            [
                [body.inertia.xx, body.inertia.xy, body.inertia.xz],
                [body.inertia.xy, body.inertia.yy, body.inertia.yz],
                [body.inertia.xz, body.inertia.yz, body.inertia.zz],
            ],
            dtype=float,
        )
        for ahead, behind in sides:
            speeds.append((ahead[1][b] - behind[1][b]) / (2 * h))
            W = (ahead[2][b] - behind[2][b]) / (2 * h) @ rest[b].T
            rates.append(np.array([W[2, 1], W[0, 2], W[1, 0]]))
        v, w = np.array(speeds), np.array(rates)
        M += float(body.mass) * v @ v.T + w @ (rest[b] @ about @ rest[b].T) @ w.T
    M += np.diag([float(link.joint.armature) for link in vehicle.links])
    for k, (ahead, behind) in enumerate(sides):
        J[:, k] = (ahead[0] - behind[0]) / (2 * h)
    _, s, _ = np.linalg.svd(J @ np.linalg.inv(np.linalg.cholesky(M)).T)
    return 1.0 / s[0] ** 2


@pytest.mark.parametrize(
    "name", ["hexarotor_arm6", "octo_coaxial_two_arms", "pelican_arm2"]
)
def test_how_light_a_tip_is_against_its_vehicle_follows_from_energy_of_its_motion(name):
    vehicle = skyarm.load_vehicle(name)
    mobile = float(vehicle.mass) / least_inertia(vehicle)
    assert tip_lightness(vehicle) == pytest.approx(mobile / 38.0, rel=1e-5)
    assert 1.5 < tip_lightness(vehicle) < 3.0


def test_a_light_tip_is_less_stiff_and_its_joints_are_observed_faster():
    """Up to bounds; not where an option says so, a load is learned or something is
    pressed.
    """
    arm = Model(vehicle=skyarm.load_vehicle("hexarotor_arm6"))

    def gains(model, **options):
        par = make_centroidal(model, mode="tip", **options).par
        return par.tip.position, par.tip.velocity, par.observer.joints

    usual = (700.0, 53.0, 34.0)
    assert gains(arm) == pytest.approx((700.0 / 1.6, 53.0, 51.0))
    for options in ({"interaction": (0.3, 0.1)}, {"load": 0.6}):
        assert gains(arm, **options) == usual
    assert gains(arm, tip=usual[:2], observer=(27.0, 31.0, 34.0, 60.0)) == usual
    for name in (
        "hummingbird_arm2",
        "hummingbird_arm2_rotors",
        "crazyflie_arm1",
        "quadrotor_roll_arm2",
    ):
        assert gains(Model(vehicle=skyarm.load_vehicle(name))) == usual
    assert gains(Model(vehicle=skyarm.load_vehicle("voliro_like")))[0] == pytest.approx(
        700.0 / 1.6
    )
