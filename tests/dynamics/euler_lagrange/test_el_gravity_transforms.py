"""Gravity, Euler rates, and the array front."""

import numpy as np
import pytest
from lagrangian_twin import gravity_vector as twin_gravity_vector
from lagrangian_twin import potential_energy as twin_potential_energy
from lagrangian_twin import rotation as twin_rotation
from lagrangian_twin import states, velocity_jacobians

from skyarm.algebra import Mat3, Vec3
from skyarm.algebra.quaternion import euler_angles
from support import euler_lagrange as el
from support.euler_lagrange import euler_kinematics as kinematics
from support.euler_lagrange import gravity, transforms

Q, QD = states(20, seed=3)


def array(matrix):
    return np.array([list(row) for row in matrix.rows], dtype=float)


def test_potential_energy_is_the_height_of_every_mass():
    for q in Q:
        assert gravity.potential_energy(el.TABLE_1, q, 9.8) == pytest.approx(
            twin_potential_energy(q, 9.8), abs=1e-14
        )


def test_gravity_is_the_gradient_of_the_height_of_every_mass():
    for q in Q:
        np.testing.assert_allclose(
            el.gravity_vector(q, 9.8), twin_gravity_vector(q, 9.8), atol=5e-15
        )


def test_mass_matrix_times_upward_acceleration_is_gravity():
    up = np.array([0, 0, 9.81, 0, 0, 0, 0, 0])
    np.testing.assert_allclose(el.mass_matrix(Q) @ up, el.gravity_vector(Q), atol=5e-15)


def test_reduced_gravity_is_the_joint_part_over_a_level_base_and_nothing_else():
    level = Q.copy()
    level[:, 3:5] = 0.0
    np.testing.assert_allclose(
        el.gravity_vector(Q, reduced=True)[:, 6:],
        el.gravity_vector(level)[:, 6:],
        atol=1e-15,
    )
    assert not el.gravity_vector(Q, reduced=True)[:, :6].any()
    assert (
        np.abs(
            el.gravity_vector(Q)[:, 6:] - el.gravity_vector(Q, reduced=True)[:, 6:]
        ).max()
        > 0.05
    )


def test_both_links_held_out_need_0_147_newton_metres():
    # 9.81 * (0.04 * 0.075 + 0.04 * 0.225 + 0.01 * 0.3); a positive angle is towards -x
    # and the weight pulls it back
    q = np.array([0, 0, 0, 0, 0, 0, np.pi / 2, 0])
    assert el.gravity_vector(q)[6] == pytest.approx(0.14715, abs=1e-12)
    assert el.gravity_vector(q, 9.81, True)[6] == pytest.approx(0.14715, abs=1e-12)


def test_rotation_and_rate_matrix_are_those_of_the_twin():
    for q in Q:
        np.testing.assert_allclose(
            array(kinematics.rotation(*q[3:6])), twin_rotation(q), atol=3e-16
        )
        np.testing.assert_allclose(
            array(kinematics.rate_matrix(q[3], q[4])),
            velocity_jacobians(q)[1][:, 3:6],
            atol=5e-16,
        )


def test_rate_matrix_partials_and_rate_are_complex_steps():
    for q, qd in zip(Q, QD, strict=True):
        along = kinematics.rate_matrix(
            *(
                np.complex128(a) + 1e-30j * v
                for a, v in zip(q[3:5], qd[3:5], strict=True)
            )
        )
        expected = np.array([[np.imag(c) / 1e-30 for c in row] for row in along.rows])
        np.testing.assert_allclose(
            array(transforms.rate_matrix_rate(q[3:6], qd[3:6])), expected, atol=2e-15
        )


def test_inverse_rate_matrix_inverts_and_its_determinant_is_the_measure():
    for q in Q:
        matrix = array(kinematics.rate_matrix(q[3], q[4]))
        # conditioning up to 1/cos(1.3) = 4
        np.testing.assert_allclose(
            array(transforms.rate_matrix_inverse(q[3], q[4])) @ matrix,
            np.eye(3),
            atol=2e-15,
        )
        assert np.linalg.det(matrix) == pytest.approx(
            transforms.singularity_measure(q[4]), abs=1e-15
        )


def test_euler_rates_give_back_the_body_rate():
    for q, qd in zip(Q, QD, strict=True):
        w = velocity_jacobians(q)[1][:, 3:6] @ qd[3:6]
        np.testing.assert_allclose(
            list(transforms.euler_rates(q[3:6], Vec3(*w))), qd[3:6], atol=2e-14
        )


def test_body_torque_does_the_same_work_as_the_generalized_torque():
    for q, qd in zip(Q, QD, strict=True):
        w = velocity_jacobians(q)[1][:, 3:6] @ qd[3:6]
        tau = np.array([0.3, -0.7, 0.2])
        assert el.body_torque(q, tau) @ w == pytest.approx(tau @ qd[3:6], abs=1e-13)


