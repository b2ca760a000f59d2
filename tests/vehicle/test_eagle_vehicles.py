"""The vehicles of eagle-mpc against the numbers of its own files, by Pinocchio and
NumPy.
"""

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.dynamics import array_front as arrays

pin = pytest.importorskip("pinocchio")

PUBLISHED = tomllib.loads(
    (Path(__file__).parents[1] / "data/eagle_vehicles.toml").read_text("utf-8")
)


def urdf(bodies):
    """Text of a URDF file of published bodies, whose joints turn without limits."""

    def words(values):
        return " ".join(map(repr, values))

    text = ""
    for body in bodies:
        moments = zip(
            ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), body["inertia"], strict=True
        )
        text += (
            f'<link name="{body["name"]}"><inertial><origin'
            f' xyz="{words(body["com"])}"/>'
        )
        text += f'<mass value="{body["mass"]}"/><inertia'
        text += (
            "".join(f' {key}="{value}"' for key, value in moments)
            + "/></inertial></link>"
        )
        if "parent" in body:
            axis = f'<axis xyz="{words(body["axis"])}"/>' if "axis" in body else ""
            turn = words([0.5 * math.pi * each for each in body["quarters"]])
            text += (
                f'<joint name="to_{body["name"]}"'
                f' type="{"continuous" if axis else "fixed"}">{axis}'
            )
            text += f'<parent link="{body["parent"]}"/><child link="{body["name"]}"/>'
            text += f'<origin xyz="{words(body["place"])}" rpy="{turn}"/></joint>'
    return f'<robot name="r">{text}</robot>'


@pytest.mark.parametrize("name", PUBLISHED)
def test_masses_arm_and_gripper_are_those_of_the_published_file(name):
    vehicle = skyarm.load_vehicle(name)
    model = pin.buildModelFromXML(
        urdf(PUBLISHED[name]["bodies"]), pin.JointModelFreeFlyer()
    )
    data, rng, n = model.createData(), np.random.default_rng(3), vehicle.n
    assert model.nv == 6 + n
    for _ in range(5):
        at, turn, angles = (
            rng.normal(size=3),
            rng.normal(size=4),
            rng.uniform(-1.6, 1.6, n),
        )
        turn /= np.linalg.norm(turn)
        circles = [
            each for angle in angles for each in (math.cos(angle), math.sin(angle))
        ]
        q = np.concatenate([at, turn[[1, 2, 3, 0]], circles])
        M = np.triu(pin.crba(model, data, q))
        pin.framesForwardKinematics(model, data, q)
        # Pinocchio's velocity of the base is in its own axes, skyarm's in those of the
        # world
        to_base = np.eye(6 + n)
        to_base[:3, :3] = pin.Quaternion(*turn).matrix().T
        M = to_base.T @ (M + np.triu(M, 1).T) @ to_base
        found = arrays.mass_matrix(vehicle, at, turn, angles)
        # the shipped files leave out products of inertia below 1e-9 kg m^2 and lengths
        # below 1e-8 m
        np.testing.assert_allclose(found, M, rtol=0, atol=4e-9)
        tip, _ = arrays.frame_pose_world(vehicle, at, turn, angles, frame="tip")
        np.testing.assert_allclose(
            tip, data.oMf[model.getFrameId("gripper")].translation, rtol=0, atol=1e-12
        )


@pytest.mark.parametrize("name", PUBLISHED)
def test_rotors_push_as_those_of_the_published_platform(name):
    platform, vehicle = PUBLISHED[name], skyarm.load_vehicle(name)
    for rotor, published in zip(vehicle.rotors, platform["rotors"], strict=True):
        axis = (
            pin.Quaternion(np.array(published["quaternion"], dtype=float))
            .normalized()
            .matrix()[:, 2]
        )
        np.testing.assert_allclose([*rotor.axis], axis, rtol=0, atol=1e-9)
        # the URDF of the hexacopter370 has its hubs 5 cm higher, along their thrust
        np.testing.assert_allclose(
            np.cross([*rotor.position], axis),
            np.cross(published["place"], axis),
            atol=1e-9,
        )
        assert -rotor.direction == published["spin"]
        assert rotor.thrust_coefficient == platform["cf"]
        assert rotor.moment_coefficient == pytest.approx(
            platform["cm"] / platform["cf"], rel=1e-12
        )
        assert rotor.thrust_coefficient * rotor.max_speed**2 == pytest.approx(
            platform["max_thrust"], rel=1e-8
        )


@pytest.mark.parametrize("name", PUBLISHED)
def test_joints_have_the_published_limits(name):
    published = [body for body in PUBLISHED[name]["bodies"] if "axis" in body]
    for link, body in zip(skyarm.load_vehicle(name).links, published, strict=True):
        joint = link.joint
        assert (joint.effort_limit, joint.upper, joint.lower) == (
            body["effort"],
            body["limit"],
            -body["limit"],
        )


def test_the_hexacopters_weigh_and_lift_what_their_planner_states():
    masses = {
        "hexacopter370_flying_arm_3": (2.561, 4.94),
        "hexacopter680_flying_arm_2": (3.384, 4.49),
    }
    for name, (mass, share) in masses.items():
        vehicle = skyarm.load_vehicle(name)
        assert vehicle.mass == pytest.approx(mass, abs=5e-4)
        thrust = sum(
            rotor.thrust_coefficient * rotor.max_speed**2 for rotor in vehicle.rotors
        )
        assert thrust / (vehicle.mass * 9.81) == pytest.approx(share, abs=5e-3)
