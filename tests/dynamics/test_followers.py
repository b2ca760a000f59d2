"""Links whose joints follow others: against Pinocchio's mimic joints, in both plants,
and from files.
"""

import dataclasses

import numpy as np
import pytest

from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics import array_front as arrays
from skyarm.dynamics import load_forces, proper_acceleration
from skyarm.dynamics.kinematics import jacobian_columns, link_poses
from skyarm.dynamics.point_motion import PointMotion
from skyarm.plant.compiled import RigidBodyPlant, example_state
from skyarm.plant.interface import Truth, flat
from skyarm.plant.mujoco import MujocoPlant
from skyarm.scenario.scenario_record import trimmed_state
from skyarm.vehicle import BASE, VehicleError
from skyarm.vehicle.attach import Mimic, couple
from skyarm.vehicle.vehicle_files import load_vehicle
from support.vehicles import (
    GRAVITY,
    PinocchioTwin,
    random_body,
    random_state,
    random_vehicle,
    rotation_matrix,
    steady_wind,
    with_armature,
)

HOW = {
    "joint3": Mimic("joint1", -1.3, 0.2),
    "joint4": Mimic("joint3", 0.5, 0.0),
    "joint5": Mimic("joint0", 0.7, -0.1),
}
"""Of a random vehicle of six joints: a leader of two, one of them through the other,
and a leader of one."""


def tied(seed):
    """A random tree of six joints, three of which follow; links that must move freely
    hang on free ones.
    """
    rng = np.random.default_rng([13, seed])
    whole = with_armature(random_vehicle(rng, 6), rng)
    parents = [
        -1,
        0,
        1,
        int(rng.integers(-1, 3)),
        int(rng.integers(-1, 4)),
        int(rng.integers(-1, 5)),
    ]
    links = [
        dataclasses.replace(k, parent=p)
        for k, p in zip(whole.links, parents, strict=True)
    ]
    kept, followers, frames = couple(links, whole.frames, HOW)
    vehicle = dataclasses.replace(whole, links=kept, followers=followers, frames=frames)
    # an armature of a follower has gone to its leader; Pinocchio's stays where it was
    return vehicle, dataclasses.replace(whole, links=tuple(links)), rng


class Twin:
    """Pinocchio's own mimic joints, whose velocities are linear and angular in base
    axes.
    """

    def __init__(self, whole):
        pin = pytest.importorskip("pinocchio")
        plain = dataclasses.replace(
            whole,
            links=tuple(
                dataclasses.replace(k, joint=dataclasses.replace(k.joint, armature=0))
                for k in whole.links
            ),
        )
        self.pin, model = pin, PinocchioTwin(plain).model
        for name, leader, ratio, offset in (
            ("joint3", "joint1", -1.3, 0.2),
            ("joint4", "joint1", -0.65, 0.1),
            ("joint5", "joint0", 0.7, -0.1),
        ):
            model = pin.transformJointIntoMimic(
                model, model.getJointId(leader), model.getJointId(name), ratio, offset
            )
        self.model, self.data = model, model.createData()
        self.columns = [
            6 + model.joints[model.getJointId(f"joint{i}")].idx_v - 6 for i in range(3)
        ]

    def given(self, state):
        w, x, y, z = state.quaternion
        q = self.pin.neutral(self.model)
        q[:7] = [*state.position, x, y, z, w]
        T = np.zeros((9, 9))
        T[:3, :3], T[3:6, 3:6] = rotation_matrix(state.quaternion).T, np.eye(3)
        for i, column in enumerate(self.columns):
            q[column + 1], T[column, 6 + i] = state.joints[i], 1.0
        return q, T @ state.velocity, T

    def mass_matrix(self, state):
        q, _, T = self.given(state)
        upper = np.triu(self.pin.crba(self.model, self.data, q))
        return T.T @ (upper + np.triu(upper, 1).T) @ T

    def inverse_dynamics(self, state, acceleration):
        q, v, T = self.given(state)
        turning = np.concatenate([np.cross(v[3:6], v[:3]), np.zeros(6)])
        self.model.gravity.linear = np.array([0.0, 0.0, -9.81])
        return T.T @ self.pin.rnea(
            self.model, self.data, q, v, T @ acceleration - turning
        )


def armature_of(vehicle):
    return np.diag([0.0] * 6 + [float(link.joint.armature) for link in vehicle.links])


@pytest.mark.parametrize("seed", range(6))
def test_mass_matrix_bias_and_accelerations_are_those_of_pinocchios_mimic_joints(seed):
    vehicle, whole, rng = tied(seed)
    assert (vehicle.n, len(vehicle.followers)) == (3, 3)
    twin, state = Twin(whole), random_state(rng, 3)
    M = arrays.mass_matrix(vehicle, *state.configuration)
    np.testing.assert_allclose(
        M, twin.mass_matrix(state) + armature_of(vehicle), rtol=0.0, atol=1e-11
    )
    a = rng.normal(size=9)
    force = arrays.inverse_dynamics(vehicle, *state.all, a)
    np.testing.assert_allclose(
        force, twin.inverse_dynamics(state, a) + armature_of(vehicle) @ a, atol=1e-10
    )
    np.testing.assert_allclose(
        arrays.forward_dynamics(vehicle, *state.all, force), a, atol=1e-9
    )


