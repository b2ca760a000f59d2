"""One source on every engine: floats, NumPy batch, traced program, JAX, CasADi."""

import numpy as np
import pytest
from lagrangian_twin import states

from skyarm import compile as program
from skyarm.algebra import Vec3
from skyarm.algebra.quaternion import euler_angles
from support import euler_lagrange as el
from support.engines import jax_doubles
from support.euler_lagrange import coriolis, gravity, mass, mass_derivative, transforms

Q, QD = states(7, seed=5)


def nested(values):
    return (
        tuple(nested(value) for value in values)
        if isinstance(values, (list, tuple))
        else values
    )


def everything(par, q, qd):
    """Every formula of the room at one state, as nested tuples of scalars."""
    C = coriolis.coriolis_matrix(par, q, qd)
    matrices = (
        mass_derivative.mass_matrix_partials(par, q)[3:],
        C,
        coriolis.coriolis_central_differences(par, q, qd, step=1e-3),
        coriolis.skew_residual(coriolis.mass_rate(par, q, qd, step=1e-3), C),
    )
    return (*equations(par, q, qd), *nested(matrices))


def equations(par, q, qd):
    """What a law needs: all but the matrices that compile slowly where equal
    expressions are not shared.
    """
    angles, rates = q[3:6], qd[3:6]
    inverse = transforms.rate_matrix_inverse(q[3], q[4])
    return nested(
        (
            mass.mass_matrix(par, q),
            coriolis.coriolis_force(par, q, qd),
            coriolis.C_ee(par, q[7], qd[6:]),
            gravity.gravity_vector(par, q, 9.81),
            gravity.reduced_joint_gravity(par, q[6:], 9.81),
            gravity.potential_energy(par, q, 9.81),
            tuple(transforms.body_torque(angles, Vec3(*qd[:3]))),
            tuple(transforms.euler_acceleration(angles, rates, Vec3(*qd[:3]))),
            tuple(transforms.euler_rates(angles, Vec3(*qd[:3]))),
            euler_angles(mass.Attitude.of(q).R),
            transforms.singularity_measure(q[4]),
            tuple(tuple(row) for row in inverse.rows),
        )
    )


def floats(q, qd):
    return everything(el.TABLE_1, tuple(map(float, q)), tuple(map(float, qd)))


def flat(values):
    return (
        [leaf for value in values for leaf in flat(value)]
        if isinstance(values, tuple)
        else [values]
    )


EXPECTED = np.array(
    [[float(leaf) for leaf in flat(floats(q, qd))] for q, qd in zip(Q, QD, strict=True)]
)
# sin and cos of two libraries differ by one unit in the last place; the central
# differences divide that by 2e-3
TOLERANCE = 2e-12


def test_traced_program_equals_the_floats_bit_for_bit():
    traced = program.trace(
        everything, el.TABLE_1, tuple(Q[0].tolist()), tuple(QD[0].tolist())
    )
    for q, qd in zip(Q, QD, strict=True):
        found = traced(el.TABLE_1, tuple(q.tolist()), tuple(qd.tolist()))
        assert flat(found) == flat(floats(q, qd))


def test_numpy_batch_equals_the_floats():
    found = everything(el.TABLE_1, tuple(Q.T), tuple(QD.T))
    batch = np.stack([np.broadcast_to(leaf, len(Q)) for leaf in flat(found)], axis=1)
    np.testing.assert_allclose(batch, EXPECTED, atol=TOLERANCE)


@pytest.mark.thorough
def test_jax_batch_equals_the_floats():
    jax = pytest.importorskip("jax")

    def leaves(q, qd):
        return [
            jax.numpy.asarray(leaf, dtype=float)
            for leaf in flat(equations(el.TABLE_1, tuple(q), tuple(qd)))
        ]

    with jax_doubles():
        found = np.stack(np.broadcast_arrays(*jax.jit(jax.vmap(leaves))(Q, QD)), axis=1)
    np.testing.assert_allclose(found, EXPECTED[:, : found.shape[1]], atol=TOLERANCE)


def test_jax_differentiates_the_potential_to_gravity():
    jax = pytest.importorskip("jax")
    with jax_doubles():
        for q in Q[:3]:
            gradient = jax.grad(
                lambda x: gravity.potential_energy(el.TABLE_1, x, 9.81)
            )(jax.numpy.asarray(q))
            np.testing.assert_allclose(gradient, el.gravity_vector(q), atol=5e-15)


def test_casadi_equals_the_floats():
    import casadi

    q, qd = casadi.SX.sym("q", 8), casadi.SX.sym("qd", 8)
    expression = everything(
        el.TABLE_1, tuple(casadi.vertsplit(q)), tuple(casadi.vertsplit(qd))
    )
    function = casadi.Function(
        "everything", [q, qd], [casadi.vertcat(*flat(expression))]
    )
    for row, (a, b) in enumerate(zip(Q, QD, strict=True)):
        np.testing.assert_allclose(
            np.array(function(a, b)).ravel(), EXPECTED[row], atol=TOLERANCE
        )


def test_structural_zeros_of_the_planar_arm_stay_structural():
    """What cannot couple is an int, so that it costs nothing anywhere: no program
    computes a zero.
    """
    q = tuple(Q[0].tolist())
    M = mass.mass_matrix(el.TABLE_1, q)
    assert all(type(M[i][j]) is int for i in range(3) for j in range(3) if i != j)
    assert type(M[3][6]) is int  # roll and the joints: Q^T ey has no roll entry
    assert type(M[3][7]) is int
    partials = mass_derivative.mass_matrix_partials(el.TABLE_1, q)
    assert all(
        type(value) is int for k in range(3) for row in partials[k] for value in row
    )
    # yaw turns only M_tr and M_te
    assert all(type(partials[5][i][j]) is int for i in range(3, 8) for j in range(3, 8))


def test_operation_counts_do_not_grow():
    """Counts are a property of the source; a lost structural zero or a lost shared
    expression shows here first.
    """
    q, qd = tuple(Q[0].tolist()), tuple(QD[0].tolist())

    def count(function, *examples):
        return sum(program.trace(function, *examples).operations().values())

    assert count(lambda x: nested(mass.mass_matrix(el.TABLE_1, x)), q) <= 196
    assert (
        count(lambda x, v: tuple(coriolis.coriolis_force(el.TABLE_1, x, v)), q, qd)
        <= 1140
    )