def test_euler_acceleration_is_the_second_derivative_of_angles_that_turn_with_alpha():
    """Differentiate w_B = Q Phidot along a motion of known second derivative; the rate
    of w_B must come back as it.
    """
    for q, qd in zip(Q, QD, strict=True):
        second = np.array([0.4, -1.1, 0.8])
        h = 1e-5

        def body_rate(t, q=q, qd=qd, second=second):
            moved = q.copy()
            moved[3:6] += qd[3:6] * t + 0.5 * second * t * t
            return velocity_jacobians(moved)[1][:, 3:6] @ (qd[3:6] + second * t)

        alpha = (body_rate(h) - body_rate(-h)) / (2 * h)
        # central difference: 1e-9, times the conditioning of Q
        np.testing.assert_allclose(
            el.euler_acceleration(q, qd, alpha), second, atol=5e-8
        )


def test_euler_angles_of_a_rotation_come_back():
    for q in Q:
        R = Mat3(*(Vec3(*row) for row in twin_rotation(q)))
        np.testing.assert_allclose(euler_angles(R), q[3:6], atol=4e-15)


@pytest.mark.parametrize("distance", [1e-3, 1e-5, 3e-6])
def test_euler_angles_keep_their_digits_near_the_singularity(distance):
    q = np.array([0, 0, 0, 0.3, np.pi / 2 - distance, -0.7, 0, 0])
    found = euler_angles(Mat3(*(Vec3(*row) for row in twin_rotation(q))))
    assert found[1] == pytest.approx(q[4], abs=1e-15)
    # roll and yaw are quotients of numbers of size ``distance`` known to 1e-16
    np.testing.assert_allclose(found, q[3:6], atol=1e-15 / distance)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_pitch_of_ninety_degrees_is_refused_in_one_line(side):
    q = np.zeros((3, 8))
    q[1, 4] = side * (np.pi / 2 - 5e-7)
    half = side * np.pi / 4
    for call in (
        lambda: el.body_torque(q, np.zeros(3)),
        lambda: el.euler_acceleration(q, np.zeros(8), np.zeros(3)),
        lambda: el.euler_angles([np.cos(half), 0.0, np.sin(half), 0.0]),
    ):
        with pytest.raises(
            ValueError,
            match=(
                r"^pitch -?(90|89\.99\d+) deg: Euler angles are singular.*90 deg[^\n]*$"
            ),
        ):
            call()
    q[1, 4] = side * (np.pi / 2 - 2e-6)
    assert np.isfinite(el.body_torque(q, np.zeros(3))).all()


def test_functions_without_the_inverse_work_at_ninety_degrees():
    q = np.array([0, 0, 0, 0.2, np.pi / 2, 0.1, 0.3, 0.4])
    assert np.isfinite(el.mass_matrix(q)).all()
    assert np.isfinite(el.coriolis_matrix(q, np.ones(8))).all()


def test_leading_axes_broadcast_and_a_batch_equals_a_loop_of_singles():
    q, qd = Q[:6].reshape(2, 3, 8), QD[0]
    for call, shape in (
        (el.mass_matrix, (8, 8)),
        (el.mass_matrix_derivative, (8, 8, 8)),
        (lambda a: el.coriolis_matrix(a, qd), (8, 8)),
        (lambda a: el.coriolis_matrix_numeric(a, qd), (8, 8)),
        (el.gravity_vector, (8,)),
        (lambda a: el.gravity_vector(a, reduced=True), (8,)),
        (lambda a: el.body_torque(a, [0.1, 0.2, 0.3]), (3,)),
        (lambda a: el.euler_acceleration(a, qd, [0.1, 0.2, 0.3]), (3,)),
    ):
        batch = call(q)
        assert batch.shape == (2, 3, *shape)
        singles = np.array([[call(one) for one in row] for row in q])
        # the sine of a NumPy batch and that of math may differ in the last bit; divided
        # by 2 * 6e-6 that is 1e-10
        np.testing.assert_allclose(
            batch, singles, atol=1e-10 if call(q[0, 0]).shape == (8, 8) else 1e-13
        )


def test_wrong_shapes_are_refused_with_the_shape():
    with pytest.raises(ValueError, match=r"q: shape \(7,\), allowed \(\.\.\., 8\)"):
        el.mass_matrix(np.zeros(7))
    with pytest.raises(ValueError, match=r"qd: shape \(2, 6\)"):
        el.coriolis_matrix(np.zeros(8), np.zeros((2, 6)))
    with pytest.raises(ValueError, match=r"q: shape \(\)"):
        el.gravity_vector(0.0)
    with pytest.raises(ValueError, match=r"\(2,\), \(3,\).*do not broadcast"):
        el.coriolis_matrix(np.zeros((2, 8)), np.zeros((3, 8)))
    with pytest.raises(ValueError, match=r"euler_torque: shape \(2,\)"):
        el.body_torque(np.zeros(8), np.zeros(2))
