"""Vec3, Mat3, Sym3 and rotations about an axis, against NumPy and SciPy on every
engine.
"""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.algebra import E_X, E_Y, E_Z, ZERO3, Mat3, Sym3, Vec3, axis_rotation
from skyarm.algebra.matrix import orientation_error
from skyarm.algebra.scalars.taylor import Taylor, nth_derivative
from support.engines import ENGINES, evaluate

RNG = np.random.default_rng(5)
LANES = RNG.normal(size=(4, 21))
ROUNDING = 1e-13  # sums of a dozen products of order one


@pytest.fixture(params=ENGINES)
def engine(request):
    return request.param


def vectors(x):
    return Vec3(*x[:3]), Vec3(*x[3:6])


def matrices(x):
    def matrix(e):
        return Mat3(Vec3(*e[:3]), Vec3(*e[3:6]), Vec3(*e[6:9]))

    return matrix(x[3:12]), matrix(x[12:21])


def flat(value):
    return (
        [entry for row in value.rows for entry in row]
        if isinstance(value, Mat3)
        else list(value)
    )


VECTOR_LAWS = {
    "sum": (lambda a, b: list(a + b), lambda a, b: a + b),
    "difference": (lambda a, b: list(a - b), lambda a, b: a - b),
    "opposite": (lambda a, b: list(-a), lambda a, b: -a),
    "product with a scalar": (
        lambda a, b: [*(a * b.y), *(2.0 * a)],
        lambda a, b: [*(a * b[1]), *(a * 2.0)],
    ),
    "componentwise": (lambda a, b: list(a.hadamard(b)), lambda a, b: a * b),
    "inner": (lambda a, b: [a.dot(b)], lambda a, b: [a @ b]),
    "cross": (lambda a, b: list(a.cross(b)), np.cross),
    "length": (lambda a, b: [a.norm()], lambda a, b: [np.linalg.norm(a)]),
    "cross matrix": (lambda a, b: list(Mat3.cross(a).apply(b)), np.cross),
}


@pytest.mark.parametrize("law", sorted(VECTOR_LAWS))
def test_a_vector_operation_is_that_of_numpy(engine, law):
    ours, reference = VECTOR_LAWS[law]
    found = evaluate(engine, lambda *x: ours(*vectors(x)), LANES)
    wanted = [np.ravel(reference(lane[:3], lane[3:6])) for lane in LANES]
    assert np.allclose(found, wanted, rtol=0.0, atol=ROUNDING)


MATRIX_LAWS = {
    "sum": (lambda v, A, B: A + B, lambda v, A, B: A + B),
    "difference": (lambda v, A, B: A - B, lambda v, A, B: A - B),
    "opposite": (lambda v, A, B: -A, lambda v, A, B: -A),
    "product with a scalar": (lambda v, A, B: A * v.z, lambda v, A, B: A * v[2]),
    "product": (lambda v, A, B: A @ B, lambda v, A, B: A @ B),
    "transpose": (lambda v, A, B: A.T, lambda v, A, B: A.T),
    "apply": (lambda v, A, B: A.apply(v), lambda v, A, B: A @ v),
    "apply transposed": (lambda v, A, B: A.apply_T(v), lambda v, A, B: A.T @ v),
    "middle column": (lambda v, A, B: A.column(1), lambda v, A, B: A[:, 1]),
    "columns": (
        lambda v, A, B: Mat3.columns(A.r0, v, B.r2),
        lambda v, A, B: np.stack([A[0], v, B[2]], axis=1),
    ),
    "vee": (
        lambda v, A, B: A.vee_antisymmetric(),
        lambda v, A, B: (
            0.5 * np.array([A[2, 1] - A[1, 2], A[0, 2] - A[2, 0], A[1, 0] - A[0, 1]])
        ),
    ),
}


@pytest.mark.parametrize("law", sorted(MATRIX_LAWS))
def test_a_matrix_operation_is_that_of_numpy(engine, law):
    ours, reference = MATRIX_LAWS[law]
    found = evaluate(engine, lambda *x: flat(ours(Vec3(*x[:3]), *matrices(x))), LANES)
    wanted = [
        np.ravel(reference(n[:3], n[3:12].reshape(3, 3), n[12:21].reshape(3, 3)))
        for n in LANES
    ]
    assert np.allclose(found, wanted, rtol=0.0, atol=ROUNDING)


def symmetric(e):
    xx, yy, zz, xy, xz, yz = e
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


