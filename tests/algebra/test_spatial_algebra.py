"""Spatial motions, forces and inertias against 6x6 NumPy matrices, on every engine."""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.algebra import (
    ArticulatedInertia,
    Force,
    Mat3,
    Motion,
    SpatialInertia,
    Sym3,
    Vec3,
    axis_rotation,
)
from support.engines import ENGINES, evaluate
from support.vehicles import (
    array3,
    inertia33,
    random_body,
    random_quaternion,
    rotation_matrix,
)

ROUNDING = 1e-13
RNG = np.random.default_rng(8)


@pytest.fixture(params=ENGINES)
def engine(request):
    return request.param


def S(v):
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def matrix(entries):
    return Mat3(Vec3(*entries[:3]), Vec3(*entries[3:6]), Vec3(*entries[6:9]))


def motion_transform(R, p):
    """6x6 that takes (angular, linear) at the parent's origin, parent axes, to the
    child's: Featherstone's X.
    """
    zero = np.zeros((3, 3))
    return np.block([[R.T, zero], [-R.T @ S(p), R.T]])


def poses(count):
    return np.array(
        [
            [*rotation_matrix(random_quaternion(RNG)).ravel(), *RNG.normal(size=3)]
            for _ in range(count)
        ]
    )


def split_pose(row):
    return row[:9].reshape(3, 3), row[9:12]


def test_a_motion_moves_into_a_child_by_the_6x6_transform(engine):
    lanes = np.hstack([poses(4), RNG.normal(size=(4, 6))])

    def function(*x):
        a = Motion(Vec3(*x[12:15]), Vec3(*x[15:18])).into_child(
            matrix(x), Vec3(*x[9:12])
        )
        return [*a.angular, *a.linear]

    found = evaluate(engine, function, lanes)
    wanted = [motion_transform(*split_pose(row)) @ row[12:] for row in lanes]
    assert np.allclose(found, wanted, rtol=0.0, atol=ROUNDING)


def test_a_force_moves_into_a_parent_by_the_transposed_transform(engine):
    lanes = np.hstack([poses(4), RNG.normal(size=(4, 6))])

    def function(*x):
        f = Force(Vec3(*x[12:15]), Vec3(*x[15:18])).into_parent(
            matrix(x), Vec3(*x[9:12])
        )
        return [*f.torque, *f.force]

    found = evaluate(engine, function, lanes)
    wanted = [motion_transform(*split_pose(row)).T @ row[12:] for row in lanes]
    assert np.allclose(found, wanted, rtol=0.0, atol=ROUNDING)


def test_the_power_of_a_force_is_the_same_in_parent_and_child(engine):
    lanes = np.hstack([poses(4), RNG.normal(size=(4, 12))])

    def function(*x):
        R, p = matrix(x), Vec3(*x[9:12])
        motion, force = (
            Motion(Vec3(*x[12:15]), Vec3(*x[15:18])),
            Force(Vec3(*x[18:21]), Vec3(*x[21:24])),
        )
        return [motion.into_child(R, p).dot(force), motion.dot(force.into_parent(R, p))]

    found = evaluate(engine, function, lanes)
    assert np.allclose(found[:, 0], found[:, 1], rtol=0.0, atol=ROUNDING)


def test_sums_differences_and_multiples_are_those_of_six_numbers(engine):
    lanes = RNG.normal(size=(3, 13))

    def function(*x):
        a, b = (
            Motion(Vec3(*x[:3]), Vec3(*x[3:6])),
            Motion(Vec3(*x[6:9]), Vec3(*x[9:12])),
        )
        f, g = Force(Vec3(*x[:3]), Vec3(*x[3:6])), Force(Vec3(*x[6:9]), Vec3(*x[9:12]))
        motions = [a + b, a * x[12]]
        forces = [f + g, f - g, f * x[12]]
        return [c for m in motions for c in (*m.angular, *m.linear)] + [
            c for h in forces for c in (*h.torque, *h.force)
        ]

    found = evaluate(engine, function, lanes)
    a, b, s = lanes[:, :6], lanes[:, 6:12], lanes[:, 12:]
    assert np.allclose(
        found, np.hstack([a + b, a * s, a + b, a - b, a * s]), rtol=0.0, atol=1e-15
    )


def bodies(count):
    """Rows m, c, and the six entries of the inertia about c; with the 6x6 inertia about
    the origin of each.
    """
    rows, inertias = [], []
    for _ in range(count):
        body = random_body(RNG, size=0.6)
        m, c, inertia = body.mass, array3(body.com), inertia33(body)
        rows.append([m, *c, *(float(e) for e in body.inertia.entries)])
        inertias.append(
            np.block(
                [[inertia + m * S(c).T @ S(c), m * S(c)], [m * S(c).T, m * np.eye(3)]]
            )
        )
    return np.array(rows), inertias


