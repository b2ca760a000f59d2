"""What the laws must do in words: signs, directions, limits."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm.algebra import Mat3, Quaternion, Sym3, Vec3
from skyarm.control.blocks.geometric import (
    angular_acceleration,
    attitude_error,
    body_thrust,
    desired_attitude,
    downward_acceleration,
    rate_error,
    yaw_of,
)
from skyarm.control.catalogue import HUMMINGBIRD
from support import euler_lagrange as el
from support.laws import (
    ARM2,
    LAWS,
    MODEL,
    G,
    cases,
    changed,
    controller,
    hovering,
    pushes,
    step,
    vec,
)


def torque_and_thrust(name, case):
    return pushes(ARM2, step(controller(name), case.measurement(), case.reference()))


def mat(array):
    return Mat3(*(vec(row) for row in array))


def array(m):
    return np.array([tuple(row) for row in m.rows], dtype=float)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_torque_opposes_a_small_tilt(name, axis, sign):
    euler = np.zeros(3)
    euler[axis] = 0.02 * sign
    level, tilted = (
        torque_and_thrust(name, hovering(euler=e))[0] for e in (np.zeros(3), euler)
    )
    # -KR sin(0.02) about that axis on the base; the hybrid laws add the arm's share,
    # which has the same sign
    least = 0.02 * (0.7, 0.7, 0.035)[axis]
    change = -sign * (tilted - level)[axis]
    assert change > 0.99 * least


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_torque_opposes_a_rate(name, axis, sign):
    w = np.zeros(3)
    w[axis] = 0.1 * sign
    torque = torque_and_thrust(name, changed(hovering(), w=w))[0]
    assert -sign * torque[axis] > 0.99 * 0.1 * (0.1, 0.1, 0.025)[axis]


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("direction", [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)])
@pytest.mark.parametrize("field", ["p_d", "v_d"])
def test_thrust_direction_tilts_towards_the_target(name, direction, field):
    """A force along +x needs a positive pitch torque, along +y a negative roll
    torque.
    """
    d = np.array(direction, dtype=float)
    case = hovering()
    torque, _ = torque_and_thrust(
        name, changed(case, **{field: getattr(case, field) + 0.2 * d})
    )
    assert torque @ np.cross([0.0, 0.0, 1.0], d) > 0.01


@pytest.mark.parametrize("name", [name for name in LAWS if name != "decoupled_pd"])
@pytest.mark.parametrize("direction", [(1, 0, 0), (0, -1, 0)])
def test_thrust_direction_leans_into_a_wanted_acceleration(name, direction):
    d = np.array(direction, dtype=float)
    torque, _ = torque_and_thrust(name, changed(hovering(), a_d=d))
    assert torque @ np.cross([0.0, 0.0, 1.0], d) > 0.05


@pytest.mark.parametrize("name", LAWS)
def test_the_nose_turns_towards_the_wanted_yaw(name):
    for yaw in (-0.3, 0.3):
        torque, _ = torque_and_thrust(name, changed(hovering(), yaw=yaw))
        assert torque[2] * yaw > 0.0


@pytest.mark.parametrize("name", LAWS)
def test_hover_thrust_equals_weight(name):
    for yaw in (0.0, 2.0):
        case = changed(hovering(euler=(0.0, 0.0, yaw)), yaw=yaw)
        torque, thrust = torque_and_thrust(name, case)
        assert thrust == pytest.approx(0.806 * G, rel=1e-13)
        np.testing.assert_allclose(torque, 0.0, atol=1e-14)


@pytest.mark.parametrize("name", LAWS)
def test_thrust_grows_below_the_target_and_when_sinking(name):
    hover = torque_and_thrust(name, hovering())[1]
    assert torque_and_thrust(name, changed(hovering(), p=(0.0, 0.0, 0.9)))[1] > hover
    assert torque_and_thrust(name, changed(hovering(), v=(0.0, 0.0, -0.1)))[1] > hover


def test_pd_baseline_holds_a_level_arm_by_exactly_its_static_torque():
    for joints in ((0.0, 0.0), (0.3, 0.2), (-1.2, 0.7), (1.0, np.pi)):
        case = hovering(joints=joints)
        efforts = step(
            controller("decoupled_pd"), case.measurement(), case.reference()
        ).efforts
        static = el.gravity_vector(
            np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, *joints]), G, reduced=True
        )[6:]
        np.testing.assert_allclose(efforts, static, rtol=1e-12, atol=1e-16)
    assert abs(static[0]) > 0.01


def test_pd_baseline_pulls_a_joint_towards_its_reference_and_against_its_rate():
    case = hovering()
    for field, value in (("q_d", 0.1), ("qd_d", 0.5), ("qd", -0.5)):
        for joint in (0, 1):
            values = np.zeros(2)
            values[joint] = value
            found = step(
                controller("decoupled_pd"), *_inputs(changed(case, **{field: values}))
            ).efforts
            gains = {"q_d": (1.0, 0.5), "qd_d": (0.04, 0.02), "qd": (-0.04, -0.02)}[
                field
            ]
            expected = np.zeros(2)
            expected[joint] = gains[joint] * value
            np.testing.assert_allclose(found, expected, atol=1e-16)


def _inputs(case):
    return case.measurement(), case.reference()


@pytest.mark.parametrize("name", LAWS[1:])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_joint_torques_are_limited_at_the_effort_limit(name, sign):
    case = changed(hovering(), q_d=(sign * 1e4, sign * 1e4))
    assert step(controller(name), *_inputs(case)).efforts == (0.5 * sign, 0.5 * sign)


def test_commanded_acceleration_points_down_in_hover_and_up_to_a_far_lower_target():
    zero = Vec3(0.0, 0.0, 0.0)

    def a_d(e_p=zero, e_v=zero, a=zero):
        found = downward_acceleration(
            HUMMINGBIRD,
            0.806,
            G,
            position_error=e_p,
            velocity_error=e_v,
            acceleration=a,
        )
        return np.array(tuple(found))

    np.testing.assert_allclose(a_d(), [0.0, 0.0, -G])
    np.testing.assert_allclose(
        a_d(e_p=Vec3(1.0, 2.0, 3.0)), [4 / 0.806, 8 / 0.806, 12 / 0.806 - G]
    )
    np.testing.assert_allclose(
        a_d(e_v=Vec3(1.0, 2.0, 3.0)), [2.2 / 0.806, 4.4 / 0.806, 6.6 / 0.806 - G]
    )
    np.testing.assert_allclose(a_d(a=Vec3(1.0, 2.0, 3.0)), [-1.0, -2.0, -3.0 - G])


def test_thrust_is_the_wanted_force_along_the_present_body_z():
    a_d = np.array([1.0, -2.0, -9.0])
    for euler in ((0.0, 0.0, 0.0), (0.4, -0.3, 1.0), (np.pi, 0.0, 0.0)):
        R = Rotation.from_euler("ZYX", euler[::-1]).as_matrix()
        assert body_thrust(0.8, vec(a_d), mat(R)) == pytest.approx(
            -0.8 * a_d @ R[:, 2], rel=1e-14
        )


def test_desired_attitude_is_a_rotation_with_thrust_up_and_nose_to_the_heading():
    rng = np.random.default_rng(2)
    for _ in range(50):
        a_d, yaw = rng.normal(size=3) * 5.0, rng.uniform(-np.pi, np.pi)
        R_d = array(desired_attitude(vec(a_d), yaw, Mat3.identity()))
        np.testing.assert_allclose(R_d.T @ R_d, np.eye(3), atol=1e-14)
        assert np.linalg.det(R_d) == pytest.approx(1.0)
        np.testing.assert_allclose(R_d[:, 2], -a_d / np.linalg.norm(a_d), atol=1e-15)
        heading = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        assert R_d[:, 0] @ heading > 0.0
        assert abs(R_d[:, 1] @ heading) < 1e-14


def test_attitude_error_is_the_sine_of_the_angle_along_the_axis():
    rng = np.random.default_rng(3)
    for _ in range(50):
        R_d, turn = Rotation.random(random_state=rng), rng.normal(size=3)
        angle = np.linalg.norm(turn)
        R = R_d.as_matrix() @ Rotation.from_rotvec(turn).as_matrix()
        found = tuple(attitude_error(mat(R), mat(R_d.as_matrix())))
        np.testing.assert_allclose(found, np.sin(angle) * turn / angle, atol=1e-14)


def _error_rate(R, w, yaw_rate):
    """d e_R / dt by central differences: a level thrust whose heading turns, a body
    that turns with w.
    """
    h, level = 1e-5, Vec3(0.0, 0.0, -G)

    def e_R(t):
        turned = R @ Rotation.from_rotvec(w * t).as_matrix()
        R_d = desired_attitude(level, 0.4 + yaw_rate * t, Mat3.identity())
        return np.array(tuple(attitude_error(mat(turned), R_d)))

    return (e_R(h) - e_R(-h)) / (2.0 * h)


def test_the_corrected_rate_error_vanishes_where_the_attitude_error_stands_still():
    """Lee's w = R^T R_d w_d keeps R_d^T R and with it e_R constant; RotorS's w = R_d^T
    R w_d does not.
    """
    yaw_rate, zero = 1.5, Vec3(0.0, 0.0, 0.0)
    R_d = desired_attitude(Vec3(0.0, 0.0, -G), 0.4, Mat3.identity())
    for euler in ((0.5, 0.0, 0.0), (0.2, -0.6, 1.0), (-0.4, 0.3, 2.0)):
        R = Rotation.from_euler("ZYX", euler[::-1]).as_matrix()
        w = {
            form: -np.array(tuple(rate_error(zero, mat(R), R_d, yaw_rate, form)))
            for form in ("corrected", "rotors_sim")
        }
        # central differences of order h^2 = 1e-10 and rounding 1e-16 / h
        np.testing.assert_allclose(
            _error_rate(R, w["corrected"], yaw_rate), 0.0, atol=1e-8
        )
        assert np.abs(_error_rate(R, w["rotors_sim"], yaw_rate)).max() > 0.1
        np.testing.assert_allclose(
            w["corrected"], R.T @ array(R_d) @ [0.0, 0.0, yaw_rate], atol=1e-15
        )


def test_rate_errors_agree_without_a_yaw_rate_and_in_the_wanted_attitude():
    R, R_d = (mat(Rotation.random(random_state=seed).as_matrix()) for seed in (1, 2))
    w = Vec3(0.1, -0.2, 0.3)
    assert (
        rate_error(w, R, R_d, 0.0, "rotors_sim")
        == rate_error(w, R, R_d, 0.0, "corrected")
        == w
    )
    same = (rate_error(w, R, R, 0.7, form) for form in ("rotors_sim", "corrected"))
    for found in same:
        np.testing.assert_allclose(tuple(found), (0.1, -0.2, -0.4), atol=1e-15)


def test_angular_acceleration_times_any_inertia_is_the_gains_torque():
    inertia = Sym3(0.01, 0.012, 0.02, 0.001, -0.002, 0.003)
    full = array(inertia.full())
    e_R, e_w = np.array([0.1, -0.2, 0.3]), np.array([1.0, 0.5, -0.7])
    alpha = np.array(
        tuple(angular_acceleration(HUMMINGBIRD, inertia, vec(e_R), vec(e_w)))
    )
    torque = -(np.array([0.7, 0.7, 0.035]) * e_R + np.array([0.1, 0.1, 0.025]) * e_w)
    np.testing.assert_allclose(full @ alpha, torque, rtol=1e-14)


def test_yaw_of_an_attitude_is_the_heading_of_its_nose():
    for case in cases(20, seed=5, joints=0):
        nose = case.R[:, 0]
        assert yaw_of(Quaternion(*case.quaternion)) == pytest.approx(
            np.arctan2(nose[1], nose[0]), abs=1e-14
        )


def test_the_model_believes_the_papers_total_mass():
    assert MODEL.vehicle.mass == pytest.approx(0.806, rel=1e-15)
