"""Oracles of the position loop in angle mode: SciPy's rotations, the geometric law's
attitude, poles, falls by hand.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm.algebra import Vec3
from skyarm.algebra.quaternion import Quaternion
from skyarm.control.blocks.geometric import desired_attitude
from skyarm.links.autopilots.angle_control import (
    AngleControl,
    AngleGains,
    MotionFilter,
    angles_of,
    rotate,
)
from skyarm.links.autopilots.autopilot import BaseGoal

GRAVITY = 9.8
ORIGIN = (0.0, 0.0, 0.0)
LEVEL = (1.0, 0.0, 0.0, 0.0)


def wxyz(rotation: Rotation) -> tuple[float, ...]:
    x, y, z, w = rotation.as_quat()
    return w, x, y, z


def goal(position=ORIGIN, velocity=ORIGIN, acceleration=ORIGIN, yaw=0.0) -> BaseGoal:
    return BaseGoal(position, velocity, acceleration, yaw)


@pytest.mark.parametrize("seed", range(5))
def test_rotations_are_those_of_scipy(seed):
    rng = np.random.default_rng(seed)
    rotation, vector = Rotation.random(random_state=seed), rng.normal(size=3)
    np.testing.assert_allclose(
        rotate(wxyz(rotation), vector), rotation.apply(vector), atol=1e-12
    )


@pytest.mark.parametrize("seed", range(5))
def test_roll_and_pitch_turn_the_body_as_the_geometric_law_does(seed):
    rng = np.random.default_rng(seed)
    thrust, yaw = (
        np.array([*rng.uniform(-4.0, 4.0, 2), rng.uniform(6.0, 12.0)]),
        rng.uniform(-3.0, 3.0),
    )
    roll, pitch = angles_of(thrust, yaw)
    reached = Rotation.from_euler("ZYX", (yaw, pitch, roll)).as_matrix()
    np.testing.assert_allclose(
        reached[:, 2], thrust / np.linalg.norm(thrust), atol=1e-12
    )
    # its attitude has the same thrust axis, for the acceleration downwards
    wanted = desired_attitude(Vec3(*-thrust), yaw, Quaternion(*LEVEL).rotation())
    np.testing.assert_allclose(
        reached[:, 2], [float(c) for c in wanted.column(2)], atol=1e-12
    )


def test_hover_asks_for_the_weight_and_level_angles():
    attitude = AngleControl(AngleGains(), GRAVITY).command(
        ORIGIN, ORIGIN, LEVEL, goal(), 0.002, flying=True
    )
    assert (attitude.roll, attitude.pitch, attitude.yaw_rate) == (0.0, 0.0, 0.0)
    assert attitude.thrust == pytest.approx(GRAVITY)


def test_signs_of_angles_for_a_goal_ahead_and_a_goal_to_the_left():
    control = AngleControl(AngleGains(), GRAVITY)
    ahead = control.command(
        ORIGIN, ORIGIN, LEVEL, goal((0.1, 0.0, 0.0)), 0.002, flying=False
    )
    assert ahead.pitch > 0.0  # nose down
    assert ahead.roll == 0.0
    left = control.command(
        ORIGIN, ORIGIN, LEVEL, goal((0.0, 0.1, 0.0)), 0.002, flying=False
    )
    assert left.roll < 0.0
    assert left.pitch == 0.0
    # the same goal lies ahead of a vehicle that looks left
    turned = wxyz(Rotation.from_euler("Z", math.pi / 2))
    assert (
        control.command(
            ORIGIN, ORIGIN, turned, goal((0.0, 0.1, 0.0), yaw=1.6), 0.002, flying=False
        ).pitch
        > 0.0
    )


def test_acceleration_of_reference_and_velocity_error_add_up():
    gains = AngleGains(position=0.0, velocity=2.0, integral=0.0)
    wanted = goal(velocity=(0.5, 0.0, 0.0), acceleration=(1.0, 0.0, 0.0))
    attitude = AngleControl(gains, GRAVITY).command(
        ORIGIN, ORIGIN, LEVEL, wanted, 0.002, flying=True
    )
    assert math.tan(attitude.pitch) == pytest.approx((1.0 + 2.0 * 0.5) / GRAVITY)


def test_thrust_is_the_component_along_the_present_axis():
    tilted = wxyz(Rotation.from_euler("Y", 0.3))
    attitude = AngleControl(AngleGains(), GRAVITY).command(
        ORIGIN, ORIGIN, tilted, goal(), 0.002, flying=False
    )
    assert attitude.thrust == pytest.approx(GRAVITY * math.cos(0.3))


@pytest.mark.parametrize("seed", range(4))
def test_a_tilted_vehicle_gets_the_angles_and_the_thrust_of_the_pid(seed):
    rng = np.random.default_rng(seed)
    yaw, wanted_yaw = rng.uniform(-3.0, 3.0, 2)
    attitude = Rotation.from_euler("ZYX", (yaw, *rng.uniform(-0.3, 0.3, 2)))
    position, place, velocity, speed, acceleration = rng.uniform(-0.3, 0.3, (5, 3))
    gains = AngleGains(integral=0.0, tilt=1.2, reach=10.0)
    found = AngleControl(gains, GRAVITY).command(
        tuple(position),
        tuple(velocity),
        wxyz(attitude),
        goal(place, speed, acceleration, wanted_yaw),
        0.002,
        flying=True,
    )
    pid = 9.0 * (place - position) + 5.0 * (speed - velocity)
    thrust = (
        acceleration + np.array([1.0, 1.0, 1.3]) * pid + np.array([0.0, 0.0, GRAVITY])
    )
    assert found.thrust == pytest.approx(thrust @ attitude.apply([0.0, 0.0, 1.0]))
    up = Rotation.from_euler(
        "ZYX", (attitude.as_euler("ZYX")[0], found.pitch, found.roll)
    ).apply([0.0, 0.0, 1.0])
    np.testing.assert_allclose(up, thrust / np.linalg.norm(thrust), atol=1e-12)
    turn = (wanted_yaw - attitude.as_euler("ZYX")[0] + math.pi) % math.tau - math.pi
    assert found.yaw_rate == pytest.approx(2.0 * turn)


@pytest.mark.parametrize(
    ("wish", "thrust"), [(-100.0, 0.2 * GRAVITY), (100.0, 2.0 * GRAVITY)]
)
def test_the_vertical_thrust_is_between_a_fifth_and_twice_the_weight(wish, thrust):
    wanted = goal(acceleration=(0.0, 0.0, wish))
    found = AngleControl(AngleGains(), GRAVITY).command(
        ORIGIN, ORIGIN, LEVEL, wanted, 0.002, flying=False
    )
    assert found.thrust == pytest.approx(thrust)


def test_a_vehicle_on_its_back_gets_no_thrust():
    back = wxyz(Rotation.from_euler("X", math.pi))
    assert (
        AngleControl(AngleGains(), GRAVITY)
        .command(ORIGIN, ORIGIN, back, goal(), 0.002, flying=False)
        .thrust
        == 0.0
    )


def test_a_slower_loop_has_the_poles_of_the_loop_nearer_to_zero_by_its_factor():
    gains = AngleGains()
    slow = gains.slow_down(0.6)
    fast, slower = (
        np.sort_complex(np.roots([1.0, g.velocity, g.position, g.integral]))
        for g in (gains, slow)
    )
    np.testing.assert_allclose(slower, 0.6 * fast, atol=1e-12)
    assert (slow.yaw, slow.tilt, slow.reach, slow.drift) == (
        gains.yaw,
        gains.tilt,
        gains.reach,
        gains.drift,
    )


def test_tilt_reach_and_drift_are_limited():
    gains = AngleGains(tilt=0.2, integral=1e6, drift=0.7)
    control = AngleControl(gains, GRAVITY)
    for _ in range(100):
        attitude = control.command(
            ORIGIN, ORIGIN, LEVEL, goal((100.0, 50.0, 0.0)), 0.01, flying=True
        )
    assert math.hypot(*control.integral) == pytest.approx(0.7)
    up = Rotation.from_euler("ZYX", (0.0, attitude.pitch, attitude.roll)).apply(
        [0.0, 0.0, 1.0]
    )
    assert math.acos(up[2]) == pytest.approx(0.2, abs=1e-9)
    weak = AngleGains(position=0.1, integral=0.0, reach=0.5)
    pitch = (
        AngleControl(weak, GRAVITY)
        .command(ORIGIN, ORIGIN, LEVEL, goal((100.0, 0.0, 0.0)), 0.01, flying=True)
        .pitch
    )
    assert math.tan(pitch) == pytest.approx(0.1 * 0.5 / GRAVITY)


def test_integral_waits_on_the_ground_and_takes_a_constant_force_in_the_air():
    control = AngleControl(AngleGains(), GRAVITY)
    control.command(ORIGIN, ORIGIN, LEVEL, goal((0.0, 0.0, 0.5)), 0.01, flying=False)
    assert control.integral == ORIGIN
    # a point mass that gets what is asked for, pushed by 0.6 m/s^2 along x
    x = v = 0.0
    for _ in range(4000):
        pitch = control.command(
            (x, 0.0, 0.0), (v, 0.0, 0.0), LEVEL, goal(), 0.005, flying=True
        ).pitch
        v += 0.005 * (math.tan(pitch) * GRAVITY + 0.6)
        x += 0.005 * v
    assert abs(x) < 1e-4
    assert control.integral[0] == pytest.approx(-0.6, abs=1e-3)


def test_filter_follows_a_throw_without_lag():
    found = MotionFilter(GRAVITY)
    dt, turned = 0.002, Rotation.from_euler("ZYX", (0.4, 0.2, -0.1))
    world = np.array([1.0, -0.5, 0.3])
    body = turned.inv().apply(world - np.array([0.0, 0.0, -GRAVITY]))
    for k in range(5001):
        t = k * dt
        if k:
            found.predict(wxyz(turned), body, dt)
        if k % 2 == 0:
            found.correct(0.5 * t * t * world, 2 * dt)
    np.testing.assert_allclose(found.position, 0.5 * t * t * world, atol=1e-6)
    np.testing.assert_allclose(found.velocity, t * world, atol=1e-6)


def test_filter_forgets_a_wrong_velocity_with_two_equal_poles():
    pole, dt = 8.0, 0.01
    found = MotionFilter(GRAVITY, pole)
    found.correct(ORIGIN, dt)
    found.velocity = Vec3(1.0, 0.0, 0.0)
    beta = math.exp(-pole * dt)
    matrix = np.array([[1.0, dt], [0.0, 1.0]])
    gain = np.array([[1.0 - beta**2, 0.0], [(1.0 - beta) ** 2 / dt, 0.0]])
    closed = (np.eye(2) - gain) @ matrix
    # the square root of a double eigenvalue's rounding
    np.testing.assert_allclose(np.linalg.eigvals(closed), beta, atol=1e-6)
    state = np.array([0.0, 1.0])
    for _ in range(20):
        found.predict(LEVEL, (0.0, 0.0, GRAVITY), dt)
        found.correct(ORIGIN, dt)
        state = closed @ state
        np.testing.assert_allclose(
            (found.position[0], found.velocity[0]), state, atol=1e-12
        )


def test_filter_leaves_the_stated_velocity_error_of_a_wrong_accelerometer():
    pole, wrong = 8.0, 0.2
    found = MotionFilter(GRAVITY, pole)
    for _ in range(5000):
        found.predict(LEVEL, (wrong, 0.0, GRAVITY), 0.001)
        found.correct(ORIGIN, 0.001)
    assert found.velocity[0] == pytest.approx(2.0 * wrong / pole, rel=0.02)
