"""Edges of boxes: depths against the least distance by SciPy, who pushes whom, and
stacks that stood on nothing.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.optimize import linprog, minimize
from scipy.spatial.transform import Rotation

from skyarm.algebra import Mat3, Vec3
from skyarm.dynamics.point_motion import PointMotion
from skyarm.world.contact import Contact, FreeObject, Surface
from skyarm.world.contact.box_edges import (
    EDGE_PAIRS,
    PlacedBox,
    edge_touches,
    face_overlap,
)
from support.worlds import AWAY, BIRD, GRAVITY, Scene

SIZE = np.array([0.1, 0.08, 0.06])


def placed(middle, R, halves=0.5 * SIZE):
    return PlacedBox(
        Vec3(*map(float, middle)),
        Mat3(*(tuple(map(float, row)) for row in R)),
        tuple(halves.tolist()),
    )


def crossed(depth, turn, away=(0.0, 0.0)):
    """Two boxes, an edge along x on an edge along y, both with a ridge up or down; the
    upper one away along both.
    """
    R = np.array(
        [
            Rotation.from_euler("x", 45, degrees=True).as_matrix(),
            Rotation.from_euler("y", 45, degrees=True).as_matrix(),
        ]
    )
    ridge = [
        0.5 * (SIZE[1] + SIZE[2]) / math.sqrt(2.0),
        0.5 * (SIZE[0] + SIZE[2]) / math.sqrt(2.0),
    ]
    between = np.array([*away, ridge[0] + ridge[1] - depth])
    T = turn.as_matrix()
    return placed(T @ between, T @ R[0]), placed(np.zeros(3), T @ R[1])


def deepest(a, b):
    place, depth, normal = max(edge_touches(a, b), key=lambda each: float(each[1]))
    return np.array([*place]), float(depth), np.array([*normal])


def matrices(box):
    R = np.array([[float(c) for c in row] for row in box.rotation.rows])
    return np.array([*map(float, box.middle)]), R, np.array(box.halves)


def distance(a, b):
    """Least distance (m) of two boxes apart: SciPy over the six coordinates in them."""
    (p, P, h), (q, Q, g) = matrices(a), matrices(b)
    best = math.inf
    for start in (np.zeros(6), *np.random.default_rng(0).uniform(-0.9, 0.9, (4, 6))):

        def way(x):
            r = p + P @ (x[:3] * h) - q - Q @ (x[3:] * g)
            return 1e4 * r @ r

        found = minimize(
            way,
            start,
            bounds=[(-1.0, 1.0)] * 6,
            method="L-BFGS-B",
            options={"ftol": 1e-16, "gtol": 1e-12},
        )
        best = min(best, math.sqrt(max(found.fun, 0.0) / 1e4))
    return best


def parted(a, b, way):
    """True if the boxes are apart after one has gone a way: no point is in both, by
    linear programming.
    """
    (p, P, h), (q, Q, g) = matrices(a), matrices(b)
    rows = np.vstack([P.T, -P.T, Q.T, -Q.T])
    p = p + way
    room = np.concatenate([h + P.T @ p, h - P.T @ p, g + Q.T @ q, g - Q.T @ q])
    return (
        linprog(np.zeros(3), A_ub=rows, b_ub=room, bounds=[(None, None)] * 3).status
        == 2
    )


TURNS = [Rotation.identity(), *Rotation.random(3, random_state=4)]


@pytest.mark.parametrize("turn", TURNS)
def test_edges_that_cross_overlap_as_far_as_must_be_gone_to_part_them(turn):
    """Along the normal the depth and 1 um more parts them, 1 um less does not; apart it
    is the distance.
    """
    for depth in (1e-4, 2e-3):
        a, b = crossed(depth, turn)
        _, found, normal = deepest(a, b)
        assert found == pytest.approx(depth, abs=1e-9)
        assert normal == pytest.approx(turn.as_matrix() @ [0.0, 0.0, 1.0], abs=1e-9)
        assert parted(a, b, normal * (found + 1e-6))
        assert not parted(a, b, normal * (found - 1e-6))
        assert not parted(a, b, 0.99 * found * turn.as_matrix() @ [0.6, 0.0, 0.8])
    a, b = crossed(-3e-3, turn)
    assert deepest(a, b)[1] == pytest.approx(-distance(a, b), abs=1e-7)


@pytest.mark.parametrize("turn", TURNS[:2])
def test_each_pushes_the_other_the_other_way_at_the_same_place(turn):
    a, b = crossed(1e-3, turn, (0.01, -0.008))
    ours, theirs = list(edge_touches(a, b)), list(edge_touches(b, a))
    assert len(ours) == len(theirs) == EDGE_PAIRS
    for one in ours:
        twin = [
            each
            for each in theirs
            if abs(float(each[1] - one[1])) < 1e-12
            and np.allclose([*each[0]], [*one[0]], atol=1e-12)
        ]
        assert any(
            np.allclose([*each[2]], [-float(c) for c in one[2]], atol=1e-9)
            for each in twin
        )
    assert float(face_overlap(a, b)) == pytest.approx(
        float(face_overlap(b, a)), abs=1e-15
    )


def largest_change(turn, way, spin, speed, count):
    """Largest change of the sum of what pushes, from one of so many instants of a
    motion to the next, m.
    """
    found = []
    for t in np.linspace(0.0, 0.02, count):
        a = placed(way + t * speed, (Rotation.from_rotvec(t * spin) * turn).as_matrix())
        touches = edge_touches(a, placed(np.zeros(3), np.eye(3)))
        found.append(
            sum(
                max(float(depth), 0.0) * np.array([*normal])
                for _, depth, normal in touches
            )
        )
    return np.abs(np.diff(found, axis=0)).max()


def test_depths_of_boxes_that_move_are_continuous():
    """About a stack, turned and tilted: in eight times as small parts of a motion they
    change by far less.
    """
    rng = np.random.default_rng(7)
    for _ in range(6):
        turn, way = (
            Rotation.from_rotvec(rng.normal(size=3) * [0.02, 0.02, 1.0]),
            rng.normal(size=3) * 0.002,
        )
        motion = (
            turn,
            way + np.array([0.0, 0.0, 0.0595]),
            rng.normal(size=3),
            0.1 * rng.normal(size=3),
        )
        assert largest_change(*motion, 161) < 0.3 * largest_change(*motion, 21) + 1e-9


def test_edges_nearly_parallel_are_met_where_they_are():
    """They cross far away, where a body that turns is swift: the place stays on
    them.
    """
    R = Rotation.from_rotvec([1e-5, -2e-5, 3e-6]).as_matrix()
    for place, _, normal in edge_touches(
        placed([0.0, 0.0, 0.06], R), placed(np.zeros(3), np.eye(3))
    ):
        assert max(abs(float(c)) for c in place) < 0.2
        assert float(normal.dot(normal)) < 1.0 + 1e-9


def stack(*objects):
    return Contact(surfaces=(Surface(name="ground"),), objects=objects)


def block(name, size, position, angles=(0.0, 0.0, 0.0), mass=0.4):
    return FreeObject(
        name=name, size=size, mass=mass, position=Vec3(*position), angles=Vec3(*angles)
    )


CUBE, PLANK, ACROSS = (0.1, 0.1, 0.1), (0.06, 0.3, 0.06), (0.3, 0.06, 0.06)


@pytest.mark.parametrize(
    ("lower", "upper"),
    [
        (
            block("lower", CUBE, (0.0, 0.0, 0.05)),
            block("upper", CUBE, (0.0, 0.0, 0.15)),
        ),
        (
            block("lower", CUBE, (0.0, 0.0, 0.05)),
            block("upper", CUBE, (0.0, 0.0, 0.15), (0.0, 0.0, 0.4)),
        ),
        (
            block("lower", PLANK, (0.0, 0.0, 0.03)),
            block("upper", ACROSS, (0.0, 0.0, 0.09)),
        ),
        (
            block("lower", PLANK, (0.0, 0.0, 0.03)),
            block("upper", ACROSS, (0.02, 0.05, 0.09), (0.0, 0.0, 0.5)),
        ),
    ],
)
def test_equal_boxes_and_crossed_planks_push_each_other_apart(lower, upper):
    """Pressed 0.1 mm into each other: upwards on four places or more, opposite, and
    level but for what is sideways.
    """
    lower = dataclasses.replace(lower, position=lower.position + Vec3(0.0, 0.0, 1.0))
    upper = dataclasses.replace(
        upper, position=upper.position + Vec3(0.0, 0.0, 1.0 - 1e-4)
    )
    contact = stack(lower, upper)
    memory = contact.start(0.005, ())
    assert len(memory.bristles) == contact.meeting_count
    meetings = contact.meetings(memory, PointMotion(BIRD, AWAY))
    up = [
        each.touch.normal
        for each in meetings
        if each.by == 1 and each.of == 0 and abs(each.touch.axis.z) > 0.99
    ]
    assert sum(float(each) > 0.4 for each in up) >= 4
    pushes = contact.on_carriers(memory, PointMotion(BIRD, AWAY), meetings, 0.0)
    assert [*pushes[0][0]] == pytest.approx(
        [-float(c) for c in pushes[1][0]], abs=1e-12
    )
    assert float(pushes[1][0].z) > 1.9


@pytest.mark.thorough
def test_a_plank_lies_across_another_and_a_box_on_one_of_its_size():
    """Set down from 0.3 mm: after 2 s they lie still, about as deep as the weight
    presses them.
    """
    for lower, upper in (
        (
            block("lower", CUBE, (0.0, 0.0, 0.05)),
            block("upper", CUBE, (0.0, 0.0, 0.1503)),
        ),
        (
            block("lower", PLANK, (0.0, 0.0, 0.03)),
            block("upper", ACROSS, (0.0, 0.0, 0.0903), (0.0, 0.0, 0.3)),
        ),
    ):
        _, rows = Scene(stack(lower, upper)).fly(stack(lower, upper), 2.0)
        rest = float(upper.position.z) - 3e-4
        weight = 0.4 * GRAVITY
        assert (
            rest - 2.0 * weight / (4.0 * 5000.0) - weight / (4.0 * 5000.0) - 2e-5
            < rows[-1, 1, 2]
            < rest
        )
        assert np.abs(rows[-1, :, 7:13]).max() < 2e-3
        assert (
            np.abs(
                rows[-1, 1, :2] - [float(upper.position.x), float(upper.position.y)]
            ).max()
            < 1e-4
        )


def written_depths(a, b):
    """Depths of all pairs of edges as the module's docstring has them; where edges
    cross, by least squares.
    """
    (p, P, h), (q, Q, g) = matrices(a), matrices(b)
    between, pairs = p - q, []

    def overlap_along(n):
        return h @ np.abs(P.T @ n) + g @ np.abs(Q.T @ n) - abs(n @ between)

    def facing(R, halves, i, way):
        """The edge along i that reaches farthest, and the one across the face that is
        squarer to the way.
        """
        off = {
            k: np.copysign(halves[k], R[:, k] @ way) * R[:, k]
            for k in range(3)
            if k != i
        }
        flat, steep = sorted(off, key=lambda k: abs(R[:, k] @ way))
        return (off[flat] + off[steep], math.inf), (
            off[steep] - off[flat],
            0.05 * (0.2 - abs(R[:, flat] @ way)),
        )

    least = min(overlap_along(n) for n in (*P.T, *Q.T))
    for i in range(3):
        for j in range(3):
            u, v = P[:, i], Q[:, j]
            n = np.cross(u, v)
            sine = np.linalg.norm(n)
            n = n / sine * (1.0 if n @ between >= 0.0 else -1.0)
            if sine > 0.05:
                least = min(least, overlap_along(n))
            for off, room in facing(P, h, i, -n):
                for to, other in facing(Q, g, j, n):
                    r = between + off - to
                    depth = -(r @ n)
                    s, t = np.linalg.lstsq(np.column_stack([u, -v]), -r, rcond=None)[0]
                    end = max(depth, 1e-3)
                    inside = min(h[i] + end - abs(s), g[j] + end - abs(t)) * sine
                    pairs.append((depth, min(inside, room, other)))
    behind = [3.0 * least - depth for depth, _ in pairs]
    return [
        min(*pair, each if least > 0.0 else 0.25 * each)
        for pair, each in zip(pairs, behind, strict=True)
    ]


def test_depths_are_those_of_the_rules():
    """Of 60 pairs of boxes near each other, tilted by little and by much; edges cross
    at 0.01 rad at least.
    """
    rng, size = np.random.default_rng(23), 0.5 * SIZE
    for k in range(60):
        spread = 0.15 if k % 2 else 1.0
        P, Q = (
            Rotation.from_rotvec(spread * rng.normal(size=3)).as_matrix()
            for _ in range(2)
        )
        a, b = (
            placed(rng.normal(size=3) * [0.03, 0.03, 0.004] + [0.0, 0.0, 0.062], P),
            placed(np.zeros(3), Q, size),
        )
        found = [float(depth) for _, depth, _ in edge_touches(a, b)]
        assert found == pytest.approx(written_depths(a, b), abs=1e-8)
    # apart across two edges: their normal parts them where they are not nearly parallel
    for sine in (0.048, 0.052):
        R = Rotation.from_rotvec([0.0, 0.6 * sine, 0.8 * sine]).as_matrix()
        a, b = placed([0.0, 0.084, 0.064], R), placed(np.zeros(3), np.eye(3))
        found = [float(depth) for _, depth, _ in edge_touches(a, b)]
        assert found == pytest.approx(written_depths(a, b), abs=1e-8)
