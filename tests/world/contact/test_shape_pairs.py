"""Places at which two shapes touch, against MuJoCo's distance of geoms (GJK and EPA)
and the symmetry of the pair.
"""

import itertools

import mujoco
import numpy as np
import pytest

from skyarm.algebra import Mat3, Vec3
from skyarm.world.contact.shape_pairs import PlacedShape, places
from skyarm.world.contact.surface import Surface

KINDS = ("sphere", "capsule", "box", "cylinder", "hull")

DEEP = 5e-4
"""Penetration (m) at which pairs are compared: that of some newtons."""


def drawn_shape(kind, rng):
    """A shape of a kind, 5 to 40 cm large."""
    a, b, c = map(float, rng.uniform(0.05, 0.2, 3))
    if kind == "disc":
        return Surface(name="a", shape="cylinder", size=(1.5 * a, 0.5 * b))
    if kind == "hull":
        corners = [Vec3(*map(float, each)) for each in 0.06 * rng.normal(size=(10, 3))]
        return Surface(name="a", shape=kind, vertices=tuple(corners))
    sizes = {"sphere": (a,), "box": (a, b, c)}
    return Surface(name="a", shape=kind, size=sizes.get(kind, (0.4 * a, 2.0 * b)))


def geom_of(shape, name):
    """The shape as MuJoCo has it: an asset and a geom."""
    if shape.shape == "hull":
        numbers = " ".join(repr(float(c)) for each in shape.vertices for c in each)
        mesh = f'<mesh name="{name}" vertex="{numbers}"/>'
        return mesh, f'<geom type="mesh" mesh="{name}"/>'
    half = {"box": (0.5, 0.5, 0.5), "sphere": (1.0,)}.get(shape.shape, (1.0, 0.5))
    size = " ".join(repr(x * y) for x, y in zip(shape.size, half, strict=True))
    return "", f'<geom type="{shape.shape}" size="{size}"/>'


def pushed_together(a, b, rng):
    """Both shapes in a drawn attitude, so near that MuJoCo sees them ``DEEP`` in each
    other.
    """
    (mesh_a, geom_a), (mesh_b, geom_b) = geom_of(a, "a"), geom_of(b, "b")
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><asset>{mesh_a}{mesh_b}</asset><worldbody>"
        f"<body><freejoint/>{geom_a}</body><body><freejoint/>{geom_b}</body>"
        "</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    turns = rng.normal(size=(2, 4))
    turns /= np.linalg.norm(turns, axis=1)[:, None]
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)

    def distance(apart):
        data.qpos[:] = [*(way * apart), *turns[0], 0.0, 0.0, 0.0, *turns[1]]
        mujoco.mj_kinematics(model, data)
        return mujoco.mj_geomDistance(model, data, 0, 1, 1.0, None)

    low, high = 0.0, 1.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if distance(middle) > 0.0 else (middle, high)
    deep = -distance(high - DEEP)
    placed = []
    for shape, i in ((a, 1), (b, 2)):
        rows = data.xmat[i].reshape(3, 3).tolist()
        at = Vec3(*map(float, data.xpos[i]))
        placed.append(PlacedShape(shape, Mat3(*(Vec3(*row) for row in rows)), at))
    return placed, deep


EXACT = [
    *itertools.product(("sphere",), KINDS),
    *itertools.product(("capsule",), ("capsule", "box", "cylinder", "hull")),
    *itertools.product(("cylinder", "disc"), ("cylinder", "disc")),
    ("cylinder", "box"),
    ("box", "box"),
]


@pytest.mark.parametrize(("one", "other"), EXACT)
def test_the_deepest_place_of_two_shapes_is_that_of_mujoco(one, other):
    rng = np.random.default_rng(len(one) + 10 * len(other))
    for _ in range(12):
        pair, deep = pushed_together(
            drawn_shape(one, rng), drawn_shape(other, rng), rng
        )
        found = max(float(depth) for _, depth, _ in places(*pair))
        # an end and the line between both share a capsule's depth
        assert deep - 2.5e-4 < found < deep + 2e-5


