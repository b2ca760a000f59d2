"""Mass matrix of the 8x8 form and its partials."""

import numpy as np
import pytest
from lagrangian_twin import mass_matrix as twin_mass_matrix
from lagrangian_twin import states

from support import euler_lagrange as el
from support.euler_lagrange import euler_kinematics as kinematics
from support.euler_lagrange import mass, mass_derivative

BLOCKS = {
    "tt": (slice(0, 3), slice(0, 3)),
    "tr": (slice(0, 3), slice(3, 6)),
    "rr": (slice(3, 6), slice(3, 6)),
    "te": (slice(0, 3), slice(6, 8)),
    "re": (slice(3, 6), slice(6, 8)),
    "ee": (slice(6, 8), slice(6, 8)),
}
Q, QD = states(20, seed=1)


@pytest.mark.parametrize("block", BLOCKS)
def test_each_block_is_the_hessian_of_the_kinetic_energy_of_the_moving_masses(block):
    rows, columns = BLOCKS[block]
    for q in Q:
        # entries up to 0.8: a few roundings
        np.testing.assert_allclose(
            el.mass_matrix(q)[rows, columns],
            twin_mass_matrix(q)[rows, columns],
            atol=5e-16,
        )


def test_mass_matrix_is_symmetric_to_the_bit_and_positive_definite():
    M = el.mass_matrix(Q)
    assert np.array_equal(M, np.swapaxes(M, -1, -2))
    assert np.linalg.eigvalsh(M).min() > 1e-6


def test_hanging_arm_over_a_level_base_gives_hand_numbers():
    M = el.mass_matrix(np.zeros(8))
    assert M[0, 0] == pytest.approx(0.806, abs=1e-15)
    # s_z = -(0.04 * 0.075 + 0.04 * 0.225 + 0.01 * 0.3) = -0.015 kg m: pitching up by y
    # swings the mass to -x
    assert M[0, 4] == pytest.approx(-0.015, abs=1e-15)
    assert M[1, 3] == pytest.approx(+0.015, abs=1e-15)
    # joint 1 moves the same mass; joint 2 only link 2 and the tip: -(0.04 * 0.075 +
    # 0.01 * 0.15)
    assert M[0, 6] == pytest.approx(-0.015, abs=1e-15)
    assert M[0, 7] == pytest.approx(-0.0045, abs=1e-15)
    # 0.04 * 0.075^2 + 0.04 * 0.225^2 + 0.01 * 0.3^2 + 2 * 7.5e-5 = 0.0033
    assert M[6, 6] == pytest.approx(0.0033, abs=1e-15)
    assert M[4, 4] == pytest.approx(0.0033 + 0.007, abs=1e-15)
    assert M[4, 6] == pytest.approx(0.0033, abs=1e-15)
    assert M[7, 7] == pytest.approx(
        0.04 * 0.075**2 + 0.01 * 0.15**2 + 7.5e-5, abs=1e-15
    )


def test_positive_joint_angles_swing_the_tip_towards_minus_x():
    tip = kinematics.end_effector(el.TABLE_1, (0.3, 0.2)).p
    assert (tip.x, tip.z) == pytest.approx(
        (-0.15 * (np.sin(0.3) + np.sin(0.5)), -0.15 * (np.cos(0.3) + np.cos(0.5)))
    )


def complex_step_partial(q, k):
    z = [np.complex128(value) for value in q]
    z[k] += 1e-30j
    return np.array(mass.mass_matrix(el.TABLE_1, z), dtype=complex).imag / 1e-30


@pytest.mark.parametrize("k", range(8))
@pytest.mark.parametrize("block", BLOCKS)
def test_partials_of_each_block_equal_complex_steps(block, k):
    rows, columns = BLOCKS[block]
    for q in Q:
        analytic = el.mass_matrix_derivative(q)[k]
        # both are exact up to rounding; entries are below 0.1
        np.testing.assert_allclose(
            analytic[rows, columns],
            complex_step_partial(q, k)[rows, columns],
            atol=2e-16,
        )


def test_partials_equal_central_differences_of_the_twin():
    h = 1e-5
    for q in Q[:5]:
        for k in range(8):
            step = np.eye(8)[k] * h
            difference = (twin_mass_matrix(q + step) - twin_mass_matrix(q - step)) / (
                2 * h
            )
            # truncation h^2/6 |M'''| and rounding 1e-16/h are both near 1e-11
            np.testing.assert_allclose(
                el.mass_matrix_derivative(q)[k], difference, atol=5e-11
            )


def test_second_partials_of_the_points_are_complex_steps_of_their_jacobians():
    for q in Q:
        for make in (kinematics.link1, kinematics.link2, kinematics.end_effector):
            exact = make(el.TABLE_1, q[6:])
            for j in range(2):
                z = [np.complex128(value) for value in q[6:]]
                z[j] += 1e-30j
                moved = make(el.TABLE_1, z)
                assert [np.imag(c) / 1e-30 for c in moved.p] == pytest.approx(
                    list(exact.J[j]), abs=1e-16
                )
                for c in range(2):
                    stepped = [np.imag(value) / 1e-30 for value in moved.J[c]]
                    assert stepped == pytest.approx(list(exact.dJ[j][c]), abs=1e-16)


def test_appendix_c_as_printed_is_not_the_derivative():
    """(A9) with a zero first column and (A18) without S(dp/dth1) J miss whole terms, so
    the corrections are needed.
    """
    q = np.array([0, 0, 0, 0.1, 0.2, 0.3, 0.4, 0.9])
    par = el.TABLE_1
    attitude, points = kinematics.Attitude.of(q), kinematics.arm_points(par, q)
    first_column = np.array(
        list(mass_derivative.dM_te_by_joint(attitude, points, 1)[0])
    )
    c12 = (par.m2 * par.lc2 + par.me * par.L2) * np.sin(1.3)
    c32 = (par.m2 * par.lc2 + par.me * par.L2) * np.cos(1.3)
    R = np.array([list(row) for row in attitude.R.rows])
    np.testing.assert_allclose(first_column, R @ [c12, 0, c32], atol=1e-17)
    np.testing.assert_allclose(
        complex_step_partial(q, 7)[:3, 6], R @ [c12, 0, c32], atol=1e-17
    )
    printed = np.zeros(3)
    for point in points:
        printed += point.mass * np.cross(list(point.p), list(point.dJ[0][1]))
    Q_T = np.array([list(row) for row in attitude.Q.rows]).T
    missing = complex_step_partial(q, 6)[3:6, 7] - Q_T @ printed
    swept = sum(
        point.mass * np.cross(list(point.J[0]), list(point.J[1])) for point in points
    )
    assert np.abs(missing).max() > 1e-4
    np.testing.assert_allclose(missing, Q_T @ swept, atol=1e-17)