def rigid(x):
    return SpatialInertia.of_body(x[0], Vec3(*x[1:4]), Sym3(*x[4:10]))


def wrench(f):
    return [*f.torque, *f.force]


def test_a_rigid_inertia_applies_as_its_6x6_matrix(engine):
    rows, inertias = bodies(4)
    lanes = np.hstack([rows, RNG.normal(size=(4, 6))])
    both = evaluate(
        engine,
        lambda *x: [
            *wrench(rigid(x).apply(Motion(Vec3(*x[10:13]), Vec3(*x[13:16])))),
            *wrench(
                rigid(x)
                .as_articulated()
                .apply(Motion(Vec3(*x[10:13]), Vec3(*x[13:16])))
            ),
        ],
        lanes,
    )
    wanted = [inertia @ row[10:] for inertia, row in zip(inertias, lanes, strict=True)]
    assert np.allclose(both[:, :6], wanted, rtol=0.0, atol=ROUNDING)
    assert np.allclose(both[:, 6:], wanted, rtol=0.0, atol=ROUNDING)


def test_a_rigid_inertia_moves_into_a_parent_as_x_transposed_i_x(engine):
    rows, inertias = bodies(4)
    lanes = np.hstack([rows, poses(4), RNG.normal(size=(4, 6))])

    def function(*x):
        R, p, a = (
            matrix(x[10:19]),
            Vec3(*x[19:22]),
            Motion(Vec3(*x[22:25]), Vec3(*x[25:28])),
        )
        moved = rigid(x).into_parent(R, p)
        return [
            *wrench(moved.apply(a)),
            *wrench(rigid(x).as_articulated().into_parent(R, p).apply(a)),
            moved.mass,
        ]

    found = evaluate(engine, function, lanes)
    for row, inertia, lane in zip(found, inertias, lanes, strict=True):
        X = motion_transform(*split_pose(lane[10:22]))
        wanted = X.T @ inertia @ X @ lane[22:]
        assert np.allclose(row[:6], wanted, rtol=0.0, atol=10 * ROUNDING)
        assert np.allclose(row[6:12], wanted, rtol=0.0, atol=10 * ROUNDING)
        assert row[12] == lane[0]


def test_two_bodies_add_as_their_matrices(engine):
    (first, one), (second, two) = bodies(3), bodies(3)
    lanes = np.hstack([first, second, RNG.normal(size=(3, 6))])

    def function(*x):
        a = Motion(Vec3(*x[20:23]), Vec3(*x[23:26]))
        return wrench((rigid(x[:10]) + rigid(x[10:20])).apply(a))

    found = evaluate(engine, function, lanes)
    wanted = [(i + j) @ lane[20:] for i, j, lane in zip(one, two, lanes, strict=True)]
    assert np.allclose(found, wanted, rtol=0.0, atol=ROUNDING)


def test_a_turning_body_feels_the_rate_of_its_own_momentum(engine):
    """The force of a body that spins about a held origin: derivative of its momentum by
    turning it a little.
    """
    rows, inertias = bodies(4)
    lanes = np.hstack([rows, RNG.normal(size=(4, 3))])
    found = evaluate(
        engine, lambda *x: wrench(rigid(x).velocity_force(Vec3(*x[10:13]))), lanes
    )
    for row, inertia, lane in zip(found, inertias, lanes, strict=True):
        w = lane[10:]
        # turns with the body: its derivative is w x
        momentum = inertia @ np.concatenate([w, np.zeros(3)])
        wanted = [*np.cross(w, momentum[:3]), *np.cross(w, momentum[3:])]
        assert np.allclose(row, wanted, rtol=0.0, atol=ROUNDING)


def articulated_rows(count):
    """Rows J (6), H (9), M (6) of a random symmetric positive definite 6x6, and the
    matrices.
    """
    rows, matrices = [], []
    for _ in range(count):
        root = RNG.normal(size=(6, 6))
        A = root @ root.T + np.eye(6)
        J, H, M = A[:3, :3], A[:3, 3:], A[3:, 3:]
        upper = [[B[0, 0], B[1, 1], B[2, 2], B[0, 1], B[0, 2], B[1, 2]] for B in (J, M)]
        rows.append([*upper[0], *H.ravel(), *upper[1]])
        matrices.append(A)
    return np.array(rows), matrices


def articulated(x):
    return ArticulatedInertia(Sym3(*x[:6]), matrix(x[6:15]), Sym3(*x[15:21]))


