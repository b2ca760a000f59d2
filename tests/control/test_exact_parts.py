"""Parts of the exact law, each against an oracle that shares no code with it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.polynomial import Chebyshev
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.actuation import Command, speed_after
from skyarm.algebra import Mat3, Quaternion, Vec3
from skyarm.control.exact import make_exact
from skyarm.control.exact.attitude import attitude, reachable
from skyarm.control.exact.extrapolation import continued, samples
from skyarm.control.exact.kinematics import derivative, moving, posture
from skyarm.control.exact.lag import command_for
from skyarm.control.exact.memory import Channel
from skyarm.control.exact.motion import Disturbance, carried
from skyarm.control.exact.tip import goal, level_joints, orientation_error
from skyarm.control.exact.torques import needed
from skyarm.control.exact.wishes import Wish
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics.kinematics import link_poses
from skyarm.reference import Reference
from skyarm.scalars.taylor import Taylor
from vehicles_random import TWINS, RandomState, random_state, random_vehicle, rotation_matrix

TRUTH = skyarm.load_vehicle("hummingbird_arm2_rotors")
NODES = np.cos(np.pi * (np.arange(24) + 0.5) / 24) * 0.2
"""Chebyshev nodes on 0.4 s: interpolation differentiates smooth signals four times to about 1e-8."""


def differentiated(values, order=4):
    """Derivatives at t = 0 of samples at NODES, by interpolation."""
    columns = np.asarray(values, dtype=float).reshape(len(NODES), -1).T
    fits = [Chebyshev.fit(NODES, column, len(NODES) - 1, domain=[-0.2, 0.2]) for column in columns]
    return [np.array([fit.deriv(k)(0.0) if k else fit(0.0) for fit in fits]) for k in range(order + 1)]


def array(v):
    return np.array([float(c) for c in v])


def vec(values):
    return Vec3(*(float(v) for v in values))


@pytest.mark.parametrize("joints", [1, 2, 4, 7])
def test_com_and_tip_derivatives_are_those_of_pinocchio_along_a_motion(joints):
    pytest.importorskip("pinocchio")
    rng = np.random.default_rng([5, joints])
    vehicle = random_vehicle(rng, joints)
    twin = TWINS["pinocchio"](vehicle)
    c = rng.normal(size=(5, joints)) / np.array([1.0, 1.0, 2.0, 6.0, 24.0])[:, None]
    still = np.zeros(6 + joints)

    def at(t):
        q = sum(c[k] * t**k for k in range(5))
        state = RandomState(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), q, still)
        return np.concatenate([twin.center_of_mass(state), twin.frame(state, vehicle.end_effector)[0]])

    expected = differentiated([at(t) for t in NODES])
    found = posture(vehicle, [Taylor(column) for column in c.T.tolist()], 4)
    for k in range(5):
        ours = np.concatenate([array(derivative(found.com, k)), array(derivative(found.tip, k))])
        np.testing.assert_allclose(ours, expected[k], rtol=1e-6, atol=1e-5 * max(1.0, np.abs(expected[k]).max()))


def test_desired_rate_and_acceleration_are_those_of_the_turning_attitude():
    force = np.array([[1.0, -2.0, 7.0], [3.0, 1.0, -1.0], [-2.0, 4.0, 1.5]])
    yaw = np.array([0.4, 0.8, -0.5])

    def rotation(t):
        f, psi = force[0] + force[1] * t + force[2] * t * t, yaw[0] + yaw[1] * t + yaw[2] * t * t
        b3 = f / np.linalg.norm(f)
        b2 = np.cross(b3, [np.cos(psi), np.sin(psi), 0.0])
        b2 = b2 / np.linalg.norm(b2)
        return np.stack([np.cross(b2, b3), b2, b3], axis=1)

    values = differentiated([rotation(t).ravel() for t in NODES], 2)
    R, first, second = (value.reshape(3, 3) for value in values)
    S = R.T @ first
    rate = np.array([S[2, 1], S[0, 2], S[1, 0]])
    A = R.T @ second - S @ S
    found = attitude(Vec3(*(Taylor(column) for column in force.T.tolist())), Taylor(yaw.tolist()))
    np.testing.assert_allclose([array(row) for row in found.R.rows], R, atol=1e-12)
    np.testing.assert_allclose(array(found.rate), rate, atol=1e-9)
    np.testing.assert_allclose(array(found.acceleration), [A[2, 1], A[0, 2], A[1, 0]], atol=1e-7)


@pytest.mark.parametrize("force", [(0.0, 0.0, 0.0), (0.0, 0.0, -9.0), (50.0, -3.0, 1.0), (1e9, 0.0, -1e9)])
def test_the_commanded_tilt_is_bounded_for_any_force(force):
    held = reachable(Vec3(*(Taylor((f, 1.0, -1.0)) for f in force)), 1.2, 0.5)
    x, y, z = (c.c[0] for c in held)
    assert z >= 0.5
    assert np.hypot(x, y) <= 1.2 * z * (1.0 + 1e-12)
    found = attitude(held, Taylor((0.3, 0.1, 0.0)))
    for v in (*found.R.rows, found.rate, found.acceleration):
        assert np.all(np.isfinite(array(v)))


def test_a_small_tilt_is_not_touched_by_its_bound():
    force = Vec3(*(Taylor((f, 0.2, 0.1)) for f in (1.0, -2.0, 8.0)))
    assert [c.c for c in reachable(force, 1.2, 0.5)] == [c.c for c in force]


@pytest.mark.parametrize(("speed", "wanted"), [(480.0, 500.0), (480.0, 455.0), (300.0, 301.0), (500.0, 500.0)])
def test_the_inverted_lag_reaches_the_wanted_speed_within_one_period(speed, wanted):
    rotor = TRUTH.rotors[0]
    command = command_for(rotor, speed, wanted, 0.005, 1.0)
    assert speed_after(rotor, speed, command, 0.005) == pytest.approx(wanted, abs=1e-9)
    tau = rotor.time_constant_up if wanted > speed else rotor.time_constant_down
    assert speed + (command - speed) * (1.0 - np.exp(-0.005 / tau)) == pytest.approx(wanted, abs=1e-9)
    assert command_for(rotor, speed, wanted, 0.005, 0.0) == wanted


@pytest.mark.parametrize(("speed", "wanted"), [(100.0, 830.0), (800.0, 10.0), (480.0, 2000.0)])
def test_the_inverted_lag_stays_within_what_the_rotor_can_do(speed, wanted):
    assert 0.0 <= command_for(TRUTH.rotors[0], speed, wanted, 0.005, 1.0) <= TRUTH.rotors[0].max_speed


def held(value, rate, acceleration):
    zero = Vec3(0.0, 0.0, 0.0)
    return Reference(
        position=Vec3(value, 0.0, 0.0),
        velocity=Vec3(rate, 0.0, 0.0),
        acceleration=Vec3(acceleration, 0.0, 0.0),
        jerk=zero,
        snap=zero,
    ).dense()


def published(signal, ticks, jump=None):
    """Series of x at each control tick from samples every 20 ms of ``signal(t) -> value, rate, acceleration``."""
    channels, age, started, found = (Channel(),) * 4, 0.0, 0.0, []
    for k in range(ticks):
        series, channels, age = continued(channels, age, samples(held(*signal((k // 4) * 0.02))), started, 0.005, 0.02)
        started = 1.0
        found.append([series[0].derivative(i) for i in range(5)])
    return np.array(found)


def test_held_samples_of_a_quartic_are_continued_exactly():
    """Its accelerations are a parabola, which three samples fix."""
    p = np.polynomial.Polynomial([0.2, -0.3, 0.5, 0.4, -0.6])
    found = published(lambda t: (p(t), p.deriv(1)(t), p.deriv(2)(t)), 60)
    for k in range(12, 60):
        expected = [p.deriv(i)(0.005 * k) if i else p(0.005 * k) for i in range(5)]
        np.testing.assert_allclose(found[k], expected, rtol=1e-6, atol=1e-7)


def test_a_sine_is_continued_far_better_than_held():
    w = 2.0 * np.pi * 0.5
    found = published(lambda t: (np.sin(w * t), w * np.cos(w * t), -w * w * np.sin(w * t)), 400)
    t = 0.005 * np.arange(400)
    assert np.abs(found[12:, 0] - np.sin(w * t)[12:]).max() < 1e-6
    assert np.abs(np.sin(w * 0.02 * (np.arange(400) // 4)) - np.sin(w * t)).max() > 0.04


def test_a_jump_does_not_kick_jerk_and_snap():
    """At 0.4 s a rest becomes a cosine: acceleration and value jump, the rate does not."""
    w = 3.0

    def signal(t):
        s = t - 0.4
        return (0.0, 0.0, 0.0) if s < -1e-9 else (np.cos(w * s), -w * np.sin(w * s), -w * w * np.cos(w * s))

    found = published(signal, 200)
    assert np.abs(found[80:84, 3:]).max() == 0.0
    assert np.abs(found[80:, 3]).max() < 1.5 * w**3
    t = 0.005 * np.arange(200)[80:] - 0.4
    assert np.abs(found[80:, 0] - np.cos(w * t)).max() < 2e-4


def test_a_constant_reference_stays_constant():
    found = published(lambda t: (1.5, 0.0, 0.0), 40)
    assert np.all(found == np.array([1.5, 0.0, 0.0, 0.0, 0.0]))


def test_torques_give_the_wished_accelerations_to_pinocchios_free_vehicle():
    """The real thrust and the unknown force go in; base torque and joint torques are what the wish needs."""
    pytest.importorskip("pinocchio")
    for joints in (0, 2, 5):
        rng = np.random.default_rng([9, joints])
        vehicle = random_vehicle(rng, joints)
        state, n = random_state(rng, joints), joints
        unknown = Disturbance(
            force=vec(rng.normal(size=3)), torque=vec(rng.normal(size=3)), efforts=tuple(rng.normal(size=n).tolist())
        )
        wish = Wish(
            thrust=float(10.0 * rng.normal()),
            alpha=vec(5.0 * rng.normal(size=3)),
            joints=tuple(rng.normal(size=n).tolist()),
        )
        now = State(
            position=vec(state.position),
            quaternion=Quaternion(*state.quaternion.tolist()),
            velocity=vec(state.velocity[:3]),
            rate=vec(state.velocity[3:6]),
            joints=tuple(state.joints.tolist()),
            joint_rates=tuple(state.velocity[6:].tolist()),
        )
        torque, efforts = needed(Model(vehicle=vehicle), now, wish, unknown)
        R = rotation_matrix(state.quaternion)
        force = np.concatenate(
            [
                R @ [0.0, 0.0, wish.thrust] + array(unknown.force),
                array(torque) + array(unknown.torque),
                np.array(efforts) + np.array(unknown.efforts),
            ]
        )
        found = TWINS["pinocchio"](vehicle).forward_dynamics(state, force, 9.81)
        np.testing.assert_allclose(found[3:6], array(wish.alpha), atol=1e-8)
        np.testing.assert_allclose(found[6:], wish.joints, atol=1e-8)


def flying():
    return State(
        position=Vec3(0.1, -0.2, 1.0),
        quaternion=Quaternion(*np.roll(Rotation.from_euler("xyz", [0.2, -0.3, 0.5]).as_quat(), 1).tolist()),
        velocity=Vec3(0.3, 0.1, -0.2),
        rate=Vec3(0.6, -0.9, 0.3),
        joints=(0.4, -0.7),
        joint_rates=(1.5, -2.0),
        rotor_speeds=(500.0, 470.0, 455.0, 510.0),
    )


def test_the_prediction_is_what_mujoco_does_in_that_time():
    pytest.importorskip("mujoco")
    from skyarm.environment import WindSample
    from skyarm.plant.interface import World
    from skyarm.plant.mujoco import MujocoPlant

    vehicle = TRUTH.with_joints(damping=0.0)
    vehicle = dataclasses.replace(
        vehicle,
        rotors=tuple(dataclasses.replace(r, drag_coefficient=0, rolling_moment_coefficient=0) for r in vehicle.rotors),
    )
    push = Vec3(0.8, -0.5, 0.3)
    command = Command(rotor_speeds=(520.0, 440.0, 480.0, 500.0), efforts=(0.02, -0.01))
    none = Disturbance(force=push, torque=Vec3(0.0, 0.0, 0.0), efforts=(0.0, 0.0))
    found = carried(Model(vehicle=vehicle, gravity=9.8), flying(), command, none, 0.005)
    wind = WindSample(push, Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0))
    plant = MujocoPlant(World(vehicle=vehicle, gravity=9.8), wind, "euler", 1e-5)
    from skyarm.compile import leaves

    x = plant.advance(tuple(leaves(flying())), tuple(leaves(command)), tuple(leaves(wind)), 0.005)
    ours = np.array(leaves(found))
    # first order in 1 ms against 0.01 ms: accelerations of 100 rad/s^2 that change by some percent within 5 ms
    np.testing.assert_allclose(ours[:7], x[:7], atol=2e-5)
    np.testing.assert_allclose(ours[7:17], x[7:17], atol=1e-2)
    np.testing.assert_allclose(ours[17:], x[17:], rtol=1e-12)


def test_link_orientations_of_a_level_base_are_absolute_angles_for_parallel_axes():
    vehicle, pitch, th = TRUTH, 0.27, (0.2, -0.15)
    par = make_exact(Model(vehicle=vehicle), mode="ee").par
    joints = moving(th, (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0))
    zero = [Vec3(0.0, 0.0, 0.0)] * 5
    wanted = goal(vehicle, zero, Taylor.constant(0.0, 4), joints, posture(vehicle, joints, 4))
    c, s = np.cos(pitch), np.sin(pitch)
    R = Mat3(Vec3(c, 0.0, s), Vec3(0.0, 1.0, 0.0), Vec3(-s, 0.0, c))
    poses = link_poses(vehicle, th)
    change = level_joints(vehicle, par.tip, wanted, R, poses)
    # the error is the sine of the angle; the posture's weight is 1e-5 of the orientations'
    np.testing.assert_allclose(change, [-np.sin(pitch), 0.0], atol=1e-4)
    error = orientation_error(R @ poses[0].R, wanted.links[0])
    np.testing.assert_allclose(array(error), [0.0, -np.sin(pitch), 0.0], atol=1e-12)


def test_goal_rates_are_those_of_the_turning_links():
    """Angular velocity and acceleration of every link of a level base, by SciPy's rotations of a random arm."""
    rng = np.random.default_rng(3)
    vehicle = random_vehicle(rng, 4)
    c, yaw = rng.normal(size=(3, 4)), np.array([0.3, 0.7, -0.4])

    def rotations(t):
        q = tuple((c[0] + c[1] * t + 0.5 * c[2] * t * t).tolist())
        turn = Rotation.from_euler("z", yaw[0] + yaw[1] * t + 0.5 * yaw[2] * t * t).as_matrix()
        return np.array([turn @ np.array([array(row) for row in pose.R.rows]) for pose in link_poses(vehicle, q)])

    joints = moving(*c.tolist(), (0.0,) * 4, (0.0,) * 4)
    level = posture(vehicle, joints, 4)
    found = goal(vehicle, [Vec3(0.0, 0.0, 0.0)] * 5, Taylor.of_derivatives([*yaw.tolist(), 0.0, 0.0]), joints, level)
    values = differentiated([rotations(t).ravel() for t in NODES], 2)
    R, first, second = (value.reshape(4, 3, 3) for value in values)
    for i in range(4):
        S = first[i] @ R[i].T
        A = second[i] @ R[i].T - S @ S
        np.testing.assert_allclose(array(found.rates[i]), [S[2, 1], S[0, 2], S[1, 0]], atol=1e-8)
        np.testing.assert_allclose(array(found.accelerations[i]), [A[2, 1], A[0, 2], A[1, 0]], atol=1e-6)
        np.testing.assert_allclose([array(row) for row in found.links[i].rows], R[i], atol=1e-12)
