"""Laws that hold for any rigid-body dynamics: symmetry, inverse, power, conservation,
invariance, degenerate cases.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skyarm.algebra import Mat3, Sym3, Vec3
from skyarm.dynamics import Pose, frame_pose
from skyarm.dynamics import array_front as arrays
from skyarm.vehicle.linkage import BASE, Body, Joint, Link
from skyarm.vehicle.vehicle_records import Vehicle
from support.vehicles import (
    array3,
    array33,
    inertia33,
    random_body,
    random_quaternion,
    random_state,
    random_vehicle,
    rotation_matrix,
)

JOINTS = range(8)


def seeded(n, salt):
    rng = np.random.default_rng([77, salt, n])
    vehicle = random_vehicle(rng, n)
    return vehicle, random_state(rng, n), rng


def quaternion_product(a, b):
    """Hamilton product written with the cross product, for tests only."""
    w = a[0] * b[0] - a[1:] @ b[1:]
    return np.array([w, *(a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))])


def rate_of_change(state):
    """(position, quaternion, joints) derivatives of a configuration whose velocity is
    known.
    """
    spin = 0.5 * quaternion_product(
        state.quaternion, np.array([0.0, *state.velocity[3:6]])
    )
    return np.concatenate([state.velocity[:3], spin, state.velocity[6:]])


@pytest.mark.parametrize("n", JOINTS)
def test_the_mass_matrix_is_symmetric_and_positive_definite(n):
    vehicle, state, _ = seeded(n, 1)
    M = arrays.mass_matrix(vehicle, *state.configuration)
    assert np.array_equal(M, M.T)  # by construction, to the last bit
    assert np.linalg.eigvalsh(M)[0] > 0.0


@pytest.mark.parametrize("n", JOINTS)
def test_forward_dynamics_undoes_inverse_dynamics(n):
    vehicle, state, rng = seeded(n, 2)
    acceleration = 10.0 * rng.normal(size=6 + n)
    force = arrays.inverse_dynamics(vehicle, *state.all, acceleration, gravity=3.0)
    again = arrays.forward_dynamics(vehicle, *state.all, force, gravity=3.0)
    condition = np.linalg.cond(arrays.mass_matrix(vehicle, *state.configuration))
    # a solution loses as many digits as the condition of M has
    assert np.abs(again - acceleration).max() <= 1e-13 * condition * max(
        1.0, np.abs(force).max()
    )


@pytest.mark.parametrize("n", JOINTS)
def test_inverse_dynamics_is_mass_matrix_times_acceleration_plus_bias(n):
    vehicle, state, rng = seeded(n, 3)
    acceleration = rng.normal(size=6 + n)
    bias = arrays.inverse_dynamics(vehicle, *state.all, np.zeros(6 + n))
    force = arrays.inverse_dynamics(vehicle, *state.all, acceleration)
    M = arrays.mass_matrix(vehicle, *state.configuration)
    assert np.allclose(
        force,
        M @ acceleration + bias,
        rtol=0.0,
        atol=1e-12 * max(1.0, np.abs(force).max()),
    )


@pytest.mark.parametrize("n", JOINTS)
def test_gravity_is_the_same_as_an_upward_acceleration(n):
    vehicle, state, _ = seeded(n, 4)
    still = np.zeros(6 + n)
    up = np.eye(6 + n)[2] * 4.2
    weight = arrays.inverse_dynamics(
        vehicle, *state.configuration, still, still, gravity=4.2
    )
    pushed = arrays.inverse_dynamics(
        vehicle, *state.configuration, still, up, gravity=0.0
    )
    assert np.allclose(weight, pushed, rtol=0.0, atol=1e-12 * np.abs(weight).max())
    assert weight[2] == pytest.approx(4.2 * vehicle.mass, rel=1e-12)


@pytest.mark.parametrize("n", JOINTS)
def test_the_power_of_the_force_is_the_rate_of_the_energy(n):
    vehicle, state, rng = seeded(n, 5)
    acceleration = rng.normal(size=6 + n)
    force = arrays.inverse_dynamics(vehicle, *state.all, acceleration)

    def energy_after(t):
        q = np.concatenate(
            [state.position, state.quaternion, state.joints]
        ) + t * rate_of_change(state)
        q[3:7] /= np.linalg.norm(q[3:7])
        return arrays.energy(
            vehicle, q[:3], q[3:7], q[7:], state.velocity + t * acceleration
        )

    h = 1e-3
    # sixth-order central difference: h^6 = 1e-18 of a seventh derivative, and 1e-16 / h
    # of rounding
    weights = {1: 45.0, 2: -9.0, 3: 1.0}
    rate = sum(
        w * (energy_after(k * h) - energy_after(-k * h)) for k, w in weights.items()
    ) / (60.0 * h)
    scale = max(1.0, float(np.abs(force * state.velocity).sum()))
    assert abs(rate - force @ state.velocity) < 1e-9 * scale


@pytest.mark.parametrize("n", [0, 1, 2, 4, 7])
def test_free_fall_keeps_energy_and_momentum(n):
    integrate = pytest.importorskip("scipy.integrate")
    vehicle, state, _ = seeded(n, 6)
    start = np.concatenate(
        [state.position, state.quaternion, state.joints, state.velocity]
    )

    def split(y):
        return y[:3], y[3:7] / np.linalg.norm(y[3:7]), y[7 : 7 + n], y[7 + n :]

    def derivative(_t, y):
        p, quaternion, q, v = split(y)
        spin = 0.5 * quaternion_product(y[3:7], np.array([0.0, *v[3:6]]))
        return np.concatenate(
            [
                v[:3],
                spin,
                v[6:],
                arrays.forward_dynamics(vehicle, p, quaternion, q, v, 0.0 * v),
            ]
        )

    span = 0.3
    solution = integrate.solve_ivp(
        derivative, (0.0, span), start, method="DOP853", rtol=1e-11, atol=1e-12
    )
    assert solution.success
    before, after = split(start), split(solution.y[:, -1])
    weight = np.array([0.0, 0.0, -9.81 * vehicle.mass, 0.0, 0.0, 0.0])
    gained = arrays.momentum(vehicle, *after) - arrays.momentum(vehicle, *before)
    energies = [float(arrays.energy(vehicle, *at)) for at in (before, after)]
    # hundreds of steps at 1e-11 each
    assert np.abs(gained - span * weight).max() < 1e-7 * max(1.0, np.abs(weight).max())
    assert abs(energies[1] - energies[0]) < 1e-7 * max(1.0, abs(energies[0]))
    fallen = (
        arrays.center_of_mass(vehicle, *before[:3])
        + span * arrays.momentum(vehicle, *before)[:3] / vehicle.mass
    )
    fallen[2] -= 0.5 * 9.81 * span**2
    assert np.allclose(
        arrays.center_of_mass(vehicle, *after[:3]), fallen, rtol=0.0, atol=1e-7
    )


@pytest.mark.parametrize("n", JOINTS)
def test_dynamics_do_not_depend_on_position_or_on_linear_velocity(n):
    vehicle, state, rng = seeded(n, 7)
    force = rng.normal(size=6 + n)
    drifting = state.velocity + np.concatenate([rng.normal(size=3), np.zeros(3 + n)])
    here = arrays.forward_dynamics(vehicle, *state.all, force)
    there = arrays.forward_dynamics(
        vehicle, state.position + 5.0, state.quaternion, state.joints, drifting, force
    )
    assert np.array_equal(here, there)


@pytest.mark.parametrize("n", JOINTS)
def test_turning_the_world_without_gravity_turns_the_world_parts_only(n):
    vehicle, state, rng = seeded(n, 8)
    turn = random_quaternion(rng)
    T = np.eye(6 + n)
    T[:3, :3] = rotation_matrix(turn)
    force = rng.normal(size=6 + n)
    turned = (
        T[:3, :3] @ state.position,
        quaternion_product(turn, state.quaternion),
        state.joints,
    )
    plain = arrays.forward_dynamics(vehicle, *state.all, force, gravity=0.0)
    rotated = arrays.forward_dynamics(
        vehicle, *turned, T @ state.velocity, T @ force, gravity=0.0
    )
    condition = np.linalg.cond(arrays.mass_matrix(vehicle, *state.configuration))
    assert np.allclose(
        rotated,
        T @ plain,
        rtol=0.0,
        atol=1e-14 * condition * max(1.0, np.abs(plain).max()),
    )
    M = arrays.mass_matrix(vehicle, *state.configuration)
    assert np.allclose(
        arrays.mass_matrix(vehicle, *turned),
        T @ M @ T.T,
        rtol=0.0,
        atol=1e-13 * np.abs(M).max(),
    )


@pytest.mark.parametrize("n", JOINTS)
def test_turning_about_the_vertical_changes_nothing_in_gravity(n):
    vehicle, state, _ = seeded(n, 9)
    yaw = np.array([np.cos(0.4), 0.0, 0.0, np.sin(0.4)])
    T = np.eye(6 + n)
    T[:3, :3] = rotation_matrix(yaw)
    bias = arrays.inverse_dynamics(vehicle, *state.all, np.zeros(6 + n))
    turned = (
        T[:3, :3] @ state.position,
        quaternion_product(yaw, state.quaternion),
        state.joints,
        T @ state.velocity,
    )
    again = arrays.inverse_dynamics(vehicle, *turned, np.zeros(6 + n))
    assert np.allclose(
        again, T @ bias, rtol=0.0, atol=1e-12 * max(1.0, np.abs(bias).max())
    )


@pytest.mark.parametrize("n", range(1, 8))
def test_a_joint_wound_past_a_turn_is_where_it_was(n):
    rng = np.random.default_rng([77, 10, n])
    vehicle, state = random_vehicle(rng, n, prismatic=False), random_state(rng, n)
    turns = 2.0 * np.pi * rng.integers(-9, 10, size=n)
    wound = arrays.inverse_dynamics(
        vehicle,
        state.position,
        state.quaternion,
        state.joints + turns,
        state.velocity,
        np.ones(6 + n),
    )
    plain = arrays.inverse_dynamics(vehicle, *state.all, np.ones(6 + n))
    # an angle of 9 turns carries 1e-14 rad of rounding
    assert np.allclose(
        wound, plain, rtol=0.0, atol=1e-11 * max(1.0, np.abs(plain).max())
    )


@pytest.mark.parametrize("n", JOINTS)
def test_the_jacobian_is_the_rate_of_the_pose(n):
    vehicle, state, _ = seeded(n, 11)
    twist = arrays.frame_jacobian(vehicle, *state.configuration) @ state.velocity

    def pose_after(t):
        q = np.concatenate(
            [state.position, state.quaternion, state.joints]
        ) + t * rate_of_change(state)
        return arrays.frame_pose_world(
            vehicle, q[:3], q[3:7] / np.linalg.norm(q[3:7]), q[7:]
        )

    h = 1e-5
    (p1, R1), (p0, R0), R = pose_after(h), pose_after(-h), pose_after(0.0)[1]
    spin = (R1 - R0) / (2.0 * h) @ R.T
    # central difference: h^2 = 1e-10 of a third derivative of a few hundred
    assert np.allclose(twist[:3], (p1 - p0) / (2.0 * h), rtol=0.0, atol=1e-6)
    assert np.allclose(
        twist[3:], [spin[2, 1], spin[0, 2], spin[1, 0]], rtol=0.0, atol=1e-6
    )


@pytest.mark.parametrize("n", [1, 4])
def test_poses_carry_points_and_compose_like_homogeneous_matrices(n):
    vehicle, state, rng = seeded(n, 13)
    R, p, point = rotation_matrix(state.quaternion), state.position, rng.normal(size=3)
    base = Pose(Mat3(*(Vec3(*row) for row in R.tolist())), Vec3(*p.tolist()))
    assert np.allclose(
        array3(base.apply(Vec3(*point.tolist()))), p + R @ point, rtol=0.0, atol=1e-14
    )
    found = base @ frame_pose(
        vehicle, vehicle.frame("tip0"), tuple(state.joints.tolist())
    )
    position, rotation = arrays.frame_pose_world(
        vehicle, *state.configuration, frame="tip0"
    )
    assert np.allclose(array3(found.p), position, rtol=0.0, atol=1e-13)
    assert np.allclose(array33(found.R), rotation, rtol=0.0, atol=1e-13)


def test_a_single_rigid_body_obeys_newton_and_euler():
    rng = np.random.default_rng(12)
    body = random_body(rng)
    vehicle, state = Vehicle(name="brick", base=body), random_state(rng, 0)
    force = rng.normal(size=6)
    R, w = rotation_matrix(state.quaternion), state.velocity[3:]
    m, c, inertia = body.mass, array3(body.com), inertia33(body)
    found = arrays.forward_dynamics(vehicle, *state.all, force)
    # Euler about the centre of mass, Newton for it, and rigid motion between origin and
    # centre
    alpha = found[3:]
    at_com = found[:3] + R @ (np.cross(alpha, c) + np.cross(w, np.cross(w, c)))
    assert np.allclose(
        m * at_com, force[:3] - [0.0, 0.0, m * 9.81], rtol=0.0, atol=1e-12
    )
    moment = force[3:] - np.cross(c, R.T @ force[:3])
    assert np.allclose(
        inertia @ alpha + np.cross(w, inertia @ w), moment, rtol=0.0, atol=1e-12
    )


def test_a_pendulum_on_a_held_base_falls_as_galileo_has_it():
    m, length, angle, rate = 0.3, 0.7, 0.5, 1.5
    joint = Joint(name="hinge", axis=Vec3(0, 1, 0))
    link = Link(
        name="rod", parent=BASE, joint=joint, body=Body(mass=m, com=Vec3(0, 0, -length))
    )
    vehicle = Vehicle(
        name="pendulum", base=random_body(np.random.default_rng(3)), links=(link,)
    )
    level = (np.zeros(3), np.array([1.0, 0, 0, 0]), np.array([angle]))
    force = arrays.inverse_dynamics(
        vehicle, *level, np.array([0, 0, 0, 0, 0, 0, rate]), np.zeros(7)
    )
    base_weight = vehicle.base.mass * 9.81
    # a positive turn about +y carries the bob, hung along -z, to -x
    assert force[6] == pytest.approx(m * 9.81 * length * np.sin(angle), rel=1e-12)
    centripetal = m * length * rate**2
    assert force[0] == pytest.approx(centripetal * np.sin(angle), rel=1e-12)
    assert force[2] == pytest.approx(
        centripetal * np.cos(angle) + m * 9.81 + base_weight, rel=1e-12
    )
    assert force[1] == pytest.approx(0.0, abs=1e-12)


def test_a_prismatic_joint_on_a_turning_base_feels_coriolis_and_centrifugal_force():
    m, out, speed, spin = 0.4, 0.6, 1.2, 2.0
    joint = Joint(name="slide", kind="prismatic", axis=Vec3(1, 0, 0))
    link = Link(name="bead", parent=BASE, joint=joint, body=Body(mass=m))
    vehicle = Vehicle(
        name="slider", base=Body(mass=1.0, inertia=Sym3.isotropic(0.1)), links=(link,)
    )
    velocity = np.array([0, 0, 0, 0, 0, spin, speed], dtype=float)
    force = arrays.inverse_dynamics(
        vehicle,
        np.zeros(3),
        np.array([1.0, 0, 0, 0]),
        np.array([out]),
        velocity,
        np.zeros(7),
        gravity=0.0,
    )
    assert force[6] == pytest.approx(-m * spin**2 * out, rel=1e-14)
    assert force[1] == pytest.approx(2.0 * m * spin * speed, rel=1e-14)
    assert force[5] == pytest.approx(2.0 * m * spin * speed * out, rel=1e-14)


def test_a_link_without_mass_passes_forces_on():
    rng = np.random.default_rng(14)
    vehicle, state = (
        random_vehicle(rng, 3, prismatic=False, branching=False),
        random_state(rng, 3),
    )
    links = list(vehicle.links)
    links[1] = dataclasses.replace(links[1], body=Body(mass=0.0))
    light = dataclasses.replace(vehicle, links=tuple(links))
    acceleration = rng.normal(size=9)
    force = arrays.inverse_dynamics(light, *state.all, acceleration)
    again = arrays.forward_dynamics(light, *state.all, force)
    condition = np.linalg.cond(arrays.mass_matrix(light, *state.configuration))
    assert np.abs(again - acceleration).max() <= 1e-13 * condition * max(
        1.0, np.abs(force).max()
    )


def test_a_tip_without_mass_changes_nothing():
    rng = np.random.default_rng(15)
    vehicle, state = random_vehicle(rng, 2, branching=False), random_state(rng, 2)
    force = rng.normal(size=8)
    loaded = vehicle.with_payload(0.0)
    plain = arrays.forward_dynamics(vehicle, *state.all, force)
    # the joined inertia differs by the rounding of one shift
    assert np.allclose(
        arrays.forward_dynamics(loaded, *state.all, force),
        plain,
        rtol=1e-10,
        atol=1e-10,
    )


def test_a_payload_is_a_point_mass_at_the_frame():
    rng = np.random.default_rng(16)
    vehicle, state = random_vehicle(rng, 3), random_state(rng, 3)
    loaded = vehicle.with_payload(0.25)
    tip, _ = arrays.frame_pose_world(vehicle, *state.configuration)
    speed = arrays.frame_jacobian(vehicle, *state.configuration)[:3] @ state.velocity
    gained = arrays.energy(loaded, *state.all) - arrays.energy(vehicle, *state.all)
    assert gained == pytest.approx(
        0.5 * 0.25 * speed @ speed + 0.25 * 9.81 * tip[2], rel=1e-10, abs=1e-10
    )