@pytest.mark.parametrize(
    ("one", "other", "deeper"),
    [
        ("cylinder", "box", 2e-5),
        ("cylinder", "cylinder", 2e-5),
        ("disc", "box", 2e-5),
        ("disc", "disc", 2e-5),
        ("hull", "box", 3e-3),
        ("hull", "hull", 3e-3),
    ],
)
def test_no_pair_with_corners_touches_deeper_than_in_mujoco(one, other, deeper):
    rng = np.random.default_rng(3)
    for _ in range(40 if "disc" in (one, other) else 12):
        pair, deep = pushed_together(
            drawn_shape(one, rng), drawn_shape(other, rng), rng
        )
        # edges of hulls do not meet edges: then the depth is less, never more
        assert max(float(depth) for _, depth, _ in places(*pair)) < deep + deeper


@pytest.mark.parametrize(("one", "other"), [*itertools.combinations(KINDS, 2)])
def test_two_shapes_touch_at_the_same_places_in_either_order(one, other):
    rng = np.random.default_rng(4)
    (a, b), _ = pushed_together(drawn_shape(one, rng), drawn_shape(other, rng), rng)
    ours = {tuple(np.round([*p, d, *n], 9) + 0.0) for p, d, n in places(a, b)}
    theirs = {
        tuple(np.round([*p, d, *(-c for c in n)], 9) + 0.0) for p, d, n in places(b, a)
    }
    assert ours == theirs


def upright(shape, height, **size):
    rows = np.eye(3).tolist()
    made = Surface(name="s", shape=shape, **size)
    return PlacedShape(
        made, Mat3(*(Vec3(*row) for row in rows)), Vec3(0.0, 0.0, height)
    )


@pytest.mark.parametrize(
    ("shape", "size", "half", "count"),
    [
        ("sphere", (0.1,), 0.1, 1),
        ("capsule", (0.05, 0.2), 0.15, 1),
        ("box", (0.2, 0.3, 0.1), 0.05, 4),
        ("cylinder", (0.1, 0.2), 0.1, 3),
    ],
)
def test_a_shape_stands_on_a_plane_on_its_lowest_places(shape, size, half, count):
    body, plane = upright(shape, half - 1e-3, size=size), upright("plane", 0.0)
    touching = [each for each in places(body, plane) if each[1] > 0.0]
    assert len(touching) == count
    assert [float(depth) for _, depth, _ in touching] == pytest.approx([1e-3] * count)
    assert all(tuple(normal) == (0, 0, 1) for _, _, normal in touching)


def test_a_capsule_lies_on_both_ends_of_what_is_above_a_box():
    rows = (Vec3(0.0, 0.0, -1.0), Vec3(0.0, 1.0, 0.0), Vec3(1.0, 0.0, 0.0))
    capsule = PlacedShape(
        Surface(name="s", shape="capsule", size=(0.02, 0.4)),
        Mat3(*rows),
        Vec3(0.05, 0.0, 0.119),
    )
    found = places(capsule, upright("box", 0.0, size=(0.3, 0.2, 0.2)))
    assert sorted(round(float(place.x), 6) for place, _, _ in found) == [-0.15, 0.15]
    assert [float(depth) for _, depth, _ in found] == pytest.approx([1e-3, 1e-3])


def test_a_disc_lies_on_a_bar_at_both_ends_of_the_part_below_it():
    rows = (Vec3(0.0, 0.0, -1.0), Vec3(0.0, 1.0, 0.0), Vec3(1.0, 0.0, 0.0))
    bar = PlacedShape(
        Surface(name="s", shape="capsule", size=(0.02, 0.6)),
        Mat3(*rows),
        Vec3(0.0, 0.06, -0.019),
    )
    found = places(upright("cylinder", 0.03, size=(0.1, 0.06)), bar)
    deep = [(round(float(at.x), 6), float(d)) for at, d, _ in found if d > 1e-6]
    assert [x for x, _ in sorted(deep)] == [-0.08, 0.08]
    assert [depth for _, depth in deep] == pytest.approx([1e-3, 1e-3])


def test_a_short_capsule_lies_on_a_long_one_at_both_ends():
    rows = (Vec3(0.0, 0.0, -1.0), Vec3(0.0, 1.0, 0.0), Vec3(1.0, 0.0, 0.0))
    long, short = (
        PlacedShape(
            Surface(name="s", shape="capsule", size=(0.02, length)),
            Mat3(*rows),
            Vec3(0.05 * at, 0.0, height),
        )
        for length, at, height in ((0.3, 0.0, 0.0), (0.1, 1.0, 0.039))
    )
    for pair in ((long, short), (short, long)):
        touching = [each for each in places(*pair) if each[1] > 1e-9]
        assert sorted(round(float(at.x), 6) for at, _, _ in touching) == [0.0, 0.1]