SYMMETRIC_LAWS = {
    "full": (lambda v, S, P, A: S.full(), lambda v, S, P, A: S),
    "sum": (lambda v, S, P, A: (S + P).full(), lambda v, S, P, A: S + P),
    "difference": (lambda v, S, P, A: (S - P).full(), lambda v, S, P, A: S - P),
    "product with a scalar": (
        lambda v, S, P, A: (S * v.x).full(),
        lambda v, S, P, A: S * v[0],
    ),
    "apply": (lambda v, S, P, A: S.apply(v), lambda v, S, P, A: S @ v),
    "rotated": (lambda v, S, P, A: S.rotate(A).full(), lambda v, S, P, A: A @ S @ A.T),
    "isotropic": (
        lambda v, S, P, A: Sym3.isotropic(v.x).full(),
        lambda v, S, P, A: v[0] * np.eye(3),
    ),
    "of a matrix": (
        lambda v, S, P, A: Sym3.of_matrix(S.full()).full(),
        lambda v, S, P, A: S,
    ),
    "point mass": (
        lambda v, S, P, A: Sym3.parallel_axis(S.xx, v).full(),
        lambda v, S, P, A: S[0, 0] * (v @ v * np.eye(3) - np.outer(v, v)),
    ),
}


@pytest.mark.parametrize("law", sorted(SYMMETRIC_LAWS))
def test_a_symmetric_operation_is_that_of_numpy(engine, law):
    ours, reference = SYMMETRIC_LAWS[law]
    lanes = RNG.normal(size=(4, 24))

    def function(*x):
        A = Mat3(Vec3(*x[15:18]), Vec3(*x[18:21]), Vec3(*x[21:24]))
        return flat(ours(Vec3(*x[:3]), Sym3(*x[3:9]), Sym3(*x[9:15]), A))

    found = evaluate(engine, function, lanes)
    wanted = [
        np.ravel(
            reference(
                n[:3], symmetric(n[3:9]), symmetric(n[9:15]), n[15:24].reshape(3, 3)
            )
        )
        for n in lanes
    ]
    assert np.allclose(found, wanted, rtol=0.0, atol=ROUNDING)


ANGLES = [0.0, 1e-12, 0.3, np.pi / 2, 3.0, np.pi, -2.0, 40.0]


def test_a_rotation_about_an_axis_is_that_of_scipy(engine):
    rotation = pytest.importorskip("scipy.spatial.transform").Rotation
    axes = RNG.normal(size=(len(ANGLES), 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    lanes = np.column_stack([axes, ANGLES])
    found = evaluate(
        engine, lambda x, y, z, angle: flat(axis_rotation(Vec3(x, y, z), angle)), lanes
    )
    wanted = [
        rotation.from_rotvec(axis * angle).as_matrix().ravel()
        for axis, angle in zip(axes, ANGLES, strict=True)
    ]
    assert np.allclose(found, wanted, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("index", range(3))
def test_a_structural_axis_gives_the_elementary_rotation_with_structure_left(
    index, sign
):
    rotation = pytest.importorskip("scipy.spatial.transform").Rotation
    components = [sign if i == index else 0 for i in range(3)]
    R = axis_rotation(Vec3(*components), 0.7)
    wanted = rotation.from_rotvec(0.7 * np.array(components)).as_matrix()
    assert np.allclose(
        np.array(flat(R), dtype=float).reshape(3, 3), wanted, rtol=0.0, atol=1e-15
    )
    assert sum(type(entry) is int for entry in flat(R)) == 5  # a one and four zeros


def test_units_and_described_vectors_are_structure():
    assert E_X.cross(E_Y) == E_Z
    assert E_Y.cross(E_Z) == E_X
    assert E_Z.cross(E_X) == E_Y
    described = Vec3.from_numbers([0.0, -1.0, 0.3])
    assert [type(c) for c in described] == [int, int, float]
    assert all(type(c) is int for c in (*ZERO3, *flat(Mat3.identity())))
    assert [type(c) for c in flat(Mat3.from_numbers(np.eye(3).tolist()))] == [int] * 9
    kinds = [type(c) for c in Sym3.from_numbers(1.0, 2.0, 0.0, xz=0.5).entries]
    assert kinds == [float, float, int, int, float, int]
    assert Sym3.from_numbers(1.0, 2.0, 3.0, 4.0, 5.0, 6.0).entries == (
        1.0,
        2.0,
        3.0,
        4.0,
        5.0,
        6.0,
    )


def test_the_error_of_an_orientation_is_scipys_axis_times_the_sine_of_its_angle():
    rotation = pytest.importorskip("scipy.spatial.transform").Rotation
    for first, second in RNG.normal(size=(8, 2, 3)):
        now, wanted = rotation.from_rotvec(first), rotation.from_rotvec(second)
        turn = (wanted * now.inv()).as_rotvec()
        angle = np.linalg.norm(turn)
        rows = [
            Mat3(*(Vec3(*row) for row in each.as_matrix())) for each in (now, wanted)
        ]
        found = orientation_error(*rows)
        np.testing.assert_allclose(
            list(found), turn / angle * np.sin(angle), atol=1e-14
        )


def test_a_smooth_length_is_the_length_and_has_the_slope_zero_at_zero():
    assert Vec3(3.0, -4.0, 12.0).smooth_norm() == 13.0
    zero = Vec3(*(Taylor.of_derivatives((0.0, 1.0)) for _ in range(3)))
    assert nth_derivative(zero.smooth_norm(), 1) == 0.0