def test_an_articulated_inertia_applies_adds_and_moves_as_its_6x6_matrix(engine):
    rows, matrices = articulated_rows(3)
    lanes = np.hstack([rows, poses(3), RNG.normal(size=(3, 6))])

    def function(*x):
        R, p, a = (
            matrix(x[21:30]),
            Vec3(*x[30:33]),
            Motion(Vec3(*x[33:36]), Vec3(*x[36:39])),
        )
        A = articulated(x)
        return [
            *wrench(A.apply(a)),
            *wrench((A + A).apply(a)),
            *wrench(A.into_parent(R, p).apply(a)),
        ]

    found = evaluate(engine, function, lanes)
    for row, A, lane in zip(found, matrices, lanes, strict=True):
        X, a = motion_transform(*split_pose(lane[21:33])), lane[33:]
        wanted = np.concatenate([A @ a, 2.0 * A @ a, X.T @ A @ X @ a])
        assert np.allclose(row, wanted, rtol=0.0, atol=1e-12 * np.abs(wanted).max())


def test_a_joint_direction_is_eliminated_by_a_rank_one_update(engine):
    rows, matrices = articulated_rows(3)
    lanes = np.hstack([rows, RNG.normal(size=(3, 12))])

    def function(*x):
        direction, a = (
            Motion(Vec3(*x[21:24]), Vec3(*x[24:27])),
            Motion(Vec3(*x[27:30]), Vec3(*x[30:33])),
        )
        A = articulated(x)
        U = A.apply(direction)
        reduced = A.without(direction, U, 1.0 / direction.dot(U))
        return [*wrench(reduced.apply(a)), *wrench(reduced.apply(direction))]

    found = evaluate(engine, function, lanes)
    for row, A, lane in zip(found, matrices, lanes, strict=True):
        s, a = lane[21:27], lane[27:33]
        wanted = (A - np.outer(A @ s, A @ s) / (s @ A @ s)) @ a
        assert np.allclose(row[:6], wanted, rtol=0.0, atol=1e-12 * np.abs(A).max())
        assert np.allclose(row[6:], 0.0, rtol=0.0, atol=1e-12 * np.abs(A).max())


@pytest.mark.parametrize("index", range(6))
@pytest.mark.parametrize("sign", [1, -1])
def test_a_coordinate_direction_is_eliminated_to_structural_zeros(engine, index, sign):
    """What is left along the joint is nothing, exactly; the rest is the rank one
    update.
    """
    rows, matrices = articulated_rows(3)
    lanes = np.hstack([rows, RNG.normal(size=(3, 6))])
    unit = [0] * 6
    unit[index] = sign
    direction = Motion(Vec3(*unit[:3]), Vec3(*unit[3:]))

    def function(*x):
        A, a = articulated(x), Motion(Vec3(*x[21:24]), Vec3(*x[24:27]))
        U = A.apply(direction)
        reduced = A.without(direction, U, 1.0 / direction.dot(U))
        left = reduced.apply(direction)
        assert all(type(c) is int and c == 0 for c in (*left.torque, *left.force))
        return wrench(reduced.apply(a))

    found = evaluate(engine, function, lanes)
    for row, A, lane in zip(found, matrices, lanes, strict=True):
        s, a = np.array(unit, dtype=float), lane[21:]
        wanted = (A - np.outer(A @ s, A @ s) / (s @ A @ s)) @ a
        assert np.allclose(row, wanted, rtol=0.0, atol=1e-12 * np.abs(A).max())


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0, -1, 0)])
def test_an_articulated_inertia_turns_about_a_coordinate_axis_as_its_6x6_matrix(
    engine, axis
):
    """The shorter formulas for a rotation about a coordinate axis give what the general
    ones give.
    """
    rows, matrices = articulated_rows(3)
    lanes = np.hstack(
        [rows, RNG.uniform(-3.0, 3.0, size=(3, 1)), RNG.normal(size=(3, 9))]
    )

    def function(*x):
        R, p, a = (
            axis_rotation(Vec3(*axis), x[21]),
            Vec3(*x[22:25]),
            Motion(Vec3(*x[25:28]), Vec3(*x[28:31])),
        )
        return wrench(articulated(x).into_parent(R, p).apply(a))

    found = evaluate(engine, function, lanes)
    Rotation = pytest.importorskip("scipy.spatial.transform").Rotation
    for row, A, lane in zip(found, matrices, lanes, strict=True):
        R = Rotation.from_rotvec(lane[21] * np.array(axis)).as_matrix()
        X, a = motion_transform(R, lane[22:25]), lane[25:]
        wanted = X.T @ A @ X @ a
        assert np.allclose(row, wanted, rtol=0.0, atol=1e-12 * np.abs(wanted).max())


def test_a_spatial_inertia_without_mass_needs_no_division():
    nothing = SpatialInertia.of_body(0.0, Vec3(1.0, 2.0, 3.0), Sym3(0, 0, 0))
    moved = nothing.into_parent(Mat3.identity(), Vec3(1.0, 0.0, 0.0))
    assert (
        wrench(moved.apply(Motion(Vec3(1.0, 2.0, 3.0), Vec3(4.0, 5.0, 6.0))))
        == [0.0] * 6
    )