def test_a_followers_drive_is_felt_at_its_leader():
    vehicle, whole, _ = tied(0)
    own = [float(link.joint.armature) for link in whole.links]
    expected = [
        own[0] + 0.7**2 * own[5],
        own[1] + 1.3**2 * own[3] + 0.65**2 * own[4],
        own[2],
    ]
    assert [float(link.joint.armature) for link in vehicle.links] == pytest.approx(
        expected
    )


def test_energy_is_kept_and_jacobians_are_derivatives():
    vehicle, _, rng = tied(2)
    state = random_state(rng, 3)
    # power of the forces that a motion needs is the rate of its energy
    a, v, h = rng.normal(size=9), state.velocity, 1e-6
    force = arrays.inverse_dynamics(vehicle, *state.all, a)
    R = rotation_matrix(state.quaternion)

    def energy(t):
        from scipy.spatial.transform import Rotation

        x, y, z, w = (
            Rotation.from_matrix(R) * Rotation.from_rotvec(t * v[3:6])
        ).as_quat()
        joints = state.joints + t * v[6:]
        return float(
            arrays.energy(
                vehicle, state.position + t * v[:3], [w, x, y, z], joints, v + t * a
            )
        )

    power = (energy(h) - energy(-h)) / (2.0 * h)
    assert power == pytest.approx(force @ v, rel=1e-6, abs=1e-5)
    frame = vehicle.frame("tip4")
    assert frame.link >= vehicle.n, "it must be on a follower"
    q = state.joints.tolist()
    columns = jacobian_columns(vehicle, frame, q)
    for i, column in enumerate(columns):
        ends = [
            link_poses(vehicle, [*q[:i], q[i] + s * h, *q[i + 1 :]])[frame.link].apply(
                frame.position
            )
            for s in (1, -1)
        ]
        slope = (
            np.array(list(ends[0]), dtype=float) - np.array(list(ends[1]), dtype=float)
        ) / (2.0 * h)
        np.testing.assert_allclose(
            np.array(list(column.linear), dtype=float), slope, atol=1e-8
        )


def gripper(**mimic):
    """The shipped arm whose second joint is followed by a finger."""
    truth = load_vehicle("hummingbird_arm2_rotors")
    second = truth.links[1]
    finger = dataclasses.replace(
        second,
        name="finger",
        joint=dataclasses.replace(second.joint, name="finger", damping=0),
    )
    finger = dataclasses.replace(
        finger, joint=dataclasses.replace(finger.joint, position=(0.0, 0.04, -0.1))
    )
    links, followers, frames = couple(
        [*truth.links, finger], truth.frames, {"finger": Mimic("joint2", **mimic)}
    )
    return dataclasses.replace(truth, links=links, followers=followers, frames=frames)


@pytest.mark.parametrize(
    ("integrator", "tolerance"), [("rk4_staged", 1e-8), ("euler", 1e-9)]
)
def test_both_plants_fly_a_gripper_alike(integrator, tolerance):
    vehicle = gripper(ratio=-0.8, offset=0.3)
    world, still = Truth(vehicle=vehicle), steady_wind()
    start = trimmed_state(world, (0.0, 0.0, 10.0), 0.0, (0.4, -0.3))
    command = [*start.rotor_speeds, 0.02, -0.03]
    ends = []
    for made in (RigidBodyPlant, MujocoPlant):
        plant, x = made(world, still, integrator, 0.001), flat(start)
        for _ in range(200):
            x = plant.advance(x, command, (), 0.001)
        ends.append((*x, *plant.specific_force(x, command, ())))
    assert abs(ends[0][13] - 0.4) > 1e-3, "the arm must move"
    np.testing.assert_allclose(*ends, rtol=0.0, atol=tolerance)


def test_a_point_on_a_follower_moves_and_a_force_there_works_on_the_leader():
    vehicle = gripper(ratio=-0.8, offset=0.3)
    state = dataclasses.replace(
        example_state(2, 4), joints=(0.2, -0.4), joint_rates=(1.0, 2.0)
    )
    motion = PointMotion(vehicle, state)
    point, push = (0.0, 0.01, -0.05), (0.3, -0.2, 0.5)
    from skyarm.algebra import ZERO3, Vec3

    moving = motion.velocity(Vec3(*point), body=2)
    total, efforts = motion.generalized_force(Vec3(*push), ZERO3, Vec3(*point), 2)
    power = sum(
        float(a) * float(b) for a, b in zip(efforts, state.joint_rates, strict=True)
    )
    assert power == pytest.approx(
        sum(float(a) * b for a, b in zip(moving, push, strict=True))
    )
    assert tuple(
        map(float, total.linear if hasattr(total, "linear") else total.force)
    ) == pytest.approx(push)


