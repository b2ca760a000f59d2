"""Convex hulls against those of SciPy (Qhull): volume, faces, and what a hull of few
corners leaves out.
"""

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from skyarm.algebra import ZERO3, Vec3
from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.convex_hull import convex_hull
from skyarm.vehicle.vehicle_records import Collision


def cloud(kind, seed):
    draw = np.random.default_rng(seed)
    if kind == "ball":
        points = draw.normal(size=(150, 3)) * [1.0, 0.3, 0.05]
    elif kind == "float32":
        points = draw.normal(size=(150, 3)).astype(np.float32).astype(float)
    elif kind == "grid":  # many points in each face and along each edge
        ticks = np.linspace(0.0, 1.0, 5)
        points = np.stack(np.meshgrid(ticks, 2 * ticks, ticks / 3), -1).reshape(-1, 3)
    else:  # whole rims in one plane
        turns = np.arange(40) * np.pi / 20
        rim = np.column_stack([np.cos(turns), np.sin(turns), 0.0 * turns])
        points = np.concatenate([rim, np.add(rim, [0.0, 0.0, 3.0])])
    turn = Rotation.random(random_state=seed).as_matrix()
    return points @ turn.T * 10.0 ** draw.uniform(-3, 2) + draw.normal(size=3)


def volume(points, faces):
    """Volume within triangles; negative if they are seen from inside."""
    middle = points.mean(axis=0)
    a, b, c = (points[faces[:, k]] - middle for k in range(3))
    return float((a * np.cross(b, c)).sum()) / 6.0


@pytest.mark.parametrize("kind", ["ball", "float32", "grid", "rims"])
@pytest.mark.parametrize("seed", range(5))
def test_a_hull_has_the_volume_of_qhulls_and_closed_outward_faces(kind, seed):
    points = cloud(kind, seed)
    corners, faces, left = convex_hull(points, len(points))
    whole = ConvexHull(points)
    assert volume(points, faces) == pytest.approx(whole.volume, rel=1e-9)
    assert ConvexHull(points[corners]).volume == pytest.approx(whole.volume, rel=1e-9)
    # Euler's formula, and each edge once in each direction
    assert len(faces) == 2 * len(corners) - 4
    edges = {
        (i, j) for f in faces.tolist() for i, j in zip(f, f[1:] + f[:1], strict=True)
    }
    assert len(edges) == 3 * len(faces)
    assert {(j, i) for i, j in edges} == edges
    assert left <= 1e-6 * np.ptp(points)


@pytest.mark.parametrize("seed", range(5))
def test_few_corners_lie_within_the_hull_at_the_stated_height(seed):
    points = cloud("ball", seed)
    corners, _, left = convex_hull(points, 12)
    assert len(corners) == 12
    whole = ConvexHull(points)
    assert set(corners) <= set(whole.vertices)
    few = ConvexHull(points[corners])
    normals, offsets = few.equations[:, :3], few.equations[:, 3]
    assert left == pytest.approx((points @ normals.T + offsets).max(), rel=1e-6)
    # more corners leave less out, and the first ones stay
    more, _, less = convex_hull(points, 24)
    assert less < left
    assert set(corners) < set(more)


def test_a_hull_turns_and_moves_with_its_points():
    points = cloud("ball", 7)
    turned = points @ Rotation.random(random_state=1).as_matrix().T + [3.0, 1.0, 2.0]
    first, second = convex_hull(points, 20), convex_hull(turned, 20)
    assert (first[0] == second[0]).all()
    assert first[2] == pytest.approx(second[2], rel=1e-9)


@pytest.mark.parametrize(
    "points",
    [
        [[1.0, 2.0, 3.0]],
        [[1.0, 2.0, 3.0]] * 9,
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [5.0, 0.0, 0.0]],
        [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1.0, 1.0, 1.0]],
    ],
)
def test_points_without_a_volume_have_no_hull(points):
    with pytest.raises(ValueError, match="in one plane: must have a volume"):
        convex_hull(np.array(points), 32)
    corners = tuple(Vec3(*each) for each in points)
    said = r"collisions\[x\].vertices = \d points: must be four"
    with pytest.raises(VehicleError, match=said):
        Collision(name="x", link=-1, position=ZERO3, shape="hull", vertices=corners)
