"""Quaternion laws against SciPy's Rotation, on every engine."""

from __future__ import annotations

import math

import numpy as np
import pytest

from skyarm.algebra import Quaternion, Vec3
from support.engines import ENGINES, evaluate, jax_doubles

Rotation = pytest.importorskip("scipy.spatial.transform").Rotation
RNG = np.random.default_rng(6)


@pytest.fixture(params=ENGINES)
def engine(request):
    return request.param


def unit(rng, count):
    q = rng.normal(size=(count, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def scipy_rotation(wxyz):
    w, x, y, z = wxyz
    return Rotation.from_quat([x, y, z, w])


ATTITUDES = np.vstack(
    [unit(RNG, 5), np.eye(4), -np.eye(4), [[math.sqrt(0.5), 0, math.sqrt(0.5), 0]]]
)


def test_the_rotation_of_a_quaternion_is_that_of_scipy(engine):
    found = evaluate(
        engine,
        lambda *q: [e for row in Quaternion(*q).rotation().rows for e in row],
        ATTITUDES,
    )
    wanted = [scipy_rotation(q).as_matrix().ravel() for q in ATTITUDES]
    assert np.allclose(found, wanted, rtol=0.0, atol=1e-15)


def test_a_product_turns_by_the_right_factor_first(engine):
    lanes = np.hstack([unit(RNG, 6), unit(RNG, 6)])

    def function(*x):
        product = Quaternion(*x[:4]) * Quaternion(*x[4:])
        return [e for row in product.rotation().rows for e in row]

    found = evaluate(engine, function, lanes)
    wanted = [
        (scipy_rotation(n[:4]).as_matrix() @ scipy_rotation(n[4:]).as_matrix()).ravel()
        for n in lanes
    ]
    assert np.allclose(found, wanted, rtol=0.0, atol=1e-14)


def test_a_product_follows_hamiltons_i_j_k():
    one, i, j, k = (Quaternion(*row) for row in np.eye(4).tolist())
    minus_one = Quaternion(-1.0, 0.0, 0.0, 0.0)
    assert i * i == j * j == k * k == i * j * k == minus_one
    assert i * j == k
    assert one * k == k


VECTORS = [
    [0.0, 0.0, 0.0],
    [1e-9, -2e-9, 3e-9],
    [5e-5, 0, 0],
    [0.99e-4, 0, 0],
    [1.01e-4, 0, 0],
    [0.3, -0.2, 0.9],
]
VECTORS += [[0.0, math.pi, 0.0], [2.0, 3.0, -4.0], [0.0, 0.0, 7.0]]


def test_the_quaternion_of_a_rotation_vector_is_that_of_scipy_also_near_zero(engine):
    found = evaluate(
        engine, lambda *v: list(Quaternion.of_rotation_vector(Vec3(*v))), VECTORS
    )
    wanted = []
    for v in VECTORS:
        x, y, z, w = Rotation.from_rotvec(v).as_quat()
        # past a turn ours goes on, SciPy's may not
        same_half = np.sign(w * math.cos(0.5 * np.linalg.norm(v)) or 1.0)
        wanted.append(same_half * np.array([w, x, y, z]))
    assert np.allclose(found, wanted, rtol=1e-13, atol=2e-16)


@pytest.mark.parametrize(
    "v", [[0.0, 0.0, 0.0], [3e-5, 0.0, -4e-5], [6e-5, 8.1e-5, 0.0], [0.3, -0.2, 0.9]]
)
def test_the_gradient_of_a_rotation_vectors_quaternion_is_right_at_and_beside_zero(v):
    jax = pytest.importorskip("jax")

    def quaternion(vector):
        return jax.numpy.stack([*Quaternion.of_rotation_vector(Vec3(*vector))])

    with jax_doubles():
        jacobian = np.array(jax.jacobian(quaternion)(np.array(v)))
    h = 1e-4
    for column, unit_vector in zip(jacobian.T, np.eye(3), strict=True):
        ahead, behind = (
            np.roll(Rotation.from_rotvec(v + s * h * unit_vector).as_quat(), 1)
            for s in (1.0, -1.0)
        )
        # central difference: h^2 / 6 of a third derivative of at most 1/8, and rounding
        # 1e-16 / h
        assert np.allclose(column, (ahead - behind) / (2.0 * h), rtol=0.0, atol=1e-9)


def test_normalisation_gives_unit_length_and_keeps_the_direction(engine):
    lanes = 3.0 * RNG.normal(size=(5, 4))
    found = evaluate(engine, lambda *q: list(Quaternion(*q).normalized()), lanes)
    assert np.allclose(
        found,
        lanes / np.linalg.norm(lanes, axis=1, keepdims=True),
        rtol=0.0,
        atol=1e-15,
    )
    # 0 * inf: NumPy warns of it in its own operators
    with np.errstate(invalid="ignore"):
        zero = evaluate(
            engine, lambda *q: list(Quaternion(*q).normalized()), [[0.0] * 4]
        )
    assert np.all(np.isnan(zero))


def test_the_derivative_is_the_limit_of_a_small_turn_in_body_axes(engine):
    lanes = np.hstack([unit(RNG, 4), RNG.normal(size=(4, 3))])
    found = evaluate(
        engine, lambda *x: list(Quaternion(*x[:4]).derivative(Vec3(*x[4:]))), lanes
    )
    h = 1e-5
    for rate, lane in zip(found, lanes, strict=True):
        steps = []
        for sign in (1.0, -1.0):
            x, y, z, w = (
                scipy_rotation(lane[:4]) * Rotation.from_rotvec(sign * h * lane[4:])
            ).as_quat()
            step = np.array([w, x, y, z])
            steps.append(step * np.sign(step @ lane[:4]))
        # central difference: h^2 = 1e-10 of a third derivative of order one
        assert np.allclose(rate, (steps[0] - steps[1]) / (2.0 * h), rtol=0.0, atol=1e-9)


def test_the_derivative_is_orthogonal_to_the_quaternion(engine):
    lanes = np.hstack([unit(RNG, 4), RNG.normal(size=(4, 3))])

    def function(*x):
        q = Quaternion(*x[:4])
        return [
            sum(
                (a * b for a, b in zip(q, q.derivative(Vec3(*x[4:])), strict=True)),
                start=0.0,
            )
        ]

    assert np.abs(evaluate(engine, function, lanes)).max() < 1e-15


def test_plus_adds_a_multiple(engine):
    lanes = RNG.normal(size=(3, 9))
    found = evaluate(
        engine,
        lambda *x: list(Quaternion(*x[:4]).plus(Quaternion(*x[4:8]), x[8])),
        lanes,
    )
    assert np.allclose(
        found, lanes[:, :4] + lanes[:, 8:] * lanes[:, 4:8], rtol=0.0, atol=1e-15
    )


@pytest.mark.parametrize(
    ("size", "tolerance"),
    [
        (0.0, 0.0),
        (1e-300, 0.0),
        (1e-9, 1e-15),
        (1e-3, 1e-15),
        (0.5, 1e-15),
        (1.0, 1e-15),
        (3.0, 4e-11),
        (10.0, 2e-4),
    ],
)
@pytest.mark.parametrize("seconds", [1.0, 0.001])
def test_a_small_rotation_is_the_exact_one_up_to_a_radian_and_near_it_up_to_ten(
    engine, size, tolerance, seconds
):
    """Against SciPy; past 1 rad the first term that the series leave out, (angle /
    4)^12 / 13!, times the angle.
    """
    Rotation = pytest.importorskip("scipy.spatial.transform").Rotation
    directions = np.random.default_rng(4).normal(size=(6, 3))
    lanes = size * directions / np.linalg.norm(directions, axis=1)[:, None]
    found = evaluate(
        engine,
        lambda *v: list(Quaternion.of_small_rotation(Vec3(*v), seconds)),
        lanes / seconds,
    )
    for row, v in zip(found, lanes, strict=True):
        x, y, z, w = Rotation.from_rotvec(v).as_quat()
        half = np.array([w, x, y, z]) * (
            np.sign(w) * np.sign(np.cos(0.5 * size)) or 1.0
        )
        assert np.allclose(row, half, rtol=0.0, atol=max(tolerance, 2.3e-16))
        assert np.allclose(row[1:], 0.5 * v, rtol=1e-7, atol=0.0) or size > 1e-4


def test_a_quaternion_that_is_nearly_of_unit_length_is_renormalised(engine):
    """One Newton step leaves 3/8 of the square of the error of the squared length: 1e-7
    off becomes 2e-14.
    """
    q = np.random.default_rng(5).normal(size=(5, 4))
    q *= (1.0 + np.array([0.0, 1e-16, -3e-9, 1e-7, -1e-7]) / 2.0)[
        :, None
    ] / np.linalg.norm(q, axis=1)[:, None]
    found = evaluate(engine, lambda *x: list(Quaternion(*x).renormalized()), q)
    assert np.allclose(
        found, q / np.linalg.norm(q, axis=1)[:, None], rtol=0.0, atol=2e-14
    )
