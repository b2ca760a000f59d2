"""Coriolis matrix of the 8x8 form."""

import numpy as np
import pytest
from lagrangian_twin import mass_matrix as twin_mass_matrix
from lagrangian_twin import potential_energy, states

from skyarm import compile as program
from support import euler_lagrange as el
from support.euler_lagrange import coriolis, gravity, mass
from support.euler_lagrange import euler_kinematics as kinematics

Q, QD = states(20, seed=2)


def trajectory(t):
    """A smooth motion with every coordinate moving, and its rate."""
    a = np.array([0.3, -0.2, 0.5, 0.8, 1.1, 1.5, 1.2, -0.9])
    w = np.array([1.1, 0.7, 1.9, 1.3, 0.9, 1.7, 2.3, 3.1])
    return a * np.sin(w * t + np.arange(8)), a * w * np.cos(w * t + np.arange(8))


@pytest.mark.parametrize("t", [0.0, 0.4, 1.1, 2.7, 5.0])
def test_mass_rate_minus_twice_c_is_skew_by_differences_along_a_trajectory(t):
    h = 3e-4
    M = [twin_mass_matrix(trajectory(t + k * h)[0]) for k in (-2, -1, 1, 2)]
    rate = (M[0] - 8 * M[1] + 8 * M[2] - M[3]) / (12 * h)
    N = rate - 2.0 * el.coriolis_matrix(*trajectory(t))
    assert np.abs(rate).max() > 1e-3
    # five-point difference: h^4/30 |M^(5)| is near 2e-13 at these rates, rounding
    # 3e-16/h near 1e-12
    np.testing.assert_allclose(N + N.T, 0.0, atol=1e-11)


def test_residual_as_the_paper_logs_it_is_small_and_sees_a_wrong_c():
    for q, qd in zip(Q, QD, strict=True):
        C, rate = (
            coriolis.coriolis_matrix(el.TABLE_1, q, qd),
            coriolis.mass_rate(el.TABLE_1, q, qd),
        )
        assert coriolis.skew_residual(rate, C) < 1e-8
        wrong = [[2.0 * entry for entry in row] for row in C]
        assert coriolis.skew_residual(rate, wrong) > 0.5  # N + N^T = -2 dM/dt
    still = coriolis.mass_rate(el.TABLE_1, list(Q[0]), [0.0] * 8)
    assert coriolis.skew_residual(still, [[0.0] * 8 for _ in range(8)]) == 0.0


def test_mass_rate_is_the_partials_times_the_rates():
    for q, qd in zip(Q, QD, strict=True):
        expected = np.einsum("kij,k->ij", el.mass_matrix_derivative(q), qd)
        found = np.array(coriolis.mass_rate(el.TABLE_1, list(q), list(qd)), dtype=float)
        # central difference of step 6e-6
        np.testing.assert_allclose(found, expected, atol=2e-9)


def test_numeric_c_as_published_is_within_1e_7_of_the_analytic_one():
    difference = np.abs(
        el.coriolis_matrix_numeric(Q, QD) - el.coriolis_matrix(Q, QD)
    ).max()
    assert 0.0 < difference < 1e-7


def test_a_ten_times_larger_step_has_a_hundred_times_the_error():
    errors = [
        np.abs(
            el.coriolis_matrix_numeric(Q, QD, step=h) - el.coriolis_matrix(Q, QD)
        ).max()
        for h in (1e-2, 1e-3)
    ]
    assert errors[0] / errors[1] == pytest.approx(100.0, rel=0.02)


def test_force_is_the_matrix_times_the_rates():
    for q, qd in zip(Q, QD, strict=True):
        force = np.array(coriolis.coriolis_force(el.TABLE_1, q, qd), dtype=float)
        np.testing.assert_allclose(force, el.coriolis_matrix(q, qd) @ qd, atol=1e-15)


def test_force_is_lagranges_equation_of_the_twins_kinetic_energy():
    """C qd = d/dt (dT/dqd) at zero acceleration - dT/dq, from differences of the twin's
    M only.
    """
    h = 1e-5
    for q, qd in zip(Q[:6], QD[:6], strict=True):
        momentum_rate = (
            (twin_mass_matrix(q + h * qd) - twin_mass_matrix(q - h * qd)) @ qd / (2 * h)
        )
        slope = np.array(
            [
                qd
                @ (twin_mass_matrix(q + h * e) - twin_mass_matrix(q - h * e))
                @ qd
                / (4 * h)
                for e in np.eye(8)
            ]
        )
        # the difference's truncation h^2/6 |qd|^4 |M'''| is near 1e-9
        np.testing.assert_allclose(
            el.coriolis_matrix(q, qd) @ qd, momentum_rate - slope, atol=5e-9
        )


def test_closed_form_of_the_arm_is_the_block_while_the_base_does_not_turn():
    for q, qd in zip(Q, QD, strict=True):
        arm_only = np.concatenate([qd[:3], np.zeros(3), qd[6:]])
        closed = np.array(coriolis.C_ee(el.TABLE_1, q[7], qd[6:]), dtype=float)
        np.testing.assert_allclose(
            el.coriolis_matrix(q, arm_only)[6:, 6:], closed, atol=1e-17
        )


def test_whole_joint_block_has_the_pitch_rate_of_the_body_added_to_the_first_joint():
    for q, qd in zip(Q, QD, strict=True):
        w = kinematics.rate_matrix(q[3], q[4]).apply(kinematics.Vec3(*qd[3:6]))
        turned = np.array(
            coriolis.C_ee(el.TABLE_1, q[7], (qd[6] + w.y, qd[7])), dtype=float
        )
        np.testing.assert_allclose(
            el.coriolis_matrix(q, qd)[6:, 6:], turned, atol=1e-17
        )


def free_motion():
    """Traced right-hand side: M, C qd and G at once."""

    def terms(q, qd):
        M = mass.mass_matrix(el.TABLE_1, q)
        rows = tuple(tuple(row) for row in M)
        return (
            rows,
            tuple(coriolis.coriolis_force(el.TABLE_1, q, qd)),
            tuple(gravity.gravity_vector(el.TABLE_1, q, 9.81)),
        )

    traced = program.trace(terms, (0.0,) * 8, (0.0,) * 8)

    def right_hand_side(_, x):
        M, force, weight = traced(tuple(x[:8].tolist()), tuple(x[8:].tolist()))
        return np.concatenate(
            [x[8:], np.linalg.solve(np.array(M), -np.array(force) - np.array(weight))]
        )

    return right_hand_side


def test_free_motion_keeps_energy_and_horizontal_momentum():
    integrate = pytest.importorskip("scipy.integrate")
    start = np.array(
        [0, 0, 1, 0.2, -0.1, 0.4, 0.5, -0.8, 0.3, -0.2, 4.0, 0.9, 0.4, 1.2, 6.0, -9.0]
    )
    found = integrate.solve_ivp(
        free_motion(), (0.0, 1.0), start, method="DOP853", rtol=1e-12, atol=1e-12
    )
    assert found.success
    energy, momentum = [], []
    for x in found.y.T:
        M = twin_mass_matrix(x[:8])
        energy.append(0.5 * x[8:] @ M @ x[8:] + potential_energy(x[:8], 9.81))
        momentum.append(M[:2] @ x[8:])
    assert np.ptp(found.y[6]) > 1.0  # the arm swings
    # tolerance 1e-12 a step over about a hundred steps, energies of 20 J
    np.testing.assert_allclose(energy, energy[0], atol=1e-9)
    np.testing.assert_allclose(
        momentum, np.broadcast_to(momentum[0], (len(momentum), 2)), atol=1e-10
    )
