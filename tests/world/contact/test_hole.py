"""A plate with a hole against the nearest of many points on its skin; what stands in
it, and what is refused.
"""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from skyarm.algebra import Vec3
from skyarm.world.contact import Surface

SIZE = (0.02, 0.03, 0.004, 0.06, 0.05)
PLACED = {"position": (0.3, -0.2, 0.5), "angles": (0.4, -0.7, 1.1)}


@cache
def skin():
    """Points of the section, less than 0.05 mm apart: (N, 2)."""
    radius, depth, chamfer, outer, length = SIZE
    corners = [
        (0, -depth),
        (radius, -depth),
        (radius, -chamfer),
        (radius + chamfer, 0),
        (outer, 0),
        (outer, -length),
        (0, -length),
    ]
    line = [np.linspace(a, b, 1401) for a, b in pairwise(corners)]
    return np.concatenate(line)


def nearest_on_skin(away, z):
    section = skin()
    return section[np.argmin((section[:, 0] - away) ** 2 + (section[:, 1] - z) ** 2)]


def is_solid(away, z):
    """By the words of the shape: within the plate, and not in the cylinder or the cone
    of the hole.
    """
    radius, depth, chamfer, outer, length = SIZE
    cylinder = away < radius and z > -depth
    cone = z > -chamfer and away < radius + chamfer + z
    return away < outer and -length < z < 0.0 and not cylinder and not cone


def drawn(count):
    rng = np.random.default_rng(4)
    return [
        (
            rng.uniform(0.0, 0.08),
            rng.uniform(-0.07, 0.03),
            rng.uniform(-math.pi, math.pi),
        )
        for _ in range(count)
    ]


def test_it_is_as_far_as_the_nearest_of_many_points_and_the_normal_leads_there():
    plate, seen = Surface(name="s", shape="hole", size=SIZE, **PLACED), set()
    R = np.array([[float(c) for c in plate.rotation.column(i)] for i in range(3)]).T
    for away, z, angle in drawn(250):
        round_about = np.array([math.cos(angle), math.sin(angle), 0.0])
        place = R @ (away * round_about + [0, 0, z]) + PLACED["position"]
        depth, normal = plate.depth(Vec3(*place.tolist()), 0, 0.0)
        near = nearest_on_skin(away, z)
        distance = math.hypot(near[0] - away, near[1] - z)
        solid = is_solid(away, z)
        assert float(depth) == pytest.approx(distance if solid else -distance, abs=2e-5)
        outward = (near - (away, z)) * (1.0 if solid else -1.0) / distance
        expected = R @ (outward[0] * round_about + [0, 0, outward[1]])
        if distance > 1e-3:
            assert [float(c) for c in normal] == pytest.approx(expected, abs=0.03)
        seen.add((solid, *np.round(near, 2)))
        ball = plate.depth(Vec3(*place.tolist()), 0.005, 0.0)[0]
        assert float(ball) == pytest.approx(float(depth) + 0.005, abs=1e-15)
    assert len(seen) > 12, "every face and corner was the nearest one of some"


@pytest.mark.parametrize(
    ("place", "depth", "normal"),
    [
        ((0.0, 0.0, -0.03), 0.0, (0, 0, 1)),
        ((0.005, 0.0, -0.0302), 0.0002, (0, 0, 1)),
        ((0.0, 0.0201, -0.015), 0.0001, (0, -1, 0)),
        ((-0.0201, 0.0, -0.015), 0.0001, (1, 0, 0)),
        ((0.02, 0.0, -0.015), 0.0, (-1, 0, 0)),
        ((0.022 + 1e-4, 0.0, -0.002), 1e-4 / 2**0.5, (-(0.5**0.5), 0, 0.5**0.5)),
        ((0.05, 0.0, -0.001), 0.001, (0, 0, 1)),
        ((0.0605, 0.0, -0.02), -0.0005, (1, 0, 0)),
        ((0.01, 0.0, -0.0495), 0.0005, (0, 0, -1)),
        ((0.023, 0.0, -0.034), 0.005, (-0.6, 0, 0.8)),
        ((0.0, 0.0, 0.1), -math.hypot(0.024, 0.1), None),
    ],
)
def test_faces_are_where_the_size_says(place, depth, normal):
    """Bottom, wall, chamfer, top, outside, below; in the corner of wall and bottom by
    the way to the corner.
    """
    found, n = Surface(name="s", shape="hole", size=SIZE).depth(
        Vec3(*map(float, place)), 0, 0.0
    )
    assert float(found) == pytest.approx(depth, abs=1e-11)
    if normal is not None:
        assert [float(c) for c in n] == pytest.approx(normal, abs=1e-6)


def test_a_micrometre_of_chamfer_is_enough():
    plate = Surface(name="s", shape="hole", size=(0.02, 0.03, 1e-6, 0.06, 0.05))
    assert float(plate.depth(Vec3(0.021, 0.0, -0.0005), 0, 0.0)[0]) == pytest.approx(
        0.0005, abs=1e-9
    )


def test_a_disc_is_held_off_the_plate_as_if_its_hole_were_filled():
    plate = Surface(name="s", shape="hole", size=SIZE)
    above = plate.clearance(Vec3(0.0, 0.0, 0.02), Vec3(0.0, 0.0, 1.0), 0.01, 0.0)
    assert float(above) == pytest.approx(0.02, abs=1e-9)
    assert (
        float(plate.clearance(Vec3(0.0, 0.0, -0.01), Vec3(0.0, 0.0, 1.0), 0.01, 0.0))
        < 0.0
    )
    assert float(
        plate.clearance(Vec3(0.0, 0.0, -0.06), Vec3(0.0, 0.0, 1.0), 0.01, 0.0)
    ) == pytest.approx(0.01)
    for x, y in ((0.06, -0.08), (0.08, 0.06)):
        assert float(
            plate.clearance(Vec3(x, y, -0.02), Vec3(0.0, 0.0, 1.0), 0, 0.0)
        ) == pytest.approx(0.04)
    assert plate.farthest == pytest.approx(math.hypot(0.06, 0.05))


@pytest.mark.parametrize(
    ("size", "words"),
    [
        ((0.02, 0.03, 0.03, 0.06, 0.05), "chamfer must be below depth"),
        ((0.02, 0.03, 0.004, 0.024, 0.05), "outer radius must be above"),
        ((0.02, 0.05, 0.004, 0.06, 0.05), "length must be above depth"),
        (
            (0.02, 0.03),
            "must be 5 numbers, radius, depth, chamfer, outer radius, length",
        ),
        ((0.02, 0.03, 0.0, 0.06, 0.05), "above 0"),
        ((0.02, 0.03, 0.9e-6, 0.06, 0.05), "must be 1e-06 m each, or more"),
    ],
)
def test_holes_that_leave_no_material_are_refused(size, words):
    with pytest.raises(ValueError, match=words):
        Surface(name="s", shape="hole", size=size)