FILE = """
schema = 1
name = "gripper"
end_effector = "tip"

[base]
mass = 0.7
inertia = [0.007, 0.007, 0.012]

[[links]]
name = "left"
parent = "base"
mass = 0.05
inertia = [1e-4, 1e-4, 1e-4]
[links.joint]
name = "left"
kind = "prismatic"
axis = [0.0, 1.0, 0.0]
armature = 0.1

[[links]]
name = "right"
parent = "base"
mass = 0.05
inertia = [1e-4, 1e-4, 1e-4]
[links.joint]
name = "right"
kind = "prismatic"
axis = [0.0, 1.0, 0.0]
damping = 0.4
mimic = { joint = "left", ratio = -1.0 }

[[frames]]
name = "tip"
link = "right"
position = [0.0, 0.0, -0.1]
"""


def test_a_vehicle_file_says_which_joints_follow(tmp_path):
    file = tmp_path / "gripper.toml"
    file.write_text(FILE, encoding="utf-8")
    vehicle = load_vehicle(file)
    assert ([k.name for k in vehicle.links], [k.name for k in vehicle.followers]) == (
        ["left"],
        ["right"],
    )
    assert (vehicle.frame().link, float(vehicle.links[0].joint.damping)) == (1, 0.4)
    level = [float(c) for pose in link_poses(vehicle, [0.03]) for c in pose.p]
    assert level == pytest.approx([0.0, 0.03, 0.0, 0.0, -0.03, 0.0])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            'joint = "left"',
            'joint = "middle"',
            "joint[right].mimic.joint = 'middle': must be one of left, right",
        ),
        (
            'joint = "left"',
            'joint = "right"',
            "joint[right].mimic.joint = 'right': must not lead back (right -> right)",
        ),
        (
            "ratio = -1.0",
            "ratio = 0.0",
            "joint[right].mimic.ratio = 0.0: must not be 0",
        ),
        (
            "ratio = -1.0",
            'ratio = "x"',
            "links[right].joint.mimic.ratio = 'x': must be a finite number",
        ),
        (
            "ratio = -1.0",
            "gear = 2",
            (
                "links[right].joint.mimic.gear = 2: unknown field; allowed: joint,"
                " ratio, offset"
            ),
        ),
    ],
)
def test_a_wrong_mimic_is_one_line(tmp_path, old, new, said):
    file = tmp_path / "gripper.toml"
    file.write_text(FILE.replace(old, new), encoding="utf-8")
    with pytest.raises(VehicleError) as told:
        load_vehicle(file)
    assert str(told.value).startswith(f"{file}: {said}")
    assert "\n" not in str(told.value)


def test_a_link_of_its_own_on_a_follower_is_refused(tmp_path):
    file = tmp_path / "gripper.toml"
    more = (
        '[[links]]\nname = "more"\nparent = "right"\nmass = 0.1\ninertia = [1e-4, 1e-4,'
        " 1e-4]\n"
    )
    more += '[links.joint]\nname = "more"\naxis = [0.0, 1.0, 0.0]\n\n[[frames]]'
    file.write_text(FILE.replace("[[frames]]", more), encoding="utf-8")
    with pytest.raises(
        VehicleError,
        match=r"joint\[more\].parent = 'right': must not follow another joint",
    ):
        load_vehicle(file)


def test_forces_that_carry_loads_are_what_pinocchio_adds_for_them():
    """Loads on the base, links and followers of a tumbling tree, as generalised
    forces.
    """
    vehicle, whole, rng = tied(5)
    state, acceleration = random_state(rng, 3), rng.normal(size=9)
    loads = [(link, random_body(rng)) for link in (BASE, 0, 2, 4)]
    R = Quaternion(*state.quaternion).rotation()
    base = proper_acceleration(
        R, Vec3(*acceleration[:3]), Vec3(*acceleration[3:6]), GRAVITY
    )
    here = dataclasses.replace(
        example_state(3, len(vehicle.rotors)),
        quaternion=Quaternion(*state.quaternion),
        joints=tuple(state.joints),
        rate=Vec3(*state.velocity[3:6]),
        joint_rates=tuple(state.velocity[6:]),
    )
    forces, motion = (
        load_forces(vehicle, loads, here, base, tuple(acceleration[6:])),
        PointMotion(vehicle, here),
    )
    total = np.zeros(9)
    for (link, _), each in zip(loads, forces, strict=True):
        force, torque = (
            motion.to_world(each.force, link),
            motion.to_world(each.torque, link),
        )
        pushed, efforts = motion.generalized_force(
            force, torque, Vec3(0.0, 0.0, 0.0), link
        )
        total += [*R.apply(pushed.force), *pushed.torque, *efforts]
    moving = [vehicle.moving[link].name if link != BASE else "" for link, _ in loads]
    links = [
        (
            dataclasses.replace(k, body=k.body.merge(loads[moving.index(k.name)][1]))
            if k.name in moving
            else k
        )
        for k in whole.links
    ]
    heavy = dataclasses.replace(
        whole, base=whole.base.merge(loads[0][1]), links=tuple(links)
    )
    before, after = (
        Twin(each).inverse_dynamics(state, acceleration) for each in (whole, heavy)
    )
    np.testing.assert_allclose(total, after - before, atol=1e-9)
